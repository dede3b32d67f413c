//! `Rollout`: the running state of one primitive, advanced once per control period on one phase.
//!
//! Outputs are physical: `(x, v/tau, rhs/tau^2)`. A change of speed keeps the scaled state `v` and the phase, so the
//! path x(s) does not depend on the course of tau(t); the plan's velocity changes instead. With
//! `rate = 1/tau(t)` the outputs are `xd = v rate` and `xdd = rhs rate^2 + v d(rate)/dt`, which is
//! `(vd - xd taud)/tau` written without a division and valid at rate 0 (time stopped). Speed changes are slewed, because
//! a jump of the rate is a jump of the desired velocity.

use core::fmt;

use crate::orientation_rows::Turn;
use crate::point_rows::{Group, Tick};
use crate::time_scale::Pace;
use crate::vector::all_finite;
use crate::{
    CONTROL_PERIOD, Coupling, HAND_ROWS, POSITION_ROWS, POSTURE_ROWS, Phase, Primitive, Quaternion, Reference, SENSORS,
    Scalar, SensorMap, StartState, bounds,
};

/// Why a start or a change in flight is refused; the run goes on unchanged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum RolloutError {
    /// A value is NaN or infinite.
    NotFinite,
    /// A value is larger than any movement needs, see [`bounds`].
    TooLarge,
    /// A quaternion is not of unit norm.
    NotUnit,
    /// The duration is shorter than [`Primitive::minimum_duration`], or the speed too high.
    TooFast,
    /// A speed, rate or duration is negative, or a duration is 0.
    Negative,
    /// The run was started with another primitive.
    OtherPrimitive,
    /// The start or the new goal is more than 175 degrees away, where the error of Eq. (4) fails.
    TurnsTooFar,
}

impl fmt::Display for RolloutError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::NotFinite => "a value is not a number",
            Self::TooLarge => "a value is larger than any movement needs",
            Self::NotUnit => "a quaternion is not of unit norm",
            Self::TooFast => "too fast: the integration would be unstable at 300 Hz",
            Self::Negative => "a speed, rate or duration is negative",
            Self::OtherPrimitive => "the run was started with another primitive",
            Self::TurnsTooFar => "the goal is more than 175 degrees away; the rotation-vector error is needed",
        })
    }
}

impl core::error::Error for RolloutError {}

/// State of one run of a [`Primitive`].
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout<T, const N: usize> {
    /// Of the primitive that it runs.
    fingerprint: u32,
    phase: Phase<T>,
    time: T,
    time_lost: T,
    pace: Pace<T>,
    position: Group<T, POSITION_ROWS>,
    posture: Group<T, POSTURE_ROWS>,
    hand: Group<T, HAND_ROWS>,
    orientation: Turn<T>,
    goal_filter: Option<T>,
    goal_fraction: (T, T),
}

impl<T: Scalar, const N: usize> Rollout<T, N> {
    /// Largest change of speed per second unless told otherwise: from full speed to rest in half a second.
    pub const DEFAULT_SLEW: f64 = 2.0;

    /// Starts a run: `x0 <- start`, goal as stored, `s <- 1`, at the taught speed.
    ///
    /// The start orientation takes the sign of the demonstration's start. Without a demonstration the goal takes the
    /// sign that is nearest to the start.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`], [`RolloutError::NotUnit`],
    /// [`RolloutError::TurnsTooFar`].
    pub fn start(primitive: &Primitive<T, N>, start: &StartState<T>) -> Result<Self, RolloutError> {
        let StartState { configuration, velocity } = start;
        if !(configuration.is_finite() && velocity.is_finite()) {
            return Err(RolloutError::NotFinite);
        }
        if configuration.out_of_bounds().or(velocity.out_of_bounds()).is_some() {
            return Err(RolloutError::TooLarge);
        }
        let from = configuration.normalised().ok_or(RolloutError::NotUnit)?;
        let to = primitive.goal();
        let tau = primitive.duration();
        Ok(Self {
            fingerprint: primitive.fingerprint(),
            phase: Phase::START,
            time: T::ZERO,
            time_lost: T::ZERO,
            pace: Pace { speed: T::ONE, target: T::ONE, stopped: false, slew: Some(T::from_f64(Self::DEFAULT_SLEW)) },
            position: Group::new(from.position, velocity.position, tau, to.position),
            posture: Group::new(from.posture, velocity.posture, tau, to.posture),
            hand: Group::new(from.hand, velocity.hand, tau, to.hand),
            orientation: Turn::start(primitive, &from.orientation, &velocity.orientation)?,
            goal_filter: None,
            goal_fraction: (T::ZERO, T::ZERO),
        })
    }

