//! The slow slot: one question per cycle about things that change slowly, in turn.
//!
//! | what | how often | why |
//! |---|---|---|
//! | MODE of the safety module | 150 Hz | torque must end within 3 cycles of IDLE or E-STOP |
//! | STAT of a puck that fell silent | 150 Hz, while it is silent | a puck that has reset must be found within 20 ms |
//! | MODE of puck 1 | 10 Hz, up to 150 Hz when torque has ended | it brakes exactly while the safety module is IDLE |
//! | MODE of every puck, in turn | 10 Hz; one that brakes under an ACTIVE module out of turn | it does not pull |
//! | PEN | 5 Hz | lights and warnings for a person |
//! | MODE of each hand puck | 10 Hz, while there is a hand | a SET has no acknowledge, and others may set modes too |
//! | TEMP | 1 Hz for each puck | heat |
//! | STAT of sensor or hand, if the start-up missed it | 10 Hz, in turn | the arm carries it all the same |
//! | STAT of a sensor that measures nothing | 10 Hz, while the arm is IDLE | one that has restarted has to be woken |
//! | STAT of one puck of a hand, missed or lost | 10 Hz, while the arm is IDLE | the hand comes back with it |
//! | STAT of each puck of a hand that is not initialised | 1 Hz and more | one that has restarted has to be woken |
//!
//! The odd slots may be taken by the hand for something more urgent. A property that is new here has to be named in
//! [`BackgroundPoll::take`], which takes every other answer for the pendant word.

use puck::{CanFrame, Node, PropertyId, get};

use crate::startup::SafetyProperties;

/// The property TEMP of every motor firmware from VERS 61.
const TEMPERATURE: PropertyId = match PropertyId::new(9) {
    Some(id) => id,
    None => unreachable!(),
};

/// Slow slots between two looks at MODE of puck 1. All offsets are odd and all periods multiples of 6, so that no two
/// questions fall into one slot and the even slots stay with the safety module. Offsets 1, 7, 13.. are for modes.
const PUCK_MODE: (u32, u32) = (30, 1);
/// Slow slots between two looks at MODE of any puck of the arm; the seven pucks take turns.
const EACH_MODE: (u32, u32) = (30, 15);
/// Slow slots between two looks at MODE of a hand puck; the one of puck 1 falls into the same raster.
const HAND_MODE: (u32, u32) = (6, 1);
/// Slow slots between two looks at the pendant.
const PENDANT: (u32, u32) = (60, 3);
/// Slow slots between two looks at a temperature of the hand; the four pucks take turns.
const HAND_TEMPERATURES: (u32, u32) = (60, 33);
/// Slow slots between two looks at a temperature; the seven pucks take turns.
const TEMPERATURES: (u32, u32) = (42, 5);
/// Slow slots between two questions to devices that were absent at the start-up; the sensor and the hand take turns.
const ABSENT: (u32, u32) = (30, 9);
/// After this many slots everything repeats: a common multiple of the periods, the seven pucks and the four digits.
const REPEAT: u32 = 42 * 7 * 40;

/// Content of a slow reply.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum PollReply {
    /// MODE of the safety module.
    SafetyMode(i32),
    /// MODE of a puck (0..=6).
    PuckMode(usize, i32),
    /// The pendant word.
    Pendant(i32),
    /// TEMP of a puck (0..=6), degree Celsius.
    Temperature(usize, i32),
    /// STAT of the sensor or of a hand puck, whether it was found at the start-up or not.
    Present(Node, i32),
    /// STAT of a suspected puck.
    Status(Node, i32),
    /// MODE of a hand puck.
    HandMode(Node, i32),
    /// TEMP of a hand puck (0..=3), degree Celsius.
    HandTemperature(usize, i32),
}

/// Whose turn it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BackgroundPoll {
    tick: u32,
    asked: Option<(Node, PropertyId)>,
    pendant: PropertyId,
    /// Questions in a row to the safety module that stayed unanswered.
    safety_silence: u16,
}

impl BackgroundPoll {
    /// The polls of a bus whose safety module has these properties.
    pub(crate) fn new(safety: &SafetyProperties) -> BackgroundPoll {
        BackgroundPoll { tick: REPEAT - 1, asked: None, pendant: safety.pendant, safety_silence: 0 }
    }

    /// Begins a slot. The question to the safety module, if the slot is its own.
    pub(crate) fn begin(&mut self) -> Option<CanFrame> {
        if self.asked.is_some_and(|(node, _)| node == Node::SAFETY_MODULE) {
            self.safety_silence = self.safety_silence.saturating_add(1);
        }
        self.asked = None;
        self.tick = (self.tick + 1) % REPEAT;
        self.tick.is_multiple_of(2).then(|| self.ask(Node::SAFETY_MODULE, PropertyId::MODE))
    }

    /// The question to a puck that fell silent.
    pub(crate) fn suspect(&mut self, node: Node) -> CanFrame {
        self.ask(node, PropertyId::STAT)
    }

    /// The question to puck 1 for its MODE.
    pub(crate) fn first_mode(&mut self) -> CanFrame {
        let [first, ..] = Node::ARM;
        self.ask(first, PropertyId::MODE)
    }

