//! `Run`: the loaded primitive in motion: its rollout, the options of this run, and the decision that it is over.

use dmp::{Pose as Place, PoseReference, Quaternion, RolloutError};
use nalgebra::Vector3;

use crate::command::{Goal, Refusal, RunOptions};
use crate::guard::watch::{Surprise, Watch};
use crate::plan::bounds::HELD_BACK;
use crate::plan::brake::brake;
use crate::plan::goal::GoalFilter;
use crate::plan::hand::Grasp;
use crate::plan::inertia::Inertia;
use crate::plan::load::within_reach;
use crate::plan::primitive::{Coupling, Primitive, Reference, Rollout, StartState, configuration, posture_and_hand};
use crate::real::{Real, at_least};
use crate::sense::deviation::{Deviation, SmoothedWrench};
use crate::sense::hand::HandState;
use crate::time::{PERIOD, periods};
use crate::units::{JointPositions, Pose, Wrench};

/// Largest distance of any joint from the start posture of the primitive (rad).
pub(crate) const START_DISTANCE: f64 = 0.05;

/// Allowed speed factors.
pub(crate) const SPEEDS: (f32, f32) = (0.1, 2.0);

/// The plan counts as at rest below these speeds (m/s, rad/s).
const REST: (f64, f64) = (2e-3, 1e-2);

/// The hand rows count as at rest below this speed (rad/s).
const HAND_REST: f64 = 5e-2;

/// Time that the plan stays at rest before the run is over: 1 s, in control periods. It is three time constants of the
/// pose feedback of Eq (11), so that the arm has closed the last millimetres.
const SETTLING: u16 = periods(1.0);

/// Time from the end of the movement in which an arm that touches nothing may come to its goal: 5 s, in control
/// periods.
const ARRIVING: u16 = periods(5.0);

/// Progress beyond the end from which a plan that never comes to rest is over as well.
const OVERTIME: f64 = 0.5;

/// The same for a run that the feedback bends: it never comes to rest while something presses. At least [`SETTLING`],
/// or the arm of a short run would be held in the middle of its movement.
const OVERTIME_WITH_FEEDBACK: f64 = 0.15;

/// Progress that a plan needs to follow a goal that has stopped moving: seven time constants of the usual spring.
const FOLLOWING: f64 = 0.5;

/// Time in which the feedback fades out when the sensor falls silent: 100 ms, in control periods.
pub(crate) const FADE: u16 = periods(0.1);

/// Largest distance of a digit of the hand from where the primitive starts (rad).
const HAND_DISTANCE: f64 = 0.15;

/// Speed of the plan up to which a hand that begins to close stands (m/s): nobody approaches so.
const STANDING: f64 = 0.02;

/// Speed of the plan above which a hand that closes no longer stands (m/s): what it closes on leads it.
const LEADING: f64 = 0.1;

/// Control periods after which another period of braking is allowed: a touch is braked, and what swings is not. Without
/// friction a plan that brakes all the time drives the cable of J1.
const BRAKING: u16 = 20;

/// The most that is saved up: a quarter of a second of braking, after five seconds without. A hand that meets something
/// bounces off it a few times.
const BRAKING_FULL: u16 = BRAKING * periods(0.25);

/// Age of the sensor values of a tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Senses {
    /// All values are of this tick.
    Fresh,
    /// Something is missing in this tick: what was computed last stays.
    Frozen,
    /// The wrench has been silent for too long: the feedback fades.
    Lost,
}