    /// Returns the plan at this tick, then advances it by `dt` (s).
    ///
    /// Value, velocity and acceleration belong to the same instant, the one BEFORE the step: the first call returns
    /// the start state. `coupling` is the feedback of the same instant. A `dt` above [`CONTROL_PERIOD`] is cut to it
    /// (a late tick slows the plan down instead of making it unstable); one that is not positive advances nothing. A
    /// coupling beyond what any movement needs is cut to that, and one that is not a number counts as 0.
    ///
    /// # Errors
    /// [`RolloutError::OtherPrimitive`]; nothing has changed then.
    #[inline]
    pub fn step(
        &mut self,
        primitive: &Primitive<T, N>,
        dt: T,
        coupling: &Coupling<T>,
    ) -> Result<Reference<T>, RolloutError> {
        self.check(primitive)?;
        let longest = T::from_f64(CONTROL_PERIOD);
        let dt = if !(dt > T::ZERO) {
            T::ZERO
        } else if dt > longest {
            longest
        } else {
            dt
        };
        let f = primitive.forcing().evaluate(self.phase.s());
        let change = self.pace.change(dt);
        let rate = self.pace.speed * primitive.rate();
        let h = dt * rate;
        let tick = Tick {
            s: self.phase.s(),
            h,
            rate,
            rate_squared: rate * rate,
            rate_slope: if change == T::ZERO || dt == T::ZERO { T::ZERO } else { change * primitive.rate() / dt },
            goal_fraction: self.goal_fraction(h),
        };
        let progress = self.phase.progress();
        let time = self.time;

        let [f0, f1, f2, r0, r1, r2, p0, p1, p2, p3, p4, p5, p6, h0, h1, h2, h3] = f;
        let limited;
        let coupling = if coupling.is_within(primitive.coupling_limits()) {
            coupling
        } else {
            limited = coupling.limited(primitive.coupling_limits());
            &limited
        };
        let position = self.position.step(primitive.position(), &tick, &[f0, f1, f2], &coupling.position);
        let orientation = self.orientation.step(primitive.orientation(), &tick, &[r0, r1, r2], &coupling.orientation);
        let posture =
            self.posture.step(primitive.posture(), &tick, &[p0, p1, p2, p3, p4, p5, p6], &[T::ZERO; POSTURE_ROWS]);
        let hand = self.hand.step(primitive.hand(), &tick, &[h0, h1, h2, h3], &coupling.hand);

        self.phase.step(primitive.canonical(), h);
        self.pace.speed = self.pace.speed + change;
        let step = dt - self.time_lost;
        let sum = self.time + step;
        self.time_lost = (sum - self.time) - step;
        self.time = sum;

        Ok(Reference { phase: tick.s, progress, time, rate, position, orientation, posture, hand })
    }

    /// Weights, gains and start of one movement with the state of another would be a plan that nobody has taught.
    #[inline]
    fn check(&self, primitive: &Primitive<T, N>) -> Result<(), RolloutError> {
        if self.fingerprint == primitive.fingerprint() { Ok(()) } else { Err(RolloutError::OtherPrimitive) }
    }

