//! Input, output and record of one control cycle.

use crate::act::actuation::Actuation;
use crate::act::limit::LimitReport;
use crate::command::{Command, Refusal};
use crate::guard::fault::Fault;
use crate::guard::supervisor::State;
use crate::sense::sample::BusSample;

/// The input of one control cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CycleInput {
    /// Number of this cycle, one up per control period.
    pub cycle: u64,
    /// Replies of this cycle.
    pub sample: BusSample,
    /// A person's command, if one is waiting.
    pub command: Option<Command>,
    /// A fault that the caller found outside the cycle (bus-off, puck reset, overrun); `None` otherwise. It takes all
    /// torque off at once, or stops softly, as [`Fault`] says of each.
    pub external_fault: Option<Fault>,
}

/// The output of one control cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CycleOutput {
    /// Frames to the motors.
    pub actuation: Actuation,
    /// Measurements and decisions of the cycle.
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
    /// The run does not go as the successful ones did.
    Surprised {
        /// Progress of the movement, 0 to 1.
        phase: f32,
        /// The channel that stands out most: force x, y, z, torque x, y, z, gauges F1 to F3, fingers F1 to F3.
        channel: u8,
    },
}

/// Events that have yet to be told, the oldest first: an answer goes before them, and there is one in each cycle at
/// most.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct News([Option<Event>; 4]);

impl News {
    /// Has an event told in its turn. Where there is no room the oldest gives way.
    pub(super) fn tell(&mut self, event: Event) {
        match self.0.iter_mut().find(|place| place.is_none()) {
            Some(place) => *place = Some(event),
            None => {
                self.next();
                self.0[3] = Some(event);
            }
        }
    }

    /// The event whose turn it is.
    pub(super) fn next(&mut self) -> Option<Event> {
        let [first, rest @ ..] = self.0;
        if first.is_some() {
            self.0 = [rest[0], rest[1], rest[2], None];
        }
        first
    }
}

/// Flags of a [`CycleRecord`], one bit each.
pub mod flags {
    /// A joint torque was cut by its joint limit.
    pub const JOINT_LIMITED: u32 = 1 << 0;
    /// The torques were scaled because a motor reached its limit.
    pub const MOTOR_LIMITED: u32 = 1 << 1;
    /// A torque was cut by its rate limit.
    pub const RATE_LIMITED: u32 = 1 << 2;
    /// A torque was not finite and was replaced.
    pub const NOT_FINITE: u32 = 1 << 3;
    /// At least one position of this cycle was extrapolated.
    pub const COASTING: u32 = 1 << 4;
    /// The wrench of this cycle is older than the cycle.
    pub const WRENCH_STALE: u32 = 1 << 5;
    /// The desired joint position reached the anti-windup clamp.
    pub const CLAMPED: u32 = 1 << 6;
    /// A joint is beyond its bound: its soft limit, or the posture in which it was armed.
    pub const NEAR_LIMIT: u32 = 1 << 7;
    /// Sensory feedback bends the plan.
    pub const FEEDBACK: u32 = 1 << 8;
    /// The force controller adds torque.
    pub const FORCE_CONTROL: u32 = 1 << 9;
    /// The movement has ended; the arm holds its goal.
    pub const ARRIVED: u32 = 1 << 10;
    /// The safety module reports ACTIVE.
    pub const SAFETY_ACTIVE: u32 = 1 << 11;
    /// All joint positions have been measured at least once.
    pub const POSITIONS_KNOWN: u32 = 1 << 12;
    /// The wrench has been tared.
    pub const TARED: u32 = 1 << 13;
    /// The wrist sensor is at its full scale, or one of its gauges has saturated since its last own tare.
    pub const SENSOR_SATURATED: u32 = 1 << 14;
    /// The hand is initialised and its positions are known.
    pub const HAND_READY: u32 = 1 << 15;
    /// The feedback is derated or fades out: another duration than recorded, a silent sensor, or the end of the run.
    pub const FEEDBACK_FADED: u32 = 1 << 16;
    /// This run does not go as the successful ones did.
    pub const SURPRISE: u32 = 1 << 17;
    /// Replies of the hand were lost for so long that its drives are left alone.
    pub const HAND_LOST: u32 = 1 << 18;
    /// The wrist sensor has been silent for 16.7 ms: no force tells of a contact.
    pub const CONTACT_UNSEEN: u32 = 1 << 19;
    /// A motor is warm, or the pendant warns.
    pub const CAUTION: u32 = 1 << 20;
    /// Because of that a run is held to half of the taught speed.
    pub const SLOWED: u32 = 1 << 21;
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
    pub flags: u32,
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
    /// Measured hand: spread, F1, F2, F3 of the inner links (rad); 0 without a hand.
    pub hand: [f32; 4],
    /// Desired hand in the same order (rad); the measured one where nothing is desired.
    pub hand_d: [f32; 4],
    /// Filtered, tared torque of the environment on the fingers F1, F2, F3 (N m): negative when closing on an object.
    pub gauges: [f32; 3],
    /// Statistic of the watch for unusual runs; 0 without one.
    pub surprise: f32,
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
        hand: [0.0; 4],
        hand_d: [0.0; 4],
        gauges: [0.0; 3],
        surprise: 0.0,
        lost_replies: 0,
    };
}

/// The flags of what the limiter cut.
pub(super) fn limit_flags(report: LimitReport) -> u32 {
    let bit = |set: bool, flag: u32| if set { flag } else { 0 };
    bit(report.joint, flags::JOINT_LIMITED)
        | bit(report.motor, flags::MOTOR_LIMITED)
        | bit(report.rate, flags::RATE_LIMITED)
        | bit(report.not_finite, flags::NOT_FINITE)
}
