//! Reasons for which bytes are not an image.

use core::fmt;

use super::layout::{EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, IMAGE_SCHEMA, KERNEL_LIMIT, STATISTICS_POINTS_LIMIT};

/// Why bytes are not an image, or a content cannot become one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum ImageError {
    /// Fewer bytes than the smallest image.
    TooShort {
        /// Bytes given.
        length: u32,
    },
    /// The first bytes are not [`MAGIC`](super::MAGIC).
    Magic,
    /// Another version of the layout.
    Schema {
        /// Its version.
        found: u16,
    },
    /// The header's length, the number of bytes and the counts do not agree.
    Length {
        /// Length in the header or asked for by the counts.
        expected: u32,
        /// The other length.
        found: u32,
    },
    /// Damaged.
    Crc {
        /// Check sum of the bytes.
        computed: u32,
        /// Check sum at their end.
        stored: u32,
    },
    /// The name breaks the rules of [`Name`](crate::Name) or is not padded with zeros.
    Name,
    /// Flags this version does not know.
    Flags {
        /// All flags.
        found: u16,
    },
    /// Fewer than 2 or more than [`KERNEL_LIMIT`] kernels.
    Kernels {
        /// Their number.
        found: u32,
    },
    /// More than [`GAIN_POINTS_LIMIT`] points, or only one of the tables K1 and K2.
    GainPoints {
        /// The larger number of points.
        found: u32,
    },
    /// More than [`EXPECTATION_POINTS_LIMIT`] points.
    ExpectationPoints {
        /// Their number.
        found: u32,
    },
    /// A real is infinite or not a number.
    NotFinite {
        /// Its place, counted in reals from the end of the header.
        real: u32,
    },
    /// A table to be written does not have the shape its counts ask for, or the buffer is too small.
    Shape,
    /// More than [`STATISTICS_POINTS_LIMIT`] points.
    StatisticsPoints {
        /// Their number.
        found: u32,
    },
}

impl ImageError {
    /// Number of the error in the detail of a refusal; never renumbered.
    #[must_use]
    pub const fn code(self) -> u32 {
        match self {
            Self::TooShort { .. } => 1,
            Self::Magic => 2,
            Self::Schema { .. } => 3,
            Self::Length { .. } => 4,
            Self::Crc { .. } => 5,
            Self::Name => 6,
            Self::Flags { .. } => 7,
            Self::Kernels { .. } => 8,
            Self::GainPoints { .. } => 9,
            Self::ExpectationPoints { .. } => 10,
            Self::NotFinite { .. } => 11,
            Self::Shape => 12,
            Self::StatisticsPoints { .. } => 13,
        }
    }

    /// The number that belongs to the error, 0 where it has none.
    #[must_use]
    pub const fn number(self) -> u32 {
        match self {
            Self::TooShort { length } => length,
            Self::Schema { found } | Self::Flags { found } => found as u32,
            Self::Length { found, .. }
            | Self::Kernels { found }
            | Self::GainPoints { found }
            | Self::ExpectationPoints { found }
            | Self::StatisticsPoints { found } => found,
            Self::Crc { computed, .. } => computed,
            Self::NotFinite { real } => real,
            Self::Magic | Self::Name | Self::Shape => 0,
        }
    }
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::TooShort { length } => write!(f, "{length} bytes are too few for an image"),
            Self::Magic => f.write_str("the bytes are not a primitive image"),
            Self::Schema { found } => {
                write!(f, "the image has layout version {found}, this side knows version {IMAGE_SCHEMA}")
            }
            Self::Length { expected, found } => {
                write!(f, "the image should have {expected} bytes, it has {found}")
            }
            Self::Crc { computed, stored } => {
                write!(f, "the image is damaged: check sum {computed:#010x}, stored {stored:#010x}")
            }
            Self::Name => f.write_str("the name in the image is not a valid name"),
            Self::Flags { found } => write!(f, "the image has unknown flags {found:#06x}"),
            Self::Kernels { found } => {
                write!(f, "the image has {found} kernels, between 2 and {KERNEL_LIMIT} are possible")
            }
            Self::GainPoints { found } => write!(
                f,
                "the gain tables have {found} points; at most {GAIN_POINTS_LIMIT} are possible, and both or none"
            ),
            Self::ExpectationPoints { found } => {
                write!(f, "the expectation has {found} points; at most {EXPECTATION_POINTS_LIMIT} are possible")
            }
            Self::StatisticsPoints { found } => {
                write!(f, "the sensor statistics have {found} points; at most {STATISTICS_POINTS_LIMIT} are possible")
            }
            Self::NotFinite { real } => write!(f, "real number {real} of the image is not finite"),
            Self::Shape => {
                f.write_str("a table does not have the shape its counts ask for, or the buffer is too small")
            }
        }
    }
}

impl core::error::Error for ImageError {}
