//! `Cycle`: one control period, the only entry that yields torque.
//!
//! ```text
//! replies -> JointEstimator, WrenchEstimator, HandDrive -> Monitor, command -> Supervisor
//!   -> the law of the state: gravity | hold | approach | run (Eqs 9, 11, 10, 12, 13) | soft stop ; the hand's (Eq 14)
//!   -> TorqueLimiter, HandLimiter -> Actuation (two frames, and one for the hand) ; everything -> CycleRecord
//! ```

mod commands;
pub mod hand;
mod law;
mod laws;
pub mod record;
mod transitions;

use pinned_init::{Init, init};
use puck::SafetyMode;

use crate::act::actuation::Actuation;
use crate::act::limit::{LimitReport, TorqueLimiter};
use crate::command::Refusal;
use crate::cycle::hand::HandDrive;
use crate::cycle::law::{Lag, Law, Posture, Running};
use crate::cycle::record::{CycleInput, CycleOutput, CycleRecord, Event, News, flags, limit_flags};
use crate::guard::disagreement::{Effort, Plan};
use crate::guard::fault::{Fault, ReactionOutside};
use crate::guard::joint_limits::JointBounds;
use crate::guard::monitor::{Monitor, Observation};
use crate::guard::supervisor::{State, Supervisor, Trigger};
use crate::law::force::ForceController;
use crate::law::gains::Gains;
use crate::law::soft_limits::SoftLimits;
use crate::model::arm::ArmModel;
use crate::model::calibration::{Calibration, Payload};
use crate::model::kinematics::Frames;
use crate::model::weight::WeightCorrection;
use crate::plan::load::{CheckedPrimitive, LoadRefusal, Loaded};
use crate::plan::primitive::Primitive;
use crate::plan::run::{FADE, Run};
use crate::real::Real;
use crate::sense::joints::{JointEstimator, JointState};
use crate::sense::observer::MotionObserver;
use crate::sense::wrench::WrenchEstimator;
use crate::time::{few_periods, periods};
use crate::units::{JOINTS, JointPositions, Pose, Vector7, Wrench};

/// Kernels per row that a stored primitive may have.
pub const MAX_KERNELS: usize = 100;

/// Frames of zero torque, one a cycle, after torque went off: one lost frame must not leave a motor pulling.
const ZERO_CYCLES: u8 = 3;

/// Words of the safety module in a row that its brakes are on: one of them may be wrong.
const BRAKE_WORDS: u8 = 2;

/// Age at which the mode of the safety module is no longer believed: 1 s, in control periods.
const SAFETY_AGE: u16 = periods(1.0);

/// Age at which a wrench no longer carries a run that depends on it: 16.7 ms, in control periods.
const WRENCH_AGE: u8 = few_periods(1.0 / 60.0);

/// Length of the ramp that takes all but gravity and damping away in a soft stop: 100 ms, in control periods.
const STOP_RAMP: u16 = periods(0.1);

/// Length of the ramp that takes away what a compliant run inherits from a stiff hold: 2 s, in control periods.
const HANDOVER: u16 = periods(2.0);

/// Time in which the torque of gravity builds up after arming: 100 ms, in control periods.
const BUILDING_UP: u16 = periods(0.1);

/// Below this joint speed (rad/s) the arm counts as standing, for leaving a stop.
const STANDING: f64 = 0.05;

/// The control code of one arm. `N` is the number of kernels per row that its primitive may have.
pub struct Cycle<R: Real, const N: usize = MAX_KERNELS> {
    calibration: Calibration<R>,
    weight: WeightCorrection,
    model: ArmModel<R>,
    gains: Gains<R>,
    supervisor: Supervisor,
    monitor: Monitor<R>,
    joints: JointEstimator<R>,
    observer: MotionObserver<R>,
    wrench: WrenchEstimator<R>,
    limiter: TorqueLimiter<R>,
    bounds: JointBounds<R>,
    soft_limits: SoftLimits<R>,
    law: Law<R>,
    /// Place of the run that [`Law::Run`] carries out; in every other state what is left of the last one.
    run: Option<Run<R, N>>,
    /// Force controller of a run. Not in its law: the window is large, and stays where it is.
    force: ForceController<R>,
    hand: HandDrive<R>,
    loaded: Loaded<R, N>,
    safety: Option<(SafetyMode, u16)>,
    /// Control periods since torque came on, saturating.
    armed_for: u16,
    /// Limits that cut the last torque.
    cut: LimitReport,
    /// The part of the last torque that the model does not explain (N m): feedback, contact, and what it does not know.
    beyond: Vector7<R>,
    news: News,
    caution: Caution,
}

