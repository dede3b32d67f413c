//! `WrenchEstimator`: raw force/torque counts to the wrench of the environment on the robot at the grasp point.
//!
//! The sensor reports what is mounted on it: the wrench of the hand on the sensor, in sensor axes, about the sensor's origin.
//! That is the wrench of the environment on the robot, plus the weight and inertia of the hand, which the expectation of a
//! primitive contains as well. Filter (second-order Butterworth, 15 Hz, the same live and recorded) and tare act in sensor
//! axes; then the force is turned into world axes and the torque is moved to the grasp point, `n_g = n_s + (p_s - p_g) x f`,
//! and turned into tool axes: the frames of the position and orientation rows of Eq (8).

use nalgebra::Vector3;
use puck::RawWrench;

use crate::cycle::RATE;
use crate::filter::{Butterworth, LowPass};
use crate::kinematics::Frames;
use crate::real::Real;
use crate::units::{Vector6, Wrench};

/// Cut-off of the wrench filter (Hz).
pub const WRENCH_CUT_OFF: f64 = 15.0;

/// Largest believed change from one sample to the next (N, N m). A larger one is believed when the next sample confirms it:
/// one corrupt sample must not bend the plan.
const LARGEST_STEP: [f64; 6] = [20.0, 20.0, 20.0, 1.0, 1.0, 1.0];

/// Filters, tares and places the measured wrench.
#[derive(Clone, Debug)]
pub struct WrenchEstimator<R: Real> {
    doubtful: bool,
    filter: LowPass<R, 6>,
    tare: Vector6<R>,
    tared: bool,
    last: Vector6<R>,
    age: Option<u8>,
}

impl<R: Real> WrenchEstimator<R> {
    /// An estimator that has not seen a wrench yet.
    pub fn new() -> Self {
        WrenchEstimator {
            doubtful: false,
            filter: LowPass::new(Butterworth::new(WRENCH_CUT_OFF, RATE)),
            tare: Vector6::zeros(),
            tared: false,
            last: Vector6::zeros(),
            age: None,
        }
    }

    /// Takes the sample of one cycle; a lost one is bridged by the last.
    pub fn update(&mut self, sample: Option<&RawWrench>) {
        let believed = sample.filter(|raw| !raw.status.is_some_and(|status| status.is_bad()));
        match believed {
            Some(raw) => {
                let [fx, fy, fz] = raw.newtons::<R>();
                let [nx, ny, nz] = raw.newton_metres::<R>();
                let sample = Vector6::new(fx, fy, fz, nx, ny, nz);
                let step = sample - self.last;
                let jumped = self.age.is_some()
                    && step
                        .iter()
                        .zip(&LARGEST_STEP)
                        .any(|(step, limit)| *step > R::of(*limit) || *step < R::of(-*limit));
                self.doubtful = jumped && !self.doubtful;
                if !self.doubtful {
                    self.last = sample;
                }
                if self.age.is_none() {
                    // Not a step from zero: the weight of the hand is there from the first sample on.
                    self.filter.settle(&self.last);
                }
                self.age = Some(0);
            }
            None => self.age = self.age.map(|age| age.saturating_add(1)),
        }
        if self.age.is_some() {
            self.filter.step(&self.last);
        }
    }

    /// Takes the present filtered wrench as zero. False if none has been measured.
    pub fn tare(&mut self) -> bool {
        if self.age.is_none() {
            return false;
        }
        self.tare = *self.filter.output();
        self.tared = true;
        true
    }

    /// Whether the wrench has been tared.
    pub fn is_tared(&self) -> bool {
        self.tared
    }

    /// Cycles since the last believed sample; `None` if there never was one.
    pub fn age(&self) -> Option<u8> {
        self.age
    }

    /// Magnitude of the last sample's force, unfiltered and tared (N): for the contact threshold, which cannot wait for a
    /// filter.
    pub fn raw_force(&self) -> R {
        if self.age.is_none() {
            return R::of(0.0);
        }
        let felt = self.last.fixed_rows::<3>(0) - self.tare.fixed_rows::<3>(0);
        felt.dot(&felt).square_root()
    }

    /// The wrench of the environment on the robot at the grasp point; zero if none has been measured.
    pub fn wrench(&self, frames: &Frames<R>) -> Wrench<R> {
        if self.age.is_none() {
            return Wrench::zero();
        }
        let felt = self.filter.output() - self.tare;
        let to_world = frames.sensor_to_world();
        let force = to_world * Vector3::new(felt[0], felt[1], felt[2]);
        let torque = to_world * Vector3::new(felt[3], felt[4], felt[5]) + frames.tool_to_sensor().cross(&force);
        Wrench { force, torque: frames.tool_to_world().tr_mul(&torque) }
    }
}

impl<R: Real> Default for WrenchEstimator<R> {
    fn default() -> Self {
        WrenchEstimator::new()
    }
}
