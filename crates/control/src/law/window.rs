//! `Window`: the sum of the last errors, for the windowed integrals of Eqs (12) and (14).

use nalgebra::SVector;
use pinned_init::{Init, init, init_array_from_fn};

use crate::real::Real;

/// Sum over the last control periods of `D` errors, at most `CAPACITY` of them.
#[derive(Clone, Debug)]
pub struct Window<R: Real, const D: usize, const CAPACITY: usize> {
    errors: [SVector<R, D>; CAPACITY],
    length: usize,
    next: usize,
    /// True if the window has been filled since it was emptied: before that there is no oldest error, and what the ring
    /// holds is from earlier. So emptying it writes nothing but a few words, within a control cycle.
    full: bool,
    sum: SVector<R, D>,
    /// Errors taken in since the window was last summed afresh.
    rebuilt: SVector<R, D>,
}

impl<R: Real, const D: usize, const CAPACITY: usize> Window<R, D, CAPACITY> {
    /// Makes an empty window of `length` control periods (kept within 1 and `CAPACITY`) in its place.
    pub fn init(length: usize) -> impl Init<Self> {
        init!(Window {
            errors <- init_array_from_fn(|_| SVector::zeros()),
            length: length.clamp(1, CAPACITY),
            next: 0,
            full: false,
            sum: SVector::zeros(),
            rebuilt: SVector::zeros(),
        })
    }

    /// Empties the window and gives it this length.
    pub fn restart(&mut self, length: usize) {
        self.length = length.clamp(1, CAPACITY);
        self.next = 0;
        self.full = false;
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
            let oldest = if self.full { *slot } else { SVector::zeros() };
            self.sum += error - oldest;
            self.rebuilt += error;
            *slot = *error;
        }
        self.next += 1;
        if self.next >= self.length {
            // A running sum drifts by rounding; once per turn it is replaced by the sum of what is in the window.
            self.next = 0;
            self.full = true;
            self.sum = self.rebuilt;
            self.rebuilt = SVector::zeros();
        }
    }

    /// The error that was taken in so many control periods before the last one; `None` if the window has none so old.
    pub fn before(&self, periods: usize) -> Option<&SVector<R, D>> {
        let back = periods + 1;
        let at = match self.next.checked_sub(back) {
            Some(at) if back <= self.length => at,
            None if self.full && back <= self.length => (self.next + self.length).checked_sub(back)?,
            _ => return None,
        };
        self.errors.get(at)
    }

    /// Sum of the errors in the window.
    pub fn sum(&self) -> &SVector<R, D> {
        &self.sum
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::boxed::Box;

    use nalgebra::Vector1;
    use pinned_init::InPlaceWrite;

    use super::*;

    #[test]
    fn an_emptied_window_forgets_what_was_in_it_whatever_its_new_length() {
        let errors: [f64; 39] = core::array::from_fn(|index| 1.0 + index as f64);
        let Ok(mut window) = Box::new_uninit().write_init(Window::<f64, 1, 8>::init(8));
        for (before, length) in [(3, 8), (8, 5), (20, 8), (11, 1), (1, 3)] {
            errors[..before].iter().for_each(|error| window.push(&Vector1::new(100.0 * error)));
            window.restart(length);
            assert_eq!(window.sum()[0], 0.0);
            for (last, error) in errors.iter().enumerate() {
                window.push(&Vector1::new(*error));
                // From the definition.
                let sum: f64 = errors[(last + 1).saturating_sub(length)..=last].iter().sum();
                assert_eq!(window.sum()[0], sum, "error {last} of a window of {length} after {before}");
            }
        }
    }

    #[test]
    fn the_error_of_some_periods_ago_is_told_as_long_as_the_window_holds_it() {
        let Ok(mut window) = Box::new_uninit().write_init(Window::<f64, 1, 8>::init(8));
        (0..20).for_each(|_| window.push(&Vector1::new(100.0)));
        window.restart(5);
        for last in 0..13u32 {
            window.push(&Vector1::new(f64::from(last)));
            for ago in 0..7u32 {
                // From the definition; what is from before the window was emptied is in no window.
                let wanted = (ago <= last && ago < 5).then(|| f64::from(last - ago));
                assert_eq!(window.before(ago as usize).map(|error| error[0]), wanted, "{ago} before error {last}");
            }
        }
    }
}
