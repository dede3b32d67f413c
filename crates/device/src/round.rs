//! One round of requests and replies per control cycle, each reply in the slot of its sender.
//!
//! A frame carries no cycle number, so the round itself is the tag: slots are emptied before the requests leave, and
//! what comes while no round is open belongs to a cycle that is over. A queue per identifier, as in Barrett's library,
//! would answer each request with the reply to the one before, for ever.

use puck::{CanFrame, Counts, GaugeStatus, Group, Node, PropertyId, RawWrench, Reply, force_torque, get};

use crate::health::Counters;
use crate::mailbox::Mailbox;

/// Rounds in a row without a reply after which a puck is suspected to have reset: it must be found
/// within 20 ms, and the slow slot takes up to 10 of them.
const SUSPECT_ROUNDS: u16 = 2;

/// Half of a wrench sample.
type WrenchHalf = ([i16; 3], Option<GaugeStatus>);

/// Replies of one round.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Gathered {
    pub(crate) positions: [Option<Counts>; 7],
    pub(crate) wrench: Option<RawWrench>,
}

/// The round of the present cycle.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Round {
    open: bool,
    has_sensor: bool,
    discard_wrench: bool,
    positions: [Mailbox<Counts>; 7],
    force: Mailbox<WrenchHalf>,
    torque: Mailbox<WrenchHalf>,
    missed: [u16; 7],
}

impl Round {
    /// The rounds of an arm with or without a force/torque sensor, which has just been tared: its first sample is void.
    pub(crate) fn new(has_sensor: bool) -> Round {
        Round { has_sensor, discard_wrench: true, ..Round::default() }
    }

    /// Empties the slots and opens the round. Returns what to ask.
    pub(crate) fn open(&mut self) -> (CanFrame, Option<CanFrame>) {
        self.positions = [Mailbox::Empty; 7];
        self.force = Mailbox::Empty;
        self.torque = Mailbox::Empty;
        self.open = true;
        (get(Group::ARM, PropertyId::POSITION), self.has_sensor.then(force_torque::get_wrench))
    }

    /// True if requests have left and no cycle has taken the replies.
    pub(crate) fn is_open(&self) -> bool {
        self.open
    }

    /// A reply has come in. False if it belongs to no round: somebody else must look at it.
    pub(crate) fn take(&mut self, reply: &Reply, counters: &mut Counters) -> bool {
        let repeats = match *reply {
            Reply::Position { node, primary, .. } => {
                let Some(slot) = node.arm_index().and_then(|joint| self.positions.get_mut(joint)) else {
                    return false;
                };
                self.open && slot.put(primary)
            }
            Reply::Force { node: Node::FORCE_TORQUE, counts, status } => self.open && self.force.put((counts, status)),
            Reply::Torque { node: Node::FORCE_TORQUE, counts, status } => {
                self.open && self.torque.put((counts, status))
            }
            _ => return false,
        };
        if repeats || !self.open {
            Counters::count(&mut counters.late_replies);
        }
        true
    }

    /// Closes the round and hands over what it brought.
    pub(crate) fn close(&mut self, counters: &mut Counters) -> Gathered {
        self.open = false;
        let positions = self.positions.map(|mailbox| mailbox.reply());
        for (position, missed) in positions.iter().zip(&mut self.missed) {
            if position.is_some() {
                *missed = 0;
            } else {
                *missed = missed.saturating_add(1);
                Counters::count(&mut counters.lost_replies);
            }
        }
        Gathered { positions, wrench: self.wrench(counters) }
    }

    /// Both halves of one sample, or nothing: force of one sample and torque of another are no wrench. One that the
    /// sensor itself calls bad is handed on: its gauges may say that something presses.
    fn wrench(&mut self, counters: &mut Counters) -> Option<RawWrench> {
        let (Some((force, _)), Some((torque, status))) = (self.force.reply(), self.torque.reply()) else {
            if self.has_sensor {
                Counters::count(&mut counters.lost_replies);
            }
            return None;
        };
        if core::mem::take(&mut self.discard_wrench) {
            return None;
        }
        Some(RawWrench { force, torque, status })
    }

    /// The first puck that has been silent long enough to be suspected.
    pub(crate) fn suspect(&self) -> Option<Node> {
        let (node, _) = Node::ARM.into_iter().zip(self.missed).find(|(_, missed)| *missed >= SUSPECT_ROUNDS)?;
        Some(node)
    }

