//! Motors that turn the joints through elastic cables: two inertias with a spring between them for each joint.
//!
//! All quantities are reflected to the joint. The motor of joint i obeys `J dw = tau - s - B w - Coulomb friction`, the
//! joint gets `s = k (theta - q) + d (w - dq)`. The joint loses its armature to the motor. Of the friction, all of the
//! viscous part and 70 % of the dry part act at the motor (brushes, bearings and the fast first stage of the cables),
//! 30 % of the dry part at the joint (its bearings, the cables' last turn). The coupled pairs (joints 2 and 3, 5 and 6
//! share two motors) are taken joint by joint: their common stiffness is not known better than that.
//!
//! Integrated with the physics step, semi-implicitly on both sides, so that energy neither grows nor leaks as long as
//! an oscillation turns by less than two radians in a step; the fastest, of joint 7, turns by 0.4. Dry friction is
//! solved exactly for one motor: it takes at most `h c` from its momentum and never turns its sign.

use super::Addresses;
use super::imperfections::Cables;
use crate::STEP_SECONDS;
use mujoco_rs::prelude::{MjData, MjModel};

/// Share of a joint's dry friction that acts at its motor.
const COULOMB_AT_MOTOR: f64 = 0.7;

/// Seven motors, each at its end of a cable.
#[derive(Clone, Debug)]
pub(super) struct Motors {
    /// Angles, rad.
    pub(super) positions: [f64; 7],
    /// Velocities, rad/s.
    pub(super) velocities: [f64; 7],
    inertia: [f64; 7],
    viscous: [f64; 7],
    coulomb: [f64; 7],
    stiffness: [f64; 7],
    damping: [f64; 7],
    torque_limits: [[f64; 2]; 7],
}

impl Motors {
    /// Takes armature and the motor's share of friction out of the model's joints. To be called before anything is
    /// computed.
    pub(super) fn take_from(model: &mut MjModel, addresses: &Addresses, cables: &Cables) -> Self {
        let at = addresses.velocities;
        let inertia = at.map(|i| std::mem::take(&mut model.dof_armature_mut()[i]));
        let viscous = at.map(|i| std::mem::take(&mut model.dof_damping_mut()[i]));
        let coulomb = at.map(|i| {
            let all = model.dof_frictionloss()[i];
            model.dof_frictionloss_mut()[i] = (1.0 - COULOMB_AT_MOTOR) * all;
            COULOMB_AT_MOTOR * all
        });
        Self {
            positions: [0.0; 7],
            velocities: [0.0; 7],
            damping: std::array::from_fn(|i| 2.0 * cables.damping_ratio * (cables.stiffness[i] * inertia[i]).sqrt()),
            inertia,
            viscous,
            coulomb,
            stiffness: cables.stiffness,
            torque_limits: addresses.motors.map(|i| model.actuator_ctrlrange()[i]),
        }
    }

    /// Lets the motors stand where their cables carry the arm's weight, so that nothing swings at the start.
    pub(super) fn settle(&mut self, data: &MjData<Box<MjModel>>, addresses: &Addresses) {
        let (q, bias) = (data.qpos(), data.qfrc_bias());
        for i in 0..7 {
            self.positions[i] = q[addresses.positions[i]] + bias[addresses.velocities[i]] / self.stiffness[i];
        }
    }

