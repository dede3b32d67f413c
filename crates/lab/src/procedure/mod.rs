//! The steps of an operator, done by the host: make the arm ready, bring it to a posture, record what it
//! does.

mod calibrate;
mod hand;
mod mode;
mod ready;
mod recorder;
mod rehearse;
mod rest;
mod run;
mod tare;
mod teach;
mod travel;
mod wait;
mod weigh;

pub use calibrate::{HomeCorrection, correct_home};
pub use hand::{HandReach, initialise_hand, initialise_hand_anew, move_hand, move_hand_to_the_end};
pub use mode::Mode;
pub use ready::{Readiness, StartupLook, make_ready, start_up};
pub use recorder::{CycleWriter, Recorder, Take, recording_row, recording_text};
pub use rehearse::play_once;
pub use run::{CHANNELS, Change, ChangeKind, FlagCounts, RunOutcome, RunRequest, Surprise, planned, play};
pub use tare::{Reading, Tared, tare};
pub use teach::{Demonstrated, record_demonstration, teacher};
pub use travel::{go_to_start, travel};
pub use wait::{EndCondition, after, pass, wait_for};
pub use weigh::{Crossings, cross_postures, slide_postures, weight_in_use};

use control::Fault;
use device::HandFailure;
use link::HandStage;
use puck::Node;

use crate::error::HostError;

/// Digits of the hand, in the order of its angles.
const DIGITS: [&str; 4] = ["the spread", "F1", "F2", "F3"];

/// Why no gauge tells anything.
fn without_hand(stage: HandStage) -> &'static str {
    match stage {
        HandStage::Absent => "no hand that answers",
        HandStage::Initialising => "the hand is being initialised",
        HandStage::NotInitialised | HandStage::Failed | HandStage::Ready => "the hand is not initialised",
    }
}

/// Why a procedure ended early.
#[derive(Debug, thiserror::Error)]
pub enum ProcedureError {
    /// The conversation with the device failed.
    #[error(transparent)]
    Host(#[from] HostError),
    /// The bus start-up does not get further.
    #[error("the arm does not get ready: {0}")]
    NotReady(String),
    /// The arm was not zeroed, and only a person can say where it stands.
    #[error("the arm does not know where it stands")]
    NotZeroed,
    /// The arm was zeroed before the device was started, or by another device.
    #[error(
        "the arm was not zeroed by this device since its bus was started, so nobody knows where it was taken to stand"
    )]
    ZeroOfOthers,
    /// The arm moves where it must stand.
    #[error("J{} of the arm moves; it has to stand for a fifth of a second", .joint + 1)]
    Moves {
        /// The first joint that does, 0 for J1.
        joint: usize,
    },
    /// Something loads the hand whose weight is to count as nothing.
    #[error("{force:.1} N act on the hand at rest, more than a sensor drifts")]
    Loaded {
        /// The force, N.
        force: f64,
    },
    /// The hand moves where it must stand.
    #[error("{} of the hand moves; it has to stand for a fifth of a second", DIGITS[*.digit])]
    HandMoves {
        /// The first digit that does: spread, F1, F2, F3.
        digit: usize,
    },
    /// A hand alone grips what is to count as nothing.
    #[error("F{} feels {torque:.2} N m at rest, more than a gauge drifts", .finger + 1)]
    Grips {
        /// The first finger that does, 0 for F1.
        finger: usize,
        /// The torque on it, N m.
        torque: f64,
    },
    /// Neither a force sensor nor the gauges of a hand tell anything.
    #[error("there is no force sensor, and {}: there is nothing to tare", without_hand(*.hand))]
    NothingToTare {
        /// Stage of the hand.
        hand: HandStage,
    },
    /// A fault is latched.
    #[error("fault: {0:?}: {0}")]
    Faulted(Fault),
    /// The arm stopped by itself.
    #[error("the arm stopped: {0}")]
    Stopped(Fault),
    /// The arm left its motion for a state that was not asked for.
    #[error("the arm went to state '{0}' instead")]
    Diverted(&'static str),
    /// It took too long.
    #[error("{what} did not end within {seconds} s")]
    TooLong {
        /// The event that was waited for.
        what: &'static str,
        /// Time waited, s.
        seconds: u64,
    },
    /// The hand did not get ready.
    #[error("the hand does not get ready: {0}")]
    Hand(&'static str),
    /// The hand did not get ready, for the reason that one of its pucks gave.
    #[error("the hand does not get ready: its puck {} {failure}", .node.number())]
    HandPuck {
        /// The puck.
        node: Node,
        /// The reason.
        failure: HandFailure,
    },
    /// The hand was ready, and is not any more.
    #[error("the hand was lost in its move: a puck of it fell silent or restarted")]
    HandLost,
    /// The recording cannot be written.
    #[error("the recording cannot be written: {0}")]
    Recording(#[from] std::io::Error),
}

impl From<crate::transport::TransportError> for ProcedureError {
    fn from(error: crate::transport::TransportError) -> Self {
        Self::Host(error.into())
    }
}