/// Findings of the device about heat and the pendant.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Caution {
    /// Nothing.
    #[default]
    None,
    /// A person should know.
    Warned,
    /// Runs are held to half of the taught speed.
    Slowed,
}

/// Measurements of one cycle.
struct Measured<'a, R: Real> {
    state: &'a JointState<R>,
    frames: &'a Frames<R>,
    pose: Pose<R>,
    wrench: Wrench<R>,
    /// True while the caller reports a fault of its own.
    outside_fault: bool,
    /// The fault that was latched before this cycle.
    fault_before: Fault,
}

impl<R: Real, const N: usize> Cycle<R, N> {
    /// Makes, in its place, a cycle in `Idle` with these gains (for a real arm: [`Gains::tuned`]) and without a
    /// primitive.
    ///
    /// In place, piece by piece, because a cycle takes half of a small processor's stack. Where there is a heap:
    /// `Box::new_uninit().write_init(Cycle::init(..))`, with [`pinned_init::InPlaceWrite`].
    pub fn init(calibration: Calibration<R>, gains: Gains<R>) -> impl Init<Self> {
        let model = ArmModel::new(calibration.payload);
        let home = JointPositions::zero();
        init!(Cycle {
            bounds: JointBounds::around(&model, &home),
            soft_limits: SoftLimits::new(),
            supervisor: Supervisor::new(),
            monitor: Monitor::new(calibration.transmission),
            joints: JointEstimator::new(&calibration),
            observer: MotionObserver::new(),
            wrench: WrenchEstimator::new(),
            limiter: TorqueLimiter::new(&calibration),
            law: Law::Off { zero_cycles: 0, brakes: 0 },
            run: None,
            force <- ForceController::init(gains.stiff.force_window),
            hand <- HandDrive::init(&gains.hand),
            loaded <- Loaded::init(),
            safety: None,
            armed_for: 0,
            cut: LimitReport::default(),
            beyond: Vector7::zeros(),
            news: News::default(),
            caution: Caution::None,
            weight: WeightCorrection::none(calibration.payload),
            calibration,
            model,
            gains,
        })
    }

    /// The present state.
    pub fn state(&self) -> State {
        self.supervisor.state()
    }

    /// The state whose law acts: while lost replies are bridged, the one before.
    pub fn law(&self) -> State {
        self.supervisor.law()
    }

    /// The latched fault.
    pub fn fault(&self) -> Fault {
        self.supervisor.fault()
    }

    /// The arm this cycle controls.
    pub fn model(&self) -> &ArmModel<R> {
        &self.model
    }

    /// The primitive that `Run` would run.
    pub fn primitive(&self) -> Option<&Primitive<R, N>> {
        self.loaded.get()
    }

    /// Returns the payload of the arm that this cycle controls.
    pub fn payload(&self) -> Payload {
        self.calibration.payload
    }

    /// True while the hand makes a move of its own, outside a run.
    pub fn moves_hand(&self) -> bool {
        self.hand.is_moving()
    }

    /// True if a motor began to count anew since the positions were learned.
    pub fn is_zero_lost(&self) -> bool {
        self.joints.is_displaced()
    }

    /// The caller knows that the zero is lost: as if a motor had begun to count anew.
    #[cold]
    pub fn lose_zero(&mut self) {
        self.joints.displace();
    }

