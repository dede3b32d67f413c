//! A hand of four worm-driven digits behind its frames: counts and gauges out, a torque frame in.
//!
//! A finger's drive has the reflected inertia of its rotor, viscous and Coulomb friction, and a worm: a load can stop
//! it but never turn it. Objects are springs that each inner link runs into; TorqueSwitch and outer links are left to
//! the simulator.

use control::model::hand::EFFICIENCY;
use control::{HandSample, PERIOD};
use puck::hand::{INNER_LINK_RATIO, SPREAD_RATIO};
use puck::{Action, CanFrame, Counts, Group, Request, gauge};

const SUBSTEPS: usize = 8;
const UNITS_PER_NEWTON_METRE: f64 = 20_000.0;
const RATIOS: [f64; 4] = [SPREAD_RATIO, INNER_LINK_RATIO, INNER_LINK_RATIO, INNER_LINK_RATIO];

/// Digits in the order spread, F1, F2, F3.
pub(crate) struct Hand {
    pub(crate) q: [f64; 4],
    pub(crate) dq: [f64; 4],
    /// Where each finger meets an object (rad), and how stiff that is (N m/rad).
    pub(crate) object: [Option<(f64, f64)>; 3],
    /// Reading of the gauges without load (counts).
    pub(crate) unloaded: f64,
    /// Objects are met by the inner links, which no gauge feels.
    pub(crate) unfelt: bool,
    /// Turns the sign of the gauges over.
    pub(crate) reversed_gauges: bool,
    /// Friction of the drives, as a multiple of the model's.
    pub(crate) friction: f64,
    /// Digits whose replies are lost.
    pub(crate) silent: bool,
    /// Torque that arrives at the digits (N m).
    pub(crate) torque: [f64; 4],
    /// Frames received so far.
    pub(crate) frames: usize,
}

impl Hand {
    pub(crate) fn new(q: [f64; 4]) -> Self {
        Hand {
            q,
            dq: [0.0; 4],
            object: [None; 3],
            unloaded: 1990.0,
            unfelt: false,
            reversed_gauges: false,
            friction: 1.0,
            silent: false,
            torque: [0.0; 4],
            frames: 0,
        }
    }

    /// Torque with which a finger presses on its object (N m).
    pub(crate) fn pressing(&self, finger: usize) -> f64 {
        self.object[finger].map_or(0.0, |(place, stiffness)| stiffness * (self.q[1 + finger] - place).max(0.0))
    }

    pub(crate) fn sample(&self) -> HandSample {
        if self.silent {
            return HandSample::default();
        }
        let counts =
            |angle: f64, ratio: f64| Some(Counts((angle * ratio * 4096.0 / std::f64::consts::TAU).floor() as i32));
        let [spread, fingers @ ..] = self.q;
        let [f1, f2, f3] = fingers.map(|angle| counts(angle, INNER_LINK_RATIO));
        let zero = gauge::torque(self.unloaded);
        HandSample {
            primary: [f1, f2, f3, counts(spread, SPREAD_RATIO)],
            secondary: fingers.map(|angle| counts(angle, 50.0)),
            gauges: [0, 1, 2].map(|finger| {
                let sign = if self.reversed_gauges { -1.0 } else { 1.0 };
                let measured = if self.unfelt { 0.0 } else { self.pressing(finger) };
                Some(gauge::counts(zero + sign * measured).round() as u16)
            }),
        }
    }

    /// The frame of one cycle; without one the drives are off.
    pub(crate) fn receive(&mut self, frame: Option<CanFrame>) {
        self.torque = [0.0; 4];
        let Some(frame) = frame else { return };
        self.frames += 1;
        let request = Request::decode(&frame).expect("a valid frame");
        assert_eq!(request.to, Group::HAND.into());
        let Action::PackedTorques { torques, .. } = request.action else { panic!("{request:?}") };
        let [f1, f2, f3, spread] = torques.map(|torque| f64::from(torque.units()) / UNITS_PER_NEWTON_METRE);
        for (digit, motor) in [spread, f1, f2, f3].into_iter().enumerate() {
            self.torque[digit] = motor * RATIOS[digit] * EFFICIENCY[digit];
        }
    }

    /// One control period of physics.
    pub(crate) fn advance(&mut self) {
        let dt = PERIOD / SUBSTEPS as f64;
        let inertia = [4e-4, 2.2e-3, 2.2e-3, 2.2e-3];
        let (viscous, coulomb) = ([0.1, 0.49, 0.49, 0.49].map(|viscous| viscous * self.friction), 0.1 * self.friction);
        for _ in 0..SUBSTEPS {
            for digit in 0..4 {
                let load = if digit == 0 { 0.0 } else { self.pressing(digit - 1) };
                let speed = (self.dq[digit] + dt * self.torque[digit] / inertia[digit])
                    / (1.0 + dt * viscous[digit] / inertia[digit]);
                // Friction, and a load on the closing side only: the worm bears what would help.
                let against = coulomb + if speed > 0.0 { load } else { 0.0 };
                let stopped = dt * against / inertia[digit];
                self.dq[digit] = speed.signum() * (speed.abs() - stopped).max(0.0);
                self.q[digit] += dt * self.dq[digit];
            }
        }
    }
}
