//! The laws of the states: from what is measured to the torque that is wanted. What a law remembers, its ramp for one,
//! is in `law.rs`; the length of a ramp is a constant of `mod.rs`.

use crate::cycle::law::{Lag, Law, Running, SINKING_SPEED};
use crate::cycle::record::{Event, flags};
use crate::cycle::{Cycle, Measured, WRENCH_AGE};
use crate::guard::monitor::{TIP_REACH, TIP_SPEED_LIMIT, TRACKING_LIMIT};
use crate::law::gains::Tracking;
use crate::law::operational::PoseFeedback;
use crate::model::kinematics::Frames;
use crate::model::wam7;
use crate::plan::hand::Grasp;
use crate::plan::primitive::posture_and_hand;
use crate::plan::reference::{HandReference, JointReference, TaskReference};
use crate::plan::run::{Run, Senses};
use crate::real::{Real, at_least, at_most, sqrt};
use crate::sense::leisure::Leisure;
use crate::sense::observer::Trust;
use crate::time::{PERIOD, few_periods, periods};
use crate::units::{JointPositions, JointTorques, JointVelocities, Pose, Vector6, Vector7, Wrench};

/// Length of the damping that carries the arm while gravity torque builds up after arming: 0.5 s, in control periods.
pub(super) const ARMING: u16 = periods(0.5);

/// Speed of elbow or forearm from which on an arm without torque falls (m/s). A wrist that sinks onto its stop, as that
/// of an arm at its resting place does, is no fall.
const FALLING: f64 = 0.3;

/// Speed of the hand up to which the arm floats freely (m/s).
const TAUGHT_SPEED: f64 = 0.18;

/// Speed of the hand from which it is damped as in a soft stop (m/s); in between the damping rises. 0.25 m/s, the
/// reduced speed of the standards for work beside a person, lies in between: an arm that was shoved falls below it by
/// itself.
const BRAKED_SPEED: f64 = 0.30;

/// Speed of elbow or forearm from which on a stop brakes harder (m/s), and the one from which it brakes hardest. At
/// 1.0 m/s the safety module takes the arm, and its brakes let it sink.
const BRAKED_HARDER: (f64, f64) = (0.3, 0.7);

/// Rate at which the hardest brake takes the speed of every joint (1/s), beside its damping.
const BRAKE_RATE: f64 = 10.0;

/// Age up to which a load that a silent sensor measured last is believed: 0.3 s, in control periods.
const BORNE_AGE: u8 = few_periods(0.3);

/// Speed at which a hand rises from which its load has been taken (m/s). A load that is carried rests.
const UNLOADED_SPEED: f64 = 0.02;

/// Largest speed of the hand to which a change of goal may add (m/s).
const HAND_SPEED: f64 = 0.8;

/// Output of a law: the torque wanted, and values for the record.
pub(super) struct Demand<R: Real> {
    pub(super) torque: JointTorques<R>,
    pub(super) q_d: JointPositions<R>,
    pub(super) pose_d: Pose<R>,
    pub(super) phase: R,
    /// Statistic of the watch for unusual runs.
    pub(super) surprise: R,
    pub(super) flags: u32,
    /// Torque that the model needs for the acceleration wanted (N m), and that acceleration (rad/s^2).
    pub(super) explained: (Vector7<R>, Vector7<R>),
}

impl<R: Real, const N: usize> Cycle<R, N> {
    /// The law of the present state; `None` where no torque is sent.
    pub(super) fn demand(&mut self, measured: &Measured<'_, R>) -> Option<Demand<R>> {
        let pushed = (!self.bounds.contain(&measured.state.q)).then(|| self.push_back(measured));
        let mut demand = match &self.law {
            Law::Off { .. } => return None,
            Law::Gravity(_) => self.lead(measured),
            Law::Posture(_) => self.hold_to(measured),
            Law::Run(_) => self.run_primitive(measured),
            Law::SoftStop(..) | Law::Lower(_) => self.stop(measured),
        };
        if let Some(JointTorques(push)) = pushed {
            // An arm that is lowered comes down to its stops, not to what pushes back before them.
            let share = if let Law::Lower(lowering) = &self.law { lowering.share } else { R::constant(1.0) };
            demand.torque.0 += push * share;
            demand.flags |= flags::NEAR_LIMIT;
            self.press_no_further(measured, &mut demand);
        }
        Some(demand)
    }

