//! Values of the options of `tactus experiment`: what is out of range is refused before anything is taught.

use std::ops::RangeInclusive;

use lab::learn::SPEEDS;

/// Largest number of an arm or a person; those that gather statistics have numbers above.
const LARGEST_NUMBER: u64 = 1000;

/// Numbers of arms or persons: `N` for 1 to N, or `FROM:TO`.
pub(super) fn numbers(text: &str) -> Result<RangeInclusive<u64>, String> {
    let number = |text: &str| text.parse::<u64>().map_err(|error| format!("'{text}': {error}"));
    let (first, last) = match text.split_once(':') {
        Some((first, last)) => (number(first)?, number(last)?),
        None => (1, number(text)?),
    };
    if first < 1 || last < first || last > LARGEST_NUMBER {
        return Err(format!("numbers are from 1 to {LARGEST_NUMBER}, the smaller one first"));
    }
    Ok(first..=last)
}

/// An angle in degrees, of a whole turn at most.
pub(super) fn degrees(text: &str) -> Result<f64, String> {
    let angle = text.parse::<f64>().ok().filter(|angle| angle.abs() <= 360.0);
    angle.ok_or_else(|| "an angle between -360 and 360 degrees is expected".to_owned())
}

/// A shift along the approach and sideways, cm, no farther than a cell can be.
pub(super) fn shift(text: &str) -> Result<[f64; 2], String> {
    let shift = super::learn::numbers::<2>(text)?;
    let near = shift.iter().all(|way| way.abs() <= 100.0);
    if near { Ok(shift) } else { Err("a shift between -100 and 100 cm is expected".to_owned()) }
}

/// A factor of the taught speed with which a movement is learned.
pub(super) fn faster(text: &str) -> Result<f64, String> {
    let factor = text.parse::<f64>().ok().filter(|factor| SPEEDS.contains(factor));
    factor.ok_or_else(|| format!("a factor from {} to {} is expected", SPEEDS.start(), SPEEDS.end()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_no_grid_can_be_is_refused() {
        assert_eq!((degrees("-90"), shift("2,-2")), (Ok(-90.0), Ok([2.0, -2.0])));
        for wrong in ["NaN", "inf", "361", "1,5", ""] {
            assert!(degrees(wrong).unwrap_err().contains("degrees"), "{wrong}");
        }
        for wrong in ["1e9,0", "0,-101", "nan,0", "1"] {
            assert!(shift(wrong).is_err(), "{wrong}");
        }
        for wrong in ["NaN", "0", "-1", "1000"] {
            assert!(faster(wrong).unwrap_err().contains("factor"), "{wrong}");
        }
    }

    #[test]
    fn numbers_are_counted_from_one_or_from_where_they_begin() {
        assert_eq!((numbers("5"), numbers("11:20"), numbers("7:7")), (Ok(1..=5), Ok(11..=20), Ok(7..=7)));
        for wrong in ["0", "0:3", "5:4", "1001", "a", "1:", ":3", "-2", "1:2:3", ""] {
            assert!(numbers(wrong).is_err(), "{wrong}");
        }
    }
}
