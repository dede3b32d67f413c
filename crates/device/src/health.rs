//! Counters and states that tell how well the bus and the arm are, for the statistics of the link.

use control::{Fault, Payload, State};
use link::HandStage;
use puck::SafetyMode;

use crate::stage::{Stage, StartupError};

/// Counters since power-up. They wrap at 2^32: a day of lost frames at 300 Hz is 2.6e7.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Control cycles.
    pub cycles: u32,
    /// Control cycles that the board began late, see [`crate::Controller::note_overrun`].
    pub overruns: u32,
    /// Position and wrench replies that had not come when the cycle needed them.
    pub lost_replies: u32,
    /// Replies that came after their cycle, or twice, and were discarded.
    pub late_replies: u32,
    /// Frames that are malformed, or no reply.
    pub malformed_frames: u32,
    /// Well-formed replies that nobody had asked for: wrong node or wrong property.
    pub foreign_frames: u32,
    /// Unsolicited broadcasts of the safety module (0x540), ignored.
    pub broadcasts: u32,
    /// Frames given to the CAN controller.
    pub frames_sent: u32,
    /// Frames taken from the CAN controller.
    pub frames_received: u32,
    /// Frames the CAN controller had no room for.
    pub frames_refused: u32,
    /// Cycles in which only one of the two torque frames could be sent.
    pub torque_mismatches: u32,
    /// Bus errors the board reported, see [`crate::Controller::note_bus_error`].
    pub bus_errors: u32,
    /// Times the start-up began anew.
    pub restarts: u32,
    /// Replies of the hand that had not come when the cycle needed them.
    pub hand_lost_replies: u32,
}

impl Counters {
    /// Add one, wrapping.
    pub fn count(counter: &mut u32) {
        *counter = counter.wrapping_add(1);
    }
}

/// Measurements of a processor by its board.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timing {
    /// Longest control computation, ticks.
    pub cost_worst_ticks: u32,
    /// Mean control computation, ticks.
    pub cost_mean_ticks: u32,
    /// Longest delay from the slot timer to the control task, ticks.
    pub latency_worst_ticks: u32,
    /// Stack never used so far, bytes; 0 where it is not measured.
    pub stack_free: u32,
    /// Size of the stack, bytes; 0 where it is not measured.
    pub stack_size: u32,
}

/// The state of the control half at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Health {
    /// Number of the latest control cycle.
    pub cycle: u64,
    /// Stage of the bus start-up.
    pub stage: Stage,
    /// Why it cannot go on, if it cannot.
    pub blocked: Option<StartupError>,
    /// State of the supervisor.
    pub state: State,
    /// The state whose law acts: while lost replies are bridged, the one before.
    pub law: State,
    /// The latched fault.
    pub fault: Fault,
    /// The encoders count from a known pose, as the safety module says. False for a hand alone, as for all that is only
    /// an arm's.
    pub zeroed: bool,
    /// The posture (rad) at which the arm was told to stand when it was zeroed; `None` if that was before the bus was
    /// started.
    pub zeroed_at: Option<[f32; 7]>,
    /// Payload mounted on the arm, as the last start-up found it; sensor and hand until one has.
    pub payload: Payload,
    /// True if the control half holds a primitive. It forgets it when a start-up finds another payload.
    pub has_primitive: bool,
    /// True if the wrench has a zero; `None` without a force/torque sensor.
    pub wrench_zeroed: Option<bool>,
    /// Latest mode of the safety module; `None` before it answered.
    pub safety_mode: Option<SafetyMode>,
    /// Latest pendant word; `None` before it answered. Decode with [`puck::PendantState::from_value`].
    pub pendant: Option<i32>,
    /// Latest temperature of each arm puck, degree Celsius.
    pub temperatures: [Option<i16>; 7],
    /// Stage of the hand.
    pub hand: HandStage,
    /// The hand moves by itself, outside a run: its initialisation, or a move that a person asked for.
    pub hand_moves: bool,
    /// Latest temperature of each hand puck (F1, F2, F3, spread), degree Celsius.
    pub hand_temperatures: [Option<i16>; 4],
    /// Counters.
    pub counters: Counters,
}