    /// Takes from the force control what presses joints beyond their bounds further out.
    #[cold]
    #[inline(never)]
    fn press_no_further(&mut self, measured: &Measured<'_, R>, demand: &mut Demand<R>) {
        if let Law::Run(Running { pressing, .. }) = &mut self.law {
            let outward = self.bounds.outward(&measured.state.q, pressing);
            *pressing -= outward;
            demand.torque.0 -= outward;
        }
    }

    /// Torque that keeps joints within their bounds (N m). It damps what the model sees, as everything else does: at a
    /// bound the swing of the cables would be driven too.
    #[cold]
    #[inline(never)]
    fn push_back(&self, measured: &Measured<'_, R>) -> JointTorques<R> {
        let holds = |gains: &Tracking<R>| (gains.stiffness, gains.damping);
        let held = match &self.law {
            Law::Posture(_) => holds(&self.gains.stiff),
            Law::Run(_) => holds(self.gains.tracking(self.run.as_ref().is_some_and(|run| run.options.compliant))),
            _ => (Vector7::zeros(), Vector7::zeros()),
        };
        self.bounds.repulsion(
            &measured.state.q,
            &self.observer.velocity(measured.state, Trust::Stiff, &Vector7::zeros()),
            &held,
        )
    }

    fn plain(&self, measured: &Measured<'_, R>, torque: Vector7<R>) -> Demand<R> {
        Demand {
            torque: JointTorques(torque),
            q_d: measured.state.q,
            pose_d: measured.pose,
            phase: R::constant(0.0),
            surprise: R::constant(0.0),
            flags: 0,
            explained: (torque, Vector7::zeros()),
        }
    }

    /// Torque of gravity (N m) where the model sees the arm: with the swing of the cables in it, and late, it would
    /// drive them.
    fn steady_gravity(&self, measured: &Measured<'_, R>) -> Vector7<R> {
        let q = self.observer.position(measured.state);
        self.model.gravity_torque(&Frames::new(&self.model, &q)).0
    }

    /// Torque (N m) that takes the speed of an arm which the safety module would take soon. All joints lose theirs at
    /// one rate: a damping that is as strong for the forearm swings a joint that turns little.
    fn brake(&self, measured: &Measured<'_, R>, velocity: &Vector7<R>) -> Vector7<R> {
        let (from, to) = BRAKED_HARDER;
        let [elbow, tip, _] = measured.frames.watched_speeds(&measured.state.dq, R::constant(TIP_REACH));
        let share = (at_least(elbow, tip) - R::constant(from)) * R::constant(1.0 / (to - from));
        let share = at_most(at_least(share, R::constant(0.0)), R::constant(1.0));
        self.observer.mass.matrix() * velocity * (share * R::constant(BRAKE_RATE))
    }

    /// Gravity compensation; damped while it builds up after arming, and while the hand is faster than a person
    /// teaches.
    fn float(&self, measured: &Measured<'_, R>) -> Demand<R> {
        let gravity = self.steady_gravity(measured);
        let mut torque = gravity;
        let mut share =
            (hand_speed(measured) - R::constant(TAUGHT_SPEED)) * R::constant(1.0 / (BRAKED_SPEED - TAUGHT_SPEED));
        if self.armed_for < ARMING {
            let arming = R::from_counts(i32::from(ARMING - self.armed_for)) / R::from_counts(i32::from(ARMING));
            share = at_least(share, arming);
        }
        let (light, full) = (&self.gains.lead_damping, &self.gains.stop_damping);
        let share = at_most(at_least(share, R::constant(0.0)), R::constant(1.0));
        let velocity = self.observer.velocity(measured.state, Trust::Stiff, &Vector7::zeros());
        torque -= (light + (full - light) * share).component_mul(&velocity) + self.brake(measured, &velocity);
        Demand { explained: (gravity, Vector7::zeros()), ..self.plain(measured, torque) }
    }

