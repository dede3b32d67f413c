//! `Disagreement`: torque and motion that do not fit together, without the help of the force sensor.
//!
//! Two things are seen in the torque that the joint feedback asks for. It swings by more than friction can hold back
//! while an encoder does not change by a count: that encoder stands still (A8). And it is several times the friction:
//! somebody or something pushes, which nobody else sees while the force sensor is silent (G8).

use puck::Transmission;

use crate::model::friction::{self, SWING};
use crate::model::wam7;
use crate::real::{Real, at_least};
use crate::time::few_periods;
use crate::units::{JOINTS, Vector7};

/// Desired speed of a motor from which on it has to turn (rad/s): 0.02 to 0.06 rad/s of the joint. A motor that is to
/// stand may be held by contact, whatever its torque does: closing fingers and a table swing it by more than friction.
const MOVING: f64 = 1.0;

/// Time for which the swing of a motor that breaks away has to be too large: friction lets go of it a moment before it
/// has turned by a count. 25 ms, in control periods.
const LETTING_GO: u8 = few_periods(0.025);

/// Largest swing of a motor in an approach, in parts of [`SWING`]: all joints move at once, up to half of their limits,
/// and what the model does not know of the dynamics swings with them.
const IN_APPROACH: f64 = 3.5 / SWING;

/// Swing of the torque that measured motion asks for beyond which the torque that was sent is not looked at, in parts
/// of [`SWING`]: a motor that runs away unseen is damped by what the observer believes, and time presses.
const UNDENIABLE: f64 = 4.0 / SWING;

/// Swing of the torque of the environment from which on a motor meets something, in parts of the largest swing.
const TOUCHED: f64 = 0.25;

/// Largest swing of a motor that meets something, in parts of [`SWING`]: the arm is slowed down within some cycles, and
/// the wrench is filtered.
const IN_CONTACT: f64 = 1.5;

/// Force (N) that explains why a motor does not turn, whatever its torque does.
const CONTACT: f64 = 10.0;

/// Time without a count, before a swing means anything: 50 ms, in control periods.
const STILL: u8 = few_periods(0.05);

/// Feedback torque of a joint that means a push, in parts of the model's friction: nominal motions stay below 2.5.
const PUSH: f64 = 3.5;

/// Time for which it has to push: 10 ms, in control periods.
const PUSHING: u8 = few_periods(0.01);

/// Source of the motion that is asked of the joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Plan {
    /// A posture that is held, or approached.
    Approach,
    /// A primitive.
    Run,
}

/// Torques and motion that a law asks of the joints.
pub(crate) struct Effort<'a, R: Real> {
    /// Torque of the joint feedback as measured motion alone asks for it (N m).
    pub(crate) feedback: &'a Vector7<R>,
    /// Torque that was sent against friction (N m): fed back, fed forward, and added for a motor to break away.
    pub(crate) sent: Vector7<R>,
    /// Torque of the force control (N m): it presses on the environment.
    pub(crate) pressing: Vector7<R>,
    /// Desired velocity (rad/s).
    pub(crate) desired: &'a Vector7<R>,
    /// Motors that are made to break away, one bit each, M1 lowest.
    pub(crate) breaking_away: u8,
    /// Where the motion comes from.
    pub(crate) plan: Plan,
}

/// Compares the feedback torque with the motion.
#[derive(Clone, Debug)]
pub(crate) struct Disagreement<R: Real> {
    transmission: Transmission<R>,
    /// Largest swing of each motor (N m at the motor).
    swing: [R; JOINTS],
    /// Torques of each motor at its last count, as asked for, as sent, and of the environment as measured (N m).
    anchor: [(R, R, R); JOINTS],
    /// Control periods since.
    still: [u8; JOINTS],
    /// Control periods for which the swing of each motor has been too large.
    beyond: [u8; JOINTS],
    pushing: u8,
}

impl<R: Real> Disagreement<R> {
    /// Nothing seen yet, on an arm with this transmission.
    pub(crate) fn new(transmission: Transmission<R>) -> Self {
        let zero = R::constant(0.0);
        let swing = friction::at_motors(&transmission).map(|friction| friction * R::constant(SWING));
        Disagreement {
            transmission,
            swing,
            anchor: [(zero, zero, zero); JOINTS],
            still: [0; JOINTS],
            beyond: [0; JOINTS],
            pushing: 0,
        }
    }

