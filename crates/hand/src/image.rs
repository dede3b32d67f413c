//! `ImageReader`: an uploaded image to [`FingerTables`], byte by byte.
//!
//! An image has up to 25 kB, of which the hand needs a tenth. So it is never held: header, numbers and check sum pass
//! through, the hand's columns are kept. What a whole image is checked for by
//! `link::PrimitiveImage` is checked here as well; `tests/fixed/image.rs` holds the two against each other. Layout:
//! `docs/image-format.md`.

use dmp::Scalar;
use link::image::{
    COUPLED_ROWS, EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, IMAGE_SCHEMA, ImageError, KERNEL_LIMIT, MAGIC,
    SENSOR_ROWS, STATISTICS_POINTS_LIMIT, STATISTICS_ROWS, WEIGHT_ROWS, image_bytes,
};
use link::name::NAME_BYTES;
use link::{Name, Refusal};

use crate::primitive::FingerTables;
use crate::{DIGITS, FINGERS};

/// Bytes in front of the first real.
const HEADER_BYTES: usize = 60;
/// Bytes of the check sum at the end.
const CRC_BYTES: usize = 4;
/// Reals in front of the tables.
const FIXED_REALS: usize = 75;
/// First hand row of the weights and of the coupled rows (there the spread, which no gauge moves), first gauge of the
/// sensors.
const FIRST_WEIGHT_ROW: usize = WEIGHT_ROWS - DIGITS;
const FIRST_COUPLED_FINGER: usize = COUPLED_ROWS - FINGERS;
const FIRST_GAUGE: usize = SENSOR_ROWS - FINGERS;
/// Flags that have a meaning.
const KNOWN_FLAGS: u16 = 3;

/// The refusal of an image that is not sound.
fn refusal(error: ImageError) -> (Refusal, [u32; 2]) {
    match error {
        ImageError::Kernels { found } => (Refusal::TooManyKernels, [found, clip(KERNEL_LIMIT)]),
        error => (Refusal::ImageInvalid, [error.code(), error.number()]),
    }
}

/// The header, read.
#[derive(Clone, Debug)]
struct Header {
    model: u32,
    name: Name,
    kernels: usize,
    /// Reals of all tables up to the end of each, behind the fixed ones: K1, K2, weights, expected mean.
    ends: [usize; 4],
}

/// Name, size and contents of a whole image.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Its name.
    pub name: Name,
    /// Hash of the robot model it was learned with.
    pub model: u32,
    /// Check sum of its bytes.
    pub crc: u32,
    /// Its length (bytes).
    pub length: u32,
    /// Duration as taught (s).
    pub duration: f32,
    /// Kernels of each row.
    pub kernels: u16,
    /// True if it knows what the gauges should feel.
    pub expectation: bool,
}

/// Reads one image.
pub struct ImageReader {
    length: usize,
    received: usize,
    header_bytes: [u8; HEADER_BYTES],
    header: Option<Header>,
    /// The bytes of the real, or of the check sum, that is not whole yet.
    part: [u8; 4],
    digest: crc::Reader,
    /// Columns of the sample under way.
    sample: [f32; FINGERS],
    flaw: Option<ImageError>,
    stored_crc: u32,
}

/// CRC-32/ISCSI, one byte after another.
mod crc {
    /// The remainder so far.
    pub(super) struct Reader(u32);

    /// Reflected polynomial 0x1EDC6F41.
    const POLYNOMIAL: u32 = 0x82F6_3B78;

    /// Remainders of the sixteen values of four bits.
    const TABLE: [u32; 16] = {
        let mut table = [0; 16];
        let mut index = 0;
        while index < 16 {
            let mut value = index as u32;
            let mut bit = 0;
            while bit < 4 {
                value = if value & 1 == 1 { (value >> 1) ^ POLYNOMIAL } else { value >> 1 };
                bit += 1;
            }
            table[index] = value;
            index += 1;
        }
        table
    };

    impl Reader {
        pub(super) const fn new() -> Self {
            Reader(u32::MAX)
        }

        pub(super) fn take(&mut self, byte: u8) {
            let step = |value: u32| (value >> 4) ^ TABLE.get((value & 15) as usize).copied().unwrap_or(0);
            self.0 = step(step(self.0 ^ u32::from(byte)));
        }

        pub(super) fn sum(&self) -> u32 {
            !self.0
        }
    }
}

impl ImageReader {
    /// Awaits an image of `length` bytes.
    pub fn new(length: u32) -> Self {
        ImageReader {
            length: usize::try_from(length).unwrap_or(usize::MAX),
            received: 0,
            header_bytes: [0; HEADER_BYTES],
            header: None,
            part: [0; 4],
            digest: crc::Reader::new(),
            sample: [0.0; FINGERS],
            flaw: None,
            stored_crc: 0,
        }
    }