    /// The question whose turn it is, if there is one; `hand`: its pucks may be asked too; `braking`: the puck (0..=6)
    /// that is to be asked if it brakes, out of turn.
    pub(crate) fn other(
        &mut self,
        hand: bool,
        absent: (bool, Option<Node>),
        braking: Option<usize>,
    ) -> Option<CanFrame> {
        let tick = self.tick;
        let due = |(period, offset): (u32, u32)| tick.checked_rem(period) == Some(offset);
        let turn = |period: u32, pucks: usize| (tick.checked_div(period)? as usize).checked_rem(pucks);
        let [first, ..] = Node::ARM;
        let (node, property) = if due(PUCK_MODE) {
            (first, PropertyId::MODE)
        } else if due(EACH_MODE) {
            (*Node::ARM.get(braking.or_else(|| turn(EACH_MODE.0, Node::ARM.len()))?)?, PropertyId::MODE)
        } else if hand && due(HAND_MODE) {
            // Of five places of the raster the first is that of puck 1, four remain for the four digits.
            let digit = (tick % PUCK_MODE.0 / HAND_MODE.0).checked_sub(1)?;
            (*Node::HAND.get(digit as usize)?, PropertyId::MODE)
        } else if due(PENDANT) {
            (Node::SAFETY_MODULE, self.pendant)
        } else if hand && due(HAND_TEMPERATURES) {
            (*Node::HAND.get(turn(HAND_TEMPERATURES.0, Node::HAND.len())?)?, TEMPERATURE)
        } else if due(ABSENT)
            && let Some(node) = match absent {
                (true, Some(digit)) => Some(if turn(ABSENT.0, 2)? == 0 { Node::FORCE_TORQUE } else { digit }),
                (true, None) => Some(Node::FORCE_TORQUE),
                (false, digit) => digit,
            }
        {
            (node, PropertyId::STAT)
        } else if due(TEMPERATURES) {
            (*Node::ARM.get(turn(TEMPERATURES.0, Node::ARM.len())?)?, TEMPERATURE)
        } else {
            return None;
        };
        Some(self.ask(node, property))
    }

    fn ask(&mut self, node: Node, property: PropertyId) -> CanFrame {
        self.asked = Some((node, property));
        get(node, property)
    }

    /// A property reply has come; `None` if it answers no open question.
    pub(crate) fn take(&mut self, node: Node, property: PropertyId, value: i32) -> Option<PollReply> {
        if self.asked != Some((node, property)) {
            return None;
        }
        self.asked = None;
        Some(match property {
            PropertyId::STAT if node.arm_index().is_none() => PollReply::Present(node, value),
            PropertyId::STAT => PollReply::Status(node, value),
            TEMPERATURE if node.hand_index().is_some() => PollReply::HandTemperature(node.hand_index()?, value),
            TEMPERATURE if node != Node::SAFETY_MODULE => PollReply::Temperature(node.arm_index()?, value),
            PropertyId::MODE if node.hand_index().is_some() => PollReply::HandMode(node, value),
            PropertyId::MODE if node != Node::SAFETY_MODULE => PollReply::PuckMode(node.arm_index()?, value),
            PropertyId::MODE => {
                self.safety_silence = 0;
                PollReply::SafetyMode(value)
            }
            _ => {
                self.safety_silence = 0;
                PollReply::Pendant(value)
            }
        })
    }

    /// Questions in a row that the safety module has not answered.
    pub(crate) fn safety_silence(&self) -> u16 {
        self.safety_silence
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use puck::{Property, PropertyTable, Request};

    extern crate std;
    use std::collections::BTreeMap;
    use std::vec::Vec;

    fn polls(seconds: usize, hand: bool) -> BTreeMap<(u8, u8), usize> {
        let safety = SafetyProperties::for_tests();
        let mut poll = BackgroundPoll::new(&safety);
        let mut counts = BTreeMap::new();
        for _ in 0..control::RATE_HZ as usize * seconds {
            if let Some(frame) = poll.begin().or_else(|| poll.other(hand, (false, None), None)) {
                let request = Request::decode(&frame).expect("a request");
                let puck::Destination::Node(node) = request.to else { panic!("a poll to a group") };
                let puck::Action::Get { property } = request.action else { panic!("a poll that sets") };
                *counts.entry((node.number(), property.number())).or_default() += 1;
                poll.take(node, property, 0);
            }
        }
        counts
    }

    #[test]
    fn every_quantity_is_polled_often_enough() {
        let counts = polls(10, true);
        let rate = |node: u8, property: u8| counts.get(&(node, property)).copied().unwrap_or(0) as f64 / 10.0;
        assert!(rate(10, 8) >= 100.0, "safety MODE");
        assert!(rate(1, 8) >= 10.0, "MODE of puck 1");
        for node in 2..=7 {
            assert!(rate(node, 8) >= 1.4, "MODE of puck {node}: {}", rate(node, 8));
        }
        assert!(rate(10, 43) >= 5.0, "PEN");
        for node in 1..=7 {
            assert!(rate(node, 9) >= 1.0, "TEMP of puck {node}: {}", rate(node, 9));
        }
        for node in 11..=14 {
            assert!(rate(node, 8) >= 9.9, "MODE of hand puck {node}: {}", rate(node, 8));
            assert!(rate(node, 9) >= 1.0, "TEMP of hand puck {node}: {}", rate(node, 9));
        }
        assert!(polls(10, false).keys().all(|(node, _)| *node <= 10), "an arm without a hand");
    }

    #[test]
    fn the_number_of_temperature_holds_for_all_supported_firmware() {
        let numbers: Vec<_> = (61..=255)
            .map(|version| PropertyTable::motor(version).expect("known").id(Property::Temp))
            .filter(|id| *id != Some(TEMPERATURE))
            .collect();
        assert!(numbers.is_empty());
    }

    #[test]
    fn a_reply_that_nobody_asked_for_tells_nothing() {
        let mut poll = BackgroundPoll::new(&SafetyProperties::for_tests());
        assert_eq!(poll.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), None);
        poll.begin();
        assert_eq!(poll.take(Node::SAFETY_MODULE, PropertyId::STAT, 2), None);
        assert_eq!(poll.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), Some(PollReply::SafetyMode(2)));
        assert_eq!(poll.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), None, "a duplicate");
    }
}
