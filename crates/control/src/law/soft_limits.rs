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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::calibration::Payload;
    use crate::model::kinematics::Frames;
    use crate::units::JointPositions;

    /// Far from every soft limit of position.
    const MIDDLE: [f64; 7] = [0.3, -0.6, 0.4, 1.5, -1.5, 0.5, 0.2];

    /// A plan of which every joint was looked at.
    struct Plan {
        model: ArmModel<f64>,
        limits: SoftLimits<f64>,
        q: Vector7<f64>,
    }

    /// Rates (rad/s) and accelerations (rad/s^2) of a plan, and if a joint was held back.
    type Held = (Vector7<f64>, Vector7<f64>, Vector7<f64>, bool);

    impl Plan {
        fn at(q: [f64; 7], rates: &Vector7<f64>) -> Plan {
            let (model, limits) = (ArmModel::new(Payload::SensorAndHand), SoftLimits::new());
            let mut plan = Plan { model, limits, q: q.into() };
            plan.look(rates);
            plan
        }

        /// True if a joint is near, once each was looked at.
        fn look(&mut self, rates: &Vector7<f64>) -> bool {
            (0..JOINTS).fold(false, |_, _| self.limits.look(&self.model, &self.q, rates))
        }

        fn jacobian(&self) -> crate::model::kinematics::Jacobian<f64> {
            Frames::new(&self.model, &JointPositions(self.q)).jacobian()
        }

        /// Rates, planned rates and accelerations are all the same before.
        fn come(&mut self, rates: Vector7<f64>) -> Held {
            let (mut kept, mut planned, mut accelerations) = (rates, rates, rates);
            let jacobian = self.jacobian();
            let inverse = jacobian.damped(1e-9);
            let both = (&mut kept, &mut planned);
            let held = self.limits.come(&self.model, &inverse, &self.q, both, &mut accelerations);
            (kept, planned, accelerations, held)
        }
    }

    /// A rate of one joint, and of no other.
    fn rate_of(joint: usize, rate: f64) -> Vector7<f64> {
        let mut rates = Vector7::zeros();
        rates[joint] = rate;
        rates
    }

    /// `MIDDLE` with one joint so far (rad) within its upper limit, or within its lower one.
    fn near(joint: usize, upper: bool, distance: f64) -> [f64; 7] {
        let mut q = MIDDLE;
        q[joint] = if upper { wam7::SOFT_MAX[joint] - distance } else { wam7::SOFT_MIN[joint] + distance };
        q
    }

    /// The change that makes it fail: a joint in the middle of its range is near, or one beside a limit is not.
    #[test]
    fn a_joint_is_near_within_a_third_of_a_radian_of_a_limit_or_at_four_fifths_of_its_speed() {
        for joint in 0..JOINTS {
            for (distance, rate, is_near) in
                [(0.34, 0.0, true), (0.36, 0.0, false), (0.5, 0.79, false), (0.5, 0.81, true)]
            {
                for upper in [true, false] {
                    let rates = rate_of(joint, rate * wam7::VELOCITY_MAX[joint] * if upper { 1.0 } else { -1.0 });
                    let plan = Plan::at(near(joint, upper, distance), &rates);
                    let expected = if is_near { 1 << joint } else { 0 };
                    assert_eq!(plan.limits.near, expected, "J{}, {distance} rad, {rate}, {upper}", joint + 1);
                }
            }
        }
    }

    /// The change that makes it fail: a joint that was near stays so.
    #[test]
    fn a_joint_that_has_left_its_limit_and_a_plan_that_begins_are_near_to_nothing() {
        let mut plan = Plan::at(near(2, true, 0.1), &Vector7::zeros());
        plan.q[5] = wam7::SOFT_MIN[5] + 0.1;
        assert!(plan.look(&Vector7::zeros()));
        assert_eq!(plan.limits.near, 0b10_0100);
        plan.q[2] = 0.0;
        assert!(plan.look(&Vector7::zeros()));
        assert_eq!(plan.limits.near, 0b10_0000);
        plan.limits.restart();
        assert_eq!(plan.limits.near, 0);
        plan.q[5] = 0.0;
        assert!(!plan.look(&Vector7::zeros()));
    }

    /// The change that makes it fail: a joint comes to its limit with more or less than its distance in each 0.15 s,
    /// another joint is held back with it, or one that goes away from its limit is.
    #[test]
    fn a_joint_comes_to_its_limit_with_its_distance_in_the_time_constant_and_leaves_it_freely() {
        for joint in 0..JOINTS {
            for (upper, sign) in [(true, 1.0), (false, -1.0)] {
                let mut plan = Plan::at(near(joint, upper, 0.06), &Vector7::zeros());
                // No time for the rates of the others.
                plan.limits.renew(false);
                let rates = rate_of(joint, sign * 1.2) + rate_of((joint + 1) % JOINTS, 0.7);
                let (kept, planned, accelerations, held) = plan.come(rates);
                let expected = rate_of(joint, sign * 0.4) + rate_of((joint + 1) % JOINTS, 0.7);
                assert!(held && (kept - expected).amax() < 1e-9, "J{} {upper}: {kept}", joint + 1);
                assert!((planned - expected).amax() < 1e-9, "J{} {upper}: {planned}", joint + 1);
                let slowed = rate_of(joint, sign * -0.4 / 0.15) + rate_of((joint + 1) % JOINTS, 0.7);
                assert!((accelerations - slowed).amax() < 1e-9, "J{} {upper}: {accelerations}", joint + 1);
                let away = rate_of(joint, sign * -1.2);
                assert_eq!(plan.come(away), (away, away, away, false), "J{} {upper}", joint + 1);
            }
        }
    }

    /// The change that makes it fail: beyond its limit a joint is not led back.
    #[test]
    fn a_joint_beyond_its_limit_is_led_back() {
        for (upper, sign) in [(true, -1.0), (false, 1.0)] {
            let mut plan = Plan::at(near(3, upper, -0.03), &Vector7::zeros());
            plan.limits.renew(false);
            let (kept, _, _, held) = plan.come(Vector7::zeros());
            assert!(held && (kept - rate_of(3, sign * 0.2)).amax() < 1e-9, "{upper}: {kept}");
        }
    }

    /// The change that makes it fail: a joint at its speed brakes, others make up for it, or it is faster one way.
    #[test]
    fn no_joint_is_planned_faster_than_it_may_be_and_none_makes_up_for_that() {
        for joint in 0..JOINTS {
            for sign in [1.0, -1.0] {
                let fastest = sign * wam7::VELOCITY_MAX[joint];
                let rates = rate_of(joint, 1.5 * fastest);
                let mut plan = Plan::at(MIDDLE, &rates);
                let expected = rate_of(joint, fastest);
                assert_eq!(plan.come(rates), (expected, expected, Vector7::zeros(), false), "J{}", joint + 1);
            }
        }
    }

    /// The change that makes it fail: the others do not make up for the rate or the acceleration that one joint loses.
    #[test]
    fn the_others_make_up_for_a_joint_that_is_held_back_as_far_as_the_tool_goes() {
        for (joint, upper) in [(2, true), (2, false), (4, true)] {
            let mut plan = Plan::at(near(joint, upper, 0.03), &Vector7::zeros());
            let rates = rate_of(joint, if upper { 0.4 } else { -0.4 });
            let (kept, _, accelerations, held) = plan.come(rates);
            assert!(held && (kept[joint].abs() - 0.2).abs() < 1e-9, "J{}: {kept}", joint + 1);
            let jacobian = plan.jacobian();
            let (lost, less) = (jacobian.twist(&(rates - kept)), jacobian.twist(&(rates - accelerations)));
            assert!(lost.amax() < 1e-5 && less.amax() < 1e-5, "J{}: the tool loses {lost} {less}", joint + 1);
            // Without the time for new ones the rates of before do, for that joint alone, and until it is free.
            plan.limits.renew(false);
            assert_eq!(plan.come(rates).0, kept);
            let free = -rates;
            assert!(!plan.come(free).3);
            assert_eq!(plan.come(rates).0, rate_of(joint, kept[joint]), "what was free is not made up for");
        }
    }

    /// The change that makes it fail: what makes up for one joint leads another beyond its limit, or what stood in for
    /// one joint stands in for another.
    #[test]
    fn what_makes_up_for_one_joint_leads_no_other_beyond_its_limit() {
        let mut plan = Plan::at(near(2, true, 0.03), &Vector7::zeros());
        let rates = rate_of(2, 0.4);
        let free = plan.come(rates).0;
        let other = (0..JOINTS).filter(|joint| *joint != 2).max_by(|a, b| free[*a].abs().total_cmp(&free[*b].abs()));
        let other = other.expect("six others");
        let upper = free[other] > 0.0;
        // J3 leaves its limit, and the other one, in the way of which it was, stands at its own.
        plan.q[other] = if upper { wam7::SOFT_MAX[other] } else { wam7::SOFT_MIN[other] };
        plan.look(&Vector7::zeros());
        let (kept, ..) = plan.come(rates);
        assert!(kept[other].abs() < 1e-9, "J{}: {kept}", other + 1);
        plan.limits.renew(false);
        plan.q[2] = 0.0;
        plan.look(&Vector7::zeros());
        let rates = rate_of(other, if upper { 0.3 } else { -0.3 });
        assert_eq!(plan.come(rates).0, Vector7::zeros(), "the rates instead of J3 are not those instead of another");
    }
}
