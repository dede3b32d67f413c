//! `Stage` and `StartupError`: the stages of the start-up, and the reasons for which it stops.

use core::fmt;

use control::CalibrationError;
use puck::Node;

/// Stage of the bus start-up. The codes travel over the link and are never renumbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[repr(u8)]
pub enum Stage {
    /// Looks for devices on the bus.
    Enumerating = 0,
    /// Loads the stored limits of the safety module.
    LoadingLimits = 1,
    /// Waits until a person has released the emergency stop and pressed Shift-Idle.
    WaitingForIdle = 2,
    /// Wakes the pucks and waits in silence.
    Waking = 3,
    /// Checks that all devices are awake and of a known firmware.
    Verifying = 4,
    /// Reads scales and group memberships of the pucks.
    Reading = 5,
    /// Waits for a person to say where the arm stands.
    WaitingForZero = 6,
    /// Writes the encoder positions.
    Zeroing = 7,
    /// Tares the force/torque sensor and begins to poll.
    Preparing = 8,
    /// The control cycle runs with zero torque; waits until a person presses Shift-Activate.
    WaitingForActive = 9,
    /// The arm can be commanded.
    Ready = 10,
    /// The start-up failed; tries again after a second.
    Blocked = 11,
}

impl Stage {
    /// Every stage, in the order of the codes.
    pub const ALL: [Stage; 12] = [
        Stage::Enumerating,
        Stage::LoadingLimits,
        Stage::WaitingForIdle,
        Stage::Waking,
        Stage::Verifying,
        Stage::Reading,
        Stage::WaitingForZero,
        Stage::Zeroing,
        Stage::Preparing,
        Stage::WaitingForActive,
        Stage::Ready,
        Stage::Blocked,
    ];

    /// The stable number of this stage.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The stage with this number, if there is one.
    pub fn from_code(code: u8) -> Option<Stage> {
        Stage::ALL.into_iter().find(|stage| stage.code() == code)
    }

    /// Returns in one phrase what happens, or what a person must do.
    pub const fn explanation(self) -> &'static str {
        match self {
            Stage::Enumerating => "looking for devices on the bus",
            Stage::LoadingLimits => "loading the limits of the safety module",
            Stage::WaitingForIdle => "release the emergency stop and press Shift-Idle",
            Stage::Waking => "waking the pucks",
            Stage::Verifying => "checking the firmware of the pucks",
            Stage::Reading => "reading the scales of the pucks",
            Stage::WaitingForZero => "bring the arm to its home pose and zero it",
            Stage::Zeroing => "writing the encoder positions",
            Stage::Preparing => "taring the force sensor",
            Stage::WaitingForActive => "press Shift-Activate",
            Stage::Ready => "ready",
            Stage::Blocked => "the start-up failed and is tried again",
        }
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(self.explanation())
    }
}

/// Why the start-up cannot go on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StartupError {
    /// No safety module answers at node 10.
    NoSafetyModule,
    /// This puck of the arm does not answer.
    MissingPuck(Node),
    /// This node did not answer a request.
    NoAnswer(Node),
    /// This node was woken and still does not report READY.
    DidNotWake(Node),
    /// This node has another role than its number demands.
    WrongRole {
        /// The node.
        node: Node,
        /// Its ROLE.
        role: u16,
    },
    /// There is no property table for the firmware of this node, or an arm must not be run with it.
    UnknownFirmware {
        /// The node.
        node: Node,
        /// Its VERS.
        version: i32,
    },
    /// This puck does not belong to the groups that reach it with requests and torques.
    WrongGroups(Node),
    /// This puck takes its torque from another place of the frame than its number demands.
    WrongPlace {
        /// The node.
        node: Node,
        /// Its PIDX.
        place: i32,
    },
    /// This puck accepts no torque (MT), or more than a frame can carry.
    WrongTorqueLimit {
        /// The node.
        node: Node,
        /// Its MT.
        limit: i32,
    },
    /// Puck 7 does not drive a seven-joint wrist.
    NotAWrist {
        /// Its POLES.
        poles: i32,
    },
    /// The scales of a puck are impossible.
    Calibration(CalibrationError),
    /// After zeroing, this puck reports another position than was written.
    ZeroNotTaken(Node),
    /// The safety module did not take the word that the arm is zeroed.
    SafetyNotZeroed,
    /// This puck of an arm that was zeroed had to be woken: it has restarted, and its counts began anew.
    CountsAnew(Node),
    /// The counts of a motor jumped since the arm was zeroed.
    CountsJumped,
    /// By its counts a joint, 1 to 7, is where its stops do not let it go.
    BeyondStops {
        /// Number of the joint.
        joint: u8,
    },
    /// The sensor or the hand answers now, and did not at the start-up or since it has restarted.
    AnswersLate(Node),
    /// The zeroing of an arm was broken off.
    ZeroUnfinished,
    /// Another payload is declared than who answers tells of.
    PayloadContradicted {
        /// True if sensor and hand are declared, and no sensor answers; false if the bare arm is, and one does.
        hand: bool,
    },
    /// The safety module stops no fast arm, or one only that is faster than it may be.
    SafetyVelocity {
        /// Its VL2, in counts of 1/4096 m/s; 0: none.
        limit: i32,
    },
    /// The safety module would stop the arm for a torque that this device may send, or never for its torque.
    SafetyTorque {
        /// Its TL2, in counts of a puck's torque.
        limit: i32,
    },
}

