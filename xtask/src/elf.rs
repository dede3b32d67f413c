//! What an image takes and says about itself, from the section table of its ELF file (32 bit, little-endian).

use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use link::metadata::METADATA_SECTION;

/// Section flag: present in memory at run time.
const ALLOCATED: u32 = 2;

/// Section flag: writable, so it lives in RAM.
const WRITABLE: u32 = 1;

/// Section type: occupies no space in the file, so none in flash.
const NO_BITS: u32 = 8;

/// Part of the name of every function of a memory allocator.
const ALLOCATOR: &str = "__rust_alloc";

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

    /// Whether all of it lies in a stretch of memory.
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

    /// What the image says about itself (`link::metadata`), undecoded.
    pub(crate) fn description(&self) -> Option<&[u8]> {
        self.description.as_deref()
    }

    /// Whether the image contains a memory allocator.
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

fn parse(file: &[u8]) -> Option<Sizes> {
    if file.get(..6)? != b"\x7fELF\x01\x01" {
        return None;
    }
    let table = word(file, 32)? as usize;
    let entry = half(file, 46)? as usize;
    let count = half(file, 48)? as usize;
    let names_entry = table + entry * half(file, 50)? as usize;
    let names = word(file, names_entry + 16)? as usize;
    let mut sections = Vec::new();
    let (mut vectors, mut description) = (Vec::new(), None);
    let (mut symbol_table, mut names_of_symbols): (&[u8], &[u8]) = (&[], &[]);
    for index in 0..count {
        let at = table + entry * index;
        let (kind, flags, bytes) = (word(file, at + 4)?, word(file, at + 8)?, word(file, at + 20)?);
        let name = file.get(names + word(file, at)? as usize..)?;
        let end = name.iter().position(|byte| *byte == 0)?;
        let name = String::from_utf8_lossy(name.get(..end)?).into_owned();
        let content = word(file, at + 16)? as usize;
        let body = || file.get(content..content.checked_add(bytes as usize)?);
        match name.as_str() {
            ".vector_table" => vectors = words(body()?),
            METADATA_SECTION => description = Some(body()?.to_vec()),
            ".symtab" => symbol_table = body()?,
            ".strtab" => names_of_symbols = body()?,
            _ => {}
        }
        if flags & ALLOCATED == 0 || bytes == 0 {
            continue;
        }
        sections.push(Section {
            name,
            address: word(file, at + 12)?,
            bytes,
            in_flash: kind != NO_BITS,
            in_ram: flags & WRITABLE != 0,
        });
    }
    let symbols = symbols(symbol_table, names_of_symbols);
    Some(Sizes { sections, vectors, description, symbols })
}

/// Names and values of a symbol table; entries of sixteen bytes.
fn symbols(table: &[u8], names: &[u8]) -> BTreeMap<String, u32> {
    let named = table.chunks_exact(16).filter_map(|entry| {
        let name = names.get(word(entry, 0)? as usize..)?;
        let end = name.iter().position(|byte| *byte == 0)?;
        Some((String::from_utf8_lossy(name.get(..end)?).into_owned(), word(entry, 4)?))
    });
    named.collect()
}

fn words(bytes: &[u8]) -> Vec<u32> {
    bytes.chunks_exact(4).filter_map(|bytes| word(bytes, 0)).collect()
}

fn word(file: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(file.get(at..at + 4)?.try_into().ok()?))
}

fn half(file: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(file.get(at..at + 2)?.try_into().ok()?))
}
