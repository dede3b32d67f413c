//! An arm with elastic cables and without friction, in f64: what a law has to damp by itself.
//!
//! Two inertias with a spring and a damper between them at each joint, as `crates/sim` has them; encoders and torques
//! sit on the motors. A torque acts [`LATENCY`] steps of time after the positions were latched, and stays until the
//! next one. The wrist sensor feels what touches the hand, the weight of the hand, and its inertia.

use std::collections::VecDeque;

use control::model::{self, ArmModel, Frames};
use control::units::{JointPositions, JointVelocities, Vector7};
use control::{Calibration, PERIOD, Payload, RATE};
use nalgebra::{SMatrix, Vector3, Vector6};
use puck::{Counts, RawWrench};

/// Steps of time in a control period.
pub(crate) const SUBSTEPS: usize = 8;

/// Time from the latch of the positions to the torque that answers them: 1.25 ms, in steps of time.
const LATENCY: usize = (1.25e-3 * RATE * SUBSTEPS as f64 + 0.5) as usize;

/// Stiffness between motor and joint, at the joint (N m/rad), and share of critical damping; as in `crates/sim`.
const CABLES: [f64; 7] = [4000.0, 4000.0, 2500.0, 2000.0, 350.0, 350.0, 120.0];
const DAMPING_RATIO: f64 = 0.05;

/// Counts per revolution: sixteen times those of the arm, so that steps of counts do not blur what is measured.
const COUNTS: i32 = 65_536;

/// Rate at which the motors are braked until the arm has come to rest (1/s): a loop that shakes would never begin.
const BRAKE: f64 = 300.0;

/// Differences from the nominal arm.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Variation {
    /// Factor on the torque beyond the one at rest.
    pub(crate) gain: f64,
    /// Additional delay of the torque, in steps of time.
    pub(crate) delay: usize,
    /// Factor on the stiffness of the cables.
    pub(crate) cables: f64,
    /// Mass at the grasp point that nobody told the controller (kg).
    pub(crate) payload: f64,
    /// Stiffness of a wall that touches the hand (N/m), and the axis across it.
    pub(crate) wall: (f64, usize),
    /// A joint (0 to 6) that stands at its soft limit and is pushed out by this torque (N m, signed).
    pub(crate) pressed: Option<(usize, f64)>,
}

impl Variation {
    pub(crate) const NONE: Self =
        Variation { gain: 1.0, delay: 0, cables: 1.0, payload: 0.0, wall: (0.0, 0), pressed: None };
}

/// The arm.
pub(crate) struct Plant {
    links: ArmModel<f64>,
    variation: Variation,
    q: Vector7<f64>,
    dq: Vector7<f64>,
    ddq: Vector7<f64>,
    theta: Vector7<f64>,
    pub(crate) omega: Vector7<f64>,
    stiffness: Vector7<f64>,
    damping: Vector7<f64>,
    rotors: Vector7<f64>,
    queue: VecDeque<Vector7<f64>>,
    /// Torque at rest, from which on the gain counts; `None` until the arm has come to rest.
    still: Option<Vector7<f64>>,
    /// The motors are braked: the arm comes to rest, whatever the loop does.
    pub(crate) braked: bool,
    /// Where the hand touches the wall (m).
    anchor: Option<Vector3<f64>>,
    /// Force that pushes the hand at the grasp point (N, world axes).
    pub(crate) push: Vector3<f64>,
    calibration: Calibration<f64>,
}

impl Plant {
    /// An arm at rest at `q`, its cables bent by its weight.
    pub(crate) fn new(q: [f64; 7], variation: Variation) -> Self {
        let links = ArmModel::disturbed(Payload::SensorAndHand, 1.0, variation.payload);
        let q = Vector7::from(q);
        let stiffness = Vector7::from(CABLES) * variation.cables;
        let rotors = Vector7::from(model::REFLECTED_INERTIA);
        let gravity = links.gravity_torque(&Frames::new(&links, &JointPositions(q))).0;
        let calibration =
            Calibration::new([COUNTS; 7], model::TORQUE_COUNTS.map(|counts| counts as i32), Payload::SensorAndHand);
        Plant {
            links,
            q,
            dq: Vector7::zeros(),
            ddq: Vector7::zeros(),
            theta: q + gravity.component_div(&stiffness),
            omega: Vector7::zeros(),
            damping: stiffness.zip_map(&rotors, |k, j| 2.0 * DAMPING_RATIO * (k * j).sqrt()),
            stiffness,
            rotors,
            queue: (0..LATENCY + variation.delay).map(|_| gravity).collect(),
            still: None,
            braked: true,
            anchor: None,
            push: Vector3::zeros(),
            calibration: calibration.expect("scales"),
            variation,
        }
    }

