//! Bytes to a checked [`PrimitiveImage`], without copying the tables.

use super::content::{
    ExpectationMarks, FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity,
};
use super::counts::{Counts, clip};
use super::error::ImageError;
use super::layout::{
    COUPLED_ROWS, CRC_BYTES, FLAG_NEAREST_HEMISPHERE, FLAG_ROTATION_VECTOR, HEADER_BYTES, IMAGE_SCHEMA, KNOWN_FLAGS,
    MAGIC, REAL_BYTES, SENSOR_ROWS, STATISTICS_ROWS, WEIGHT_ROWS,
};
use super::write::NAMED_HEAD_BYTES;
use crate::frame::CRC;
use crate::name::{NAME_BYTES, Name};

/// Reals inside an image, read where they lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Reals<'a>(&'a [u8]);

impl<'a> Reals<'a> {
    /// The number of reals.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.0.len() / REAL_BYTES
    }

    /// True if there are none.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The one at `index`.
    #[must_use]
    pub fn get(&self, index: usize) -> Option<f32> {
        let start = index.checked_mul(REAL_BYTES)?;
        let bytes = self.0.get(start..)?.first_chunk::<REAL_BYTES>()?;
        Some(f32::from_le_bytes(*bytes))
    }

    /// All, in order.
    pub fn iter(&self) -> impl ExactSizeIterator<Item = f32> + use<'a> {
        self.0.as_chunks::<REAL_BYTES>().0.iter().map(|bytes| f32::from_le_bytes(*bytes))
    }

    /// Copies all to the front of `out` and returns that part; `None` if `out` is too short.
    pub fn copy_to<'b>(&self, out: &'b mut [f32]) -> Option<&'b [f32]> {
        let front = out.get_mut(..self.len())?;
        for (place, value) in front.iter_mut().zip(self.iter()) {
            *place = value;
        }
        Some(front)
    }
}

/// A checked image, borrowed from its bytes.
#[derive(Debug, Clone, PartialEq)]
pub struct PrimitiveImage<'a> {
    bytes: &'a [u8],
    name: Name,
    crc: u32,
    content: ImageContent<Reals<'a>>,
}

impl<'a> PrimitiveImage<'a> {
    /// Checks `bytes` and reads them.
    ///
    /// The hash of the robot model is left to the caller to compare.
    ///
    /// # Errors
    /// [`ImageError`] with the first reason found, in the order magic, schema, length, check sum, counts,
    /// name, finite numbers: an image of another version is named as such, not as damaged.
    pub fn parse(bytes: &'a [u8]) -> Result<Self, ImageError> {
        let mut header = Cursor(bytes);
        let short = ImageError::TooShort { length: clip(bytes.len()) };
        if header.array::<4>().ok_or(short)? != MAGIC {
            return Err(ImageError::Magic);
        }
        let schema = header.u16().ok_or(short)?;
        if schema != IMAGE_SCHEMA {
            return Err(ImageError::Schema { found: schema });
        }
        let flags = header.u16().ok_or(short)?;
        let length = header.u32().ok_or(short)?;
        if length != clip(bytes.len()) {
            return Err(ImageError::Length { expected: length, found: clip(bytes.len()) });
        }
        let (covered, stored) = bytes.split_last_chunk::<CRC_BYTES>().ok_or(short)?;
        let (computed, stored) = (CRC.checksum(covered), u32::from_le_bytes(*stored));
        if computed != stored {
            return Err(ImageError::Crc { computed, stored });
        }
        let model_hash = header.u32().ok_or(short)?;
        let name = header.array::<NAME_BYTES>().ok_or(short)?;
        let counts = Counts {
            kernels: usize::from(header.u16().ok_or(short)?),
            k1_points: usize::from(header.u16().ok_or(short)?),
            k2_points: usize::from(header.u16().ok_or(short)?),
            expectation_points: usize::from(header.u16().ok_or(short)?),
            statistics_points: usize::from(header.u16().ok_or(short)?),
        };
        let statistics_trials = header.u16().ok_or(short)?;
        counts.check()?;
        if counts.bytes() != bytes.len() {
            return Err(ImageError::Length { expected: clip(counts.bytes()), found: clip(bytes.len()) });
        }
        if flags & !KNOWN_FLAGS != 0 {
            return Err(ImageError::Flags { found: flags });
        }
        let name = parse_name(&name)?;
        let body = covered.get(HEADER_BYTES..).ok_or(short)?;
        if let Some(real) = Reals(body).iter().position(|value| !value.is_finite()) {
            return Err(ImageError::NotFinite { real: clip(real) });
        }
        let content = read_content(Cursor(body), model_hash, flags, counts, statistics_trials).ok_or(short)?;
        Ok(Self { bytes, name, crc: computed, content })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &Name {
        &self.name
    }

    /// CRC-32 of all its bytes, the check sum at their end included. Together with the length it tells
    /// images apart.
    #[must_use]
    pub fn crc(&self) -> u32 {
        self.crc
    }

    /// All its bytes.
    #[must_use]
    pub fn bytes(&self) -> &'a [u8] {
        self.bytes
    }

