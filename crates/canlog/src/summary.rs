//! Summary of a log: frames by kind, load, replies that did not come, and the jitter of the cycle.

use std::collections::BTreeMap;

use puck::{Action, CanFrame, Destination, Group, Node, Property, PropertyId, Reply, Request};
use schemars::JsonSchema;
use serde::Serialize;
use sim::wire::frame_bits;

use crate::candump::{AnyFrame, LogLine};
use crate::decoder::{Decoder, Kind, Meaning};
use crate::names;

/// A reply that has not come this long after its request is lost, us. Waking pucks take up to 50 ms.
const PATIENCE_US: u64 = 50_000;

/// A node that has said nothing for so long is off or asleep and owes no reply, us.
const SILENCE_US: u64 = 500_000;

/// The span over which the highest load is looked for, us.
const WINDOW_US: u64 = 100_000;

/// Bit rate of both buses, bit/us.
const BITS_PER_MICROSECOND: f64 = 1.0;

/// The reply that a request expects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Answer {
    Property(u8),
    Position,
    SecondaryPosition,
    Force,
    Torque,
    Acceleration,
}

/// One node's part.
#[derive(Debug, Clone, Default)]
struct NodeTotals {
    /// Questions that it should have answered.
    asked: u64,
    answered: u64,
    lost: u64,
    /// Replies nobody had asked for, or that came twice.
    unasked: u64,
    delay_sum_us: u64,
    delay_worst_us: u64,
    /// When it last said anything.
    heard_us: Option<u64>,
    /// Open questions: when they were put, and whether a reply is owed.
    pending: BTreeMap<Answer, (u64, bool)>,
}

/// Intervals between the position requests of the control cycle.
#[derive(Debug, Clone, Default)]
struct Cycle {
    last_us: Option<u64>,
    /// Torques have left since: this was no single look of a start-up.
    drives: bool,
    intervals_us: Vec<u32>,
}

/// Adds up the frames of one interface.
#[derive(Debug, Clone, Default)]
pub struct InterfaceTotals {
    first_us: Option<u64>,
    last_us: u64,
    kinds: BTreeMap<Kind, (u64, u64)>,
    unnamed: u64,
    bits: u64,
    window: (u64, u64),
    busiest_bits: u64,
    nodes: BTreeMap<u8, NodeTotals>,
    cycle: Cycle,
}

impl InterfaceTotals {
    /// Takes a frame into account.
    pub fn note(&mut self, line: &LogLine, meaning: &Meaning) {
        let first = *self.first_us.get_or_insert(line.time_us);
        self.last_us = self.last_us.max(line.time_us);
        let bits = u64::from(bits(&line.frame));
        let kind = self.kinds.entry(meaning.kind).or_default();
        *kind = (kind.0 + 1, kind.1 + bits);
        self.unnamed += u64::from(!meaning.is_named());
        self.bits += bits;
        let window = line.time_us.saturating_sub(first) / WINDOW_US;
        if self.window.0 != window {
            self.window = (window, 0);
        }
        self.window.1 += bits;
        self.busiest_bits = self.busiest_bits.max(self.window.1);
        if let (AnyFrame::Data(frame), false) = (&line.frame, meaning.kind == Kind::Link) {
            self.follow(line.time_us, frame, meaning.property);
        }
    }

    /// The clock of the log was set: no cycle is measured over that.
    pub fn leap(&mut self) {
        self.cycle.last_us = None;
    }

    /// Questions and answers. The number of a property depends on the firmware, its `name` does not.
    fn follow(&mut self, now_us: u64, frame: &CanFrame, name: Option<&str>) {
        if frame.can_id().sender() != Node::HOST {
            if let Some((node, answer)) = Reply::decode(frame).ok().and_then(|reply| answer_of(&reply)) {
                self.nodes.entry(node.number()).or_default().answer(now_us, answer);
            }
            return;
        }
        let (to, property) = match Request::decode(frame) {
            Ok(Request { to, action: Action::Get { property }, .. }) => (to, property),
            Ok(Request { to, action: Action::PackedTorques { .. }, .. }) => {
                self.cycle.drives |= to == Destination::Group(Group::ARM_TORQUES);
                return;
            }
            _ => return,
        };
        if to == Destination::Group(Group::ARM) && property == PropertyId::POSITION {
            self.cycle.begin(now_us);
        }
        match to {
            Destination::Node(node) => self.ask(now_us, node, property, name),
            Destination::Group(group) => {
                names::members(group).iter().for_each(|node| self.ask(now_us, *node, property, name));
            }
        }
    }

