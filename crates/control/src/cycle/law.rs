//! `Law`: what acts in the present state, with all that the state remembers. Leaving a state drops what it remembered.

use crate::law::integral::PostureIntegral;
use crate::law::joint::JointController;
use crate::law::operational::OperationalController;
use crate::plan::approach::Approach;
use crate::plan::reference::JointReference;
use crate::plan::run::Run;
use crate::real::Real;
use crate::units::{JointPositions, Vector7};

/// The law of a state.
#[allow(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of these at a time is what memory is needed for"
)]
pub(super) enum Law<R: Real, const N: usize> {
    /// `Idle` and `Fault`: no torque. Frames of zero torque are sent this many cycles more.
    Off { zero_cycles: u8 },
    /// `Gravity`.
    Gravity,
    /// `Hold` and `Approach`.
    Posture(Posture<R>),
    /// `Run`.
    Run(Running<R, N>),
    /// `SoftStop`: the torque beyond gravity when it began is ramped away.
    SoftStop(Ramp<R>),
}

/// A posture that is held, or moved along an approach.
pub(super) struct Posture<R: Real> {
    /// Desired posture (rad).
    pub(super) q: JointPositions<R>,
    /// The move in progress; `None` in `Hold`.
    pub(super) approach: Option<Approach<R>>,
    pub(super) integral: PostureIntegral<R>,
    pub(super) controller: JointController<R>,
}

impl<R: Real> Posture<R> {
    /// To hold `q`.
    pub(super) fn at(q: JointPositions<R>) -> Self {
        Posture { q, approach: None, integral: PostureIntegral::new(), controller: JointController::new() }
    }

    /// Moves from here on, or stays. The integral goes on.
    pub(super) fn follow(&mut self, approach: Option<Approach<R>>) {
        self.approach = approach;
        self.controller.reset();
    }

    /// Returns what the joints should do in this control period.
    pub(super) fn reference(&mut self) -> JointReference<R> {
        let reference = match &mut self.approach {
            Some(approach) => approach.step(),
            None => JointReference::at_rest(self.q),
        };
        self.q = reference.q;
        reference
    }
}

/// A run, and the controllers that follow its plan.
pub(super) struct Running<R: Real, const N: usize> {
    pub(super) run: Run<R, N>,
    pub(super) operational: OperationalController<R>,
    pub(super) controller: JointController<R>,
    /// Torque beyond what the arm itself needs when a compliant run began.
    pub(super) handover: Ramp<R>,
    /// Distance between plan and tool in the last cycle (m).
    pub(super) tracking: R,
}

/// A torque that is taken away steadily, so that it makes no step.
pub(super) struct Ramp<R: Real> {
    /// Torque at the beginning (N m).
    torque: Vector7<R>,
    /// Control periods left.
    left: u16,
    /// 1 / control periods of the whole ramp.
    slope: R,
}

impl<R: Real> Ramp<R> {
    /// A ramp of so many control periods.
    pub(super) fn new(torque: Vector7<R>, periods: u16) -> Self {
        Ramp { torque, left: periods, slope: R::of(1.0 / f64::from(periods)) }
    }

    /// Nothing to take away.
    pub(super) fn none() -> Self {
        Ramp { torque: Vector7::zeros(), left: 0, slope: R::of(0.0) }
    }

    /// Returns the torque of this control period (N m).
    pub(super) fn step(&mut self) -> Vector7<R> {
        let share = R::from_counts(i32::from(self.left)) * self.slope;
        self.left = self.left.saturating_sub(1);
        self.torque * share
    }
}
