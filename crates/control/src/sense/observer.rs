//! `MotionObserver`: velocity of the joints, from the torque that was sent and the model of the arm, slowly corrected
//! by what is measured.
//!
//! A velocity that is differentiated from encoders shows the swing of the cables, late: fed back, it drives them. The
//! model has no cables. What it predicts from the torque is fast, and what is measured corrects it with poles of a few
//! hertz, below every swing of the cables. An acceleration that the torque does not explain (friction, contact, masses
//! that differ from the model) is a third state, slower still.

use crate::model::arm::ArmModel;
use crate::model::kinematics::Frames;
use crate::real::{Real, at_least, within};
use crate::sense::correction::Correction;
use crate::sense::joints::JointState;
use crate::sense::mass::Mass;
use crate::sense::swing::Swings;
use crate::time::{PERIOD, RATE, few_periods};
use crate::units::{JOINTS, JointPositions, Vector7};

/// Time from the latch of the positions to the torque that answers them: 1.33 ms, in control periods.
const LATENCY: f64 = 0.4 * RATE / 300.0;

/// Poles of the correction (Hz). The shoulder's lie well below the first swing of its cables (24 Hz), the wrist's are
/// fast enough to damp it against a wall (8 to 10 Hz).
const POLES: [f64; JOINTS] = [4.0, 4.0, 4.0, 6.0, 15.0, 15.0, 15.0];

/// Pole with which the unexplained acceleration is followed (Hz).
const DISTURBANCE_POLE: f64 = 2.0;

/// Poles of the correction and of the unexplained acceleration (Hz) in every other state than a compliant run: where
/// the joints are stiffer, the shoulder's lie lower.
const STIFF_POLES: ([f64; JOINTS], f64) = ([3.5, 3.0, 3.5, 5.0, 12.0, 12.0, 12.0], 1.5);

/// Largest difference from the measured velocity (rad/s): a person who shoves the arm is in no model.
const FARTHEST: f64 = 0.5;

/// The same for a joint that has stood still to the count for [`STANDS`] cycles (rad/s), on the way to which it falls
/// steadily: friction holds the joint, of which the model knows nothing.
const FARTHEST_AT_REST: f64 = 0.05;

/// Time after which such a joint stands: 100 ms, in control periods. Shorter, and the torque makes steps.
const STANDS: u8 = few_periods(0.1);

/// Motors that turn each joint, one bit each, M1 lowest.
const TURNED_BY: [u8; JOINTS] = [0b1, 0b110, 0b110, 0b1000, 0b11_0000, 0b11_0000, 0b100_0000];

/// Largest difference from the measured position (rad).
const ASTRAY: f64 = 0.02;

/// The same for a fast joint in every other state than a compliant run, and the speed beyond its plan from which it is
/// fast (rad/s): somebody throws it. One that follows a fast plan is left to the model, or the swing of its cables
/// would be in its damping.
const FARTHEST_AT_SPEED: (f64, f64) = (0.1, 0.9);

/// Nearness of the observed velocities to the measured ones.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trust {
    /// In compliant runs: within a fixed distance.
    Compliant,
    /// In every other state: the nearer the faster a joint is measured, beyond its plan.
    Stiff,
    /// In an approach, besides: the nearer the longer a joint has stood still that is to move.
    Approach,
}

impl Trust {
    /// That of a run.
    pub fn of_run(compliant: bool) -> Self {
        if compliant { Trust::Compliant } else { Trust::Stiff }
    }
}

/// Motion of the joints, as the model tells it.
#[derive(Clone, Debug)]
pub struct MotionObserver<R: Real> {
    /// For compliant runs, and for every other state.
    correction: [Correction<R>; 2],
    q: Vector7<R>,
    dq: Vector7<R>,
    /// Acceleration that the torque does not explain (rad/s^2).
    disturbance: Vector7<R>,
    /// Control periods for which the motors of each joint have stood, less those in which one turned: 0 to [`STANDS`].
    still: [u8; JOINTS],
    /// Joints that swing.
    swings: Swings<R>,
    /// Accelerations by the torques sent last and before.
    sent: [Vector7<R>; 2],
    /// Inertia of the arm, renewed as torque is sent.
    pub(crate) mass: Mass<R>,
}