/// A run in progress.
#[derive(Clone, Debug)]
pub(crate) struct Run<R: Real, const N: usize> {
    rollout: Rollout<R, N>,
    pub(crate) options: RunOptions,
    /// Feedback as computed last, before it fades.
    coupling: Coupling<R>,
    deviation: Option<Deviation<R>>,
    /// The filtered deviation, by which a compliant run bends, and any run in which the hand grasps.
    smoothed: SmoothedWrench<R>,
    /// Mass of a plan that bends.
    inertia: Inertia<R>,
    /// True while the hand holds something, or closes where it stands in a compliant run.
    grasps: bool,
    watch: Watch<R>,
    /// Control periods of fading left: `FADE` in full, 0 gone.
    kept: u16,
    /// The movement has ended, and the plan stays as the feedback has bent it.
    settled: bool,
    rested: u16,
    /// Control periods since the movement has ended.
    ended: u16,
    /// Control periods of braking that are left, [`BRAKING`] times as many.
    braking: u16,
    goal: GoalFilter<R>,
    /// Progress at which the movement ends: 1, or later if the goal has moved.
    end: R,
    /// Part of the speed limits that the plan uses.
    load: R,
    /// Speed factor that was asked for.
    speed: f32,
    /// It is held to [`HELD_BACK`].
    slow: bool,
}

impl<R: Real, const N: usize> Run<R, N> {
    /// Puts a run into its place that begins at the measured pose and posture, at rest; a refused one leaves the place
    /// as it was. `slow` holds it to half of the taught speed. In place, because moving it out of a result costs
    /// thousands of instructions in the cycle that has most to do.
    ///
    /// # Errors
    /// [`Refusal`]: the arm or the hand is not where the primitive starts, or an option is out of range.
    pub(crate) fn start(
        place: &mut Option<Self>,
        primitive: &Primitive<R, N>,
        q: &JointPositions<R>,
        pose: &Pose<R>,
        hand: Option<&HandState<R>>,
        (options, slow): (RunOptions, bool),
    ) -> Result<(), Refusal> {
        let (taught_posture, taught_hand) = posture_and_hand(&primitive.movement().start().points);
        let far = |(q, start): (&R, &R)| {
            let distance = *q - *start;
            !(distance <= R::constant(START_DISTANCE) && distance >= R::constant(-START_DISTANCE))
        };
        if q.0.iter().zip(&taught_posture).any(far) {
            return Err(Refusal::StartTooFar);
        }
        let hand = match hand {
            Some(state) => {
                let far = |(q, start): (&R, &R)| {
                    let distance = *q - *start;
                    !(distance <= R::constant(HAND_DISTANCE) && distance >= R::constant(-HAND_DISTANCE))
                };
                if state.q.iter().zip(&taught_hand).any(far) {
                    return Err(Refusal::HandTooFar);
                }
                state.q
            }
            None => taught_hand,
        };
        let start = StartState::at_rest(configuration(pose.position.into(), pose.orientation.0, q.0.into(), hand));
        let mut run = Run {
            rollout: Rollout::start(primitive.movement(), &start).map_err(reason)?,
            options,
            coupling: Coupling::NONE,
            deviation: None,
            smoothed: SmoothedWrench::new(),
            inertia: Inertia::none(),
            grasps: false,
            watch: Watch::new(),
            kept: FADE,
            settled: false,
            rested: 0,
            ended: 0,
            braking: BRAKING_FULL,
            goal: GoalFilter::at(primitive.movement().goal().poses[0]),
            end: R::constant(1.0),
            load: R::constant(0.0),
            speed: options.speed,
            slow,
        };
        run.inertia.take_on(primitive);
        // The first speed acts at once; later ones are approached at the rollout's slew rate.
        run.rollout.set_speed_slew(None).map_err(reason)?;
        run.set_speed(primitive, options.speed)?;
        run.rollout.set_speed_slew(Some(R::constant(Rollout::<R, N>::DEFAULT_SLEW))).map_err(reason)?;
        run.set_goal(primitive, &options.goal)?;
        *place = Some(run);
        Ok(())
    }

    /// Takes a new goal, or leaves everything as it was.
    pub(crate) fn set_goal(&mut self, primitive: &Primitive<R, N>, goal: &Goal) -> Result<(), Refusal> {
        if *goal != Goal::STORED {
            let (position, orientation) = checked_goal(&self.rollout, primitive, goal)?;
            self.goal.command(position, orientation);
            (self.rested, self.ended) = (0, 0);
        }
        Ok(())
    }

