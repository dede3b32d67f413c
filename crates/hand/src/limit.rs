//! `HandLimiter`: the only maker of [`LimitedTorques`], and with it the only way to the hand's motors.

use control::act::hand::TORQUE_LIMIT;
use control::model::hand::EFFICIENCY;
use puck::hand::{INNER_LINK_RATIO, SPREAD_RATIO};
use puck::units::PACKED_TORQUE_LIMIT;
use puck::{CanFrame, Group, PropertyId, PuckTorque, packed_torques};

use crate::DIGITS;
use crate::estimate::spread_last;
use crate::number::{FRACTION_BITS, Number, ZERO, constant, constants, whole, within};

const LIMITS: [Number; DIGITS] = constants(TORQUE_LIMIT);

/// Full scale in 15 control periods (50 ms).
const STEPS: [Number; DIGITS] = {
    let mut steps = [ZERO; DIGITS];
    let mut digit = 0;
    while digit < DIGITS {
        steps[digit] = constant(TORQUE_LIMIT[digit] / 15.0);
        digit += 1;
    }
    steps
};

/// Motor torque per torque at the link: through gears and worm.
const MOTOR_SHARE: [Number; DIGITS] = constants([
    1.0 / (SPREAD_RATIO * EFFICIENCY[0]),
    1.0 / (INNER_LINK_RATIO * EFFICIENCY[1]),
    1.0 / (INNER_LINK_RATIO * EFFICIENCY[2]),
    1.0 / (INNER_LINK_RATIO * EFFICIENCY[3]),
]);

/// Torques of spread, F1, F2, F3 within every limit. No public constructor: the limiter makes them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitedTorques([Number; DIGITS]);

impl LimitedTorques {
    /// The torques (N m), spread first.
    pub fn torques(&self) -> &[Number; DIGITS] {
        &self.0
    }

    /// The packed frame for the four pucks, rounded toward minus infinity; `scales` in units per N m at the link,
    /// spread first.
    pub fn frame(&self, scales: &Scales) -> CanFrame {
        let mut units = [PuckTorque::ZERO; DIGITS];
        let wanted: [Number; DIGITS] = core::array::from_fn(|digit| self.0[digit] * scales.0[digit]);
        for (units, wanted) in units.iter_mut().zip(spread_last(wanted)) {
            let whole_units = wanted.to_bits() >> FRACTION_BITS;
            let limit = i64::from(PACKED_TORQUE_LIMIT);
            let kept = i16::try_from(whole_units.clamp(-limit, limit)).unwrap_or(0);
            *units = PuckTorque::new(kept).unwrap_or(PuckTorque::ZERO);
        }
        packed_torques(Group::HAND, PropertyId::TORQUE, units)
    }
}

/// Puck units per N m at spread and inner links, spread first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Scales([Number; DIGITS]);

impl Scales {
    /// From IPNM of F1, F2, F3, spread.
    pub fn new(units_per_newton_metre: [i32; DIGITS]) -> Scales {
        let [f1, f2, f3, spread] = units_per_newton_metre;
        let units = [spread, f1, f2, f3];
        Scales(core::array::from_fn(|digit| whole(units[digit]) * MOTOR_SHARE[digit]))
    }
}

/// Cuts torques to what the drives of the hand bear.
#[derive(Clone, Debug)]
pub struct HandLimiter {
    last: [Number; DIGITS],
    /// The torques before the last, in case those do not leave.
    before: [Number; DIGITS],
}

impl HandLimiter {
    /// A limiter at zero torque.
    pub const fn new() -> Self {
        HandLimiter { last: [ZERO; DIGITS], before: [ZERO; DIGITS] }
    }

    /// Back to zero torque at once: nothing is being sent.
    pub fn reset(&mut self) {
        *self = HandLimiter::new();
    }

    /// The torques of the last cycle did not leave: the next step counts from those before.
    pub fn not_sent(&mut self) {
        self.last = self.before;
    }

    /// Cuts the wanted torques (N m) of one cycle to magnitude and rate; also whether a finger was cut to its
    /// magnitude.
    pub fn limit(&mut self, wanted: &[Number; DIGITS]) -> (LimitedTorques, bool) {
        let mut saturated = false;
        self.before = self.last;
        for (digit, last) in self.last.iter_mut().enumerate() {
            let kept = within(wanted[digit], LIMITS[digit]);
            saturated |= digit > 0 && kept != wanted[digit];
            *last = within(*last + within(kept - *last, STEPS[digit]), LIMITS[digit]);
        }
        (LimitedTorques(self.last), saturated)
    }
}

impl Default for HandLimiter {
    fn default() -> Self {
        HandLimiter::new()
    }
}
