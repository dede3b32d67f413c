//! The hand on the bus: from four woken pucks to a sample and a torque frame in every control cycle.
//!
//! A hand is optional: whatever is wrong with it is told and leaves the arm alone. Its fingers move only when a person
//! has asked for the initialisation, and after that only by the torques of the control cycle.
//!
//! | stage | what goes to the hand |
//! |---|---|
//! | absent | nothing |
//! | not initialised | questions for MODE and TEMP |
//! | initialising | its command, and GET MODE every 100 ms |
//! | ready | GET P and GET SG in every cycle, torques where the control cycle drives it, MODE as these need it |
//! | failed | MODE IDLE, questions for MODE and TEMP, and MODE IDLE again to a puck that tells another |

mod drive;
mod failure;
mod found;
mod initialise;
mod round;

use control::HandSample;
use link::HandStage;
use puck::{CanFrame, Node, PropertyId, Reply, Status, get};

use crate::bus::Outlet;
use crate::command::Refusal;
use crate::health::Counters;
pub use drive::Drive;
pub use failure::HandFailure;
pub(crate) use found::Found;
pub use found::HandProperties;
pub use initialise::{Initialisation, Outcome};
pub use round::HandRound;

/// Time that a puck may be silent before the hand is given up: 0.2 s, in rounds, one a control period.
const SILENT_ROUNDS: u16 = control::time::periods(0.2);

/// Control periods for which one puck of a hand that is not initialised is the one to be asked for its STAT: two of
/// the slow questions about what is missing, of which one may be the sensor's.
const TURN_CYCLES: u64 = 60;

/// The hand.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hand {
    stage: HandStage,
    cause: Option<(Node, HandFailure)>,
    /// Stage and cause that were told last.
    told: (HandStage, Option<(Node, HandFailure)>),
    properties: Option<HandProperties>,
    /// It was ready when the bus was started anew.
    was_ready: bool,
    initialisation: Option<Initialisation>,
    round: HandRound,
    drive: Drive,
    /// The puck that was asked for its STAT.
    asked: Option<Node>,
}

impl Hand {
    /// Nothing known.
    pub(crate) fn new() -> Hand {
        Hand {
            stage: HandStage::Absent,
            cause: None,
            told: (HandStage::Absent, None),
            properties: None,
            was_ready: false,
            initialisation: None,
            round: HandRound::default(),
            drive: Drive::resting(false),
            asked: None,
        }
    }

    /// The start-up is over and has found this.
    pub(crate) fn begin(&mut self, found: Found) {
        let (told, was_ready) = (self.told, self.was_ready);
        *self = Hand { told, ..Hand::new() };
        match found {
            Found::Nothing(cause) => self.cause = cause,
            Found::Hand { properties, was_awake } => {
                self.properties = Some(properties);
                self.stage = if was_ready && was_awake { HandStage::Ready } else { HandStage::NotInitialised };
            }
        }
    }

    /// The cyclic loop goes on after the arm was zeroed again: what was told before is stale.
    pub(crate) fn resume(&mut self) {
        self.round = HandRound::default();
    }

    /// The bus is started anew: nothing is known until the start-up is over.
    pub(crate) fn suspend(&mut self) {
        let was_ready = self.was_ready || self.stage == HandStage::Ready;
        *self = Hand { told: self.told, was_ready, ..Hand::new() };
    }

    /// Its stage.
    pub(crate) fn stage(&self) -> HandStage {
        self.stage
    }

    /// Stage and cause, if either has changed since the last call.
    pub(crate) fn news(&mut self) -> Option<(HandStage, Option<(Node, HandFailure)>)> {
        let now = (self.stage, self.cause);
        (now != core::mem::replace(&mut self.told, now)).then_some(now)
    }

    /// A person wants it initialised.
    pub(crate) fn initialise(&mut self, now_us: u64) -> Result<(), Refusal> {
        match (self.stage, self.properties) {
            (HandStage::Initialising, _) => Err(Refusal::HandBusy),
            (HandStage::Absent, _) | (_, None) => Err(Refusal::NoHand),
            (stage, Some(_)) => {
                // Braking after a stop: that word may not have left.
                let driven = stage == HandStage::Ready || self.drive.mode_frame().is_some();
                self.enter(HandStage::Initialising, None);
                self.drive = Drive::resting(false);
                self.initialisation = Some(Initialisation::new(driven, now_us));
                Ok(())
            }
        }
    }

    /// A person wants everything to stop.
    pub(crate) fn stop(&mut self) {
        if self.stage == HandStage::Initialising {
            self.enter(HandStage::NotInitialised, None);
        }
    }

    /// The puck to be asked for its STAT. One that has restarted or fallen silent may sleep, and a start-up alone wakes
    /// it: it is asked while the arm `rests`. Before the initialisation nothing else tells of one that has restarted;
    /// they take turns by the `cycle`.
    pub(crate) fn puck_in_doubt(&self, cycle: u64, rests: bool) -> Option<Node> {
        match (self.stage, self.cause) {
            (HandStage::NotInitialised, _) => {
                let [f1, f2, f3, spread] = Node::HAND;
                Some(match cycle / TURN_CYCLES % 4 {
                    0 => f1,
                    1 => f2,
                    2 => f3,
                    _ => spread,
                })
            }
            (HandStage::Failed, Some((node, HandFailure::Reset | HandFailure::Silent))) => Some(node).filter(|_| rests),
            _ => None,
        }
    }

