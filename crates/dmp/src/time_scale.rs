//! `TimeScale`: the speed of time, slewed towards the one asked for.

use crate::Scalar;
use crate::vector::clamp;

/// Present speed, the one asked for, and how fast it may change. 1 is the taught speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TimeScale<T> {
    pub(crate) speed: T,
    pub(crate) target: T,
    pub(crate) stopped: bool,
    pub(crate) slew: Option<T>,
}

impl<T: Scalar> TimeScale<T> {
    /// Change of speed until the next tick.
    pub(crate) fn change(&self, dt: T) -> T {
        let Some(slew) = self.slew else {
            return T::ZERO;
        };
        clamp(self.effective_target() - self.speed, slew * dt)
    }

    fn effective_target(&self) -> T {
        if self.stopped { T::ZERO } else { self.target }
    }

    /// Takes over a new target. Without a slew rate the speed jumps between two ticks, and the jump is not reported as
    /// an acceleration.
    pub(crate) fn update(&mut self, target: T, stopped: bool, slew: Option<T>) {
        *self = Self { speed: self.speed, target, stopped, slew };
        if slew.is_none() {
            self.speed = self.effective_target();
        }
    }
}
