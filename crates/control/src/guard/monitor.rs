//! `Monitor`: watches the measured state and says when torque authority has to go down.

use puck::Transmission;

use crate::guard::disagreement::{Disagreement, Effort};
use crate::guard::fault::Fault;
use crate::guard::joint_limits::JointBounds;
use crate::guard::supervisor::{State, Trigger};
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::real::Real;
use crate::sense::joints::{COAST_CYCLES, JointState};
use crate::time::few_periods;
use crate::units::{JOINTS, Wrench};

/// Largest speed of elbow and forearm in any state with torque (m/s); the safety module faults at 1.0.
pub const TIP_SPEED_LIMIT: f64 = 0.8;

/// Distance beyond the elbow at which the safety module watches the speed (m).
pub const TIP_REACH: f64 = 0.35;

/// A joint may exceed its speed limit by this factor before it is stopped: noise and overshoot.
const SPEED_MARGIN: f64 = 1.2;

/// Contact force that stops a movement (N): the lowest permissible quasi-static one (face) of the collaboration
/// standards.
pub(crate) const FORCE_LIMIT: f64 = 65.0;

/// Samples in a row above the force limit: one corrupt sample stops no movement.
const FORCE_CYCLES: u8 = 2;

/// Largest distance between plan and tool (m); a plan farther away has lost its arm.
pub(crate) const TRACKING_LIMIT: f64 = 0.30;

/// Largest speed of the tool against its plan (m/s). Somebody who pushes harder is not followed; a loop that swings is
/// stopped.
const LAG_LIMIT: f64 = 0.5;

/// Time without positions after which torque goes off: 200 ms, in control periods.
const SILENCE_CYCLES: u8 = few_periods(0.2);

/// Watches limits.
#[derive(Clone, Debug)]
pub(crate) struct Monitor<R: Real> {
    speed_limit: [R; JOINTS],
    pressed: u8,
    disagreement: Disagreement<R>,
}

/// Input of the monitor besides the joint state.
pub(crate) struct Observation<'a, R: Real> {
    pub(crate) frames: &'a Frames<R>,
    pub(crate) bounds: &'a JointBounds<R>,
    /// Magnitude of the unfiltered, tared force (N).
    pub(crate) force: R,
    /// Wrench of the environment on the robot at the grasp point.
    pub(crate) wrench: &'a Wrench<R>,
    /// Distance (m) and speed (m/s) of the tool against the plan in the last cycle.
    pub(crate) lag: (R, R),
    /// True if the wrench is gone for so long that nothing moves by itself any more.
    pub(crate) wrench_lost: bool,
    /// True if no fresh force tells of a contact: the sensor is silent, or there is none.
    pub(crate) blind: bool,
    /// Torques and motion that the law asks of the joints, where it feeds anything back.
    pub(crate) effort: Option<Effort<'a, R>>,
    /// True if the sensor has been at full scale: in a force, or in a torque that the run depends on.
    pub(crate) full_scale: bool,
}

impl<R: Real> Monitor<R> {
    pub(crate) fn new(transmission: Transmission<R>) -> Self {
        Monitor {
            speed_limit: wam7::VELOCITY_MAX.map(|limit| R::constant(limit * SPEED_MARGIN)),
            pressed: 0,
            disagreement: Disagreement::new(transmission),
        }
    }

    /// The most severe finding of this cycle in a state with torque.
    pub(crate) fn check(
        &mut self,
        law: State,
        state: &JointState<R>,
        seen: &Observation<'_, R>,
    ) -> Option<(Trigger, Fault)> {
        if state.age > SILENCE_CYCLES {
            return Some((Trigger::HardFault, Fault::RepliesLostForLong));
        }
        if state.displaced && law != State::Lower {
            return Some((Trigger::SoftFault, Fault::ImplausiblePosition));
        }
        if state.age > COAST_CYCLES {
            let fault = match (state.stuck, state.implausible) {
                (true, _) => Fault::EncoderStuck,
                (_, true) => Fault::ImplausiblePosition,
                _ => Fault::RepliesLost,
            };
            return Some((Trigger::SoftFault, fault));
        }
        let (stuck, pushed) = self.disagrees(state, seen);
        // A value that was measured long ago says nothing of now.
        let pressed = !seen.blind && (seen.force > R::constant(FORCE_LIMIT) || seen.full_scale);
        self.pressed = if pressed { self.pressed.saturating_add(1) } else { 0 };
        let moving_by_itself = matches!(law, State::Hold | State::Approach | State::Run);
        let finding = if moving_by_itself && self.pressed >= FORCE_CYCLES {
            Some(Fault::ContactForce)
        } else if stuck {
            Some(Fault::EncoderStuck)
        } else if pushed {
            Some(Fault::UnseenContact)
        } else if moving_by_itself && seen.bounds.violated(&state.q) {
            Some(Fault::JointLimit)
        } else if matches!(law, State::Approach | State::Run) && seen.wrench_lost {
            Some(Fault::WrenchLost)
        } else if law == State::Run && (seen.lag.0 > R::constant(TRACKING_LIMIT) || seen.lag.1 > R::constant(LAG_LIMIT))
        {
            Some(Fault::TrackingError)
        } else if state.dq.0.iter().zip(&self.speed_limit).any(|(dq, limit)| *dq > *limit || *dq < -*limit) {
            Some(Fault::JointSpeed)
        } else {
            let [elbow, tip] = seen.frames.elbow_speeds(&state.dq, R::constant(TIP_REACH));
            let limit = R::constant(TIP_SPEED_LIMIT);
            (elbow > limit || tip > limit).then_some(Fault::TipSpeed)
        };
        if let Some(fault) = finding {
            return Some((Trigger::SoftFault, fault));
        }
        let trigger = if state.missing > 0 { Trigger::RepliesMissing } else { Trigger::RepliesBack };
        Some((trigger, Fault::None))
    }

    /// True if an encoder stands still; true if something pushes that the sensor does not see.
    fn disagrees(&mut self, state: &JointState<R>, seen: &Observation<'_, R>) -> (bool, bool) {
        match &seen.effort {
            Some(effort) if state.missing == 0 => {
                let stuck = if state.still == 0 {
                    self.disagreement.all_turn();
                    false
                } else {
                    let environment = seen.frames.torques_of(seen.wrench);
                    self.disagreement.encoder_stands_still(effort, &environment, seen.force, state.still)
                };
                (stuck, seen.blind && self.disagreement.is_pushed(effort.feedback))
            }
            Some(_) => (false, false),
            None => {
                self.disagreement.reset();
                (false, false)
            }
        }
    }
}
