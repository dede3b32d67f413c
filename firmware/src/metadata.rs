//! Who the image is: for its file (`link::metadata`) and, from the same constants, for the hello of the running device.

use link::metadata::{METADATA_BYTES, MemoryRegion};
use link::{ImageMetadata, LINK_VERSION, SCHEMA_HASH};

/// Firmware version and git revision.
pub const FIRMWARE: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("TACTUS_REVISION"), ")");

/// The block an image carries in its section `.tactus`.
#[must_use]
pub const fn block(
    board: &str,
    simulated: bool,
    image: MemoryRegion,
    store: Option<MemoryRegion>,
) -> [u8; METADATA_BYTES] {
    let model_hash = control::MODEL_HASH;
    ImageMetadata {
        link_version: LINK_VERSION,
        simulated,
        schema_hash: SCHEMA_HASH,
        model_hash,
        image,
        store,
        firmware: FIRMWARE,
        board,
    }
    .encode()
}
