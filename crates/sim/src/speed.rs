//! Speed of the arm as the safety module estimates it from the position replies on the bus.
//!
//! Zeroed arm: the larger Cartesian speed of the elbow (0.55 m up the upper arm) and of a point 0.35 m beyond it; the
//! wrist is not counted. Arm not zeroed: the largest joint velocity of joints 1..4 (compared with the same limit, read
//! as rad/s: assumed). The speed spans the last five full sets, the history that the library reckons with when it asks
//! for five faults to be ignored. A pause between two sets counts as at most 10 ms: that reproduces the documented trap
//! that an arm moved by hand while nobody polls faults at the first poll (docs/barrett-can.md).

use crate::chain::{self, Vector, add, subtract};
use crate::rotation::norm;
use crate::time::{TICKS_PER_MILLISECOND, Ticks, seconds};
use puck::{Counts, Drives, Node, Transmission};
use std::collections::VecDeque;

/// Full sets that the speed spans.
const HISTORY: usize = 5;

/// Longest pause that counts between two sets.
const LONGEST_PAUSE: Ticks = 10 * TICKS_PER_MILLISECOND;

/// The second supervised point, m beyond the elbow along the forearm.
const BEYOND_ELBOW: f64 = 0.35;

/// One full set of positions.
#[derive(Clone, Copy, Debug)]
struct Sample {
    /// Time in which pauses are shortened, ticks.
    reckoned: Ticks,
    q: [f64; 7],
    /// Elbow and the point beyond it, m.
    points: [Vector; 2],
}

/// The monitor.
#[derive(Clone, Debug)]
pub(crate) struct SpeedMonitor {
    transmission: Transmission<f64>,
    drives: Drives,
    arriving: [Option<Counts>; 7],
    history: VecDeque<Sample>,
    last_complete: Ticks,
    latest: Option<f64>,
}

impl SpeedMonitor {
    /// A monitor for an arm with this transmission and these encoders.
    pub(crate) fn new(transmission: Transmission<f64>, drives: Drives) -> Self {
        Self { transmission, drives, arriving: [None; 7], history: VecDeque::new(), last_complete: 0, latest: None }
    }

    /// Takes one position reply; `true` if it completes a full set and the speed was judged anew.
    pub(crate) fn hear(&mut self, at: Ticks, node: Node, counts: Counts, is_zeroed: bool) -> bool {
        let Some(motor) = node.arm_index() else {
            return false;
        };
        if self.arriving[motor].is_some() {
            // A second reply of the same puck: a new round has begun and the old one was incomplete.
            self.arriving = [None; 7];
        }
        self.arriving[motor] = Some(counts);
        let [Some(a), Some(b), Some(c), Some(d), Some(e), Some(f), Some(g)] = self.arriving else {
            return false;
        };
        self.arriving = [None; 7];
        let motors = self.drives.motor_angles(&[a, b, c, d, e, f, g]);
        self.judge(at, self.transmission.joint_from_motor(&motors), is_zeroed);
        true
    }

    /// m/s (zeroed) or rad/s (not zeroed); `None` before two full sets.
    pub(crate) fn latest(&self) -> Option<f64> {
        self.latest
    }

    /// The speed just judged was to be ignored.
    pub(crate) fn forgive(&mut self) {
        self.latest = None;
    }

    /// Forgets everything: the pucks have lost their power.
    pub(crate) fn clear(&mut self) {
        self.arriving = [None; 7];
        self.history.clear();
        self.latest = None;
    }

    fn judge(&mut self, at: Ticks, q: [f64; 7], is_zeroed: bool) {
        let pause = (at - self.last_complete).min(LONGEST_PAUSE);
        let reckoned = self.history.back().map_or(0, |sample| sample.reckoned + pause);
        self.last_complete = at;
        self.history.push_back(Sample { reckoned, q, points: supervised_points(&q) });
        if self.history.len() > HISTORY {
            self.history.pop_front();
        }
        let (Some(first), Some(last)) = (self.history.front(), self.history.back()) else {
            return;
        };
        let elapsed = seconds(last.reckoned - first.reckoned);
        if elapsed > 0.0 {
            let moved =
                if is_zeroed { tip_travel(&first.points, &last.points) } else { joint_travel(&first.q, &last.q) };
            self.latest = Some(moved / elapsed);
        }
    }
}

/// The farther of the two supervised points' straight ways, m.
fn tip_travel(from: &[Vector; 2], to: &[Vector; 2]) -> f64 {
    from.iter().zip(to).map(|(a, b)| norm(subtract(*b, *a))).fold(0.0, f64::max)
}

/// The largest turn of joints 1..4, rad.
fn joint_travel(from: &[f64; 7], to: &[f64; 7]) -> f64 {
    from.iter().zip(to).take(4).map(|(a, b)| (b - a).abs()).fold(0.0, f64::max)
}

/// Elbow and the point beyond it, m.
fn supervised_points(q: &[f64; 7]) -> [Vector; 2] {
    let frames = chain::frames(q);
    let [_, _, _, elbow, forearm, ..] = frames;
    let along = forearm.axes[2].map(|component| component * BEYOND_ELBOW);
    [elbow.origin, add(forearm.origin, along)]
}
