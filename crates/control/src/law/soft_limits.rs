//! `SoftLimits`: a plan of the joints comes to a soft limit slowly, no joint of it is faster than it may be, and the
//! others make up for the one that is held back.

use crate::model::arm::ArmModel;
use crate::model::kinematics::DampedInverse;
use crate::model::wam7;
use crate::real::{Real, at_least, at_most};
use crate::units::{JOINTS, Vector7};

/// Time constant with which a plan comes to a soft limit (s). Stopped at once, a compliant joint swings past it: J2
/// that came with 0.26 rad/s by 0.02 rad, which stops the arm.
const LIMIT_TIME: f64 = 0.15;

/// Distance of a plan from a soft limit within which it comes to it slowly, if it does (rad): one of 2 rad/s does.
const NEAR_LIMIT: f64 = 0.35;

/// Part of its largest speed from which on a joint is near it.
const NEAR_SPEED: f64 = 0.8;

/// The joints of a plan near their limits of position or speed.
#[derive(Clone, Debug)]
pub struct SoftLimits<R: Real> {
    /// Joints that are near, one bit each, J1 lowest, and the one whose turn it is to be looked at.
    near: u8,
    looked_at: u8,
    /// Rates of the other joints instead of one at its limit, for each rate that it loses, and the number of that joint
    /// from 1; 0 where none is.
    instead: Vector7<R>,
    instead_of: u8,
    has_time: bool,
    /// Largest speeds (rad/s).
    fastest: [R; JOINTS],
}

impl<R: Real> SoftLimits<R> {
    /// No joint is near.
    pub fn new() -> Self {
        SoftLimits {
            near: 0,
            looked_at: 0,
            instead: Vector7::zeros(),
            instead_of: 0,
            has_time: true,
            fastest: wam7::VELOCITY_MAX.map(R::constant),
        }
    }

    /// Another plan begins.
    pub fn restart(&mut self) {
        (self.near, self.instead_of) = (0, 0);
    }

    /// Rates of the joints instead of one change slowly: they are renewed in the ticks that have the time.
    pub fn renew(&mut self, has_time: bool) {
        self.has_time = has_time;
    }

    /// True if a joint is near, as far as is known. One joint of this posture (rad) and these rates (rad/s) is looked
    /// at in a tick, because none comes there faster.
    pub fn look(&mut self, model: &ArmModel<R>, q: &Vector7<R>, rates: &Vector7<R>) -> bool {
        let joint = usize::from(self.looked_at) % JOINTS;
        self.looked_at = joint as u8 + 1;
        let near = R::constant(NEAR_LIMIT);
        let (q, rate, bit) = (q[joint], rates[joint], 1 << joint);
        let fast = R::constant(NEAR_SPEED) * self.fastest[joint];
        let is_near = q < model.soft_min[joint] + near || q > model.soft_max[joint] - near;
        let is_near = is_near || rate > fast || rate < -fast;
        self.near = if is_near { self.near | bit } else { self.near & !bit };
        self.near != 0
    }

    /// Rates (rad/s) and accelerations (rad/s^2) with which joints at `q` (rad) come to their limits slowly, and the
    /// others make up for them: the arm gives way as far as it can, and does not stop. True if a joint is held back.
    ///
    /// Not inlined: it is asked near a limit.
    #[inline(never)]
    pub fn come(
        &mut self,
        model: &ArmModel<R>,
        inverse: &DampedInverse<'_, R>,
        q: &Vector7<R>,
        (rates, planned): (&mut Vector7<R>, &mut Vector7<R>),
        accelerations: &mut Vector7<R>,
    ) -> bool {
        let Some((joint, lost, less)) = self.slow_down(model, q, (&mut *rates, &mut *planned), accelerations) else {
            self.instead_of = 0;
            return false;
        };
        let number = joint as u8 + 1;
        if self.has_time {
            (self.instead, self.instead_of) = (inverse.instead_of(joint), number);
        }
        if self.instead_of == number {
            *rates += self.instead * lost;
            *accelerations += self.instead * less;
            // What makes up for one joint may lead another beyond its limit.
            self.slow_down(model, q, (rates, planned), accelerations);
        }
        true
    }

    /// Holds joints back. Returns the first of them, and the rate (rad/s) and the acceleration (rad/s^2) that it loses.
    #[inline(never)]
    fn slow_down(
        &self,
        model: &ArmModel<R>,
        q: &Vector7<R>,
        (rates, planned): (&mut Vector7<R>, &mut Vector7<R>),
        accelerations: &mut Vector7<R>,
    ) -> Option<(usize, R, R)> {
        let share = R::constant(1.0 / LIMIT_TIME);
        let limits = model.soft_min.iter().zip(&model.soft_max).zip(&self.fastest);
        // Of their arrays, because one loop over several of them is several times as long over vectors.
        let ([rates], [planned], [accelerations], [q]) =
            (&mut rates.data.0, &mut planned.data.0, &mut accelerations.data.0, &q.data.0);
        let joints = rates.iter_mut().zip(planned).zip(accelerations).zip(q);
        let (mut near, mut first) = (self.near, None);
        for (joint, ((((rate, planned), acceleration), q), ((min, max), fastest))) in joints.zip(limits).enumerate() {
            let is_near = near & 1 != 0;
            near >>= 1;
            if !is_near {
                // It is too far away to come there in this tick, and every instruction counts.
                continue;
            }
            let (down, up) = (at_least((*min - *q) * share, -*fastest), at_most((*max - *q) * share, *fastest));
            let kept = at_most(at_least(*rate, down), up);
            if kept != *rate {
                let at_speed = kept == *fastest || kept == -*fastest;
                let slowed = if at_speed { R::constant(0.0) } else { -kept * share };
                if first.is_none() && !at_speed {
                    first = Some((joint, *rate - kept, *acceleration - slowed));
                }
                (*rate, *acceleration) = (kept, slowed);
                *planned = at_most(at_least(*planned, down), up);
            }
        }
        first
    }
}

impl<R: Real> Default for SoftLimits<R> {
    fn default() -> Self {
        Self::new()
    }
}
