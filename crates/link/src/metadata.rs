//! Who a firmware image is: a block of fixed layout in a section of its own of the ELF file.
//!
//! The file and the hello of the running device take their values from the same constants, so a host can tell
//! before flashing whether it will be able to talk to the image, and afterwards whether the device runs that image.
//!
//! ```text
//!   0  magic "TACTUS" and layout version u16 (1)      36  firmware version and revision, 48 bytes, zero-padded UTF-8
//!   8  link version u16                               84  board, 32 bytes, likewise
//!  10  flags u16: bit 0 simulated board              116  CRC-32/ISCSI u32 over bytes 0 to 115
//!  12  schema hash u32                               120  end
//!  16  robot model hash u32
//!  20  image region: address u32, bytes u32
//!  28  store region: address u32, bytes u32; 0 bytes if the store is elsewhere
//! ```
//! Little endian. The layout version changes with any change; readers refuse what they do not know.

use core::fmt;

use crate::frame::CRC;

/// Name of the ELF section.
pub const METADATA_SECTION: &str = ".tactus";

/// Bytes of the block.
pub const METADATA_BYTES: usize = 120;

const MAGIC: [u8; 6] = *b"TACTUS";
const LAYOUT: u16 = 1;
const FIRMWARE_AT: usize = 36;
const FIRMWARE_BYTES: usize = 48;
const BOARD_AT: usize = FIRMWARE_AT + FIRMWARE_BYTES;
const BOARD_BYTES: usize = 32;
const CRC_AT: usize = BOARD_AT + BOARD_BYTES;
const SIMULATED: u16 = 1;
const KNOWN_FLAGS: u16 = SIMULATED;

/// The chip on a real board, by the name under which debug probes' tools know it; `None` for boards that have none.
#[must_use]
pub fn chip(board: &str) -> Option<&'static str> {
    match board {
        "nucleo-h743zi2" => Some("STM32H743ZITx"),
        _ => None,
    }
}

/// A stretch of the device's address space.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct MemoryRegion {
    /// Address of the first byte.
    pub start: u32,
    /// Bytes.
    pub length: u32,
}

impl MemoryRegion {
    /// True if `length` bytes from `start` on lie inside.
    #[must_use]
    pub const fn contains(&self, start: u32, length: u32) -> bool {
        start >= self.start && (start - self.start) as u64 + length as u64 <= self.length as u64
    }
}

/// The description of an image, in its own file.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ImageMetadata<'a> {
    /// [`crate::LINK_VERSION`] of the image.
    pub link_version: u16,
    /// For an emulated board: must not be flashed on a real one, nor be mistaken for an arm.
    pub simulated: bool,
    /// [`crate::SCHEMA_HASH`] of the image.
    pub schema_hash: u32,
    /// Hash of the robot model in the image.
    pub model_hash: u32,
    /// Where the image lies in the flash, and may be erased and written by whoever flashes it.
    pub image: MemoryRegion,
    /// Where the device keeps its primitives; whoever flashes an image must leave it alone. `None` if that is not in
    /// the device's address space.
    pub store: Option<MemoryRegion>,
    /// Firmware version and git revision, at most 48 bytes.
    pub firmware: &'a str,
    /// Board, at most 32 bytes.
    pub board: &'a str,
}

/// Why a block could not be read.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum MetadataError {
    /// It is shorter than a block.
    Short,
    /// It does not begin as a block does.
    Magic,
    /// It has a layout this version does not know.
    Layout(u16),
    /// Its check sum is wrong.
    Crc,
    /// It has flags this version does not know.
    Flags(u16),
    /// Its names are not text, or not padded with zeros.
    Text,
}

impl fmt::Display for MetadataError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Short => f.write_str("the description of the image is cut short"),
            Self::Magic => f.write_str("the description of the image does not begin as one"),
            Self::Layout(layout) => {
                write!(f, "the description of the image has layout {layout}; this version reads {LAYOUT}")
            }
            Self::Crc => f.write_str("the description of the image is damaged"),
            Self::Flags(flags) => {
                write!(
                    f,
                    "the description of the image has flags {flags:#06x}, of which this version does not know all"
                )
            }
            Self::Text => f.write_str("the description of the image holds names that are not text"),
        }
    }
}

impl core::error::Error for MetadataError {}

