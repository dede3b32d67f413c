//! The hand in the start-up: found, woken and read like the arm, but never a reason to stop.

use puck::hand::HandCommander;
use puck::{Node, Property, PropertyId, PropertyTable, Role, Status};

use super::survey::Survey;
use super::{Next, Startup, Step};
use crate::bus::{Answer, Outlet};
use crate::hand::{Found, HandFailure, HandProperties};

/// Properties that are read of each hand puck, in this order.
pub(super) const DIGIT_PROPERTIES: [Property; 7] =
    [Property::Cts, Property::Ipnm, Property::Pidx, Property::Grpa, Property::Grpb, Property::Grpc, Property::Hold];

/// Counts per revolution of the hand's encoders; the finger angles are computed with no other.
const COUNTS_PER_REVOLUTION: i32 = puck::hand::COUNTS_PER_REVOLUTION as i32;
/// The group through which the hand is asked, and those of the arm.
const HAND_GROUP: i32 = 5;
const ARM_GROUPS: core::ops::RangeInclusive<i32> = 1..=4;
/// Start-ups in a row that are begun anew for a puck that answers and then does not. One that never wakes is left.
const TRIES: u8 = 3;

/// State of the hand as the start-up knows it.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct HandSurvey {
    /// A puck that made it unfit, and why.
    failure: Option<(Node, HandFailure)>,
    digits: [[i32; DIGIT_PROPERTIES.len()]; 4],
    /// A puck of it has not been awake at some time since the cyclic loop: it may have lost its position.
    pub(super) slept: bool,
    /// Start-ups in a row, before this one, in which a puck of it answered and then did not.
    pub(super) tried: u8,
    found: Option<Found>,
}

impl HandSurvey {
    /// Nothing known but whether a puck has slept, and how often it was tried.
    pub(super) fn again(self) -> HandSurvey {
        HandSurvey { slept: self.slept, tried: self.tried, ..HandSurvey::default() }
    }

    /// Nothing known after the cyclic loop.
    pub(super) fn after_loop(self) -> HandSurvey {
        let tried = if self.speechless().is_some() { self.tried.saturating_add(1) } else { 0 };
        HandSurvey { tried, ..HandSurvey::default() }
    }

    /// The puck that was there and did not answer a question, or did not wake: the next time it may.
    fn speechless(&self) -> Option<Node> {
        let (node, failure) = self.failure?;
        matches!(failure, HandFailure::NoAnswer | HandFailure::DidNotWake).then_some(node)
    }

    /// The same, if it is worth another start-up.
    pub(super) fn worth_another(&self) -> Option<Node> {
        self.speechless().filter(|_| self.tried < TRIES)
    }
}

impl Survey {
    /// Pucks of a hand that answered.
    fn digits(&self) -> usize {
        Node::HAND.into_iter().filter(|node| self.is_present(*node)).count()
    }

    /// True if any puck of a hand answered.
    pub(super) fn has_digits(&self) -> bool {
        self.digits() > 0
    }

    /// The puck of the hand that tells whether it is there now: one that did not answer.
    pub(super) fn missing_digit(&self) -> Option<Node> {
        Node::HAND.into_iter().find(|node| !self.is_present(*node))
    }

    /// True if some pucks of a hand answered and others did not, or not yet.
    pub(super) fn hand_is_partial(&self) -> bool {
        !matches!(self.digits(), 0 | 4)
    }
}

impl Startup {
    /// The devices that are woken and read: the arm, its sensor, and a hand that is fit so far.
    pub(super) fn device(&self, index: u8) -> Option<Node> {
        let hand = if self.hand_is_fit() { &Node::HAND[..] } else { &[] };
        self.survey.devices().chain(hand.iter().copied()).nth(usize::from(index))
    }

    fn hand_is_fit(&self) -> bool {
        self.hand.failure.is_none() && self.survey.digits() == Node::HAND.len()
    }

    /// A puck of the hand makes it unfit. The first reason is kept.
    pub(super) fn drop_hand(&mut self, node: Node, failure: HandFailure) {
        self.hand.failure.get_or_insert((node, failure));
    }

    /// The enumeration is over.
    pub(super) fn survey_hand(&mut self) {
        let asleep = |node: &Node| self.survey.seen(*node).status != Some(Status::Ready.value());
        self.hand.slept |= Node::HAND.iter().any(asleep);
        if self.survey.hand_is_partial()
            && let Some(node) = self.survey.missing_digit()
        {
            self.drop_hand(node, HandFailure::Missing);
        }
    }

    /// Asks a puck of the hand; `None` while no answer has come, and when none will: then the hand is dropped.
    pub(super) fn ask_digit(
        &mut self,
        node: Node,
        property: PropertyId,
        outlet: &mut impl Outlet,
    ) -> Option<Result<i32, ()>> {
        match self.exchange.ask(node, property, outlet) {
            Answer::Pending => None,
            Answer::Value(value) => Some(Ok(value)),
            Answer::Silent => {
                self.drop_hand(node, HandFailure::NoAnswer);
                Some(Err(()))
            }
        }
    }

    /// ROLE of a hand puck in its monitor.
    pub(super) fn identify_digit(&mut self, node: Node, next: Step, outlet: &mut impl Outlet) -> Next {
        match self.ask_digit(node, PropertyId::ROLE, outlet) {
            None => return Next::Stay,
            Some(Ok(role)) if Role::from_value(role).kind() != Role::HAND => {
                self.drop_hand(node, HandFailure::WrongRole);
            }
            Some(_) => {}
        }
        Next::Go(next)
    }

