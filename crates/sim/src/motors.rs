//! Seven motors between pucks and joints: torque in, angles out, and the clock of physics.
//!
//! Physics advances in steps of half a slot. The torque of a step is the time average of what the pucks applied during
//! it, so that a command in the middle of a step counts from its own instant. Encoders sit on the motors: with elastic
//! cables all angles here are those of the motor side. Between two steps they are extrapolated with the velocity of the
//! last one: that is what an encoder shows at the latch.
//!
//! A puck that is not in torque mode shorts the windings: `tau = -b dtheta`, with b = J/2 ms from the rotor inertia J.
//! Barrett publishes no figure for the brake; with this one the arm sinks from home at some tenths of rad/s, and the
//! explicit step stays far from instability (step / time constant = 0.28).

use crate::puck_model::Drive;
use crate::steady_hand::SteadyHand;
use crate::time::{STEP_TICKS, Ticks, seconds};
use crate::world::World;
use puck::{Drives, Transmission};

/// Inertia of drive and rotor at each motor, kg m^2 (`wam7.toml` `rotor_inertia`).
const ROTOR_INERTIA: [f64; 7] = [0.00011631, 0.00011831, 0.00011831, 0.00010686, 1.685e-05, 1.745e-05, 1.42e-06];

/// Time constant of a shorted motor that drives nothing but its own inertia, s. Assumed.
const BRAKE_TIME_CONSTANT: f64 = 0.002;

/// Motors, transmission and the state of their end of the joints at the last physics step.
#[derive(Clone, Debug)]
pub(crate) struct Motors {
    transmission: Transmission<f64>,
    q: [f64; 7],
    dq: [f64; 7],
    stepped_at: Ticks,
    /// True torque constant of each motor: current units per N m. What a puck *reports* as IPNM is its own affair.
    units_per_newton_metre: [i32; 7],
    /// Torque times time since the last step, current units times ticks. Whole numbers, so that the sum does not depend
    /// on how often somebody looks.
    impulse: [i64; 7],
    /// Time spent braking since the last step.
    braked: [Ticks; 7],
    are_powered: bool,
    hand: SteadyHand,
}

impl Motors {
    /// Motors of the arm in `world`, without power, at time 0; the operator holds the arm as `patience` says.
    pub(crate) fn new(
        transmission: Transmission<f64>,
        drives: &Drives,
        world: &dyn World,
        patience: Option<Ticks>,
    ) -> Self {
        Self {
            transmission,
            q: world.motor_positions(),
            dq: world.motor_velocities(),
            stepped_at: 0,
            units_per_newton_metre: *drives.units_per_newton_metre(),
            impulse: [0; 7],
            braked: [0; 7],
            are_powered: false,
            hand: SteadyHand::new(world.motor_positions(), patience),
        }
    }

    /// True while motor power is on.
    pub(crate) fn are_powered(&self) -> bool {
        self.are_powered
    }

    /// Switches motor power.
    pub(crate) fn set_powered(&mut self, are_powered: bool) {
        self.are_powered = are_powered;
    }

    /// The arm has become active at `now`: the operator may let go.
    pub(crate) fn see_active(&mut self, now: Ticks) {
        self.hand.see_active(now);
    }

    /// The operator carries the arm home, from `now` on.
    pub(crate) fn carry_home(&mut self, now: Ticks) {
        self.hand.carry_home(now, self.q);
    }

    /// The pucks drive the motors like this for the next `duration`.
    pub(crate) fn drive(&mut self, drives: &[Drive; 7], duration: Ticks) {
        for (motor, drive) in drives.iter().enumerate() {
            match drive {
                Drive::Brake => self.braked[motor] += duration,
                Drive::Torque(units) => {
                    // A step lasts 13 889 ticks: neither the cast nor the product comes near its limit.
                    self.impulse[motor] += i64::from(*units) * duration as i64;
                }
            }
        }
    }

    /// When the next physics step is due.
    pub(crate) fn next_step(&self) -> Ticks {
        self.stepped_at + STEP_TICKS
    }

    /// One physics step over the interval that ends at [`Motors::next_step`], with viscous friction (N m s/rad) beyond
    /// the world's own.
    pub(crate) fn step(&mut self, world: &mut dyn World, friction: &[f64; 7]) {
        let speeds = self.transmission.motor_from_joint(&self.dq);
        let torques = std::array::from_fn(|motor| {
            let damping = ROTOR_INERTIA[motor] / BRAKE_TIME_CONSTANT;
            let braking = self.braked[motor] as f64 / STEP_TICKS as f64;
            let units = self.impulse[motor] as f64 / STEP_TICKS as f64;
            units / f64::from(self.units_per_newton_metre[motor]) - damping * speeds[motor] * braking
        });
        let driven = self.transmission.joint_torques_from_motor(&torques);
        let held = self.hand.torques(self.next_step(), &self.q, &self.dq);
        world.step(&std::array::from_fn(|joint| driven[joint] + held[joint] - friction[joint] * self.dq[joint]));
        self.q = world.motor_positions();
        self.dq = world.motor_velocities();
        self.stepped_at += STEP_TICKS;
        self.impulse = [0; 7];
        self.braked = [0; 7];
    }

    /// Motor angles at time `t` in the present step, rad.
    pub(crate) fn angles(&self, t: Ticks) -> [f64; 7] {
        let ahead = seconds(t - self.stepped_at);
        self.transmission.motor_from_joint(&std::array::from_fn(|joint| self.q[joint] + self.dq[joint] * ahead))
    }
}
