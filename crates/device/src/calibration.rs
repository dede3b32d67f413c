//! `Home`: the posture in which one arm stands when it is zeroed, and the form in which the device keeps it.
//!
//! ```text
//! "TacH" | layout u16 | 0 u16 | model hash u32 | home 7 f32 (rad) | CRC-32/ISCSI u32        all little endian
//! ```
//! The stops at which an arm is brought home are where its maker's screws and cables put them, some degrees beside
//! those of the model. What is wrong here is wrong in every angle afterwards: in the weight that gravity compensation
//! carries, in the limits, in every place.

use core::fmt;
use core::ops::RangeInclusive;

use control::{MODEL_HASH, model};
use link::frame::CRC;
use link::{Calibration, HomeSource};

/// Largest distance of a joint's home from the model's (rad): 20 degrees.
///
/// Arms differ from the default home by a few degrees. What is to be kept out are angles in degrees, a wrong sign, two
/// joints exchanged, and an arm that was not at home: all of them are larger, in at least one joint, for an arm folded
/// at home (J2 -2.0, J4 3.13 rad). A smaller bound would refuse arms whose stops have been rebuilt.
pub const HOME_DISTANCE: f32 = 0.35;

/// Largest distance of a home beyond the joint's range (rad): home is at the stops, and stops are where cables stretch.
const MARGIN: f32 = 0.05;

/// Bytes of a home as it is kept.
pub const HOME_BYTES: usize = 44;

/// Begins every one.
const MAGIC: [u8; 4] = *b"TacH";

/// Version of the form.
const LAYOUT: u16 = 1;

/// Reason for which an angle is no home.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum HomeFault {
    /// It is not a number.
    NotANumber = 0,
    /// The joint cannot stand there.
    OutOfRange = 1,
    /// It is farther than [`HOME_DISTANCE`] from the model's home.
    TooFar = 2,
}

/// Why a posture is not the home of an arm: the first joint that cannot be there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HomeError {
    /// Which joint, 0 for J1.
    pub joint: u8,
    /// Description.
    pub fault: HomeFault,
}

impl HomeError {
    /// The error as it goes over the link, in the detail of `link::Refusal::HomeImplausible`.
    #[must_use]
    pub fn detail(self) -> [u32; 2] {
        [self.joint.into(), self.fault as u32]
    }

    /// The error that such a detail stands for; `None` for numbers of another version.
    #[must_use]
    pub fn from_detail([joint, fault]: [u32; 2]) -> Option<Self> {
        let joint = u8::try_from(joint).ok().filter(|joint| usize::from(*joint) < model::HOME.len())?;
        let faults = [HomeFault::NotANumber, HomeFault::OutOfRange, HomeFault::TooFar];
        let fault = faults.into_iter().find(|known| *known as u32 == fault)?;
        Some(Self { joint, fault })
    }
}

impl fmt::Display for HomeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let joint = usize::from(self.joint);
        write!(f, "J{} ", joint + 1)?;
        match self.fault {
            HomeFault::NotANumber => f.write_str("is not a number"),
            HomeFault::OutOfRange => {
                let range = reach(joint);
                write!(f, "cannot stand there; its range is {:.2} to {:.2} rad", range.start(), range.end())
            }
            HomeFault::TooFar => {
                let home = model::HOME.get(joint).copied().unwrap_or_default();
                write!(f, "is more than {HOME_DISTANCE} rad from the model's home, {home:.2} rad")
            }
        }
    }
}

impl core::error::Error for HomeError {}

/// Where a joint can stand when it is zeroed (rad), its stops included. Empty for a joint there is none of.
pub(crate) fn reach(joint: usize) -> RangeInclusive<f32> {
    match (model::POSITION_MIN.get(joint), model::POSITION_MAX.get(joint)) {
        (Some(least), Some(most)) => *least as f32 - MARGIN..=*most as f32 + MARGIN,
        _ => 1.0..=0.0,
    }
}

/// Joint angles at which an arm stands when it is zeroed (rad): finite, within the joints' reach, near the model's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Home([f32; 7]);

impl Home {
    /// Checks a posture.
    ///
    /// # Errors
    /// [`HomeError`] names the first joint that cannot be at home there.
    pub fn new(angles: [f32; 7]) -> Result<Self, HomeError> {
        for (joint, (angle, home)) in (0_u8..).zip(angles.iter().zip(model::HOME)) {
            let fault = if !angle.is_finite() {
                HomeFault::NotANumber
            } else if !reach(joint.into()).contains(angle) {
                HomeFault::OutOfRange
            } else if (angle - home as f32).abs() > HOME_DISTANCE {
                HomeFault::TooFar
            } else {
                continue;
            };
            return Err(HomeError { joint, fault });
        }
        Ok(Self(angles))
    }

    /// The home of the robot model, for an arm that has none of its own.
    #[must_use]
    pub fn of_model() -> Self {
        Self(model::HOME.map(|angle| angle as f32))
    }

    /// The angles (rad).
    #[must_use]
    pub fn angles(&self) -> &[f32; 7] {
        &self.0
    }

    /// The bytes that are kept.
    #[must_use]
    pub fn encode(&self) -> [u8; HOME_BYTES] {
        let head = MAGIC.into_iter().chain(LAYOUT.to_le_bytes()).chain([0; 2]).chain(MODEL_HASH.to_le_bytes());
        let body = head.chain(self.0.into_iter().flat_map(f32::to_le_bytes));
        let mut bytes = [0; HOME_BYTES];
        for (place, byte) in bytes.iter_mut().zip(body) {
            *place = byte;
        }
        if let Some((body, sum)) = bytes.split_last_chunk_mut::<4>() {
            *sum = CRC.checksum(body).to_le_bytes();
        }
        bytes
    }
}

/// An arm's own home as the device has kept it. The first variant is all zeros in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum StoredHome {
    /// There is none, or it was forgotten.
    #[default]
    Nothing,
    /// This one.
    Kept(Home),
    /// There is one whose check sum is wrong.
    Damaged,
    /// There is a sound one of another layout, for another robot model, or beyond the bounds of this firmware.
    Foreign,
}

impl StoredHome {
    /// Reads what was kept; no bytes at all stand for a home that was forgotten.
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

    /// The home in a body whose check sum is right.
    fn parse(body: &[u8]) -> Option<Home> {
        let (head, angles) = body.split_first_chunk::<8>()?;
        let [a, b, c, d, low, high, ..] = *head;
        let (hash, angles) = angles.split_first_chunk::<4>()?;
        let known = [a, b, c, d] == MAGIC && u16::from_le_bytes([low, high]) == LAYOUT;
        if !known || u32::from_le_bytes(*hash) != MODEL_HASH {
            return None;
        }
        let (angles, []) = angles.as_chunks::<4>() else { return None };
        let angles: &[[u8; 4]; 7] = angles.try_into().ok()?;
        Home::new(angles.map(f32::from_le_bytes)).ok()
    }

    /// The home that counts: this arm's own, or else the model's.
    #[must_use]
    pub fn home(&self) -> Home {
        match self {
            Self::Kept(home) => *home,
            Self::Nothing | Self::Damaged | Self::Foreign => Home::of_model(),
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

    /// The same for the link, with the posture of the last zeroing.
    #[must_use]
    pub fn calibration(&self, zeroed_at: Option<[f32; 7]>) -> Calibration {
        Calibration { home: *self.home().angles(), source: self.source(), zeroed_at }
    }
}
