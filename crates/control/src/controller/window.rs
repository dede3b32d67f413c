//! `Window`: the sum of the last errors, for the windowed integrals of Eqs (12) and (14).

use nalgebra::SVector;

use crate::real::Real;

/// Sum over the last control periods of `D` errors, at most `CAPACITY` of them.
#[derive(Clone, Debug)]
pub struct Window<R: Real, const D: usize, const CAPACITY: usize> {
    errors: [SVector<R, D>; CAPACITY],
    length: usize,
    next: usize,
    sum: SVector<R, D>,
    /// Errors taken in since the window was last summed afresh.
    rebuilt: SVector<R, D>,
}

impl<R: Real, const D: usize, const CAPACITY: usize> Window<R, D, CAPACITY> {
    /// An empty window of `length` control periods (kept within 1 and `CAPACITY`).
    pub fn new(length: usize) -> Self {
        Window {
            errors: [SVector::zeros(); CAPACITY],
            length: length.clamp(1, CAPACITY),
            next: 0,
            sum: SVector::zeros(),
            rebuilt: SVector::zeros(),
        }
    }

    /// Empties the window and gives it this length.
    pub fn restart(&mut self, length: usize) {
        self.errors = [SVector::zeros(); CAPACITY];
        self.length = length.clamp(1, CAPACITY);
        self.next = 0;
        self.sum = SVector::zeros();
        self.rebuilt = SVector::zeros();
    }

    /// Empties the window.
    pub fn reset(&mut self) {
        self.restart(self.length);
    }

    /// Takes in the error of this control period and lets go of the oldest one.
    pub fn push(&mut self, error: &SVector<R, D>) {
        if let Some(slot) = self.errors.get_mut(self.next) {
            self.sum += error - *slot;
            self.rebuilt += error;
            *slot = *error;
        }
        self.next += 1;
        if self.next >= self.length {
            // A running sum drifts by rounding; once per turn it is replaced by the sum of what is in the window.
            self.next = 0;
            self.sum = self.rebuilt;
            self.rebuilt = SVector::zeros();
        }
    }

    /// Sum of the errors in the window.
    pub fn sum(&self) -> &SVector<R, D> {
        &self.sum
    }
}
