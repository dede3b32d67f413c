//! Memory and metadata of an image, from the section table of its ELF file (32 bit, little-endian).

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use link::metadata::METADATA_SECTION;
use object::elf::{PT_LOAD, SHF_ALLOC, SHF_WRITE, SHT_NOBITS};
use object::read::elf::{ElfFile32, ProgramHeader as _, SectionHeader as _};
use object::{LittleEndian, Object as _, ObjectSection as _, ObjectSymbol as _};
use sha2::{Digest as _, Sha256};

/// Part of the name of every function of a memory allocator.
const ALLOCATOR: &str = "__rust_alloc";

/// Vectors in front of the interrupt lines.
pub(crate) const CORE_VECTORS: usize = 16;

/// An ELF file of the kind every image is.
pub(crate) type Elf<'a> = ElfFile32<'a, LittleEndian>;

/// One section that exists at run time.
pub(crate) struct Section {
    name: String,
    address: u32,
    bytes: u32,
    in_flash: bool,
    in_ram: bool,
}

impl Section {
    /// Its name in the file.
    pub(crate) fn name(&self) -> &str {
        &self.name
    }

    /// Where it is at run time.
    pub(crate) fn address(&self) -> u32 {
        self.address
    }

    /// Its size at run time.
    pub(crate) fn bytes(&self) -> u32 {
        self.bytes
    }

    /// True if all of it lies in a stretch of memory.
    pub(crate) fn lies_in(&self, start: u32, length: u32) -> bool {
        self.address >= start && u64::from(self.address) + u64::from(self.bytes) <= u64::from(start) + u64::from(length)
    }
}

/// Memory that an image takes before its stack.
pub(crate) struct Sizes {
    sections: Vec<Section>,
    vectors: Vec<u32>,
    description: Option<Vec<u8>>,
    symbols: BTreeMap<String, u32>,
}

impl Sizes {
    /// Reads an ELF file.
    ///
    /// # Errors
    /// If the file cannot be read or is not a 32-bit little-endian ELF file.
    pub(crate) fn of(image: &Path) -> Result<Self> {
        let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
        parse(&file).with_context(|| format!("{} is not a 32-bit ELF file", image.display()))
    }

    /// The sections, in the order of the file.
    pub(crate) fn sections(&self) -> &[Section] {
        &self.sections
    }

    /// The vector table: where the stack begins, then the addresses of the handlers.
    pub(crate) fn vectors(&self) -> &[u32] {
        &self.vectors
    }

    /// Address of a symbol.
    pub(crate) fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    /// Metadata of the image (`link::metadata`), undecoded.
    pub(crate) fn description(&self) -> Option<&[u8]> {
        self.description.as_deref()
    }

    /// True if the image contains a memory allocator.
    pub(crate) fn allocates(&self) -> bool {
        self.symbols.keys().any(|name| name.contains(ALLOCATOR))
    }

    /// Bytes of flash: code, constants and the initial values of data.
    pub(crate) fn flash(&self) -> u32 {
        self.sections.iter().filter(|section| section.in_flash).map(|section| section.bytes).sum()
    }

    /// Bytes of RAM without the stack.
    pub(crate) fn ram(&self) -> u32 {
        self.sections.iter().filter(|section| section.in_ram).map(|section| section.bytes).sum()
    }
}

impl fmt::Display for Sizes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for section in &self.sections {
            let place = match (section.in_flash, section.in_ram) {
                (true, true) => "flash and RAM",
                (true, false) => "flash",
                _ => "RAM",
            };
            writeln!(f, "{:<20} {:>8} B  {place}", section.name, section.bytes)?;
        }
        writeln!(f, "{:<20} {:>8} B", "flash", self.flash())?;
        writeln!(f, "{:<20} {:>8} B  without stack", "RAM", self.ram())
    }
}

/// SHA-256, in hexadecimal digits, of what flashing an image writes: of every load segment with content its physical
/// address, its length (u32 each, little-endian) and its bytes.
///
/// # Errors
/// If the file cannot be read or is not a 32-bit little-endian ELF file.
pub(crate) fn load_hash(image: &Path) -> Result<String> {
    let bytes = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let file = Elf::parse(&*bytes).with_context(|| format!("{} is not a 32-bit ELF file", image.display()))?;
    let endian = LittleEndian;
    let mut hash = Sha256::new();
    for segment in file.elf_program_headers().iter().filter(|segment| segment.p_type(endian) == PT_LOAD) {
        let data = segment.data(endian, &*bytes).unwrap_or_default();
        if !data.is_empty() {
            hash.update(segment.p_paddr(endian).to_le_bytes());
            hash.update((data.len() as u32).to_le_bytes());
            hash.update(data);
        }
    }
    Ok(hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect())
}

fn parse(file: &[u8]) -> object::Result<Sizes> {
    let file = Elf::parse(file)?;
    let endian = LittleEndian;
    let mut sections = Vec::new();
    for section in file.sections() {
        let header = section.elf_section_header();
        let (flags, bytes) = (header.sh_flags(endian), header.sh_size(endian));
        if flags & SHF_ALLOC == 0 || bytes == 0 {
            continue;
        }
        sections.push(Section {
            name: section.name()?.to_owned(),
            address: header.sh_addr(endian),
            bytes,
            in_flash: header.sh_type(endian) != SHT_NOBITS,
            in_ram: flags & SHF_WRITE != 0,
        });
    }
    let content = |name| file.section_by_name(name).map(|section| section.data()).transpose();
    let vectors = content(".vector_table")?.unwrap_or_default();
    let vectors = vectors.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
    let description = content(METADATA_SECTION)?.map(<[u8]>::to_vec);
    let mut symbols = BTreeMap::new();
    for symbol in file.symbols() {
        symbols.insert(symbol.name()?.to_owned(), symbol.address() as u32);
    }
    Ok(Sizes { sections, vectors, description, symbols })
}