impl<R: Real> MotionObserver<R> {
    /// Nothing is known yet.
    #[inline(never)]
    pub fn new() -> Self {
        MotionObserver {
            correction: [
                Correction::with_poles(&POLES, DISTURBANCE_POLE),
                Correction::with_poles(&STIFF_POLES.0, STIFF_POLES.1),
            ],
            q: Vector7::zeros(),
            dq: Vector7::zeros(),
            disturbance: Vector7::zeros(),
            still: [0; JOINTS],
            swings: Swings::new(),
            sent: [Vector7::zeros(); 2],
            mass: Mass::new(),
        }
    }

    /// Takes the measured motion as it is: nothing is predicted where no torque is sent.
    pub fn settle(&mut self, state: &JointState<R>) {
        (self.q, self.dq) = (state.q.0, state.dq.0);
        self.disturbance = Vector7::zeros();
        self.sent = [Vector7::zeros(); 2];
        self.swings = Swings::new();
    }

    /// True if a joint swings back and forth for longer than a blow rings.
    pub fn shakes(&self) -> bool {
        self.swings.shakes()
    }

    /// Velocities where the next torque acts (rad/s), kept near the measured ones; `planned` are those of the plan, and
    /// zero where there is none.
    #[inline(never)]
    pub fn velocity(&self, state: &JointState<R>, trust: Trust, planned: &Vector7<R>) -> Vector7<R> {
        let ahead = self.dq + (self.sent[0] + self.disturbance) * R::constant(LATENCY * PERIOD);
        let (least, speed) = FARTHEST_AT_SPEED;
        let nearer = R::constant(if trust != Trust::Compliant { (FARTHEST - least) / speed } else { 0.0 });
        let stands =
            R::constant(if trust == Trust::Approach { (FARTHEST - FARTHEST_AT_REST) / STANDS as f64 } else { 0.0 });
        let swinging = self.swings.swinging();
        let mut velocity = state.dq.0;
        for (joint, ((velocity, observed), still)) in velocity.iter_mut().zip(ahead.iter()).zip(self.still).enumerate()
        {
            if swinging >> joint & 1 != 0 {
                // Nobody shoves a joint back and forth like that: near what is measured, its damping would drive it.
                *velocity = *observed;
                continue;
            }
            let beyond = *velocity - planned[joint];
            let fast = at_least(beyond, -beyond);
            let stands = R::from_counts(i32::from(still)) * stands;
            let farthest = at_least(R::constant(FARTHEST) - fast * nearer, R::constant(least));
            let farthest = at_least(farthest - stands, R::constant(FARTHEST_AT_REST));
            *velocity += within(*observed - *velocity, farthest);
        }
        velocity
    }

    /// Torque (N m) of what the model does not know, friction mostly, as the measured motion tells it.
    #[inline(never)]
    pub fn unknown(&self) -> Vector7<R> {
        self.mass.matrix() * self.disturbance
    }

    /// Positions (rad), kept near the measured ones.
    #[inline(never)]
    pub fn position(&self, state: &JointState<R>) -> JointPositions<R> {
        let near = |observed, measured| measured + within(observed - measured, R::constant(ASTRAY));
        JointPositions(self.q.zip_map(&state.q.0, near))
    }

    /// One control period on, corrected by what is measured; `stiff` in every state but a compliant run.
    #[inline(never)]
    pub fn update(&mut self, state: &JointState<R>, stiff: bool) {
        let correction = &self.correction[usize::from(stiff)];
        let acceleration =
            self.sent[1] * R::constant(LATENCY) + self.sent[0] * R::constant(1.0 - LATENCY) + self.disturbance;
        self.q += (self.dq + acceleration * R::constant(0.5 * PERIOD)) * R::constant(PERIOD);
        self.dq += acceleration * R::constant(PERIOD);
        for (joint, (still, by)) in self.still.iter_mut().zip(TURNED_BY).enumerate() {
            if state.extrapolated >> joint & 1 == 0 {
                *still = if state.still & by == by { (*still + 1).min(STANDS) } else { still.saturating_sub(1) };
            }
        }
        self.swings.step(&state.dq.0, state.extrapolated);
        let mut error = state.q.0 - self.q;
        if state.extrapolated != 0 {
            forget(&mut error, state.extrapolated);
        }
        self.q += error.component_mul(&correction.position);
        self.dq += error.component_mul(&correction.velocity);
        self.disturbance += error.component_mul(&correction.acceleration);
    }

