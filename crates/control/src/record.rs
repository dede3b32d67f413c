//! What goes into one control cycle and what comes out of it.

use puck::{Counts, RawWrench, SafetyMode};

use crate::actuation::Actuation;
use crate::command::{Command, Refusal};
use crate::fault::Fault;
use crate::supervisor::State;

/// What the bus round of one cycle brought in.
///
/// Only replies of this cycle belong here: the caller empties its mailboxes before it sends the requests, so a late
/// reply is a missing one.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BusSample {
    /// Motor positions of pucks 1 to 7; `None` where the reply was lost or malformed.
    pub positions: [Option<Counts>; 7],
    /// Wrist wrench; `None` where one of its two frames was lost or the sensor marked it bad.
    pub wrench: Option<RawWrench>,
    /// Latest mode of the safety module, where it was polled since the last cycle.
    pub safety: Option<SafetyMode>,
}

/// The input of one control cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleInput {
    /// Number of this cycle, one up per 1/300 s.
    pub cycle: u64,
    /// Replies of this cycle.
    pub sample: BusSample,
    /// A person's command, if one is waiting.
    pub command: Option<Command>,
    /// A fault that the caller found outside the cycle (bus-off, puck reset, overrun); `None` otherwise.
    pub external_fault: Option<Fault>,
}

/// The output of one control cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleOutput {
    /// What to send to the motors.
    pub actuation: Actuation,
    /// What the cycle measured and decided.
    pub record: CycleRecord,
    /// Something a person should hear of, at most one per cycle.
    pub event: Option<Event>,
}

/// Something that happened in a cycle and is worth a message.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Event {
    /// A command was taken up.
    Accepted,
    /// A command was refused.
    Refused(Refusal),
    /// The state changed; the fault is the reason, or `Fault::None`.
    Entered(State, Fault),
    /// The movement ended and the arm holds the goal.
    Arrived,
}

/// Flags of a [`CycleRecord`], one bit each.
pub mod flags {
    /// A joint torque was cut by its joint limit.
    pub const JOINT_LIMITED: u16 = 1 << 0;
    /// The torques were scaled because a motor reached its limit.
    pub const MOTOR_LIMITED: u16 = 1 << 1;
    /// A torque was cut by its rate limit.
    pub const RATE_LIMITED: u16 = 1 << 2;
    /// A torque was not finite and was replaced.
    pub const NOT_FINITE: u16 = 1 << 3;
    /// At least one position of this cycle was extrapolated.
    pub const COASTING: u16 = 1 << 4;
    /// The wrench of this cycle is older than the cycle.
    pub const WRENCH_STALE: u16 = 1 << 5;
    /// The desired joint position reached the anti-windup clamp.
    pub const CLAMPED: u16 = 1 << 6;
    /// The repulsion of a joint limit acts.
    pub const NEAR_LIMIT: u16 = 1 << 7;
    /// Sensory feedback bends the plan.
    pub const FEEDBACK: u16 = 1 << 8;
    /// The force controller adds torque.
    pub const FORCE_CONTROL: u16 = 1 << 9;
    /// The movement has ended; the arm holds its goal.
    pub const ARRIVED: u16 = 1 << 10;
    /// The safety module reports ACTIVE.
    pub const SAFETY_ACTIVE: u16 = 1 << 11;
    /// All joint positions have been measured at least once.
    pub const POSITIONS_KNOWN: u16 = 1 << 12;
    /// The wrench has been tared.
    pub const TARED: u16 = 1 << 13;
}

/// Everything one cycle measured and decided, of constant size; the source of telemetry and fault records.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleRecord {
    /// Number of the cycle.
    pub cycle: u64,
    /// State after the cycle.
    pub state: State,
    /// Latched fault.
    pub fault: Fault,
    /// Bits of [`flags`].
    pub flags: u16,
    /// Phase of the movement, 1 at its start, towards 0 at its end; 0 outside a run.
    pub phase: f32,
    /// Measured joint positions (rad).
    pub q: [f32; 7],
    /// Filtered joint velocities (rad/s).
    pub dq: [f32; 7],
    /// Desired joint positions (rad); the measured ones where nothing is desired.
    pub q_d: [f32; 7],
    /// Joint torques sent (N m), after all limits.
    pub tau: [f32; 7],
    /// Desired tool pose: position (m), orientation (w, x, y, z); the measured one where nothing is desired.
    pub pose_d: [f32; 7],
    /// Measured tool pose: position (m), orientation (w, x, y, z).
    pub pose: [f32; 7],
    /// Filtered, tared wrench of the environment on the robot at the grasp point: force in world axes (N), torque in
    /// tool axes (N m).
    pub wrench: [f32; 6],
    /// Position replies lost in this cycle (0 to 7).
    pub lost_replies: u8,
}

impl CycleRecord {
    /// A record of nothing, for buffers.
    pub const EMPTY: CycleRecord = CycleRecord {
        cycle: 0,
        state: State::Idle,
        fault: Fault::None,
        flags: 0,
        phase: 0.0,
        q: [0.0; 7],
        dq: [0.0; 7],
        q_d: [0.0; 7],
        tau: [0.0; 7],
        pose_d: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        pose: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        wrench: [0.0; 6],
        lost_replies: 0,
    };
}
