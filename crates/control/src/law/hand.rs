//! `HandController`: position and force of the digits.
//!
//! Eq (14): `tau_finger = PD(position) + PI(force)`, the force from the finger's strain gauge, with the sign of Eq
//! (12):
//! `PI = -(P e + K_i integral_{t-Dt}^{t} e dt)`, `e = F_expected - F`, `F` the torque of the environment on the finger,
//! negative when closing on an object. A finger that presses harder than expected (`F < F_expected`) is driven open,
//! one that misses what it should press on is driven shut. The spread is controlled in position alone.
//!
//! A gauge feels the outer link only. So the sum is bounded on the closing side, by what moves the finger, what is
//! [asked] of it, and what its gauge feels: an inner link that closes on something presses with what is asked,
//! and not with all that drive and clutch can give.

use nalgebra::SVector;
use pinned_init::{Init, init};

use crate::law::gains::{HAND_GRIP, HAND_TOLD, HandGains};
use crate::law::window::Window;
use crate::model::hand::{DIGITS, FINGERS};
use crate::plan::reference::HandReference;
use crate::real::{Real, at_least, at_most};
use crate::sense::hand::HandState;
use crate::time::{PERIOD, periods};

/// Desired speed at which half of the Coulomb friction is fed forward (rad/s).
const FRICTION_SPEED: f64 = 0.05;

/// Longest window: 0.2 s, in control periods.
pub const WINDOW_CAPACITY: usize = periods(0.2) as usize;

/// The torque with which a finger shall press (N m): what its gauge is expected to feel, or where that is next to
/// nothing, the grip of a plan that tells none.
pub fn asked<R: Real>(expected: R) -> R {
    if -expected > R::constant(HAND_TOLD) { -expected } else { R::constant(HAND_GRIP) }
}

/// Eq (14).
#[derive(Clone, Debug)]
pub struct HandController<R: Real> {
    window: Window<R, FINGERS, WINDOW_CAPACITY>,
    /// Torque of the position part at each digit's last reply (N m).
    feedback: [R; DIGITS],
}

impl<R: Real> HandController<R> {
    /// Makes a controller without history in its place.
    pub fn init(gains: &HandGains<R>) -> impl Init<Self> + use<R> {
        let length = gains.force_window;
        init!(HandController { window <- Window::init(length), feedback: [R::constant(0.0); DIGITS] })
    }

    /// Forgets everything.
    pub fn reset(&mut self) {
        self.window.reset();
        self.feedback = [R::constant(0.0); DIGITS];
    }

    /// The torques of one tick (N m, spread first).
    ///
    /// A digit whose reply is missing keeps the position feedback of its last one. With `expected` gauges (N m) the PI
    /// acts, and no finger closes with more than is asked of it;
    /// `frozen` (a torque saturates) keeps its window as it is, and so do gauges that are not measured.
    pub fn torque(
        &mut self,
        gains: &HandGains<R>,
        state: &HandState<R>,
        reference: &HandReference<R>,
        expected: Option<&[R; FINGERS]>,
        frozen: bool,
    ) -> [R; DIGITS] {
        for digit in 0..DIGITS {
            if state.age[digit] == 0 {
                let rate = reference.dq[digit];
                let magnitude = if rate < R::constant(0.0) { -rate } else { rate };
                self.feedback[digit] = gains.stiffness[digit] * (reference.q[digit] - state.q[digit])
                    + gains.damping[digit] * (reference.dq[digit] - state.dq[digit])
                    + gains.viscous[digit] * rate
                    + gains.coulomb[digit] * rate / (magnitude + R::constant(FRICTION_SPEED));
            }
        }
        let [spread, f1, f2, f3] = self.feedback;
        let Some(expected) = expected.filter(|_| state.feels()) else {
            return self.feedback;
        };
        let error = SVector::from(*expected) - SVector::from(state.gauges);
        if !frozen && state.gauge_age == 0 {
            self.window.push(&error);
        }
        let force = error * gains.force_proportional + self.window.sum() * (gains.force_integral * R::constant(PERIOD));
        let mut torques = [spread, f1 - force[0], f2 - force[1], f3 - force[2]];
        bound_closing(&mut torques, state, gains, expected);
        torques
    }
}

/// Bounds the torques (N m, spread first) on the closing side, with `expected` gauges. Not inlined: the small fast
/// memory of a board is full.
#[inline(never)]
fn bound_closing<R: Real>(
    torques: &mut [R; DIGITS],
    state: &HandState<R>,
    gains: &HandGains<R>,
    expected: &[R; FINGERS],
) {
    let zero = R::constant(0.0);
    for (finger, expected) in expected.iter().enumerate() {
        let digit = 1 + finger;
        let friction = gains.coulomb[digit] + gains.viscous[digit] * at_least(state.dq[digit], zero);
        let most = asked(*expected) + at_least(-state.gauges[finger], zero) + friction;
        torques[digit] = at_most(torques[digit], most);
    }
}