    /// Takes what was sent: the acceleration that was wanted, and the torque (N m) beyond the one that the model needs
    /// for it.
    #[inline(never)]
    pub fn send(&mut self, model: &ArmModel<R>, frames: &Frames<R>, wanted: &Vector7<R>, beyond: &Vector7<R>) {
        self.mass.renew(model, frames);
        let next = wanted + self.mass.accelerated(beyond);
        // What is not a number would stay for good.
        let known = next.iter().all(|value| value.is_finite_number());
        self.sent = [if known { next } else { Vector7::zeros() }, self.sent[0]];
    }

    /// Takes a torque (N m) that will be sent from now on and that friction holds.
    #[inline(never)]
    pub fn hold_back(&mut self, torque: &Vector7<R>) {
        // Before the first mass matrix no torque accelerates anything.
        if *torque != Vector7::zeros() {
            self.disturbance -= self.mass.accelerated(torque);
        }
    }
}

/// Nothing corrects these joints, one bit each, J1 lowest: they are not measured.
#[cold]
#[inline(never)]
fn forget<R: Real>(error: &mut Vector7<R>, joints: u8) {
    for (joint, error) in error.iter_mut().enumerate() {
        if joints >> joint & 1 != 0 {
            *error = R::constant(0.0);
        }
    }
}

impl<R: Real> Default for MotionObserver<R> {
    fn default() -> Self {
        MotionObserver::new()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::calibration::Payload;
    use crate::units::JointPositions;

    const POSTURE: [f64; JOINTS] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

    /// The change that makes it fail: the torque beyond the model accelerates nothing.
    #[test]
    fn what_was_sent_is_the_acceleration_that_was_wanted_and_that_of_the_torque_beyond_it() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        let wanted = Vector7::from([0.5, -1.0, 2.0, 0.3, -4.0, 5.0, 6.0]);
        let mut observer = MotionObserver::new();
        observer.send(&model, &frames, &wanted, &(model.mass_matrix(&frames) * wanted * 2.0));
        assert!((observer.sent[0] - wanted * 3.0).amax() < 1e-9, "{}", observer.sent[0]);
    }