    /// Gravity compensation, and what a stop carried, as long as the hand bears it: a fault that is cleared leaves its
    /// load where it was.
    #[inline(never)]
    fn lead(&mut self, measured: &Measured<'_, R>) -> Demand<R> {
        let mut demand = self.float(measured);
        if self.law.support().carries() {
            let borne =
                self.borne(measured, sinking(measured, &measured.frames.jacobian().twist(&measured.state.dq.0)));
            if let Law::Gravity(support) = &mut self.law {
                support.keep(borne);
                demand.torque.0 += support.torque(measured.frames);
            }
        }
        demand
    }

    /// The load (N) that the hand is measured to bear; none without a sensor. One that has just fallen silent is
    /// believed, unless the hand rises: from that its load has been taken.
    fn borne(&self, measured: &Measured<'_, R>, sinking: R) -> R {
        let believed = match self.senses(measured) {
            Senses::Lost => {
                self.wrench.age().is_some_and(|age| age <= BORNE_AGE) && sinking > R::constant(-UNLOADED_SPEED)
            }
            _ => true,
        };
        if believed { -measured.wrench.force.z } else { R::constant(0.0) }
    }

    /// Gravity compensation and damping; what else was there is ramped away, and gravity too where the arm is lowered.
    /// Not inlined, as [`Cycle::hold_to`].
    #[inline(never)]
    fn stop(&mut self, measured: &Measured<'_, R>) -> Demand<R> {
        let twist = measured.frames.jacobian().twist(&measured.state.dq.0);
        let sinking = sinking(measured, &twist);
        let borne = self.borne(measured, sinking);
        let (rest, share, support) = match &mut self.law {
            Law::SoftStop(ramp, support) => {
                support.step(sinking, borne, R::constant(0.0));
                (ramp.step(), R::constant(1.0), support)
            }
            Law::Lower(lowering) => {
                let hand = sqrt(twist.fixed_rows::<3>(0).norm_squared());
                lowering.step(hand, measured.state.dq.0.amax());
                // As long as gravity is carried, what sinks is a load that a hold has borne.
                let allowed = R::constant(SINKING_SPEED) * (R::constant(1.0) - lowering.share);
                lowering.support.step(sinking, borne, allowed);
                (lowering.rest.step(), lowering.share, &mut lowering.support)
            }
            _ => return self.float(measured),
        };
        let load = support.torque(measured.frames);
        let gravity = self.steady_gravity(measured);
        let velocity = self.observer.velocity(measured.state, Trust::Stiff, &Vector7::zeros());
        let damping = self.gains.stop_damping.component_mul(&velocity) + self.brake(measured, &velocity);
        let demand = self.plain(measured, gravity * share + rest + load - damping);
        Demand { explained: (gravity, Vector7::zeros()), ..demand }
    }

    /// Eq (10) along a joint reference, with the integral that takes away what friction leaves.
    /// Not inlined: the small fast memory of a board is for the code of a run.
    #[inline(never)]
    fn hold_to(&mut self, measured: &Measured<'_, R>) -> Demand<R> {
        let Law::Posture(posture) = &mut self.law else { return self.float(measured) };
        let reference = posture.reference(measured.state, &self.gains.stiff.clamp);
        let frozen = measured.state.missing > 0;
        if !frozen && !self.cut.is_cut() {
            let error = reference.q.0 - measured.state.q.0;
            let before = *posture.integral.shift();
            posture.integral.step(&self.gains, &error, &(measured.state.dq.0 - reference.dq.0));
            // What the integral adds is there for friction, and moves nothing.
            let added = self.gains.stiff.stiffness.component_mul(&(posture.integral.shift() - before));
            self.observer.hold_back(&added);
        }
        let shifted = JointReference { q: JointPositions(reference.q.0 + posture.integral.shift()), ..reference };
        let trust = if posture.approach.is_some() { Trust::Approach } else { Trust::Stiff };
        let velocity = self.observer.velocity(measured.state, trust, &reference.dq.0);
        let mut torque = posture.controller.torque(
            &self.model,
            &self.gains.stiff,
            measured.frames,
            measured.state,
            &velocity,
            &shifted,
        );
        let pose_d = Frames::new(&self.model, &reference.q).tool_pose();
        let explained = (torque.0 - posture.controller.feedback(), reference.ddq.0);
        torque.0 += posture.break_away(measured.state, &self.calibration.transmission);
        Demand { torque, q_d: reference.q, pose_d, explained, ..self.plain(measured, Vector7::zeros()) }
    }