    /// The deviation as force control takes it: while the hand grasps, without what swings. The inertia of an object
    /// behind the sensor would drive the cables, and fingers that clamp make a contact too stiff for the fast path.
    pub(crate) fn steadied(&self) -> Option<Deviation<R>> {
        self.deviation.map(|deviation| if self.grasps { deviation.smoothed(&self.smoothed) } else { deviation })
    }

    /// True while the goal is on its way to the one that was commanded.
    pub(crate) fn goal_moves(&self) -> bool {
        self.goal.moves()
    }

    /// Takes the part of the speed limits that the plan uses: a goal on its way waits for what is left.
    pub(crate) fn crowd(&mut self, load: R) {
        self.load = load;
    }

    /// True if the feedback of Eq (8) bends the plan.
    pub(crate) fn bends(&self, primitive: &Primitive<R, N>) -> bool {
        self.options.feedback && !self.settled && primitive.feedback().is_some()
    }

    /// Moves the goal. Not inlined: it is rare, and a board may keep the code of every cycle in a small fast memory.
    #[inline(never)]
    fn lead_goal(&mut self, primitive: &Primitive<R, N>) {
        if !self.goal.moves() {
            return;
        }
        if let Some(goal) = self.goal.step(self.rollout.phase(), self.load) {
            // Both were allowed for the goal that was commanded; what cannot be set on the way to it is left out.
            let _ = self.rollout.set_goal_position(0, goal.position);
            if self.goal.turns() {
                let _ = self.rollout.set_goal_orientation(primitive.movement(), 0, goal.orientation);
            }
        }
        if self.goal.lags() {
            self.end = at_least(self.end, self.rollout.progress() + R::constant(FOLLOWING));
        }
    }

    /// Adds what takes the plan's speed against a force that was not expected. The force of this tick counts, not the
    /// smoothed one: each millisecond does.
    #[inline(never)]
    fn brake(&mut self, primitive: &Primitive<R, N>, coupling: &mut Coupling<R>) {
        self.braking = BRAKING_FULL.min(self.braking + 1);
        let Some(deviation) = self.deviation.as_ref().filter(|_| self.braking >= BRAKING) else { return };
        let rate = primitive.movement().rate() * self.rollout.speed();
        let velocity = self.rollout.scaled_velocities()[0].into();
        if let Some(taken) = brake(&velocity, &deviation.wrench.force, rate) {
            self.braking -= BRAKING;
            let (taken, [x, y, z]) = (taken * primitive.trust(&self.rollout), &mut coupling.poses[0].position);
            (*x, *y, *z) = (*x + taken.x, *y + taken.y, *z + taken.z);
        }
    }

    /// True if the plan of the hand moves by no more than what it closes on makes it.
    fn stands(&self, primitive: &Primitive<R, N>) -> bool {
        let limit = if self.grasps { R::constant(1.0 / LEADING) } else { R::constant(1.0 / STANDING) };
        let velocity = Vector3::from(self.rollout.scaled_velocities()[0])
            * (primitive.movement().rate() * self.rollout.speed() * limit);
        velocity.dot(&velocity) < R::constant(1.0)
    }

    fn is_finished(&self) -> bool {
        self.rollout.is_finished() && self.rollout.progress() >= self.end
    }

    /// Takes a new speed factor; what the rollout refuses as too fast is out of range as well, also while the speed is
    /// held back: it comes back to this factor.
    pub(crate) fn set_speed(&mut self, primitive: &Primitive<R, N>, factor: f32) -> Result<(), Refusal> {
        if !(factor >= SPEEDS.0 && factor <= SPEEDS.1) {
            return Err(Refusal::OutOfRange);
        }
        let mut set = |factor: f32| self.rollout.set_speed(primitive.movement(), R::constant(f64::from(factor)));
        set(factor).map_err(reason)?;
        if self.slow && factor > HELD_BACK {
            set(HELD_BACK).map_err(reason)?;
        }
        self.speed = factor;
        Ok(())
    }

