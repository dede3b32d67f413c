//! `JointEstimator`: motor counts to joint positions and velocities, through lost and implausible replies.
//!
//! Positions come from the unwrapped counts of each motor. Velocities are the difference of whole counts over the time
//! that really passed since the last reply, through the transmission, low-passed at 50 Hz (second-order Butterworth,
//! delay 4.5 ms). One count is 3.7e-5 rad at J1 and 1.0e-4 rad at J7, which plain differencing at 300 Hz turns into
//! steps of 0.011 and
//! 0.031 rad/s; the noise of differencing lies near half the sampling rate, and behind the 50 Hz filter it is 8 times
//! smaller. At 30 Hz the delay would already cost the wrist its damping (stiff gains, three cycles of delay).
//!
//! A reply is believed if the motor cannot have moved farther: 1.5 times its speed limit, per cycle since the last
//! reply. Missing motors are carried on at the velocity estimated last, for at most [`COAST_CYCLES`]; then they stand
//! still.

use puck::{Counts, Transmission};

use crate::model::calibration::Calibration;
use crate::model::wam7;
use crate::real::Real;
use crate::sense::filter::{Butterworth, LowPass};
use crate::time::{PERIOD, RATE, few_periods};
use crate::units::{JOINTS, JointPositions, JointVelocities, Vector7};

/// Time without a reply that is bridged by extrapolation: 16.7 ms, in control periods.
pub const COAST_CYCLES: u8 = few_periods(1.0 / 60.0);

/// Cut-off of the velocity filter (Hz).
pub const VELOCITY_CUT_OFF: f64 = 50.0;

/// A motor is not believed to move faster than this many times its speed limit.
const PLAUSIBLE_SPEED: f64 = 1.5;

/// State of one motor.
#[derive(Clone, Copy, Debug)]
struct Motor {
    /// Unwrapped counts of the last reply believed.
    counts: Counts,
    /// Cycles since then.
    age: u8,
    /// Last reply that was not believed, for taking up a motor again while no torque is on.
    doubtful: Option<Counts>,
}

/// Joint state of one cycle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointState<R: Real> {
    /// Positions (rad).
    pub q: JointPositions<R>,
    /// Filtered velocities (rad/s).
    pub dq: JointVelocities<R>,
    /// Motors without a believed reply in this cycle.
    pub missing: u8,
    /// Largest number of cycles since a believed reply.
    pub age: u8,
    /// True if a reply of this cycle was implausible.
    pub implausible: bool,
}

/// Estimates joint positions and velocities from motor counts.
#[derive(Clone, Debug)]
pub struct JointEstimator<R: Real> {
    transmission: Transmission<R>,
    radians_per_count: Vector7<R>,
    counts_per_radian: Vector7<R>,
    gate: [i32; JOINTS],
    motors: Option<[Motor; JOINTS]>,
    /// Counts per cycle of each motor, from the filtered velocity.
    rates: Vector7<R>,
    filter: LowPass<R, JOINTS>,
}

impl<R: Real> JointEstimator<R> {
    /// An estimator that has not seen a position yet.
    pub fn new(calibration: &Calibration<R>) -> Self {
        let mut radians_per_count = Vector7::zeros();
        let mut counts_per_radian = Vector7::zeros();
        let mut gate = [0; JOINTS];
        for motor in 0..JOINTS {
            let counts = f64::from(calibration.drives.counts_per_revolution()[motor]);
            radians_per_count[motor] = R::of(core::f64::consts::TAU / counts);
            counts_per_radian[motor] = R::of(counts / core::f64::consts::TAU);
            // Joint limits through the absolute values of the transmission: the fastest this motor can be asked to
            // turn.
            let fastest: f64 = wam7::JOINT_TO_MOTOR[motor]
                .iter()
                .zip(&wam7::VELOCITY_MAX)
                .map(|(ratio, limit)| (if *ratio < 0.0 { -ratio } else { *ratio }) * limit)
                .sum();
            gate[motor] = (PLAUSIBLE_SPEED * fastest * PERIOD * counts / core::f64::consts::TAU) as i32 + 1;
        }
        JointEstimator {
            transmission: calibration.transmission,
            radians_per_count,
            counts_per_radian,
            gate,
            motors: None,
            rates: Vector7::zeros(),
            filter: LowPass::new(Butterworth::new(VELOCITY_CUT_OFF, RATE)),
        }
    }

