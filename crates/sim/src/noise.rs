//! Seeded noise that is the same on every machine.
//!
//! Each source of noise (wake delay of a puck, force axis...) draws from its own stream, so that one component more or
//! one draw more does not change the noise of the others. Gaussian values are sums of twelve uniforms (Irwin-Hall):
//! only additions, hence bit-identical on every platform, unlike Box-Muller, which needs a `log` and a `cos` of some
//! C library. Their tails end at six sigma, far beyond what a sensor model needs.

use oorandom::Rand64;

/// One stream of random numbers.
#[derive(Clone, Debug)]
pub struct Noise {
    generator: Rand64,
}

impl Noise {
    /// The stream number `stream` of the run with this seed.
    #[must_use]
    pub fn new(seed: u64, stream: u64) -> Self {
        Self { generator: Rand64::new(u128::from(seed) << 64 | u128::from(stream)) }
    }

    /// Uniform in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.generator.rand_float()
    }

    /// Gaussian with mean zero, standard deviation `sigma`.
    pub fn gaussian(&mut self, sigma: f64) -> f64 {
        let sum: f64 = (0..12).map(|_| self.generator.rand_float()).sum();
        (sum - 6.0) * sigma
    }
}
