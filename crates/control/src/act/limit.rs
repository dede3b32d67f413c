//! `TorqueLimiter`: the only maker of [`LimitedTorques`], and with it the only way to the motors.
//!
//! In this order: what is not finite is refused; each joint is cut to its own limit; each differential pair is scaled
//! until both of its motors are below their caps; the step from the last torque is cut to the rate limit, a pair by a
//! common fraction. The set of allowed torques is convex and the last torque lies in it, so the step never leaves it
//! again.
//!
//! Joint limits are the worst gravity torque of the arm with its hand plus what the manufacturer's own controllers
//! allow themselves (25, 20, 15, 15, 5, 5, 5 N m): those add gravity after their limit, and the outstretched arm alone
//! needs 41 N m at J2. The motor caps lie below the safety module's warning (TL1 = 4731 counts) and the pucks' own cap
//! (MT).

use puck::Transmission;

use crate::model::calibration::Calibration;
use crate::model::wam7;
use crate::real::{Real, within};
use crate::time::periods;
use crate::units::{JOINTS, JointTorques, Vector7};

/// Worst gravity torque over all postures, with sensor and hand (N m), rounded up. A test recomputes it.
pub const WORST_GRAVITY: [f64; JOINTS] = [0.0, 41.5, 13.0, 11.0, 1.9, 1.9, 0.2];

/// The manufacturer's full scale (N m).
const FULL_SCALE: [f64; JOINTS] = [25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0];

/// Largest change of torque (N m per control period): full scale in 50 ms.
pub const STEP_LIMIT: [f64; JOINTS] = {
    let [j1, j2, j3, j4, j5, j6, j7] = FULL_SCALE;
    let cycles = periods(0.05) as f64;
    [j1 / cycles, j2 / cycles, j3 / cycles, j4 / cycles, j5 / cycles, j6 / cycles, j7 / cycles]
};

/// Largest torque of a puck (counts of its torque unit): below the safety module's warning of 4731 and its limit of
/// 5204.
pub const MOTOR_COUNTS_LIMIT: f64 = 4600.0;

/// Joints that share motors.
const GROUPS: [&[usize]; 5] = [&[0], &[1, 2], &[3], &[4, 5], &[6]];

/// Joints whose torques travel in the first frame of a cycle: no pair of motors is parted.
const ARM_JOINTS: usize = 4;

/// Joint torques within every limit. No public constructor: the limiter makes them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LimitedTorques<R: Real>(JointTorques<R>);

impl<R: Real> LimitedTorques<R> {
    /// The torques (N m).
    pub fn torques(&self) -> &JointTorques<R> {
        &self.0
    }
}

/// Limits that acted in one cycle.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitReport {
    /// A joint was cut to its own limit.
    pub joint: bool,
    /// A pair was scaled for its motors.
    pub motor: bool,
    /// A step was cut.
    pub rate: bool,
    /// A torque was not finite; the last torque was kept.
    pub not_finite: bool,
}

impl LimitReport {
    /// True if a limit cut the torque: of a joint, a motor, or the rate.
    pub const fn is_cut(&self) -> bool {
        self.joint || self.motor || self.rate
    }
}

/// Cuts torques to what joints, motors and cables bear.
#[derive(Clone, Debug)]
pub struct TorqueLimiter<R: Real> {
    transmission: Transmission<R>,
    joint_limit: [R; JOINTS],
    motor_limit: [R; JOINTS],
    step_limit: [R; JOINTS],
    last: JointTorques<R>,
    /// The torques before the last, in case those do not leave.
    before: JointTorques<R>,
}