impl<'a> ImageMetadata<'a> {
    /// The block, made by the compiler: a name that is too long stops the build.
    ///
    /// # Panics
    /// While compiling, if a name is longer than its place.
    #[must_use]
    pub const fn encode(&self) -> [u8; METADATA_BYTES] {
        assert!(self.firmware.len() <= FIRMWARE_BYTES && self.board.len() <= BOARD_BYTES, "a name is too long");
        let mut block = [0; METADATA_BYTES];
        put(&mut block, 0, &MAGIC);
        put(&mut block, 6, &LAYOUT.to_le_bytes());
        put(&mut block, 8, &self.link_version.to_le_bytes());
        put(&mut block, 10, &(if self.simulated { SIMULATED } else { 0 }).to_le_bytes());
        put(&mut block, 12, &self.schema_hash.to_le_bytes());
        put(&mut block, 16, &self.model_hash.to_le_bytes());
        put(&mut block, 20, &self.image.start.to_le_bytes());
        put(&mut block, 24, &self.image.length.to_le_bytes());
        if let Some(store) = self.store {
            put(&mut block, 28, &store.start.to_le_bytes());
            put(&mut block, 32, &store.length.to_le_bytes());
        }
        put(&mut block, FIRMWARE_AT, self.firmware.as_bytes());
        put(&mut block, BOARD_AT, self.board.as_bytes());
        let (covered, _) = block.split_at(CRC_AT);
        let crc = CRC.checksum(covered);
        put(&mut block, CRC_AT, &crc.to_le_bytes());
        block
    }

    /// Reads a block; bytes behind it are ignored.
    ///
    /// # Errors
    /// See [`MetadataError`].
    pub fn decode(bytes: &'a [u8]) -> Result<Self, MetadataError> {
        let block = bytes.get(..METADATA_BYTES).ok_or(MetadataError::Short)?;
        if !block.starts_with(&MAGIC) {
            return Err(MetadataError::Magic);
        }
        let layout = half(block, 6);
        if layout != LAYOUT {
            return Err(MetadataError::Layout(layout));
        }
        if CRC.checksum(block.get(..CRC_AT).unwrap_or(&[])) != word_at(block, CRC_AT) {
            return Err(MetadataError::Crc);
        }
        let flags = half(block, 10);
        if flags & !KNOWN_FLAGS != 0 {
            return Err(MetadataError::Flags(flags));
        }
        let store = MemoryRegion { start: word_at(block, 28), length: word_at(block, 32) };
        Ok(Self {
            link_version: half(block, 8),
            simulated: flags & SIMULATED != 0,
            schema_hash: word_at(block, 12),
            model_hash: word_at(block, 16),
            image: MemoryRegion { start: word_at(block, 20), length: word_at(block, 24) },
            store: (store.length > 0).then_some(store),
            firmware: text(block, FIRMWARE_AT, FIRMWARE_BYTES)?,
            board: text(block, BOARD_AT, BOARD_BYTES)?,
        })
    }
}

/// Copies bytes to a place that has room for them, by the layout.
const fn put(block: &mut [u8; METADATA_BYTES], at: usize, bytes: &[u8]) {
    let mut index = 0;
    while index < bytes.len() {
        block[at + index] = bytes[index];
        index += 1;
    }
}

fn half(block: &[u8], at: usize) -> u16 {
    let bytes = block.get(at..).and_then(|rest| rest.first_chunk());
    u16::from_le_bytes(*bytes.unwrap_or(&[0; 2]))
}

fn word_at(block: &[u8], at: usize) -> u32 {
    let bytes = block.get(at..).and_then(|rest| rest.first_chunk());
    u32::from_le_bytes(*bytes.unwrap_or(&[0; 4]))
}

fn text(block: &[u8], at: usize, length: usize) -> Result<&str, MetadataError> {
    let field = block.get(at..at + length).ok_or(MetadataError::Short)?;
    let end = field.iter().position(|byte| *byte == 0).unwrap_or(length);
    let (name, padding) = field.split_at_checked(end).ok_or(MetadataError::Text)?;
    if padding.iter().any(|byte| *byte != 0) {
        return Err(MetadataError::Text);
    }
    core::str::from_utf8(name).map_err(|_| MetadataError::Text)
}
