//! Transitions: what a state inherits from the one before it, so that no torque makes a step.

use crate::cycle::{Cycle, HANDOVER, Measured, STOP_RAMP, ZERO_CYCLES};
use crate::guard::fault::Fault;
use crate::guard::joint_limits::JointBounds;
use crate::guard::supervisor::{State, Trigger};
use crate::law::force::ForceController;
use crate::law::operational::OperationalController;
use crate::plan::primitive::Primitive;
use crate::real::{Real, within};
use crate::sense::deviation::Deviation;
use crate::units::{JointAccelerations, JointPositions, Vector7, Wrench};

impl<R: Real, const N: usize> Cycle<R, N> {
    /// Takes a trigger that no person caused.
    pub(super) fn trigger(&mut self, trigger: Trigger, fault: Fault, measured: Option<&Measured<'_, R>>) {
        let from = self.supervisor.law();
        // Only commands can be refused.
        if let Ok(true) = self.supervisor.take(trigger, fault) {
            self.entered(from, measured);
        }
    }

    /// Prepares the law of the state that was just entered. Not inlined: it is rare, and a board may keep the code of every
    /// cycle in a small fast memory.
    #[inline(never)]
    pub(super) fn entered(&mut self, from: State, measured: Option<&Measured<'_, R>>) {
        let law = self.supervisor.law();
        match law {
            State::Hold | State::Approach => self.hand.stay(),
            State::Run => self.hand.begin_run(),
            _ => self.hand.release(),
        }
        let Some(measured) = measured.filter(|_| law.has_torque()) else {
            // Without a measurement there is nothing to hold or to stop with: only states without torque can follow, or a
            // soft stop whose ramp has nothing to take away.
            self.rest = (Vector7::zeros(), 0);
            if !law.has_torque() {
                self.leave_torque();
            }
            return;
        };
        let q = measured.state.q;
        if !from.has_torque() {
            self.bounds = JointBounds::around(&self.model, &q);
            self.limiter.reset();
            self.armed_for = 0;
        }
        match law {
            State::Hold => {
                match from {
                    // What Eq (11) has put between q_d and q against friction becomes the integral's.
                    State::Run => {
                        let offset = self.torque_beyond_model(measured)
                            + self.gains.stiff.damping.component_mul(&measured.state.dq.0);
                        let offset =
                            offset.component_div(&self.gains.stiff.stiffness).zip_map(&self.gains.stiff.clamp, within);
                        self.hold = self.integral.take_over(&self.gains, &offset, &q);
                    }
                    State::Approach => {}
                    _ => self.hold = q,
                }
            }
            State::Run => {
                // From what the feedback is drawn to while holding, so that the torque against friction stays.
                let compliant = self.run.as_ref().is_some_and(|run| run.options.compliant);
                let held = from == State::Hold && !compliant;
                let start = if held { self.hold.0 + self.integral.shift() } else { q.0 };
                self.handover = if compliant {
                    (self.torque_beyond_model(measured) - self.load_expected_first(measured), HANDOVER)
                } else {
                    (Vector7::zeros(), 0)
                };
                self.operational = OperationalController::new(JointPositions(start));
                self.force.restart(self.gains.tracking(compliant).force_window);
                self.tracking = R::of(0.0);
            }
            State::SoftStop => {
                let gravity = self.model.gravity_torque(measured.frames);
                self.rest = (self.limiter.last().torques().0 - gravity.0, STOP_RAMP);
            }
            _ => {}
        }
        if !matches!(law, State::Hold | State::Approach) {
            self.integral.reset();
        }
        if law != State::Run {
            self.run = None;
        }
        if law != State::Approach {
            self.approach = None;
        }
        self.joint_controller.reset();
    }

    /// What the last torque has beyond what the arm itself needs at rest in its motion (N m): friction, contact, and what the
    /// model does not know.
    fn torque_beyond_model(&self, measured: &Measured<'_, R>) -> Vector7<R> {
        let own = self.model.inverse_dynamics(measured.frames, &measured.state.dq, &JointAccelerations::zero());
        self.limiter.last().torques().0 - own.0
    }

    /// Torque that the force controller will feed forward for what the primitive expects at its start (N m).
    fn load_expected_first(&self, measured: &Measured<'_, R>) -> Vector7<R> {
        let controls_force = self.run.as_ref().is_some_and(|run| run.options.force_control);
        match self.loaded.get().and_then(Primitive::expected).filter(|_| controls_force) {
            Some(expected) => {
                let expected = Deviation::new(&expected.at(R::of(0.0)), &Wrench::zero(), None).expected;
                let load = -expected.in_world(measured.frames.tool_to_world());
                ForceController::torque(&measured.frames.jacobian(), &load).0
            }
            None => Vector7::zeros(),
        }
    }

    pub(super) fn leave_torque(&mut self) {
        self.limiter.reset();
        self.joint_controller.reset();
        self.force.reset();
        self.integral.reset();
        self.run = None;
        self.approach = None;
        self.rest = (Vector7::zeros(), 0);
        self.handover = (Vector7::zeros(), 0);
        self.hand.release();
        self.tracking = R::of(0.0);
        self.saturated = false;
        self.limited = false;
        self.zero_cycles = ZERO_CYCLES;
    }
}
