//! Bounds of every number of an image: the one place where device, hand and host look them up.
//!
//! `dmp` bounds what any robot can need; these are the numbers of this arm. Those of postures, reach and expectations
//! are in [`load`](super::load), which checks them too.

use core::fmt;

use dmp::{Group, Scalar};

use crate::model::wam7;
use crate::plan::primitive::{Configuration, POSTURE_ROWS, Primitive, Rollout, RowGroup, StartState};
use crate::real::Real;

/// Largest stiffness K and damping D of a row. The usual 200 and 28 are slow beside them; what is stiffer follows its
/// weights without a filter, whatever they are.
pub const GAIN: f64 = 1e4;

/// Largest displacement of the plan by feedback: position (m), orientation and digits (rad).
pub const DISPLACEMENT: [f64; 3] = [1.0, core::f64::consts::PI, 3.0];

/// Largest speed of position (m/s), orientation, posture and digits (rad/s), of the plan at the taught speed and of its
/// start: twice what the arm is allowed, because fast demonstrations are run slowly.
pub const SPEED: [f64; 4] = [2.0, 8.0, 8.0, 12.0];

/// Largest speed factor of a run while a motor is hot or the pendant warns.
pub const HELD_BACK: f32 = 0.5;

/// Largest acceleration of the plan, in the same order (m/s^2, rad/s^2).
pub const ACCELERATION: [f64; 4] = [40.0, 400.0, 400.0, 2000.0];

/// Largest values of a sensor in the memory of earlier runs: force (N), torque (N m), torque of a finger (N m), angle
/// of a finger (rad). A frame of the sensor can carry no more.
pub const MEASURED: [f64; 4] = [128.0, 8.0, 2.0 * wam7::FINGER_TORQUE_MAX, 7.0];

/// Heaviest load that the expectation may have been recorded with (kg): what the arm is built to carry.
pub const LOAD_MASS: f64 = 4.0;

/// Farthest centre of that load from the hand (m).
pub const LOAD_CENTRE: f64 = 0.5;

/// Most runs behind an expectation.
pub const TRIALS: f64 = 65_535.0;

/// Steps of the check of a plan, at the usual stiffness, over one duration.
const STEPS: f64 = 200.0;

/// Length of a step in time constants of the stiffest row.
const STEP_OF_SPRING: f64 = 0.1;

/// Progress up to which a plan is looked at.
const LOOKED_AT: f64 = 1.3;

/// A number of an image, or of the plan that it gives, that is out of its bounds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// Stiffness or damping.
    Gain(RowGroup),
    /// Displacement by feedback.
    Displacement(RowGroup),
    /// Velocity at the start of the demonstration.
    StartVelocity(RowGroup),
    /// Speed of the plan.
    Speed(RowGroup),
    /// Acceleration of the plan.
    Acceleration(RowGroup),
    /// A sensor (0 = force x) in the memory of earlier runs.
    Measured(u8),
    /// Mass of the load of the recording, or its place.
    Load,
    /// Runs behind the expectation, or their spread.
    Recording,
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Quantity::Gain(rows) => write!(f, "{rows}: stiffness or damping is above {GAIN}"),
            Quantity::Displacement(rows) => {
                write!(f, "{rows}: the feedback may displace the plan by more than this arm can follow")
            }
            Quantity::StartVelocity(rows) => {
                write!(f, "{rows}: the velocity at the start is above {}", of(&SPEED, *rows))
            }
            Quantity::Speed(rows) => {
                write!(f, "{rows}: the plan is faster than {} m/s or rad/s", of(&SPEED, *rows))
            }
            Quantity::Acceleration(rows) => {
                write!(f, "{rows}: the plan accelerates by more than {} m/s^2 or rad/s^2", of(&ACCELERATION, *rows))
            }
            Quantity::Measured(sensor) => {
                write!(f, "value {sensor} (from 0) of the earlier runs is more than its sensor can measure")
            }
            Quantity::Load => f.write_str("the load of the recording is negative, too heavy or too far away"),
            Quantity::Recording => f.write_str("the number of recorded runs or their spread is no possible one"),
        }
    }
}

/// The bound of these rows.
pub fn of(bounds: &[f64; 4], rows: RowGroup) -> f64 {
    let [position, orientation, posture, hand] = *bounds;
    match rows {
        RowGroup::Position => position,
        RowGroup::Orientation => orientation,
        RowGroup::Posture => posture,
        RowGroup::Hand => hand,
    }
}

/// True if no magnitude is above the bound. False for a NaN.
pub fn within<T: Scalar>(values: &[T], bound: f64) -> bool {
    let bound = T::from_f64(bound);
    values.iter().all(|value| *value <= bound && *value >= -bound)
}

/// The marks of a recording, as an image carries them: mass (kg) and centre (m) of the load, number of runs, smallest
/// relative spread that counts.
///
/// # Errors
/// The [`Quantity`] that is out of its bounds.
pub fn check_marks(mass: f32, centre: &[f32; 3], trials: f32, spread_floor: f32) -> Result<(), Quantity> {
    if !(0.0..=LOAD_MASS).contains(&f64::from(mass)) || !within(centre, LOAD_CENTRE) {
        return Err(Quantity::Load);
    }
    let possible = (0.0..=TRIALS).contains(&f64::from(trials)) && (0.0..=1.0).contains(&spread_floor);
    if possible { Ok(()) } else { Err(Quantity::Recording) }
}

