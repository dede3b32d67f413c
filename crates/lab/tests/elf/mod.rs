//! Images for the real board that hold nothing but what they say about themselves.

#![allow(dead_code, reason = "each test program uses its own part of these helpers")]

use link::metadata::{METADATA_SECTION, MemoryRegion};
use link::{ImageMetadata, LINK_VERSION, SCHEMA_HASH};

/// Where images belong.
pub(crate) const BANK_1: MemoryRegion = MemoryRegion { start: 0x0800_0000, length: 0x10_0000 };
/// Where primitives belong.
pub(crate) const BANK_2: MemoryRegion = MemoryRegion { start: 0x0810_0000, length: 0x10_0000 };

/// The description of an image for the real board.
pub(crate) fn real() -> ImageMetadata<'static> {
    ImageMetadata {
        link_version: LINK_VERSION,
        simulated: false,
        schema_hash: SCHEMA_HASH,
        model_hash: 0x1234_5678,
        image: BANK_1,
        store: Some(BANK_2),
        firmware: "0.1.0 (1a2b3c4)",
        board: "nucleo-h743zi2",
    }
}

/// A 32-bit ELF file with one loaded segment at `address` and the description in a section of its own.
pub(crate) fn elf(description: Option<&[u8]>, address: u32) -> Vec<u8> {
    const HEADER: usize = 52;
    const SEGMENT: usize = 32;
    const SECTION: usize = 40;
    let names = format!("\0{METADATA_SECTION}\0.shstrtab\0").into_bytes();
    let block = description.unwrap_or(&[]);
    let code_at = HEADER + SEGMENT;
    let block_at = code_at + 64;
    let names_at = block_at + block.len();
    let table_at = (names_at + names.len()).next_multiple_of(4);
    let mut file = Vec::new();
    file.extend(b"\x7fELF\x01\x01\x01\0\0\0\0\0\0\0\0\0");
    let half = |file: &mut Vec<u8>, value: usize| file.extend(u16::try_from(value).unwrap().to_le_bytes());
    half(&mut file, 2);
    half(&mut file, 40);
    let words = |file: &mut Vec<u8>, values: &[u32]| values.iter().for_each(|v| file.extend(v.to_le_bytes()));
    words(&mut file, &[1, address, HEADER as u32, table_at as u32, 0]);
    for value in [HEADER, SEGMENT, 1, SECTION, 3, 2] {
        half(&mut file, value);
    }
    words(&mut file, &[1, code_at as u32, address, address, 64, 64, 5, 4]);
    file.extend([0x42; 64]);
    file.extend(block);
    file.extend(&names);
    file.resize(table_at, 0);
    words(&mut file, &[0; 10]);
    // Without a description the section has another name, so that it is not found.
    let name = if description.is_some() { 1 } else { 1 + METADATA_SECTION.len() as u32 + 1 };
    words(&mut file, &[name, 1, 2, 0, block_at as u32, block.len() as u32, 0, 0, 4, 0]);
    let shstrtab = 1 + METADATA_SECTION.len() as u32 + 1;
    words(&mut file, &[shstrtab, 3, 0, 0, names_at as u32, names.len() as u32, 0, 0, 1, 0]);
    file
}