    /// Takes the next bytes and puts what they hold into `tables`, which are empty at first. A flaw is
    /// kept until the end: the host learns of it when it asks for the primitive to be stored.
    pub fn take(&mut self, bytes: &[u8], tables: &mut FingerTables) {
        for byte in bytes {
            let place = self.received;
            self.received += 1;
            if place + CRC_BYTES < self.length {
                self.digest.take(*byte);
            }
            if self.flaw.is_some() {
                self.note_crc(place, *byte);
                continue;
            }
            if let Err(flaw) = self.byte(place, *byte, tables) {
                self.flaw = Some(flaw);
            }
            self.note_crc(place, *byte);
        }
    }

    fn note_crc(&mut self, place: usize, byte: u8) {
        if let Some(index) = (place + CRC_BYTES).checked_sub(self.length).filter(|index| *index < CRC_BYTES) {
            self.stored_crc |= u32::from(byte) << (8 * index);
        }
    }

    fn byte(&mut self, place: usize, byte: u8, tables: &mut FingerTables) -> Result<(), ImageError> {
        if let Some(target) = self.header_bytes.get_mut(place) {
            *target = byte;
            if place + 1 == HEADER_BYTES {
                self.header = Some(self.read_header()?);
            }
            return Ok(());
        }
        let Some(index) = place.checked_sub(HEADER_BYTES).filter(|_| place + CRC_BYTES < self.length) else {
            return Ok(());
        };
        if let Some(target) = self.part.get_mut(index % 4) {
            *target = byte;
        }
        if index % 4 == 3 { self.real(index / 4, f32::from_le_bytes(self.part), tables) } else { Ok(()) }
    }

    fn read_header(&self) -> Result<Header, ImageError> {
        let bytes = &self.header_bytes;
        let word = |at: usize| bytes.get(at..).and_then(|rest| rest.first_chunk::<4>()).copied().unwrap_or_default();
        let half = |at: usize| {
            u16::from_le_bytes(bytes.get(at..).and_then(|rest| rest.first_chunk::<2>()).copied().unwrap_or_default())
        };
        if word(0) != MAGIC {
            return Err(ImageError::Magic);
        }
        if half(4) != IMAGE_SCHEMA {
            return Err(ImageError::Schema { found: half(4) });
        }
        let (announced, given) = (u32::from_le_bytes(word(8)), clip(self.length));
        if announced != given {
            return Err(ImageError::Length { expected: announced, found: given });
        }
        let [kernels, k1, k2, expected, statistics] = [48, 50, 52, 54, 56].map(|at| usize::from(half(at)));
        if !(2..=KERNEL_LIMIT).contains(&kernels) {
            return Err(ImageError::Kernels { found: clip(kernels) });
        }
        if k1.max(k2) > GAIN_POINTS_LIMIT || (k1 == 0) != (k2 == 0) {
            return Err(ImageError::GainPoints { found: clip(k1.max(k2)) });
        }
        if expected > EXPECTATION_POINTS_LIMIT {
            return Err(ImageError::ExpectationPoints { found: clip(expected) });
        }
        if statistics > STATISTICS_POINTS_LIMIT {
            return Err(ImageError::StatisticsPoints { found: clip(statistics) });
        }
        let whole = image_bytes(kernels, k1, k2, expected, statistics);
        if whole != self.length {
            return Err(ImageError::Length { expected: clip(whole), found: given });
        }
        if half(6) & !KNOWN_FLAGS != 0 {
            return Err(ImageError::Flags { found: half(6) });
        }
        let name = bytes.get(16..16 + NAME_BYTES).and_then(read_name).ok_or(ImageError::Name)?;
        let mut end = FIXED_REALS;
        let ends = [COUPLED_ROWS * k1, SENSOR_ROWS * k2, WEIGHT_ROWS * kernels, SENSOR_ROWS * expected].map(|reals| {
            end += reals;
            end
        });
        // What follows, spreads and statistics, concern the arm's watch alone.
        let _ = STATISTICS_ROWS;
        Ok(Header { model: u32::from_le_bytes(word(12)), name, kernels, ends })
    }