    /// Forgets everything; the next complete set of replies starts anew.
    pub fn reset(&mut self) {
        self.motors = None;
        self.rates = Vector7::zeros();
        self.filter.settle(&Vector7::zeros());
    }

    /// Takes the replies of one cycle. `None` until all seven motors have answered once in the same cycle.
    ///
    /// Where `torque_on` is false, a motor that was silent for long or jumped is taken up again after two replies that
    /// agree with each other; with torque on it never is, because a wrong position means a wrong torque.
    pub fn update(&mut self, replies: &[Option<Counts>; JOINTS], torque_on: bool) -> Option<JointState<R>> {
        let Some(motors) = &mut self.motors else {
            return self.begin(replies);
        };
        let mut missing = 0;
        let mut age = 0;
        let mut implausible = false;
        let mut angles = Vector7::zeros();
        let mut rates = Vector7::zeros();
        for (index, (motor, reply)) in motors.iter_mut().zip(replies).enumerate() {
            let elapsed = motor.age.saturating_add(1);
            let accepted = reply.map(|raw| raw.unwrapped_near(motor.counts)).and_then(|counts| {
                let moved = counts.0.wrapping_sub(motor.counts.0);
                let reach = self.gate[index] * i32::from(elapsed.min(COAST_CYCLES + 1));
                if moved.unsigned_abs() <= reach.unsigned_abs() {
                    return Some((counts, R::from_counts(moved) / R::from_counts(i32::from(elapsed))));
                }
                implausible = true;
                let agrees = motor.doubtful.is_some_and(|before| {
                    counts.0.wrapping_sub(before.0).unsigned_abs() <= self.gate[index].unsigned_abs()
                });
                motor.doubtful = Some(counts);
                (agrees && !torque_on).then_some((counts, R::of(0.0)))
            });
            let carried = match accepted {
                Some((counts, rate)) => {
                    *motor = Motor { counts, age: 0, doubtful: None };
                    rates[index] = rate;
                    R::of(0.0)
                }
                None => {
                    motor.age = elapsed;
                    missing += 1;
                    let bridged = elapsed.min(COAST_CYCLES);
                    rates[index] = if elapsed > COAST_CYCLES { R::of(0.0) } else { self.rates[index] };
                    self.rates[index] * R::from_counts(i32::from(bridged))
                }
            };
            age = age.max(motor.age);
            angles[index] = (R::from_counts(motor.counts.0) + carried) * self.radians_per_count[index];
        }
        let q = self.transmission.joint_from_motor(&angles.into());
        let speeds = rates.component_mul(&self.radians_per_count) * R::of(RATE);
        let dq = self.filter.step(&Vector7::from(self.transmission.joint_from_motor(&speeds.into())));
        if missing == 0 {
            let motor_speeds = Vector7::from(self.transmission.motor_from_joint(&dq.into()));
            self.rates = motor_speeds.component_mul(&self.counts_per_radian) * R::of(PERIOD);
        }
        Some(JointState { q: JointPositions::from_array(q), dq: JointVelocities(dq), missing, age, implausible })
    }

    /// The first complete set of replies.
    fn begin(&mut self, replies: &[Option<Counts>; JOINTS]) -> Option<JointState<R>> {
        let mut motors = [Motor { counts: Counts(0), age: 0, doubtful: None }; JOINTS];
        let mut angles = Vector7::zeros();
        for (index, (motor, reply)) in motors.iter_mut().zip(replies).enumerate() {
            motor.counts = (*reply)?.wrapped();
            angles[index] = R::from_counts(motor.counts.0) * self.radians_per_count[index];
        }
        self.motors = Some(motors);
        let q = self.transmission.joint_from_motor(&angles.into());
        Some(JointState {
            q: JointPositions::from_array(q),
            dq: JointVelocities::zero(),
            missing: 0,
            age: 0,
            implausible: false,
        })
    }
}
