//! From the register NBTP and the kernel clock to the bit rate and the sample point.

use crate::Nanoseconds;

/// One bit on the wire as a controller is configured for it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BitTiming {
    /// Frequency of the kernel clock, Hz.
    pub kernel_hz: u32,
    /// Ticks of the kernel clock in a quantum.
    pub prescaler: u32,
    /// Quanta between the synchronisation quantum and the sample point.
    pub before_sample: u32,
    /// Quanta after the sample point.
    pub after_sample: u32,
    /// Most quanta by which one edge may shift the sample point.
    pub jump: u32,
}

impl BitTiming {
    /// Reads NBTP; `None` while the kernel clock stands.
    pub(crate) fn new(nbtp: u32, kernel_hz: u32) -> Option<Self> {
        (kernel_hz > 0).then_some(Self {
            kernel_hz,
            prescaler: (nbtp >> 16 & 0x1FF) + 1,
            before_sample: (nbtp >> 8 & 0xFF) + 1,
            after_sample: (nbtp & 0x7F) + 1,
            jump: (nbtp >> 25) + 1,
        })
    }

    /// Quanta of a bit.
    #[must_use]
    pub fn quanta(&self) -> u32 {
        1 + self.before_sample + self.after_sample
    }

    /// Bits per second, rounded down.
    #[must_use]
    pub fn bits_per_second(&self) -> u32 {
        self.kernel_hz / (self.prescaler * self.quanta())
    }

    /// Where in the bit it is sampled, per mille.
    #[must_use]
    pub fn sample_point_per_mille(&self) -> u32 {
        1000 * (1 + self.before_sample) / self.quanta()
    }

    /// Duration of `count` bits.
    #[must_use]
    pub fn bits(&self, count: u32) -> Nanoseconds {
        let ticks = u64::from(count) * u64::from(self.prescaler * self.quanta());
        ticks * 1_000_000_000 / u64::from(self.kernel_hz)
    }
}