    /// The counts of the motors as the loop knew them last; see [`JointEstimator::last_counts`].
    pub fn last_counts(&self) -> Option<[(puck::Counts, u8); JOINTS]> {
        self.joints.last_counts()
    }

    /// True if the wrench has a zero; see [`WrenchEstimator::is_tared`].
    pub fn is_wrench_zeroed(&self) -> bool {
        self.wrench.is_tared()
    }

    /// Control periods since the last wrench that was measured; `None` if there was none since the bus was started.
    pub fn wrench_age(&self) -> Option<u8> {
        self.wrench.age()
    }

    /// Takes the scales read from the pucks. Positions are learned anew, and a primitive that was for another payload
    /// is forgotten.
    ///
    /// # Errors
    /// [`Refusal::WrongState`] while torque is on.
    pub fn calibrate(&mut self, calibration: Calibration<R>) -> Result<(), Refusal> {
        if self.supervisor.state().has_torque() {
            return Err(Refusal::WrongState);
        }
        self.joints = JointEstimator::new(&calibration);
        self.monitor = Monitor::new(calibration.transmission);
        self.limiter = TorqueLimiter::new(&calibration);
        if calibration.payload != self.calibration.payload {
            // It was checked for another tool.
            self.loaded.clear();
        }
        self.model = ArmModel::corrected(calibration.payload, &self.weight);
        self.observer = MotionObserver::new();
        self.calibration = calibration;
        Ok(())
    }

    /// Takes the weight of this arm's links. It counts while the arm carries the payload it was measured with.
    ///
    /// # Errors
    /// [`Refusal::WrongState`] while torque is on: the torque would make a step.
    pub fn weigh(&mut self, weight: &WeightCorrection) -> Result<(), Refusal> {
        if self.supervisor.state().has_torque() {
            return Err(Refusal::WrongState);
        }
        self.weight = *weight;
        self.model = ArmModel::corrected(self.calibration.payload, weight);
        Ok(())
    }

    /// Forgets positions and the mode of the safety module: the pucks were off. Ends in `Idle`.
    pub fn reset(&mut self) {
        self.joints.reset();
        self.wrench.restart();
        self.safety = None;
        // Every state allows this trigger, so there is nothing to refuse.
        let _ = self.supervisor.take(Trigger::SafetyDropped, Fault::SafetyDropped);
        self.leave_torque();
        // The start-up that follows puts the brakes on.
        self.law = Law::Off { zero_cycles: ZERO_CYCLES, brakes: 0 };
    }

    /// Takes a primitive for the next run: no more than a copy, because its caller keeps the control task waiting. A
    /// refused one leaves the old in place.
    ///
    /// # Errors
    /// [`LoadRefusal`] while a run is in progress, or if it was checked for another arm than this.
    pub fn load(&mut self, fit: &CheckedPrimitive<'_, R, N>) -> Result<(), LoadRefusal> {
        if self.supervisor.law() == State::Run {
            return Err(LoadRefusal::Running);
        }
        if !fit.is_for(&self.model) {
            return Err(LoadRefusal::OtherTool);
        }
        self.loaded.put(fit);
        Ok(())
    }

    /// Forgets the primitive. Ignored while it runs.
    pub fn unload(&mut self) {
        if self.supervisor.law() != State::Run {
            self.loaded.clear();
        }
    }

    /// Takes what was found about heat and the pendant, and holds a run to it.
    pub fn set_caution(&mut self, caution: Caution) {
        if caution != self.caution {
            self.caution = caution;
            self.hold_back();
        }
    }

    /// Frames of the last cycle did not leave: torques of M1 to M4, torques of M5 to M7, torques of the hand. The next
    /// step of a torque counts from what the motors still have.
    #[cold]
    #[inline(never)]
    pub fn not_sent(&mut self, arm: bool, wrist: bool, hand: bool) {
        self.limiter.not_sent(arm, wrist);
        if hand {
            self.hand.not_sent();
        }
    }

