//! Numbers of the link for reasons of the device, and back to words for the host.
//!
//! Each mapping is an exhaustive match: a reason without a number does not compile.

use core::fmt;

use control::plan::bounds::Quantity;
use control::plan::load::{End, LoadError};
use control::plan::primitive::{ORIENTATION_ROWS, POSITION_ROWS, RowGroup};
use control::{CalibrationError, CycleRecord};
use dmp::{Entry, GainError, Group, Part, PrimitiveError, TableError};
use link::{Event as LinkEvent, EventKind as LinkKind, HandStage, Refusal as LinkRefusal, Telemetry};
use puck::Node;

use crate::command::Refusal;
use crate::event::{Event, EventKind};
use crate::health::Health;
use crate::stage::{Stage, StartupError};

/// A cycle number as it goes over the link, where it wraps after 165 days.
const fn cycle(number: u64) -> u32 {
    number as u32
}

/// A refusal of the control half as a refusal of the link, with its detail.
pub(crate) fn refusal(reason: Refusal, health: &Health) -> (LinkRefusal, [u32; 2]) {
    use control::Refusal as Control;
    match reason {
        Refusal::NotReady(Stage::WaitingForZero) => (LinkRefusal::NotZeroed, [0, 0]),
        Refusal::NotReady(stage) => (LinkRefusal::NotReady, [stage.code().into(), 0]),
        Refusal::ZeroNeedsIdle => (LinkRefusal::ZeroNeedsIdle, [0, 0]),
        Refusal::HomeOutOfRange { joint } => (LinkRefusal::BadValue, [joint.into(), 0]),
        Refusal::Control(Control::FaultLatched) => (LinkRefusal::Faulted, [health.fault.code().into(), 0]),
        Refusal::Control(Control::WrongState) => (LinkRefusal::State, [health.state.code().into(), 0]),
        Refusal::Control(Control::SafetyNotActive) => {
            (LinkRefusal::SafetyMode, [health.safety_mode.map_or(u32::MAX, |mode| mode.value().unsigned_abs()), 0])
        }
        Refusal::Control(Control::PositionsMissing) => (LinkRefusal::PositionsMissing, [0, 0]),
        Refusal::Control(Control::NoPrimitive) => (LinkRefusal::NoSuchPrimitive, [0, 0]),
        Refusal::Control(Control::StartTooFar) => (LinkRefusal::FarFromStart, [0, 0]),
        Refusal::Control(Control::OutOfRange) => (LinkRefusal::BadValue, [0, 0]),
        Refusal::Control(Control::OutsideJointLimits) => (LinkRefusal::OutsideJointLimits, [0, 0]),
        Refusal::Control(Control::OutsideWorkspace) => (LinkRefusal::OutsideWorkspace, [0, 0]),
        Refusal::Control(Control::CauseRemains) => (LinkRefusal::CauseRemains, [0, 0]),
        Refusal::Control(Control::Moving) => (LinkRefusal::Moving, [0, 0]),
        Refusal::Control(Control::WrenchMissing) => (LinkRefusal::WrenchMissing, [0, 0]),
        Refusal::Control(Control::NoExpectation) => (LinkRefusal::NoExpectation, [0, 0]),
        Refusal::Control(Control::HandTooFar) => (LinkRefusal::HandFarFromStart, [0, 0]),
        Refusal::Control(Control::ForceAtRest) => (LinkRefusal::ForceAtRest, [0, 0]),
        Refusal::Control(Control::ZeroLost) => (LinkRefusal::NotZeroed, [0, 0]),
        Refusal::Control(Control::NoHand) | Refusal::NoHand => hand(health.hand),
        Refusal::HandBusy => (LinkRefusal::HandBusy, [0, 0]),
    }
}

/// Why there is no hand to use.
fn hand(stage: HandStage) -> (LinkRefusal, [u32; 2]) {
    let refusal = match stage {
        HandStage::Absent | HandStage::Failed => LinkRefusal::NoHand,
        HandStage::Initialising => LinkRefusal::HandBusy,
        // Ready since the cycle refused, or about to be.
        HandStage::NotInitialised | HandStage::Ready => LinkRefusal::HandNotReady,
    };
    (refusal, [stage.code().into(), 0])
}