    /// `1 - exp(-a_g h)`: exact step of the goal filter, computed anew only when `h` changes.
    #[inline]
    fn goal_fraction(&mut self, h: T) -> T {
        let Some(a_g) = self.goal_filter else {
            return T::ZERO;
        };
        if h != self.goal_fraction.0 {
            self.goal_fraction = (h, T::ONE - T::exp(-a_g * h));
        }
        self.goal_fraction.1
    }

    /// `zeta` of Eq. (8) for this tick from the measured sensor values (environment on the robot, in the frames of
    /// [`SensorMap`]); open loop if the primitive has no gains or no expectation.
    ///
    /// Loses effect when the speed differs from the one of the recording, see
    /// [`ExpectedWrench::trust`](crate::ExpectedWrench::trust).
    ///
    /// # Errors
    /// [`RolloutError::OtherPrimitive`].
    pub fn coupling(
        &self,
        primitive: &Primitive<T, N>,
        measured: &[T; SENSORS],
        map: &SensorMap<T>,
    ) -> Result<Coupling<T>, RolloutError> {
        self.check(primitive)?;
        let (Some(feedback), Some(expected)) = (primitive.feedback(), primitive.expected()) else {
            return Ok(Coupling::NONE);
        };
        let u = self.phase.progress();
        let felt = expected.at(u);
        let relative_speed = expected.recorded_duration() * primitive.rate() * self.pace.speed;
        let trust = expected.trust(relative_speed);
        let error = core::array::from_fn(|i| (measured[i] - felt[i]) * trust);
        Ok(feedback.coupling(u, &error, map, &primitive.stiffness()))
    }

    /// New goal position, m. The start is never reset, so the acceleration jumps by `K dg (1-s)/tau^2`; use
    /// [`Rollout::set_goal_filter`] if that is too much.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`].
    pub fn set_goal_position(&mut self, goal: [T; POSITION_ROWS]) -> Result<(), RolloutError> {
        self.position.command(goal, self.goal_filter.is_some())
    }

    /// New goal orientation, either sign: it is aligned with the demonstrated goal, or without a demonstration with
    /// the present orientation.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::NotUnit`], [`RolloutError::TurnsTooFar`],
    /// [`RolloutError::OtherPrimitive`].
    pub fn set_goal_orientation(
        &mut self,
        primitive: &Primitive<T, N>,
        goal: Quaternion<T>,
    ) -> Result<(), RolloutError> {
        self.check(primitive)?;
        if !all_finite(&goal.to_array()) {
            return Err(RolloutError::NotFinite);
        }
        let goal = goal.checked_unit(T::from_f64(1e-3)).ok_or(RolloutError::NotUnit)?;
        self.orientation.command(primitive, &goal, self.goal_filter.is_some())
    }

    /// New goal of the posture, rad.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`].
    pub fn set_goal_posture(&mut self, goal: [T; POSTURE_ROWS]) -> Result<(), RolloutError> {
        self.posture.command(goal, self.goal_filter.is_some())
    }

    /// New goal of the hand, rad.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`].
    pub fn set_goal_hand(&mut self, goal: [T; HAND_ROWS]) -> Result<(), RolloutError> {
        self.hand.command(goal, self.goal_filter.is_some())
    }

    /// Makes the place where the plan is now its goal, in all rows: what the feedback has bent stays as it is when the feedback ends. The
    /// phase runs on, so what is left of the forcing term (`s` of it) still fades out about the new goal.
    pub fn settle(&mut self) {
        self.position.settle();
        self.posture.settle();
        self.hand.settle();
        self.orientation.settle();
    }