    /// Advances one control period.
    pub fn step(&mut self, input: &CycleInput) -> CycleOutput {
        // A bridged reply is no news: the law stays.
        let before = (self.supervisor.law(), self.supervisor.fault());
        self.watch_safety(input.sample.safety);
        if let Some(fault) = input.external_fault {
            match fault.reaction_outside() {
                ReactionOutside::SoftUnlessLowering if self.supervisor.law() == State::Lower => {}
                ReactionOutside::TorqueOff => self.trigger(Trigger::HardFault, fault, None),
                _ => self.trigger(Trigger::SoftFault, fault, None),
            }
        }
        self.joints.expect_plan(matches!(self.supervisor.law(), State::Approach | State::Run));
        let state = self.joints.update(&input.sample.positions, self.supervisor.state().has_torque());
        self.hand.update(input.sample.hand.as_ref());

        let mut record = CycleRecord { cycle: input.cycle, ..CycleRecord::EMPTY };
        if let Some(hand) = self.hand.state() {
            record.hand = hand.q.map(Real::single);
            record.hand_d = record.hand;
            record.gauges = hand.gauges.map(Real::single);
        }
        let mut answer = None;
        let actuation = match state {
            None => {
                self.wrench.update(input.sample.wrench.as_ref(), None, false);
                answer = input.command.map(|command| self.command_blind(command));
                record.lost_replies = input.sample.positions.iter().filter(|reply| reply.is_none()).count() as u8;
                self.actuate_without_torque()
            }
            Some(state) => {
                let frames = Frames::new(&self.model, &state.q);
                let at_rest = state.missing == 0 && state.dq.0.amax() < R::constant(STANDING);
                let weight = self.model.hanging_weight(&frames);
                self.wrench.update(input.sample.wrench.as_ref(), Some(&weight), at_rest);
                if self.supervisor.state() == State::Idle && !self.wrench.is_tared() {
                    self.tare_first();
                }
                let measured = Measured {
                    state: &state,
                    frames: &frames,
                    pose: frames.tool_pose(),
                    wrench: self.wrench.wrench(&frames),
                    outside_fault: input.external_fault.is_some(),
                    fault_before: before.1,
                };
                // A model lets an arm fall that friction or brakes hold while the torque of gravity builds up.
                if self.supervisor.state().has_torque() && self.armed_for >= BUILDING_UP {
                    let compliant = self.run.as_ref().is_some_and(|run| run.options.compliant);
                    self.observer.update(&state, !(matches!(self.law, Law::Run(_)) && compliant));
                } else {
                    self.observer.settle(&state);
                }
                self.monitor(&measured);
                answer = input.command.map(|command| self.command(command, &measured)).or(answer);
                self.act(&measured, &mut record)
            }
        };

        record.state = self.supervisor.state();
        record.fault = self.supervisor.fault();
        record.flags |= self.standing_flags();
        // A run's last transition is told as `Arrived` by `act`; every other change is told here.
        if (self.supervisor.law(), record.fault) != before && record.flags & flags::ARRIVED == 0 {
            self.news.tell(Event::Entered(self.supervisor.law(), record.fault));
        }
        let answer = answer.map(|answer| answer.map_or_else(Event::Refused, |()| Event::Accepted));
        let event = answer.or_else(|| self.news.next());
        CycleOutput { actuation, record, event }
    }

    fn watch_safety(&mut self, polled: Option<SafetyMode>) {
        self.safety = match (polled, self.safety) {
            (Some(mode), _) => Some((mode, 0)),
            (None, Some((mode, age))) if age < SAFETY_AGE => Some((mode, age + 1)),
            (None, _) => None,
        };
        if !self.is_active() {
            self.trigger(Trigger::SafetyDropped, Fault::SafetyDropped, None);
        }
    }

    fn is_active(&self) -> bool {
        matches!(self.safety, Some((SafetyMode::Active, _)))
    }

