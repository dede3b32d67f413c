//! `Watch`: notices, by the sensor values of successful runs, that this one is not going as it should.
//!
//! Two things are told. A channel leaves its band: its z-score by the [`SensorStatistics`] is averaged over [`MEMORY`]
//! with its sign (noise averages out, a missing object does not) and passes [`LIMIT`]. Of a finger only going too far
//! counts: one that stops early has met something, be it thicker than usual; one that closes farther than ever holds
//! nothing. And contact is lost: before the fingers move, the force falls to a small part of what it was. No table by
//! phase can tell that, because objects are met at different phases, but an object that was met and fell over no longer
//! pushes back.
//!
//! Each is told once per run. The watch only tells; it never touches a torque, since a wrong alarm must not stop an arm
//! that holds something.

use crate::real::Real;
use crate::time::PERIOD;

/// Channels: the nine sensor values, then the angles of fingers F1, F2, F3 (rad).
pub const STATISTICS_CHANNELS: usize = 12;

/// Most points of the statistics.
pub const STATISTICS_CAPACITY: usize = 64;

/// Mean and spread of the sensor values of successful runs.
pub type SensorStatistics<T> = dmp::SensorStatistics<T, STATISTICS_CHANNELS, STATISTICS_CAPACITY>;

/// Time over which a deviation is averaged (s).
pub const MEMORY: f64 = 0.1;

/// Averaged deviation beyond which a channel counts as a surprise (spreads).
pub const LIMIT: f64 = 4.0;

/// First of the channels that are angles of fingers.
pub const FIRST_FINGER: usize = 9;

/// Largest deviation that a single sample counts for (spreads): one corrupt sample stays below the limit.
const WILDEST: f64 = 40.0;

/// Channels that the wrist sensor measures; those after them belong to the hand.
const WRIST_CHANNELS: usize = 6;

/// Time over which the force is averaged before contact is judged (s): longer than a bounce, or the swing of an object
/// that stays on its foot.
const CONTACT_MEMORY: f64 = 0.5;

/// Square of the averaged force that counts as contact (N^2): 1 N is ten times what the sensor drifts by.
const CONTACT_SQUARE: f64 = 1.0;

/// Share of its largest value to which the force falls when contact is lost. Successful runs keep a quarter at least,
/// even those that give way.
const KEPT: f64 = 1.0 / 7.0;

/// Movement of a finger from where it was at the start by which the hand is closing (rad).
const CLOSING: f64 = 0.1;

/// Statistic of a run that has lost contact: twice the limit.
const LOST: f64 = 2.0;

/// Largest force that is compared (N); more would be no sample.
const STRONGEST: f64 = 1e3;

/// A channel that left its band, and when.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surprise {
    /// Channel of the statistics, 0 to 11. For lost contact it is the axis along which the force was largest, 0 to 2.
    pub channel: u8,
    /// Progress of the movement, 0 to 1 and a little beyond.
    pub progress: f32,
}

/// The running comparison of one run with its statistics.
#[derive(Clone, Debug)]
pub struct Watch<R: Real> {
    averages: [R; STATISTICS_CHANNELS],
    told: [bool; STATISTICS_CHANNELS],
    contact: Contact<R>,
}

impl<R: Real> Watch<R> {
    /// Before the first sample.
    pub fn new() -> Self {
        Watch {
            averages: [R::constant(0.0); STATISTICS_CHANNELS],
            told: [false; STATISTICS_CHANNELS],
            contact: Contact::new(),
        }
    }

    /// Takes the values of one control period at `progress`; gives the most deviant channel that has just left its
    /// band.
    ///
    /// Without a hand (`has_hand` false) its six channels say nothing.
    pub fn step(
        &mut self,
        statistics: &SensorStatistics<R>,
        progress: R,
        values: &[R; STATISTICS_CHANNELS],
        has_hand: bool,
    ) -> Option<Surprise> {
        let deviations = statistics.z_score(progress, values);
        let mut worst: Option<(usize, R)> = None;
        let channels = self.averages.iter_mut().zip(&mut self.told).zip(deviations).enumerate();
        for (channel, ((average, told), deviation)) in channels {
            if channel >= WRIST_CHANNELS && !has_hand {
                continue;
            }
            *average += (clamp(deviation) - *average) * R::constant(PERIOD / MEMORY);
            let size = size(channel, *average);
            if size > R::constant(LIMIT) && !*told {
                *told = true;
                if worst.is_none_or(|(_, other)| size > other) {
                    worst = Some((channel, size));
                }
            }
        }
        let lost = self.contact.step(progress, values, has_hand);
        lost.or(worst.map(|(channel, _)| channel))
            .map(|channel| Surprise { channel: channel as u8, progress: progress.single() })
    }

