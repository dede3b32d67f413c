//! A rigid-body arm in f64 behind the real interface: counts in, torque frames out.
//!
//! The plant is built from the crate's own dynamics, which `golden_dynamics` proves against an independent library;
//! what it adds is what the controller does not have: dry friction with true sticking, encoder quantisation and delay.
//! The whole path through counts, frames and 14-bit torques is part of every test.

use std::collections::VecDeque;

use crate::hand_plant::Hand;
use control::command::Command;
use control::law::Gains;
use control::model::{ArmModel, Frames};
use control::plan::load;
use control::plan::primitive::Primitive;
use control::units::{JointPositions, JointVelocities, Vector7};
use control::{
    BusSample, Calibration, Cycle, CycleInput, CycleOutput, Event, Fault, LoadRefusal, Payload, RATE, Real, State,
    model,
};
use nalgebra::{SMatrix, Vector3};
use pinned_init::InPlaceWrite;
use puck::{Action, CanFrame, Counts, Group, RawWrench, Request, SafetyMode};

pub(crate) const KERNELS: usize = 50;
const SUBSTEPS: usize = 8;

pub(crate) struct Plant {
    pub(crate) model: ArmModel<f64>,
    pub(crate) q: Vector7<f64>,
    pub(crate) dq: Vector7<f64>,
    pub(crate) coulomb: Vector7<f64>,
    pub(crate) viscous: Vector7<f64>,
    /// World-frame force and torque of the environment on the tool.
    pub(crate) push: [f64; 6],
    /// Torque of what touches the arm where no sensor is, its elbow for one (N m, joint by joint).
    pub(crate) unseen: Vector7<f64>,
    /// A compliant plane: position of its surface on the x axis (m) and stiffness (N/m).
    pub(crate) wall: Option<(f64, f64)>,
    pub(crate) torque: Vector7<f64>,
    /// Weight of the hand that the wrist sensor carries (N).
    pub(crate) hand_weight: f64,
    /// Force that the sensor alone reports, along its x axis (N).
    pub(crate) glitch: f64,
    /// Wrench that the sensor alone reports, at the grasp point (N, N m, world axes).
    pub(crate) lie: [f64; 6],
    /// Share of the inertia of the hand that the sensor feels; 0 by default.
    pub(crate) inertia: f64,
    /// Mean acceleration of the joints in the last control period (rad/s^2).
    pub(crate) ddq: Vector7<f64>,
    /// The one value that a stuck sensor reports.
    pub(crate) stuck: Option<RawWrench>,
    /// True if what the sensor feels of the environment has the wrong sign.
    pub(crate) reversed: bool,
    /// True while the sensor's replies are lost.
    pub(crate) deaf: bool,
    /// The hand, if it is on the bus.
    pub(crate) hand: Option<Hand>,
    queue: VecDeque<Vector7<f64>>,
    calibration: Calibration<f64>,
}

impl Plant {
    pub(crate) fn new(q: [f64; 7], delay: usize) -> Self {
        Plant {
            model: ArmModel::new(Payload::SensorAndHand),
            q: Vector7::from(q),
            dq: Vector7::zeros(),
            coulomb: Vector7::from(model::FRICTION_COULOMB),
            viscous: Vector7::from(model::FRICTION_VISCOUS),
            push: [0.0; 6],
            unseen: Vector7::zeros(),
            wall: None,
            torque: Vector7::zeros(),
            hand_weight: model::HAND_MASS * 9.81,
            glitch: 0.0,
            lie: [0.0; 6],
            inertia: 0.0,
            ddq: Vector7::zeros(),
            stuck: None,
            reversed: false,
            deaf: false,
            hand: None,
            queue: (0..delay).map(|_| Vector7::zeros()).collect(),
            calibration: Calibration::nominal(Payload::SensorAndHand),
        }
    }

    pub(crate) fn frames(&self) -> Frames<f64> {
        Frames::new(&self.model, &JointPositions(self.q))
    }

    /// Counts that the pucks report, rounded down and wrapped to 22 bits.
    pub(crate) fn counts(&self) -> [Option<Counts>; 7] {
        let motor = self.calibration.transmission().motor_from_joint(&self.q.into());
        self.calibration.drives().counts(&motor).expect("finite").map(|counts| Some(counts.wrapped()))
    }

    /// Wrench of the environment on the tool right now (world axes).
    pub(crate) fn environment(&self) -> [f64; 6] {
        let mut wrench = self.push;
        if let Some((surface, stiffness)) = self.wall {
            let depth = self.frames().tool_pose().position.x - surface;
            wrench[0] -= stiffness * depth.max(0.0);
        }
        wrench
    }

