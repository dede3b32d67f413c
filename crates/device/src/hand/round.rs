//! The hand's part of a bus round: positions and strain gauges, asked after the torques, for the cycle that follows.

use control::HandSample;
use puck::{CanFrame, Counts, Group, Node, PropertyId, get};

use crate::health::Counters;
use crate::mailbox::Mailbox;

/// Rounds in a row without a position after which a puck is suspected to have reset.
const SUSPECT_ROUNDS: u16 = 2;

/// Readings of a strain gauge that tell a torque. At an end of its 12 bits, 0 and 4095, it is saturated or its cable is
/// off: 2.8 N m, more than a finger's drive can press.
const GAUGE_RANGE: core::ops::RangeInclusive<i32> = 1..=4094;

/// The replies of one round, each in the slot of its sender.
#[derive(Clone, Copy, Debug, Default)]
pub struct HandRound {
    open: bool,
    positions: [Mailbox<(Counts, Option<Counts>)>; 4],
    gauges: [Mailbox<i32>; 3],
    missed: [u16; 4],
}

impl HandRound {
    /// Empties the slots and opens the round. Returns what to ask.
    pub fn open(&mut self, gauge: PropertyId) -> [CanFrame; 2] {
        self.positions = [Mailbox::Empty; 4];
        self.gauges = [Mailbox::Empty; 3];
        self.open = true;
        [get(Group::HAND, PropertyId::POSITION), get(Group::HAND, gauge)]
    }

    /// The position of a digit has come.
    pub fn take_position(&mut self, digit: usize, primary: Counts, secondary: Option<Counts>, counters: &mut Counters) {
        let repeats = self.open && self.positions.get_mut(digit).is_some_and(|slot| slot.put((primary, secondary)));
        if repeats || !self.open {
            Counters::count(&mut counters.late_replies);
        }
    }

    /// The strain gauge of a digit has come. The spread has none; its puck answers the group's question all the same.
    pub fn take_gauge(&mut self, digit: usize, value: i32, counters: &mut Counters) {
        let repeats = self.open && self.gauges.get_mut(digit).is_some_and(|slot| slot.put(value));
        if repeats || !self.open {
            Counters::count(&mut counters.late_replies);
        }
    }

    /// Closes the round and hands over what it brought; `None` if no round was open.
    pub fn close(&mut self, counters: &mut Counters) -> Option<HandSample> {
        if !core::mem::take(&mut self.open) {
            return None;
        }
        let positions = self.positions.map(|mailbox| mailbox.reply());
        for (position, missed) in positions.iter().zip(&mut self.missed) {
            *missed = if position.is_some() { 0 } else { missed.saturating_add(1) };
        }
        let gauges = self.gauges.map(|mailbox| {
            mailbox.reply().filter(|value| GAUGE_RANGE.contains(value)).and_then(|value| u16::try_from(value).ok())
        });
        let lost = positions.iter().filter(|position| position.is_none()).count()
            + gauges.iter().filter(|gauge| gauge.is_none()).count();
        for _ in 0..lost {
            Counters::count(&mut counters.hand_lost_replies);
        }
        let [f1, f2, f3, _] = positions.map(|position| position.and_then(|(_, secondary)| secondary));
        Some(HandSample {
            primary: positions.map(|position| position.map(|(primary, _)| primary)),
            secondary: [f1, f2, f3],
            gauges,
        })
    }

    /// The first puck that has been silent long enough to be suspected.
    pub fn suspect(&self) -> Option<Node> {
        let (node, _) = Node::HAND.into_iter().zip(self.missed).find(|(_, missed)| *missed >= SUSPECT_ROUNDS)?;
        Some(node)
    }

    /// The puck that has been silent for at least so many rounds.
    pub fn silent_for(&self, rounds: u16) -> Option<Node> {
        let (node, _) = Node::HAND.into_iter().zip(self.missed).find(|(_, missed)| *missed >= rounds)?;
        Some(node)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gauge() -> PropertyId {
        PropertyId::new(25).expect("a property")
    }

    #[test]
    fn a_whole_round_becomes_a_sample() {
        let (mut round, mut counters) = (HandRound::default(), Counters::default());
        round.open(gauge());
        for digit in 0..3 {
            round.take_position(digit, Counts(125), Some(Counts(50)), &mut counters);
            round.take_gauge(digit, 2000, &mut counters);
        }
        round.take_position(3, Counts(-7), None, &mut counters);
        round.take_gauge(3, 17, &mut counters);
        let sample = round.close(&mut counters).expect("a sample");
        assert_eq!(sample.primary, [Some(Counts(125)), Some(Counts(125)), Some(Counts(125)), Some(Counts(-7))]);
        assert_eq!((sample.secondary, sample.gauges), ([Some(Counts(50)); 3], [Some(2000); 3]));
        assert_eq!((counters.hand_lost_replies, counters.late_replies), (0, 0));
        assert_eq!(round.close(&mut counters), None, "one round, one sample");
    }

    #[test]
    fn late_contradicting_and_impossible_replies_are_missing_for_their_digit_alone() {
        let (mut round, mut counters) = (HandRound::default(), Counters::default());
        round.take_position(0, Counts(1), None, &mut counters);
        assert_eq!(counters.late_replies, 1, "nobody had asked");
        round.open(gauge());
        for (digit, counts) in [(0, 5), (0, 6), (1, 7), (1, 7), (2, 8)] {
            round.take_position(digit, Counts(counts), Some(Counts(counts)), &mut counters);
        }
        for (digit, value) in [(0, 0), (1, 4095), (2, 4094)] {
            round.take_gauge(digit, value, &mut counters);
        }
        let sample = round.close(&mut counters).expect("a sample");
        assert_eq!(sample.primary, [None, Some(Counts(7)), Some(Counts(8)), None]);
        assert_eq!(sample.secondary, [None, Some(Counts(7)), Some(Counts(8))]);
        assert_eq!(sample.gauges, [None, None, Some(4094)]);
        assert_eq!((counters.hand_lost_replies, counters.late_replies), (4, 3));
        round.open(gauge());
        for (digit, value) in [(0, -1), (1, 4096), (2, 1)] {
            round.take_gauge(digit, value, &mut counters);
        }
        assert_eq!(round.close(&mut counters).map(|sample| sample.gauges), Some([None, None, Some(1)]));
    }

    #[test]
    fn a_puck_is_suspected_after_two_silent_rounds() {
        let (mut round, mut counters) = (HandRound::default(), Counters::default());
        for expected in [None, Some(Node::SPREAD)] {
            round.open(gauge());
            for digit in 0..3 {
                round.take_position(digit, Counts(0), None, &mut counters);
            }
            round.close(&mut counters);
            assert_eq!(round.suspect(), expected);
        }
        assert_eq!((round.silent_for(2), round.silent_for(3)), (Some(Node::SPREAD), None));
    }
}