    /// One physics step of the motors under their torques, N m; gives the torques of the cables on the joints.
    pub(super) fn step(&mut self, q: &[f64; 7], dq: &[f64; 7], torques: &[f64; 7]) -> [f64; 7] {
        std::array::from_fn(|i| {
            let (theta, speed) = (self.positions[i], self.velocities[i]);
            let cable = self.stiffness[i] * (theta - q[i]) + self.damping[i] * (speed - dq[i]);
            let [low, high] = self.torque_limits[i];
            let drive = torques[i].clamp(low, high) - cable;
            let inertia = self.inertia[i] + STEP_SECONDS * self.viscous[i];
            let momentum = self.inertia[i] * speed + STEP_SECONDS * drive;
            let left = (momentum.abs() - STEP_SECONDS * self.coulomb[i]).max(0.0);
            self.velocities[i] = left.copysign(momentum) / inertia;
            self.positions[i] += STEP_SECONDS * self.velocities[i];
            cable
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Joint inertia at the end of the cable, kg m^2.
    const JOINT_INERTIA: f64 = 0.02;

    /// A frictionless motor of 0.003 kg m^2 on a cable of 300 N m/rad, without damping.
    fn motors() -> Motors {
        Motors {
            positions: [0.0; 7],
            velocities: [0.0; 7],
            inertia: [0.003; 7],
            viscous: [0.0; 7],
            coulomb: [0.0; 7],
            stiffness: [300.0; 7],
            damping: [0.0; 7],
            torque_limits: [[-10.0, 10.0]; 7],
        }
    }

    /// A joint stretched by 10 mrad and released; its angle, velocity and the motor for each of `steps` steps.
    fn released(mut motors: Motors, steps: usize) -> Vec<([f64; 2], [f64; 2])> {
        let (mut q, mut dq) = ([0.01; 7], [0.0; 7]);
        (0..steps)
            .map(|_| {
                let torques = motors.step(&q, &dq, &[0.0; 7]);
                for i in 0..7 {
                    dq[i] += STEP_SECONDS * torques[i] / JOINT_INERTIA;
                    q[i] += STEP_SECONDS * dq[i];
                }
                ([q[6], dq[6]], [motors.positions[6], motors.velocities[6]])
            })
            .collect()
    }

    #[test]
    fn a_released_cable_swings_with_its_frequency_and_neither_gains_nor_loses_energy() {
        let seconds = 20.0;
        let way = released(motors(), (seconds / STEP_SECONDS) as usize);
        let crossings =
            way.windows(2).filter(|w| (w[0].0[0] - w[0].1[0] > 0.0) != (w[1].0[0] - w[1].1[0] > 0.0)).count();
        let frequency = crossings as f64 / 2.0 / seconds;
        let expected = (300.0_f64 * (1.0 / 0.003 + 1.0 / JOINT_INERTIA)).sqrt() / std::f64::consts::TAU;
        assert!((frequency / expected - 1.0).abs() < 0.01, "{frequency} Hz, not {expected} Hz");
        let energy = |([q, dq], [theta, omega]): &([f64; 2], [f64; 2])| {
            0.5 * (300.0 * (q - theta).powi(2) + JOINT_INERTIA * dq * dq + 0.003 * omega * omega)
        };
        let mean = |part: &[([f64; 2], [f64; 2])]| part.iter().map(energy).sum::<f64>() / part.len() as f64;
        let (first, last) = (mean(&way[..1800]), mean(&way[way.len() - 1800..]));
        assert!((last / first - 1.0).abs() < 0.01, "{first} J become {last} J");
        // Nothing outside acts: the common centre stays.
        let ([q, _], [theta, _]) = way[way.len() - 1];
        let centre = (JOINT_INERTIA * q + 0.003 * theta) / (JOINT_INERTIA + 0.003);
        assert!((centre - 0.01 * JOINT_INERTIA / (JOINT_INERTIA + 0.003)).abs() < 1e-6, "{centre}");
    }

    #[test]
    fn damping_ends_the_swing_and_dry_friction_keeps_the_motor_where_it_is() {
        let way = released(Motors { damping: [0.1; 7], ..motors() }, 3600);
        let ([q, _], [theta, _]) = way[3599];
        assert!((q - theta).abs() < 1e-5, "still {} rad apart", q - theta);
        // 10 mrad of cable are 3 N m: a motor with 3.1 N m of friction never moves.
        let stuck = released(Motors { coulomb: [3.1; 7], ..motors() }, 3600);
        assert!(stuck.iter().all(|(_, motor)| *motor == [0.0; 2]));
        assert!(stuck.iter().any(|([q, _], _)| *q < -0.009), "the joint swings on its own");
    }
}