    fn monitor(&mut self, measured: &Measured<'_, R>) {
        let law = self.supervisor.law();
        if measured.state.displaced && matches!(law, State::Idle | State::Lower) {
            // Nothing has to stop; nothing may begin either.
            self.supervisor.latch(Fault::ImplausiblePosition);
        }
        if !law.has_torque() {
            self.catch(measured);
            return;
        }
        self.bounds.tighten(&self.model, &measured.state.q);
        let (depends, lag) = match (&self.law, &self.run) {
            (Law::Run(Running { lag, .. }), Some(run)) => (run.options.feedback || run.options.force_control, *lag),
            _ => (false, Lag::none()),
        };
        let effort = match &self.law {
            Law::Posture(posture) => Some(posture.effort()),
            Law::Run(Running { controller, pressing, .. }) => Some(Effort {
                feedback: controller.feedback(),
                sent: *controller.feedback(),
                pressing: Some(pressing),
                desired: controller.desired(),
                breaking_away: 0,
                plan: Plan::Run { observer: &self.observer, friction: controller.friction() },
            }),
            _ => None,
        };
        let seen = Observation {
            frames: measured.frames,
            bounds: &self.bounds,
            force: self.wrench.raw_force(),
            wrench: &measured.wrench,
            lag: (lag.distance, lag.speed),
            wrench_lost: self.is_blind(u16::from(WRENCH_AGE) + FADE),
            blind: self.is_blind(WRENCH_AGE.into()) || self.is_bare() && self.armed_for >= laws::ARMING,
            depends,
            carried: self.armed_for >= laws::ARMING,
            effort,
            shakes: self.observer.shakes(),
            full_scale: self.wrench.full_scale().force > 0 || (depends && self.wrench.full_scale().torque > 0),
        };
        if let Some((trigger, fault)) = self.monitor.check(law, measured.state, &seen) {
            self.trigger(trigger, fault, Some(measured));
        }
    }

    /// Asks for brakes where an arm that is activated falls before anybody has commanded it. Not inlined: an arm with
    /// torque has no use for it.
    #[inline(never)]
    fn catch(&mut self, measured: &Measured<'_, R>) {
        let active = self.is_active();
        let Law::Off { brakes, .. } = &mut self.law else { return };
        if active && *brakes == 0 && laws::falls(measured) {
            *brakes = BRAKE_WORDS;
        }
    }

    /// True if the arm carries nothing, as far as anybody knows: no sensor answers.
    fn is_bare(&self) -> bool {
        self.calibration.payload == Payload::None
    }

    /// True if an arm that has a sensor has had no wrench for so many control periods.
    fn is_blind(&self, periods: u16) -> bool {
        !self.is_bare() && self.wrench.age().is_none_or(|age| u16::from(age) > periods)
    }

    /// The first rest after start-up is the zero of the sensors; the arm is braked then, and nobody uses the hand.
    fn tare_first(&mut self) {
        self.wrench.tare_first();
        if self.wrench.is_tared() {
            self.hand.tare_drift();
        }
    }

