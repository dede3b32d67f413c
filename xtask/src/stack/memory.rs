//! The content of an image, by the addresses it has at run time.

use anyhow::Result;
use object::elf::{SHF_ALLOC, SHT_NOBITS};
use object::read::elf::SectionHeader as _;
use object::{LittleEndian, Object as _, ObjectSection as _};

use crate::elf::Elf;

/// Name of the section with the addresses of the handlers.
const VECTORS: &str = ".vector_table";

/// Everything in the file that is there at run time.
pub(super) struct Memory {
    sections: Vec<(u32, Vec<u8>)>,
    vectors: Vec<u32>,
}

impl Memory {
    /// Reads the sections of an image.
    ///
    /// # Errors
    /// If the file is damaged.
    pub(super) fn of(file: &Elf<'_>) -> Result<Self> {
        let (mut sections, mut vectors) = (Vec::new(), Vec::new());
        for section in file.sections() {
            let header = section.elf_section_header();
            if header.sh_flags(LittleEndian) & SHF_ALLOC == 0 || header.sh_type(LittleEndian) == SHT_NOBITS {
                continue;
            }
            let content = section.data()?;
            if section.name()? == VECTORS {
                vectors = content.as_chunks().0.iter().map(|bytes| u32::from_le_bytes(*bytes)).collect();
            } else {
                sections.push((section.address() as u32, content.to_vec()));
            }
        }
        Ok(Self { sections, vectors })
    }

    /// The vector table: where the stack begins, then the addresses of the handlers.
    pub(super) fn vectors(&self) -> &[u32] {
        &self.vectors
    }

    fn bytes<const N: usize>(&self, address: u32) -> Option<[u8; N]> {
        self.sections.iter().find_map(|(start, content)| {
            let at = address.checked_sub(*start)? as usize;
            content.get(at..)?.first_chunk().copied()
        })
    }

    /// The byte there.
    pub(super) fn byte(&self, address: u32) -> Option<u32> {
        self.bytes::<1>(address).map(|[byte]| u32::from(byte))
    }

    /// The half word there.
    pub(super) fn half(&self, address: u32) -> Option<u32> {
        self.bytes(address).map(|bytes| u32::from(u16::from_le_bytes(bytes)))
    }

    /// The word there.
    pub(super) fn word(&self, address: u32) -> Option<u32> {
        self.bytes(address).map(u32::from_le_bytes)
    }

    /// Every word with its address.
    pub(super) fn words(&self) -> impl Iterator<Item = (u32, u32)> {
        self.sections.iter().flat_map(|(start, content)| {
            // Sections begin at multiples of four.
            let words = content.as_chunks().0.iter().zip((*start..).step_by(4));
            words.map(|(bytes, address)| (address, u32::from_le_bytes(*bytes)))
        })
    }
}
