//! `Law`: what acts in the present state, with all that the state remembers. Leaving a state drops what it remembered.

use nalgebra::Vector3;
use puck::Transmission;

use crate::guard::disagreement::{Effort, Plan};
use crate::law::breakaway::Breakaway;
use crate::law::gains::POSTURE_FRICTION_SPEED;
use crate::law::integral::PostureIntegral;
use crate::law::joint::JointController;
use crate::law::operational::OperationalController;
use crate::law::settling::{CLAMP, Settling};
use crate::law::spring::{LET_GO, reach};
use crate::law::support::Support;
use crate::model::friction;
use crate::plan::approach::Approach;
use crate::plan::lift::Lift;
use crate::plan::reference::JointReference;
use crate::plan::run::Run;
use crate::real::{Real, at_least, at_most, sqrt, within};
use crate::sense::drift::Drift;
use crate::sense::joints::JointState;
use crate::time::{PERIOD, periods};
use crate::units::{JointPositions, JointTorques, JointVelocities, Vector7};

/// Speed at which a held posture returns after somebody pushed the arm away from it (rad/s).
const RETURN_SPEED: f64 = 0.2;

/// The law of a state.
#[allow(
    clippy::large_enum_variant,
    reason = "there is no heap, and one of these at a time is what memory is needed for"
)]
pub(super) enum Law<R: Real> {
    /// `Idle` and `Fault`: no torque. Frames of zero torque are sent this many cycles more; the safety module is asked
    /// for its brakes until it has said so many times in a row that they are on.
    Off { zero_cycles: u8, brakes: u8 },
    /// `Gravity`, with what a stop before it carried.
    Gravity(Support<R>),
    /// `Hold` and `Approach`.
    Posture(Posture<R>),
    /// `Run`.
    Run(Running<R>),
    /// `SoftStop`: the torque beyond gravity when it began is ramped away, and what sinks nevertheless is carried.
    SoftStop(Ramp<R>, Support<R>),
    /// `Lower`: as `SoftStop`, and gravity is taken away as the arm sinks.
    Lower(Lowering<R>),
}

impl<R: Real> Law<R> {
    /// The part that is carried of a load that nobody declared.
    pub(super) fn support(&self) -> Support<R> {
        match self {
            Law::Gravity(support) | Law::SoftStop(_, support) => *support,
            Law::Lower(lowering) => lowering.support,
            Law::Off { .. } | Law::Posture(_) | Law::Run(_) => Support::new(),
        }
    }
}

/// A posture that is held, or moved along an approach.
pub(super) struct Posture<R: Real> {
    /// Desired posture (rad).
    pub(super) q: JointPositions<R>,
    /// Where that posture has given way to (rad).
    held: JointPositions<R>,
    /// True while these two differ. Kept, because an order is to begin within its cycle.
    gives_way: bool,
    /// The move in progress; `None` in `Hold`.
    pub(super) approach: Option<Approach<R>>,
    pub(super) integral: PostureIntegral<R>,
    pub(super) controller: JointController<R>,
    /// Trial of the motors with which the approach begins.
    breakaway: Breakaway<R>,
    /// Torque that it added in the last cycle (N m).
    extra: Vector7<R>,
}

impl<R: Real> Posture<R> {
    /// To hold `q`.
    pub(super) fn at(q: JointPositions<R>) -> Self {
        Posture {
            q,
            held: q,
            gives_way: false,
            approach: None,
            integral: PostureIntegral::new(),
            controller: JointController::new(R::constant(POSTURE_FRICTION_SPEED)),
            breakaway: Breakaway::none(),
            extra: Vector7::zeros(),
        }
    }

    /// Moves from here on, or stays. The integral goes on.
    pub(super) fn follow(&mut self, approach: Option<Approach<R>>, transmission: &Transmission<R>) {
        self.breakaway = match &approach {
            Some(approach) => Breakaway::along(&transmission.motor_from_joint(&(*approach.way()).into())),
            None => Breakaway::none(),
        };
        self.approach = approach;
        self.controller.reset();
    }

