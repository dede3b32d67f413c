//! `Law`: what acts in the present state, with all that the state remembers. Leaving a state drops what it remembered.

use crate::law::integral::PostureIntegral;
use crate::law::joint::JointController;
use crate::law::operational::OperationalController;
use crate::plan::approach::Approach;
use crate::plan::reference::JointReference;
use crate::real::{Real, within};
use crate::time::PERIOD;
use crate::units::{JointPositions, Vector7};

/// Speed at which a held posture returns after somebody pushed the arm away from it (rad/s).
const RETURN_SPEED: f64 = 0.2;

/// The law of a state.
#[allow(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of these at a time is what memory is needed for"
)]
pub(super) enum Law<R: Real> {
    /// `Idle` and `Fault`: no torque. Frames of zero torque are sent this many cycles more.
    Off { zero_cycles: u8 },
    /// `Gravity`.
    Gravity,
    /// `Hold` and `Approach`.
    Posture(Posture<R>),
    /// `Run`.
    Run(Running<R>),
    /// `SoftStop`: the torque beyond gravity when it began is ramped away.
    SoftStop(Ramp<R>),
}

/// A posture that is held, or moved along an approach.
pub(super) struct Posture<R: Real> {
    /// Desired posture (rad).
    pub(super) q: JointPositions<R>,
    /// Where that posture has given way to (rad).
    held: JointPositions<R>,
    /// The move in progress; `None` in `Hold`.
    pub(super) approach: Option<Approach<R>>,
    pub(super) integral: PostureIntegral<R>,
    pub(super) controller: JointController<R>,
}

impl<R: Real> Posture<R> {
    /// To hold `q`.
    pub(super) fn at(q: JointPositions<R>) -> Self {
        Posture { q, held: q, approach: None, integral: PostureIntegral::new(), controller: JointController::new() }
    }

    /// Moves from here on, or stays. The integral goes on.
    pub(super) fn follow(&mut self, approach: Option<Approach<R>>) {
        self.approach = approach;
        self.controller.reset();
    }

    /// Takes another posture to hold (rad).
    pub(super) fn shift_to(&mut self, q: JointPositions<R>) {
        (self.q, self.held) = (q, q);
    }

    /// Returns what the joints should do in this control period, at `q` (rad).
    pub(super) fn reference(&mut self, q: &JointPositions<R>, clamp: &Vector7<R>) -> JointReference<R> {
        match &mut self.approach {
            Some(approach) => {
                let reference = approach.step();
                self.shift_to(reference.q);
                reference
            }
            None => {
                self.give_way(q, clamp);
                JointReference::at_rest(self.held)
            }
        }
    }

    /// Gives way where the arm was pushed away by more than `clamp` (rad), and comes back slowly once it is let go. A
    /// spring that is not bounded would throw it back.
    fn give_way(&mut self, q: &JointPositions<R>, clamp: &Vector7<R>) {
        let step = R::of(RETURN_SPEED * PERIOD);
        let back = (self.q.0 - self.held.0).map(|way| within(way, step));
        let held = q.0 + (self.held.0 + back - q.0).zip_map(clamp, within);
        // Exactly, where nobody pushes: a sum of differences is not.
        self.held = JointPositions(held.zip_map(&self.q.0, |held, wanted| {
            let rest = held - wanted;
            if rest < step && rest > -step { wanted } else { held }
        }));
    }
}

/// The controllers that follow the plan of a run. The run itself stays in its place in the cycle: it is large, and is
/// written there once.
pub(super) struct Running<R: Real> {
    pub(super) operational: OperationalController<R>,
    pub(super) controller: JointController<R>,
    /// Torque beyond what the arm itself needs when a compliant run began.
    pub(super) handover: Ramp<R>,
    pub(super) lag: Lag<R>,
}

/// The tool against the plan in the last cycle.
#[derive(Clone, Copy)]
pub(super) struct Lag<R: Real> {
    /// Distance (m).
    pub(super) distance: R,
    /// Speed (m/s).
    pub(super) speed: R,
}

impl<R: Real> Lag<R> {
    /// The tool is where the plan is.
    pub(super) fn none() -> Self {
        Lag { distance: R::of(0.0), speed: R::of(0.0) }
    }
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
