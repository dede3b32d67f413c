//! `HandDrive`: where the hand is to go, and whether it is driven at all.

use pinned_init::{Init, init};

use crate::act::hand::{HandLimiter, LimitedHandTorques, TORQUE_LIMIT};
use crate::law::gains::HandGains;
use crate::law::hand::HandController;
use crate::model::hand::{DIGITS, FINGERS, ranges};
use crate::plan::hand::{Grasp, HandMotion};
use crate::plan::reference::HandReference;
use crate::real::Real;
use crate::sense::hand::{HandEstimator, HandState};
use crate::sense::sample::HandSample;
use crate::time::periods;

/// Time for which the hand is still driven after a move that nothing follows: 0.5 s, in control periods.
const SETTLING: u16 = periods(0.5);

/// A finger that is this far behind its plan on the closing side stands on something (rad), if it stands: in free
/// motion it is at most 0.03 behind, and with more friction than the model's as far as that makes it.
const HELD_UP: f64 = 0.05;

/// Part of its planned speed, and speed beyond that (rad/s), below which a finger stands.
const STANDS: (f64, f64) = (0.5, 0.1);

/// Planned speed from which on a finger closes (rad/s).
const CLOSING: f64 = 0.1;

/// Aim of the hand.
#[derive(Clone, Copy, Debug)]
enum Aim<R: Real> {
    /// Nothing: the worms hold.
    None,
    /// A move that a person asked for, and the control periods since its end.
    Move(HandMotion<R>, u16),
    /// A reference: that of the run, or the last one.
    Follow(HandReference<R>),
}

/// The hand from its replies to its torques.
#[derive(Clone, Debug)]
pub struct HandDrive<R: Real> {
    estimator: HandEstimator<R>,
    state: Option<HandState<R>>,
    /// True if the state is that of a lost hand. Asked once in a cycle: the small fast memory of a board is full.
    lost: bool,
    controller: HandController<R>,
    limiter: HandLimiter<R>,
    aim: Aim<R>,
    /// Gauges that Eq (14) should see (N m); `None` controls position alone.
    expected: Option<[R; FINGERS]>,
    /// True if a finger torque was cut to its limit in the last tick.
    saturated: bool,
    driven: bool,
}

impl<R: Real> HandDrive<R> {
    /// Makes, in its place, a drive that knows no hand and drives nothing.
    pub fn init(gains: &HandGains<R>) -> impl Init<Self> + use<R> {
        let controller = HandController::init(gains);
        init!(HandDrive {
            estimator: HandEstimator::new(),
            state: None,
            lost: false,
            controller <- controller,
            limiter: HandLimiter::new(),
            aim: Aim::None,
            expected: None,
            saturated: false,
            driven: false,
        })
    }

    /// Takes what the hand told since the last cycle.
    pub fn update(&mut self, sample: Option<&HandSample>) {
        self.state = self.estimator.update(sample);
        self.lost = self.state.as_ref().is_some_and(HandState::is_lost);
        if self.state.is_none() {
            self.release();
        }
    }

    /// Returns the state of the hand; `None` without an initialised one.
    pub fn state(&self) -> Option<&HandState<R>> {
        self.state.as_ref()
    }

    /// The state of a hand that answers.
    pub fn answering(&self) -> Option<&HandState<R>> {
        self.state().filter(|_| !self.lost)
    }

    /// True while a move that a person asked for is under way.
    pub fn is_moving(&self) -> bool {
        matches!(&self.aim, Aim::Move(motion, _) if !motion.is_finished())
    }

    /// Takes the present gauges as zero; false if none tells anything.
    pub fn tare(&mut self) -> bool {
        self.estimator.tare()
    }

    /// Takes what a gauge drifts away as zero.
    pub fn tare_drift(&mut self) {
        self.estimator.tare_drift();
    }

    /// Forgets every aim: no torque from now on, the worms hold.
    pub fn release(&mut self) {
        self.aim = Aim::None;
        self.expected = None;
        self.stop_driving();
    }

    /// Moves to `goal` (rad) in `duration` (s) or longer, from where the hand is held, or is. Position alone is
    /// controlled.
    pub fn move_to(&mut self, goal: &[R; DIGITS], duration: R) {
        let Some(state) = self.state else { return };
        let from = match &self.aim {
            Aim::None => state.q,
            Aim::Move(motion, _) if motion.is_finished() => motion.goal(),
            Aim::Move(..) => state.q,
            Aim::Follow(reference) => reference.q,
        };
        if goal.iter().zip(&state.q).skip(1).any(|(goal, now)| goal > now) {
            // Fingers that are to close may hold something from now on: the last moment for a first zero.
            self.estimator.tare_first();
        }
        self.expected = None;
        self.controller.reset();
        self.aim = Aim::Move(HandMotion::new(&from, goal, duration), 0);
    }

