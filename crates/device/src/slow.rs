//! The slow slot: one question per cycle about things that change slowly, in turn.
//!
//! | what | how often | why |
//! |---|---|---|
//! | MODE of the safety module | 150 Hz | torque must end within 3 cycles of IDLE or E-STOP |
//! | STAT of a puck that fell silent | 150 Hz, while it is silent | a puck that has reset must be found within 20 ms |
//! | MODE of puck 1 | 10 Hz | braking pucks under an ACTIVE safety module mean that IDLE was pressed |
//! | PEN | 5 Hz | lights and warnings for a person |
//! | TEMP | 1 Hz for each puck | heat |

use puck::{CanFrame, Node, PropertyId, get};

use crate::startup::SafetyProperties;

/// The property TEMP of every motor firmware from VERS 61.
const TEMPERATURE: PropertyId = match PropertyId::new(9) {
    Some(id) => id,
    None => unreachable!(),
};

/// Slow slots between two looks at MODE of puck 1. All four spacings are odd offsets of even periods, so that no two
/// questions fall into one slot and the even slots stay with the safety module.
const PUCK_MODE: (u32, u32) = (30, 1);
/// Slow slots between two looks at the pendant.
const PENDANT: (u32, u32) = (60, 3);
/// Slow slots between two looks at a temperature; the seven pucks take turns.
const TEMPERATURES: (u32, u32) = (42, 5);
/// After this many slots everything repeats: the least common multiple of the periods and the seven pucks.
const REPEAT: u32 = 42 * 7 * 10;

/// What a slow reply told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Told {
    /// MODE of the safety module.
    SafetyMode(i32),
    /// MODE of puck 1.
    PuckMode(i32),
    /// The pendant word.
    Pendant(i32),
    /// TEMP of a puck (0..=6), degree Celsius.
    Temperature(usize, i32),
    /// STAT of a suspected puck.
    Status(Node, i32),
}

/// Whose turn it is.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SlowPoll {
    tick: u32,
    asked: Option<(Node, PropertyId)>,
    pendant: PropertyId,
    /// Questions in a row to the safety module that stayed unanswered.
    safety_silence: u16,
}

impl SlowPoll {
    /// The polls of a bus whose safety module has these properties.
    pub(crate) fn new(safety: &SafetyProperties) -> SlowPoll {
        SlowPoll { tick: 0, asked: None, pendant: safety.pendant, safety_silence: 0 }
    }

    /// The question of this slot, if there is one.
    pub(crate) fn next(&mut self, suspect: Option<Node>) -> Option<CanFrame> {
        if self.asked.is_some_and(|(node, _)| node == Node::SAFETY_MODULE) {
            self.safety_silence = self.safety_silence.saturating_add(1);
        }
        let tick = self.tick;
        self.tick = (tick + 1) % REPEAT;
        let due = |(period, offset): (u32, u32)| tick % period == offset;
        let [first, ..] = Node::ARM;
        self.asked = if tick.is_multiple_of(2) {
            Some((Node::SAFETY_MODULE, PropertyId::MODE))
        } else if let Some(node) = suspect {
            Some((node, PropertyId::STAT))
        } else if due(PUCK_MODE) {
            Some((first, PropertyId::MODE))
        } else if due(PENDANT) {
            Some((Node::SAFETY_MODULE, self.pendant))
        } else if due(TEMPERATURES) {
            let turn = (tick / TEMPERATURES.0) as usize % Node::ARM.len();
            Node::ARM.get(turn).map(|node| (*node, TEMPERATURE))
        } else {
            None
        };
        self.asked.map(|(node, property)| get(node, property))
    }

    /// A property reply has come; `None` if it answers no open question.
    pub(crate) fn take(&mut self, node: Node, property: PropertyId, value: i32) -> Option<Told> {
        if self.asked != Some((node, property)) {
            return None;
        }
        self.asked = None;
        Some(match property {
            PropertyId::STAT => Told::Status(node, value),
            TEMPERATURE if node != Node::SAFETY_MODULE => Told::Temperature(node.arm_index()?, value),
            PropertyId::MODE if node != Node::SAFETY_MODULE => Told::PuckMode(value),
            PropertyId::MODE => {
                self.safety_silence = 0;
                Told::SafetyMode(value)
            }
            _ => {
                self.safety_silence = 0;
                Told::Pendant(value)
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

    fn polls(seconds: usize) -> BTreeMap<(u8, u8), usize> {
        let safety = SafetyProperties::for_tests();
        let mut slow = SlowPoll::new(&safety);
        let mut counts = BTreeMap::new();
        for _ in 0..300 * seconds {
            if let Some(frame) = slow.next(None) {
                let request = Request::decode(&frame).expect("a request");
                let puck::Destination::Node(node) = request.to else { panic!("a poll to a group") };
                let puck::Action::Get { property } = request.action else { panic!("a poll that sets") };
                *counts.entry((node.number(), property.number())).or_default() += 1;
                slow.take(node, property, 0);
            }
        }
        counts
    }

    #[test]
    fn every_quantity_is_polled_often_enough() {
        let counts = polls(10);
        let rate = |node: u8, property: u8| counts.get(&(node, property)).copied().unwrap_or(0) as f64 / 10.0;
        assert!(rate(10, 8) >= 100.0, "safety MODE");
        assert!(rate(1, 8) >= 10.0, "MODE of puck 1");
        assert!(rate(10, 43) >= 5.0, "PEN");
        for node in 1..=7 {
            assert!(rate(node, 9) >= 1.0, "TEMP of puck {node}: {}", rate(node, 9));
        }
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
        let mut slow = SlowPoll::new(&SafetyProperties::for_tests());
        assert_eq!(slow.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), None);
        slow.next(None);
        assert_eq!(slow.take(Node::SAFETY_MODULE, PropertyId::STAT, 2), None);
        assert_eq!(slow.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), Some(Told::SafetyMode(2)));
        assert_eq!(slow.take(Node::SAFETY_MODULE, PropertyId::MODE, 2), None, "a duplicate");
    }
}