/// An event of the control half for the host; `None` for the answers to commands, which travel as answers.
pub(crate) fn event(event: Event) -> Option<LinkEvent> {
    let (kind, code, detail) = match event.kind {
        EventKind::Accepted | EventKind::Refused(_) => return None,
        EventKind::Entered(state, fault) => (LinkKind::State, state.code().into(), fault.code().into()),
        EventKind::Arrived => (LinkKind::Arrived, 0, 0),
        EventKind::Startup(stage) => (LinkKind::Startup, stage.code().into(), 0),
        EventKind::Blocked(error) => {
            let StartupFailure([code, detail]) = StartupFailure::from(error);
            (LinkKind::Blocked, u16::try_from(code).unwrap_or(u16::MAX), detail)
        }
        EventKind::Surprised { progress, channel } => (LinkKind::Surprise, channel.into(), progress.into()),
        EventKind::Hand { stage, cause } => {
            (LinkKind::Hand, stage.code().into(), cause.map_or(0, |(node, failure)| failure.number(node)))
        }
        EventKind::Safety { mode, is_asked_for } => {
            (LinkKind::SafetyMode, u16::try_from(mode.value()).unwrap_or(u16::MAX), is_asked_for.into())
        }
    };
    Some(LinkEvent { cycle: cycle(event.cycle), kind, code, detail })
}

/// A cycle record as telemetry, without its cost.
pub(crate) fn telemetry(record: &CycleRecord) -> Telemetry {
    Telemetry {
        cycle: cycle(record.cycle),
        state: record.state.code(),
        fault: record.fault.code(),
        flags: record.flags,
        phase: record.phase,
        q: record.q,
        dq: record.dq,
        tau: record.tau,
        pose_d: record.pose_d,
        wrench: record.wrench,
        lost_replies: record.lost_replies,
        cost_ticks: 0,
        hand: record.hand,
        hand_d: record.hand_d,
        gauges: record.gauges,
        surprise: record.surprise,
    }
}

/// Why the bus start-up cannot go on, as two numbers that print as words.
///
/// The second number is the node, and from bit 8 on the value that was wrong, cut to 24 bits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct StartupFailure(pub [u32; 2]);

impl From<StartupError> for StartupFailure {
    fn from(error: StartupError) -> Self {
        let at =
            |code: u32, node: Node, value: i32| Self([code, u32::from(node.number()) | value.cast_unsigned() << 8]);
        match error {
            StartupError::NoSafetyModule => Self([1, 0]),
            StartupError::MissingPuck(node) => at(2, node, 0),
            StartupError::NoAnswer(node) => at(3, node, 0),
            StartupError::DidNotWake(node) => at(4, node, 0),
            StartupError::WrongRole { node, role } => at(5, node, role.into()),
            StartupError::UnknownFirmware { node, version } => at(6, node, version),
            StartupError::WrongGroups(node) => at(7, node, 0),
            StartupError::WrongPlace { node, place } => at(8, node, place),
            StartupError::WrongTorqueLimit { node, limit } => at(9, node, limit),
            StartupError::NotAWrist { poles } => at(10, Node::ARM[6], poles),
            StartupError::Calibration(CalibrationError::CountsPerRevolution(motor)) => Self([11, motor.into()]),
            StartupError::Calibration(CalibrationError::TorqueCounts(motor)) => Self([12, motor.into()]),
            StartupError::Calibration(CalibrationError::Transmission(_)) => Self([13, 0]),
            StartupError::Calibration(CalibrationError::HandTorqueCounts(digit)) => Self([16, digit.into()]),
            StartupError::ZeroNotTaken(node) => at(14, node, 0),
            StartupError::SafetyNotZeroed => Self([15, 0]),
            StartupError::CountsAnew(node) => at(17, node, 0),
            StartupError::CountsJumped => Self([18, 0]),
            StartupError::AnswersLate(node) => at(19, node, 0),
            StartupError::ZeroUnfinished => Self([20, 0]),
            StartupError::SafetyVelocity { limit } => at(21, Node::SAFETY_MODULE, limit),
            StartupError::SafetyTorque { limit } => at(22, Node::SAFETY_MODULE, limit),
            StartupError::BeyondStops { joint } => Self([23, joint.into()]),
            StartupError::PayloadContradicted { hand } => Self([24, hand.into()]),
        }
    }
}