    /// The wrist sensor: environment and weight of the hand, in sensor axes.
    pub(crate) fn wrench(&self) -> RawWrench {
        let frames = self.frames();
        let sign = if self.reversed { -1.0 } else { 1.0 };
        let [fx, fy, fz, nx, ny, nz] = self.environment().map(|part| sign * part);
        let [lx, ly, lz, mx, my, mz] = self.lie;
        let [fx, fy, fz, nx, ny, nz] = [fx + lx, fy + ly, fz + lz, nx + mx, ny + my, nz + mz];
        let mut weight = Vector3::new(0.0, 0.0, -self.hand_weight);
        if self.inertia != 0.0 {
            let twist = frames.jacobian().twist(&self.ddq);
            let at_tool: Vector3<f64> = twist.fixed_rows::<3>(0).into();
            let turning: Vector3<f64> = twist.fixed_rows::<3>(3).into();
            let centre = frames.sensor_to_world() * Vector3::from(model::HAND_CENTRE);
            let at_centre = at_tool + turning.cross(&(centre + frames.tool_to_sensor()));
            weight -= at_centre * (self.inertia * model::HAND_MASS);
        }
        let to_sensor = frames.sensor_to_world().transpose();
        let centre = frames.sensor_to_world() * Vector3::from(model::HAND_CENTRE);
        let force = Vector3::new(fx, fy, fz) + weight;
        let torque =
            Vector3::new(nx, ny, nz) - frames.tool_to_sensor().cross(&Vector3::new(fx, fy, fz)) + centre.cross(&weight);
        let counts = |v: Vector3<f64>, scale: f64| [0, 1, 2].map(|axis| (v[axis] * scale).floor() as i16);
        RawWrench {
            force: counts(to_sensor * force + Vector3::new(self.glitch, 0.0, 0.0), 256.0),
            torque: counts(to_sensor * torque, 4096.0),
            status: None,
        }
    }

    /// The frames of one cycle arrive; `None` leaves the last torque in the pucks.
    pub(crate) fn receive(&mut self, frames: Option<[CanFrame; 2]>) {
        let mut torque = self.queue.back().copied().unwrap_or(self.torque);
        if let Some(frames) = frames {
            let mut motors = [0.0; 7];
            for (frame, (group, offset)) in frames.iter().zip([(Group::ARM_TORQUES, 0), (Group::WRIST_TORQUES, 4)]) {
                let request = Request::decode(frame).expect("a valid frame");
                assert_eq!(request.to, group.into());
                let Action::PackedTorques { torques, .. } = request.action else { panic!("{request:?}") };
                for (slot, units) in torques.iter().enumerate() {
                    if offset + slot < 7 {
                        assert!(units.units().abs() < 4731, "above the safety module's warning: {units:?}");
                        motors[offset + slot] = f64::from(units.units()) / model::TORQUE_COUNTS[offset + slot];
                    }
                }
            }
            torque = Vector7::from(self.calibration.transmission().joint_torques_from_motor(&motors));
        }
        self.queue.push_back(torque);
        self.torque = self.queue.pop_front().expect("just pushed");
    }

    /// Torque of the mechanical stops on joints that have run into them: as stiff and as damped as one step of time
    /// allows.
    fn stops(&self, mass: &SMatrix<f64, 7, 7>, dt: f64) -> Vector7<f64> {
        Vector7::from_fn(|joint, _| {
            let (q, dq) = (self.q[joint], self.dq[joint]);
            let past = (q - model::POSITION_MAX[joint]).max(0.0) + (q - model::POSITION_MIN[joint]).min(0.0);
            let outward = if past * dq > 0.0 { dq } else { 0.0 };
            if past == 0.0 { 0.0 } else { -mass[(joint, joint)] * (0.02 * past / dt + 0.3 * outward) / dt }
        })
    }

