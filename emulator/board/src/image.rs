//! The image as a file: what it loads, who it says it is, its symbols.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use link::ImageMetadata;
use object::elf::PT_LOAD;
use object::read::elf::{FileHeader, ProgramHeader};
use object::{Object, ObjectSection, ObjectSymbol, SymbolKind};
use sha2::{Digest, Sha256};

/// Name of the only board this emulates.
pub const BOARD: &str = "nucleo-h743zi2";

/// Place of the slot timer (TIM2) in the vector table.
const SLOT_VECTOR: usize = 16 + 28;

/// Why a file is no image for this board.
#[derive(Debug, thiserror::Error)]
pub enum ImageError {
    /// It cannot be read.
    #[error("{}: {source}", path.display())]
    Read {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// It is no ELF file for this processor.
    #[error("{}: not an ELF file of 32 bits: {source}", path.display())]
    Elf {
        /// The file.
        path: PathBuf,
        /// Why.
        source: object::Error,
    },
    /// It does not say who it is.
    #[error("{}: no section .tactus: not an image of Tactus; this emulates {BOARD}", path.display())]
    Anonymous {
        /// The file.
        path: PathBuf,
    },
    /// Its description cannot be understood.
    #[error(
        "{}: the section .tactus cannot be read ({source}): the image is older or newer than this emulator of {BOARD}",
        path.display()
    )]
    Metadata {
        /// The file.
        path: PathBuf,
        /// Why.
        source: link::metadata::MetadataError,
    },
    /// It is for another board.
    #[error("{}: the image is for {found}, this emulates {BOARD}", path.display())]
    Board {
        /// The file.
        path: PathBuf,
        /// The board it names.
        found: String,
    },
    /// A symbol that the emulator needs is missing.
    #[error("{}: no symbol {name}: the image is older than this emulator's map of {BOARD}", path.display())]
    Symbol {
        /// The file.
        path: PathBuf,
        /// The symbol.
        name: &'static str,
    },
}

/// The facts of an image.
#[derive(Debug)]
pub struct Image {
    /// The file.
    pub path: PathBuf,
    /// Its bytes.
    pub bytes: Vec<u8>,
    /// SHA-256 in hexadecimal digits over the load segments that have content: physical address, length, content of
    /// each.
    pub hash: String,
    /// Metadata of its firmware.
    pub firmware: String,
    /// End of the stack (its highest address) and its lowest address.
    pub stack: std::ops::Range<u32>,
    /// Where the handlers of non-maskable interrupt, hard fault and the three configurable faults begin.
    pub fault_handlers: Vec<u32>,
    /// Where the handler of the slot timer begins.
    pub slot_handler: u32,
    /// Hash of the robot model in it.
    pub model_hash: u32,
    /// The log's control block.
    pub log_control: u32,
    /// Where the words of the last stop are kept, if it keeps any.
    pub kept_words: Option<u32>,
    functions: BTreeMap<u32, (u32, String)>,
}

impl Image {
    /// Reads a file and checks that it is an image for this board.
    ///
    /// # Errors
    /// [`ImageError`]
    pub fn read(path: &Path) -> Result<Self, ImageError> {
        let path = path.to_owned();
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(source) => return Err(ImageError::Read { path, source }),
        };
        let elf = |source| ImageError::Elf { path: path.clone(), source };
        let file = object::read::elf::ElfFile32::<object::Endianness>::parse(&*bytes).map_err(elf)?;
        let section = file.section_by_name(".tactus").ok_or_else(|| ImageError::Anonymous { path: path.clone() })?;
        let metadata = ImageMetadata::decode(section.data().map_err(elf)?)
            .map_err(|source| ImageError::Metadata { path: path.clone(), source })?;
        if metadata.board != BOARD {
            return Err(ImageError::Board { path, found: metadata.board.to_owned() });
        }
        let firmware = metadata.firmware.to_owned();
        let model_hash = metadata.model_hash;
        let vectors =
            file.section_by_name(".vector_table").ok_or_else(|| ImageError::Anonymous { path: path.clone() })?;
        let vectors: Vec<u32> =
            vectors.data().map_err(elf)?.as_chunks::<4>().0.iter().map(|word| u32::from_le_bytes(*word) & !1).collect();
        let mut fault_handlers = vectors.get(2..7).unwrap_or(&[]).to_vec();
        let slot_handler = vectors.get(SLOT_VECTOR).copied().unwrap_or(0);
        fault_handlers.sort_unstable();
        fault_handlers.dedup();
        let hash = hash_of(&file, &bytes).map_err(elf)?;
        let mut functions = BTreeMap::new();
        let mut named = BTreeMap::new();
        for symbol in file.symbols() {
            let Ok(name) = symbol.name() else { continue };
            let address = symbol.address() as u32;
            named.insert(name.to_owned(), address);
            if symbol.kind() == SymbolKind::Text {
                let name = format!("{:#}", rustc_demangle::demangle(name));
                functions.insert(address & !1, (symbol.size() as u32, name));
            }
        }
        let symbol = |name: &'static str| {
            named.get(name).copied().ok_or_else(|| ImageError::Symbol { path: path.clone(), name })
        };
        let is_place = |name: &str| name.contains("panic_reason") && name.contains("PLACE");
        let kept_words = named.iter().find(|(name, _)| is_place(name)).map(|(_, address)| *address);
        let stack = symbol("_stack_end")?..symbol("_stack_start")?;
        let log_control = symbol("_SEGGER_RTT")?;
        Ok(Self {
            hash,
            model_hash,
            fault_handlers,
            slot_handler,
            firmware,
            stack,
            log_control,
            kept_words,
            functions,
            path,
            bytes,
        })
    }

    /// The function that holds an address, for people.
    #[must_use]
    pub fn function_at(&self, address: u32) -> String {
        match self.functions.range(..=address).next_back() {
            Some((start, (size, name))) if address - start < (*size).max(2) => name.clone(),
            _ => format!("{address:#010x}"),
        }
    }

    /// Where the first function begins whose name contains `part`.
    #[must_use]
    pub fn function_named(&self, part: &str) -> Option<u32> {
        self.functions.iter().find(|(_, (_, name))| name.contains(part)).map(|(address, _)| *address)
    }
}

fn hash_of(file: &object::read::elf::ElfFile32<'_, object::Endianness>, bytes: &[u8]) -> Result<String, object::Error> {
    let endian = file.elf_header().endian()?;
    let mut hash = Sha256::new();
    for segment in file.elf_program_headers().iter().filter(|segment| segment.p_type(endian) == PT_LOAD) {
        let data = segment.data(endian, bytes).unwrap_or(&[]);
        if !data.is_empty() {
            hash.update(segment.p_paddr(endian).to_le_bytes());
            hash.update((data.len() as u32).to_le_bytes());
            hash.update(data);
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}
