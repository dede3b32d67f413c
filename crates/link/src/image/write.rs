//! Plain numbers to an image.

use super::content::{Hemisphere, ImageContent, OrientationError, Waypoint};
use super::counts::{Counts, clip};
use super::error::ImageError;
use super::layout::{
    COUPLED_ROWS, FLAG_NEAREST_HEMISPHERE, FLAG_ROTATION_VECTOR, HEADER_BYTES, IMAGE_SCHEMA, MAGIC, REAL_BYTES,
    SENSOR_ROWS, STATISTICS_ROWS, WEIGHT_ROWS,
};
use crate::frame::CRC;
use crate::name::{NAME_BYTES, Name};

/// Bytes of an image up to the end of its name.
pub const NAMED_HEAD_BYTES: usize = 16 + NAME_BYTES;

/// The first bytes of `image` with another name in them. What follows is the same for every name, but for the check
/// sum at the end. `None`: `image` is shorter than that.
#[must_use]
pub fn renamed_head(image: &[u8], name: &Name) -> Option<[u8; NAMED_HEAD_BYTES]> {
    let mut head = *image.first_chunk::<NAMED_HEAD_BYTES>()?;
    head.last_chunk_mut::<NAME_BYTES>()?.copy_from_slice(&padded(name));
    Some(head)
}

fn padded(name: &Name) -> [u8; NAME_BYTES] {
    let mut padded = [0; NAME_BYTES];
    for (place, byte) in padded.iter_mut().zip(name.as_str().bytes()) {
        *place = byte;
    }
    padded
}

impl ImageContent<&[f32]> {
    /// Writes the image to the front of `out` and returns its length.
    ///
    /// # Errors
    /// [`ImageError::Shape`] if a table does not fit the counts or `out` is too small
    /// ([`image_bytes`](super::image_bytes)); the same errors as
    /// [`PrimitiveImage::parse`](super::PrimitiveImage::parse) for counts and reals that could not be read back.
    pub fn encode(&self, name: &Name, out: &mut [u8]) -> Result<usize, ImageError> {
        let counts = Counts {
            kernels: self.kernels,
            k1_points: points(self.k1, COUPLED_ROWS)?,
            k2_points: points(self.k2, SENSOR_ROWS)?,
            expectation_points: points(self.expected_mean, SENSOR_ROWS)?,
            statistics_points: points(self.statistics_mean, STATISTICS_ROWS)?,
        };
        counts.check()?;
        if self.weights.len() != WEIGHT_ROWS * self.kernels
            || self.statistics_spread.len() != self.statistics_mean.len()
        {
            return Err(ImageError::Shape);
        }
        let length = counts.bytes();
        let out = out.get_mut(..length).ok_or(ImageError::Shape)?;
        let mut flags = 0;
        if self.orientation_error == OrientationError::RotationVector {
            flags |= FLAG_ROTATION_VECTOR;
        }
        if self.hemisphere == Hemisphere::Nearest {
            flags |= FLAG_NEAREST_HEMISPHERE;
        }
        let mut writer = Writer { out, position: 0 };
        writer.bytes(&MAGIC)?;
        writer.bytes(&IMAGE_SCHEMA.to_le_bytes())?;
        writer.bytes(&flags.to_le_bytes())?;
        writer.bytes(&clip(length).to_le_bytes())?;
        writer.bytes(&self.model_hash.to_le_bytes())?;
        writer.bytes(&padded(name))?;
        for count in
            [counts.kernels, counts.k1_points, counts.k2_points, counts.expectation_points, counts.statistics_points]
        {
            writer.bytes(&u16::try_from(count).map_err(|_| ImageError::Shape)?.to_le_bytes())?;
        }
        writer.bytes(&self.statistics_trials.to_le_bytes())?;
        writer.reals(&[self.duration, self.alpha, self.activation])?;
        writer.reals(&self.stiffness)?;
        writer.reals(&self.damping)?;
        writer.waypoint(&self.start)?;
        let velocity = &self.start_velocity;
        writer.reals(&velocity.position)?;
        writer.reals(&velocity.orientation)?;
        writer.reals(&velocity.posture)?;
        writer.reals(&velocity.hand)?;
        writer.waypoint(&self.goal)?;
        writer.reals(&[self.clamps.position, self.clamps.orientation, self.clamps.hand])?;
        let marks = &self.marks;
        writer.reals(&[marks.recorded_duration, marks.payload_mass])?;
        writer.reals(&marks.payload_centre)?;
        writer.reals(&[marks.filter_cutoff, marks.trials, marks.spread_floor])?;
        for table in [self.k1, self.k2, self.weights, self.expected_mean, self.statistics_mean, self.statistics_spread]
        {
            writer.reals(table)?;
        }
        let written = writer.position;
        let crc = CRC.checksum(out.get(..written).ok_or(ImageError::Shape)?);
        out.get_mut(written..).ok_or(ImageError::Shape)?.copy_from_slice(&crc.to_le_bytes());
        Ok(length)
    }
}

/// Number of points of a table with so many rows.
fn points(table: &[f32], rows: usize) -> Result<usize, ImageError> {
    if table.len().is_multiple_of(rows) { Ok(table.len() / rows) } else { Err(ImageError::Shape) }
}

/// Writes to the front of a buffer; refuses reals that could not be read back.
struct Writer<'a> {
    out: &'a mut [u8],
    position: usize,
}

impl Writer<'_> {
    fn bytes(&mut self, bytes: &[u8]) -> Result<(), ImageError> {
        let end = self.position + bytes.len();
        self.out.get_mut(self.position..end).ok_or(ImageError::Shape)?.copy_from_slice(bytes);
        self.position = end;
        Ok(())
    }

    fn reals(&mut self, values: &[f32]) -> Result<(), ImageError> {
        for value in values {
            if !value.is_finite() {
                let real = (self.position - HEADER_BYTES) / REAL_BYTES;
                return Err(ImageError::NotFinite { real: clip(real) });
            }
            self.bytes(&value.to_le_bytes())?;
        }
        Ok(())
    }

    fn waypoint(&mut self, waypoint: &Waypoint) -> Result<(), ImageError> {
        self.reals(&waypoint.position)?;
        self.reals(&waypoint.orientation)?;
        self.reals(&waypoint.posture)?;
        self.reals(&waypoint.hand)
    }
}
