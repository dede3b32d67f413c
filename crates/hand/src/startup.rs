//! `Startup`: from power-up to four woken hand pucks whose properties are known, on a bus with nothing else.
//!
//! Sends at most one frame per call, torque none. Where something is wrong it tells why, rests for a second and begins
//! anew.

use device::bus::{Answer, Exchange, Outlet};
use device::hand::{HandFailure, HandProperties};
use puck::hand::{COUNTS_PER_REVOLUTION, HandCommander};
use puck::{Group, Node, Property, PropertyId, PropertyTable, Role, Status, get, hand_stop_frames, set};

use crate::DIGITS;

/// Longest time to an answer in an enumeration (us): a puck that boots needs up to 50 ms.
const LISTEN_US: u64 = 50_000;
/// Between two wakes (us): each may glitch the transceivers.
const WAKE_GAP_US: u64 = 10_000;
/// Silence after the last wake (us).
const WAKE_SILENCE_US: u64 = 1_000_000;
/// Between two attempts (us).
const REST_US: u64 = 1_000_000;
/// Enumerations after which a partial hand counts as one.
const ENUMERATIONS: u8 = 6;

/// Properties that are read of each puck, in this order.
const PROPERTIES: [Property; 7] =
    [Property::Cts, Property::Ipnm, Property::Pidx, Property::Grpa, Property::Grpb, Property::Grpc, Property::Hold];
/// Torque scales that are possible.
const UNITS_RANGE: core::ops::RangeInclusive<i32> = 500..=50_000;
/// Groups that carry the torques of an arm: a puck that listened to them would take another one's.
const ARM_GROUPS: core::ops::RangeInclusive<i32> = 1..=4;

/// Present step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// Take off what torque may still be applied: the frames of [`hand_stop_frames`] from this one on.
    ZeroTorques {
        frame: usize,
    },
    Enumerate {
        digit: usize,
    },
    Listen {
        until_us: u64,
    },
    Role {
        digit: usize,
    },
    Wake {
        digit: usize,
        after_us: u64,
        woken: bool,
    },
    Silence {
        until_us: u64,
    },
    Status {
        digit: usize,
    },
    Version {
        digit: usize,
    },
    Read {
        digit: usize,
        item: usize,
    },
    Rest {
        until_us: u64,
    },
    Done,
}

/// The phases for people.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Looking for the pucks.
    Enumerating,
    /// Waking them.
    Waking,
    /// Reading their properties.
    Reading,
    /// Over.
    Done,
}

/// A hand that was found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FoundHand {
    /// Numbers of its properties.
    pub properties: HandProperties,
    /// IPNM of F1, F2, F3, spread.
    pub units_per_newton_metre: [i32; DIGITS],
}

/// Result of one call.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// Under way.
    Busy,
    /// A hand.
    Found(FoundHand),
    /// None that works, because of this puck; it is looked for again.
    Unfit(Node, HandFailure),
}

/// The start-up.
#[derive(Clone, Copy, Debug)]
pub struct Startup {
    step: Step,
    exchange: Exchange,
    enumerations: u8,
    status: [Option<i32>; DIGITS],
    versions: [i32; DIGITS],
    values: [[i32; PROPERTIES.len()]; DIGITS],
}

impl Startup {
    /// At its beginning.
    pub fn new() -> Startup {
        Startup {
            step: Step::ZeroTorques { frame: 0 },
            exchange: Exchange::default(),
            enumerations: 0,
            status: [None; DIGITS],
            versions: [0; DIGITS],
            values: [[0; PROPERTIES.len()]; DIGITS],
        }
    }

    /// The phase it is in.
    pub fn phase(&self) -> Phase {
        match self.step {
            Step::ZeroTorques { .. }
            | Step::Enumerate { .. }
            | Step::Listen { .. }
            | Step::Role { .. }
            | Step::Rest { .. } => Phase::Enumerating,
            Step::Wake { .. } | Step::Silence { .. } | Step::Status { .. } => Phase::Waking,
            Step::Version { .. } | Step::Read { .. } => Phase::Reading,
            Step::Done => Phase::Done,
        }
    }

    /// A property of a hand puck has come; whether it was asked for.
    pub fn receive(&mut self, digit: usize, node: Node, property: PropertyId, value: i32) -> bool {
        match (self.step, self.status.get_mut(digit)) {
            (Step::Enumerate { .. } | Step::Listen { .. }, Some(place)) if property == PropertyId::STAT => {
                *place = Some(value);
                true
            }
            _ => self.exchange.receive(node, property, value),
        }
    }

