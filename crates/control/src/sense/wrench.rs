//! `WrenchEstimator`: raw force/torque counts to the wrench of the environment on the robot at the grasp point.
//!
//! The sensor reports what is mounted on it: the wrench of the hand on the sensor, in sensor axes, about the sensor's
//! origin. The weight of the hand is known from the model in every orientation and is taken off first; what the
//! environment does to the hand remains, with the hand's inertia, which the expectation of a primitive contains as
//! well. Filter (second-order Butterworth, 15 Hz, the same live and recorded) and tare act in sensor axes, and because
//! the weight is gone the tare is the sensor's bias and nothing else: it holds in every orientation. Then the force is
//! turned into world axes and the torque is moved to the grasp point, `n_g = n_s + (p_s - p_g) x f`, and turned into
//! tool axes: the frames of the position and orientation rows of Eq (8).

use nalgebra::Vector3;
use puck::RawWrench;

use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::real::{Real, sqrt};
use crate::sense::deviation::Deviation;
use crate::sense::drift::Drift;
use crate::sense::filter::{Butterworth, LowPass};
use crate::time::{RATE, periods};
use crate::units::{Vector6, Wrench};

/// Cut-off of the wrench filter (Hz).
pub const WRENCH_CUT_OFF: f64 = 15.0;

/// Largest change that is believed at once (N, N m), twelve times the noise of a difference of samples: a wild sample
/// of that size stays in the dead band of Eq (8). A larger change is believed with the second sample that shows one,
/// while every further one does: what truly changes fast is one cycle late, once.
const LARGEST_STEP: [f64; 6] = [1.0, 1.0, 1.0, 0.05, 0.05, 0.05];

/// Half of the time over which a resting wrench is averaged for the tare: 0.15 s, in control periods.
const REST_HALF: u16 = periods(0.15);

/// Largest drift (N) that an automatic tare takes away once the wrench has been tared: what is more is a load or a
/// contact.
const DRIFT: f64 = 1.0;

/// Largest force at rest (N) with which a run that uses force begins.
pub const REST_FORCE: f64 = 5.0;

/// Part of the sensor's range from which on a sample counts as full scale.
pub const FULL_SCALE: f64 = 0.99;

/// Largest force that a frame can carry (N).
const LARGEST_FORCE: f64 = 32_767.0 / 256.0;

/// Number of samples in a row at full scale.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FullScale {
    /// In a force.
    pub force: u8,
    /// In a torque.
    pub torque: u8,
}

/// Mean of the last 0.15 to 0.3 s at rest, from two blocks of samples.
#[derive(Clone, Copy, Debug)]
struct RestMean<R: Real> {
    sum: Vector6<R>,
    count: u16,
    /// Sum of the last whole block.
    block: Option<Vector6<R>>,
}

impl<R: Real> RestMean<R> {
    fn new() -> Self {
        RestMean { sum: Vector6::zeros(), count: 0, block: None }
    }

    fn push(&mut self, sample: &Vector6<R>) {
        self.sum += sample;
        self.count += 1;
        if self.count >= REST_HALF {
            *self = RestMean { sum: Vector6::zeros(), count: 0, block: Some(self.sum) };
        }
    }

    fn mean(&self) -> Option<Vector6<R>> {
        let samples = R::from_counts(i32::from(self.count + REST_HALF));
        self.block.map(|block| (block + self.sum) / samples)
    }
}

/// Filters, tares and places the measured wrench.
#[derive(Clone, Debug)]
pub struct WrenchEstimator<R: Real> {
    /// True if the last sample was far from the last believed one.
    jumped: bool,
    filter: LowPass<R, 6>,
    tare: Vector6<R>,
    /// The tare as it was taken, before anything was followed in a run.
    taken: Vector6<R>,
    tared: bool,
    /// Last believed sample, as the sensor gave it.
    last: Vector6<R>,
    /// The same without the weight of the hand.
    unloaded: Vector6<R>,
    /// True if the filter has had an input without the weight.
    placed: bool,
    rest: RestMean<R>,
    saturated: bool,
    full_scale: FullScale,
    age: Option<u8>,
}

