//! `Profile`: three values, one per finger, over the progress of the movement.
//!
//! As `dmp::PhaseTable`: samples at evenly spaced progress from 0 to 1, linear in between, end values beyond. Filled
//! point by point while an image arrives.

use dmp::Scalar;

use crate::FINGERS;
use crate::number::{Number, ONE, ZERO, whole};

/// How a value is kept.
pub trait Stored: Copy {
    /// The value in this form; `None` where it does not fit.
    fn stored(value: f32) -> Option<Self>;
    /// The value on the control path.
    fn number(self) -> Number;
}

impl Stored for Number {
    fn stored(value: f32) -> Option<Self> {
        /// Gains beyond this mean nothing, and their products must stay far from saturation.
        const LIMIT: f32 = 1e5;
        (value.abs() <= LIMIT).then(|| crate::number::from_real(value))
    }

    fn number(self) -> Number {
        self
    }
}

/// 24 fraction bits: +-128 N m to 6e-8 N m, half the room of a [`Number`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Torque(i32);

impl Stored for Torque {
    fn stored(value: f32) -> Option<Self> {
        crate::forcing::weight(value).map(Torque)
    }

    fn number(self) -> Number {
        Number::from_bits(i64::from(self.0) << 8)
    }
}

/// Up to `POINTS` samples.
#[derive(Clone, Debug)]
pub struct Profile<T, const POINTS: usize>(heapless::Vec<[T; FINGERS], POINTS>);

impl<T: Stored, const POINTS: usize> Profile<T, POINTS> {
    /// Without samples: zero everywhere.
    pub const fn new() -> Self {
        Profile(heapless::Vec::new())
    }

    /// True if there are no samples.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }

    /// Forgets all samples.
    pub fn clear(&mut self) {
        self.0.clear();
    }

    /// Adds the next sample; false if there is no room.
    pub fn push(&mut self, sample: [T; FINGERS]) -> bool {
        self.0.push(sample).is_ok()
    }

    /// True if a sample makes `doubt` true.
    pub fn any(&self, doubt: impl Fn(Number) -> bool) -> bool {
        self.0.iter().flatten().any(|value| doubt(value.number()))
    }

    /// The values at progress `u`.
    pub fn at(&self, u: Number) -> [Number; FINGERS] {
        let (Some(first), Some(last)) = (self.0.first(), self.0.last()) else {
            return [ZERO; FINGERS];
        };
        if u <= ZERO {
            return first.map(T::number);
        }
        if u >= ONE {
            return last.map(T::number);
        }
        let intervals = i32::try_from(self.0.len() - 1).unwrap_or(0);
        let place = u * whole(intervals);
        let left = place.to_index();
        let weight = place - whole(i32::try_from(left).unwrap_or(0));
        match (self.0.get(left), self.0.get(left + 1)) {
            (Some(a), Some(b)) => core::array::from_fn(|finger| {
                let (a, b) = (a[finger].number(), b[finger].number());
                a + (b - a) * weight
            }),
            _ => last.map(T::number),
        }
    }
}

impl<T: Stored, const POINTS: usize> Default for Profile<T, POINTS> {
    fn default() -> Self {
        Profile::new()
    }
}
