//! Frames of the wrist force/torque sensor (node 8): three 16-bit counts, little-endian, and a status byte at times.
//!
//! GET FT answers with two frames, force then torque. Little-endian, unlike positions and torques of the motors.

use crate::can::{CanFrame, CanId, Group, Node};
use crate::message::{get, set};
use crate::property::PropertyId;
use crate::units::Real;

/// Newton per count of a force frame (exact in binary).
pub const NEWTON_PER_COUNT: f64 = 1.0 / 256.0;
/// Newton metre per count of a torque frame (exact in binary).
pub const NEWTON_METRE_PER_COUNT: f64 = 1.0 / 4096.0;
/// Unit of acceleration per count. The library's header says m/s^2; this was never verified.
pub const ACCELERATION_PER_COUNT: f64 = 1.0 / 1024.0;

/// Status of the strain gauges since the last tare: `R B G5..G0`, appended to the torque frame only when a gauge
/// saturated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct GaugeStatus(pub u8);

impl GaugeStatus {
    /// A new tare is suggested (bit 7).
    #[must_use]
    pub const fn suggests_tare(self) -> bool {
        self.0 & 0x80 != 0
    }

    /// The data of this very sample are bad (bit 6).
    #[must_use]
    pub const fn is_bad(self) -> bool {
        self.0 & 0x40 != 0
    }

    /// Gauges that have saturated since the last tare, bit 0 = gauge 1.
    #[must_use]
    pub const fn saturated_gauges(self) -> u8 {
        self.0 & 0x3F
    }
}

/// One sample of the sensor in counts: the wrench of the environment on the robot's tool side, in the sensor frame.
///
/// On the bus it is two frames, [`Reply::Force`](crate::Reply::Force) and [`Reply::Torque`](crate::Reply::Torque); put
/// them together only if they answer the same request.
///
/// ```
/// use puck::RawWrench;
///
/// let sample = RawWrench { force: [256, 0, -512], ..RawWrench::default() };
/// assert_eq!(sample.newtons::<f32>(), [1.0, 0.0, -2.0]);
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct RawWrench {
    /// x, y, z; 1/256 N per count.
    pub force: [i16; 3],
    /// x, y, z; 1/4096 N m per count.
    pub torque: [i16; 3],
    /// Present when some gauge has saturated since the last tare.
    pub status: Option<GaugeStatus>,
}

impl RawWrench {
    /// The force in N, sensor frame.
    #[must_use]
    pub fn newtons<R: Real>(&self) -> [R; 3] {
        scaled_counts(self.force, NEWTON_PER_COUNT)
    }

    /// The torque in N m, sensor frame.
    #[must_use]
    pub fn newton_metres<R: Real>(&self) -> [R; 3] {
        scaled_counts(self.torque, NEWTON_METRE_PER_COUNT)
    }
}

/// Counts times their unit. The units are powers of two: exact in both types.
#[must_use]
pub fn scaled_counts<R: Real>(counts: [i16; 3], unit: f64) -> [R; 3] {
    counts.map(|count| R::from_i32(count as i32) * R::from_f64(unit))
}

/// A physical value in counts of `unit`, rounded down, saturated to 16 bits.
///
/// For the device side. NaN becomes 0: a sensor has no way to send it.
pub fn quantise<R: Real>(value: R, unit: f64) -> i16 {
    let counts = (value / R::from_f64(unit)).floor().to_i32();
    counts.clamp(i16::MIN as i32, i16::MAX as i32) as i16
}

/// Ask for one force and torque sample: two frames will answer.
#[must_use]
pub fn get_wrench() -> CanFrame {
    get(Node::FORCE_TORQUE, PropertyId::FORCE_TORQUE)
}

/// Ask for the acceleration: one frame will answer.
#[must_use]
pub fn get_acceleration() -> CanFrame {
    get(Node::FORCE_TORQUE, PropertyId::ACCELERATION)
}

/// Make the present load the zero. No reply; throw the first sample after it away.
#[must_use]
pub fn tare() -> CanFrame {
    set(Node::FORCE_TORQUE, PropertyId::FORCE_TORQUE, 0)
}

/// Three little-endian counts; `None` unless the payload has six or seven bytes. Byte 6 is the status.
pub(crate) fn decode(payload: &[u8]) -> Option<([i16; 3], Option<GaugeStatus>)> {
    let status = match payload.len() {
        6 => None,
        7 => payload.get(6).map(|byte| GaugeStatus(*byte)),
        _ => return None,
    };
    let &[x0, x1, y0, y1, z0, z1] = payload.first_chunk::<6>()?;
    let counts = [i16::from_le_bytes([x0, x1]), i16::from_le_bytes([y0, y1]), i16::from_le_bytes([z0, z1])];
    Some((counts, status))
}

/// Device side: the force frame, x, y, z in 1/256 N.
#[must_use]
pub fn force_frame(force: [i16; 3]) -> CanFrame {
    six_bytes(Group::FORCE_REPLIES, force)
}

/// Device side: the torque frame, x, y, z in 1/4096 N m, with the status byte if there is one.
#[must_use]
pub fn torque_frame(torque: [i16; 3], status: Option<GaugeStatus>) -> CanFrame {
    match status {
        None => six_bytes(Group::TORQUE_REPLIES, torque),
        Some(GaugeStatus(status)) => {
            let [a, b, c, d, e, f] = little_endian(torque);
            CanFrame::with_payload(id(Group::TORQUE_REPLIES), [a, b, c, d, e, f, status])
        }
    }
}

/// Device side: the acceleration frame, x, y, z in 1/1024.
#[must_use]
pub fn acceleration_frame(acceleration: [i16; 3]) -> CanFrame {
    six_bytes(Group::ACCELERATION_REPLIES, acceleration)
}

fn six_bytes(group: Group, counts: [i16; 3]) -> CanFrame {
    CanFrame::with_payload(id(group), little_endian(counts))
}

fn id(group: Group) -> CanId {
    CanId::encode(Node::FORCE_TORQUE, group)
}

fn little_endian(counts: [i16; 3]) -> [u8; 6] {
    let [[a, b], [c, d], [e, f]] = counts.map(i16::to_le_bytes);
    [a, b, c, d, e, f]
}