impl<R: Real> WrenchEstimator<R> {
    /// An estimator that has not seen a wrench yet.
    pub fn new() -> Self {
        WrenchEstimator {
            jumped: false,
            filter: LowPass::new(Butterworth::new(WRENCH_CUT_OFF, RATE)),
            tare: Vector6::zeros(),
            taken: Vector6::zeros(),
            tared: false,
            last: Vector6::zeros(),
            unloaded: Vector6::zeros(),
            placed: false,
            rest: RestMean::new(),
            saturated: false,
            full_scale: FullScale::default(),
            age: None,
        }
    }

    /// Forgets what was measured, and keeps the tare: something may press on the sensor when it is heard again.
    pub fn restart(&mut self) {
        let (tare, taken, tared) = (self.tare, self.taken, self.tared);
        *self = WrenchEstimator { tare, taken, tared, ..WrenchEstimator::new() };
    }

    /// Forgets the tare: the next rest is the zero.
    pub fn forget_tare(&mut self) {
        self.tared = false;
        (self.tare, self.taken) = (Vector6::zeros(), Vector6::zeros());
    }

    /// Takes the sample of one cycle; a lost or bad one is bridged by the last.
    ///
    /// `weight` is what the hand alone does to the sensor in the present posture
    /// ([`ArmModel::hanging_weight`](crate::model::arm::ArmModel::hanging_weight)); without a posture only the age is
    /// kept.
    pub fn update(&mut self, sample: Option<&RawWrench>, weight: Option<&Vector6<R>>, at_rest: bool) {
        let believed = sample.filter(|raw| !raw.status.is_some_and(|status| status.is_bad()));
        match believed {
            Some(raw) => self.take(raw),
            None => {
                self.age = self.age.map(|age| age.saturating_add(1));
                // The sensor calls a sample bad whose gauges are at their end: no number, but something presses.
                let overloaded = |raw: &RawWrench| raw.status.is_some_and(|status| status.saturated_gauges() != 0);
                if sample.is_some_and(overloaded) {
                    self.saturated = true;
                    self.full_scale.force = self.full_scale.force.saturating_add(1);
                } else if sample.is_none() {
                    // One sample may be wild, and one that is not there does not confirm it.
                    self.full_scale = FullScale::default();
                }
            }
        }
        let (Some(weight), Some(age)) = (weight, self.age) else { return };
        self.unloaded = self.last - weight;
        if !self.placed {
            // Not a step from zero: a bias is there from the first sample on.
            self.filter.settle(&self.unloaded);
            self.placed = true;
        }
        self.filter.step(&self.unloaded);
        if !at_rest {
            self.rest = RestMean::new();
        } else if age == 0 {
            self.rest.push(&self.unloaded);
        }
    }

    fn take(&mut self, raw: &RawWrench) {
        let [fx, fy, fz] = raw.newtons::<R>();
        let [nx, ny, nz] = raw.newton_metres::<R>();
        let sample = Vector6::new(fx, fy, fz, nx, ny, nz);
        let beyond = |value: &R, limit: f64| *value > R::constant(limit) || *value < R::constant(-limit);
        let step = sample - self.last;
        let jumped = self.age.is_some() && step.iter().zip(&LARGEST_STEP).any(|(step, limit)| beyond(step, *limit));
        if self.jumped || !jumped {
            self.last = sample;
        }
        self.jumped = jumped;
        let at_end = |values: &[R], ranges: &[f64; 3]| {
            values.iter().zip(ranges).any(|(value, range)| beyond(value, FULL_SCALE * range.min(LARGEST_FORCE)))
        };
        let count = |so_far: u8, now: bool| if now { so_far.saturating_add(1) } else { 0 };
        self.full_scale.force = count(self.full_scale.force, at_end(&[fx, fy, fz], &wam7::SENSOR_FORCE_RANGE));
        self.full_scale.torque = count(self.full_scale.torque, at_end(&[nx, ny, nz], &wam7::SENSOR_TORQUE_RANGE));
        self.saturated = raw.status.is_some_and(|status| status.saturated_gauges() != 0);
        self.age = Some(0);
    }

    /// Returns the wrench that a tare would take as zero: the mean at rest, or the filtered value where the arm has
    /// just moved.
    fn offset(&self) -> Vector6<R> {
        self.rest.mean().unwrap_or(*self.filter.output())
    }