    fn ask(&mut self, now_us: u64, node: Node, property: PropertyId, name: Option<&str>) {
        let totals = self.nodes.entry(node.number()).or_default();
        for answer in answers_to(node, property, name).into_iter().flatten() {
            totals.ask(now_us, answer);
        }
    }

    /// The summary. `pucks` know the firmware.
    #[must_use]
    pub fn sum(&self, interface: &str, pucks: &Decoder) -> Summary {
        let duration_us = self.last_us - self.first_us.unwrap_or(self.last_us);
        // A frame counts where it ends; the part of it that was before the first time, or before its window, is not
        // worth a share above one.
        let share = |bits: u64, over_us: u64| {
            if over_us == 0 { 0.0 } else { (bits as f64 / BITS_PER_MICROSECOND / over_us as f64).min(1.0) }
        };
        let seconds = duration_us as f64 * 1e-6;
        let kinds = Kind::ALL.into_iter().filter_map(|kind| {
            let (frames, bits) = *self.kinds.get(&kind)?;
            let per_second = if duration_us == 0 { 0.0 } else { frames as f64 / seconds };
            Some(KindSummary { kind, frames, per_second, load: share(bits, duration_us) })
        });
        let nodes = self.nodes.iter().filter_map(|(number, totals)| {
            let node = Node::new(*number)?;
            // Numbers that never answered belong to nobody: an enumeration asks them all.
            (totals.answered + totals.unasked > 0).then(|| NodeSummary {
                name: names::node(node),
                firmware: pucks.puck(node).version(),
                asked: totals.asked,
                answered: totals.answered,
                lost: totals.lost + totals.overdue(self.last_us),
                unasked: totals.unasked,
                delay_mean_us: if totals.answered == 0 {
                    0.0
                } else {
                    totals.delay_sum_us as f64 / totals.answered as f64
                },
                delay_worst_us: totals.delay_worst_us,
            })
        });
        Summary {
            interface: interface.to_owned(),
            seconds,
            frames: self.kinds.values().map(|(frames, _)| frames).sum(),
            unnamed: self.unnamed,
            load: share(self.bits, duration_us),
            load_busiest: share(self.busiest_bits, WINDOW_US.min(duration_us)),
            kinds: kinds.collect(),
            nodes: nodes.collect(),
            cycle: self.cycle.sum(),
        }
    }
}

impl NodeTotals {
    fn ask(&mut self, now_us: u64, answer: Answer) {
        let owed = self.heard_us.is_some_and(|heard| now_us.saturating_sub(heard) < SILENCE_US);
        self.asked += u64::from(owed);
        if let Some((_, true)) = self.pending.insert(answer, (now_us, owed)) {
            self.lost += 1;
        }
    }

    fn answer(&mut self, now_us: u64, answer: Answer) {
        self.heard_us = Some(now_us);
        match self.pending.remove(&answer) {
            Some((asked_us, owed)) => {
                let delay = now_us.saturating_sub(asked_us);
                self.asked += u64::from(!owed);
                self.answered += 1;
                self.delay_sum_us += delay;
                self.delay_worst_us = self.delay_worst_us.max(delay);
            }
            None => self.unasked += 1,
        }
    }

    /// Questions still open at the end that should have been answered long ago.
    fn overdue(&self, end_us: u64) -> u64 {
        let overdue = |(asked, owed): &&(u64, bool)| *owed && end_us.saturating_sub(*asked) > PATIENCE_US;
        self.pending.values().filter(overdue).count() as u64
    }
}