impl StartupFailure {
    /// The reason these numbers stand for, where they carry it wholly.
    fn error(self) -> Option<StartupError> {
        let Self([code, detail]) = self;
        let byte = u8::try_from(detail & 0xFF).ok()?;
        let value = detail.cast_signed() >> 8;
        let node = Node::new(byte)?;
        Some(match code {
            1 => StartupError::NoSafetyModule,
            2 => StartupError::MissingPuck(node),
            3 => StartupError::NoAnswer(node),
            4 => StartupError::DidNotWake(node),
            5 => StartupError::WrongRole { node, role: u16::try_from(value & 0xFFFF).ok()? },
            6 => StartupError::UnknownFirmware { node, version: value },
            7 => StartupError::WrongGroups(node),
            8 => StartupError::WrongPlace { node, place: value },
            9 => StartupError::WrongTorqueLimit { node, limit: value },
            10 => StartupError::NotAWrist { poles: value },
            11 => StartupError::Calibration(CalibrationError::CountsPerRevolution(byte)),
            12 => StartupError::Calibration(CalibrationError::TorqueCounts(byte)),
            14 => StartupError::ZeroNotTaken(node),
            15 => StartupError::SafetyNotZeroed,
            16 => StartupError::Calibration(CalibrationError::HandTorqueCounts(byte)),
            17 => StartupError::CountsAnew(node),
            18 => StartupError::CountsJumped,
            19 => StartupError::AnswersLate(node),
            20 => StartupError::ZeroUnfinished,
            21 => StartupError::SafetyVelocity { limit: value },
            22 => StartupError::SafetyTorque { limit: value },
            23 => StartupError::BeyondStops { joint: byte },
            24 => StartupError::PayloadContradicted { hand: byte != 0 },
            _ => return None,
        })
    }
}

impl fmt::Display for StartupFailure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.error(), self.0) {
            (Some(error), _) => error.fmt(f),
            (None, [13, _]) => f.write_str("the scales of the pucks do not fit the arm's transmission"),
            (None, [0, _]) => f.write_str("it goes on, and has met nothing that stops it"),
            (None, [code, detail]) => write!(f, "unknown reason {code} ({detail:#x})"),
        }
    }
}

/// Why the device found a primitive outside what the controller accepts, as the two numbers of the refusal.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PrimitiveDefect(pub [u32; 2]);

/// Errors in the order of their numbers.
const GAINS: [GainError; 2] = [GainError::Stiffness, GainError::Damping];
const PLAIN: [PrimitiveError; 13] = [
    PrimitiveError::Duration,
    PrimitiveError::Alpha,
    PrimitiveError::KernelCount,
    PrimitiveError::Activation,
    PrimitiveError::WeightCount,
    PrimitiveError::Weight,
    PrimitiveError::Start,
    PrimitiveError::StartVelocity,
    PrimitiveError::Goal,
    PrimitiveError::StartNotUnit,
    PrimitiveError::GoalNotUnit,
    PrimitiveError::TurnsTooFar,
    PrimitiveError::ControlPeriod,
];

const PARTS: [Part; 3] = [Part::Start, Part::Goal, Part::StartVelocity];

/// Codes of the tables beside the primitive itself.
const DEFECT_FEEDBACK: PrimitiveDefect = PrimitiveDefect::FEEDBACK;
const DEFECT_EXPECTATION: PrimitiveDefect = PrimitiveDefect::EXPECTATION;
const DEFECT_STATISTICS: PrimitiveDefect = PrimitiveDefect([10, 0]);