    /// Returns its content.
    #[must_use]
    pub fn content(&self) -> &ImageContent<Reals<'a>> {
        &self.content
    }

    /// True if it has a table of expected sensor values.
    #[must_use]
    pub fn has_expectation(&self) -> bool {
        !self.content.expected_mean.is_empty()
    }

    /// True if it has sensor statistics of successful runs.
    #[must_use]
    pub fn has_statistics(&self) -> bool {
        !self.content.statistics_mean.is_empty()
    }
}

/// Check sum of a whole image as uploads and listings name it.
///
/// The CRC of data followed by its own CRC is one constant for all data; therefore this one leaves the
/// image's last four bytes out and is, for a good image, equal to them.
#[must_use]
pub fn stored_crc(image: &[u8]) -> u32 {
    image.split_last_chunk::<CRC_BYTES>().map_or(0, |(covered, _)| CRC.checksum(covered))
}

/// The name in the first bytes of an image that may be damaged; `None`: it cannot be one. A bit that has fallen over
/// may have made another name of it.
#[must_use]
pub fn legible_name(head: &[u8]) -> Option<Name> {
    let head = head.first_chunk::<NAMED_HEAD_BYTES>()?;
    parse_name(head.last_chunk()?).ok()
}

fn parse_name(bytes: &[u8; NAME_BYTES]) -> Result<Name, ImageError> {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(NAME_BYTES);
    let (name, padding) = bytes.split_at_checked(end).ok_or(ImageError::Name)?;
    if padding.iter().any(|byte| *byte != 0) {
        return Err(ImageError::Name);
    }
    let text = core::str::from_utf8(name).map_err(|_| ImageError::Name)?;
    Name::new(text).map_err(|_| ImageError::Name)
}

fn read_content<'a>(
    mut body: Cursor<'a>,
    model_hash: u32,
    flags: u16,
    counts: Counts,
    statistics_trials: u16,
) -> Option<ImageContent<Reals<'a>>> {
    let [duration, alpha, activation] = body.reals()?;
    let stiffness = body.reals()?;
    let damping = body.reals()?;
    let start = body.waypoint()?;
    let start_velocity = WaypointVelocity {
        position: body.reals()?,
        orientation: body.reals()?,
        posture: body.reals()?,
        hand: body.reals()?,
    };
    let goal = body.waypoint()?;
    let [position, orientation, hand] = body.reals()?;
    let clamps = FeedbackClamps { position, orientation, hand };
    let [recorded_duration, payload_mass] = body.reals()?;
    let payload_centre = body.reals()?;
    let [filter_cutoff, trials, spread_floor] = body.reals()?;
    Some(ImageContent {
        model_hash,
        duration,
        alpha,
        activation,
        stiffness,
        damping,
        orientation_error: if flags & FLAG_ROTATION_VECTOR == 0 {
            OrientationError::Quaternion
        } else {
            OrientationError::RotationVector
        },
        hemisphere: if flags & FLAG_NEAREST_HEMISPHERE == 0 { Hemisphere::Demonstrated } else { Hemisphere::Nearest },
        start,
        start_velocity,
        goal,
        clamps,
        marks: ExpectationMarks {
            recorded_duration,
            payload_mass,
            payload_centre,
            filter_cutoff,
            trials,
            spread_floor,
        },
        statistics_trials,
        kernels: counts.kernels,
        k1: body.table(COUPLED_ROWS * counts.k1_points)?,
        k2: body.table(SENSOR_ROWS * counts.k2_points)?,
        weights: body.table(WEIGHT_ROWS * counts.kernels)?,
        expected_mean: body.table(SENSOR_ROWS * counts.expectation_points)?,
        statistics_mean: body.table(STATISTICS_ROWS * counts.statistics_points)?,
        statistics_spread: body.table(STATISTICS_ROWS * counts.statistics_points)?,
    })
}

/// Reads from the front of bytes; `None` when there are too few.
struct Cursor<'a>(&'a [u8]);

impl<'a> Cursor<'a> {
    fn array<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (front, rest) = self.0.split_first_chunk::<N>()?;
        self.0 = rest;
        Some(*front)
    }

    fn u16(&mut self) -> Option<u16> {
        self.array().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Option<u32> {
        self.array().map(u32::from_le_bytes)
    }

    fn table(&mut self, reals: usize) -> Option<Reals<'a>> {
        let (front, rest) = self.0.split_at_checked(reals.checked_mul(REAL_BYTES)?)?;
        self.0 = rest;
        Some(Reals(front))
    }

    fn reals<const N: usize>(&mut self) -> Option<[f32; N]> {
        let mut values = [0.0; N];
        self.table(N)?.copy_to(&mut values)?;
        Some(values)
    }

    fn waypoint(&mut self) -> Option<Waypoint> {
        Some(Waypoint {
            position: self.reals()?,
            orientation: self.reals()?,
            posture: self.reals()?,
            hand: self.reals()?,
        })
    }
}
