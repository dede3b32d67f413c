//! `Rollout`: the running state of the four hand rows, Eqs (1), (3), (8) and (9), advanced once per control period.
//!
//! The rows are those of `dmp` ([`dmp::PointState`], [`dmp::TransformationSystem`]) in fixed point. The phase comes
//! from the progress, `s = exp(-alpha u)` with `u <- u + dt/tau(t)`: the exact solution of Eq (3) for any course of
//! tau, without the drift of a phase that is multiplied thousands of times.

use dmp::{PointInput, PointState, Scalar};

use crate::forcing;
use crate::number::{Number, ONE, ZERO, at_most, constant, constants, magnitude, share, whole, within};
use crate::primitive::FingerPrimitive;
use crate::{DIGITS, FINGERS};

/// The control period (s).
const PERIOD: Number = constant(control::PERIOD);

/// Largest change of speed per control period: from full speed to rest in half a second.
const SLEW: Number = constant(2.0 * control::PERIOD);

/// Deviation of the duration up to which an expectation is believed in full, and from which on not at all.
const TRUST: [Number; 2] = constants([0.1, 0.5]);

/// The plan at one tick, spread first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Plan {
    /// Angles (rad).
    pub q: [Number; DIGITS],
    /// Velocities (rad/s).
    pub dq: [Number; DIGITS],
    /// Phase s.
    pub phase: Number,
    /// Progress u.
    pub progress: Number,
}

/// State of one run.
#[derive(Clone, Copy, Debug)]
pub struct Rollout {
    rows: [PointState<Number>; DIGITS],
    start: [Number; DIGITS],
    goal: [Number; DIGITS],
    progress: Number,
    speed: Number,
    target: Number,
    /// Trust at the speed at which it was last computed.
    trust: (Number, Number),
}

impl Rollout {
    /// A run from `start` (rad), at rest, at `speed` relative to the taught one; the goal is the stored one.
    pub fn start(primitive: &FingerPrimitive, start: &[Number; DIGITS], speed: Number) -> Rollout {
        Rollout {
            rows: start.map(|x| PointState::new(x, ZERO)),
            start: *start,
            goal: primitive.goal,
            progress: ZERO,
            speed,
            target: speed,
            trust: (speed, trust(primitive.recorded_speed * speed)),
        }
    }

    /// As the demonstration started, with its initial velocity, at the taught speed.
    pub fn demonstrated(primitive: &FingerPrimitive) -> Rollout {
        let mut rollout = Rollout::start(primitive, &primitive.start, ONE);
        for (digit, row) in rollout.rows.iter_mut().enumerate() {
            *row = PointState::new(primitive.start[digit], primitive.start_velocity[digit] * primitive.duration);
        }
        rollout
    }

    /// New speed relative to the taught one, approached at the slew rate; false if it would be too fast for 300 Hz.
    pub fn set_speed(&mut self, primitive: &FingerPrimitive, speed: Number) -> bool {
        let stable = speed * primitive.shortest < primitive.duration;
        if stable {
            self.target = speed;
        }
        stable
    }

    /// Progress u: 0 at the start, 1 at the end, growing beyond.
    pub fn progress(&self) -> Number {
        self.progress
    }

    /// Torques that the gauges should feel now (N m); `None` if none were recorded.
    pub fn expected(&self, primitive: &FingerPrimitive) -> Option<[Number; FINGERS]> {
        primitive.has_expectation().then(|| primitive.expected.at(self.progress))
    }

    /// True if the feedback is derated because this run is faster or slower than the recorded one.
    pub fn is_derated(&self) -> bool {
        self.trust.1 < ONE
    }

    /// Eq (8) for the fingers: `zeta = K1 K2 (F - F_des)`, clamped; `fade` (0 to 1) takes it away where the gauges are
    /// old.
    pub fn feedback(
        &mut self,
        primitive: &FingerPrimitive,
        gauges: &[Number; FINGERS],
        fade: Number,
    ) -> [Number; FINGERS] {
        let Some(expected) = self.expected(primitive).filter(|_| !primitive.sensitivity.is_empty()) else {
            return [ZERO; FINGERS];
        };
        if self.trust.0 != self.speed {
            self.trust = (self.speed, trust(primitive.recorded_speed * self.speed));
        }
        let (k1, k2) = (primitive.sensitivity.at(self.progress), primitive.weight.at(self.progress));
        let share = self.trust.1 * fade;
        core::array::from_fn(|finger| {
            let error = (gauges[finger] - expected[finger]) * share;
            within(k1[finger] * (k2[finger] * error), primitive.zeta_limit)
        })
    }

    /// The plan at this tick; then a control period passes. `zeta`: feedback of the fingers of the same instant.
    pub fn step(&mut self, primitive: &FingerPrimitive, zeta: &[Number; FINGERS]) -> Plan {
        let phase = primitive.basis.phase(self.progress);
        let force = forcing::evaluate(&primitive.basis, &primitive.weights, self.progress);
        let rate = self.speed * primitive.rate;
        let h = PERIOD * rate;
        let [z1, z2, z3] = *zeta;
        let zeta = [ZERO, z1, z2, z3];
        let mut plan = Plan { q: [ZERO; DIGITS], dq: [ZERO; DIGITS], phase, progress: self.progress };
        for digit in 0..DIGITS {
            let row = &mut self.rows[digit];
            plan.q[digit] = row.x();
            plan.dq[digit] = row.v() * rate;
            if let Some(system) = &primitive.system {
                let input = PointInput {
                    start: self.start[digit],
                    goal: self.goal[digit],
                    s: phase,
                    f: force[digit],
                    zeta: zeta[digit],
                };
                row.step(system.right_hand_side(row, &input), h);
            }
        }
        // Far beyond the end nothing changes any more; the counter stays where its products are exact.
        self.progress = at_most(self.progress + h, whole(1000));
        self.speed = self.speed + within(self.target - self.speed, SLEW);
        plan
    }
}

/// How far an expectation can be believed at another speed than it was recorded at, 1 to 0; see
/// `dmp::ExpectedSensors::trust`.
fn trust(relative_speed: Number) -> Number {
    let [full, none] = TRUST;
    let deviation = magnitude(ONE - relative_speed);
    if deviation <= full * relative_speed {
        ONE
    } else if deviation < none * relative_speed {
        (none - Scalar::abs(share(deviation, relative_speed))) * constant(1.0 / (0.5 - 0.1))
    } else {
        ZERO
    }
}
