//! Puts samples on a uniform grid of time.

/// Uniform times from the first to the last of `time`, `period` apart; the last grid point is at most half a
/// period away from the last sample.
///
/// A grid that the samples already lie on (a device's own telemetry) is reproduced to the last digit.
pub fn grid(time: &[f64], period: f64) -> Vec<f64> {
    let (Some(first), Some(last)) = (time.first(), time.last()) else {
        return Vec::new();
    };
    // A recorded time stamp of few digits may end a little before its grid point: do not lose that sample.
    let count = ((last - first) / period + 1e-2).floor() as usize + 1;
    (0..count).map(|index| first + index as f64 * period).collect()
}

/// Index of the sample before `t` and the fraction of the way to the next.
fn locate(time: &[f64], t: f64) -> (usize, f64) {
    let after = time.partition_point(|sample| *sample <= t).clamp(1, time.len() - 1);
    let (before, next) = (time[after - 1], time[after]);
    (after - 1, ((t - before) / (next - before)).clamp(0.0, 1.0))
}

/// Linear interpolation of vectors. At 300 Hz the chord lies `a dt^2 / 8` = 1.4 um off an arc of 1 m/s^2, far below
/// the noise that the filter behind it removes.
pub fn vectors<const SIZE: usize>(time: &[f64], values: &[[f64; SIZE]], grid: &[f64]) -> Vec<[f64; SIZE]> {
    grid.iter()
        .map(|t| {
            let (index, fraction) = locate(time, *t);
            let (a, b) = (values[index], values[index + 1]);
            std::array::from_fn(|row| a[row] + fraction * (b[row] - a[row]))
        })
        .collect()
}

/// Linear interpolation of unit quaternions along the chord, normalised: for the small angles between neighbours
/// (they are sign-continuous) it differs from the great arc by the third power of the angle.
pub fn quaternions(time: &[f64], values: &[[f64; 4]], grid: &[f64]) -> Vec<[f64; 4]> {
    vectors(time, values, grid)
        .into_iter()
        .map(|value| {
            let norm = value.iter().map(|part| part * part).sum::<f64>().sqrt();
            value.map(|part| part / norm)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_on_the_grid_come_back_unchanged() {
        let time: Vec<f64> = (0..100).map(|k| f64::from(k) / 300.0).collect();
        let values: Vec<[f64; 1]> = time.iter().map(|t| [t.sin()]).collect();
        let grid = grid(&time, 1.0 / 300.0);
        assert_eq!(grid.len(), 100);
        let again = vectors(&time, &values, &grid);
        for (a, b) in values.iter().zip(&again) {
            assert!((a[0] - b[0]).abs() < 1e-15);
        }
    }

    #[test]
    fn a_gap_is_bridged_in_a_straight_line() {
        let time = [0.0, 0.1, 0.4, 0.5];
        let values = [[0.0], [1.0], [4.0], [5.0]];
        let again = vectors(&time, &values, &grid(&time, 0.1));
        assert_eq!(again.len(), 6);
        for (k, value) in again.iter().enumerate() {
            assert!((value[0] - k as f64).abs() < 1e-12);
        }
    }

    #[test]
    fn a_quaternion_halfway_turns_by_half_the_angle() {
        let half = 0.1_f64;
        let time = [0.0, 1.0];
        let values = [[1.0, 0.0, 0.0, 0.0], [half.cos(), 0.0, half.sin(), 0.0]];
        let middle = quaternions(&time, &values, &[0.5])[0];
        assert!((middle[2].asin() - half / 2.0).abs() < 1e-12);
    }
}