    /// Returns the age of the sensor's values; all of a tick in which a position is missing are old.
    fn senses(&self, measured: &Measured<'_, R>) -> Senses {
        match self.wrench.age() {
            Some(0) if measured.state.missing == 0 => Senses::Fresh,
            Some(age) if age <= WRENCH_AGE => Senses::Frozen,
            _ => Senses::Lost,
        }
    }

    /// Eqs (8), (9), (11), (10), (12), (13), and the hand's part for Eq (14).
    ///
    /// Not inlined: the memory map of a board names it.
    #[inline(never)]
    fn run_primitive(&mut self, measured: &Measured<'_, R>) -> Demand<R> {
        let senses = self.senses(measured);
        let (Law::Run(running), Some(run), Some(primitive)) = (&mut self.law, &mut self.run, self.loaded.get()) else {
            // A run begins with a primitive, and no other is loaded meanwhile; else the arm floats.
            return self.float(measured);
        };
        let Running { operational, controller, handover, leaning, lag, drift, pressing, settling, lift } = running;
        let (options, tracking) = (run.options, self.gains.tracking(run.options.compliant));
        let hand = self.hand.answering().filter(|hand| hand.feels());
        let gauges = hand.map(|hand| &hand.gauges);
        let grasp = self.hand.grasp();
        let Ok(plan) = run.step(primitive, &measured.wrench, gauges, grasp, senses) else {
            return self.float(measured);
        };
        if senses == Senses::Fresh {
            self.wrench.follow(drift, &measured.wrench, (run.deviation(), run.has_ended()), measured.frames);
            if let Some(surprise) = run.watch(primitive, &measured.wrench, hand) {
                self.news.tell(Event::Surprised { phase: surprise.progress, channel: surprise.channel });
            }
        }
        let deviation = run.steadied().filter(|_| options.force_control);
        self.hand.follow(
            &HandReference { q: posture_and_hand(&plan.points.x).1, dq: posture_and_hand(&plan.points.v).1 },
            deviation.map(|deviation| deviation.expected_gauges),
        );
        let task = TaskReference::from_plan(&plan);
        let grips = options.compliant && grasp == Grasp::Gripping;
        operational.keep(lift.step(&task, grips, deviation.as_ref()));
        let leisure = self.observer.mass.leaves();
        self.soft_limits.renew(leisure == Leisure::Limits);
        let how = (PoseFeedback::of_run(options.compliant), options.acceleration, &mut self.soft_limits);
        let reference = operational.step(&self.model, tracking, measured.frames, measured.state, &task, how);
        if leisure == Leisure::Goal && run.goal_moves() {
            crowd(run, measured.frames, &reference.dq, lag);
        }
        let velocity = self.observer.velocity(measured.state, Trust::of_run(options.compliant), &reference.dq.0);
        let mut torque =
            controller.torque(&self.model, tracking, measured.frames, measured.state, &velocity, &reference);
        let explained = (torque.0 - controller.feedback(), reference.ddq.0);
        let mut set = if run.bends(primitive) { flags::FEEDBACK } else { 0 };
        if let Some(deviation) = deviation {
            let to_world = measured.frames.tool_to_world();
            let error = Wrench { torque: deviation.wrench.torque * tracking.moment_share, ..deviation.wrench };
            let command = self.force.calm_command(
                &-error.in_world(to_world),
                tracking.force_proportional,
                tracking.force_integral,
                R::constant(PERIOD),
                self.cut.joint || self.cut.motor || senses != Senses::Fresh,
            );
            // The expected wrench is fed forward, because the gain of the integral is finite.
            let wanted = bounded(&command, tracking.force_limit) * run.kept() - deviation.expected.in_world(to_world);
            let wanted = self.force.confirmed(&wanted, &measured.wrench.in_world(to_world));
            *pressing = measured.frames.joint_torques(&wanted).0;
            torque.0 += *pressing;
            set |= flags::FORCE_CONTROL;
        }
        let surprise = run.surprise();
        set |= if surprise > R::constant(1.0) { flags::SURPRISE } else { 0 };
        set |= if run.is_faded(primitive) { flags::FEEDBACK_FADED } else { 0 };
        set |= if operational.is_clamped() { flags::CLAMPED } else { 0 };
        let steady = senses == Senses::Fresh && !self.cut.is_cut();
        // The sensor measures a throw, too: inertia of the hand. So what is drawn is let go of until it is relaxed.
        let lets_go = operational.is_drawn() || drift.is_free() || !(options.feedback || options.force_control);
        let drawn = lets_go && operational.let_go(measured.state, &reference.planned, &tracking.clamp);
        if options.compliant {
            let settles = steady && if grips { lift.carries() } else { drift.is_free() };
            if drawn || (grips && !settles) {
                settling.fade();
            } else if settles {
                settling.step(&tracking.stiffness, measured.state, &reference, |joint| handover.fall(joint));
            } else if drift.is_touched() {
                settling.give_way(pressing);
            }
        }
        torque.0 += handover.step() + settling.torque();
        leaning.act(&mut torque, &measured.state.dq, &reference.dq);
        *lag = Lag::new(&(task.pose.position - measured.pose.position), operational.lag());
        Demand { torque, q_d: reference.q, pose_d: task.pose, phase: plan.phase, surprise, flags: set, explained }
    }
}

