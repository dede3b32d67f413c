//! A person's requests to the arm: commands, the options of a run, and the reasons a command is refused.
//!
//! Commands carry plain `f32` in SI units, as they arrive over the link; they are checked when the cycle takes them up.

use core::fmt;

/// The source of the desired joint acceleration of Eq (10).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AccelerationSource {
    /// `J^+ (ddx_d + K_x (dx_d - dx) - dJ dq)`, where `dx` is the velocity of the pose that is fed back.
    Analytic,
    /// The low-passed numerical derivative of `dq_d`.
    Differentiated,
}

/// A new goal of the tool, in world axes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Goal {
    /// Tool position (m); `None` keeps the present goal.
    pub position: Option<[f32; 3]>,
    /// Tool orientation as a unit quaternion (w, x, y, z), tool to world; `None` keeps the present goal.
    pub orientation: Option<[f32; 4]>,
}

impl Goal {
    /// The goal stored in the primitive, or, while it runs, the present one: nothing is to change.
    pub const STORED: Goal = Goal { position: None, orientation: None };
}

/// The options of one run of the loaded primitive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RunOptions {
    /// Goal of this run.
    pub goal: Goal,
    /// Speed factor on the stored duration: 1 as stored, 0.5 half as fast. Refused outside 0.1 to 2.
    pub speed: f32,
    /// True if the measured wrench bends the plan (Eqs 8, 9). Off while an expectation is recorded.
    pub feedback: bool,
    /// True if the force controller of Eq (12) adds its torque.
    pub force_control: bool,
    /// Acceleration used in Eq (10).
    pub acceleration: AccelerationSource,
    /// True if the finger gauges bend the finger rows; only together with `feedback`.
    pub finger_feedback: bool,
    /// True if the arm tracks with the compliant gains, and Eq (11) is closed over the planned pose, so that the force
    /// controller is not overruled; over the measured one otherwise. A plan that bends is followed with compliant gains
    /// whatever this says: with stiff ones the loop over the force sensor swings where there is no friction.
    pub compliant: bool,
}

impl RunOptions {
    /// The same, with compliant gains where the plan bends.
    pub(crate) fn with_fitting_gains(self) -> Self {
        RunOptions { compliant: self.compliant || self.feedback, ..self }
    }
}

impl Default for RunOptions {
    /// The first, open-loop run of a primitive: stored goal and speed, no feedback, no force control.
    fn default() -> Self {
        RunOptions {
            goal: Goal::STORED,
            speed: 1.0,
            feedback: false,
            force_control: false,
            acceleration: AccelerationSource::Analytic,
            finger_feedback: true,
            compliant: false,
        }
    }
}

/// A person's command, taken up at the start of a cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Command {
    /// Float: gravity compensation only, for teaching by hand.
    Gravity,
    /// Hold the present posture.
    Hold,
    /// Move in joint space to `q` (rad) along a minimum-jerk path.
    Approach {
        /// Target posture (rad).
        q: [f32; 7],
        /// Requested duration (s); lengthened where the speed limits ask for it. 0 asks for the shortest.
        duration: f32,
    },
    /// Run the loaded primitive.
    Run(RunOptions),
    /// Stop softly: gravity compensation and damping.
    Stop,
    /// Give up torque: the arm sinks slowly until it rests, then the pucks are sent zero torque.
    Release,
    /// Leave a soft stop or a fault, once its cause is gone.
    ClearFault,
    /// Change the goal of the present run.
    SetGoal(Goal),
    /// Change the speed factor of the present run.
    SetSpeed {
        /// Speed factor on the stored duration.
        factor: f32,
    },
    /// Take the present filtered wrench, less the weight of the hand, and the present gauges as zero.
    Tare,
    /// Move the hand along a minimum-jerk path; taken in Gravity, Hold and Approach.
    MoveHand {
        /// Target: spread, F1, F2, F3 of the inner links (rad).
        q: [f32; 4],
        /// Requested duration (s); lengthened where the speed limits ask for it. 0 asks for the shortest.
        duration: f32,
    },
}

