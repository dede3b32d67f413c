//! `HandController`: Eq (14) in fixed point, the law of `control::law::HandController` with its gains.
//!
//! `tau_finger = PD(position) - (P e + K_i integral_{t-Dt}^{t} e dt)`, `e = F_expected - F`, `F` the torque of the
//! environment on the finger, with the same bound of what a finger closes with. The window's sum is exact: integers are
//! added and taken away, nothing drifts.

use control::law::gains::{HAND_COULOMB, HAND_DAMPING, HAND_FORCE, HAND_GRIP, HAND_STIFFNESS, HAND_TOLD, HAND_VISCOUS};

use crate::estimate::HandState;
use crate::number::{Number, ZERO, at_least, at_most, constant, constants, magnitude, share};
use crate::{DIGITS, FINGERS};

const STIFFNESS: [Number; DIGITS] = constants(HAND_STIFFNESS);
const DAMPING: [Number; DIGITS] = constants(HAND_DAMPING);
const VISCOUS: [Number; DIGITS] = constants(HAND_VISCOUS);
const COULOMB: [Number; DIGITS] = constants(HAND_COULOMB);
const FORCE_PROPORTIONAL: Number = constant(HAND_FORCE.0);
/// K_i times the control period.
const FORCE_INTEGRAL: Number = constant(HAND_FORCE.1 * control::PERIOD);
/// Control periods of the window.
const WINDOW: usize = HAND_FORCE.2;

const GRIP: Number = constant(HAND_GRIP);
const TOLD: Number = constant(HAND_TOLD);

/// Desired speed at which half of the Coulomb friction is fed forward (rad/s).
const FRICTION_SPEED: Number = constant(0.05);

/// Desired angles and velocities of the digits at one tick, spread first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandReference {
    /// Desired angles (rad).
    pub q: [Number; DIGITS],
    /// Desired velocities (rad/s).
    pub dq: [Number; DIGITS],
}

impl HandReference {
    /// To stand still at `q`.
    pub fn at_rest(q: [Number; DIGITS]) -> Self {
        HandReference { q, dq: [ZERO; DIGITS] }
    }

    /// The same, kept within the ranges of the digits.
    pub fn kept_in_range(mut self) -> Self {
        for ((q, dq), [low, high]) in self.q.iter_mut().zip(&mut self.dq).zip(crate::RANGE_NUMBERS) {
            let kept = crate::number::at_least(crate::number::at_most(*q, high), low);
            if kept != *q {
                *q = kept;
                *dq = ZERO;
            }
        }
        self
    }
}

/// The errors of the last control periods and their sum.
#[derive(Clone, Copy, Debug)]
struct Window {
    errors: [[Number; FINGERS]; WINDOW],
    next: usize,
    sum: [Number; FINGERS],
}

impl Window {
    const EMPTY: Window = Window { errors: [[ZERO; FINGERS]; WINDOW], next: 0, sum: [ZERO; FINGERS] };

    fn push(&mut self, error: &[Number; FINGERS]) {
        if let Some(slot) = self.errors.get_mut(self.next) {
            for ((sum, error), oldest) in self.sum.iter_mut().zip(error).zip(slot.iter()) {
                *sum = *sum + *error - *oldest;
            }
            *slot = *error;
        }
        self.next = if self.next + 1 >= WINDOW { 0 } else { self.next + 1 };
    }
}

/// Eq (14).
#[derive(Clone, Debug)]
pub struct HandController {
    window: Window,
    /// Torque of the position part at each digit's last reply (N m).
    position: [Number; DIGITS],
}

impl HandController {
    /// A controller without history.
    pub const fn new() -> Self {
        HandController { window: Window::EMPTY, position: [ZERO; DIGITS] }
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        *self = HandController::new();
    }

    /// The torques of one tick (N m, spread first).
    ///
    /// A digit whose reply is missing keeps the position part of its last one. With `expected` gauges (N m) the PI
    /// acts, and no finger closes with more than is asked of it; `frozen` (a torque saturates) keeps its window as it
    /// is, and so do gauges that are not measured.
    pub fn torque(
        &mut self,
        state: &HandState,
        reference: &HandReference,
        expected: Option<&[Number; FINGERS]>,
        frozen: bool,
    ) -> [Number; DIGITS] {
        for digit in 0..DIGITS {
            if state.age[digit] == 0 {
                let rate = reference.dq[digit];
                let friction = share(rate, magnitude(rate) + FRICTION_SPEED);
                self.position[digit] = STIFFNESS[digit] * (reference.q[digit] - state.q[digit])
                    + DAMPING[digit] * (rate - state.dq[digit])
                    + VISCOUS[digit] * rate
                    + COULOMB[digit] * friction;
            }
        }
        let Some(expected) = expected.filter(|_| state.feels()) else {
            return self.position;
        };
        let error: [Number; FINGERS] = core::array::from_fn(|finger| expected[finger] - state.gauges[finger]);
        if !frozen && state.gauge_age == 0 {
            self.window.push(&error);
        }
        let [spread, f1, f2, f3] = self.position;
        let force: [Number; FINGERS] = core::array::from_fn(|finger| {
            FORCE_PROPORTIONAL * error[finger] + FORCE_INTEGRAL * self.window.sum[finger]
        });
        let mut torques = [spread, f1 - force[0], f2 - force[1], f3 - force[2]];
        for (finger, expected) in expected.iter().enumerate() {
            let digit = 1 + finger;
            let asked = if -*expected > TOLD { -*expected } else { GRIP };
            let friction = COULOMB[digit] + VISCOUS[digit] * at_least(state.dq[digit], ZERO);
            torques[digit] = at_most(torques[digit], asked + at_least(-state.gauges[finger], ZERO) + friction);
        }
        torques
    }
}

impl Default for HandController {
    fn default() -> Self {
        HandController::new()
    }
}