    fn real(&mut self, index: usize, value: f32, tables: &mut FingerTables) -> Result<(), ImageError> {
        if !value.is_finite() {
            return Err(ImageError::NotFinite { real: clip(index) });
        }
        let Some(Header { kernels, ends: [k1, k2, weights, expected], .. }) = self.header else {
            return Ok(());
        };
        tables.kernels = kernels;
        if index < FIXED_REALS {
            mark(index, value, tables);
        } else if index < k1 {
            self.column((index - FIXED_REALS) % COUPLED_ROWS, FIRST_COUPLED_FINGER, value, &mut tables.sensitivity);
        } else if index < k2 {
            self.column((index - k1) % SENSOR_ROWS, FIRST_GAUGE, value, &mut tables.weight);
        } else if index < weights {
            if (index - k2) / kernels >= FIRST_WEIGHT_ROW {
                // There is room for as many as the header may announce, here and below. One that cannot be kept is
                // missed when they are counted.
                let _ = crate::number::from_real(value).to_weight().map(|weight| tables.weights.push(weight));
            }
        } else if index < expected {
            self.column((index - weights) % SENSOR_ROWS, FIRST_GAUGE, value, &mut tables.expected);
        }
        Ok(())
    }

    /// A value of a table whose last three columns are the fingers'.
    fn column<const POINTS: usize>(
        &mut self,
        column: usize,
        first: usize,
        value: f32,
        table: &mut heapless::Vec<[f32; FINGERS], POINTS>,
    ) {
        let Some(finger) = column.checked_sub(first) else {
            return;
        };
        if let Some(place) = self.sample.get_mut(finger) {
            *place = value;
        }
        if finger + 1 == FINGERS {
            let _ = table.push(self.sample);
        }
    }

    /// Bytes received so far.
    pub fn received(&self) -> u32 {
        clip(self.received)
    }

    /// The image is whole: what it was, or why it is refused. `announced` is the check sum the host gave at the
    /// beginning.
    ///
    /// # Errors
    /// The refusal, with the numbers that belong to it.
    pub fn finish(self, tables: &FingerTables, announced: u32) -> Result<Summary, (Refusal, [u32; 2])> {
        let computed = self.digest.sum();
        // As a whole image is read: an image of another version is named as such, a damaged one as damaged, the rest as
        // it is.
        if let Some(error @ (ImageError::Magic | ImageError::Schema { .. })) = self.flaw {
            return Err(refusal(error));
        }
        if computed != self.stored_crc || computed != announced {
            // Arrived as announced, the image was wrong when it left: then its own check sum is the one that differs.
            let expected = if computed == announced { self.stored_crc } else { announced };
            return Err((Refusal::UploadCrc, [computed, expected]));
        }
        if let Some(error) = self.flaw {
            return Err(refusal(error));
        }
        let Some(header) = self.header else {
            return Err(refusal(ImageError::TooShort { length: clip(self.length) }));
        };
        Ok(Summary {
            name: header.name,
            model: header.model,
            crc: computed,
            length: clip(self.length),
            duration: tables.duration,
            kernels: u16::try_from(header.kernels).unwrap_or(u16::MAX),
            expectation: !tables.expected.is_empty(),
        })
    }
}

/// One of the reals in front of the tables.
fn mark(index: usize, value: f32, tables: &mut FingerTables) {
    let place = match index {
        0 => Some(&mut tables.duration),
        1 => Some(&mut tables.alpha),
        2 => Some(&mut tables.activation),
        6 => Some(&mut tables.stiffness),
        10 => Some(&mut tables.damping),
        25..29 => tables.start.get_mut(index - 25),
        42..46 => tables.start_velocity.get_mut(index - 42),
        60..64 => tables.goal.get_mut(index - 60),
        66 => Some(&mut tables.limit),
        67 => Some(&mut tables.recorded_duration),
        68 => Some(&mut tables.load_mass),
        69..72 => tables.load_centre.get_mut(index - 69),
        72 => Some(&mut tables.filter_cut_off),
        73 => Some(&mut tables.trials),
        74 => Some(&mut tables.spread_floor),
        _ => None,
    };
    if let Some(place) = place {
        *place = value;
    }
}

fn read_name(bytes: &[u8]) -> Option<Name> {
    let end = bytes.iter().position(|byte| *byte == 0).unwrap_or(bytes.len());
    let (name, padding) = bytes.split_at_checked(end)?;
    if padding.iter().any(|byte| *byte != 0) {
        return None;
    }
    Name::new(core::str::from_utf8(name).ok()?).ok()
}

fn clip(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::crc::Reader;

    #[test]
    fn the_check_sum_byte_by_byte_is_that_of_the_link() {
        for length in [0, 1, 7, 200] {
            let bytes: [u8; 200] = core::array::from_fn(|index| (index * 151 + length) as u8);
            let mut reader = Reader::new();
            bytes[..length].iter().for_each(|byte| reader.take(*byte));
            assert_eq!(reader.sum(), link::frame::CRC.checksum(&bytes[..length]));
        }
    }
}