/// Why a command was refused. The codes travel over the link and are never renumbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Refusal {
    /// The state the arm is in does not allow this command.
    WrongState = 1,
    /// The safety module does not report ACTIVE.
    SafetyNotActive = 2,
    /// Not all joint positions have been measured in this cycle.
    PositionsMissing = 3,
    /// No primitive is loaded.
    NoPrimitive = 4,
    /// The arm is farther than 50 mrad from the start posture of the primitive in at least one joint.
    StartTooFar = 5,
    /// A number in the command is not finite or outside its range.
    OutOfRange = 6,
    /// A target posture lies outside the soft joint limits.
    OutsideJointLimits = 7,
    /// A goal lies outside the workspace.
    OutsideWorkspace = 8,
    /// The arm still moves, or the cause of the stop is still present.
    CauseRemains = 9,
    /// The arm moves too fast for this command.
    Moving = 10,
    /// No wrench has been measured, and the command needs one.
    WrenchMissing = 11,
    /// A fault is latched and has not been cleared.
    FaultLatched = 12,
    /// The run uses force, and the primitive carries no expectation of it.
    NoExpectation = 13,
    /// A digit of the hand is farther than 0.15 rad from where the primitive starts.
    HandTooFar = 14,
    /// There is no initialised hand.
    NoHand = 15,
    /// The force at rest differs by more than 5 N from the weight of the hand (a run), or by more than 20 N from its
    /// last zero (a tare): a load, a contact, or a sensor adrift.
    ForceAtRest = 16,
    /// A motor began to count anew: the positions no longer refer to the zero of the arm.
    ZeroLost = 17,
}

impl Refusal {
    /// Every reason, for tables and documents.
    pub const ALL: [Refusal; 17] = [
        Refusal::WrongState,
        Refusal::SafetyNotActive,
        Refusal::PositionsMissing,
        Refusal::NoPrimitive,
        Refusal::StartTooFar,
        Refusal::OutOfRange,
        Refusal::OutsideJointLimits,
        Refusal::OutsideWorkspace,
        Refusal::CauseRemains,
        Refusal::Moving,
        Refusal::WrenchMissing,
        Refusal::FaultLatched,
        Refusal::NoExpectation,
        Refusal::HandTooFar,
        Refusal::NoHand,
        Refusal::ForceAtRest,
        Refusal::ZeroLost,
    ];

    /// The stable number of this reason.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The reason with this number, if there is one.
    pub fn from_code(code: u8) -> Option<Refusal> {
        Refusal::ALL.into_iter().find(|reason| reason.code() == code)
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            Refusal::WrongState => "the arm is in a state that does not allow this command",
            Refusal::SafetyNotActive => "the safety module does not report ACTIVE",
            Refusal::PositionsMissing => "not all joint positions are measured",
            Refusal::NoPrimitive => "no primitive is loaded",
            Refusal::StartTooFar => "a joint is more than 50 mrad away from the start posture of the primitive",
            Refusal::OutOfRange => "a number in the command is not finite or outside its range",
            Refusal::OutsideJointLimits => "the target lies outside the soft joint limits",
            Refusal::OutsideWorkspace => "the goal lies outside the workspace of the arm",
            Refusal::CauseRemains => "the cause of the stop is still present",
            Refusal::Moving => "the arm moves too fast for this command",
            Refusal::WrenchMissing => "no wrench is measured",
            Refusal::FaultLatched => "a fault is latched, clear it first",
            Refusal::NoExpectation => "the run uses force, and the primitive carries no expectation of it",
            Refusal::HandTooFar => "the hand is more than 0.15 rad away from where the primitive starts",
            Refusal::NoHand => "there is no initialised hand",
            Refusal::ForceAtRest => {
                "the force at rest is not the weight of the hand: 5 N off for a run, 20 N off its last zero for a tare"
            }
            Refusal::ZeroLost => "the zero of the arm is lost: zero it again",
        })
    }
}

impl core::error::Error for Refusal {}