    /// One slot.
    pub fn advance(&mut self, outlet: &mut impl Outlet) -> Progress {
        let now_us = outlet.now_us();
        match self.attempt(now_us, outlet) {
            Ok(None) => Progress::Busy,
            Ok(Some(found)) => {
                self.step = Step::Done;
                Progress::Found(found)
            }
            Err((node, failure)) => {
                *self = Startup { step: Step::Rest { until_us: now_us + REST_US }, ..Startup::new() };
                Progress::Unfit(node, failure)
            }
        }
    }

    /// All who are there have answered the enumeration.
    fn listened(&mut self, now_us: u64) -> Result<(), (Node, HandFailure)> {
        self.enumerations += 1;
        let present = self.status.iter().flatten().count();
        let missing = Node::HAND.into_iter().zip(self.status).find(|(_, status)| status.is_none());
        match missing {
            None => self.step = Step::Role { digit: 0 },
            Some((node, _)) if present > 0 && self.enumerations >= ENUMERATIONS => {
                return Err((node, HandFailure::Missing));
            }
            // Nobody there yet is nothing to tell: the hand may be switched on later.
            Some(_) => {
                let enumerations = if present > 0 { self.enumerations } else { 0 };
                let step = Step::Rest { until_us: now_us + REST_US / 4 };
                *self = Startup { step, enumerations, ..Startup::new() };
            }
        }
        Ok(())
    }

    fn attempt(&mut self, now_us: u64, outlet: &mut impl Outlet) -> Result<Option<FoundHand>, (Node, HandFailure)> {
        match self.step {
            Step::ZeroTorques { frame } => match hand_stop_frames().get(frame) {
                Some(content) => {
                    if outlet.send(*content) {
                        self.step = Step::ZeroTorques { frame: frame + 1 };
                    }
                }
                None => self.step = Step::Enumerate { digit: 0 },
            },
            Step::Enumerate { digit } => match Node::HAND.get(digit) {
                Some(node) => {
                    if outlet.send(get(*node, PropertyId::STAT)) {
                        self.step = Step::Enumerate { digit: digit + 1 };
                    }
                }
                None => self.step = Step::Listen { until_us: now_us + LISTEN_US },
            },
            Step::Listen { until_us } if now_us < until_us => {}
            Step::Listen { .. } => self.listened(now_us)?,
            Step::Role { digit } => match Node::HAND.get(digit) {
                None => self.step = Step::Wake { digit: 0, after_us: now_us, woken: false },
                Some(node) => {
                    if let Some(role) = self.ask(*node, PropertyId::ROLE, outlet)? {
                        if Role::from_value(role).kind() != Role::HAND {
                            return Err((*node, HandFailure::WrongRole));
                        }
                        self.step = Step::Role { digit: digit + 1 };
                    }
                }
            },
            Step::Wake { after_us, .. } if now_us < after_us => {}
            Step::Wake { digit, woken, .. } => match (Node::HAND.get(digit), self.status.get(digit)) {
                (Some(_), Some(Some(status))) if *status == Status::Ready.value() => {
                    self.step = Step::Wake { digit: digit + 1, after_us: now_us, woken };
                }
                (Some(node), _) => {
                    if outlet.send(set(*node, PropertyId::STAT, Status::Ready.value())) {
                        self.step = Step::Wake { digit: digit + 1, after_us: now_us + WAKE_GAP_US, woken: true };
                    }
                }
                (None, _) if woken => self.step = Step::Silence { until_us: now_us + WAKE_SILENCE_US },
                (None, _) => self.step = Step::Status { digit: 0 },
            },
            Step::Silence { until_us } if now_us < until_us => {}
            Step::Silence { .. } => self.step = Step::Status { digit: 0 },
            Step::Status { digit } => match Node::HAND.get(digit) {
                None => self.step = Step::Version { digit: 0 },
                Some(node) => {
                    if let Some(status) = self.ask(*node, PropertyId::STAT, outlet)? {
                        if status != Status::Ready.value() {
                            return Err((*node, HandFailure::DidNotWake));
                        }
                        self.step = Step::Status { digit: digit + 1 };
                    }
                }
            },
            Step::Version { digit } => match (Node::HAND.get(digit), self.versions.get(digit)) {
                (Some(node), Some(_)) => {
                    // What the boot loader told was its own version; only this one chooses property numbers.
                    if let Some(version) = self.ask(*node, PropertyId::VERS, outlet)?
                        && let Some(place) = self.versions.get_mut(digit)
                    {
                        *place = version;
                        self.step = Step::Version { digit: digit + 1 };
                    }
                }
                _ => self.step = Step::Read { digit: 0, item: 0 },
            },
            Step::Read { digit, item } => return self.read(digit, item, outlet),
            Step::Rest { until_us } => {
                if now_us >= until_us {
                    // A puck that was not heard may not have heard that its torque has ended either.
                    self.step = Step::ZeroTorques { frame: 0 };
                }
            }
            Step::Done => {}
        }
        Ok(None)
    }

