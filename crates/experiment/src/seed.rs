//! The seed of a trial: from experiment seed and cell, so that any trial can be repeated alone.
//!
//! The modes of one cell and seed share it on purpose: they meet the same plant and the same noise, and differ in the
//! mode only.

use super::grid::Cell;

/// Mixes the bits of a number so that neighbours have nothing in common (the finalizer of SplitMix64).
pub(crate) fn mix(value: u64) -> u64 {
    let value = value.wrapping_add(0x9e37_79b9_7f4a_7c15);
    let value = (value ^ (value >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
    let value = (value ^ (value >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
    value ^ (value >> 31)
}

/// Seed of the plant and of all noise in the trial of `seed` in `cell`.
pub fn of_trial(seed: u64, cell: Cell) -> u64 {
    let place = (u64::from(cell.along_mm as u32) << 32) | u64::from(cell.sideways_mm as u32);
    mix(mix(seed) ^ mix(place))
}

/// A direction in space drawn from a seed: evenly over the sphere.
pub fn direction(seed: u64) -> [f64; 3] {
    // 53 bits are what a double holds.
    let uniform = |seed: u64| (mix(seed) >> 11) as f64 / (1_u64 << 53) as f64;
    let z = 2.0 * uniform(seed ^ 0x7a) - 1.0;
    let (sine, cosine) = (std::f64::consts::TAU * uniform(seed ^ 0xa21)).sin_cos();
    let radius = (1.0 - z * z).sqrt();
    [radius * cosine, radius * sine, z]
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;
    use crate::grid::Grid;

    #[test]
    fn every_trial_has_a_seed_of_its_own() {
        let seeds = (1..=20).flat_map(|seed| Grid::paper().cells.into_iter().map(move |cell| of_trial(seed, cell)));
        assert_eq!(seeds.collect::<BTreeSet<_>>().len(), 20 * 48);
    }

    #[test]
    fn directions_favour_no_side() {
        let mut sum = [0.0; 3];
        for seed in 0..4000 {
            let vector = direction(seed);
            assert!((vector.iter().map(|part| part * part).sum::<f64>() - 1.0).abs() < 1e-12);
            sum = std::array::from_fn(|axis| sum[axis] + vector[axis]);
        }
        assert!(sum.iter().all(|part| part.abs() < 4000.0 * 0.04), "{sum:?}");
    }
}
