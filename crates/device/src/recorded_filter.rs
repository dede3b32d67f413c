//! Checks that the expectation of a primitive was recorded through the same filter as the device's own.
//!
//! Recording and execution must see a contact equally late, or every contact would differ from what is expected of it.

use link::Refusal;

/// Cut-off of the device's filter on wrench and gauges, Hz.
const CUT_OFF: f32 = control::sense::wrench::WRENCH_CUT_OFF as f32;

/// Largest relative difference of another cut-off from it.
const TOLERANCE: f32 = 0.01;

/// The expectation was recorded through a filter of this cut-off, mHz.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OtherFilter(pub u32);

impl From<OtherFilter> for (Refusal, [u32; 2]) {
    fn from(OtherFilter(found): OtherFilter) -> Self {
        (Refusal::ImageFilter, [found, millihertz(CUT_OFF)])
    }
}

/// Accepts the cut-off (Hz) that an image names.
///
/// # Errors
/// [`OtherFilter`], also for a NaN.
pub fn check(found: f32) -> Result<(), OtherFilter> {
    if (1.0 - TOLERANCE..=1.0 + TOLERANCE).contains(&(found / CUT_OFF)) {
        Ok(())
    } else {
        Err(OtherFilter(millihertz(found)))
    }
}

/// Cut to what fits, since it is only told.
fn millihertz(frequency: f32) -> u32 {
    (frequency.clamp(0.0, 4.0e6) * 1000.0 + 0.5) as u32
}

#[cfg(test)]
mod tests {
    use super::{CUT_OFF, OtherFilter, check};

    #[test]
    fn a_filter_within_a_hundredth_is_the_same_and_no_number_is_none() {
        assert_eq!(check(CUT_OFF), Ok(()));
        assert_eq!(check(CUT_OFF * 1.009), Ok(()));
        assert_eq!(check(30.0), Err(OtherFilter(30_000)));
        assert!(check(0.0).is_err() && check(-CUT_OFF).is_err());
        assert!(check(f32::NAN).is_err() && check(f32::INFINITY).is_err());
    }
}
