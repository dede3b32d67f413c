//! The BarrettHand BH8-280: encoder counts to finger angles, and the commands that move it.
//!
//! A finger has one motor and two links. Motor and inner link are geared 125:1, the secondary encoder sits on the worm
//! at 50:1, the outer link moves by 1/375 relative to the inner one until the TorqueSwitch breaks away. The spread is
//! 17.5:1. Integers are *truncated toward zero* here, as in Barrett's library, except torques, which are rounded down.

use crate::can::{CanFrame, Group, Node};
use crate::message::{packed_torques, set};
use crate::property::{Property, PropertyId, PropertyTable};
use crate::state::MotorMode;
use crate::units::{Counts, NotFinite, PuckTorque, Real};

/// Motor revolutions per revolution of an inner link.
pub const INNER_LINK_RATIO: f64 = 125.0;
/// Motor revolutions per revolution of an outer link relative to its inner link, before breakaway.
pub const OUTER_LINK_RATIO: f64 = 375.0;
/// Secondary encoder revolutions per revolution of an inner link.
pub const SECONDARY_RATIO: f64 = 50.0;
/// Motor revolutions per revolution of the spread.
pub const SPREAD_RATIO: f64 = 17.5;
/// Encoder counts per revolution, motor and secondary.
pub const COUNTS_PER_REVOLUTION: f64 = 4096.0;

/// Radian per count.
const RADIAN_PER_COUNT: f64 = core::f64::consts::TAU / COUNTS_PER_REVOLUTION;
/// Commands of velocity are in counts per millisecond.
const MILLISECONDS_PER_SECOND: f64 = 1000.0;
/// Motor revolutions per joint revolution in the order of [`Node::HAND`].
const RATIOS: [f64; 4] = [INNER_LINK_RATIO, INNER_LINK_RATIO, INNER_LINK_RATIO, SPREAD_RATIO];

/// Values of CMD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
#[repr(u8)]
pub enum HandCommand {
    /// 0.
    Load = 0,
    /// 1.
    Save = 1,
    /// 2.
    Reset = 2,
    /// 3: default.
    Default = 3,
    /// 4.
    Get = 4,
    /// 5: calibrate.
    Find = 5,
    /// 6.
    Set = 6,
    /// 7.
    Home = 7,
    /// 8.
    Keep = 8,
    /// 9.
    Loop = 9,
    /// 10.
    Pass = 10,
    /// 11: version.
    Version = 11,
    /// 12: error.
    Error = 12,
    /// 13 (HI): drive to the open stop and set P = 0. Until MODE tells the end, send nothing but GET MODE.
    Initialise = 13,
    /// 14 (IC): close by the default step.
    IncrementClose = 14,
    /// 15 (IO): open by the default step.
    IncrementOpen = 15,
    /// 16 (TC): close with torque.
    TorqueClose = 16,
    /// 17 (TO): open with torque.
    TorqueOpen = 17,
    /// 18 (C): close.
    Close = 18,
    /// 19 (M): move to the default position.
    Move = 19,
    /// 20 (O): open.
    Open = 20,
    /// 21 (T): terminate.
    Terminate = 21,
    /// 22.
    Help = 22,
}

/// Angles of the hand, rad.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct HandAngles<R> {
    /// Inner link of each finger, 0 open.
    pub inner: [R; 3],
    /// Outer link of each finger relative to its inner link; the mechanical bend of about 42 degrees is not included.
    pub outer: [R; 3],
    /// Spread; at 0 F1 and F2 stand opposite F3.
    pub spread: R,
}

