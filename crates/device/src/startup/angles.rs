//! `MotorAngles`: the absolute angles of the motors, which tell whether counts still mean what they meant at the zero.

use puck::{Counts, Node, Property, Role};

use super::survey::Survey;
use super::{Next, Startup, Step};
use crate::bus::Outlet;
use crate::stage::StartupError;

/// First firmware of a motor puck whose MECH is an absolute angle.
const VERSION: i32 = 118;

/// Distance by which counts and angle of a motor at rest may part, counts: 0.1 rad of the motor, 2 mrad of J1.
const TOLERANCE: i32 = 64;

/// Largest way of a motor while the angles are read, counts: 2 rad/s of J1. More, and they are read again.
const FASTEST: i32 = 512;

/// Counts and angles. An encoder that tells its angle within a revolution does not forget it; counts that jump part
/// from it, but for a jump by whole revolutions (0.15 rad of J1).
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct MotorAngles {
    /// Counts less angle within a revolution, as they were at the zero.
    at_zero: [Option<u16>; 7],
    /// The same now, where the motor tells an angle, with the counts before that angle was read.
    now: [Option<(u16, Counts)>; 7],
}

impl MotorAngles {
    /// The arm is being zeroed: from here on other counts are right.
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Motor `joint` has told `angle` of `revolution` counts; its counts were `before`.
    fn note(&mut self, joint: usize, angle: i32, revolution: i32, before: Counts) {
        if let Some(place) = self.now.get_mut(joint) {
            *place = part(before.0.wrapping_sub(angle), revolution).map(|part| (part, before));
        }
    }

    /// True if a motor has gone too far meanwhile for its angle to say anything.
    fn has_moved(&self, counts: &[Counts; 7]) -> bool {
        self.now.iter().zip(counts).any(|(now, counts)| now.is_some_and(|(_, before)| way(before, *counts) > FASTEST))
    }

    /// Compares with the zero, or keeps what it is there. True if the counts of a motor have parted from its angle.
    fn have_parted(&mut self, counts: &[Counts; 7], revolutions: [i32; 7]) -> bool {
        let mut parted = false;
        for (((at_zero, now), counts), revolution) in
            self.at_zero.iter_mut().zip(&mut self.now).zip(counts).zip(revolutions)
        {
            let Some((now, before)) = now.take() else { continue };
            let zero = *at_zero.get_or_insert(now);
            // On the way from one reading of the counts to the other the angle was read.
            let apart = part(i32::from(now) - i32::from(zero), revolution).map_or(0, i32::from);
            parted |= apart.min(revolution - apart) > TOLERANCE + way(before, *counts);
        }
        parted
    }
}

/// The way of a motor, counts.
fn way(before: Counts, after: Counts) -> i32 {
    after.unwrapped_near(before).0.wrapping_sub(before.0).saturating_abs()
}

/// The part of `counts` within a revolution; `None` if that is no number of counts.
fn part(counts: i32, revolution: i32) -> Option<u16> {
    u16::try_from(counts.checked_rem_euclid(revolution)?).ok()
}

impl Startup {
    /// Asks the motors for their angles, one after the other, from this one on.
    pub(super) fn read_angle(&mut self, joint: u8, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let index = usize::from(joint);
        let (Some(node), Some(counts)) = (Node::ARM.get(index).copied(), self.positions.get(index).copied().flatten())
        else {
            return Ok(Next::Go(Step::LastPositions { until_us: None }));
        };
        let next = Next::Go(Step::ReadAngle { joint: joint + 1 });
        let Some(property) = self.survey.motor_table(node)?.id(Property::Mech).filter(|_| tells(&self.survey, node))
        else {
            return Ok(next);
        };
        let Some(angle) = self.ask(node, property, outlet)? else {
            return Ok(Next::Stay);
        };
        self.angles.note(index, angle, self.survey.counts_per_revolution(index), counts);
        Ok(next)
    }

    /// The angles have been read between two readings of the counts.
    pub(super) fn compare_angles(&mut self) -> Next {
        let counts = self.positions.map(Option::unwrap_or_default);
        if self.angles.has_moved(&counts) {
            return Next::Go(Step::FirstPositions { until_us: None });
        }
        let revolutions = core::array::from_fn(|joint| self.survey.counts_per_revolution(joint));
        if self.angles.have_parted(&counts, revolutions) {
            self.lose_zero();
        }
        self.doubts_posture(&counts);
        Next::Go(Step::Done)
    }
}

/// True if the angle of this motor is absolute.
fn tells(survey: &Survey, node: Node) -> bool {
    let seen = survey.seen(node);
    let is_absolute = seen.role.is_some_and(Role::has_absolute_angle);
    is_absolute && seen.version.is_some_and(|version| version >= VERSION)
}

#[cfg(test)]
mod tests {
    use super::*;

    const REVOLUTION: i32 = 4096;

    /// True if M1 is said to have parted that stood at 1000 at the zero, and at `before` and `after` now, with the
    /// angles in between.
    fn parts(jump: i32, before: i32, between: i32, after: i32) -> bool {
        let mut angles = MotorAngles::default();
        let mut look = |before: i32, angle: i32, after: i32| {
            angles.note(0, angle.rem_euclid(REVOLUTION), REVOLUTION, Counts(before));
            angles.have_parted(&[Counts(after); 7], [REVOLUTION; 7])
        };
        assert!(!look(1000, 3000, 1000), "the zero itself");
        // The angle is 2000 counts ahead.
        look(before + jump, between + 2000, after + jump)
    }

    #[test]
    fn a_motor_that_turns_does_not_part_from_its_angle_and_one_that_jumps_does() {
        for place in [-200_000, -1, 0, 1000, 4095, 77_777] {
            assert!(!parts(0, place, place, place), "{place}");
            assert!(!parts(0, place, place + 300, place + 300), "{place}");
            assert!(!parts(0, place, place, place - 300), "{place}");
            for jump in [-9000, -70, 70, 2048, 4000, 20_000] {
                assert!(parts(jump, place, place, place), "{place} {jump}");
            }
        }
    }

    #[test]
    fn whole_revolutions_are_not_seen() {
        assert!(!parts(REVOLUTION, 0, 0, 0));
    }

    #[test]
    fn a_motor_that_moves_fast_is_asked_again() {
        let mut angles = MotorAngles::default();
        angles.note(3, 0, REVOLUTION, Counts(1000));
        assert!(!angles.has_moved(&[Counts(1000 + FASTEST); 7]));
        assert!(angles.has_moved(&[Counts(1000 - FASTEST - 1); 7]));
    }

    #[test]
    fn a_revolution_of_no_counts_says_nothing() {
        let mut angles = MotorAngles::default();
        angles.note(0, 5, 0, Counts(1000));
        assert!(!angles.have_parted(&[Counts(0); 7], [0; 7]));
        angles.note(9, 5, REVOLUTION, Counts(1000));
        assert!(!angles.have_parted(&[Counts(0); 7], [REVOLUTION; 7]));
    }
}
