//! Events: messages of the control half to a person, unasked or in answer to a command.

use control::{Fault, State};
use link::HandStage;
use puck::{Node, SafetyMode};

use crate::command::Refusal;
use crate::hand::HandFailure;
use crate::stage::{Stage, StartupError};

/// Something happened.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Event {
    /// Control cycle in which it happened.
    pub cycle: u64,
    /// Its kind.
    pub kind: EventKind,
}

/// Kind of an event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum EventKind {
    /// The oldest unanswered command was taken up.
    Accepted,
    /// The oldest unanswered command was refused.
    Refused(Refusal),
    /// The supervisor entered a state, for this reason or for none.
    Entered(State, Fault),
    /// The movement ended and the arm holds its goal.
    Arrived,
    /// The bus start-up reached a stage.
    Startup(Stage),
    /// The bus start-up cannot go on, for this reason. It tries again by itself; told once per reason.
    Blocked(StartupError),
    /// The safety module reports another mode than before.
    Safety {
        /// The mode.
        mode: SafetyMode,
        /// True if it went to IDLE because this device has asked for it, and no person: brakes alone hold the arm.
        is_asked_for: bool,
    },
    /// The run no longer goes as the successful ones before it.
    Surprised {
        /// Progress of the movement, 0 to 1000: an integer, because the log spells events out, and the code that spells
        /// a float takes 21 KB of flash.
        progress: u16,
        /// The channel of the statistics that stands out most.
        channel: u8,
    },
    /// The hand reached a stage, or was found unfit at the start.
    Hand {
        /// The stage.
        stage: HandStage,
        /// The puck that caused it and why, where something went wrong.
        cause: Option<(Node, HandFailure)>,
    },
}

impl From<control::Event> for EventKind {
    fn from(event: control::Event) -> EventKind {
        match event {
            control::Event::Accepted => EventKind::Accepted,
            control::Event::Refused(reason) => EventKind::Refused(Refusal::Control(reason)),
            control::Event::Entered(state, fault) => EventKind::Entered(state, fault),
            control::Event::Arrived => EventKind::Arrived,
            control::Event::Surprised { phase, channel } => {
                EventKind::Surprised { progress: thousandths(phase), channel }
            }
        }
    }
}

/// A share of one in 1/1000, rounded to the nearest; 0 for what is no share.
fn thousandths(share: f32) -> u16 {
    (share.clamp(0.0, 1.0) * 1000.0 + 0.5) as u16
}
