//! `ForceController`: proportional and windowed integral force control.
//!
//! Eq (12): `tau = -J^T (e + K_i integral_{t-Dt}^{t} e dt)`, `e = F_expected - F`, `F` the wrench of the environment on
//! the robot. With this sign it is negative feedback: a wall that pushes too little is pressed harder. The window makes
//! the integral a box filter of gain `K_i Dt`; against a rigid wall the force settles at `F_expected G/(1+G)`,
//! `G = P + K_i Dt`. `F` has to be low-passed before it comes here: with unit gain and a tick of delay a stiff contact
//! is marginally stable.

use pinned_init::{Init, init};

use crate::law::window::Window;
use crate::model::kinematics::Jacobian;
use crate::real::Real;
use crate::time::periods;
use crate::units::{JointTorques, Vector6};

/// Longest window: 0.5 s, in control periods.
pub const WINDOW_CAPACITY: usize = periods(0.5) as usize;

/// Eq (12).
#[derive(Clone, Debug)]
pub struct ForceController<R: Real> {
    window: Window<R, 6, WINDOW_CAPACITY>,
}

impl<R: Real> ForceController<R> {
    /// Makes, in its place, a controller with an empty window of `length` control periods (kept within 1 and
    /// [`WINDOW_CAPACITY`]).
    pub fn init(length: usize) -> impl Init<Self> {
        init!(ForceController { window <- Window::init(length) })
    }

    /// Empties the window and gives it `length` control periods.
    pub fn restart(&mut self, length: usize) {
        self.window.restart(length);
    }

    /// The command `-(P e + K_i dt sum e)` in the axes of the error (N, N m), world axes for
    /// [`ForceController::torque`].
    ///
    /// `frozen` (a torque saturates) keeps the window as it is. The error of this tick belongs to the window.
    pub fn command(&mut self, error: &Vector6<R>, proportional: R, integral: R, period: R, frozen: bool) -> Vector6<R> {
        if !frozen {
            self.window.push(error);
        }
        -(error * proportional + self.window.sum() * (integral * period))
    }

    /// Joint torque of a command in world axes: `J^T u`.
    pub fn torque(jacobian: &Jacobian<R>, command: &Vector6<R>) -> JointTorques<R> {
        JointTorques(jacobian.transpose_times(command))
    }
}