    /// Begins to follow a run.
    pub fn begin_run(&mut self) {
        self.expected = None;
        self.controller.reset();
    }

    /// Follows the plan of a run, kept within the range of the digits; with `expected` gauges (N m) also in force. A
    /// lost hand follows no more until it is heard again: a plan that goes on without its fingers tells nothing about
    /// them.
    pub fn follow(&mut self, reference: &HandReference<R>, expected: Option<[R; FINGERS]>) {
        if self.lost {
            return;
        }
        let mut reference = *reference;
        for ((q, dq), [min, max]) in reference.q.iter_mut().zip(&mut reference.dq).zip(ranges()) {
            let kept = crate::real::at_least(crate::real::at_most(*q, R::constant(max)), R::constant(min));
            if kept != *q {
                *q = kept;
                *dq = R::constant(0.0);
            }
        }
        self.aim = Aim::Follow(reference);
        self.expected = expected;
    }

    /// Returns what the hand does with what is between its fingers. Not inlined: the small fast memory of a board is
    /// full.
    #[inline(never)]
    pub fn grasp(&self) -> Grasp {
        let (Aim::Follow(reference), Some(state)) = (&self.aim, &self.state) else { return Grasp::Open };
        let fingers = reference.q.iter().zip(&state.q).zip(reference.dq.iter().zip(&state.dq)).skip(1);
        let held_up = fingers.filter(|((wanted, found), (plan, speed))| {
            **wanted - **found > R::constant(HELD_UP)
                && **speed < **plan * R::constant(STANDS.0) + R::constant(STANDS.1)
        });
        if held_up.count() > 1 {
            Grasp::Gripping
        } else if reference.dq.iter().skip(1).any(|speed| *speed > R::constant(CLOSING)) {
            Grasp::Closing
        } else {
            Grasp::Open
        }
    }

    /// Keeps the last reference, at rest: what is gripped stays gripped.
    pub fn stay(&mut self) {
        if let Aim::Follow(reference) = self.aim {
            self.aim = Aim::Follow(HandReference::at_rest(reference.q));
        }
    }

    /// Returns the desired angles (rad); the measured ones, if nothing is desired; zero without a hand.
    pub fn desired(&self) -> [R; DIGITS] {
        match (&self.aim, self.state) {
            (Aim::Follow(reference), _) => reference.q,
            (Aim::Move(motion, _), _) => motion.now().q,
            (Aim::None, Some(state)) => state.q,
            (Aim::None, None) => [R::constant(0.0); DIGITS],
        }
    }

    /// The torques of one tick; `None` where the hand is not driven. `keeps` tells whether a finished move is held on
    /// to.
    pub fn step(&mut self, gains: &HandGains<R>, keeps: bool) -> Option<LimitedHandTorques<R>> {
        let reference = match &mut self.aim {
            Aim::None => None,
            Aim::Follow(reference) => Some(*reference),
            Aim::Move(motion, settled) => {
                let reference = motion.step();
                if motion.is_finished() && !keeps {
                    *settled = settled.saturating_add(1);
                }
                (*settled <= SETTLING).then_some(reference)
            }
        };
        let Some(reference) = reference else {
            self.release();
            return None;
        };
        let (false, Some(state)) = (self.lost, &self.state) else {
            self.stop_driving();
            return None;
        };
        let wanted = self.controller.torque(gains, state, &reference, self.expected.as_ref(), self.saturated);
        self.driven = true;
        let limited = self.limiter.limit(&wanted);
        self.saturated = wanted.iter().zip(TORQUE_LIMIT).skip(1).any(|(torque, limit)| {
            // A NaN counts as saturated.
            !(*torque <= R::constant(limit) && *torque >= R::constant(-limit))
        });
        Some(limited)
    }

    /// The last torques did not leave.
    pub(super) fn not_sent(&mut self) {
        self.limiter.not_sent();
    }

    /// Not inlined: the small fast memory of a board is full.
    #[inline(never)]
    fn stop_driving(&mut self) {
        if self.driven {
            self.controller.reset();
            self.limiter.reset();
            self.saturated = false;
            self.driven = false;
        }
    }
}