    /// Rounds that the most silent puck has missed in a row.
    pub(crate) fn longest_silence(&self) -> u16 {
        self.missed.into_iter().max().unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn position(joint: usize, counts: i32) -> Reply {
        Reply::Position { node: Node::ARM[joint], primary: Counts(counts), secondary: None }
    }

    #[test]
    fn a_reply_between_two_rounds_belongs_to_neither() {
        let (mut round, mut counters) = (Round::new(false), Counters::default());
        round.open();
        round.close(&mut counters);
        assert!(round.take(&position(0, 1), &mut counters));
        round.open();
        assert_eq!(round.close(&mut counters).positions, [None; 7]);
        assert_eq!((counters.late_replies, counters.lost_replies), (1, 14));
    }

    #[test]
    fn two_different_replies_in_a_round_are_both_discarded_and_two_equal_ones_are_one() {
        let (mut round, mut counters) = (Round::new(false), Counters::default());
        round.open();
        for (joint, counts) in [(0, 7), (0, 8), (0, 8), (1, 5), (1, 5), (2, 3)] {
            round.take(&position(joint, counts), &mut counters);
        }
        let positions = round.close(&mut counters).positions;
        assert_eq!(positions[..3], [None, Some(Counts(5)), Some(Counts(3))]);
        assert_eq!(counters.late_replies, 3);
        round.open();
        round.take(&position(0, 9), &mut counters);
        assert_eq!(round.close(&mut counters).positions[0], Some(Counts(9)), "the next round begins empty");
    }

    #[test]
    fn force_of_one_sample_and_torque_of_another_are_no_wrench() {
        let (mut round, mut counters) = (Round::new(true), Counters::default());
        let force = |x| Reply::Force { node: Node::FORCE_TORQUE, counts: [x, 0, 0], status: None };
        let torque = |x| Reply::Torque { node: Node::FORCE_TORQUE, counts: [x, 0, 0], status: None };
        let mut round_of = |replies: &[Reply]| {
            round.open();
            for reply in replies {
                round.take(reply, &mut counters);
            }
            round.close(&mut counters).wrench
        };
        assert_eq!(round_of(&[force(1), torque(1)]), None, "the first sample after the tare");
        let wrench = RawWrench { force: [2, 0, 0], torque: [3, 0, 0], status: None };
        assert_eq!(round_of(&[force(2), torque(3)]), Some(wrench));
        assert_eq!(round_of(&[force(2)]), None);
        assert_eq!(round_of(&[torque(3)]), None, "the force of the round before is gone");
        assert_eq!(round_of(&[force(2), torque(3), torque(4)]), None);
        let judged =
            |status| Reply::Torque { node: Node::FORCE_TORQUE, counts: [3, 0, 0], status: Some(GaugeStatus(status)) };
        for status in [0x40, 0x81] {
            let handed_on = round_of(&[force(2), judged(status)]).and_then(|wrench| wrench.status);
            assert_eq!(handed_on, Some(GaugeStatus(status)), "judged by the controller, not here");
        }
    }

    #[test]
    fn a_puck_is_suspected_after_two_silent_rounds() {
        let (mut round, mut counters) = (Round::new(false), Counters::default());
        let mut turn = |round: &mut Round, joints: core::ops::Range<usize>| {
            round.open();
            for joint in joints {
                round.take(&position(joint, 0), &mut counters);
            }
            round.close(&mut counters);
        };
        turn(&mut round, 0..6);
        assert_eq!(round.suspect(), None);
        turn(&mut round, 0..6);
        assert_eq!((round.suspect(), round.longest_silence()), (Some(Node::ARM[6]), 2));
        turn(&mut round, 0..7);
        assert_eq!((round.suspect(), round.longest_silence()), (None, 0));
    }

    #[test]
    fn a_round_asks_the_sensor_only_where_there_is_one_and_is_open_until_it_is_closed() {
        for has_sensor in [true, false] {
            let mut round = Round::new(has_sensor);
            assert!(!round.is_open());
            let sensor = has_sensor.then(force_torque::get_wrench);
            assert_eq!(round.open(), (get(Group::ARM, PropertyId::POSITION), sensor));
            assert!(round.is_open());
            round.close(&mut Counters::default());
            assert!(!round.is_open());
        }
    }

    #[test]
    fn a_reply_of_another_kind_or_node_belongs_to_no_round() {
        let (mut round, mut counters) = (Round::new(true), Counters::default());
        round.open();
        let finger = Reply::Position { node: Node::FINGERS[0], primary: Counts(1), secondary: None };
        let force = Reply::Force { node: Node::FINGERS[0], counts: [1, 0, 0], status: None };
        let torque = Reply::Torque { node: Node::FINGERS[0], counts: [1, 0, 0], status: None };
        for reply in [finger, force, torque] {
            assert!(!round.take(&reply, &mut counters), "{reply:?}");
        }
        assert_eq!(counters.late_replies, 0);
    }
}
