//! Commands: their conditions, and what they start.

use nalgebra::Vector3;

use crate::command::{Command, Refusal};
use crate::cycle::law::Law;
use crate::cycle::{Caution, Cycle, Measured, STANDING, WRENCH_AGE};
use crate::guard::fault::Fault;
use crate::guard::supervisor::{State, Trigger};
use crate::model::hand;
use crate::plan;
use crate::plan::approach::{Approach, LONGEST_APPROACH};
use crate::plan::primitive::Primitive;
use crate::plan::run::Run;
use crate::real::Real;
use crate::sense::wrench::REST_FORCE;
use crate::units::JointPositions;

/// Below this joint speed (rad/s) a movement may begin.
const CALM: f64 = 0.2;

/// Largest change of the force (N) that a person may tare away: two kilograms that are mounted behind the sensor.
const MOUNTED: f64 = 20.0;

impl<R: Real, const N: usize> Cycle<R, N> {
    /// Commands before any position is known.
    pub(super) fn command_blind(&mut self, command: Command) -> Result<(), Refusal> {
        match command {
            Command::ClearFault if self.needs_clear() => Err(Refusal::CauseRemains),
            Command::Stop | Command::Release | Command::ClearFault => {
                let trigger = if command == Command::ClearFault { Trigger::Clear } else { Trigger::Release };
                self.supervisor.take(trigger, Fault::None).map(|_| ())
            }
            _ => Err(Refusal::PositionsMissing),
        }
    }

    /// The sensor has been tared by its own command, or has lost that: the zero of its wrench is to be found again.
    #[cold]
    pub fn forget_tare(&mut self) {
        self.wrench.forget_tare();
    }

    fn tare(&mut self, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if self.supervisor.law() == State::Run {
            return Err(Refusal::WrongState);
        }
        // What a stop carries is what the sensor measures: with that as its zero the load would be let fall.
        if self.law.support().carries() {
            return Err(Refusal::ForceAtRest);
        }
        if self.fastest(measured) > R::constant(CALM) {
            return Err(Refusal::Moving);
        }
        // Whoever presses on the hand as it is tared shifts the force at which a contact stops the arm.
        if self.wrench.is_tared() && self.wrench.rest_force().norm_squared() > R::constant(MOUNTED * MOUNTED) {
            return Err(Refusal::ForceAtRest);
        }
        // What was measured long ago, perhaps in another posture, is no zero.
        let present = self.wrench.age().is_some_and(|age| age <= WRENCH_AGE);
        let wrench = present && self.wrench.tare();
        // Half a zero is none where a sensor has fallen silent; where there never was one the gauges are all there is.
        if (wrench || self.is_bare()) && self.hand.tare() | wrench { Ok(()) } else { Err(Refusal::WrenchMissing) }
    }

    /// Holds the arm. One that was held up in an approach stays where it is: the plan has gone on without it.
    fn hold(&mut self, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        self.may_begin(measured)?;
        self.supervisor.allows(Trigger::Hold)?;
        if let (State::Approach, Law::Posture(posture)) = (self.supervisor.law(), &mut self.law) {
            posture.stay(&measured.state.q);
        }
        self.arm(Trigger::Hold, measured)
    }

    #[inline(never)]
    pub(super) fn command(&mut self, command: Command, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        let q = &measured.state.q;
        match command {
            Command::Stop => self.change(Trigger::Stop, measured),
            Command::Release => self.change(Trigger::Release, measured),
            Command::ClearFault => {
                self.may_trust_zero(measured)?;
                let waits = matches!(self.supervisor.state(), State::SoftStop | State::Fault);
                let moving = waits && self.fastest(measured) > R::constant(STANDING);
                let remains = measured.outside_fault || measured.state.missing > 0 || moving;
                // Nobody can know of a fault that this very cycle has brought.
                let is_new = self.supervisor.fault() != measured.fault_before;
                if is_new || (waits || self.needs_clear()) && remains {
                    return Err(Refusal::CauseRemains);
                }
                self.change(Trigger::Clear, measured)
            }
            Command::Tare => self.tare(measured),
            Command::MoveHand { q, duration } => self.move_hand(&q, duration, measured),
            Command::Gravity => {
                self.may_begin(measured)?;
                self.arm(Trigger::Gravity, measured)
            }
            Command::Hold => self.hold(measured),
            Command::Approach { q: target, duration } => {
                self.may_begin(measured)?;
                self.supervisor.allows(Trigger::Approach)?;
                if !(duration >= 0.0 && f64::from(duration) <= LONGEST_APPROACH)
                    || target.iter().any(|q| !q.is_finite())
                {
                    return Err(Refusal::OutOfRange);
                }
                let target = JointPositions::from_f32(target);
                if !self.model.within_soft_limits(&target) {
                    return Err(Refusal::OutsideJointLimits);
                }
                self.may_move(measured)?;
                // From the posture that is held, so that the torque against friction stays; from where the arm is, if
                // it was led aside: nothing throws it back.
                let held = if let Law::Posture(posture) = &self.law { posture.held() } else { None };
                let from = held.unwrap_or(q);
                let mut approach = Approach::new(&self.model, from, &target, R::constant(f64::from(duration)));
                if self.caution == Caution::Slowed {
                    approach = approach.slowed();
                }
                self.supervisor.take(Trigger::Approach, Fault::None)?;
                self.tare_at_last();
                self.begin_approach(approach, measured);
                Ok(())
            }
            Command::Run(options) => {
                let options = options.with_fitting_gains();
                self.may_begin(measured)?;
                self.supervisor.allows(Trigger::Run)?;
                self.may_move(measured)?;
                let primitive = self.loaded.get().ok_or(Refusal::NoPrimitive)?;
                if options.feedback || options.force_control {
                    self.may_use_force(primitive, measured)?;
                }
                // Its worms hold a silent hand where it was last.
                let hand = self.hand.state();
                let begun = (options, self.caution == Caution::Slowed);
                Run::start(&mut self.run, primitive, q, &measured.pose, hand, begun)?;
                self.supervisor.take(Trigger::Run, Fault::None)?;
                self.wrench.tare_drift();
                self.hand.tare_drift();
                self.begin_run(options, measured);
                Ok(())
            }
            Command::SetGoal(goal) => match (&self.law, &mut self.run, self.loaded.get()) {
                (Law::Run(_), Some(run), Some(primitive)) => run.set_goal(primitive, &goal),
                _ => Err(Refusal::WrongState),
            },
            Command::SetSpeed { factor } => match (&self.law, &mut self.run, self.loaded.get()) {
                (Law::Run(_), Some(run), Some(primitive)) => run.set_speed(primitive, factor),
                _ => Err(Refusal::WrongState),
            },
        }
    }

