//! `Continuity`: looks at the motors' counts while the bus is started anew, so that a jump of them is noticed.

use control::model;
use puck::{Counts, Group, PropertyId, get};

use crate::bus::Outlet;

/// Between two looks, us: a motor of the wrist at its speed limit turns 0.02 rad of its joint meanwhile.
const PACE_US: u64 = 10_000;

/// The same until the safety module has told IDLE, us: positions that flow are its heartbeat, and it would stay ACTIVE
/// instead of noticing the loss.
const SLOW_PACE_US: u64 = 250_000;

/// Faster than so many times its speed limit no motor turns, not even of an arm that falls.
const FASTEST: f64 = 3.0;

/// Largest change of each motor's counts per millisecond, with the arm's usual encoders.
const COUNTS_PER_MILLISECOND: [i32; 7] = {
    let mut counts = [0; 7];
    let mut motor = 0;
    while motor < counts.len() {
        let mut speed = 0.0;
        let mut joint = 0;
        while joint < counts.len() {
            speed += model::JOINT_TO_MOTOR[motor][joint].abs() * model::VELOCITY_MAX[joint];
            joint += 1;
        }
        counts[motor] = (FASTEST * speed * 4096.0 / core::f64::consts::TAU / 1000.0) as i32 + 1;
        motor += 1;
    }
    counts
};

/// The counts last seen.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Continuity {
    /// Time of the last look, us.
    asked_us: u64,
    /// Counts, and the time of the look that brought them, us.
    seen: [Option<(Counts, u64)>; 7],
}

impl Continuity {
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
        let (Some(seen), Some(fastest)) = (self.seen.get_mut(joint), COUNTS_PER_MILLISECOND.get(joint)) else {
            return false;
        };
        let before = seen.replace((told, self.asked_us));
        before.is_some_and(|(counts, at_us)| {
            let moved = told.unwrapped_near(counts).0.wrapping_sub(counts.0).unsigned_abs();
            // One millisecond more than between the two looks: an answer may come late.
            let milliseconds = (self.asked_us - at_us) / 1000 + 1;
            u64::from(moved) > milliseconds.saturating_mul(fastest.unsigned_abs().into())
        })
    }
}
