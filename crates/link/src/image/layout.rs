//! Sizes, limits and flags of the image layout.

/// Version of this layout. An image of another version is refused with both versions named.
pub const IMAGE_SCHEMA: u16 = 3;

/// First bytes of every image.
pub const MAGIC: [u8; 4] = *b"TACP";

/// Rows of weights: 3 position, 3 orientation, 7 posture, 4 hand.
pub const WEIGHT_ROWS: usize = 17;

/// Rows that sensory feedback can bend: 3 position, 3 orientation, 4 hand.
pub const COUPLED_ROWS: usize = 10;

/// Sensor rows: wrist force 3 (world axes), wrist torque 3, one strain gauge of each finger.
pub const SENSOR_ROWS: usize = 9;

/// Most kernels of each row.
pub const KERNEL_LIMIT: usize = 100;

/// Most points of a gain table.
pub const GAIN_POINTS_LIMIT: usize = 32;

/// Most points of the expectation.
pub const EXPECTATION_POINTS_LIMIT: usize = 128;

/// Channels of the statistics: what the sensor rows are, then the angles of the three fingers.
pub const STATISTICS_ROWS: usize = 12;

/// Most points of the statistics.
pub const STATISTICS_POINTS_LIMIT: usize = 64;

pub(super) const HEADER_BYTES: usize = 60;
pub(super) const CRC_BYTES: usize = 4;
pub(super) const REAL_BYTES: usize = 4;

/// Reals between header and tables: timing 3, gains 8, start 18, start velocity 17, goal 18, clamps 3,
/// expectation marks 8.
const FIXED_REALS: usize = 3 + 8 + 18 + 17 + 18 + 3 + EXPECTATION_MARKS;

/// Reals that describe how an expectation was recorded: duration, payload mass, payload centre 3, filter
/// cut-off, number of trials, smallest spread that counts.
const EXPECTATION_MARKS: usize = 8;

pub(super) const FLAG_ROTATION_VECTOR: u16 = 1 << 0;
pub(super) const FLAG_NEAREST_HEMISPHERE: u16 = 1 << 1;
pub(super) const KNOWN_FLAGS: u16 = FLAG_ROTATION_VECTOR | FLAG_NEAREST_HEMISPHERE;

/// Bytes of an image with these counts.
#[must_use]
pub const fn image_bytes(
    kernels: usize,
    k1_points: usize,
    k2_points: usize,
    expectation_points: usize,
    statistics_points: usize,
) -> usize {
    let reals = FIXED_REALS
        + COUPLED_ROWS * k1_points
        + SENSOR_ROWS * k2_points
        + WEIGHT_ROWS * kernels
        + SENSOR_ROWS * expectation_points
        + 2 * STATISTICS_ROWS * statistics_points;
    HEADER_BYTES + REAL_BYTES * reals + CRC_BYTES
}

/// Bytes of the largest image there can be.
pub const IMAGE_BYTES_LIMIT: usize =
    image_bytes(KERNEL_LIMIT, GAIN_POINTS_LIMIT, GAIN_POINTS_LIMIT, EXPECTATION_POINTS_LIMIT, STATISTICS_POINTS_LIMIT);