    /// The largest averaged deviation, as a share of [`LIMIT`]: above 1 is a surprise. At least 2 once contact was
    /// lost.
    pub fn statistic(&self) -> R {
        let begin = if self.contact.lost { R::constant(LOST) } else { R::constant(0.0) };
        self.averages.iter().enumerate().fold(begin, |largest, (channel, average)| {
            let share = size(channel, *average) * R::constant(1.0 / LIMIT);
            if share > largest { share } else { largest }
        })
    }

    /// Distance of each channel towards a surprise (spreads, never negative): the averaged deviation, of fingers only
    /// that of closing too far.
    pub fn sizes(&self) -> [R; STATISTICS_CHANNELS] {
        core::array::from_fn(|channel| {
            self.averages.get(channel).map_or(R::constant(0.0), |average| size(channel, *average))
        })
    }

    /// True if contact was lost before the fingers closed.
    pub fn has_lost_contact(&self) -> bool {
        self.contact.lost
    }

    /// Averaged deviation of each channel (spreads), with its sign.
    pub fn averages(&self) -> &[R; STATISTICS_CHANNELS] {
        &self.averages
    }
}

impl<R: Real> Default for Watch<R> {
    fn default() -> Self {
        Watch::new()
    }
}

/// Contact with an object that was met, and its loss.
#[derive(Clone, Debug)]
struct Contact<R: Real> {
    /// Averaged force (N, world).
    force: [R; 3],
    /// Square of the largest averaged force so far (N^2), and its largest axis.
    largest: R,
    axis: usize,
    /// Where the fingers stood at the start (rad).
    fingers: Option<[R; 3]>,
    closing: bool,
    lost: bool,
}

impl<R: Real> Contact<R> {
    fn new() -> Self {
        let zero = R::constant(0.0);
        Contact { force: [zero; 3], largest: zero, axis: 0, fingers: None, closing: false, lost: false }
    }

    /// Returns, once, the axis of a force that is gone.
    fn step(&mut self, progress: R, values: &[R; STATISTICS_CHANNELS], has_hand: bool) -> Option<usize> {
        let [fx, fy, fz, .., q1, q2, q3] = *values;
        if has_hand {
            let start = *self.fingers.get_or_insert([q1, q2, q3]);
            let moved = |(q, start): (R, R)| magnitude(q - start) > R::constant(CLOSING);
            self.closing = self.closing || [q1, q2, q3].into_iter().zip(start).any(moved);
        }
        // The force of a grasp has other reasons, and after the movement nothing is known of it.
        if self.closing || self.lost || progress > R::constant(1.0) {
            return None;
        }
        let mut square = R::constant(0.0);
        let mut strongest = (0, R::constant(0.0));
        for (axis, (average, force)) in self.force.iter_mut().zip([fx, fy, fz]).enumerate() {
            if magnitude(force) < R::constant(STRONGEST) {
                *average += (force - *average) * R::constant(PERIOD / CONTACT_MEMORY);
            }
            square += *average * *average;
            if magnitude(*average) > strongest.1 {
                strongest = (axis, magnitude(*average));
            }
        }
        if square > self.largest {
            (self.largest, self.axis) = (square, strongest.0);
        }
        self.lost = self.largest > R::constant(CONTACT_SQUARE) && square < self.largest * R::constant(KEPT * KEPT);
        self.lost.then_some(self.axis)
    }
}

/// Of an averaged deviation what counts: its magnitude, of a finger only the part that closes too far.
fn size<R: Real>(channel: usize, average: R) -> R {
    if channel < FIRST_FINGER {
        magnitude(average)
    } else if average > R::constant(0.0) {
        average
    } else {
        R::constant(0.0)
    }
}