    /// Holds the speed to half of the taught one, or lets it go back to what was asked for.
    pub(crate) fn hold_back(&mut self, primitive: &Primitive<R, N>, slow: bool) {
        self.slow = slow;
        // The factor was accepted before, and a slower one always is.
        let _ = self.set_speed(primitive, self.speed);
    }

    /// The plan of this tick; `grasp` is that of the hand.
    ///
    /// # Errors
    /// [`RolloutError::OtherPrimitive`]: this is not the primitive that the run was started with.
    pub(crate) fn step(
        &mut self,
        primitive: &Primitive<R, N>,
        wrench: &Wrench<R>,
        gauges: Option<&[R; 3]>,
        grasp: Grasp,
        senses: Senses,
    ) -> Result<Reference<R>, RolloutError> {
        // A hand that closes on its way meets what is in that way as an open one does; a stiff one that closes along
        // a table has to give way at once.
        let clamps = grasp == Grasp::Closing && self.options.compliant && self.stands(primitive);
        self.grasps = grasp == Grasp::Gripping || clamps;
        let grasps = self.grasps;
        self.kept = match senses {
            Senses::Lost => self.kept.saturating_sub(1),
            _ => FADE.min(self.kept + 1),
        };
        if senses == Senses::Fresh {
            let progress = self.rollout.progress();
            self.deviation =
                primitive.expected().map(|expected| Deviation::new(&expected.at(progress), wrench, gauges));
            if let Some(deviation) = &self.deviation {
                self.smoothed.step(wrench, &deviation.expected, grasps);
            }
        }
        let bends = self.options.feedback && !self.settled;
        if let Some(deviation) = self.deviation.filter(|_| bends && senses == Senses::Fresh) {
            // What swings is an arm that follows softly, or that holds something; a stiff one meets hard things, where
            // each millisecond counts.
            let mut seen =
                if self.options.compliant || grasps { deviation.smoothed(&self.smoothed) } else { deviation };
            if !self.options.finger_feedback {
                seen.gauges = [R::constant(0.0); 3];
            }
            if self.options.compliant || grasps {
                self.inertia.carry(&mut seen.wrench.force, primitive.movement().rate() * self.rollout.speed());
            }
            self.coupling = primitive.coupling(&self.rollout, &seen.error())?;
        }
        // A plan that springs back tips what has just been grasped, and one that goes on giving way pulls at it.
        self.lead_goal(primitive);
        let settles = bends && self.is_finished() && self.kept == FADE;
        if settles {
            self.rollout.settle();
            self.coupling = Coupling::NONE;
            self.settled = true;
        }
        let mut coupling = self.coupling;
        if self.kept < FADE {
            let kept = self.kept();
            coupling = coupling.map(|value| value * kept);
        }
        if senses == Senses::Fresh && self.options.compliant && !grasps && self.bends(primitive) {
            self.brake(primitive, &mut coupling);
        }
        let plan = self.rollout.step(primitive.movement(), R::constant(PERIOD), &coupling)?;
        if settles {
            let [PoseReference { position, orientation }] = &plan.poses;
            self.goal = GoalFilter::at(Place { position: position.x, orientation: orientation.quaternion });
        }
        let (posture, hand) = posture_and_hand(&plan.points.v);
        let slow = |speeds: &[R], limit: f64| {
            speeds.iter().all(|speed| *speed < R::constant(limit) && *speed > R::constant(-limit))
        };
        let finished = self.is_finished();
        self.ended = if finished { self.ended.saturating_add(1) } else { 0 };
        let resting = finished
            && plan.poses.iter().all(|pose| slow(&pose.position.v, REST.0) && slow(&pose.orientation.omega, REST.1))
            && slow(&posture, REST.1)
            && slow(&hand, HAND_REST);
        self.rested = if resting { self.rested.saturating_add(1) } else { 0 };
        Ok(plan)
    }

