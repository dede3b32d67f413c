//! Flash and RAM of an image, from the section table of its ELF file (32 bit, little-endian).

use std::fmt;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

/// Section flag: present in memory at run time.
const ALLOCATED: u32 = 2;

/// Section flag: writable, so it lives in RAM.
const WRITABLE: u32 = 1;

/// Section type: occupies no space in the file, so none in flash.
const NO_BITS: u32 = 8;

/// One section that exists at run time.
pub(crate) struct Section {
    name: String,
    bytes: u32,
    in_flash: bool,
    in_ram: bool,
}

/// Memory that an image takes before its stack.
pub(crate) struct Sizes {
    sections: Vec<Section>,
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
    for index in 0..count {
        let at = table + entry * index;
        let (kind, flags, bytes) = (word(file, at + 4)?, word(file, at + 8)?, word(file, at + 20)?);
        if flags & ALLOCATED == 0 || bytes == 0 {
            continue;
        }
        let name = file.get(names + word(file, at)? as usize..)?;
        let end = name.iter().position(|byte| *byte == 0)?;
        sections.push(Section {
            name: String::from_utf8_lossy(name.get(..end)?).into_owned(),
            bytes,
            in_flash: kind != NO_BITS,
            in_ram: flags & WRITABLE != 0,
        });
    }
    Some(Sizes { sections })
}

fn word(file: &[u8], at: usize) -> Option<u32> {
    Some(u32::from_le_bytes(file.get(at..at + 4)?.try_into().ok()?))
}

fn half(file: &[u8], at: usize) -> Option<u16> {
    Some(u16::from_le_bytes(file.get(at..at + 2)?.try_into().ok()?))
}