    /// Computes the torque of the state and sends it, or nothing; fills in the record.
    fn act(&mut self, measured: &Measured<'_, R>, record: &mut CycleRecord) -> Actuation {
        record.q = measured.state.q.to_f32();
        record.dq = measured.state.dq.to_f32();
        record.q_d = record.q;
        record.pose = measured.pose.to_f32();
        record.pose_d = record.pose;
        record.wrench = measured.wrench.to_f32();
        record.lost_replies = measured.state.missing;
        record.flags |= flags::POSITIONS_KNOWN;
        let Some(demand) = self.demand(measured) else {
            return self.actuate_without_torque();
        };
        let (torques, report) = self.limiter.limit(&demand.torque);
        let (model, wanted) = &demand.explained;
        self.beyond = torques.torques().0 - model;
        self.observer.send(&self.model, measured.frames, wanted, &self.beyond);
        self.cut = report;
        self.armed_for = self.armed_for.saturating_add(1);
        record.q_d = demand.q_d.to_f32();
        record.pose_d = demand.pose_d.to_f32();
        record.phase = demand.phase.single();
        record.surprise = demand.surprise.single();
        record.flags |= demand.flags | limit_flags(report);
        if report.not_finite {
            // A soft stop computes with less; if that is not finite either, nothing is left but zero.
            let stopping = self.supervisor.law() == State::SoftStop;
            let trigger = if stopping { Trigger::HardFault } else { Trigger::SoftFault };
            self.trigger(trigger, Fault::NotFinite, Some(measured));
            if !self.supervisor.state().has_torque() {
                return self.actuate_without_torque();
            }
        }
        record.tau = torques.torques().to_f32();
        if matches!(&self.law, Law::Lower(lowering) if lowering.is_over()) {
            self.trigger(Trigger::Arrived, Fault::None, Some(measured));
            return self.actuate_without_torque();
        }
        if self.is_over(measured) {
            self.trigger(Trigger::Arrived, Fault::None, Some(measured));
            record.flags |= flags::ARRIVED;
            self.news.tell(Event::Arrived);
        }
        let mut actuation = Actuation::torque(&torques, &self.calibration);
        let fault = self.supervisor.fault();
        if self.joints.has_lost_sight() || fault == Fault::UnseenContact && self.is_bare() {
            // Torque cannot damp a joint that nobody sees, nor carry what nobody knows of: brakes, as soon as the
            // safety module has them on.
            actuation = actuation.requesting_idle();
        }
        let keeps = self.supervisor.law() != State::Gravity;
        let hand = self.hand.step(&self.gains.hand, keeps);
        record.hand_d = self.hand.desired().map(Real::single);
        match hand {
            Some(torques) => actuation.with_hand(&torques, &self.calibration),
            None => actuation,
        }
    }

    fn is_over(&self, measured: &Measured<'_, R>) -> bool {
        // A bridged state does not end.
        if self.supervisor.state() == State::Coast {
            return false;
        }
        match &self.law {
            Law::Run(running) => self.run.as_ref().is_none_or(|run| running.ends(run)),
            Law::Posture(Posture { approach: Some(approach), integral, .. }) => {
                let rests = integral.is_settled() && self.fastest(measured) < R::constant(STANDING);
                approach.is_overdue() || (approach.is_finished() && rests)
            }
            _ => false,
        }
    }

    fn actuate_without_torque(&mut self) -> Actuation {
        self.limiter.reset();
        let active = self.is_active();
        let faulty = self.supervisor.state() == State::Fault;
        let Law::Off { zero_cycles, brakes } = &mut self.law else { return Actuation::zero() };
        *brakes = match self.safety {
            Some((SafetyMode::Active, 0)) if *brakes > 0 => BRAKE_WORDS,
            Some((mode, 0)) if mode != SafetyMode::Active => brakes.saturating_sub(1),
            _ => *brakes,
        };
        // An ACTIVE puck applies the last torque it was sent, whoever sent it: keep it at zero.
        let sends = active || *zero_cycles > 0;
        *zero_cycles = zero_cycles.saturating_sub(1);
        let actuation = if sends { Actuation::zero() } else { Actuation::silent() };
        if *brakes > 0 || (faulty && active) { actuation.requesting_idle() } else { actuation }
    }

    fn standing_flags(&self) -> u32 {
        let mut set = 0;
        if self.supervisor.state() == State::Coast {
            set |= flags::COASTING;
        }
        if self.wrench.age() != Some(0) {
            set |= flags::WRENCH_STALE;
        }
        if self.is_blind(WRENCH_AGE.into()) {
            set |= flags::CONTACT_UNSEEN;
        }
        if self.wrench.is_tared() {
            set |= flags::TARED;
        }
        if self.is_active() {
            set |= flags::SAFETY_ACTIVE;
        }
        if self.wrench.is_saturated() {
            set |= flags::SENSOR_SATURATED;
        }
        set |= match self.caution {
            Caution::None => 0,
            Caution::Warned => flags::CAUTION,
            Caution::Slowed => flags::CAUTION | flags::SLOWED,
        };
        match self.hand.state() {
            Some(hand) if hand.is_lost() => set |= flags::HAND_LOST,
            Some(_) => set |= flags::HAND_READY,
            None => {}
        }
        set
    }
}