    /// Compares the measured values with the statistics of the primitive, if it has any; returns what has just become a
    /// surprise.
    pub(crate) fn watch(
        &mut self,
        primitive: &Primitive<R, N>,
        wrench: &Wrench<R>,
        hand: Option<&HandState<R>>,
    ) -> Option<Surprise> {
        let statistics = primitive.statistics()?;
        let (f, n) = (&wrench.force, &wrench.torque);
        let zero = [R::constant(0.0); 3];
        let [g1, g2, g3] = hand.map_or(zero, |hand| hand.gauges);
        let [q1, q2, q3] = hand.map_or(zero, |hand| {
            let [_spread, fingers @ ..] = hand.q;
            fingers
        });
        let values = [f.x, f.y, f.z, n.x, n.y, n.z, g1, g2, g3, q1, q2, q3];
        self.watch.step(statistics, self.rollout.progress(), &values, hand.is_some())
    }

    /// The largest z-score, 1 at the limit of a surprise; 0 without statistics.
    pub(crate) fn surprise(&self) -> R {
        self.watch.statistic()
    }

    /// Share of the feedback that has not faded: 1 unless the sensor is silent.
    pub(crate) fn kept(&self) -> R {
        R::from_counts(i32::from(self.kept)) * R::constant(1.0 / FADE as f64)
    }

    /// True if the feedback or the force controller acts with less than it would: the sensor is silent, or the run
    /// takes another time than the recording of the expectation.
    pub(crate) fn is_faded(&self, primitive: &Primitive<R, N>) -> bool {
        let uses_force = self.options.feedback || self.options.force_control;
        let derated = self.options.feedback && primitive.trust(&self.rollout) < R::constant(1.0);
        (uses_force && self.kept < FADE) || derated
    }

    /// True if the movement is over.
    pub(crate) fn is_over(&self) -> bool {
        let overtime = if self.options.feedback { OVERTIME_WITH_FEEDBACK } else { OVERTIME };
        let is_overdue = self.ended >= SETTLING && self.rollout.progress() > self.end + R::constant(overtime);
        self.rested >= SETTLING || is_overdue
    }

    /// True once the movement has ended, though not yet the run.
    pub(crate) fn has_ended(&self) -> bool {
        self.ended > 0
    }

    /// True as long as an arm that is still on its way to its goal is waited for.
    pub(crate) fn waits(&self) -> bool {
        self.ended < ARRIVING
    }

    /// The expected sensor values and the deviation from them, as of the last complete tick; `None` without an
    /// expectation.
    pub(crate) fn deviation(&self) -> Option<&Deviation<R>> {
        self.deviation.as_ref()
    }
}

/// Returns what is new in a goal, if all of it can be set.
#[allow(clippy::type_complexity, reason = "two parts of a goal, each given or not")]
fn checked_goal<R: Real, const N: usize>(
    rollout: &Rollout<R, N>,
    primitive: &Primitive<R, N>,
    goal: &Goal,
) -> Result<(Option<[R; 3]>, Option<Quaternion<R>>), Refusal> {
    let mut next = rollout.clone();
    let mut position = None;
    if let Some(wanted) = goal.position {
        if wanted.iter().any(|value| !value.is_finite()) {
            return Err(Refusal::OutOfRange);
        }
        let wanted = wanted.map(|value| R::constant(f64::from(value)));
        if !within_reach(&Vector3::from(wanted)) {
            return Err(Refusal::OutsideWorkspace);
        }
        next.set_goal_position(0, wanted).map_err(reason)?;
        position = Some(wanted);
    }
    let mut orientation = None;
    if let Some(wanted) = goal.orientation {
        let [w, x, y, z] = wanted.map(|value| R::constant(f64::from(value)));
        let wanted = Quaternion::new(w, x, y, z);
        next.set_goal_orientation(primitive.movement(), 0, wanted).map_err(reason)?;
        orientation = Some(wanted.renormalised());
    }
    Ok((position, orientation))
}

/// Every reason a rollout gives is a number out of range.
fn reason(_: RolloutError) -> Refusal {
    Refusal::OutOfRange
}
