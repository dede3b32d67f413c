//! Learning from a demonstration of 1501 samples: 17 rows, 50 kernels, smoothing and replay included.

use divan::{Bencher, black_box};
use dmp::Quaternion;
use dmp::fit::{Demonstration, FitOptions, PoseSamples, fit};

fn main() {
    divan::main();
}

fn demonstration() -> Demonstration<11, 1> {
    let samples = 1501;
    let value = |k: usize, i: usize| {
        let u = k as f64 / (samples - 1) as f64;
        u * u * (3.0 - 2.0 * u) + 0.1 * (9.0 * u + i as f64).sin()
    };
    fn rows<const D: usize>(value: impl Fn(usize, usize) -> f64) -> Vec<[f64; D]> {
        (0..1501).map(|k| std::array::from_fn(|i| value(k, i))).collect()
    }
    let orientation = rows::<3>(value).iter().map(Quaternion::from_rotation_vector).collect();
    Demonstration::new(1.0 / 300.0, [PoseSamples { position: rows(value), orientation }], rows(value)).unwrap()
}

#[divan::bench]
fn rows_17_samples_1501(bencher: Bencher<'_, '_>) {
    let demonstration = demonstration();
    let options = FitOptions::default();
    bencher.bench_local(|| fit(black_box(&demonstration), black_box(&options)).unwrap());
}