/// Angles from the positions of the four pucks, in the order of [`Node::HAND`].
///
/// A finger without a secondary position gets `outer = inner / 3`, which holds only before breakaway.
#[must_use]
pub fn angles<R: Real>(primary: &[Counts; 4], secondary: &[Option<Counts>; 3]) -> HandAngles<R> {
    let scale = |counts: Counts, factor: f64| R::from_i32(counts.0) * R::from_f64(factor);
    let mut inner = [R::from_f64(0.0); 3];
    let mut outer = inner;
    for (((inner, outer), motor), worm) in inner.iter_mut().zip(&mut outer).zip(primary).zip(secondary) {
        match worm {
            Some(worm) => {
                let both_links = RADIAN_PER_COUNT * (1.0 / INNER_LINK_RATIO + 1.0 / OUTER_LINK_RATIO);
                *inner = scale(*worm, RADIAN_PER_COUNT / SECONDARY_RATIO);
                *outer = scale(*motor, both_links) - *inner;
            }
            None => {
                *inner = scale(*motor, RADIAN_PER_COUNT / INNER_LINK_RATIO);
                *outer = *inner * R::from_f64(INNER_LINK_RATIO / OUTER_LINK_RATIO);
            }
        }
    }
    let [_, _, _, spread] = *primary;
    HandAngles { inner, outer, spread: scale(spread, RADIAN_PER_COUNT / SPREAD_RATIO) }
}

/// Device side: counts of motor and secondary encoder of a finger before breakaway at this inner angle, rounded down.
pub fn finger_counts<R: Real>(inner: R) -> (Counts, Counts) {
    let counts = |ratio: f64| Counts((inner * R::from_f64(ratio / RADIAN_PER_COUNT)).floor().to_i32());
    (counts(INNER_LINK_RATIO), counts(SECONDARY_RATIO))
}

/// Reason for which no hand command was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum HandError {
    /// A value is NaN or infinite.
    NotFinite,
    /// The firmware of the hand has no such property.
    Property(Property),
    /// The IPNM of this digit (0..=3, in the order of [`Node::HAND`]) is not positive.
    UnitsPerNewtonMetre {
        /// Index of the digit.
        digit: usize,
    },
    /// A velocity does not fit into the 16 bits of V.
    Range,
}

impl core::fmt::Display for HandError {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        match self {
            HandError::NotFinite => NotFinite.fmt(formatter),
            HandError::Property(property) => write!(formatter, "the hand has no property {}", property.mnemonic()),
            HandError::Range => formatter.write_str("velocity does not fit into 16 bits"),
            HandError::UnitsPerNewtonMetre { digit } => {
                write!(formatter, "digit {} of the hand reports an IPNM that is not positive", digit + 1)
            }
        }
    }
}

impl core::error::Error for HandError {}

impl From<NotFinite> for HandError {
    fn from(_: NotFinite) -> HandError {
        HandError::NotFinite
    }
}

/// The frames that command a hand whose four pucks share one firmware generation. Angles are read by [`angles`].
///
/// ```
/// use puck::{PropertyTable, hand::{HandCommand, HandCommander}, Node};
///
/// let hand = HandCommander::new(&PropertyTable::motor(200)?)?;
/// let frame = hand.command(Node::FINGERS[0], HandCommand::Initialise);
/// let frames = hand.trapezoidal_move(&[1.0, 1.0, 1.0, 0.0])?; // rad; four targets, then the mode
/// # Ok::<(), Box<dyn core::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct HandCommander {
    command: PropertyId,
    end_point: PropertyId,
    position: PropertyId,
    torque: PropertyId,
    velocity: PropertyId,
}

impl HandCommander {
    /// Looks up the properties once.
    ///
    /// # Errors
    /// [`HandError::Property`] if the firmware lacks one.
    pub fn new(table: &PropertyTable) -> Result<HandCommander, HandError> {
        let id = |property: Property| table.id(property).ok_or(HandError::Property(property));
        Ok(HandCommander {
            command: id(Property::Cmd)?,
            end_point: id(Property::E)?,
            position: id(Property::P)?,
            torque: id(Property::T)?,
            velocity: id(Property::V)?,
        })
    }

    /// A command to one digit.
    #[must_use]
    pub fn command(&self, digit: Node, command: HandCommand) -> CanFrame {
        set(digit, self.command, command as i32)
    }

