//! `Watch`: notices, from what successful runs felt like, that this one is not going as it should.
//!
//! Each channel of the [`Experience`] is compared with its band. The deviation in units of the spread is averaged over
//! [`MEMORY`], with its sign: noise averages out, a missing object does not. A channel whose average leaves
//! [`LIMIT`] is told once per run. The watch only tells; it never touches a torque, since a wrong alarm must not stop an arm
//! that holds something.

use dmp::{EXPERIENCE_CHANNELS, Experience};

use crate::cycle::PERIOD;
use crate::real::Real;

/// Time over which a deviation is averaged (s).
pub const MEMORY: f64 = 0.1;

/// Averaged deviation beyond which a channel counts as a surprise (spreads).
pub const LIMIT: f64 = 4.0;

/// Largest deviation that a single sample counts for (spreads): one corrupt sample stays below the limit.
const WILDEST: f64 = 40.0;

/// Channels that the wrist sensor measures; those after them belong to the hand.
const WRIST_CHANNELS: usize = 6;

/// What was not as it should be, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surprise {
    /// Channel of the experience, 0 to 11.
    pub channel: u8,
    /// Progress of the movement, 0 to 1 and a little beyond.
    pub progress: f32,
}

/// The running comparison of one run with its experience.
#[derive(Clone, Debug)]
pub struct Watch<R: Real> {
    averages: [R; EXPERIENCE_CHANNELS],
    told: [bool; EXPERIENCE_CHANNELS],
}

impl<R: Real> Watch<R> {
    /// Before the first sample.
    pub fn new() -> Self {
        Watch { averages: [R::of(0.0); EXPERIENCE_CHANNELS], told: [false; EXPERIENCE_CHANNELS] }
    }

    /// Takes the values of one control period at `progress`; gives the most deviant channel that has just left its band.
    ///
    /// Without a hand (`has_hand` false) its six channels say nothing.
    pub fn step(
        &mut self,
        experience: &Experience<R>,
        progress: R,
        values: &[R; EXPERIENCE_CHANNELS],
        has_hand: bool,
    ) -> Option<Surprise> {
        let deviations = experience.deviation(progress, values);
        let mut worst: Option<(usize, R)> = None;
        let channels = self.averages.iter_mut().zip(&mut self.told).zip(deviations).enumerate();
        for (channel, ((average, told), deviation)) in channels {
            if channel >= WRIST_CHANNELS && !has_hand {
                continue;
            }
            *average += (clamp(deviation) - *average) * R::of(PERIOD / MEMORY);
            let size = magnitude(*average);
            if size > R::of(LIMIT) && !*told {
                *told = true;
                if worst.is_none_or(|(_, other)| size > other) {
                    worst = Some((channel, size));
                }
            }
        }
        worst.map(|(channel, _)| Surprise { channel: channel as u8, progress: progress.single() })
    }

    /// The largest averaged deviation, as a share of [`LIMIT`]: above 1 is a surprise.
    pub fn statistic(&self) -> R {
        self.averages.iter().fold(R::of(0.0), |largest, average| {
            let size = magnitude(*average) * R::of(1.0 / LIMIT);
            if size > largest { size } else { largest }
        })
    }

    /// Averaged deviation of each channel (spreads), with its sign.
    pub fn averages(&self) -> &[R; EXPERIENCE_CHANNELS] {
        &self.averages
    }
}

impl<R: Real> Default for Watch<R> {
    fn default() -> Self {
        Watch::new()
    }
}

/// Within [`WILDEST`]; what is not a number counts as nothing, which the limiter and the gates before it make known.
fn clamp<R: Real>(deviation: R) -> R {
    let wildest = R::of(WILDEST);
    if deviation > wildest {
        wildest
    } else if deviation < -wildest {
        -wildest
    } else if deviation <= wildest {
        deviation
    } else {
        R::of(0.0)
    }
}

fn magnitude<R: Real>(value: R) -> R {
    if value < R::of(0.0) { -value } else { value }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn experience() -> Experience<f64> {
        // Finger F1 closes to 1.5 rad; the force may wander.
        let mean = [0.0, 0.5, 1.0].map(|u| {
            let mut point = [0.0; EXPERIENCE_CHANNELS];
            point[9] = 0.25 + 1.25 * u;
            point
        });
        let mut spread = [0.1; EXPERIENCE_CHANNELS];
        spread[0] = 1.0;
        Experience::new(&mean, &[spread; 3], 10).expect("a valid experience")
    }

    fn values(finger: f64, force: f64) -> [f64; EXPERIENCE_CHANNELS] {
        let mut values = [0.0; EXPERIENCE_CHANNELS];
        (values[0], values[9]) = (force, finger);
        values
    }

    #[test]
    fn a_run_within_the_band_surprises_nobody() {
        let (experience, mut watch) = (experience(), Watch::new());
        for tick in 0..300 {
            let u = f64::from(tick) / 300.0;
            let noise = if tick % 2 == 0 { 8.0 } else { -8.0 };
            assert_eq!(watch.step(&experience, u, &values(0.25 + 1.25 * u + 0.1, noise), true), None);
        }
        assert!(watch.statistic() < 0.5, "{}", watch.statistic());
    }

    #[test]
    fn a_finger_that_closes_on_nothing_is_told_once_with_its_channel() {
        let (experience, mut watch) = (experience(), Watch::new());
        let mut told = (0..60).filter_map(|_| watch.step(&experience, 1.0, &values(2.35, 0.0), true));
        assert_eq!(told.next().map(|surprise| surprise.channel), Some(9));
        assert_eq!(told.next(), None);
        assert!(watch.statistic() > 1.0);
    }

    #[test]
    fn a_single_wild_sample_is_no_surprise() {
        let (experience, mut watch) = (experience(), Watch::new());
        for wild in [1e9, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(watch.step(&experience, 0.0, &values(0.25, wild), true), None);
            for _ in 0..300 {
                assert_eq!(watch.step(&experience, 0.0, &values(0.25, 0.0), true), None);
            }
        }
    }

    #[test]
    fn without_a_hand_its_channels_say_nothing() {
        let (experience, mut watch) = (experience(), Watch::new());
        for _ in 0..300 {
            assert_eq!(watch.step(&experience, 1.0, &values(0.0, 0.0), false), None);
        }
    }
}
