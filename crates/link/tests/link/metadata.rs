//! What a firmware image says about itself.

use link::metadata::{METADATA_BYTES, MemoryRegion, MetadataError};
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