    /// A mode for all four digits.
    #[must_use]
    pub fn mode(&self, mode: MotorMode) -> CanFrame {
        set(Group::HAND, PropertyId::MODE, mode.value())
    }

    /// Move all digits to these angles (rad; inner links, spread): E to each, then MODE 5.
    ///
    /// # Errors
    /// [`HandError::NotFinite`].
    pub fn trapezoidal_move<R: Real>(&self, target: &[R; 4]) -> Result<[CanFrame; 5], HandError> {
        let [a, b, c, d] = each_digit(self.end_point, &joint_counts(target)?);
        Ok([a, b, c, d, self.mode(MotorMode::Trapezoidal)])
    }

    /// Move all digits with these velocities (rad/s) until told otherwise: V to each, then MODE 4.
    ///
    /// # Errors
    /// [`HandError::NotFinite`]; [`HandError::Range`] beyond 32 767 counts/ms, 402 rad/s of a finger.
    pub fn velocity_move<R: Real>(&self, velocity: &[R; 4]) -> Result<[CanFrame; 5], HandError> {
        let mut values = [0; 4];
        for ((value, velocity), ratio) in values.iter_mut().zip(velocity).zip(RATIOS) {
            let counts = finite(*velocity)? * R::from_f64(ratio / RADIAN_PER_COUNT);
            let counts = (counts / R::from_f64(MILLISECONDS_PER_SECOND)).to_i32();
            *value = i16::try_from(counts).map_err(|_| HandError::Range)?.into();
        }
        let [a, b, c, d] = each_digit(self.velocity, &values);
        Ok([a, b, c, d, self.mode(MotorMode::Velocity)])
    }

    /// Stream set-points (rad) to digits in MODE 3: P to each.
    ///
    /// # Errors
    /// [`HandError::NotFinite`].
    pub fn positions<R: Real>(&self, target: &[R; 4]) -> Result<[CanFrame; 4], HandError> {
        Ok(each_digit(self.position, &joint_counts(target)?))
    }

    /// Torques (N m at inner links and spread) to digits in MODE 2: one packed frame.
    ///
    /// Barrett's library sends this frame with a wrong property number (0xFB instead of 0xAA); we do not copy that.
    ///
    /// # Errors
    /// [`HandError::NotFinite`], [`HandError::UnitsPerNewtonMetre`]: such an IPNM would turn a torque round or lose it.
    pub fn torques<R: Real>(&self, torque: &[R; 4], units_per_newton_metre: &[i32; 4]) -> Result<CanFrame, HandError> {
        if let Some(digit) = units_per_newton_metre.iter().position(|units| *units <= 0) {
            return Err(HandError::UnitsPerNewtonMetre { digit });
        }
        let mut units = [PuckTorque::ZERO; 4];
        for (((units, torque), ipnm), ratio) in units.iter_mut().zip(torque).zip(units_per_newton_metre).zip(RATIOS) {
            *units = PuckTorque::from_units(*torque * R::from_i32(*ipnm) / R::from_f64(ratio))?;
        }
        Ok(packed_torques(Group::HAND, self.torque, units))
    }
}

/// Joint angles to motor counts, toward zero.
fn joint_counts<R: Real>(angles: &[R; 4]) -> Result<[i32; 4], NotFinite> {
    let mut counts = [0; 4];
    for ((count, angle), ratio) in counts.iter_mut().zip(angles).zip(RATIOS) {
        *count = (finite(*angle)? * R::from_f64(ratio / RADIAN_PER_COUNT)).to_i32();
    }
    Ok(counts)
}

fn finite<R: Real>(value: R) -> Result<R, NotFinite> {
    if value.is_finite() { Ok(value) } else { Err(NotFinite) }
}

fn each_digit(property: PropertyId, [a, b, c, d]: &[i32; 4]) -> [CanFrame; 4] {
    let [f1, f2, f3, spread] = Node::HAND;
    [set(f1, property, *a), set(f2, property, *b), set(f3, property, *c), set(spread, property, *d)]
}