    /// A puck has told its STAT; false if it is one that was missed, or lost.
    pub(crate) fn hear_status(&mut self, node: Node, is_ready: bool) -> bool {
        if matches!(self.stage, HandStage::Absent | HandStage::Failed) {
            return false;
        }
        if self.stage == HandStage::NotInitialised && !is_ready {
            self.fail(node, HandFailure::Reset);
        }
        true
    }

    /// True if its pucks may be asked for MODE and TEMP.
    pub(crate) fn answers_questions(&self) -> bool {
        matches!(self.stage, HandStage::NotInitialised | HandStage::Ready | HandStage::Failed)
    }

    /// A reply has come in; whether it was for the hand.
    pub(crate) fn take(&mut self, reply: &Reply, counters: &mut Counters) -> bool {
        match *reply {
            Reply::Position { node, primary, secondary } => match node.hand_index() {
                Some(digit) if self.properties.is_some() => {
                    if let Some(initialisation) = &mut self.initialisation
                        && initialisation.receive_position(digit, primary)
                    {
                        return true;
                    }
                    self.round.take_position(digit, primary, secondary, counters);
                    true
                }
                _ => false,
            },
            Reply::Property { node, property, value } => {
                let (Some(digit), Some(properties)) = (node.hand_index(), self.properties) else {
                    return false;
                };
                if let Some(initialisation) = &mut self.initialisation {
                    return initialisation.receive(digit, node, property, value);
                }
                if property == properties.gauge {
                    self.round.take_gauge(digit, value, counters);
                    return true;
                }
                if property == PropertyId::STAT && self.asked == Some(node) {
                    self.asked = None;
                    if Status::from_value(value) != Some(Status::Ready) {
                        self.fail(node, HandFailure::Reset);
                    }
                    return true;
                }
                false
            }
            _ => false,
        }
    }

    /// A puck has told its MODE.
    pub(crate) fn hear_mode(&mut self, node: Node, value: i32) {
        self.drive.hear_mode(node, value);
    }

    /// The replies since the last cycle; `None` unless it is ready.
    pub(crate) fn sample(&mut self, counters: &mut Counters) -> Option<HandSample> {
        let sample = self.round.close(counters);
        if let Some(node) = self.round.silent_for(SILENT_ROUNDS).filter(|_| self.stage == HandStage::Ready) {
            self.fail(node, HandFailure::Silent);
        }
        sample.filter(|_| self.stage == HandStage::Ready)
    }

    /// The frames of a control slot, to be sent behind the arm's torques: the hand's torques, and its questions.
    pub(crate) fn frames(&mut self, torques: Option<CanFrame>) -> [Option<CanFrame>; 3] {
        match (self.stage, self.properties) {
            (HandStage::Ready, Some(properties)) => {
                let [position, gauge] = self.round.open(properties.gauge);
                [self.drive.torque_frame(torques), Some(position), Some(gauge)]
            }
            _ => [None; 3],
        }
    }

    /// True if its drives have yet to be told a mode, to brake for one.
    pub(crate) fn has_word(&self) -> bool {
        self.properties.is_some() && self.initialisation.is_none() && self.drive.mode_frame().is_some()
    }

    /// A slow slot that the hand may use; whether it did.
    pub(crate) fn act(&mut self, outlet: &mut impl Outlet) -> bool {
        let Some(properties) = self.properties else {
            return false;
        };
        if let Some(initialisation) = &mut self.initialisation {
            match initialisation.advance(&properties, outlet) {
                Outcome::Busy => {}
                Outcome::Done => self.enter(HandStage::Ready, None),
                Outcome::Failed(node, failure) => self.fail(node, failure),
            }
            return true;
        }
        if let Some(frame) = self.drive.mode_frame() {
            if outlet.send(frame) {
                self.drive.mode_sent();
            }
            return true;
        }
        let suspect = self.round.suspect().filter(|_| self.stage == HandStage::Ready);
        suspect.is_some_and(|node| {
            self.asked = Some(node);
            outlet.send(get(node, PropertyId::STAT))
        })
    }

    fn fail(&mut self, node: Node, failure: HandFailure) {
        self.enter(HandStage::Failed, Some((node, failure)));
    }

    /// Enters a stage with drives at rest: whatever the pucks did before, they are told to stop.
    fn enter(&mut self, stage: HandStage, cause: Option<(Node, HandFailure)>) {
        // A digit that holds after its initialisation may go on holding.
        let brake = stage != HandStage::Ready;
        *self = Hand {
            stage,
            cause,
            told: self.told,
            properties: self.properties,
            drive: Drive::resting(brake),
            ..Hand::new()
        };
    }
}
