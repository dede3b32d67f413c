//! Transitions: what a state inherits from the one before it, so that no torque makes a step.

use crate::act::limit::LimitReport;
use crate::command::RunOptions;
use crate::cycle::law::{Lag, Law, Leaning, Lowering, Posture, Ramp, Running};
use crate::cycle::record::Event;
use crate::cycle::{BRAKE_WORDS, Caution, Cycle, HANDOVER, Measured, STOP_RAMP, ZERO_CYCLES};
use crate::guard::fault::Fault;
use crate::guard::joint_limits::JointBounds;
use crate::guard::supervisor::{State, Trigger};
use crate::law::joint::JointController;
use crate::law::operational::OperationalController;
use crate::law::settling::Settling;
use crate::law::support::Support;
use crate::plan::approach::Approach;
use crate::plan::lift::Lift;
use crate::plan::primitive::Primitive;
use crate::real::{Real, within};
use crate::sense::deviation::Deviation;
use crate::sense::drift::Drift;
use crate::sense::observer::Trust;
use crate::units::{JointPositions, Vector7, Wrench};

impl<R: Real, const N: usize> Cycle<R, N> {
    /// Takes a trigger that no person caused.
    pub(super) fn trigger(&mut self, trigger: Trigger, fault: Fault, measured: Option<&Measured<'_, R>>) {
        // Whatever the first cause was.
        if fault == Fault::EncoderStuck {
            self.joints.lose_sight();
        }
        // Only commands can be refused.
        if let Ok(true) = self.supervisor.take(trigger, fault) {
            self.entered(measured);
        }
    }

    /// The oldest event that has yet to be told, for a caller who will not come back soon: who ends the cycles has each
    /// of them told.
    #[cold]
    pub fn untold(&mut self) -> Option<Event> {
        self.news.next()
    }

    /// Begins the law of the state that was just entered; an approach and a run are begun by [`Cycle::begin_approach`]
    /// and [`Cycle::begin_run`]. Not inlined: it is rare, and a board may keep the code of every cycle in a small fast
    /// memory.
    #[inline(never)]
    pub(super) fn entered(&mut self, measured: Option<&Measured<'_, R>>) {
        let state = self.supervisor.law();
        if state == State::Hold {
            self.hand.stay()
        } else {
            self.hand.release()
        }
        let Some(measured) = measured.filter(|_| state.has_torque()) else {
            // Without a measurement there is nothing to hold or to stop with: only states without torque can follow, or
            // a soft stop whose ramp has nothing to take away.
            if state.has_torque() {
                self.law = Law::SoftStop(Ramp::none(), Support::new());
            } else {
                self.leave_torque();
            }
            return;
        };
        if matches!(self.law, Law::Off { .. }) {
            self.bounds = JointBounds::around(&self.model, &measured.state.q);
            self.limiter.reset();
            self.armed_for = 0;
        }
        match (state, &mut self.law) {
            (State::Hold, Law::Posture(posture)) => posture.follow(None, &self.calibration.transmission),
            (State::Hold, Law::Run(_)) => self.law = Law::Posture(self.after_run(measured)),
            (State::Hold, _) => self.law = Law::Posture(self.posture_here(measured)),
            (State::SoftStop | State::Lower, _) => {
                let gravity = self.model.gravity_torque(measured.frames);
                // What is carried already is not ramped away: it would fall until it is caught again.
                let support = self.law.support();
                let load = support.torque(measured.frames);
                let rest = Ramp::new(self.limiter.last().torques().0 - gravity.0 - load, STOP_RAMP);
                self.law = if state == State::Lower {
                    Law::Lower(Lowering::new(rest, support))
                } else {
                    Law::SoftStop(rest, support)
                };
            }
            _ => self.law = Law::Gravity(self.law.support()),
        }
    }

    /// Holds the run to what heat and the pendant allow.
    #[inline(never)]
    pub(super) fn hold_back(&mut self) {
        if let (Law::Run(_), Some(run), Some(primitive)) = (&self.law, &mut self.run, self.loaded.get()) {
            run.hold_back(primitive, self.caution == Caution::Slowed);
        }
    }

    /// Begins a move in joint space, after the supervisor has allowed it.
    pub(super) fn begin_approach(&mut self, approach: Approach<R>, measured: &Measured<'_, R>) {
        self.hand.stay();
        self.observer.mass.postpone();
        if !matches!(self.law, Law::Posture(_)) {
            self.law = Law::Posture(self.posture_here(measured));
        }
        if let Law::Posture(posture) = &mut self.law {
            posture.follow(Some(approach), &self.calibration.transmission);
        }
    }