/// Checks the numbers of a primitive, and the plan that they give at the taught speed.
///
/// # Errors
/// The first [`Quantity`] that is out of its bounds.
pub(crate) fn check<R: Real, const N: usize>(primitive: &Primitive<R, N>) -> Result<(), Quantity> {
    let movement = primitive.movement();
    let [[position, orientation]] = movement.pose_systems();
    let springs =
        [(Group::Position, position), (Group::Orientation, orientation)].map(|(group, system)| (group, 0, system));
    let points = (0u8..).zip(movement.point_systems()).map(|(row, system)| (Group::Points, row, system));
    let mut stiffest = R::constant(0.0);
    for (group, row, system) in springs.into_iter().chain(points) {
        if !within(&[system.stiffness(), system.damping()], GAIN) {
            return Err(Quantity::Gain(RowGroup::of(group, row).0));
        }
        stiffest = crate::real::at_least(stiffest, system.stiffness());
    }
    if let Some(feedback) = primitive.feedback() {
        let ([pose], limits) = (&feedback.limits().poses, feedback.limits());
        let [p, o, h] = DISPLACEMENT;
        let (_, hand) = crate::plan::primitive::posture_and_hand(&limits.points);
        for (rows, values, bound) in [
            (RowGroup::Position, [pose.displacement; 4], p),
            (RowGroup::Orientation, [pose.rotation; 4], o + 1e-6),
            (RowGroup::Hand, hand, h),
        ] {
            if !within(&values, bound) {
                return Err(Quantity::Displacement(rows));
            }
        }
    }
    if let Some(rows) = beyond(
        &movement.start_velocity().poses[0].linear,
        &movement.start_velocity().poses[0].angular,
        &movement.start_velocity().points,
        &SPEED,
    ) {
        return Err(Quantity::StartVelocity(rows));
    }
    if let Some(statistics) = primitive.statistics() {
        let tables = statistics.mean().iter().chain(statistics.spread());
        let [force, torque, finger, angle] = MEASURED;
        let bounds = [force, force, force, torque, torque, torque, finger, finger, finger, angle, angle, angle];
        for sample in tables {
            for (sensor, (value, bound)) in (0u8..).zip(sample.iter().zip(bounds)) {
                if !within(&[*value], bound) {
                    return Err(Quantity::Measured(sensor));
                }
            }
        }
    }
    check_plan(primitive, stiffest)
}

/// Rolls the plan out, faster than it will be run: in steps that resolve the springs, not in those of a control period.
fn check_plan<R: Real, const N: usize>(primitive: &Primitive<R, N>, stiffest: R) -> Result<(), Quantity> {
    let movement = primitive.movement();
    let start: &Configuration<R> = movement.start();
    let Ok(mut rollout) = Rollout::<R, N>::start(movement, &StartState::at_rest(*start)) else {
        return Err(Quantity::Speed(RowGroup::Orientation));
    };
    let period = movement.control_period();
    let step =
        crate::real::at_most(R::constant(1.0 / STEPS), R::constant(STEP_OF_SPRING) / crate::real::sqrt(stiffest));
    let fastest = R::constant(0.9) * movement.duration() / movement.minimum_duration();
    let speed = crate::real::at_most(step * movement.duration() / period, fastest);
    let speed = crate::real::at_least(speed, R::constant(1.0));
    let taken = rollout.set_speed_slew(None).and_then(|()| rollout.set_speed(movement, speed));
    let back = R::constant(1.0) / speed;
    while taken.is_ok() && rollout.progress() < R::constant(LOOKED_AT) {
        let Ok(plan) = rollout.step(movement, period, &crate::plan::primitive::Coupling::NONE) else { break };
        let ([pose], points) = (&plan.poses, &plan.points);
        let slow = |value: R| value * back;
        let (linear, angular) = (pose.position.v.map(slow), pose.orientation.omega.map(slow));
        if let Some(rows) = beyond(&linear, &angular, &points.v.map(slow), &SPEED) {
            return Err(Quantity::Speed(rows));
        }
        let slow = |value: R| value * back * back;
        let (linear, angular) = (pose.position.a.map(slow), pose.orientation.domega.map(slow));
        if let Some(rows) = beyond(&linear, &angular, &points.a.map(slow), &ACCELERATION) {
            return Err(Quantity::Acceleration(rows));
        }
    }
    Ok(())
}

/// The first part of the plan of which a value is beyond its bound.
fn beyond<R: Real>(linear: &[R; 3], angular: &[R; 3], points: &[R], bounds: &[f64; 4]) -> Option<RowGroup> {
    let (posture, hand) = points.split_at_checked(POSTURE_ROWS)?;
    RowGroup::ALL
        .into_iter()
        .zip([linear.as_slice(), angular, posture, hand])
        .find(|(rows, values)| !within(values, of(bounds, *rows)))
        .map(|(rows, _)| rows)
}