/// Code of a value that is larger than anything real; its place is in the detail.
const TABLE_VALUE: u32 = 13;

impl PrimitiveDefect {
    /// The error of the feedback's table as two numbers.
    pub(crate) fn feedback(error: TableError) -> Self {
        Self::value(error).unwrap_or(DEFECT_FEEDBACK)
    }

    /// The error of the expectation's table as two numbers.
    pub(crate) fn expectation(error: TableError) -> Self {
        Self::value(error).unwrap_or(DEFECT_EXPECTATION)
    }

    /// The error of the table of earlier runs as two numbers.
    pub(crate) fn statistics(error: TableError) -> Self {
        Self::value(error).unwrap_or(DEFECT_STATISTICS)
    }

    fn value(error: TableError) -> Option<Self> {
        let TableError::TooLarge(entry) = error else {
            return None;
        };
        let (kind, point, column) = match entry {
            Entry::Displacement => (0, 0, 0),
            Entry::Rotation => (1, 0, 0),
            Entry::PointDisplacement => (2, 0, 0),
            Entry::Sensitivity { point, column } => (3, point, column),
            Entry::SensorWeight { point, column } => (4, point, column),
            Entry::Expected { point, column } => (5, point, column),
            Entry::Mean { point, column } => (6, point, column),
            Entry::Spread { point, column } => (7, point, column),
            _ => return None,
        };
        Some(Self([TABLE_VALUE, kind << 16 | u32::from(point) << 8 | u32::from(column)]))
    }

    /// The value that is too large.
    fn entry(self) -> Option<Entry> {
        let Self([TABLE_VALUE, detail]) = self else {
            return None;
        };
        let [column, point, kind, _] = detail.to_le_bytes();
        Some(match kind {
            0 => Entry::Displacement,
            1 => Entry::Rotation,
            2 => Entry::PointDisplacement,
            3 => Entry::Sensitivity { point, column },
            4 => Entry::SensorWeight { point, column },
            5 => Entry::Expected { point, column },
            6 => Entry::Mean { point, column },
            7 => Entry::Spread { point, column },
            _ => return None,
        })
    }

    /// The gains of the feedback.
    pub const FEEDBACK: PrimitiveDefect = PrimitiveDefect([8, 0]);
    /// The expectation.
    pub const EXPECTATION: PrimitiveDefect = PrimitiveDefect([9, 0]);
}

fn place<T: PartialEq>(list: &[T], item: &T) -> u32 {
    list.iter().zip(0..).find(|(other, _)| *other == item).map_or(u32::MAX, |(_, index)| index)
}

fn item<T: Copy>(list: &[T], index: u32) -> Option<T> {
    list.get(usize::try_from(index).ok()?).copied()
}

impl From<LoadError> for PrimitiveDefect {
    fn from(error: LoadError) -> Self {
        let number = |group: RowGroup| place(&RowGroup::ALL, &group);
        let end = |end: End| match end {
            End::Start => 0,
            End::Goal => 1,
        };
        Self(match error {
            LoadError::Primitive(PrimitiveError::Gains { group, index, error }) => {
                [2, number(RowGroup::of(group, index).0) * 2 + place(&GAINS, &error)]
            }
            LoadError::Primitive(PrimitiveError::Unstable { group, index }) => {
                [3, number(RowGroup::of(group, index).0)]
            }
            LoadError::Primitive(PrimitiveError::WeightTooLarge { group, index, kernel }) => {
                let first = match group {
                    Group::Position => 0,
                    Group::Orientation => POSITION_ROWS,
                    _ => POSITION_ROWS + ORIENTATION_ROWS,
                };
                [11, (first as u32 + u32::from(index)) << 8 | u32::from(kernel)]
            }
            LoadError::Primitive(PrimitiveError::TooLarge { part, group, index }) => {
                let (group, index) = RowGroup::of(group, index);
                [12, place(&PARTS, &part) << 16 | number(group) << 8 | u32::from(index)]
            }
            LoadError::Primitive(plain) => [1, place(&PLAIN, &plain)],
            LoadError::Duration => [4, 0],
            LoadError::Posture(which, joint) => [5, end(which) << 8 | u32::from(joint)],
            LoadError::OutOfReach(which) => [6, end(which)],
            LoadError::Inconsistent(which) => [7, end(which)],
            LoadError::Expected(sensor) => [14, sensor.into()],
            LoadError::Bound(quantity) => {
                let (kind, which) = match quantity {
                    Quantity::Gain(rows) => (0, number(rows)),
                    Quantity::Displacement(rows) => (1, number(rows)),
                    Quantity::StartVelocity(rows) => (2, number(rows)),
                    Quantity::Speed(rows) => (3, number(rows)),
                    Quantity::Acceleration(rows) => (4, number(rows)),
                    Quantity::Measured(sensor) => (5, sensor.into()),
                    Quantity::Load => (6, 0),
                    Quantity::Recording => (7, 0),
                };
                [15, kind << 8 | which]
            }
        })
    }
}

