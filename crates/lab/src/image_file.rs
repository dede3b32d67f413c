//! A firmware image in a file: what it says about itself, and what flashing it would write where.
//!
//! The description is the section `.tactus` (`link::metadata`); a device that runs the image tells the same in its
//! hello. An image is only taken for flashing if all it would write lies where it says images belong: never where the
//! device keeps its primitives.

use std::path::{Path, PathBuf};

use crate::input_file;

use link::ImageMetadata;
use link::metadata::{METADATA_SECTION, MemoryRegion, MetadataError, chip};
use object::read::elf::{FileHeader as _, ProgramHeader as _};
use object::{Endianness, Object as _, ObjectSection as _, elf};

/// An image's description of itself, in values that outlive its file.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Description {
    /// Link version.
    pub link_version: u16,
    /// For an emulated board.
    pub simulated: bool,
    /// Schema hash of the link.
    pub schema_hash: u32,
    /// Hash of the robot model.
    pub model_hash: u32,
    /// Where the image may lie.
    pub image: MemoryRegion,
    /// Where the device keeps its primitives.
    pub store: Option<MemoryRegion>,
    /// Firmware version and git revision.
    pub firmware: String,
    /// Board.
    pub board: String,
}

/// An image, read and checked.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ImageFile {
    /// Its file.
    pub path: PathBuf,
    /// Its description of itself.
    pub description: Description,
    /// The regions that flashing it writes: stretches of the device's address space.
    pub writes: Vec<MemoryRegion>,
}

/// Why an image cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum ImageFileError {
    /// The file cannot be read.
    #[error("cannot read {}: {source}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// Why.
        source: std::io::Error,
    },
    /// The file is no image.
    #[error("{} is not an ELF file for a 32-bit processor", path.display())]
    NotAnImage {
        /// The file.
        path: PathBuf,
        /// Why.
        source: object::Error,
    },
    /// The file says nothing about itself.
    #[error("{} does not say what it is: no section {METADATA_SECTION}", path.display())]
    Silent {
        /// The file.
        path: PathBuf,
    },
    /// The file's description cannot be read.
    #[error("{}: {source}", path.display())]
    Description {
        /// The file.
        path: PathBuf,
        /// Why.
        source: MetadataError,
    },
    /// The image is for an emulator.
    #[error("the image is for the emulated board '{board}', not for a real one")]
    Emulated {
        /// Its board.
        board: String,
    },
    /// Nobody knows how to flash the board.
    #[error("the image is for board '{board}', whose chip this tool does not know")]
    UnknownBoard {
        /// Its board.
        board: String,
    },
    /// The image would be written where it does not belong.
    #[error(
        "the image would write {} bytes at {:#010x}, outside of where images belong ({:#010x}, {} bytes)",
        write.length, write.start, image.start, image.length
    )]
    Outside {
        /// The region that would be written.
        write: MemoryRegion,
        /// Where images belong.
        image: MemoryRegion,
    },
    /// The image says it belongs where the device keeps its primitives.
    #[error("the image and the stored primitives would share memory at {:#010x}", store.start)]
    OverStore {
        /// Where the primitives are.
        store: MemoryRegion,
    },
}

impl ImageFile {
    /// Reads an image.
    ///
    /// # Errors
    /// It is not there, is no image, or says nothing about itself.
    pub fn read(path: &Path) -> Result<Self, ImageFileError> {
        let owned = || path.to_path_buf();
        let bytes = input_file::read(path, input_file::LONGEST_IMAGE)
            .map_err(|source| ImageFileError::Unreadable { path: owned(), source })?;
        let no_image = |source| ImageFileError::NotAnImage { path: owned(), source };
        let file = object::read::elf::ElfFile32::<Endianness>::parse(&*bytes).map_err(no_image)?;
        let section = file.section_by_name(METADATA_SECTION).ok_or_else(|| ImageFileError::Silent { path: owned() })?;
        let block = section.data().map_err(no_image)?;
        let metadata =
            ImageMetadata::decode(block).map_err(|source| ImageFileError::Description { path: owned(), source })?;
        let description = Description {
            link_version: metadata.link_version,
            simulated: metadata.simulated,
            schema_hash: metadata.schema_hash,
            model_hash: metadata.model_hash,
            image: metadata.image,
            store: metadata.store,
            firmware: metadata.firmware.to_owned(),
            board: metadata.board.to_owned(),
        };
        let header = elf::FileHeader32::<Endianness>::parse(&*bytes).map_err(no_image)?;
        let endian = header.endian().map_err(no_image)?;
        let segments = header.program_headers(endian, &*bytes).map_err(no_image)?;
        let writes = segments
            .iter()
            .filter(|segment| segment.p_type(endian) == elf::PT_LOAD && segment.p_filesz(endian) > 0)
            .map(|segment| MemoryRegion { start: segment.p_paddr(endian), length: segment.p_filesz(endian) })
            .collect();
        Ok(Self { path: owned(), description, writes })
    }

    /// Bytes that flashing writes.
    #[must_use]
    pub fn bytes(&self) -> u64 {
        self.writes.iter().map(|write| u64::from(write.length)).sum()
    }

    /// The chip to flash it on, if it is for a real board and writes nothing where it does not belong.
    ///
    /// # Errors
    /// See [`ImageFileError`].
    pub fn chip(&self) -> Result<&'static str, ImageFileError> {
        let description = &self.description;
        if description.simulated {
            return Err(ImageFileError::Emulated { board: description.board.clone() });
        }
        if let Some(store) = description.store {
            let image = description.image;
            let apart = |first: MemoryRegion, second: MemoryRegion| {
                u64::from(first.start) + u64::from(first.length) <= u64::from(second.start)
            };
            if !apart(image, store) && !apart(store, image) {
                return Err(ImageFileError::OverStore { store });
            }
        }
        let stray = self.writes.iter().find(|write| !description.image.contains(write.start, write.length));
        if let Some(write) = stray {
            return Err(ImageFileError::Outside { write: *write, image: description.image });
        }
        chip(&description.board).ok_or_else(|| ImageFileError::UnknownBoard { board: description.board.clone() })
    }
}
