//! `Run`: the loaded primitive in motion: its rollout, the options of this run, and the decision that it is over.

use dmp::{
    Configuration, Coupling, Primitive, Quaternion, Reference, Rollout, RolloutError, SENSORS, SensorMap, StartState,
};
use nalgebra::Vector3;

use crate::command::{Goal, Refusal, RunOptions};
use crate::cycle::PERIOD;
use crate::load::within_reach;
use crate::real::Real;
use crate::units::{JointPositions, Pose, Vector6, Wrench};

/// Largest distance of any joint from the start posture of the primitive (rad).
pub(crate) const START_DISTANCE: f64 = 0.05;

/// Allowed speed factors.
pub(crate) const SPEEDS: (f32, f32) = (0.1, 2.0);

/// The plan counts as at rest below these speeds (m/s, rad/s).
const REST: (f64, f64) = (2e-3, 1e-2);

/// Control periods that the plan stays at rest before the run is over: three time constants of the pose feedback of
/// Eq (11), so that the arm has closed the last millimetres.
const SETTLING: u16 = 300;

/// Progress beyond which a plan that never comes to rest (feedback still bends it) is over as well.
const LATEST: f64 = 1.5;

/// A run in progress.
#[derive(Clone, Debug)]
pub(crate) struct Run<R: Real, const N: usize> {
    rollout: Rollout<R, N>,
    pub(crate) options: RunOptions,
    coupling: Coupling<R>,
    rested: u16,
}

impl<R: Real, const N: usize> Run<R, N> {
    /// Begins at the measured pose and posture, at rest.
    pub(crate) fn start(
        primitive: &Primitive<R, N>,
        q: &JointPositions<R>,
        pose: &Pose<R>,
        options: RunOptions,
    ) -> Result<Self, Refusal> {
        let taught = primitive.start();
        let far = |(q, start): (&R, &R)| {
            let distance = *q - *start;
            !(distance <= R::of(START_DISTANCE) && distance >= R::of(-START_DISTANCE))
        };
        if q.0.iter().zip(&taught.posture).any(far) {
            return Err(Refusal::StartTooFar);
        }
        let [w, x, y, z] = pose.orientation.0;
        let start = StartState::at_rest(Configuration {
            position: pose.position.into(),
            orientation: Quaternion::new(w, x, y, z),
            posture: q.0.into(),
            hand: taught.hand,
        });
        let rollout = Rollout::start(primitive, &start).map_err(reason)?;
        let mut run = Run { rollout, options, coupling: Coupling::NONE, rested: 0 };
        // The first speed acts at once; later ones are approached at the rollout's slew rate.
        run.rollout.set_speed_slew(None).map_err(reason)?;
        run.set_speed(primitive, options.speed)?;
        run.rollout.step(primitive, R::of(0.0), &Coupling::NONE);
        run.rollout.set_speed_slew(Some(R::of(2.0))).map_err(reason)?;
        run.set_goal(primitive, &options.goal)?;
        Ok(run)
    }

    /// Takes a new goal, or leaves everything as it was.
    pub(crate) fn set_goal(&mut self, primitive: &Primitive<R, N>, goal: &Goal) -> Result<(), Refusal> {
        let mut next = self.rollout.clone();
        if let Some(position) = goal.position {
            if position.iter().any(|value| !value.is_finite()) {
                return Err(Refusal::OutOfRange);
            }
            let position = position.map(|value| R::of(f64::from(value)));
            if !within_reach(&Vector3::from(position)) {
                return Err(Refusal::OutsideWorkspace);
            }
            next.set_goal_position(position).map_err(reason)?;
        }
        if let Some(orientation) = goal.orientation {
            let [w, x, y, z] = orientation.map(|value| R::of(f64::from(value)));
            next.set_goal_orientation(primitive, Quaternion::new(w, x, y, z)).map_err(reason)?;
        }
        self.rollout = next;
        self.rested = 0;
        Ok(())
    }

    /// Takes a new speed factor.
    pub(crate) fn set_speed(&mut self, primitive: &Primitive<R, N>, factor: f32) -> Result<(), Refusal> {
        if !(factor >= SPEEDS.0 && factor <= SPEEDS.1) {
            return Err(Refusal::OutOfRange);
        }
        self.rollout.set_speed(primitive, R::of(f64::from(factor))).map_err(reason)
    }

    /// The plan of this tick. With `frozen` feedback (the wrench or a position is missing) the last coupling stays.
    pub(crate) fn step(&mut self, primitive: &Primitive<R, N>, wrench: &Wrench<R>, frozen: bool) -> Reference<R> {
        if !self.options.feedback {
            self.coupling = Coupling::NONE;
        } else if !frozen {
            let measured = self.sensors(primitive, wrench);
            self.coupling = self.rollout.coupling(primitive, &measured, &SensorMap::IDENTITY);
        }
        let plan = self.rollout.step(primitive, R::of(PERIOD), &self.coupling);
        let slow =
            |speeds: &[R], limit: f64| speeds.iter().all(|speed| *speed < R::of(limit) && *speed > R::of(-limit));
        let resting = self.rollout.is_finished()
            && slow(&plan.position.v, REST.0)
            && slow(&plan.orientation.omega, REST.1)
            && slow(&plan.posture.v, REST.1);
        self.rested = if resting { self.rested.saturating_add(1) } else { 0 };
        plan
    }

    /// Whether the movement is over.
    pub(crate) fn is_over(&self) -> bool {
        self.rested >= SETTLING || self.rollout.progress() > R::of(LATEST)
    }

    /// Error of the force controller, `F_expected - F` (N, N m, force world axes, torque tool axes); `None` without an
    /// expectation.
    pub(crate) fn force_error(&self, primitive: &Primitive<R, N>, wrench: &Wrench<R>) -> Option<Wrench<R>> {
        let [fx, fy, fz, nx, ny, nz, ..] = primitive.expected()?.at(self.rollout.progress());
        Some(Wrench {
            force: Vector3::new(fx, fy, fz) - wrench.force,
            torque: Vector3::new(nx, ny, nz) - wrench.torque,
        })
    }

    /// Sensor values for Eq (8). Finger gauges are not measured yet: they read what is expected, so they bend nothing.
    fn sensors(&self, primitive: &Primitive<R, N>, wrench: &Wrench<R>) -> [R; SENSORS] {
        let mut sensors = match primitive.expected() {
            Some(expected) => expected.at(self.rollout.progress()),
            None => [R::of(0.0); SENSORS],
        };
        let felt = Vector6::new(
            wrench.force.x,
            wrench.force.y,
            wrench.force.z,
            wrench.torque.x,
            wrench.torque.y,
            wrench.torque.z,
        );
        for (sensor, value) in sensors.iter_mut().zip(felt.iter()) {
            *sensor = *value;
        }
        sensors
    }
}

/// Every reason a rollout gives is a number out of range.
fn reason(_: RolloutError) -> Refusal {
    Refusal::OutOfRange
}