    /// Returns the torque that makes motors break away (N m). Not inlined: it is asked in an approach.
    #[inline(never)]
    pub(super) fn break_away(&mut self, state: &JointState<R>, transmission: &Transmission<R>) -> Vector7<R> {
        if self.breakaway.is_active() {
            let against = self.controller.feedback() + self.controller.friction();
            let against = transmission.motor_torques_from_joint(&against.into());
            let friction = friction::at_motors(transmission);
            let extra = self.breakaway.step(&against, &friction, (state.still, state.extrapolated));
            self.extra = Vector7::from(transmission.joint_torques_from_motor(extra));
        } else {
            self.extra = Vector7::zeros();
        }
        self.extra
    }

    /// Returns what is asked of the joints. Not inlined: it is asked while a posture is held or approached.
    #[inline(never)]
    pub(super) fn effort(&self) -> Effort<'_, R> {
        Effort {
            feedback: self.controller.measured_feedback(),
            sent: self.controller.feedback() + self.controller.friction() + self.extra,
            pressing: None,
            desired: self.controller.desired(),
            breaking_away: self.breakaway.due(),
            plan: Plan::Approach,
        }
    }

    /// The posture that is held (rad); `None` while it gives way.
    pub(super) fn held(&self) -> Option<&JointPositions<R>> {
        (!self.gives_way).then_some(&self.q)
    }

    /// Holds the arm where it is (rad), if it was held up: it goes on no more to where the plan of its approach is.
    pub(super) fn stay(&mut self, q: &JointPositions<R>) {
        if self.gives_way {
            self.shift_to(*q);
        }
    }

    /// Takes another posture to hold (rad).
    pub(super) fn shift_to(&mut self, q: JointPositions<R>) {
        (self.q, self.held, self.gives_way) = (q, q, false);
    }

    /// Returns what the joints should do in this control period, at `q` (rad).
    pub(super) fn reference(&mut self, state: &JointState<R>, clamp: &Vector7<R>) -> JointReference<R> {
        match &mut self.approach {
            Some(approach) => {
                let begins = approach.begins();
                let reference = approach.step();
                if begins {
                    // An order is to begin within its cycle, and the arm has not been held up yet.
                    self.shift_to(reference.q);
                    return reference;
                }
                self.give_way_along(reference, state, clamp)
            }
            None => {
                self.give_way(&state.q, &state.dq, clamp);
                JointReference::at_rest(self.held)
            }
        }
    }

    /// Goes on along an approach; what gives way of it goes along, and lets go of an arm that is faster than the plan.
    fn give_way_along(
        &mut self,
        reference: JointReference<R>,
        state: &JointState<R>,
        clamp: &Vector7<R>,
    ) -> JointReference<R> {
        self.held.0 += reference.q.0 - self.q.0;
        self.q = reference.q;
        self.give_way(&state.q, &JointVelocities(state.dq.0 - reference.dq.0), clamp);
        JointReference { q: self.held, ..reference }
    }

    /// Gives way where the arm was pushed away by more than `clamp` (rad), and comes back slowly once it is let go. A
    /// spring that is not bounded would throw it back; so would one that is, and it gives way once more to a joint that
    /// it has made fast.
    fn give_way(&mut self, q: &JointPositions<R>, dq: &JointVelocities<R>, clamp: &Vector7<R>) {
        let step = R::constant(RETURN_SPEED * PERIOD);
        let back = (self.q.0 - self.held.0).map(|way| within(way, step));
        let mut offset = (self.held.0 + back - q.0).zip_map(clamp, within);
        for (((offset, speed), clamp), let_go) in offset.iter_mut().zip(dq.0.iter()).zip(clamp.iter()).zip(LET_GO) {
            if let Some(reach) = reach(*offset, *speed, *clamp, let_go) {
                *offset = within(*offset, reach);
            }
        }
        let held = q.0 + offset;
        // Exactly, where nobody pushes: a sum of differences is not.
        let mut gives_way = false;
        self.held = JointPositions(held.zip_map(&self.q.0, |held, wanted| {
            let rest = held - wanted;
            let is_there = rest < step && rest > -step;
            gives_way |= !is_there;
            if is_there { wanted } else { held }
        }));
        self.gives_way = gives_way;
    }
}

