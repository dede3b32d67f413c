//! The operator's hands, which hold the arm at home until it is active.
//!
//! Zeroing tells the pucks "this is home" (docs/barrett-can.md), and it is the operator who puts the arm there. The
//! brake of idle motors alone would let the wrist sink under the hand's weight before the pucks are awake. The hands
//! let go slowly, some time after the arm has become active, and do not come back by themselves: after an E-stop the
//! arm lies where it fell, until somebody has it carried home.
//!
//! `tau = kp e + kd de + ki int e` per joint, with gains from one frequency and the joint's mean inertia.

use crate::time::{STEP_SECONDS, TICKS_PER_MILLISECOND, Ticks, seconds};

/// Stiffness of the hold as a frequency, rad/s. Assumed; the integral part removes the sag whatever the stiffness.
const FREQUENCY: f64 = 100.0;

/// Error that is not corrected, rad: half a motor count at the wrist. Without it friction and the integral
/// part would hunt for ever.
const CLOSE_ENOUGH: f64 = 4e-5;

/// Duration of letting go.
const FADE: Ticks = 200 * TICKS_PER_MILLISECOND;

/// Time in which the arm is carried home.
const CARRY: Ticks = 1000 * TICKS_PER_MILLISECOND;

/// Mean inertia about each joint, kg m^2: order of magnitude is enough.
const INERTIA: [f64; 7] = [1.6, 2.4, 0.26, 0.36, 0.019, 0.03, 0.0033];

/// The hands.
#[derive(Clone, Debug)]
pub(crate) struct SteadyHand {
    home: [f64; 7],
    /// Where the arm is carried from, and since when; `None`: it is held at home.
    carried: Option<([f64; 7], Ticks)>,
    error_sum: [f64; 7],
    /// As told at the beginning; it counts again for an arm that has been carried home.
    patience: Option<Ticks>,
    /// Time from ACTIVE to the beginning of letting go; `None` once nothing is held.
    holds_for: Option<Ticks>,
    lets_go_at: Option<Ticks>,
}

impl SteadyHand {
    /// Hands at the arm in pose `home`, rad, that let go `holds_for` after ACTIVE; `None`: nobody holds the arm.
    pub(crate) fn new(home: [f64; 7], holds_for: Option<Ticks>) -> Self {
        Self { home, carried: None, error_sum: [0.0; 7], patience: holds_for, holds_for, lets_go_at: None }
    }

    /// The hands take the arm where it lies, at `q`, carry it home, and hold it there as at the beginning.
    pub(crate) fn carry_home(&mut self, now: Ticks, q: [f64; 7]) {
        *self = Self { carried: Some((q, now)), ..Self::new(self.home, self.patience) };
    }

    /// Where the hands want the arm at `now`, rad.
    fn target(&self, now: Ticks) -> [f64; 7] {
        let Some((from, since)) = self.carried else { return self.home };
        let u = (seconds(now.saturating_sub(since)) / seconds(CARRY)).min(1.0);
        let share = u * u * u * (10.0 - 15.0 * u + 6.0 * u * u);
        std::array::from_fn(|joint| from[joint] + (self.home[joint] - from[joint]) * share)
    }

    /// The arm has become active.
    pub(crate) fn see_active(&mut self, now: Ticks) {
        self.lets_go_at = self.lets_go_at.or(self.holds_for.map(|holds_for| now + holds_for));
    }

    /// Torque of the hands on each joint for the step that ends at `now`, N m.
    pub(crate) fn torques(&mut self, now: Ticks, q: &[f64; 7], dq: &[f64; 7]) -> [f64; 7] {
        if self.holds_for.is_none() {
            return [0.0; 7];
        }
        let grip = match self.lets_go_at {
            Some(at) if now >= at + FADE => {
                self.holds_for = None;
                return [0.0; 7];
            }
            Some(at) => 1.0 - seconds(now.saturating_sub(at)) / seconds(FADE),
            None => 1.0,
        };
        let target = self.target(now);
        std::array::from_fn(|joint| {
            let error = target[joint] - q[joint];
            if error.abs() > CLOSE_ENOUGH {
                self.error_sum[joint] += error * STEP_SECONDS;
            }
            let stiffness = INERTIA[joint] * FREQUENCY * FREQUENCY;
            let damping = 2.0 * INERTIA[joint] * FREQUENCY;
            let reset = stiffness * FREQUENCY / 5.0;
            grip * (stiffness * error - damping * dq[joint] + reset * self.error_sum[joint])
        })
    }
}