    #[test]
    fn a_torque_that_is_no_number_is_forgotten() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        let mut observer = MotionObserver::new();
        observer.send(&model, &frames, &Vector7::zeros(), &Vector7::repeat(f64::NAN));
        assert_eq!(observer.sent[0], Vector7::zeros());
    }

    /// A measured motion of all joints, in which so many motors stand and no joint is extrapolated.
    fn measured(q: f64, dq: f64, still: u8) -> JointState<f64> {
        JointState {
            still,
            ..JointState::whole(JointPositions(Vector7::repeat(q)), crate::units::JointVelocities(Vector7::repeat(dq)))
        }
    }

    /// An observer of a motion with this velocity.
    fn observing(dq: f64) -> MotionObserver<f64> {
        let mut observer = MotionObserver::new();
        observer.settle(&measured(0.0, dq, 0));
        observer
    }

    fn near(is: &Vector7<f64>, expected: f64, what: &str) {
        assert!(is.iter().all(|value| (value - expected).abs() < 1e-9), "{what}: {is} for {expected}");
    }

    #[test]
    fn a_velocity_is_kept_the_nearer_to_the_measured_one_the_faster_that_is_but_in_a_compliant_run() {
        for sign in [1.0, -1.0] {
            for (observed, speed, compliant, stiff) in [
                (0.3, 0.0, 0.3, 0.3),
                (0.7, 0.0, FARTHEST, FARTHEST),
                (0.0, 0.45, 0.0, 0.15),
                (1.0, 0.45, 0.95, 0.75),
                (0.0, 3.0, 2.5, 2.9),
                (9.0, 3.0, 3.5, 3.1),
            ] {
                let (observer, state) = (observing(sign * observed), measured(0.0, sign * speed, 0));
                near(&observer.velocity(&state, Trust::Compliant, &Vector7::zeros()), sign * compliant, "compliant");
                near(&observer.velocity(&state, Trust::Stiff, &Vector7::zeros()), sign * stiff, "stiff");
                near(&observer.velocity(&state, Trust::Approach, &Vector7::zeros()), sign * stiff, "approach");
            }
        }
    }

    /// The change that makes it fail: the speed from which a joint is fast is not the one beyond its plan.
    #[test]
    fn a_joint_that_follows_a_fast_plan_is_left_to_the_model_as_one_that_stands() {
        for (sign, trust) in [(1.0, Trust::Stiff), (-1.0, Trust::Stiff), (1.0, Trust::Approach)] {
            for (speed, planned, nearest) in [(0.9, 0.9, FARTHEST), (0.9, 0.45, 0.3), (0.0, 0.9, 0.1), (0.9, -0.9, 0.1)]
            {
                let (observer, state) = (observing(sign * (speed + 1.0)), measured(0.0, sign * speed, 0));
                let velocity = observer.velocity(&state, trust, &Vector7::repeat(sign * planned));
                near(&velocity, sign * (speed + nearest), "near its plan");
            }
        }
    }

    #[test]
    fn in_an_approach_a_joint_that_stands_is_believed_the_more_the_longer_it_stands() {
        let mut observer = observing(1.0);
        let mut cycle = 0.0;
        let mut believed = |cycles: u8, still: u8, extrapolated: u8, trust: Trust| {
            for _ in 0..cycles {
                cycle += 1.0;
                let state = JointState { extrapolated, ..measured(cycle * PERIOD, 1.0, still) };
                observer.update(&state, true);
            }
            observer.velocity(&measured(cycle * PERIOD, 0.0, still), trust, &Vector7::zeros())
        };
        let after = |cycles: u8| FARTHEST - f64::from(cycles) / f64::from(STANDS) * (FARTHEST - FARTHEST_AT_REST);
        near(&believed(STANDS / 3, 0x7F, 0, Trust::Approach), after(STANDS / 3), "it begins to stand");
        near(&believed(0, 0x7F, 0, Trust::Stiff), FARTHEST, "in an approach alone");
        near(&believed(2, 0x7F, 0x7F, Trust::Approach), after(STANDS / 3), "nothing is known of who is silent");
        near(&believed(2, 0, 0, Trust::Approach), after(STANDS / 3 - 2), "it turns");
        near(&believed(2 * STANDS, 0x7F, 0, Trust::Approach), FARTHEST_AT_REST, "it stands");
        near(&believed(2 * STANDS, 0, 0, Trust::Approach), FARTHEST, "it turns again");
        // M2 and M3 turn J2 and J3 together.
        let one_of_two = believed(STANDS, 0b101_0101, 0, Trust::Approach);
        for (joint, velocity) in one_of_two.iter().enumerate() {
            let expected = if [0, 6].contains(&joint) { FARTHEST_AT_REST } else { FARTHEST };
            assert!((velocity - expected).abs() < 1e-9, "J{}: {velocity}", joint + 1);
        }
    }

    #[test]
    fn a_position_is_kept_within_20_mrad_of_the_measured_one() {
        let observer = observing(0.0);
        for (q, expected) in [(0.01, 0.0), (-0.01, 0.0), (0.05, 0.05 - ASTRAY), (-0.05, ASTRAY - 0.05)] {
            near(&observer.position(&measured(q, 0.0, 0)).0, expected, "position");
        }
    }

    #[test]
    fn what_was_sent_moves_the_model_from_the_moment_on_at_which_it_acts() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        assert!((LATENCY * PERIOD - 0.004 / 3.0).abs() < 1e-9, "1.33 ms at any rate");
        let mut observer = observing(0.0);
        let acceleration = 30.0;
        let (mut q, mut dq) = (0.0, 0.0);
        for cycle in 0..10 {
            observer.send(&model, &frames, &Vector7::repeat(acceleration), &Vector7::zeros());
            // Nothing is measured: the model is alone.
            observer.update(&JointState { extrapolated: 0x7F, ..measured(9.0, 0.0, 0) }, false);
            let acts = if cycle == 0 { acceleration * (1.0 - LATENCY) } else { acceleration };
            q += (dq + 0.5 * acts * PERIOD) * PERIOD;
            dq += acts * PERIOD;
            near(&observer.q, q, "position");
            near(&observer.dq, dq, "velocity");
            let ahead = dq + acceleration * LATENCY * PERIOD;
            near(
                &observer.velocity(&measured(0.0, ahead - 0.1, 0), Trust::Compliant, &Vector7::zeros()),
                ahead,
                "where the torque acts",
            );
        }
        observer.settle(&measured(0.1, 0.2, 0));
        near(
            &observer.velocity(&measured(0.1, 0.2, 0), Trust::Compliant, &Vector7::zeros()),
            0.2,
            "nothing is predicted any more",
        );
    }

    #[test]
    fn an_acceleration_that_no_torque_explains_goes_on_until_the_next_torque_acts() {
        let mut observer = observing(0.1);
        observer.disturbance = Vector7::repeat(30.0);
        let ahead = 0.1 + 30.0 * LATENCY * PERIOD;
        near(
            &observer.velocity(&measured(0.0, 0.1, 0), Trust::Compliant, &Vector7::zeros()),
            ahead,
            "where the torque acts",
        );
    }

    /// An error of the model dies away with two poles of the joint and one of the disturbance: each value follows from
    /// the three before it.
    #[test]
    fn an_error_dies_away_with_the_poles_of_each_joint() {
        for (stiff, (poles, slowest)) in [(false, (POLES, DISTURBANCE_POLE)), (true, STIFF_POLES)] {
            let mut observer = MotionObserver::<f64>::new();
            observer.settle(&measured(0.01, 0.0, 0));
            let mut last = [Vector7::zeros(); 20];
            for q in &mut last {
                *q = observer.q;
                observer.update(&measured(0.0, 0.0, 0), stiff);
            }
            for (joint, pole) in poles.into_iter().enumerate() {
                let [p, s] = [pole, slowest].map(|hertz| f64::exp(-core::f64::consts::TAU * hertz * PERIOD));
                for k in 3..last.len() {
                    let [a, b, c] = [k - 1, k - 2, k - 3].map(|k| last[k][joint]);
                    let expected = (2.0 * p + s) * a - (p * p + 2.0 * p * s) * b + p * p * s * c;
                    assert!((last[k][joint] - expected).abs() < 1e-12, "J{}, cycle {k}, {stiff}", joint + 1);
                }
            }
        }
    }

    #[test]
    fn a_joint_that_is_not_measured_is_not_corrected_and_every_other_one_is() {
        for extrapolated in [0b1, 0b110, 0b100_0000] {
            let mut observer = MotionObserver::<f64>::new();
            observer.settle(&measured(0.01, 0.0, 0));
            observer.update(&JointState { extrapolated, ..measured(0.0, 0.0, 0) }, false);
            for (joint, q) in observer.q.iter().enumerate() {
                assert_eq!(*q == 0.01, extrapolated >> joint & 1 != 0, "J{}", joint + 1);
            }
        }
    }

    #[test]
    fn a_joint_that_swings_is_taken_as_the_model_moves_it_and_every_other_one_stays_near_what_is_measured() {
        for swinging in 0..JOINTS {
            let mut observer = observing(0.0);
            for cycle in 0..150 {
                let mut state = measured(0.0, 0.0, 0);
                state.dq.0[swinging] = (core::f64::consts::TAU * 45.0 * f64::from(cycle) * PERIOD).sin();
                observer.update(&state, false);
            }
            assert!(observer.shakes());
            (observer.dq, observer.disturbance) = (Vector7::repeat(2.0), Vector7::zeros());
            for (joint, velocity) in
                observer.velocity(&measured(0.0, 0.0, 0), Trust::Compliant, &Vector7::zeros()).iter().enumerate()
            {
                assert_eq!(*velocity, if joint == swinging { 2.0 } else { FARTHEST }, "J{}", joint + 1);
            }
            observer.settle(&measured(0.0, 0.0, 0));
            assert!(!observer.shakes(), "where no torque is sent nothing is driven");
        }
    }

    #[test]
    fn a_torque_that_friction_holds_back_is_no_acceleration() {
        let model = ArmModel::<f64>::new(Payload::SensorAndHand);
        let frames = Frames::new(&model, &JointPositions::from_array(POSTURE));
        let mut observer = observing(0.0);
        let torque = Vector7::from([0.5, -1.0, 2.0, 0.3, -0.4, 0.5, 0.1]);
        observer.hold_back(&torque);
        assert_eq!(observer.disturbance, Vector7::zeros(), "of which arm?");
        observer.send(&model, &frames, &Vector7::zeros(), &torque);
        observer.hold_back(&torque);
        assert!((observer.disturbance + observer.sent[0]).amax() < 1e-9, "{}", observer.disturbance);
    }
}
