//! `JointEstimator`: motor counts to joint positions and velocities, through lost and implausible replies.
//!
//! Positions come from the unwrapped counts of each motor. Velocities are the difference of whole counts over the time
//! that really passed since the last reply, through the transmission, low-passed at 50 Hz (second-order Butterworth,
//! delay 4.5 ms). One count is 3.7e-5 rad at J1 and 1.0e-4 rad at J7, which plain differencing at 300 Hz turns into
//! steps of 0.011 and 0.031 rad/s; the noise of differencing lies near half the sampling rate, and behind the 50 Hz
//! filter it is 8 times smaller. At 30 Hz the delay would already cost the wrist its damping (stiff gains, three cycles
//! of delay).
//!
//! A reply is believed if it lies where the motor can have turned to: at its last speed, stopped dead, or in between,
//! changed by at most 1.5 times its speed limit a cycle. A person who shoves the arm stays within that at any speed,
//! into a mechanical stop too; a puck that begins to count anew does not. Two replies that agree with each other but
//! not with the ones before are a jump: the position goes on from where the motor was carried to, the speed is
//! measured, and the joint state says that the zero is lost ([`JointState::displaced`]). Missing motors are carried on
//! at the velocity estimated last, for at most [`COAST_CYCLES`]; then they stand still.

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

/// Largest change of a motor's speed from one cycle to the next, in parts of its speed limit: 450 times the limit per
/// second, several times what a blow to the hand can do. Smaller, and a shove counts as a jump; larger, and a jump
/// counts as motion.
const PLAUSIBLE_CHANGE: f64 = 1.5;

/// Largest change of a motor's speed that is believed once the next reply confirms it, in parts of
/// [`PLAUSIBLE_CHANGE`]: a joint of the wrist that hits its stop sets its neighbour turning within a cycle.
const HARDEST_BLOW: u32 = 4;

/// Part of the largest change of speed from which on a motor of the arm turns too fast to stand still, to the count, in
/// the next cycle: nothing but an encoder stops so dead, or a joint that is led into its stop.
const TURNING: i32 = 8;

/// The same where a plan turns it, which keeps off the stops.
const PLANNED: i32 = 16;

/// Motors of the arm. A blow can stop those of the wrist dead, they have little to carry.
const ARM_MOTORS: usize = 4;

/// Joints that each motor turns, one bit each, J1 lowest.
const TURNED: [u8; JOINTS] = [0b1, 0b110, 0b110, 0b1000, 0b11_0000, 0b11_0000, 0b100_0000];

/// State of one motor.
#[derive(Clone, Copy, Debug)]
struct Motor {
    /// Unwrapped counts of the last reply believed, offset included.
    counts: Counts,
    /// Counts added to every reply: what the motor jumped by while torque was on.
    offset: i32,
    /// Counts per cycle between the last two replies believed.
    step: i32,
    /// Cycles since the last reply believed.
    age: u8,
    /// Reply of the last cycle that was not believed, offset included.
    doubtful: Option<Counts>,
}

/// A reply that is believed.
struct Believed<R> {
    /// Counts per cycle since the reply before.
    rate: R,
    /// True if it only agrees with the reply before, which was not believed.
    jumped: bool,
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
    /// Joints that such a motor turns, one bit each, J1 lowest.
    pub extrapolated: u8,
    /// Largest number of cycles since a believed reply.
    pub age: u8,
    /// True if a reply of this cycle was implausible.
    pub implausible: bool,
    /// True if a motor that turned fast has not changed by a count since: its encoder stands still.
    pub stuck: bool,
    /// Motors whose believed reply did not change by a count, one bit each, M1 lowest.
    pub still: u8,
    /// True from a jump of a motor on until the estimator begins anew: the positions no longer refer to the zero of the
    /// arm.
    pub displaced: bool,
}

impl<R: Real> JointState<R> {
    /// All motors measured, moving and believed.
    pub fn whole(q: JointPositions<R>, dq: JointVelocities<R>) -> Self {
        JointState {
            q,
            dq,
            missing: 0,
            extrapolated: 0,
            age: 0,
            implausible: false,
            stuck: false,
            still: 0,
            displaced: false,
        }
    }
}