    /// Forgets what was seen: no feedback acts.
    pub(crate) fn reset(&mut self) {
        self.still = [0; JOINTS];
        self.pushing = 0;
    }

    /// Every motor has turned.
    pub(crate) fn all_turn(&mut self) {
        (self.still, self.beyond) = ([0; JOINTS], [0; JOINTS]);
    }

    /// Takes what the law asks of the joints, the torque (N m) and the magnitude of the force (N) that the environment
    /// is measured to apply, and the motors whose counts have not changed, one bit each; true if an encoder stands still
    /// while its motor cannot.
    ///
    /// What the environment takes of the torque swings with it, and is no friction: an arm that runs into something
    /// stands still as well.
    ///
    /// Not inlined: it is asked where a motor stands.
    #[inline(never)]
    pub(crate) fn encoder_stands_still(
        &mut self,
        effort: &Effort<'_, R>,
        environment: &Vector7<R>,
        force: R,
        unchanged: u8,
    ) -> bool {
        if force > R::constant(CONTACT) {
            self.all_turn();
            return false;
        }
        let asked = self.transmission.motor_torques_from_joint(&(*effort.feedback).into());
        let sent = self.transmission.motor_torques_from_joint(&effort.sent.into());
        let environment = self.transmission.motor_torques_from_joint(&(*environment + effort.pressing).into());
        let speeds = self.transmission.motor_from_joint(&(*effort.desired).into());
        let mut stuck = false;
        let state = self.still.iter_mut().zip(&mut self.beyond).zip(&mut self.anchor);
        let torques = self.swing.iter().zip(asked.into_iter().zip(sent).zip(environment)).zip(speeds);
        for (motor, (((still, beyond), anchor), ((limit, ((asked, sent), outside)), speed))) in
            state.zip(torques).enumerate()
        {
            let breaks_away = effort.breaking_away >> motor & 1 != 0;
            let is_to_turn = breaks_away || at_least(speed, -speed) >= R::constant(MOVING);
            if unchanged >> motor & 1 == 0 || !is_to_turn {
                (*still, *beyond) = (0, 0);
                continue;
            }
            if *still == 0 {
                *anchor = (asked, sent, outside);
            }
            *still = still.saturating_add(1);
            // What the environment takes of a torque is no friction; the joints that it slows down swing as well.
            let outside = outside - anchor.2;
            let touched = at_least(outside, -outside) > *limit * R::constant(TOUCHED);
            let limit = if touched { *limit * R::constant(IN_CONTACT) } else { *limit };
            let swings = |now: R, then: R, share: f64| {
                let (swing, limit) = (now - then, limit * R::constant(share));
                let rest = swing + outside;
                at_least(swing, -swing) > limit && at_least(rest, -rest) > limit
            };
            let (asked, sent) = ((asked, anchor.0), (sent, anchor.1));
            // What the observer believes, and friction that was fed forward, may have made up for what was asked for.
            let too_far = match effort.plan {
                _ if breaks_away => swings(sent.0, sent.1, 1.0),
                Plan::Run => swings(asked.0, asked.1, 1.0),
                Plan::Approach => {
                    swings(asked.0, asked.1, IN_APPROACH) && swings(sent.0, sent.1, IN_APPROACH)
                        || swings(asked.0, asked.1, UNDENIABLE)
                }
            };
            *beyond = if too_far { beyond.saturating_add(1) } else { 0 };
            stuck |= *still > STILL && *beyond > if breaks_away { LETTING_GO } else { 0 };
        }
        stuck
    }

    /// True if the feedback torque (N m) has been that of a push for 10 ms. Not inlined: it is asked while the sensor
    /// is silent.
    #[inline(never)]
    pub(crate) fn is_pushed(&mut self, feedback: &Vector7<R>) -> bool {
        let beyond = feedback.iter().zip(wam7::FRICTION_COULOMB).any(|(torque, friction)| {
            let bar = R::constant(PUSH * friction);
            *torque > bar || *torque < -bar
        });
        self.pushing = if beyond { self.pushing.saturating_add(1) } else { 0 };
        self.pushing >= PUSHING
    }
}