/// A goal that the joints cannot follow is not led away from the tool.
#[inline(never)]
fn crowd<R: Real, const N: usize>(run: &mut Run<R, N>, frames: &Frames<R>, dq: &JointVelocities<R>, lag: &Lag<R>) {
    let behind = lag.distance * R::constant(1.0 / TRACKING_LIMIT);
    run.crowd(at_least(speed_load(frames, dq), behind));
}

/// Part of the speed limits that these joint speeds use, at most one of them in full: of the joints, of elbow and
/// forearm, and of the hand.
#[inline(never)]
fn speed_load<R: Real>(frames: &Frames<R>, dq: &JointVelocities<R>) -> R {
    let [elbow, tip, hand] = frames.watched_speeds(dq, R::constant(TIP_REACH));
    let load =
        at_least(at_least(elbow, tip) * R::constant(1.0 / TIP_SPEED_LIMIT), hand * R::constant(1.0 / HAND_SPEED));
    dq.0.iter().zip(&wam7::VELOCITY_MAX).fold(load, |load, (dq, limit)| {
        at_least(load, (if *dq < R::constant(0.0) { -*dq } else { *dq }) * R::constant(1.0 / limit))
    })
}

/// True if the arm is faster than one that is led or at rest.
pub(super) fn falls<R: Real>(measured: &Measured<'_, R>) -> bool {
    let [elbow, tip, _] = measured.frames.watched_speeds(&measured.state.dq, R::constant(TIP_REACH));
    at_least(elbow, tip) > R::constant(FALLING)
}

/// Speed at which the hand sinks (m/s). What is not measured does not sink.
fn sinking<R: Real>(measured: &Measured<'_, R>, twist: &Vector6<R>) -> R {
    if measured.state.missing == 0 { -twist[2] } else { R::constant(0.0) }
}

/// Speed of the hand (m/s).
fn hand_speed<R: Real>(measured: &Measured<'_, R>) -> R {
    sqrt(measured.frames.jacobian().twist(&measured.state.dq.0).fixed_rows::<3>(0).norm_squared())
}

/// The command with its force and its torque cut to these magnitudes (N, N m), their directions kept.
fn bounded<R: Real>(command: &Vector6<R>, (force, torque): (R, R)) -> Vector6<R> {
    let mut bounded = *command;
    for (first, limit) in [(0, force), (3, torque)] {
        let mut part = bounded.fixed_rows_mut::<3>(first);
        let length = sqrt(part.dot(&part));
        if length > limit {
            part *= limit / length;
        }
    }
    bounded
}