    /// Goal filter `tau gd = a_g (g_commanded - g)` for the goals set from now on; 12.5 is a usual `a_g`.
    ///
    /// `None` (the default, as in the paper) lets goals act at once, including one the filter has not reached yet.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::Negative`].
    pub fn set_goal_filter(&mut self, rate: Option<T>) -> Result<(), RolloutError> {
        if let Some(rate) = rate {
            if !rate.is_finite() {
                return Err(RolloutError::NotFinite);
            }
            if !(rate > T::ZERO) {
                return Err(RolloutError::Negative);
            }
        } else {
            self.position.goal = self.position.commanded;
            self.posture.goal = self.posture.commanded;
            self.hand.goal = self.hand.commanded;
            self.orientation.arrive();
        }
        self.goal_filter = rate;
        self.goal_fraction = (T::ZERO, T::ZERO);
        Ok(())
    }

    /// New duration tau of the whole movement, s, approached at the slew rate. The path stays the same.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::Negative`], [`RolloutError::TooFast`],
    /// [`RolloutError::OtherPrimitive`].
    pub fn set_duration(&mut self, primitive: &Primitive<T, N>, duration: T) -> Result<(), RolloutError> {
        self.check(primitive)?;
        if !duration.is_finite() {
            return Err(RolloutError::NotFinite);
        }
        if !(duration > T::ZERO) {
            return Err(RolloutError::Negative);
        }
        if !(duration > primitive.minimum_duration()) {
            return Err(RolloutError::TooFast);
        }
        self.set_target(primitive.duration() / duration);
        Ok(())
    }

    /// New speed relative to the taught one, approached at the slew rate: 1 = as taught, 0 = time stands still.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::Negative`], [`RolloutError::TooFast`],
    /// [`RolloutError::OtherPrimitive`].
    pub fn set_speed(&mut self, primitive: &Primitive<T, N>, speed: T) -> Result<(), RolloutError> {
        self.check(primitive)?;
        if !speed.is_finite() {
            return Err(RolloutError::NotFinite);
        }
        if speed < T::ZERO {
            return Err(RolloutError::Negative);
        }
        if speed * primitive.minimum_duration() >= primitive.duration() {
            return Err(RolloutError::TooFast);
        }
        self.set_target(speed);
        Ok(())
    }

    /// Largest change of speed per second; `None` lets the speed (and with it the desired velocity) jump.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::Negative`], [`RolloutError::TooFast`].
    pub fn set_speed_slew(&mut self, slew: Option<T>) -> Result<(), RolloutError> {
        if let Some(slew) = slew {
            if !slew.is_finite() {
                return Err(RolloutError::NotFinite);
            }
            if !(slew > T::ZERO) {
                return Err(RolloutError::Negative);
            }
            if !(slew <= T::from_f64(bounds::FASTEST_SLEW)) {
                return Err(RolloutError::TooFast);
            }
        }
        self.pace.update(self.pace.target, self.pace.stopped, slew);
        Ok(())
    }

    /// Brings time to a stop at the slew rate; [`Rollout::resume`] continues the same path.
    pub fn pause(&mut self) {
        self.pace.update(self.pace.target, true, self.pace.slew);
    }

    /// Stops time at once: the desired velocity jumps to 0. For use when the plan must not move another tick.
    pub fn freeze(&mut self) {
        self.pace.stopped = true;
        self.pace.speed = T::ZERO;
    }

    /// Lets time run again, slewed up to the speed last asked for.
    pub fn resume(&mut self) {
        self.pace.update(self.pace.target, false, self.pace.slew);
    }

    fn set_target(&mut self, speed: T) {
        self.pace.update(speed, self.pace.stopped, self.pace.slew);
    }

    /// Present speed relative to the taught one.
    #[inline]
    pub fn speed(&self) -> T {
        self.pace.speed
    }

    /// Phase s.
    #[inline]
    pub fn phase(&self) -> T {
        self.phase.s()
    }

    /// Progress u: 0 at the start, 1 at the end of the movement.
    #[inline]
    pub fn progress(&self) -> T {
        self.phase.progress()
    }

    /// Whether the movement has run its duration. The plan may go on settling into its goal.
    #[inline]
    pub fn is_finished(&self) -> bool {
        self.phase.progress() >= T::ONE
    }
}