impl<R: Real> TorqueLimiter<R> {
    /// A limiter for this arm, at zero torque.
    pub fn new(calibration: &Calibration<R>) -> Self {
        let mut joint_limit = [R::constant(0.0); JOINTS];
        let mut motor_limit = [R::constant(0.0); JOINTS];
        for joint in 0..JOINTS {
            let wanted = WORST_GRAVITY[joint] + wam7::CONTROL_SIGNAL_LIMIT[joint];
            joint_limit[joint] = R::constant(wanted.min(wam7::TORQUE_MAX[joint]));
            let units = f64::from(calibration.drives.units_per_newton_metre()[joint]);
            motor_limit[joint] = R::constant(wam7::MOTOR_TORQUE_MAX[joint].min(MOTOR_COUNTS_LIMIT / units));
        }
        TorqueLimiter {
            transmission: calibration.transmission,
            joint_limit,
            motor_limit,
            step_limit: STEP_LIMIT.map(R::constant),
            last: JointTorques::zero(),
            before: JointTorques::zero(),
        }
    }

    /// Back to zero torque at once: nothing is being sent, so the next torque starts from nothing.
    pub fn reset(&mut self) {
        self.last = JointTorques::zero();
        self.before = self.last;
    }

    /// Torques of the last cycle did not leave: those of J1 to J4, those of J5 to J7. The motors still have the torques
    /// before, so the next step counts from these.
    pub fn not_sent(&mut self, arm: bool, wrist: bool) {
        for (joint, (last, before)) in self.last.0.iter_mut().zip(&self.before.0).enumerate() {
            if if joint < ARM_JOINTS { arm } else { wrist } {
                *last = *before;
            }
        }
    }

    /// The torques of the last cycle.
    pub fn last(&self) -> LimitedTorques<R> {
        LimitedTorques(self.last)
    }

    /// Limits per joint (N m).
    pub fn joint_limits(&self) -> &[R; JOINTS] {
        &self.joint_limit
    }

    /// Limits per motor (N m at the motor).
    pub fn motor_limits(&self) -> &[R; JOINTS] {
        &self.motor_limit
    }

    /// Cuts the wanted torques of one cycle.
    pub fn limit(&mut self, wanted: &JointTorques<R>) -> (LimitedTorques<R>, LimitReport) {
        let mut report = LimitReport::default();
        self.before = self.last;
        if !wanted.is_finite() {
            report.not_finite = true;
            return (LimitedTorques(self.last), report);
        }
        let mut torques = wanted.0;
        for (torque, limit) in torques.iter_mut().zip(&self.joint_limit) {
            let cut = within(*torque, *limit);
            report.joint |= cut != *torque;
            *torque = cut;
        }
        report.motor = self.scale_to_motors(&mut torques);
        report.rate = self.cut_steps(&mut torques);
        self.last = JointTorques(torques);
        (LimitedTorques(self.last), report)
    }

    /// Scales each group until its motors are within their caps; true if it had to.
    fn scale_to_motors(&self, torques: &mut Vector7<R>) -> bool {
        let motors = self.transmission.motor_torques_from_joint(&(*torques).into());
        let mut scaled = false;
        for group in GROUPS {
            let mut factor = R::constant(1.0);
            // Motors have the numbers of the joints they drive: M2, M3 drive J2, J3, and M5, M6 drive J5, J6.
            for &motor in group {
                let magnitude = magnitude(motors[motor]);
                if magnitude * factor > self.motor_limit[motor] {
                    factor = self.motor_limit[motor] / magnitude;
                    scaled = true;
                }
            }
            for &joint in group {
                torques[joint] *= factor;
            }
        }
        scaled
    }

    /// Cuts the way from the last torques to the rate limit, a group by a common fraction; true if it had to.
    fn cut_steps(&self, torques: &mut Vector7<R>) -> bool {
        let mut cut = false;
        for group in GROUPS {
            let mut fraction = R::constant(1.0);
            for &joint in group {
                let step = magnitude(torques[joint] - self.last.0[joint]);
                if step * fraction > self.step_limit[joint] {
                    fraction = self.step_limit[joint] / step;
                    cut = true;
                }
            }
            if fraction < R::constant(1.0) {
                for &joint in group {
                    let from = self.last.0[joint];
                    torques[joint] = from + (torques[joint] - from) * fraction;
                }
            }
        }
        cut
    }
}

fn magnitude<R: Real>(value: R) -> R {
    if value < R::constant(0.0) { -value } else { value }
}
