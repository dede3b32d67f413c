//! `Continuity`: compares the motors' counts while the bus is started anew, from the last of the cyclic loop on.

use control::model;
use puck::{Counts, Group, PropertyId, get};

use crate::bus::Outlet;

/// Between two looks, us: a motor of the wrist at its speed limit turns 0.02 rad of its joint meanwhile.
const PACE_US: u64 = 10_000;

/// The same until the safety module has told IDLE, us: positions that flow are its heartbeat, and it would stay ACTIVE
/// instead of noticing the loss.
const SLOW_PACE_US: u64 = 250_000;

/// Length of a control cycle, us.
const CYCLE_US: u64 = (control::PERIOD * 1e6) as u64;

/// Faster than so many times its speed limit no motor turns, not even of an arm that falls.
const FASTEST: f64 = 3.0;

/// Further than so many times the way between its stops no joint turns, however long nobody looks.
const FARTHEST: f64 = 1.1;

/// Counts by which each motor turns if every joint turns by so many times `joints` (rad), whichever way, with the usual
/// encoders.
const fn counts_of(joints: [f64; 7], factor: f64) -> [i32; 7] {
    let mut counts = [0; 7];
    let mut motor = 0;
    while motor < counts.len() {
        let mut turned = 0.0;
        let mut joint = 0;
        while joint < counts.len() {
            turned += model::JOINT_TO_MOTOR[motor][joint].abs() * joints[joint];
            joint += 1;
        }
        counts[motor] = (factor * turned * 4096.0 / core::f64::consts::TAU) as i32 + 1;
        motor += 1;
    }
    counts
}

/// Largest change of each motor's counts per millisecond.
const COUNTS_PER_MILLISECOND: [i32; 7] = counts_of(model::VELOCITY_MAX, FASTEST / 1000.0);

/// Largest change of each motor's counts at all.
const LARGEST_CHANGE: [i32; 7] = {
    let mut range = [0.0; 7];
    let mut joint = 0;
    while joint < range.len() {
        range[joint] = model::POSITION_MAX[joint] - model::POSITION_MIN[joint];
        joint += 1;
    }
    counts_of(range, FARTHEST)
};

/// The counts last seen.
#[derive(Clone, Copy, Debug)]
pub(super) struct Continuity {
    /// Time of the last look, us.
    asked_us: u64,
    /// Counts, and the time of the look that brought them, us.
    seen: [Option<(Counts, u64)>; 7],
}

impl Continuity {
    /// Compares with the counts that the cyclic loop knew last, so many cycles ago.
    pub(super) fn since(now_us: u64, last: Option<[(Counts, u8); 7]>) -> Self {
        let at_us = |age: u8| now_us.saturating_sub(u64::from(age) * CYCLE_US);
        let seen = last.map_or([None; 7], |motors| motors.map(|(counts, age)| Some((counts, at_us(age)))));
        Self { asked_us: now_us, seen }
    }

    /// Looks if it is time to; true if the slot is used. `is_idle`: the safety module has told IDLE.
    pub(super) fn look(&mut self, is_idle: bool, outlet: &mut impl Outlet) -> bool {
        let now_us = outlet.now_us();
        let pace_us = if is_idle { PACE_US } else { SLOW_PACE_US };
        let sent = now_us >= self.asked_us + pace_us && outlet.send(get(Group::ARM, PropertyId::POSITION));
        if sent {
            self.asked_us = now_us;
        }
        sent
    }

    /// The start-up has asked for the counts itself.
    pub(super) fn note_asked(&mut self, now_us: u64) {
        self.asked_us = now_us;
    }

    /// A motor has told its counts; true if it cannot have turned so far.
    pub(super) fn has_jumped(&mut self, joint: usize, told: Counts) -> bool {
        let (Some(seen), Some(&fastest), Some(&largest)) =
            (self.seen.get_mut(joint), COUNTS_PER_MILLISECOND.get(joint), LARGEST_CHANGE.get(joint))
        else {
            return false;
        };
        let before = seen.replace((told, self.asked_us));
        before.is_some_and(|(counts, at_us)| {
            let moved = told.unwrapped_near(counts).0.wrapping_sub(counts.0).unsigned_abs();
            // One millisecond more than between the two looks: an answer may come late.
            let milliseconds = self.asked_us.saturating_sub(at_us) / 1000 + 1;
            let reach = milliseconds.saturating_mul(fastest.unsigned_abs().into());
            u64::from(moved) > reach.min(largest.unsigned_abs().into())
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const START: [(Counts, u8); 7] = [(Counts(1000), 3); 7];

    /// True if M1 is said to have jumped by `counts` after `milliseconds` without a look.
    fn jumps(counts: i32, milliseconds: u64) -> bool {
        let mut continuity = Continuity::since(1_000_000, Some(START));
        continuity.note_asked(1_000_000 + 1000 * milliseconds);
        continuity.has_jumped(0, Counts(1000 + counts))
    }

    #[test]
    fn what_the_arm_can_do_is_no_jump_and_what_it_cannot_is_one() {
        // At its speed limit for as long as nobody looked, the three cycles before included.
        let limit = |milliseconds: u64| (milliseconds as i32 + 10) * COUNTS_PER_MILLISECOND[0] / 3;
        for milliseconds in [0, 10, 100, 500] {
            assert!(!jumps(limit(milliseconds), milliseconds), "{milliseconds} ms");
            assert!(jumps(4 * limit(milliseconds), milliseconds), "{milliseconds} ms");
        }
    }

    #[test]
    fn further_than_from_stop_to_stop_is_a_jump_however_long_nobody_looked() {
        assert!(!jumps(LARGEST_CHANGE[0], 3_600_000));
        assert!(jumps(LARGEST_CHANGE[0] + 1, 3_600_000));
    }
}