/// Within [`WILDEST`]; what is not a number counts as nothing, which the limiter and the gates before it make known.
fn clamp<R: Real>(deviation: R) -> R {
    let wildest = R::constant(WILDEST);
    if deviation > wildest {
        wildest
    } else if deviation < -wildest {
        -wildest
    } else if deviation <= wildest {
        deviation
    } else {
        R::constant(0.0)
    }
}

fn magnitude<R: Real>(value: R) -> R {
    if value < R::constant(0.0) { -value } else { value }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec;
    use std::vec::Vec;

    use super::*;

    fn statistics() -> SensorStatistics<f64> {
        // Finger F1 closes to 1.5 rad; the force may wander.
        let mean = [0.0, 0.5, 1.0].map(|u| {
            let mut point = [0.0; STATISTICS_CHANNELS];
            point[9] = 0.25 + 1.25 * u;
            point
        });
        let mut spread = [0.1; STATISTICS_CHANNELS];
        spread[0] = 1.0;
        SensorStatistics::new(&mean, &[spread; 3], 10).expect("valid statistics")
    }

    fn values(finger: f64, force: f64) -> [f64; STATISTICS_CHANNELS] {
        let mut values = [0.0; STATISTICS_CHANNELS];
        (values[0], values[9]) = (force, finger);
        values
    }

    #[test]
    fn a_run_within_the_band_surprises_nobody() {
        let (statistics, mut watch) = (statistics(), Watch::new());
        for tick in 0..300 {
            let u = f64::from(tick) / 300.0;
            let noise = if tick % 2 == 0 { 8.0 } else { -8.0 };
            assert_eq!(watch.step(&statistics, u, &values(0.25 + 1.25 * u + 0.1, noise), true), None);
        }
        assert!(watch.statistic() < 0.5, "{}", watch.statistic());
    }

    #[test]
    fn a_finger_that_closes_on_nothing_is_told_once_with_its_channel() {
        let (statistics, mut watch) = (statistics(), Watch::new());
        let mut told = (0..60).filter_map(|_| watch.step(&statistics, 1.0, &values(2.35, 0.0), true));
        assert_eq!(told.next().map(|surprise| surprise.channel), Some(9));
        assert_eq!(told.next(), None);
        assert!(watch.statistic() > 1.0);
    }

    #[test]
    fn a_finger_that_stops_early_has_met_something_and_is_no_surprise() {
        let (statistics, mut watch) = (statistics(), Watch::new());
        for _ in 0..300 {
            assert_eq!(watch.step(&statistics, 1.0, &values(0.6, 0.0), true), None);
        }
        assert_eq!(watch.statistic(), 0.0);
        assert!(watch.averages()[9] < -2.0 * LIMIT);
    }

    /// Statistics to which every force is usual.
    fn indifferent() -> SensorStatistics<f64> {
        let mut spread = [100.0; STATISTICS_CHANNELS];
        spread[9] = 0.1;
        SensorStatistics::new(&[[0.25; STATISTICS_CHANNELS]; 2], &[spread; 2], 10).expect("valid statistics")
    }

    /// Pushed with 2 N for two seconds, then with `then` N for two; gives what was told, and after which time (s).
    fn pushed(then: f64, finger: f64) -> (Option<(u8, f64)>, f64) {
        let (statistics, mut watch) = (indifferent(), Watch::new());
        let mut told = None;
        for tick in 0..crate::time::periods(5.0) {
            let time = f64::from(tick) * PERIOD;
            let force = if time < 1.0 {
                0.0
            } else if time < 3.0 {
                -2.0
            } else {
                then
            };
            let mut values = values(0.25, 0.0);
            values[1] = force;
            if time > 2.9 {
                values[9] = finger;
            }
            if let Some(surprise) = watch.step(&statistics, 0.5, &values, true) {
                assert_eq!(told, None);
                told = Some((surprise.channel, time));
            }
        }
        assert_eq!(watch.has_lost_contact(), told.is_some());
        (told, watch.statistic())
    }

    #[test]
    fn contact_that_is_lost_before_the_fingers_close_is_told_with_its_axis_within_a_second() {
        let (told, statistic) = pushed(-0.1, 0.25);
        let (channel, time) = told.expect("told");
        assert!(channel == 1 && (3.5..4.5).contains(&time), "{channel} at {time} s");
        assert!(statistic > 1.0);
    }

    #[test]
    fn a_hand_that_gives_way_and_still_feels_a_quarter_has_lost_nothing() {
        assert_eq!(pushed(-0.5, 0.25).0, None);
    }

    #[test]
    fn the_force_may_vanish_when_the_fingers_have_begun_to_close() {
        assert_eq!(pushed(0.0, 0.4).0, None);
    }

    #[test]
    fn a_single_wild_sample_is_no_surprise() {
        let (statistics, mut watch) = (statistics(), Watch::new());
        for wild in [1e9, f64::NAN, f64::NEG_INFINITY] {
            assert_eq!(watch.step(&statistics, 0.0, &values(0.25, wild), true), None);
            for _ in 0..300 {
                assert_eq!(watch.step(&statistics, 0.0, &values(0.25, 0.0), true), None);
            }
        }
    }

    /// Statistics that expect nothing on any channel, each with this spread.
    fn still(spread: [f64; STATISTICS_CHANNELS]) -> SensorStatistics<f64> {
        SensorStatistics::new(&[[0.0; STATISTICS_CHANNELS]; 2], &[spread; 2], 10).expect("valid statistics")
    }

    /// Each channel that is told within a second of these values.
    fn told(values: &[f64; STATISTICS_CHANNELS], has_hand: bool) -> Vec<u8> {
        let (statistics, mut watch) = (still([0.1; STATISTICS_CHANNELS]), Watch::new());
        let surprises = (0..crate::time::periods(1.0)).filter_map(|_| watch.step(&statistics, 1.5, values, has_hand));
        surprises.map(|surprise| surprise.channel).collect()
    }

    #[test]
    fn every_channel_that_leaves_its_band_is_told_and_without_a_hand_those_of_the_wrist_alone() {
        for channel in 0..STATISTICS_CHANNELS {
            // Spreads by a factor of ten; a wild one that lasts is no corrupt sample.
            for value in [1.0, 100.0, -1.0, -100.0] {
                let mut values = [0.0; STATISTICS_CHANNELS];
                values[channel] = value;
                let expected = if channel < FIRST_FINGER || value > 0.0 { vec![channel as u8] } else { vec![] };
                assert_eq!(told(&values, true), expected, "{value}");
                assert_eq!(told(&values, false), if channel < WRIST_CHANNELS { expected } else { vec![] }, "{value}");
            }
        }
    }

    #[test]
    fn of_channels_that_leave_their_bands_together_the_most_deviant_is_told() {
        for (first, second, most) in [(2.0, 1.9, 1), (1.9, 2.0, 4)] {
            let mut values = [0.0; STATISTICS_CHANNELS];
            (values[1], values[4]) = (first, -second);
            assert_eq!(told(&values, true), [most]);
        }
    }

    #[test]
    fn the_statistic_is_the_largest_size_in_limits_and_a_finger_that_closes_less_has_none() {
        let (statistics, mut watch) = (still([0.1; STATISTICS_CHANNELS]), Watch::new());
        let mut values = [0.0; STATISTICS_CHANNELS];
        (values[2], values[7], values[9], values[10]) = (-0.3, 0.2, -0.8, 0.1);
        for _ in 0..crate::time::periods(2.0) {
            watch.step(&statistics, 0.5, &values, true);
        }
        let mut expected = [0.0; STATISTICS_CHANNELS];
        (expected[2], expected[7], expected[10]) = (3.0, 2.0, 1.0);
        assert!(watch.sizes().iter().zip(expected).all(|(size, expected)| (size - expected).abs() < 1e-6));
        assert!((watch.statistic() - 3.0 / LIMIT).abs() < 1e-6, "{}", watch.statistic());
    }

    /// Statistic of a run that is pushed with `force` (N) for ten seconds, and then by nothing for five.
    fn released(force: [f64; 3], progress: f64, has_hand: bool) -> f64 {
        let (statistics, mut watch) = (still([1e3; STATISTICS_CHANNELS]), Watch::new());
        for tick in 0..crate::time::periods(15.0) {
            let mut values = [0.0; STATISTICS_CHANNELS];
            if tick < crate::time::periods(10.0) {
                values[..3].copy_from_slice(&force);
            }
            watch.step(&statistics, progress, &values, has_hand);
        }
        watch.statistic()
    }

    #[test]
    fn a_newton_in_any_direction_is_a_contact_that_can_be_lost_also_without_a_hand() {
        for axis in 0..3 {
            for (newtons, lost) in [(1.1, LOST), (-1.1, LOST), (0.9, 0.0)] {
                let mut force = [0.0; 3];
                force[axis] = newtons;
                assert!((released(force, 0.5, axis == 0) - lost).abs() < 0.01, "{force:?}");
            }
        }
        assert_eq!(released([0.7, 0.7, 0.3], 1.0, true), LOST);
    }

    #[test]
    fn contact_that_ends_after_the_movement_is_not_lost() {
        assert!(released([5.0, 0.0, 0.0], 1.001, true) < 0.01);
    }

    /// One control period of a run whose averages are `average` on every channel, and so are its values.
    fn settled(average: f64) -> Option<u8> {
        let values = [average; STATISTICS_CHANNELS];
        let mut watch = Watch { averages: values, ..Watch::new() };
        watch.step(&still([1.0; STATISTICS_CHANNELS]), 1.5, &values, false).map(|surprise| surprise.channel)
    }

    #[test]
    fn at_the_limit_nothing_is_told_one_bit_above_it_the_first_of_channels_that_deviate_alike() {
        assert_eq!(settled(LIMIT), None);
        assert_eq!(settled(LIMIT.next_up()), Some(0));
    }

    /// One control period of a contact whose averaged force is `force` (N), and so is that of this period; the largest
    /// so far was along Z, with this square (N^2). Gives the axis of a force that is gone.
    fn judged(force: [f64; 3], largest: f64, fingers: f64) -> (Option<usize>, Contact<f64>) {
        let mut contact = Contact { force, largest, axis: 2, fingers: Some([0.0; 3]), ..Contact::new() };
        let mut values = [0.0; STATISTICS_CHANNELS];
        values[..3].copy_from_slice(&force);
        values[FIRST_FINGER + 1] = fingers;
        (contact.step(0.5, &values, true), contact)
    }

    #[test]
    fn a_contact_is_more_than_a_newton_and_lost_below_a_seventh_of_it() {
        assert_eq!(judged([0.0; 3], CONTACT_SQUARE, 0.0).0, None);
        assert_eq!(judged([0.0; 3], CONTACT_SQUARE.next_up(), 0.0).0, Some(2));
        // A power of two: the shares are exact.
        assert_eq!(judged([8.0 * KEPT, 0.0, 0.0], 64.0, 0.0).0, None);
        assert_eq!(judged([(8.0 * KEPT).next_down(), 0.0, 0.0], 64.0, 0.0).0, Some(2));
    }

    #[test]
    fn a_hand_closes_once_a_finger_has_moved_by_more_than_a_tenth_of_a_radian() {
        for moved in [CLOSING, -CLOSING] {
            assert_eq!(judged([0.0; 3], 4.0, moved).0, Some(2));
            assert_eq!(judged([0.0; 3], 4.0, moved * 1.001).0, None);
        }
    }

    #[test]
    fn a_force_is_that_of_the_axis_along_which_it_was_largest_first() {
        assert_eq!(judged([0.0, 3.0, 3.0], 4.0, 0.0).1.axis, 1);
        assert_eq!(judged([0.0, 2.0, 0.0], 4.0, 0.0).1.axis, 2);
        assert_eq!(judged([0.0, 2.0_f64.next_up(), 0.0], 4.0, 0.0).1.axis, 1);
    }

    #[test]
    fn a_force_of_a_kilonewton_is_no_sample() {
        for (force, counts) in [(STRONGEST, false), (-STRONGEST, false), (STRONGEST.next_down(), true)] {
            let mut contact = Contact::new();
            let mut values = [0.0; STATISTICS_CHANNELS];
            values[1] = force;
            contact.step(0.5, &values, false);
            assert_eq!(contact.force[1] != 0.0, counts, "{force}");
        }
    }
}