    /// Takes the present wrench, less the weight of the hand, as zero. False if none has been measured in a known
    /// posture.
    pub fn tare(&mut self) -> bool {
        if self.age.is_none() || !self.placed {
            return false;
        }
        self.tare = self.offset();
        self.taken = self.tare;
        self.tared = true;
        true
    }

    /// Tares at the first rest after start-up; later ones are asked for.
    pub fn tare_first(&mut self) {
        if !self.tared && self.rest.mean().is_some() {
            self.tare();
        }
    }

    /// Tares, unless the wrench has been tared already and differs from that by more than a sensor drifts: then the
    /// hand holds or touches something, which must stay in the wrench.
    pub fn tare_drift(&mut self) {
        // What was followed in a run may have been a slow touch: the tare before it counts as well.
        let near = |tare: &Vector6<R>| {
            let drift = (self.offset() - tare).fixed_rows::<3>(0).into_owned();
            drift.dot(&drift) <= R::constant(DRIFT * DRIFT)
        };
        if !self.tared || near(&self.tare) || near(&self.taken) {
            self.tare();
        }
    }

    /// The force at rest (N, sensor axes), tared.
    pub fn rest_force(&self) -> Vector3<R> {
        (self.offset() - self.tare).fixed_rows::<3>(0).into_owned()
    }

    /// True if the wrench has been tared.
    pub fn is_tared(&self) -> bool {
        self.tared
    }

    /// True if the last sample is at the end of the sensor's range, or a gauge has saturated since the sensor's own
    /// tare.
    pub fn is_saturated(&self) -> bool {
        self.saturated || self.full_scale != FullScale::default()
    }

    /// Number of samples in a row at full scale.
    pub fn full_scale(&self) -> FullScale {
        self.full_scale
    }

    /// Cycles since the last believed sample; `None` if there never was one.
    pub fn age(&self) -> Option<u8> {
        self.age
    }

    /// Magnitude of the last sample's force, unfiltered, without the weight of the hand, tared (N): for the contact
    /// threshold, which cannot wait for a filter.
    pub fn raw_force(&self) -> R {
        if !self.placed {
            return R::constant(0.0);
        }
        let force = self.unloaded.fixed_rows::<3>(0) - self.tare.fixed_rows::<3>(0);
        sqrt(force.dot(&force))
    }

    /// Tells by the deviation from the expected wrench whether something is touched, and moves the tare by as much of
    /// it as is an error of the sensor. Without an expectation nothing is expected, and the tare stays: the wrench
    /// has the inertia of the hand in it.
    ///
    /// Not inlined: it runs from flash on a board whose fast memory is full.
    #[inline(never)]
    pub fn follow(
        &mut self,
        drift: &mut Drift<R>,
        measured: &Wrench<R>,
        (deviation, has_ended): (Option<&Deviation<R>>, bool),
        frames: &Frames<R>,
    ) {
        let nothing = Wrench::zero();
        let expected = deviation.map_or(&nothing, |deviation| &deviation.expected);
        let to_world = frames.sensor_to_world();
        let force = measured.force - expected.force;
        let torque =
            frames.tool_to_world() * (measured.torque - expected.torque) - frames.tool_to_sensor().cross(&force);
        let (force, torque) = (to_world.tr_mul(&force), to_world.tr_mul(&torque));
        let change = Vector6::new(force.x, force.y, force.z, torque.x, torque.y, torque.z);
        drift.feel(&change, has_ended, deviation.is_some());
        if deviation.is_some() && drift.is_free() {
            self.tare += drift.follow(&change);
        }
    }

    /// The wrench of the environment on the robot at the grasp point; zero if none has been measured.
    pub fn wrench(&self, frames: &Frames<R>) -> Wrench<R> {
        if !self.placed {
            return Wrench::zero();
        }
        let tared = self.filter.output() - self.tare;
        let to_world = frames.sensor_to_world();
        let force = to_world * Vector3::new(tared[0], tared[1], tared[2]);
        let torque = to_world * Vector3::new(tared[3], tared[4], tared[5]) + frames.tool_to_sensor().cross(&force);
        Wrench { force, torque: frames.tool_to_world().tr_mul(&torque) }
    }
}