impl Cycle {
    /// A position request; it ends a cycle if torques have left since the one before.
    fn begin(&mut self, now_us: u64) {
        if let (Some(last), true) = (self.last_us, self.drives) {
            self.intervals_us.push(u32::try_from(now_us.saturating_sub(last)).unwrap_or(u32::MAX));
        }
        self.last_us = Some(now_us);
        self.drives = false;
    }

    fn sum(&self) -> Option<CycleSummary> {
        let mut sorted = self.intervals_us.clone();
        sorted.sort_unstable();
        let (shortest, longest) = (*sorted.first()?, *sorted.last()?);
        let count = sorted.len() as f64;
        let mean = sorted.iter().map(|interval| f64::from(*interval)).sum::<f64>() / count;
        let variance = sorted.iter().map(|interval| (f64::from(*interval) - mean).powi(2)).sum::<f64>() / count;
        let at = |fraction: f64| sorted.get(((count - 1.0) * fraction).round() as usize).copied().unwrap_or(longest);
        Some(CycleSummary {
            cycles: sorted.len() as u64,
            mean_us: mean,
            deviation_us: variance.sqrt(),
            shortest_us: shortest,
            p99_us: at(0.99),
            longest_us: longest,
        })
    }
}

/// The replies that a question to one node brings; none of tactile data, see [`answer_of`].
fn answers_to(node: Node, property: PropertyId, name: Option<&str>) -> [Option<Answer>; 2] {
    match (node, property) {
        _ if name == Some(Property::Tact.mnemonic()) => [None; 2],
        _ if name == Some(Property::Jp.mnemonic()) => [Some(Answer::SecondaryPosition), None],
        (Node::FORCE_TORQUE, PropertyId::FORCE_TORQUE) => [Some(Answer::Force), Some(Answer::Torque)],
        (Node::FORCE_TORQUE, PropertyId::ACCELERATION) => [Some(Answer::Acceleration), None],
        (Node::SAFETY_MODULE | Node::FORCE_TORQUE, _) => [Some(Answer::Property(property.number())), None],
        (_, PropertyId::POSITION) => [Some(Answer::Position), None],
        _ => [Some(Answer::Property(property.number())), None],
    }
}

/// Whose answer a reply is, and to what; `None` for what nobody asks for, and for tactile data, which come in several
/// frames.
fn answer_of(reply: &Reply) -> Option<(Node, Answer)> {
    Some(match *reply {
        Reply::Property { node, property, .. } => (node, Answer::Property(property.number())),
        Reply::Position { node, .. } => (node, Answer::Position),
        Reply::SecondaryPosition { node, .. } => (node, Answer::SecondaryPosition),
        Reply::Force { node, .. } => (node, Answer::Force),
        Reply::Torque { node, .. } => (node, Answer::Torque),
        Reply::Acceleration { node, .. } => (node, Answer::Acceleration),
        _ => return None,
    })
}

/// Bits on the wire with the stuff bits a frame really has; frames that do not belong here are counted without.
fn bits(frame: &AnyFrame) -> u32 {
    match frame {
        AnyFrame::Data(frame) => frame_bits(frame),
        AnyFrame::Extended { data, .. } => 67 + 8 * data.len() as u32,
        AnyFrame::Remote { extended, .. } => {
            if *extended {
                67
            } else {
                47
            }
        }
        // Not on the wire as a frame, or not at this rate.
        AnyFrame::Error { .. } | AnyFrame::FlexibleRate { .. } => 0,
    }
}

/// Frames of one kind.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct KindSummary {
    /// The kind.
    pub kind: Kind,
    /// Their number.
    pub frames: u64,
    /// Their rate, 1/s.
    pub per_second: f64,
    /// Their share of the bus' time, 0 to 1.
    pub load: f64,
}