impl fmt::Display for StartupError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            StartupError::NoSafetyModule => formatter.write_str("no safety module answers at node 10"),
            StartupError::MissingPuck(node) => write!(formatter, "puck {} of the arm does not answer", node.number()),
            StartupError::NoAnswer(node) => {
                write!(formatter, "node {} did not answer a request", node.number())
            }
            StartupError::DidNotWake(node) => {
                write!(formatter, "node {} did not wake up", node.number())
            }
            StartupError::WrongRole { node, role } => {
                write!(formatter, "node {} has ROLE {role:#06X}, which does not fit its number", node.number())
            }
            StartupError::UnknownFirmware { node, version } => {
                write!(formatter, "node {} runs firmware {version}, which is not supported", node.number())
            }
            StartupError::WrongGroups(node) => {
                write!(formatter, "puck {} belongs to the wrong groups (GRPA, GRPB, GRPC)", node.number())
            }
            StartupError::WrongPlace { node, place } => {
                write!(formatter, "puck {} has PIDX {place}, which does not fit its number", node.number())
            }
            StartupError::WrongTorqueLimit { node, limit } => {
                write!(formatter, "puck {} has a torque limit MT of {limit}", node.number())
            }
            StartupError::NotAWrist { poles } => {
                write!(formatter, "puck 7 drives a motor with {poles} poles, not that of a seven-joint wrist")
            }
            StartupError::Calibration(error) => error.fmt(formatter),
            StartupError::ZeroNotTaken(node) => {
                write!(formatter, "puck {} did not take the position written to it", node.number())
            }
            StartupError::SafetyNotZeroed => {
                formatter.write_str("the safety module did not take the word that the arm is zeroed")
            }
            StartupError::CountsAnew(node) => {
                write!(formatter, "puck {} has restarted and counts anew: zero the arm", node.number())
            }
            StartupError::CountsJumped => formatter.write_str("the counts of a motor jumped: zero the arm"),
            StartupError::BeyondStops { joint } => {
                write!(formatter, "J{joint} is told to be beyond its stops: zero the arm")
            }
            StartupError::SafetyVelocity { limit } => {
                write!(formatter, "the safety module has a velocity limit VL2 of {limit}: it must be 1 to 4096 (1 m/s)")
            }
            StartupError::SafetyTorque { limit } => {
                write!(formatter, "the safety module has a torque limit TL2 of {limit}: it must be 4601 to 8191 (5204)")
            }
            StartupError::PayloadContradicted { hand: true } => formatter.write_str(
                "sensor and hand are declared, and no sensor answers: check its cable, or declare what the arm carries",
            ),
            StartupError::PayloadContradicted { hand: false } => {
                formatter.write_str("the bare arm is declared, and a sensor answers: declare what the arm carries")
            }
            StartupError::ZeroUnfinished => formatter.write_str("zeroing was broken off: zero the arm"),
            StartupError::AnswersLate(node) => {
                write!(formatter, "node {} answers now and did not before: everything is asked anew", node.number())
            }
        }
    }
}

impl core::error::Error for StartupError {}