/// The controllers that follow the plan of a run. The run itself stays in its place in the cycle: it is large, and is
/// written there once.
pub(super) struct Running<R: Real> {
    pub(super) operational: OperationalController<R>,
    pub(super) controller: JointController<R>,
    /// Torque beyond what the arm itself needs when a compliant run began, as far as an integral holds it.
    pub(super) handover: Ramp<R>,
    /// The rest of that torque.
    pub(super) leaning: Leaning<R>,
    pub(super) lag: Lag<R>,
    /// Error of the force sensor in free motion.
    pub(super) drift: Drift<R>,
    /// Torque of Eq (12) in the last cycle (N m).
    pub(super) pressing: Vector7<R>,
    /// Keeps a compliant arm that touches nothing on its plan, against friction and the error of the model.
    pub(super) settling: Settling<R>,
    /// Height to which a grip has been raised, and its load.
    pub(super) lift: Lift<R>,
}

impl<R: Real> Running<R> {
    /// True if the movement is over, and the arm is not waited for any more.
    pub(super) fn ends<const N: usize>(&self, run: &Run<R, N>) -> bool {
        run.is_over() && !(run.waits() && self.is_seeking())
    }

    /// True if the arm touches nothing, and is still on its way to its plan.
    ///
    /// Not inlined: it is asked once a run is over.
    #[inline(never)]
    fn is_seeking(&self) -> bool {
        self.settling.is_seeking() && (self.drift.is_free() || self.lift.carries())
    }
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
    /// From the way to the plan (m) and the speed against it (m/s).
    pub(super) fn new(way: &Vector3<R>, speed: R) -> Self {
        Lag { distance: sqrt(way.dot(way)), speed }
    }

    /// The tool is where the plan is.
    pub(super) fn none() -> Self {
        Lag { distance: R::constant(0.0), speed: R::constant(0.0) }
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
        Ramp { torque, left: periods, slope: R::constant(1.0 / f64::from(periods)) }
    }

    /// Nothing to take away.
    pub(super) fn none() -> Self {
        Ramp { torque: Vector7::zeros(), left: 0, slope: R::constant(0.0) }
    }

    /// Returns the torque of a joint that is taken away in this control period (N m).
    pub(super) fn fall(&self, joint: usize) -> R {
        let torque = if self.left > 0 { self.torque.get(joint) } else { None };
        torque.map_or(R::constant(0.0), |torque| *torque * self.slope)
    }

    /// Returns the torque of this control period (N m).
    pub(super) fn step(&mut self) -> Vector7<R> {
        let share = R::from_counts(i32::from(self.left)) * self.slope;
        self.left = self.left.saturating_sub(1);
        self.torque * share
    }
}

/// Speed along its torque at which a drawn spring is let go of (rad/s): half of what lets go of a posture on its way
/// back. An arm that is leaned on moves against that torque, if at all.
const RELEASED: f64 = 0.06;

/// The torque of a spring that somebody draws, or that a load has drawn. It is taken away steadily, and at once where
/// the arm begins to follow it: who lets go of the arm is not thrown back.
pub(super) struct Leaning<R: Real> {
    ramp: Ramp<R>,
    /// Power at which it is let go of (W).
    power: R,
}