    /// Begins a run, after the supervisor has allowed it.
    #[inline(never)]
    pub(super) fn begin_run(&mut self, options: RunOptions, measured: &Measured<'_, R>) {
        self.hand.begin_run();
        self.observer.mass.postpone();
        // From what the feedback is drawn to while holding, so that the torque against friction stays. An arm that was
        // led aside has nothing to hand over: it would be thrown back.
        let held = if let Law::Posture(posture) = &self.law { posture.held() } else { Some(&measured.state.q) };
        let start = match (&self.law, held) {
            (Law::Posture(posture), Some(q)) if !options.compliant => JointPositions(q.0 + posture.integral.shift()),
            _ => measured.state.q,
        };
        self.soft_limits.restart();
        self.force.restart(self.gains.tracking(options.compliant).force_window);
        // What a limit has cut off is not to be taken over: after arming that is the gravity which has yet to build up.
        let (handover, leaning) = if options.compliant && held.is_some() && !self.cut.is_cut() {
            let load = if options.force_control { self.load_expected_first(measured) } else { Vector7::zeros() };
            Leaning::part(self.beyond - load, HANDOVER)
        } else {
            (Ramp::none(), Leaning::none())
        };
        self.law = Law::Run(Running {
            operational: OperationalController::new(start),
            controller: JointController::new(self.gains.tracking(options.compliant).friction_speed),
            handover,
            leaning,
            lag: Lag::none(),
            drift: Drift::new(),
            pressing: Vector7::zeros(),
            settling: Settling::new(),
            lift: Lift::new(),
        });
    }

    /// The posture to hold after a run: what Eq (11) has put between q_d and q against friction becomes the integral's.
    fn after_run(&self, measured: &Measured<'_, R>) -> Posture<R> {
        let stiff = &self.gains.stiff;
        let velocity = self.observer.velocity(measured.state, Trust::Stiff, &Vector7::zeros());
        let friction = match &self.law {
            Law::Run(Running { controller, .. }) => *controller.friction(),
            _ => Vector7::zeros(),
        };
        self.posture_under(&(self.beyond + friction + stiff.damping.component_mul(&velocity)), measured)
    }

    /// The present posture, held with what is carried of a load.
    fn posture_here(&self, measured: &Measured<'_, R>) -> Posture<R> {
        let support = self.law.support();
        if support.carries() {
            self.posture_under(&support.torque(measured.frames), measured)
        } else {
            Posture::at(measured.state.q)
        }
    }

    /// The present posture, held with this torque (N m) from the beginning.
    fn posture_under(&self, torque: &Vector7<R>, measured: &Measured<'_, R>) -> Posture<R> {
        let stiff = &self.gains.stiff;
        let offset = torque.component_div(&stiff.stiffness).zip_map(&stiff.clamp, within);
        let mut posture = Posture::at(measured.state.q);
        let held = posture.integral.take_over(&self.gains, &offset, &measured.state.q);
        posture.shift_to(held);
        posture
    }

    /// Torque that the force controller will feed forward for what the primitive expects at its start (N m).
    fn load_expected_first(&mut self, measured: &Measured<'_, R>) -> Vector7<R> {
        match self.loaded.get().and_then(Primitive::expected) {
            Some(expected) => {
                let expected = Deviation::new(&expected.at(R::constant(0.0)), &Wrench::zero(), None).expected;
                let to_world = measured.frames.tool_to_world();
                let load = self.force.confirmed(&-expected.in_world(to_world), &measured.wrench.in_world(to_world));
                measured.frames.joint_torques(&load).0
            }
            None => Vector7::zeros(),
        }
    }

    /// No torque from now on. What has not come to rest needs the brakes of the safety module.
    pub(super) fn leave_torque(&mut self) {
        let brakes = match &self.law {
            Law::Off { brakes, .. } => *brakes,
            Law::Lower(lowering) if lowering.rests() => 0,
            _ => BRAKE_WORDS,
        };
        self.law = Law::Off { zero_cycles: ZERO_CYCLES, brakes };
        self.limiter.reset();
        self.beyond = Vector7::zeros();
        self.hand.release();
        self.cut = LimitReport::default();
    }
}