impl<R: Real> Default for WrenchEstimator<R> {
    fn default() -> Self {
        WrenchEstimator::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::arm::ArmModel;
    use crate::model::calibration::Payload;
    use crate::units::JointPositions;

    fn frames(q: [f64; 7]) -> Frames<f64> {
        Frames::new(&ArmModel::new(Payload::SensorAndHand), &JointPositions::from_array(q))
    }

    /// A sample of these errors (N, N m, sensor axes).
    fn sample(force: [f64; 3], torque: [f64; 3]) -> RawWrench {
        let counts = |values: [f64; 3], scale: f64| values.map(|value| (value * scale).round() as i16);
        RawWrench { force: counts(force, 256.0), torque: counts(torque, 4096.0), status: None }
    }

    /// A cycle of free motion, of which nothing is expected; returns the wrench.
    fn follow(
        estimator: &mut WrenchEstimator<f64>,
        drift: &mut Drift<f64>,
        raw: &RawWrench,
        frames: &Frames<f64>,
    ) -> Wrench<f64> {
        estimator.update(Some(raw), Some(&Vector6::zeros()), false);
        let measured = estimator.wrench(frames);
        let deviation = Deviation::new(&[0.0; 9], &measured, None);
        estimator.follow(drift, &measured, (Some(&deviation), false), frames);
        measured
    }

    fn tared() -> WrenchEstimator<f64> {
        let mut estimator = WrenchEstimator::new();
        for _ in 0..200 {
            estimator.update(Some(&sample([0.0; 3], [0.0; 3])), Some(&Vector6::zeros()), true);
        }
        assert!(estimator.tare());
        estimator
    }

    #[test]
    fn an_error_of_the_sensor_is_followed_in_its_own_axes_and_holds_when_the_hand_turns() {
        let (mut estimator, mut drift) = (tared(), Drift::new());
        let error = |share: f64| {
            sample([0.3, -0.2, 0.1].map(|force| force * share), [0.01, 0.02, -0.01].map(|torque| torque * share))
        };
        let before = frames([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
        for tick in 0..1500_u32 {
            follow(&mut estimator, &mut drift, &error(f64::min(f64::from(tick) / RATE, 1.0)), &before);
        }
        let turned = frames([0.3, 0.9, -0.4, 1.6, -1.5, 0.9, -1.0]);
        let left = follow(&mut estimator, &mut drift, &error(1.0), &turned);
        assert!(left.force.norm() < 0.01 && left.torque.norm() < 0.002, "{left:?}");
    }

    /// The inertia of a hand of which nothing is expected is measured as well, and is to be recorded.
    ///
    /// The change that makes it fail: the tare follows without an expectation.
    #[test]
    fn without_an_expectation_free_motion_is_told_and_the_tare_stays() {
        let (mut estimator, mut drift) = (tared(), Drift::new());
        let here = frames([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
        for _ in 0..900 {
            estimator.update(Some(&sample([0.3, 0.0, 0.0], [0.0; 3])), Some(&Vector6::zeros()), false);
            estimator.follow(&mut drift, &estimator.wrench(&here), (None, false), &here);
        }
        assert!(drift.is_free() && (estimator.wrench(&here).force.norm() - 0.3).abs() < 0.01);
    }

    #[test]
    fn a_slow_touch_that_was_taken_for_an_error_is_forgotten_at_the_next_rest() {
        let (mut estimator, mut drift) = (tared(), Drift::new());
        let here = frames([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
        for tick in 0..3000_u32 {
            let touch = f64::min(0.4 * f64::from(tick) / RATE, 1.9);
            follow(&mut estimator, &mut drift, &sample([touch, 0.0, 0.0], [0.0; 3]), &here);
        }
        for _ in 0..200 {
            estimator.update(Some(&sample([0.0; 3], [0.0; 3])), Some(&Vector6::zeros()), true);
        }
        assert!(estimator.rest_force().norm() > 1.5, "nothing was followed: {}", estimator.rest_force());
        estimator.tare_drift();
        assert!(estimator.rest_force().norm() < 0.01, "{}", estimator.rest_force());
    }
}
