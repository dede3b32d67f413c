//! The metadata of a firmware image.

use link::frame::CRC;
use link::metadata::{METADATA_BYTES, MemoryRegion, MetadataError, chip};
use link::{ImageMetadata, LINK_VERSION, SCHEMA_HASH};

const SAMPLE: ImageMetadata<'static> = ImageMetadata {
    link_version: LINK_VERSION,
    simulated: false,
    schema_hash: SCHEMA_HASH,
    model_hash: 0x1234_5678,
    image: MemoryRegion { start: 0x0800_0000, length: 0x10_0000 },
    store: Some(MemoryRegion { start: 0x0810_0000, length: 0x10_0000 }),
    firmware: "0.1.0 (1a2b3c4)",
    board: "nucleo-h743zi2",
};

/// As in an image: made by the compiler.
const BLOCK: [u8; METADATA_BYTES] = SAMPLE.encode();

#[test]
fn what_the_compiler_wrote_is_read_back() {
    assert_eq!(ImageMetadata::decode(&BLOCK), Ok(SAMPLE));
    let emulated = ImageMetadata { simulated: true, store: None, firmware: "", ..SAMPLE };
    assert_eq!(ImageMetadata::decode(&emulated.encode()), Ok(emulated));
}

#[test]
fn names_may_fill_their_places() {
    let firmware = "f".repeat(48);
    let board = "b".repeat(32);
    let sample = ImageMetadata { firmware: &firmware, board: &board, ..SAMPLE };
    assert_eq!(ImageMetadata::decode(&sample.encode()), Ok(sample));
}

#[test]
fn every_flipped_bit_is_noticed() {
    for bit in 0..BLOCK.len() * 8 {
        let mut block = BLOCK;
        block[bit / 8] ^= 1 << (bit % 8);
        assert!(ImageMetadata::decode(&block).is_err(), "bit {bit}");
    }
}

/// The block with other bytes at a place and a check sum that is right again.
fn block_with(at: usize, bytes: &[u8]) -> [u8; METADATA_BYTES] {
    let mut block = BLOCK;
    block[at..at + bytes.len()].copy_from_slice(bytes);
    let (covered, crc) = block.split_at_mut(METADATA_BYTES - 4);
    crc.copy_from_slice(&CRC.checksum(covered).to_le_bytes());
    block
}

#[test]
fn flags_that_this_version_does_not_know_are_refused_by_name() {
    for flags in (1..16).map(|bit| 1_u16 << bit) {
        let block = block_with(10, &flags.to_le_bytes());
        assert_eq!(ImageMetadata::decode(&block), Err(MetadataError::Flags(flags)));
    }
}

#[test]
fn names_are_padded_with_zeros_and_nothing_else() {
    // Places 36 (48 bytes) and 84 (32 bytes).
    for last in [83, 115] {
        assert_eq!(ImageMetadata::decode(&block_with(last, b"x")), Err(MetadataError::Text));
    }
}

#[test]
fn a_later_layout_and_a_short_block_are_refused_by_name() {
    let mut later = BLOCK;
    later[6] = 2;
    assert_eq!(ImageMetadata::decode(&later), Err(MetadataError::Layout(2)));
    assert_eq!(ImageMetadata::decode(&BLOCK[..METADATA_BYTES - 1]), Err(MetadataError::Short));
    assert_eq!(ImageMetadata::decode(&[0; METADATA_BYTES]), Err(MetadataError::Magic));
}

#[test]
fn a_region_contains_what_lies_inside_and_nothing_else() {
    let region = SAMPLE.image;
    assert!(region.contains(region.start, region.length));
    assert!(!region.contains(region.start, region.length + 1));
    assert!(!region.contains(region.start - 1, 1));
    assert!(!region.contains(u32::MAX, u32::MAX));
    let top = MemoryRegion { start: 0xFFFF_FF00, length: 0x100 };
    assert!(top.contains(0xFFFF_FF00, 0x100));
}

#[test]
fn a_real_board_has_its_chip_and_an_emulated_one_none() {
    assert_eq!(chip("nucleo-h743zi2"), Some("STM32H743ZITx"));
    assert_eq!(chip("mps2-an500"), None);
}

#[test]
fn a_description_that_is_not_read_is_told_why() {
    for (error, words) in [
        (MetadataError::Short, "is cut short"),
        (MetadataError::Magic, "does not begin as one"),
        (MetadataError::Layout(7), "has layout 7; this version reads 1"),
        (MetadataError::Crc, "is damaged"),
        (MetadataError::Flags(6), "has flags 0x0006, of which this version does not know all"),
        (MetadataError::Text, "holds names that are not text"),
    ] {
        assert_eq!(error.to_string(), format!("the description of the image {words}"));
    }
}