    /// One control period of physics.
    pub(crate) fn advance(&mut self) {
        let dt = control::PERIOD / SUBSTEPS as f64;
        let before = self.dq;
        for _ in 0..SUBSTEPS {
            let frames = self.frames();
            let mass = self.model.mass_matrix(&frames);
            let bias =
                self.model.coriolis_torque(&frames, &JointVelocities(self.dq)).0 + self.model.gravity_torque(&frames).0;
            let environment = nalgebra::Vector6::from(self.environment());
            let external = frames.jacobian().transpose_times(&environment) + self.unseen;
            let damped = mass + SMatrix::<f64, 7, 7>::from_diagonal(&(self.viscous * dt));
            let inverse = damped.try_inverse().expect("a mass matrix");
            let stops = self.stops(&mass, dt);
            let free = inverse * (mass * self.dq + (self.torque - bias + external + stops) * dt);
            // Dry friction: impulses that stop each joint, or as much of that as friction can give.
            let mut impulse = Vector7::zeros();
            let mut velocity = free;
            for _ in 0..30 {
                for joint in 0..7 {
                    let bound = self.coulomb[joint] * dt;
                    let wanted = impulse[joint] - velocity[joint] / inverse[(joint, joint)];
                    let next = f64::clamp(wanted, -bound, bound);
                    velocity += inverse.column(joint) * (next - impulse[joint]);
                    impulse[joint] = next;
                }
            }
            self.dq = velocity;
            self.q += self.dq * dt;
        }
        self.ddq = (self.dq - before) / control::PERIOD;
    }
}

/// A controller of the nominal arm with these gains.
pub(crate) fn cycle<R: Real>(gains: Gains<R>) -> Box<Cycle<R, KERNELS>> {
    let nominal = Calibration::nominal(Payload::SensorAndHand);
    let Ok(cycle) = Box::new_uninit().write_init(Cycle::init(nominal, gains));
    cycle
}

/// The controller and the plant, joined.
pub(crate) struct Rig<R: Real> {
    pub(crate) cycle: Box<Cycle<R, KERNELS>>,
    pub(crate) plant: Plant,
    pub(crate) safety: SafetyMode,
    pub(crate) number: u64,
    /// Replies to leave out in the next cycle.
    pub(crate) lose: [bool; 7],
    /// Counts by which the replies of each motor have jumped.
    pub(crate) jump: [i32; 7],
    /// Motors whose encoders stand still, and where.
    pub(crate) stuck: [Option<Counts>; 7],
    /// A fault that the device has found.
    pub(crate) external: Option<Fault>,
    pub(crate) last: Option<CycleOutput>,
}

impl<R: Real> Rig<R> {
    pub(crate) fn new(q: [f64; 7], delay: usize) -> Self {
        Rig {
            cycle: cycle(Gains::tuned()),
            plant: Plant::new(q, delay),
            safety: SafetyMode::Active,
            number: 0,
            lose: [false; 7],
            jump: [0; 7],
            stuck: [None; 7],
            external: None,
            last: None,
        }
    }

    /// Gives the cycle a primitive that its arm can run.
    pub(crate) fn load(&mut self, primitive: &Primitive<R, KERNELS>) -> Result<(), LoadRefusal> {
        self.cycle.load(&load::check(self.cycle.model(), primitive).expect("a movement this arm can run"))
    }

    pub(crate) fn tick(&mut self, command: Option<Command>) -> CycleOutput {
        let mut positions = self.plant.counts();
        for ((position, lose), jump) in positions.iter_mut().zip(self.lose).zip(self.jump) {
            *position = position.filter(|_| !lose).map(|counts| Counts(counts.0 + jump).wrapped());
        }
        for (position, stuck) in positions.iter_mut().zip(self.stuck) {
            *position = position.map(|counts| stuck.unwrap_or(counts));
        }
        let sample = BusSample {
            positions,
            wrench: self.plant.stuck.or(Some(self.plant.wrench())).filter(|_| !self.plant.deaf),
            safety: Some(self.safety),
            hand: self.plant.hand.as_ref().map(Hand::sample),
        };
        let input = CycleInput { cycle: self.number, sample, command, external_fault: self.external };
        let output = self.cycle.step(&input);
        self.plant.receive(output.actuation.frames());
        if let Some(hand) = &mut self.plant.hand {
            hand.receive(output.actuation.hand_frame());
            hand.advance();
        }
        if self.safety == SafetyMode::Active {
            self.plant.advance();
        } else {
            // The pucks brake.
            self.plant.dq.fill(0.0);
        }
        self.number += 1;
        self.last = Some(output);
        output
    }

    pub(crate) fn command(&mut self, command: Command) -> CycleOutput {
        let output = self.tick(Some(command));
        assert_eq!(output.event, Some(Event::Accepted), "{command:?} in {:?}", output.record.state);
        output
    }

    pub(crate) fn run_for(&mut self, seconds: f64) {
        for _ in 0..(seconds * RATE).round() as usize {
            self.tick(None);
        }
    }

    /// Runs until the state is left; fails after `seconds`.
    pub(crate) fn until(&mut self, state: State, seconds: f64) {
        for _ in 0..(seconds * RATE) as usize {
            if self.tick(None).record.state == state {
                return;
            }
        }
        panic!("{state:?} not reached within {seconds} s: {:?}", self.last);
    }
}
