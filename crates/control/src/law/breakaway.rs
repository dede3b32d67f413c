//! `Breakaway`: the torque against friction with which an approach begins, so that a motor turns soon, or its encoder
//! stands still.
//!
//! The spring of Eq (10) builds up slowly where a plan begins slowly. A motor whose encoder stands still then runs
//! away: nothing damps it, and friction that is smaller than the largest thinkable one hides it. Here the torque of
//! every motor that the approach is to turn rises to what no friction holds, in a short time. A sound motor breaks away
//! at its own friction, and what was added fades.

use crate::model::friction::SWING;
use crate::real::{Real, at_least, at_most};
use crate::time::{PERIOD, periods};
use crate::units::JOINTS;

/// Torque to which it rises, in parts of [`SWING`]: beyond what is believed of a sound motor.
const BEYOND: f64 = 1.1;

/// Time in which the torque rises to [`SWING`] times the friction (s). Shorter, and a joint without friction is jerked;
/// longer, and a joint that nobody sees goes farther.
const RISE: f64 = 0.12;

/// Time constant with which it fades once the motor turns (s).
const FADE: f64 = 0.06;

/// Cycles in a row with another count after which a motor turns: one may be a count that flickers.
const TURNS: u8 = 2;

/// Motors of the arm. Those of the wrist are not asked: what breaks their friction turns their light joints by degrees.
const ARM_MOTORS: usize = 4;

/// Way of a motor (rad) below which it is not asked to turn: 7 mrad of J1.
const LEAST_WAY: f64 = 0.3;

/// Time for which it is asked: 0.5 s, in control periods.
const TRIAL: u16 = periods(0.5);

/// The torque with which an approach begins.
#[derive(Clone, Debug)]
pub(crate) struct Breakaway<R: Real> {
    /// Direction of each motor's way, 1 or -1; 0: not asked to turn.
    direction: [R; JOINTS],
    /// Torque against friction when it began (N m at the motor).
    begin: Option<[R; JOINTS]>,
    /// Cycles in a row in which the count of each motor changed; [`TURNS`] of them are not forgotten.
    turned: [u8; JOINTS],
    /// Torque that is added (N m at the motor).
    extra: [R; JOINTS],
    passed: u16,
}

impl<R: Real> Breakaway<R> {
    /// No motor is asked to turn.
    pub(crate) fn none() -> Self {
        let zero = [R::constant(0.0); JOINTS];
        Breakaway { direction: zero, begin: None, turned: [0; JOINTS], extra: zero, passed: 2 * TRIAL }
    }

    /// For motors that are to go these ways (rad).
    pub(crate) fn along(ways: &[R; JOINTS]) -> Self {
        let mut direction = [R::constant(0.0); JOINTS];
        for (direction, way) in direction.iter_mut().zip(ways).take(ARM_MOTORS) {
            let least = R::constant(LEAST_WAY);
            if *way > least {
                *direction = R::constant(1.0);
            } else if *way < -least {
                *direction = R::constant(-1.0);
            }
        }
        Breakaway { direction, passed: 0, ..Breakaway::none() }
    }

    /// True while torque is added, or will be.
    pub(crate) fn is_active(&self) -> bool {
        self.passed < 2 * TRIAL
    }

    /// Motors that have been asked to turn and have not, one bit each, M1 lowest.
    pub(crate) fn due(&self) -> u8 {
        if self.passed >= TRIAL {
            return 0;
        }
        let motors = self.direction.iter().zip(&self.turned).enumerate();
        motors.fold(0, |due, (motor, (direction, turned))| {
            due | u8::from(*direction != R::constant(0.0) && *turned < TURNS) << motor
        })
    }

    /// One control period: takes the torque against friction that acts without it and the largest friction (N m at the
    /// motor), the motors whose count did not change, and those that are not known, one bit each. Returns what is to be
    /// added (N m at the motor).
    #[inline(never)]
    pub(crate) fn step(
        &mut self,
        against: &[R; JOINTS],
        friction: &[R; JOINTS],
        (still, unknown): (u8, u8),
    ) -> &[R; JOINTS] {
        let begin = *self.begin.get_or_insert(*against);
        self.passed = self.passed.saturating_add(1);
        let level = at_most(R::from_counts(i32::from(self.passed)) * R::constant(PERIOD / RISE), R::constant(BEYOND))
            * R::constant(SWING);
        let motors = self.direction.iter().zip(&mut self.turned).zip(&mut self.extra);
        let torques = begin.iter().zip(against).zip(friction);
        for (motor, (((direction, turned), extra), ((begin, against), friction))) in motors.zip(torques).enumerate() {
            if *turned < TURNS && unknown >> motor & 1 == 0 {
                *turned = if still >> motor & 1 == 0 { *turned + 1 } else { 0 };
            }
            if *turned >= TURNS || self.passed >= TRIAL {
                *extra *= R::constant(1.0 - PERIOD / FADE);
            } else {
                let missing = *direction * (*begin - *against) + level * *friction;
                *extra = *direction * at_least(missing, R::constant(0.0));
            }
        }
        &self.extra
    }
}