    pub(crate) fn calibration(&self) -> Calibration<f64> {
        self.calibration
    }

    fn frames(&self) -> Frames<f64> {
        Frames::new(&self.links, &JointPositions(self.q))
    }

    /// Counts that the pucks report.
    pub(crate) fn counts(&self) -> [Option<Counts>; 7] {
        let motor = self.calibration.transmission().motor_from_joint(&self.theta.into());
        self.calibration.drives().counts(&motor).expect("finite").map(|counts| Some(counts.wrapped()))
    }

    /// From now on the arm is touched by its wall, and its gain is that of the variation.
    pub(crate) fn settle(&mut self) {
        self.still = self.queue.back().copied();
        self.braked = false;
        self.anchor = Some(self.frames().tool_pose().position);
    }

    /// Force of the wall on the tool (N, world axes). It holds on to the hand: a contact that does not part.
    fn wall(&self, frames: &Frames<f64>) -> Vector3<f64> {
        let (stiffness, axis) = self.variation.wall;
        let mut force = Vector3::zeros();
        if let Some(anchor) = self.anchor {
            force[axis] = -stiffness * (frames.tool_pose().position[axis] - anchor[axis]);
        }
        force
    }

    /// The wrist sensor, in its axes.
    pub(crate) fn wrench(&self) -> RawWrench {
        let frames = self.frames();
        let gravity = Vector3::from(model::GRAVITY);
        let (touch, held) = (self.wall(&frames) + self.push, self.variation.payload);
        let acceleration = frames.jacobian().twist(&self.ddq);
        let at_tool: Vector3<f64> = acceleration.fixed_rows::<3>(0).into();
        let turning: Vector3<f64> = acceleration.fixed_rows::<3>(3).into();
        let to_sensor = frames.sensor_to_world().transpose();
        // From the sensor's origin, world axes.
        let (tool, centre) = (-frames.tool_to_sensor(), frames.sensor_to_world() * Vector3::from(model::HAND_CENTRE));
        let at_centre = at_tool + turning.cross(&(centre - tool));
        let hand = (gravity - at_centre) * model::HAND_MASS;
        let load = (gravity - at_tool) * held + touch;
        let force = hand + load;
        let torque = centre.cross(&hand) + tool.cross(&load);
        let counts = |v: Vector3<f64>, scale: f64| [0, 1, 2].map(|axis| (v[axis] * scale).round() as i16);
        RawWrench { force: counts(to_sensor * force, 256.0), torque: counts(to_sensor * torque, 4096.0), status: None }
    }

    /// One control period with this torque (N m), `None` without.
    pub(crate) fn advance(&mut self, torque: Option<Vector7<f64>>) {
        let dt = PERIOD / SUBSTEPS as f64;
        let wanted = torque.unwrap_or_else(Vector7::zeros);
        let torque = self.still.map_or(wanted, |still| still + (wanted - still) * self.variation.gain);
        let frames = self.frames();
        let mass: SMatrix<f64, 7, 7> = self.links.link_mass_matrix(&frames);
        let inverse = mass.try_inverse().expect("a mass matrix");
        let bias =
            self.links.gravity_torque(&frames).0 + self.links.coriolis_torque(&frames, &JointVelocities(self.dq)).0;
        let jacobian = frames.jacobian();
        for _ in 0..SUBSTEPS {
            self.queue.push_back(torque);
            let motor = self.queue.pop_front().expect("just pushed");
            let brake = if self.braked { BRAKE * dt } else { 0.0 };
            self.omega /= 1.0 + brake;
            let cable = self.stiffness.component_mul(&(self.theta - self.q))
                + self.damping.component_mul(&(self.omega - self.dq));
            self.omega += (motor - cable).component_div(&self.rotors) * dt;
            self.theta += self.omega * dt;
            let wall = if self.variation.wall.0 > 0.0 { self.wall(&self.frames()) } else { Vector3::zeros() };
            let touch = wall + self.push;
            let mut external = jacobian.transpose_times(&Vector6::new(touch.x, touch.y, touch.z, 0.0, 0.0, 0.0));
            if let (Some((joint, torque)), true) = (self.variation.pressed, self.still.is_some()) {
                external[joint] += torque;
            }
            self.ddq = inverse * (cable - bias + external);
            self.dq += self.ddq * dt;
            self.q += self.dq * dt;
        }
    }
}
