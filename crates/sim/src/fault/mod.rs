//! Faults that are ordered beforehand: frames lost, late or changed, pucks that restart, the pendant, pushes.
//!
//! [`FaultKind`] is the one table of them, as scripts spell it (`docs/faults.md`). An [`Injection`] says when; its
//! times count from the moment at which the plant is given it ([`Plant::inject`](crate::Plant::inject)).

mod check;
mod engine;

use serde::{Deserialize, Serialize};

use crate::operator::PendantAction;
use puck::{CanFrame, Destination, Group, Node, Request};

pub(crate) use engine::{Faults, Treated};

/// A fault, when it begins and when it ends.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Injection {
    /// Begin, s.
    pub at: f64,
    /// Duration, s; for ever unless given. What happens at one moment, such as a restart, has none.
    #[serde(default = "for_ever")]
    pub lasts: f64,
    /// Time from one begin to the next, s, of a fault that comes several times.
    #[serde(default)]
    pub every: f64,
    /// Number of times it comes.
    #[serde(default = "once")]
    pub times: u32,
    /// The fault.
    pub what: FaultKind,
}

/// The faults there are.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum FaultKind {
    /// Frames that nobody receives; their sender believes them sent.
    Drop(Frames),
    /// Frames that everybody receives late.
    Delay {
        /// The frames.
        frames: Frames,
        /// Delay, s.
        by: f64,
    },
    /// Frames that the co-controller receives twice.
    Repeat(Frames),
    /// Frames in which one bit, drawn at random, is wrong although their check sum is right.
    Flip(Frames),
    /// Frames that repeat what the first of them said: an encoder or a sensor that stands still.
    Freeze(Frames),
    /// Position counts of a puck that are off from now on; at the end, if there is one, they are right again.
    CountJump {
        /// The puck, 1 to 7.
        node: u8,
        /// Counts.
        by: i32,
    },
    /// A node that loses its power for an instant: boot loader, no torque, counts that begin anew, no tare.
    Restart {
        /// A puck of the arm, 1 to 7, the sensor, 8, or a puck of the hand, 11 to 14.
        node: u8,
    },
    /// Temperature that a puck of the arm tells of itself and of its motor.
    Temperature {
        /// The puck, 1 to 7.
        node: u8,
        /// Degree Celsius.
        celsius: i32,
    },
    /// Somebody at the pendant.
    Pendant(PendantAction),
    /// The pendant warns of this quantity.
    Warning(Supervised),
    /// Error of the force/torque sensor.
    Sensor {
        /// N and N m, sensor axes, from the begin on.
        #[serde(default)]
        error: [f64; 6],
        /// N/s and N m/s by which it grows.
        #[serde(default)]
        drift: [f64; 6],
    },
    /// The CAN controller of the co-controller has left the bus: it sends and hears nothing, and comes back by itself
    /// at the end. All others go on hearing each other. Engines other than `sil:` are not told.
    BusOff,
    /// The CAN controller of the co-controller takes no such frames. `sil:` only.
    Refuse(FrameKind),
    /// A node that goes on sending frames of the highest priority, identifier 0. Its next frame takes the place of one
    /// that could not leave.
    Flood {
        /// Frames in a second.
        rate: f64,
        /// Payload of each, 0 to 8 bytes.
        bytes: u8,
    },
    /// The co-controller's clock is slow by this share of a second in each; negative if it is fast. `sil:` only.
    Clock(f64),
    /// Somebody pushes at the grasp point.
    Push {
        /// N, world frame.
        force: [f64; 3],
    },
    /// A weight that nobody declared hangs at the grasp point, kg.
    Payload(f64),
    /// Viscous friction added to the joints, N m s/rad; negative takes from what there is.
    Friction([f64; 7]),
    /// Packed torques reach the motors later by this, s.
    TorqueDelay(f64),
}

impl FaultKind {
    /// True if the fault lies in the co-controller's own port, which an emulated device has from its emulator.
    #[must_use]
    pub fn is_of_the_port(&self) -> bool {
        matches!(self, Self::BusOff | Self::Refuse(_) | Self::Clock(_))
    }
}

/// Frames on the arm's bus. Without any key: all of them.
#[derive(Clone, Debug, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields, default)]
pub struct Frames {
    /// Their kind.
    pub kind: FrameKind,
    /// Numbers of the nodes that send them (0 is the co-controller, 8 the sensor); empty for all.
    pub from: Vec<u8>,
    /// Share of them that is meant, 0 to 1, drawn at random.
    pub share: f64,
    /// Largest number of frames that is meant.
    pub most: u32,
}

impl Default for Frames {
    fn default() -> Self {
        Self { kind: FrameKind::Any, from: Vec::new(), share: 1.0, most: u32::MAX }
    }
}

/// Kinds of frames of a control cycle.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FrameKind {
    /// Every frame.
    Any,
    /// The request for the positions of the arm.
    PositionRequest,
    /// A position.
    Position,
    /// A request to the force/torque sensor.
    SensorRequest,
    /// The sensor's force.
    Force,
    /// The sensor's torque.
    Moment,
    /// Torques for M1 to M4.
    ArmTorques,
    /// Torques for M5 to M7.
    WristTorques,
    /// Torques for M1 to M7.
    Torques,
    /// An answer to a question about a property other than position and wrench.
    Property,
}

impl FrameKind {
    /// True if a frame is of this kind.
    #[must_use]
    pub fn fits(self, frame: &CanFrame) -> bool {
        let id = frame.can_id();
        let to = |group: Group| id.destination() == Destination::Group(group);
        match self {
            Self::Any => true,
            Self::PositionRequest => Request::decode(frame).is_ok_and(|request| {
                to(Group::ARM) && request.action == puck::Action::Get { property: puck::PropertyId::POSITION }
            }),
            Self::Position => to(Group::POSITION_REPLIES),
            Self::SensorRequest => id.destination() == Destination::Node(Node::FORCE_TORQUE),
            Self::Force => to(Group::FORCE_REPLIES),
            Self::Moment => to(Group::TORQUE_REPLIES),
            Self::ArmTorques => id.sender() == Node::HOST && to(Group::ARM_TORQUES),
            Self::WristTorques => id.sender() == Node::HOST && to(Group::WRIST_TORQUES),
            Self::Torques => Self::ArmTorques.fits(frame) || Self::WristTorques.fits(frame),
            Self::Property => to(Group::PROPERTY_REPLIES),
        }
    }
}

/// Quantities that the safety module supervises.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Supervised {
    /// Velocity of the arm.
    Velocity,
    /// Commanded torque.
    Torque,
    /// Supply.
    Voltage,
    /// Traffic on the bus.
    Heartbeat,
    /// Everything else.
    Other,
}

fn for_ever() -> f64 {
    f64::INFINITY
}

fn once() -> u32 {
    1
}
