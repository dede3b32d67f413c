//! `ForceController`: proportional and windowed integral force control.
//!
//! Eq (12): `tau = -J^T (e + K_i integral_{t-Dt}^{t} e dt)`, `e = F_expected - F`, `F` the wrench of the environment on the
//! robot. With this sign it is negative feedback: a wall that pushes too little is pressed harder. The window makes the
//! integral a box filter of gain `K_i Dt`; against a rigid wall the force settles at `F_expected G/(1+G)`,
//! `G = P + K_i Dt`. `F` has to be low-passed before it comes here: with unit gain and a tick of delay a stiff contact is
//! marginally stable.

use crate::kinematics::Jacobian;
use crate::real::Real;
use crate::units::{JointTorques, Vector6};

/// Longest window (control periods): 0.5 s.
pub const WINDOW_CAPACITY: usize = 150;

/// Eq (12).
#[derive(Clone, Debug)]
pub struct ForceController<R: Real> {
    errors: [Vector6<R>; WINDOW_CAPACITY],
    length: usize,
    next: usize,
    sum: Vector6<R>,
    /// Errors taken in since the window was last summed afresh.
    rebuilt: Vector6<R>,
}

impl<R: Real> ForceController<R> {
    /// A controller with an empty window of `length` control periods (kept within 1 and [`WINDOW_CAPACITY`]).
    pub fn new(length: usize) -> Self {
        ForceController {
            errors: [Vector6::zeros(); WINDOW_CAPACITY],
            length: length.clamp(1, WINDOW_CAPACITY),
            next: 0,
            sum: Vector6::zeros(),
            rebuilt: Vector6::zeros(),
        }
    }

    /// Empties the window.
    pub fn reset(&mut self) {
        self.errors = [Vector6::zeros(); WINDOW_CAPACITY];
        self.next = 0;
        self.sum = Vector6::zeros();
        self.rebuilt = Vector6::zeros();
    }

    /// The command `-(P e + K_i dt sum e)` in the axes of the error (N, N m), world axes for [`ForceController::torque`].
    ///
    /// `frozen` (a torque saturates) keeps the window as it is. The error of this tick belongs to the window.
    pub fn command(&mut self, error: &Vector6<R>, proportional: R, integral: R, period: R, frozen: bool) -> Vector6<R> {
        if !frozen {
            if let Some(slot) = self.errors.get_mut(self.next) {
                self.sum += error - *slot;
                self.rebuilt += error;
                *slot = *error;
            }
            self.next += 1;
            if self.next >= self.length {
                // A running sum drifts by rounding; once per turn it is replaced by the sum of what is in the window.
                self.next = 0;
                self.sum = self.rebuilt;
                self.rebuilt = Vector6::zeros();
            }
        }
        -(error * proportional + self.sum * (integral * period))
    }

    /// Joint torque of a command in world axes: `J^T u`.
    pub fn torque(jacobian: &Jacobian<R>, command: &Vector6<R>) -> JointTorques<R> {
        JointTorques(jacobian.transpose_times(command))
    }
}