    /// STAT (0) and VERS (1) of a hand puck that was woken.
    pub(super) fn verify_digit(&mut self, node: Node, index: u8, item: u8, outlet: &mut impl Outlet) -> Next {
        let next = Next::Go(Step::Verify { device: index + 1, item: 0 });
        if item == 0 {
            return match self.ask_digit(node, PropertyId::STAT, outlet) {
                None => Next::Stay,
                Some(Ok(status)) if status == Status::Ready.value() => {
                    Next::Go(Step::Verify { device: index, item: 1 })
                }
                Some(_) => {
                    self.drop_hand(node, HandFailure::DidNotWake);
                    next
                }
            };
        }
        match self.ask_digit(node, PropertyId::VERS, outlet) {
            None => return Next::Stay,
            Some(Ok(version)) => self.survey.note_version(node, version),
            Some(Err(())) => {}
        }
        next
    }

    /// A property of a digit; at the end what was found.
    pub(super) fn read_digit(&mut self, digit: u8, item: u8, outlet: &mut impl Outlet) -> Next {
        let place = (usize::from(digit), usize::from(item));
        let (Some(node), true) = (Node::HAND.get(place.0).copied(), self.hand_is_fit()) else {
            self.hand.found = Some(self.judge_hand());
            return Next::Go(Step::AskZero);
        };
        let Some(property) = DIGIT_PROPERTIES.get(place.1) else {
            return Next::Go(Step::ReadHand { digit: digit + 1, item: 0 });
        };
        let table = self.survey.seen(node).version.and_then(|version| PropertyTable::motor(version).ok());
        let Some(id) = table.and_then(|table| table.id(*property)) else {
            self.drop_hand(node, HandFailure::UnknownFirmware);
            return Next::Stay;
        };
        if let Some(Ok(value)) = self.ask_digit(node, id, outlet) {
            if let Some(place) = self.hand.digits.get_mut(place.0).and_then(|digit| digit.get_mut(place.1)) {
                *place = value;
            }
            return Next::Go(Step::ReadHand { digit, item: item + 1 });
        }
        Next::Stay
    }

    /// Checks everything read of the hand and joins its scales to those of the arm.
    fn judge_hand(&mut self) -> Found {
        if !self.hand_is_fit() {
            return Found::Nothing(self.hand.failure);
        }
        match self.fit_hand() {
            Ok(properties) => Found::Hand { properties, was_awake: !self.hand.slept },
            Err((node, failure)) => {
                self.drop_hand(node, failure);
                Found::Nothing(self.hand.failure)
            }
        }
    }

    fn fit_hand(&mut self) -> Result<HandProperties, (Node, HandFailure)> {
        let mut common: Option<HandProperties> = None;
        for (place, (node, digit)) in (1..).zip(Node::HAND.into_iter().zip(self.hand.digits)) {
            let [counts, _, index, groups @ .., _] = digit;
            // A puck in the wrong group, or at the wrong place of the frame, would apply the torque of another one.
            if !groups.contains(&HAND_GROUP) || groups.iter().any(|group| ARM_GROUPS.contains(group)) {
                return Err((node, HandFailure::WrongGroups));
            }
            if index != place {
                return Err((node, HandFailure::WrongPlace));
            }
            if counts != COUNTS_PER_REVOLUTION {
                return Err((node, HandFailure::WrongScale));
            }
            let properties = self.digit_properties(node).ok_or((node, HandFailure::UnknownFirmware))?;
            if *common.get_or_insert(properties) != properties {
                return Err((node, HandFailure::UnknownFirmware));
            }
        }
        let [first, ..] = Node::HAND;
        let units = self.hand.digits.map(|[_, units, ..]| units);
        let scales = self.calibration.map(|calibration| calibration.with_hand(units));
        match (common, scales) {
            (Some(properties), Some(Ok(calibration))) => {
                self.calibration = Some(calibration);
                Ok(properties)
            }
            (_, Some(Err(control::CalibrationError::HandTorqueCounts(digit)))) => {
                let node = Node::HAND.get(usize::from(digit)).copied().unwrap_or(first);
                Err((node, HandFailure::WrongScale))
            }
            _ => Err((first, HandFailure::WrongScale)),
        }
    }

    /// The numbers of the properties on this puck. Packed torques and group requests carry one number for all.
    fn digit_properties(&self, node: Node) -> Option<HandProperties> {
        let table = PropertyTable::motor(self.survey.seen(node).version?).ok()?;
        let same_generation =
            table.id(Property::T) == Some(PropertyId::TORQUE) && table.id(Property::P) == Some(PropertyId::POSITION);
        Some(HandProperties {
            commander: HandCommander::new(&table).ok().filter(|_| same_generation)?,
            gauge: table.id(Property::Sg)?,
            stall: table.id(Property::Tstop)?,
            holds: self.hand.digits.map(|[.., holds]| holds != 0),
        })
    }

    /// Returns the result for the hand, once after each time it was read. What has slept before is no news any more.
    pub(crate) fn take_hand(&mut self) -> Option<Found> {
        self.hand.slept = false;
        self.hand.found.take()
    }
}
