//! The weight of an arm's links in the form in which the device keeps it.
//!
//! ```text
//! "TacW" | layout u16 | payload u16 | model hash u32 | links 7 x (share, x, y, z) f32 | CRC-32/ISCSI u32
//! ```
//! All little endian; payload 0 for the bare arm, 1 for sensor and hand. Gravity compensation believes these numbers:
//! what is not finite or beyond the bounds of [`WeightCorrection::new`] is not used, whatever its check sum.

use control::model::{LinkWeight, WeightCorrection};
use control::{MODEL_HASH, Payload};
use link::HomeSource;
use link::frame::CRC;

/// Bytes of a weight as it is kept.
pub const WEIGHT_BYTES: usize = 128;

/// Begins every one.
const MAGIC: [u8; 4] = *b"TacW";

/// Version of the form.
const LAYOUT: u16 = 1;

/// The bytes that are kept.
#[must_use]
pub fn encode(weight: &WeightCorrection) -> [u8; WEIGHT_BYTES] {
    let payload: u16 = match weight.payload() {
        Payload::None => 0,
        Payload::SensorAndHand => 1,
    };
    let head = MAGIC.into_iter().chain(LAYOUT.to_le_bytes()).chain(payload.to_le_bytes());
    let links = weight.links().iter().flat_map(|LinkWeight { share, shift: [x, y, z] }| [*share, *x, *y, *z]);
    let body = head.chain(MODEL_HASH.to_le_bytes()).chain(links.flat_map(f32::to_le_bytes));
    let mut bytes = [0; WEIGHT_BYTES];
    for (place, byte) in bytes.iter_mut().zip(body) {
        *place = byte;
    }
    if let Some((body, sum)) = bytes.split_last_chunk_mut::<4>() {
        *sum = CRC.checksum(body).to_le_bytes();
    }
    bytes
}

/// The weight of an arm's links as the device has kept it. The first variant is all zeros in memory, which takes a tag
/// of its own: without it the payload would be the tag.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(u8)]
pub enum StoredWeight {
    /// There is none, or it was forgotten.
    #[default]
    Nothing,
    /// This one.
    Kept(WeightCorrection),
    /// There is one whose check sum is wrong.
    Damaged,
    /// There is a sound one of another layout, for another robot model, or beyond the bounds of this firmware.
    Foreign,
}

impl StoredWeight {
    /// Reads what was kept; no bytes at all stand for a weight that was forgotten.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        if bytes.is_empty() {
            return Self::Nothing;
        }
        let Some((body, sum)) = bytes.split_last_chunk::<4>() else { return Self::Damaged };
        if CRC.checksum(body).to_le_bytes() != *sum {
            return Self::Damaged;
        }
        Self::parse(body).map_or(Self::Foreign, Self::Kept)
    }

    /// The weight in a body whose check sum is right.
    fn parse(body: &[u8]) -> Option<WeightCorrection> {
        let (magic, rest) = body.split_first_chunk::<4>()?;
        let (layout, rest) = rest.split_first_chunk::<2>()?;
        let (payload, rest) = rest.split_first_chunk::<2>()?;
        let (hash, rest) = rest.split_first_chunk::<4>()?;
        if *magic != MAGIC || u16::from_le_bytes(*layout) != LAYOUT || u32::from_le_bytes(*hash) != MODEL_HASH {
            return None;
        }
        let payload = match u16::from_le_bytes(*payload) {
            0 => Payload::None,
            1 => Payload::SensorAndHand,
            _ => return None,
        };
        let (links, []) = rest.as_chunks::<16>() else { return None };
        let links: &[[u8; 16]; 7] = links.try_into().ok()?;
        let links = links.map(|link| {
            let [share, x, y, z] = core::array::from_fn(|index| {
                link.as_chunks::<4>().0.get(index).map_or(f32::NAN, |bytes| f32::from_le_bytes(*bytes))
            });
            LinkWeight { share, shift: [x, y, z] }
        });
        WeightCorrection::new(payload, links).ok()
    }

    /// The weight that counts: this arm's own, or else the model's.
    #[must_use]
    pub fn correction(&self) -> WeightCorrection {
        match self {
            Self::Kept(weight) => *weight,
            Self::Nothing | Self::Damaged | Self::Foreign => WeightCorrection::none(Payload::SensorAndHand),
        }
    }

    /// Payload that a person has declared: a weight counts with one only. `None`: nothing is declared.
    #[must_use]
    pub fn declared(&self) -> Option<Payload> {
        match self {
            Self::Kept(weight) => Some(weight.payload()),
            Self::Nothing | Self::Damaged | Self::Foreign => None,
        }
    }

    /// Whose that is.
    #[must_use]
    pub fn source(&self) -> HomeSource {
        match self {
            Self::Nothing => HomeSource::Model,
            Self::Kept(_) => HomeSource::Stored,
            Self::Damaged => HomeSource::Damaged,
            Self::Foreign => HomeSource::Foreign,
        }
    }
}
