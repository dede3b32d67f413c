//! A movement primitive as one block of bytes: what is uploaded and what is stored.
//!
//! ```text
//! header 60 bytes | fixed part 75 f32 | K1 table | K2 table | weights | expectation | statistics | CRC-32
//! ```
//! All numbers little endian, all reals IEEE-754 single precision, SI units. `docs/image-format.md` gives
//! every offset. There is no padding: the header's counts fix the total length.
//!
//! Invariants of a [`PrimitiveImage`]: check sum and schema are right, its length is exactly what its
//! counts ask for, every real is finite, counts are within the limits below. What the numbers mean to the
//! arm (limits, stability, unit quaternions) is checked by `dmp` and `control`, not here.

mod content;
mod counts;
mod error;
mod layout;
mod read;
mod write;

pub use content::{
    ExpectationMarks, FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity,
};
pub use error::ImageError;
pub use layout::{
    COUPLED_ROWS, EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, IMAGE_BYTES_LIMIT, IMAGE_SCHEMA, KERNEL_LIMIT, MAGIC,
    SENSOR_ROWS, STATISTICS_POINTS_LIMIT, STATISTICS_ROWS, WEIGHT_ROWS, image_bytes,
};
pub use read::{PrimitiveImage, Reals, legible_name, stored_crc};
pub use write::{NAMED_HEAD_BYTES, renamed_head};