/// Estimates joint positions and velocities from motor counts.
#[derive(Clone, Debug)]
pub struct JointEstimator<R: Real> {
    transmission: Transmission<R>,
    radians_per_count: Vector7<R>,
    counts_per_radian: Vector7<R>,
    gate: [i32; JOINTS],
    motors: Option<[Motor; JOINTS]>,
    displaced: bool,
    unseen: bool,
    follows_plan: bool,
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
            radians_per_count[motor] = R::constant(core::f64::consts::TAU / counts);
            counts_per_radian[motor] = R::constant(counts / core::f64::consts::TAU);
            // Joint limits through the absolute values of the transmission: the fastest this motor can be asked to
            // turn.
            let fastest: f64 = wam7::JOINT_TO_MOTOR[motor]
                .iter()
                .zip(&wam7::VELOCITY_MAX)
                .map(|(ratio, limit)| (if *ratio < 0.0 { -ratio } else { *ratio }) * limit)
                .sum();
            gate[motor] = (PLAUSIBLE_CHANGE * fastest * PERIOD * counts / core::f64::consts::TAU) as i32 + 1;
        }
        JointEstimator {
            transmission: calibration.transmission,
            radians_per_count,
            counts_per_radian,
            gate,
            motors: None,
            displaced: false,
            unseen: false,
            follows_plan: false,
            rates: Vector7::zeros(),
            filter: LowPass::new(Butterworth::new(VELOCITY_CUT_OFF, RATE)),
        }
    }

    /// Forgets everything; the next complete set of replies starts anew.
    pub fn reset(&mut self) {
        self.motors = None;
        (self.displaced, self.unseen) = (false, false);
        self.rates = Vector7::zeros();
        self.filter.settle(&Vector7::zeros());
    }

    /// The last believed counts of each motor, as its puck told them, and the cycles since; `None` before all have
    /// answered.
    pub fn last_counts(&self) -> Option<[(Counts, u8); JOINTS]> {
        let told = |motor: &Motor| (Counts(motor.counts.0.wrapping_sub(motor.offset)), motor.age);
        self.motors.as_ref().map(|motors| motors.each_ref().map(told))
    }

    /// True from a jump of a motor on until a reset: see [`JointState::displaced`].
    pub fn is_displaced(&self) -> bool {
        self.displaced
    }

    /// The positions do not refer to the zero of the arm, as after a jump: until a reset.
    pub fn displace(&mut self) {
        self.displaced = true;
    }

    /// A joint moves and nobody sees how far: its encoder stands still. The positions do not refer to the zero of the
    /// arm any longer, until a reset.
    pub fn lose_sight(&mut self) {
        (self.displaced, self.unseen) = (true, true);
    }

    /// True from [`JointEstimator::lose_sight`] on until a reset.
    pub fn has_lost_sight(&self) -> bool {
        self.unseen
    }

    /// Says if a plan turns the joints: then a motor stands still sooner than it can.
    pub fn expect_plan(&mut self, follows: bool) {
        self.follows_plan = follows;
    }

    /// Takes the replies of one cycle. `None` until all seven motors have answered once in the same cycle.
    ///
    /// A jump is carried over where `torque_on` is true, because a step of the position would be a step of the torque.
    /// Where it is false, or where the motor was silent for long and can have turned so far, the counts are taken as
    /// they are.
    pub fn update(&mut self, replies: &[Option<Counts>; JOINTS], torque_on: bool) -> Option<JointState<R>> {
        let Some(motors) = &mut self.motors else {
            return self.begin(replies);
        };
        let turning = if self.follows_plan { PLANNED } else { TURNING };
        let (mut missing, mut extrapolated) = (0, 0);
        let mut age = 0;
        let mut implausible = false;
        let (mut stuck, mut still) = (false, 0);
        let mut angles = Vector7::zeros();
        let mut rates = Vector7::zeros();
        for (index, (motor, reply)) in motors.iter_mut().zip(replies).enumerate() {
            let gate = self.gate[index];
            let frozen =
                torque_on && index < ARM_MOTORS && reply.is_some_and(|raw| motor.is_frozen(raw, gate, turning));
            stuck |= frozen;
            let believed = reply.filter(|_| !frozen).and_then(|raw| motor.judge::<R>(raw, gate, torque_on));
            // By the way since the last reply, not by the whole counts per cycle: one count in two cycles is a motion.
            still |= u8::from(believed.as_ref().is_some_and(|believed| believed.rate == R::constant(0.0))) << index;
            implausible |= motor.doubtful.is_some() || believed.as_ref().is_some_and(|believed| believed.jumped);
            let carried = match believed {
                Some(believed) => {
                    self.displaced |= believed.jumped;
                    rates[index] = believed.rate;
                    R::constant(0.0)
                }
                None => {
                    motor.age = motor.age.saturating_add(1);
                    missing += 1;
                    extrapolated |= TURNED[index];
                    let bridged = motor.age.min(COAST_CYCLES);
                    rates[index] = if motor.age > COAST_CYCLES { R::constant(0.0) } else { self.rates[index] };
                    self.rates[index] * R::from_counts(i32::from(bridged))
                }
            };
            age = age.max(motor.age);
            angles[index] = (R::from_counts(motor.counts.0) + carried) * self.radians_per_count[index];
        }
        let q = self.transmission.joint_from_motor(&angles.into());
        let speeds = rates.component_mul(&self.radians_per_count) * R::constant(RATE);
        let dq = self.filter.step(&Vector7::from(self.transmission.joint_from_motor(&speeds.into())));
        if missing == 0 {
            let motor_speeds = Vector7::from(self.transmission.motor_from_joint(&dq.into()));
            self.rates = motor_speeds.component_mul(&self.counts_per_radian) * R::constant(PERIOD);
        }
        let displaced = self.displaced;
        Some(JointState {
            q: JointPositions::from_array(q),
            dq: JointVelocities(dq),
            missing,
            extrapolated,
            age,
            implausible,
            stuck,
            still,
            displaced,
        })
    }

    /// The first complete set of replies.
    fn begin(&mut self, replies: &[Option<Counts>; JOINTS]) -> Option<JointState<R>> {
        let mut motors = [Motor::AT_REST; JOINTS];
        let mut angles = Vector7::zeros();
        for (index, (motor, reply)) in motors.iter_mut().zip(replies).enumerate() {
            motor.counts = (*reply)?.wrapped();
            angles[index] = R::from_counts(motor.counts.0) * self.radians_per_count[index];
        }
        self.motors = Some(motors);
        let q = self.transmission.joint_from_motor(&angles.into());
        let rest = JointState::whole(JointPositions::from_array(q), JointVelocities::zero());
        Some(JointState { displaced: self.displaced, ..rest })
    }
}

