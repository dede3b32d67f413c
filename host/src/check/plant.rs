//! An ideal arm: the model's rigid bodies, rotors and friction, moved by joint torques, measured in motor counts.
//!
//! `ddq = M(q)^-1 (tau - c(q, dq) - g(q) - friction(dq))`, semi-implicit Euler in four sub-steps of a control period.
//! No noise, no lost frames, no delay: what fails here fails on every arm.

use control::model;
use control::model::{ArmModel, Calibration, Frames};
use control::units::{JointAccelerations, JointPositions, JointVelocities, Vector7};
use puck::force_torque::{NEWTON_METRE_PER_COUNT, NEWTON_PER_COUNT};
use puck::{Counts, RawWrench};

use lab::arm;
use lab::plan::PERIOD;

/// Sub-steps of one control period.
const SUB_STEPS: usize = 4;

/// Speed at which the Coulomb friction has reached 76 % of its value, rad/s: smooths the sign of the velocity.
const FRICTION_SPEED: f64 = 0.01;

/// The state of the arm.
pub(super) struct Plant {
    calibration: Calibration<f64>,
    pub(super) q: Vector7<f64>,
    pub(super) dq: Vector7<f64>,
}

impl Plant {
    /// At rest at `q` (rad).
    pub(super) fn at(q: [f64; 7]) -> Plant {
        Plant { calibration: Calibration::nominal(arm::PAYLOAD), q: Vector7::from(q), dq: Vector7::zeros() }
    }

    /// The positions that the pucks report; `None` if the position is not finite any more.
    pub(super) fn counts(&self) -> Option<[Counts; 7]> {
        let motors = self.calibration.transmission().motor_from_joint(&self.q.into());
        self.calibration.drives().counts(&motors).ok()
    }

    /// Frames at the present position.
    pub(super) fn frames(&self) -> Frames<f64> {
        Frames::new(&arm::MODEL, &JointPositions(self.q))
    }

    /// Returns what the wrist sensor measures: the weight of the hand, and nothing of its inertia.
    pub(super) fn wrench(&self) -> RawWrench {
        let weight = arm::MODEL.hanging_weight(&self.frames());
        let counts = |first: usize, unit: f64| [0, 1, 2].map(|axis| (weight[first + axis] / unit).round() as i16);
        RawWrench { force: counts(0, NEWTON_PER_COUNT), torque: counts(3, NEWTON_METRE_PER_COUNT), status: None }
    }

    /// Moves for one control period under constant torque (N m).
    pub(super) fn step(&mut self, torque: &Vector7<f64>) {
        let model: &ArmModel<f64> = &arm::MODEL;
        let period = PERIOD / SUB_STEPS as f64;
        for _ in 0..SUB_STEPS {
            let frames = self.frames();
            let still = JointAccelerations(Vector7::zeros());
            let bias = model.inverse_dynamics(&frames, &JointVelocities(self.dq), &still).0;
            let friction = Vector7::from_fn(|joint, _| {
                let dq = self.dq[joint];
                model::FRICTION_COULOMB[joint] * (dq / FRICTION_SPEED).tanh() + model::FRICTION_VISCOUS[joint] * dq
            });
            let force = torque - bias - friction;
            // A mass matrix is positive definite; should rounding ever deny it, the arm stands still for a sub-step.
            let ddq = model.mass_matrix(&frames).cholesky().map_or_else(Vector7::zeros, |factor| factor.solve(&force));
            self.dq += ddq * period;
            self.q += self.dq * period;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gravity_torque_holds_the_arm_still() {
        let mut plant = Plant::at([0.3, -0.5, 0.2, 1.8, -0.4, 0.6, 0.1]);
        let start = plant.q;
        for _ in 0..control::RATE_HZ {
            let torque = arm::MODEL.gravity_torque(&plant.frames()).0;
            plant.step(&torque);
        }
        assert!((plant.q - start).amax() < 1e-9);
    }

    #[test]
    fn without_torque_the_outstretched_arm_falls() {
        let mut plant = Plant::at([0.0, 1.2, 0.0, 0.0, 0.0, 0.0, 0.0]);
        let height = plant.frames().tool_pose().position.z;
        for _ in 0..control::RATE_HZ / 5 {
            plant.step(&Vector7::zeros());
        }
        assert!(plant.frames().tool_pose().position.z < height - 0.05);
    }
}