    /// Conditions of a run that uses force: it is measured, expected, and at rest what it should be (B5). A load that
    /// the primitive expects at its start is no reason to refuse it.
    fn may_use_force(&self, primitive: &Primitive<R, N>, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if self.wrench.age().is_none_or(|age| age > WRENCH_AGE) {
            return Err(Refusal::WrenchMissing);
        }
        let expected = primitive.expected().ok_or(Refusal::NoExpectation)?;
        let [fx, fy, fz, ..] = expected.at(R::constant(0.0));
        let at_rest = measured.frames.sensor_to_world() * self.wrench.rest_force();
        let limit = R::constant(REST_FORCE * REST_FORCE);
        let within = |force: Vector3<R>| force.dot(&force) <= limit;
        if within(at_rest) || within(at_rest - Vector3::new(fx, fy, fz)) { Ok(()) } else { Err(Refusal::ForceAtRest) }
    }

    fn move_hand(&mut self, q: &[f32; 4], duration: f32, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        self.may_begin(measured)?;
        if !matches!(self.supervisor.law(), State::Gravity | State::Hold | State::Approach) {
            return Err(Refusal::WrongState);
        }
        if self.hand.answering().is_none() {
            return Err(Refusal::NoHand);
        }
        let timely = duration >= 0.0 && f64::from(duration) <= plan::hand::LONGEST_MOVE;
        if !timely || !hand::within_range(q) {
            return Err(Refusal::OutOfRange);
        }
        self.hand.move_to(&q.map(|q| R::constant(f64::from(q))), R::constant(f64::from(duration)));
        Ok(())
    }

    /// Takes a person's trigger that raises torque. The arm was braked until now, and nobody used the hand.
    fn arm(&mut self, trigger: Trigger, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        let idle = self.supervisor.state() == State::Idle;
        self.change(trigger, measured)?;
        if idle {
            self.tare_at_last();
        }
        Ok(())
    }

    /// Takes the zero of the sensors if there is none yet: the arm has not rested for long enough since its start-up.
    fn tare_at_last(&mut self) {
        if !self.wrench.is_tared() && self.wrench.tare() {
            self.hand.tare_drift();
        }
    }

    /// Conditions of every command that keeps or raises torque.
    fn may_begin(&self, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if !self.is_active() {
            return Err(Refusal::SafetyNotActive);
        }
        if measured.outside_fault {
            return Err(Refusal::CauseRemains);
        }
        if measured.state.missing > 0 {
            return Err(Refusal::PositionsMissing);
        }
        self.may_trust_zero(measured)?;
        if self.needs_clear() {
            return Err(Refusal::FaultLatched);
        }
        if self.supervisor.state() == State::SoftStop && self.fastest(measured) > R::constant(STANDING) {
            return Err(Refusal::Moving);
        }
        Ok(())
    }

    /// True if a fault is latched that arming alone does not clear.
    fn needs_clear(&self) -> bool {
        !matches!(self.supervisor.fault(), Fault::None | Fault::SafetyDropped)
    }

    /// No Clear brings back the zero that a motor has lost which counts anew.
    fn may_trust_zero(&self, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if measured.state.displaced { Err(Refusal::ZeroLost) } else { Ok(()) }
    }

    /// Conditions of a command that moves the arm.
    fn may_move(&self, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if self.is_blind(WRENCH_AGE.into()) {
            return Err(Refusal::WrenchMissing);
        }
        if self.fastest(measured) > R::constant(CALM) { Err(Refusal::Moving) } else { Ok(()) }
    }

    pub(super) fn fastest(&self, measured: &Measured<'_, R>) -> R {
        measured.state.dq.0.amax()
    }

    /// Takes a person's trigger.
    fn change(&mut self, trigger: Trigger, measured: &Measured<'_, R>) -> Result<(), Refusal> {
        if self.supervisor.take(trigger, Fault::None)? {
            self.entered(Some(measured));
        }
        Ok(())
    }
}
