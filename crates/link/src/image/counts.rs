//! The numbers that fix the length of an image, and their limits.

use super::error::ImageError;
use super::layout::{EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, KERNEL_LIMIT, STATISTICS_POINTS_LIMIT, image_bytes};

/// The five numbers that fix the length of an image.
#[derive(Clone, Copy)]
pub(super) struct Counts {
    pub(super) kernels: usize,
    pub(super) k1_points: usize,
    pub(super) k2_points: usize,
    pub(super) expectation_points: usize,
    pub(super) statistics_points: usize,
}

impl Counts {
    pub(super) fn check(self) -> Result<(), ImageError> {
        if self.kernels < 2 || self.kernels > KERNEL_LIMIT {
            return Err(ImageError::Kernels { found: clip(self.kernels) });
        }
        let gain_points = self.k1_points.max(self.k2_points);
        if gain_points > GAIN_POINTS_LIMIT || (self.k1_points == 0) != (self.k2_points == 0) {
            return Err(ImageError::GainPoints { found: clip(gain_points) });
        }
        if self.expectation_points > EXPECTATION_POINTS_LIMIT {
            return Err(ImageError::ExpectationPoints { found: clip(self.expectation_points) });
        }
        if self.statistics_points > STATISTICS_POINTS_LIMIT {
            return Err(ImageError::StatisticsPoints { found: clip(self.statistics_points) });
        }
        Ok(())
    }

    pub(super) const fn bytes(self) -> usize {
        image_bytes(self.kernels, self.k1_points, self.k2_points, self.expectation_points, self.statistics_points)
    }
}

pub(super) fn clip(value: usize) -> u32 {
    u32::try_from(value).unwrap_or(u32::MAX)
}