impl<R: Real> Leaning<R> {
    /// Parts a torque (N m) that is to be taken away within so many control periods into what an integral holds at
    /// most, and the rest.
    pub(super) fn part(mut torque: Vector7<R>, periods: u16) -> (Ramp<R>, Self) {
        let (mut rest, mut leans) = (Vector7::zeros(), false);
        for ((torque, rest), most) in torque.iter_mut().zip(rest.iter_mut()).zip(CLAMP) {
            let held = within(*torque, R::constant(most));
            if held != *torque {
                (*rest, leans) = (*torque - held, true);
                *torque = held;
            }
        }
        let leaning = if leans { Leaning::new(rest, periods) } else { Leaning::none() };
        (Ramp::new(torque, periods), leaning)
    }

    #[inline(never)]
    fn new(torque: Vector7<R>, periods: u16) -> Self {
        let power = sqrt(torque.dot(&torque)) * R::constant(RELEASED);
        Leaning { ramp: Ramp::new(torque, periods), power }
    }

    /// Nothing to take away.
    pub(super) fn none() -> Self {
        Leaning { ramp: Ramp::none(), power: R::constant(0.0) }
    }

    /// Adds the torque of this control period (N m) for joints at this speed (rad/s), and at this one in their plan.
    pub(super) fn act(&mut self, torque: &mut JointTorques<R>, dq: &JointVelocities<R>, planned: &JointVelocities<R>) {
        if self.ramp.left > 0 {
            self.fade(torque, &(dq.0 - planned.0));
        }
    }

    /// Not inlined: it is asked in the first second of a compliant run.
    #[inline(never)]
    fn fade(&mut self, torque: &mut JointTorques<R>, away: &Vector7<R>) {
        if self.ramp.torque.dot(away) > self.power {
            *self = Leaning::none();
        }
        torque.0 += self.ramp.step();
    }
}

/// Speed of the hand at which the arm sinks (m/s): half of the 0.25 m/s of the standards for work beside a person.
pub(super) const SINKING_SPEED: f64 = 0.12;

/// Change of the share of gravity for each m/s that the hand is faster than that (1/s).
const SINKING_GAIN: f64 = 6.0;

/// Joint speed below which a lowered arm rests (rad/s).
const RESTING: f64 = 0.02;

/// Time for which it has to rest without torque: 0.5 s, in control periods.
const REST: u16 = periods(0.5);

/// Longest time of lowering: 30 s, in control periods. What has not come to rest by then is left to the brakes.
const LOWERING: u16 = periods(30.0);

/// An arm that is let down until it rests.
pub(super) struct Lowering<R: Real> {
    /// Torque beyond gravity when it began.
    pub(super) rest: Ramp<R>,
    /// Share of gravity that is carried.
    pub(super) share: R,
    /// Carries a load that nobody declared.
    pub(super) support: Support<R>,
    /// Control periods for which it has rested without torque, and those left.
    rested: u16,
    left: u16,
}

impl<R: Real> Lowering<R> {
    /// Begins with all of gravity, and with what is carried already.
    pub(super) fn new(rest: Ramp<R>, support: Support<R>) -> Self {
        Lowering { rest, share: R::constant(1.0), support, rested: 0, left: LOWERING }
    }

    /// Takes the speed of the hand (m/s) and of the fastest joint (rad/s).
    pub(super) fn step(&mut self, hand: R, joint: R) {
        let zero = R::constant(0.0);
        let change = (hand - R::constant(SINKING_SPEED)) * R::constant(SINKING_GAIN * PERIOD);
        self.share = at_most(at_least(self.share + change, zero), R::constant(1.0));
        let rests = self.share == zero && joint < R::constant(RESTING);
        self.rested = if rests { self.rested.saturating_add(1) } else { 0 };
        self.left = self.left.saturating_sub(1);
    }

    /// True once it rests without torque.
    pub(super) fn rests(&self) -> bool {
        self.rested >= REST
    }

    /// True once it rests, or nobody waits any longer.
    pub(super) fn is_over(&self) -> bool {
        self.rests() || self.left == 0
    }
}