/// Questions to one node and its answers.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct NodeSummary {
    /// Its name.
    pub name: String,
    /// Its firmware, if it has told.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub firmware: Option<i32>,
    /// Replies it owed.
    pub asked: u64,
    /// Replies that came.
    pub answered: u64,
    /// Replies that did not come before the question was put again, or within 50 ms of the end.
    pub lost: u64,
    /// Replies without a question.
    pub unasked: u64,
    /// Mean time from question to reply, us.
    pub delay_mean_us: f64,
    /// Longest time from question to reply, us.
    pub delay_worst_us: u64,
}

/// Regularity of the control cycle, by its position requests.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct CycleSummary {
    /// Their number.
    pub cycles: u64,
    /// Mean period, us.
    pub mean_us: f64,
    /// Standard deviation of the period, us.
    pub deviation_us: f64,
    /// Shortest period, us.
    pub shortest_us: u32,
    /// 99 of 100 periods are not longer, us.
    pub p99_us: u32,
    /// Longest period, us.
    pub longest_us: u32,
}

/// Summary of one interface.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Summary {
    /// Its name.
    pub interface: String,
    /// From its first frame to its last, s.
    pub seconds: f64,
    /// Number of frames.
    pub frames: u64,
    /// Frames that have no name here.
    pub unnamed: u64,
    /// Share of the time the bus was busy, 0 to 1, at 1 Mbit/s.
    pub load: f64,
    /// The same in the busiest tenth of a second.
    pub load_busiest: f64,
    /// By kind.
    pub kinds: Vec<KindSummary>,
    /// By node.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub nodes: Vec<NodeSummary>,
    /// The control cycle, if there was one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cycle: Option<CycleSummary>,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bus_is_never_busier_than_all_the_time_however_short_its_log_is() {
        let mut totals = InterfaceTotals::default();
        let mut decoder = Decoder::default();
        for time_us in [1_000_000, 1_000_050] {
            let frame = puck::get(Group::ARM, PropertyId::POSITION);
            let line = LogLine { time_us, interface: "can0".into(), frame: AnyFrame::Data(frame) };
            totals.note(&line, &decoder.read(&line.frame));
        }
        let sum = totals.sum("can0", &decoder);
        let loads = [sum.load, sum.load_busiest].into_iter().chain(sum.kinds.iter().map(|kind| kind.load));
        assert!(loads.into_iter().all(|load| load > 0.5 && load <= 1.0), "{sum:?}");
    }

    /// Every question for the worm's encoder, or for the tactile cells, was counted as lost although it was answered.
    ///
    /// The change that makes it fail: an answer is looked for among ordinary values and positions alone.
    #[test]
    fn an_answer_in_a_format_of_its_own_is_not_lost() {
        let finger = Node::HAND[0];
        let id = |number| PropertyId::new(number).unwrap();
        let (secondary, tactile) = (id(96), id(106));
        let full = |sequence: u8| {
            let group = puck::CanId::encode(finger, Group::TACTILE_FULL_REPLIES);
            CanFrame::with_payload(group, [sequence << 4, 0, 0, 0, 0, 0, 0, 0])
        };
        let mut frames = vec![puck::device::reply16(finger, PropertyId::STAT, 2)];
        for _ in 0..3 {
            frames.extend([
                puck::get(finger, secondary),
                puck::device::secondary_position_frame(finger, puck::Counts(7)),
            ]);
            frames.push(puck::get(finger, tactile));
            frames.extend((0..5).map(full));
        }
        let (mut totals, mut decoder) = (InterfaceTotals::default(), Decoder::default());
        for (index, frame) in (0_u64..).zip(frames) {
            let frame = AnyFrame::Data(frame);
            let line = LogLine { time_us: 10_000 * index, interface: "can0".into(), frame };
            let meaning = decoder.read(&line.frame);
            assert!(meaning.is_named(), "{meaning:?}");
            totals.note(&line, &meaning);
        }
        let [node] = &totals.sum("can0", &decoder).nodes[..] else { panic!("one node") };
        assert_eq!((node.asked, node.answered, node.lost, node.unasked), (3, 3, 0, 1), "STAT alone was not asked for");
    }
}