impl Motor {
    const AT_REST: Motor = Motor { counts: Counts(0), offset: 0, step: 0, age: 0, doubtful: None };

    /// True if the motor turned fast and this reply says that it stands where it was. Not beyond the speeds of its own:
    /// who throws the arm into a stop is believed. For as long as a bridge lasts: then it is taken as it is.
    fn is_frozen(&self, raw: Counts, gate: i32, turning: i32) -> bool {
        let step = self.step.saturating_abs();
        self.age <= COAST_CYCLES
            && step <= gate
            && step * turning > gate
            && raw.unwrapped_near(Counts(self.counts.0.wrapping_sub(self.offset))).0.wrapping_add(self.offset)
                == self.counts.0
    }

    /// Takes a reply; `None` if it is not believed yet. `gate` is the largest change of the counts per cycle.
    fn judge<R: Real>(&mut self, raw: Counts, gate: i32, torque_on: bool) -> Option<Believed<R>> {
        let elapsed = self.age.saturating_add(1);
        let before = Counts(self.counts.0.wrapping_sub(self.offset));
        let counts = Counts(raw.unwrapped_near(before).0.wrapping_add(self.offset));
        let moved = counts.0.wrapping_sub(self.counts.0);
        let bridged = i32::from(elapsed.min(COAST_CYCLES + 1));
        let carried = self.step.saturating_mul(i32::from(elapsed.min(COAST_CYCLES)));
        if is_within(moved, carried, gate.saturating_mul(bridged)) {
            let cycles = i32::from(elapsed);
            *self = Motor { counts, step: moved / cycles, age: 0, doubtful: None, ..*self };
            return Some(Believed { rate: R::from_counts(moved) / R::from_counts(cycles), jumped: false });
        }
        self.doubt(counts, carried, gate, torque_on)
    }

    /// Weighs a reply that does not fit the ones before; `None` if it does not fit the last doubtful one either. Not
    /// inlined: it is rare.
    #[inline(never)]
    fn doubt<R: Real>(&mut self, counts: Counts, carried: i32, gate: i32, torque_on: bool) -> Option<Believed<R>> {
        let elapsed = self.age.saturating_add(1);
        let moved = counts.0.wrapping_sub(self.counts.0);
        let doubtful = self.doubtful.replace(counts);
        let since = doubtful.map(|doubtful| counts.0.wrapping_sub(doubtful.0));
        if let (2, Some(doubtful), Some(step)) = (elapsed, doubtful, since) {
            let first = doubtful.0.wrapping_sub(self.counts.0);
            let same = step.wrapping_sub(first).unsigned_abs() <= gate.unsigned_abs();
            if same && first.unsigned_abs() <= gate.unsigned_abs().saturating_mul(HARDEST_BLOW) {
                // A jump is over after one reply; what goes on as it began is motion.
                *self = Motor { counts, step, age: 0, doubtful: None, ..*self };
                return Some(Believed { rate: R::from_counts(step), jumped: false });
            }
        }
        let step = since.filter(|step| is_within(*step, self.step, gate))?;
        let can_have_turned = moved.unsigned_abs() <= gate.unsigned_abs().saturating_mul(u32::from(elapsed));
        let counts = if torque_on && !can_have_turned { Counts(self.counts.0.wrapping_add(carried)) } else { counts };
        let shift = counts.0.wrapping_sub(self.counts.0.wrapping_add(moved));
        *self = Motor { counts, offset: self.offset.wrapping_add(shift), step, age: 0, doubtful: None };
        Some(Believed { rate: R::from_counts(step), jumped: true })
    }
}

/// True if a motor that was to move by `carried` can have moved by `moved`: stopped dead by an obstacle and thrown back
/// by half, going on, or anything in between, and that changed by `gate`.
fn is_within(moved: i32, carried: i32, gate: i32) -> bool {
    let thrown_back = -(carried / 2);
    let (low, high) = if carried < 0 { (carried, thrown_back) } else { (thrown_back, carried) };
    moved >= low.saturating_sub(gate) && moved <= high.saturating_add(gate)
}