impl PrimitiveDefect {
    fn error(self) -> Option<LoadError> {
        let Self([code, detail]) = self;
        let end = |bit: u32| if bit == 0 { End::Start } else { End::Goal };
        Some(match code {
            1 => LoadError::Primitive(item(&PLAIN, detail)?),
            2 => {
                let (group, index) = item(&RowGroup::ALL, detail / 2)?.row(0);
                LoadError::Primitive(PrimitiveError::Gains { group, index, error: item(&GAINS, detail % 2)? })
            }
            3 => {
                let (group, index) = item(&RowGroup::ALL, detail)?.row(0);
                LoadError::Primitive(PrimitiveError::Unstable { group, index })
            }
            4 => LoadError::Duration,
            5 => LoadError::Posture(end(detail >> 8), u8::try_from(detail & 0xFF).ok()?),
            6 => LoadError::OutOfReach(end(detail)),
            7 => LoadError::Inconsistent(end(detail)),
            11 => {
                let [kernel, row, _, _] = detail.to_le_bytes();
                let (group, index) = Group::of_weights(row.into(), 1);
                LoadError::Primitive(PrimitiveError::WeightTooLarge { group, index: u8::try_from(index).ok()?, kernel })
            }
            12 => {
                let [index, row, part, _] = detail.to_le_bytes();
                let (part, (group, index)) = (item(&PARTS, part.into())?, item(&RowGroup::ALL, row.into())?.row(index));
                LoadError::Primitive(PrimitiveError::TooLarge { part, group, index })
            }
            14 => LoadError::Expected(u8::try_from(detail).ok()?),
            15 => {
                let [which, kind, _, _] = detail.to_le_bytes();
                let rows = || item(&RowGroup::ALL, which.into());
                LoadError::Bound(match kind {
                    0 => Quantity::Gain(rows()?),
                    1 => Quantity::Displacement(rows()?),
                    2 => Quantity::StartVelocity(rows()?),
                    3 => Quantity::Speed(rows()?),
                    4 => Quantity::Acceleration(rows()?),
                    5 => Quantity::Measured(which),
                    6 => Quantity::Load,
                    7 => Quantity::Recording,
                    _ => return None,
                })
            }
            _ => return None,
        })
    }
}

impl fmt::Display for PrimitiveDefect {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(entry) = self.entry() {
            return TableError::TooLarge(entry).fmt(f);
        }
        match (self.error(), *self) {
            (Some(error), _) => error.fmt(f),
            (None, DEFECT_FEEDBACK) => f.write_str("a gain or clamp of the feedback is negative or too large"),
            (None, DEFECT_STATISTICS) => {
                f.write_str("a spread of the sensor statistics is below 1e-6, or no run is behind it")
            }
            (None, DEFECT_EXPECTATION) => {
                f.write_str("the recorded duration of the expectation is not positive or too long")
            }
            (None, Self([code, detail])) => write!(f, "unknown reason {code} ({detail:#x})"),
        }
    }
}
