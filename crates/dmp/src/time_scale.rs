//! `Pace`: the speed of time, slewed towards the one asked for.

use crate::Scalar;
use crate::vector::clamp;

/// Speed of time: the present one, the one asked for, and how fast it may change.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pace<T> {
    pub(crate) speed: T,
    pub(crate) target: T,
    pub(crate) stopped: bool,
    pub(crate) slew: Option<T>,
}

impl<T: Scalar> Pace<T> {
    /// Change of speed until the next tick.
    pub(crate) fn change(&self, dt: T) -> T {
        let Some(slew) = self.slew else {
            return T::ZERO;
        };
        clamp(self.wanted() - self.speed, slew * dt)
    }

    fn wanted(&self) -> T {
        if self.stopped { T::ZERO } else { self.target }
    }

    /// Takes over a new wish. Without a slew rate the speed jumps between two ticks, and the jump is not reported as
    /// an acceleration.
    pub(crate) fn update(&mut self, target: T, stopped: bool, slew: Option<T>) {
        *self = Self { speed: self.speed, target, stopped, slew };
        if slew.is_none() {
            self.speed = self.wanted();
        }
    }
}