    fn read(
        &mut self,
        digit: usize,
        item: usize,
        outlet: &mut impl Outlet,
    ) -> Result<Option<FoundHand>, (Node, HandFailure)> {
        let Some(node) = Node::HAND.get(digit).copied() else {
            return self.judge().map(Some);
        };
        let Some(property) = PROPERTIES.get(item) else {
            self.step = Step::Read { digit: digit + 1, item: 0 };
            return Ok(None);
        };
        let id = self.table(digit).and_then(|table| table.id(*property));
        let id = id.ok_or((node, HandFailure::UnknownFirmware))?;
        if let Some(value) = self.ask(node, id, outlet)? {
            if let Some(place) = self.values.get_mut(digit).and_then(|values| values.get_mut(item)) {
                *place = value;
            }
            self.step = Step::Read { digit, item: item + 1 };
        }
        Ok(None)
    }

    fn ask(
        &mut self,
        node: Node,
        property: PropertyId,
        outlet: &mut impl Outlet,
    ) -> Result<Option<i32>, (Node, HandFailure)> {
        match self.exchange.ask(node, property, outlet) {
            Answer::Pending => Ok(None),
            Answer::Value(value) => Ok(Some(value)),
            Answer::Silent => Err((node, HandFailure::NoAnswer)),
        }
    }

    fn table(&self, digit: usize) -> Option<PropertyTable> {
        PropertyTable::motor(*self.versions.get(digit)?).ok()
    }

    /// Everything is read: is it a hand that can be driven?
    fn judge(&self) -> Result<FoundHand, (Node, HandFailure)> {
        let mut common: Option<HandProperties> = None;
        let places = Node::HAND.into_iter().enumerate().zip(self.values).zip(1..);
        for (((digit, node), values), place) in places {
            let [counts, units, index, groups @ .., _] = values;
            let hand_group = i32::from(Group::HAND.number());
            // A puck in the wrong group, or at the wrong place of the frame, would apply the torque of another one.
            if !groups.contains(&hand_group) || groups.iter().any(|group| ARM_GROUPS.contains(group)) {
                return Err((node, HandFailure::WrongGroups));
            }
            if index != place {
                return Err((node, HandFailure::WrongPlace));
            }
            if counts != COUNTS_PER_REVOLUTION as i32 || !UNITS_RANGE.contains(&units) {
                return Err((node, HandFailure::WrongScale));
            }
            let properties = self.properties(digit).ok_or((node, HandFailure::UnknownFirmware))?;
            if *common.get_or_insert(properties) != properties {
                return Err((node, HandFailure::UnknownFirmware));
            }
        }
        let [first, ..] = Node::HAND;
        let properties = common.ok_or((first, HandFailure::Missing))?;
        Ok(FoundHand { properties, units_per_newton_metre: self.values.map(|[_, units, ..]| units) })
    }

    fn properties(&self, digit: usize) -> Option<HandProperties> {
        let table = self.table(digit)?;
        let same_generation =
            table.id(Property::T) == Some(PropertyId::TORQUE) && table.id(Property::P) == Some(PropertyId::POSITION);
        Some(HandProperties {
            commander: HandCommander::new(&table).ok().filter(|_| same_generation)?,
            gauge: table.id(Property::Sg)?,
            stall: table.id(Property::Tstop)?,
            holds: self.values.map(|[.., holds]| holds != 0),
        })
    }
}

impl Default for Startup {
    fn default() -> Self {
        Startup::new()
    }
}
