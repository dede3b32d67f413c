//! `ForceController`: proportional and windowed integral force control.
//!
//! Eq (12): `tau = -J^T (P e + K_i integral_{t-Dt}^{t} e dt)`, `e = F_expected - F`, `F` the wrench of the environment
//! on the robot. With this sign it is negative feedback: a wall that pushes too little is pressed harder. The window
//! makes the integral a box filter of gain `K_i Dt`; against a rigid wall the force settles at `F_expected G/(1+G)`,
//! `G = P + K_i Dt`. `F` has to be low-passed before it comes here: with unit gain and a tick of delay a stiff contact
//! is marginally stable.

use pinned_init::{Init, init};

use crate::law::gains::FORCE_AT_REST;
use crate::law::window::Window;
use crate::real::{Real, at_least, at_most, sqrt};
use crate::time::{PERIOD, periods};
use crate::units::Vector6;

/// Longest window: 0.5 s, in control periods.
pub const WINDOW_CAPACITY: usize = periods(0.5) as usize;

/// Force (N) and torque (N m) that may be applied to nothing. More is applied only where the sensor measures that
/// something presses back: a run that expects to press on what is not there would else throw the arm (30 N: 1.7 m/s).
const UNCONFIRMED: [f64; 2] = [5.0, 0.5];

/// Most that may be applied along a push, in parts of the push, if that is more than `UNCONFIRMED`. It is the gain of
/// Eq (12) at rest in a compliant run: nothing presses back on a hand that gives way (decision 0131). At most twice
/// `UNCONFIRMED`, all that Eq (12) commands: a light push does not release what is expected (decision 0133).
const GIVING: f64 = FORCE_AT_REST;

/// Fastest rise of what counts as confirmed (N/s, N m/s). A guard, not measured: the sensor also feels the inertia of
/// the hand, which "presses back" while the hand is thrown.
const CONFIRMATION: [f64; 2] = [20.0, 2.0];

/// Age of the error whose mean with the present one a run takes in proportion: 10 ms, in control periods. The sensor
/// feels the inertia of the hand as well, and that drives the cables of J1, J2 and J5 at 21 to 29 Hz where there is no
/// friction; 5 ms later and a quarter less it does not. A low-pass that does as much is too late at 4 Hz, where the
/// wrist swings on a wall.
const AGO: usize = periods(0.01) as usize;

/// Eq (12).
#[derive(Clone, Debug)]
pub struct ForceController<R: Real> {
    window: Window<R, 6, WINDOW_CAPACITY>,
    /// Force and torque (N, N m) that the environment confirms; `None` before the first cycle, when the arm rests and
    /// what is measured is a load.
    confirmed: Option<[R; 2]>,
}

impl<R: Real> ForceController<R> {
    /// Makes, in its place, a controller with an empty window of `length` control periods (kept within 1 and
    /// [`WINDOW_CAPACITY`]).
    pub fn init(length: usize) -> impl Init<Self> {
        init!(ForceController { window <- Window::init(length), confirmed: None })
    }

    /// Empties the window and gives it `length` control periods.
    pub fn restart(&mut self, length: usize) {
        self.window.restart(length);
        self.confirmed = None;
    }

    /// The command `-(P e + K_i dt sum e)` in the axes of the error (N, N m), world axes for
    /// [`Frames::joint_torques`](crate::model::kinematics::Frames::joint_torques).
    ///
    /// `frozen` (a torque saturates) keeps the window as it is. The error of this tick belongs to the window.
    pub fn command(&mut self, error: &Vector6<R>, proportional: R, integral: R, period: R, frozen: bool) -> Vector6<R> {
        if !frozen {
            self.window.push(error);
        }
        -(error * proportional + self.window.sum() * (integral * period))
    }

    /// The same, whose proportional part takes the mean of the error and of the one 10 ms ago.
    pub fn calm_command(
        &mut self,
        error: &Vector6<R>,
        proportional: R,
        integral: R,
        period: R,
        frozen: bool,
    ) -> Vector6<R> {
        let command = self.command(error, proportional, integral, period, frozen);
        match self.window.before(AGO) {
            Some(before) => command + (error - before) * (proportional * R::constant(0.5)),
            None => command,
        }
    }

    /// The wrench that is to be applied (world axes), its force and its torque cut to `UNCONFIRMED` beyond what the
    /// environment presses back along them, as the sensor measures it; along a push to `GIVING` times the push, between
    /// five sixths of `UNCONFIRMED` and twice that. Their directions are kept.
    pub fn confirmed(&mut self, wanted: &Vector6<R>, measured: &Vector6<R>) -> Vector6<R> {
        let mut applied = *wanted;
        let before = self.confirmed.map_or([None; 2], |before| before.map(Some));
        let rows = self
            .confirmed
            .insert([R::constant(0.0); 2])
            .iter_mut()
            .zip(before)
            .zip(UNCONFIRMED)
            .zip(CONFIRMATION)
            .zip([0, 3]);
        for ((((confirmed, before), unconfirmed), rise), first) in rows {
            let mut part = applied.fixed_rows_mut::<3>(first);
            let (length, unconfirmed) = (sqrt(part.dot(&part)), R::constant(unconfirmed));
            if length > unconfirmed {
                let push = part.dot(&measured.fixed_rows::<3>(first)) / length;
                let given = at_most(push * R::constant(GIVING) - unconfirmed, unconfirmed);
                let now = at_least(-push, given);
                *confirmed = before.map_or(now, |before| at_most(now, before + R::constant(rise * PERIOD)));
                let most = *confirmed + unconfirmed;
                if length > most {
                    part *= most / length;
                }
            }
        }
        applied
    }
}
