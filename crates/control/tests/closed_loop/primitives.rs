//! Movements for the tests: between two postures, with a bent path.

use control::Payload;
use control::Real;
use control::command::RunOptions;
use control::model::{ArmModel, Frames};
use control::plan::load;
use control::plan::primitive::{
    Configuration, ExpectedWrench, Feedback, GainSchedule, MovementTables, Primitive, ROWS, SENSORS, Velocity,
    configuration as rows, gains, limits,
};
use control::units::JointPositions;
use dmp::{Hemisphere, OrientationError};

use crate::rig::KERNELS;

/// A posture beside a table, hand level, and the posture of a side grasp.
pub(crate) const START: [f64; 7] = [-0.20, 1.30, 1.20, 2.10, -0.30, -0.50, 1.40];
pub(crate) const GOAL: [f64; 7] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

/// Stretched out to the front.
pub(crate) const OUT: [f64; 7] = [0.0, 1.45, 0.0, 0.1, 0.0, 0.0, 0.0];

/// Largest displacement (m) and rotation (rad) of the test primitives by feedback.
pub(crate) const DISPLACEMENT: f64 = 0.1;
pub(crate) const ROTATION: f64 = 0.4;

/// The pose and posture of the arm at `q`.
pub(crate) fn configuration<R: Real>(q: [f64; 7], hand: [f64; 4]) -> Configuration<R> {
    let model = ArmModel::<f64>::new(Payload::SensorAndHand);
    let pose = Frames::new(&model, &JointPositions::from_array(q)).tool_pose();
    let position = [0, 1, 2].map(|axis| R::constant(pose.position[axis]));
    rows(position, pose.orientation.0.map(R::constant), q.map(R::constant), hand.map(R::constant))
}

/// A compliant run that adapts, as `tactus run --mode adapt` asks for it.
pub(crate) fn adapting() -> RunOptions {
    RunOptions { compliant: true, feedback: true, force_control: true, ..RunOptions::default() }
}

/// Weights that bend the position path by a few centimetres and the orientation by some degrees.
fn weights<R: Real>() -> Vec<R> {
    (0..ROWS)
        .flat_map(|row| {
            (0..KERNELS).map(move |kernel| {
                let place = (kernel as f64 + 0.5) / KERNELS as f64;
                let bump = (std::f64::consts::PI * place).sin().powi(2);
                let amplitude = match row {
                    0..3 => 0.15,
                    3..6 => 0.2,
                    _ => 0.0,
                };
                R::constant(amplitude * bump * (0.25 * kernel as f64 + row as f64).sin())
            })
        })
        .collect()
}

/// Options of a test primitive.
pub(crate) struct Design {
    pub(crate) duration: f64,
    pub(crate) start: [f64; 7],
    pub(crate) goal: [f64; 7],
    /// Expected wrench (six rows), constant; with it the primitive has feedback gains.
    pub(crate) expected: Option<[f64; 6]>,
    /// Expected torque on F1, F2, F3 (N m), constant.
    pub(crate) expected_gauges: [f64; 3],
    /// Sensitivity K1 of position, orientation and hand rows.
    pub(crate) sensitivity: [f64; 3],
    /// Duration at which the expectation is said to have been recorded; that of the primitive, if `None`.
    pub(crate) recorded: Option<f64>,
    /// Where the fingers close to (rad).
    pub(crate) closed: f64,
    pub(crate) bent: bool,
    /// Stiffness K of every row.
    pub(crate) stiffness: f64,
}

impl Default for Design {
    fn default() -> Self {
        Design {
            duration: 5.0,
            start: START,
            goal: GOAL,
            expected: None,
            expected_gauges: [0.0; 3],
            sensitivity: [4.0, 20.0, 400.0],
            recorded: None,
            closed: 0.25,
            bent: true,
            stiffness: 200.0,
        }
    }
}

/// The primitive, checked as the device checks it.
pub(crate) fn primitive<R: Real>(design: &Design) -> Primitive<R, KERNELS> {
    let zero = R::constant(0.0);
    let stiffness = R::constant(design.stiffness);
    let critical = R::constant(2.0 * design.stiffness.sqrt());
    let quick = R::constant((2.0 * design.stiffness).sqrt());
    let weights = if design.bent { weights() } else { vec![zero; ROWS * KERNELS] };
    let [p, o, h] = design.sensitivity;
    let feedback = design.expected.map(|_| {
        Feedback::new(
            GainSchedule::constant([p, p, p, o, o, o, 0.0, h, h, h].map(R::constant)).expect("gains"),
            GainSchedule::constant([R::constant(1.0); SENSORS]).expect("gains"),
            limits(R::constant(DISPLACEMENT), R::constant(ROTATION), R::constant(0.8)),
        )
        .expect("gains")
    });
    let expected = design.expected.map(|wrench| {
        let mut row = [zero; SENSORS];
        for (entry, value) in row.iter_mut().zip(wrench.into_iter().chain(design.expected_gauges)) {
            *entry = R::constant(value);
        }
        ExpectedWrench::new(&[row, row], R::constant(design.recorded.unwrap_or(design.duration)))
            .expect("an expectation")
    });
    let tables = MovementTables {
        control_period: R::constant(control::PERIOD),
        duration: R::constant(design.duration),
        alpha: R::constant(-(0.01f64).ln()),
        activation: R::constant(0.7),
        kernel_count: KERNELS,
        weights: &weights,
        gains: gains([stiffness; 4], [critical, quick, critical, critical]),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: configuration(design.start, [0.0, 0.25, 0.25, 0.25]),
        goal: configuration(design.goal, [0.0, design.closed, design.closed, design.closed]),
        start_velocity: Velocity::ZERO,
    };
    let model = ArmModel::new(Payload::SensorAndHand);
    let mut primitive = load::primitive(&model, &tables).expect("a movement this arm can run");
    primitive.set_feedback(feedback.as_ref());
    primitive.set_expected(expected.as_ref());
    primitive
}
