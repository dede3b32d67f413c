//! `Rollout`: the running state of one primitive, advanced once per control period on one phase.
//!
//! Outputs are physical: `(x, v/tau, rhs/tau^2)`. A change of speed keeps the scaled state `v` and the phase, so the
//! path x(s) does not depend on the course of tau(t); the plan's velocity changes instead. With `rate = 1/tau(t)` the
//! outputs are `xd = v rate` and `xdd = rhs rate^2 + v d(rate)/dt`, which is `(vd - xd taud)/tau` written without a
//! division and valid at rate 0 (time stopped). Speed changes are slewed, because a jump of the rate is a jump of the
//! desired velocity.

use crate::orientation_rows::OrientationRows;
use crate::point_rows::{PointRows, Tick};
use crate::time_scale::TimeScale;
use crate::vector::all_finite;
use crate::{
    Configuration, Coupling, Phase, PoseReference, Primitive, Quaternion, Reference, RolloutError, Scalar, Velocity,
    bounds,
};

/// One pose in motion.
#[derive(Clone, Copy, Debug, PartialEq)]
struct PoseRows<T> {
    position: PointRows<T, 3>,
    orientation: OrientationRows<T>,
}

/// Where a run begins.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct StartState<T, const D: usize, const P: usize> {
    /// Poses and point rows.
    pub configuration: Configuration<T, D, P>,
    /// Physical velocity.
    pub velocity: Velocity<T, D, P>,
}

impl<T: Scalar, const D: usize, const P: usize> StartState<T, D, P> {
    /// At rest in this configuration.
    #[must_use]
    pub fn at_rest(configuration: Configuration<T, D, P>) -> Self {
        Self { configuration, velocity: Velocity::ZERO }
    }

    /// As the demonstration started, with its initial velocity: replays a recording that was cut out of a motion.
    #[must_use]
    pub fn demonstrated<const N: usize>(primitive: &Primitive<T, D, P, N>) -> Self {
        Self { configuration: *primitive.start(), velocity: *primitive.start_velocity() }
    }
}

/// State of one run of a [`Primitive`].
#[derive(Clone, Debug, PartialEq)]
pub struct Rollout<T, const D: usize, const P: usize, const N: usize> {
    /// Of the primitive that it runs.
    fingerprint: u32,
    phase: Phase<T>,
    time: T,
    time_lost: T,
    time_scale: TimeScale<T>,
    poses: [PoseRows<T>; P],
    points: PointRows<T, D>,
    goal_filter: Option<T>,
    goal_fraction: (T, T),
}

impl<T: Scalar, const D: usize, const P: usize, const N: usize> Rollout<T, D, P, N> {
    /// Largest change of speed per second unless told otherwise: from full speed to rest in half a second.
    pub const DEFAULT_SLEW: f64 = 2.0;

    /// Starts a run: `x0 <- start`, goal as stored, `s <- 1`, at the taught speed.
    ///
    /// The start orientation takes the sign of the demonstration's start. Without a demonstration the goal takes the
    /// sign that is nearest to the start, with [`OrientationError::RotationVector`](crate::OrientationError) that
    /// nearest to the start of the primitive.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`], [`RolloutError::NotUnit`],
    /// [`RolloutError::TurnsTooFar`].
    pub fn start(primitive: &Primitive<T, D, P, N>, start: &StartState<T, D, P>) -> Result<Self, RolloutError> {
        let StartState { configuration, velocity } = start;
        if !(configuration.is_finite() && velocity.is_finite()) {
            return Err(RolloutError::NotFinite);
        }
        if configuration.out_of_bounds().or(velocity.out_of_bounds()).is_some() {
            return Err(RolloutError::TooLarge);
        }
        let from = configuration.normalised().ok_or(RolloutError::NotUnit)?;
        let (to, tau) = (primitive.goal(), primitive.duration());
        let at_rest = PointRows::new([T::ZERO; 3], [T::ZERO; 3], tau, [T::ZERO; 3]);
        let no_map = OrientationRows::AT_REST;
        let mut poses = [PoseRows { position: at_rest, orientation: no_map }; P];
        for (n, rows) in poses.iter_mut().enumerate() {
            let taught = primitive.taught(n).ok_or(RolloutError::NoSuchPose)?;
            let (pose, twist) = (&from.poses[n], &velocity.poses[n]);
            rows.position = PointRows::new(pose.position, twist.linear, tau, to.poses[n].position);
            rows.orientation = OrientationRows::start(&taught, &pose.orientation, &twist.angular)?;
        }
        Ok(Self {
            fingerprint: primitive.fingerprint(),
            phase: Phase::START,
            time: T::ZERO,
            time_lost: T::ZERO,
            time_scale: TimeScale {
                speed: T::ONE,
                target: T::ONE,
                stopped: false,
                slew: Some(T::from_f64(Self::DEFAULT_SLEW)),
            },
            poses,
            points: PointRows::new(from.points, velocity.points, tau, to.points),
            goal_filter: None,
            goal_fraction: (T::ZERO, T::ZERO),
        })
    }

    /// Returns the plan at this tick, then advances it by `dt` (s).
    ///
    /// Value, velocity and acceleration belong to the same instant, the one BEFORE the step: the first call returns
    /// the start state. `coupling` is that of the same instant. A `dt` that is not positive advances nothing. A
    /// coupling beyond what any movement needs is cut to that, and one that is not a number counts as 0.
    ///
    /// # Errors
    /// [`RolloutError::PeriodTooLong`] for a `dt` above [`Primitive::control_period`], at which the integration could
    /// be unstable, [`RolloutError::OtherPrimitive`]; nothing has changed then.
    #[inline]
    pub fn step(
        &mut self,
        primitive: &Primitive<T, D, P, N>,
        dt: T,
        coupling: &Coupling<T, D, P>,
    ) -> Result<Reference<T, D, P>, RolloutError> {
        self.check(primitive)?;
        if dt > primitive.control_period() {
            return Err(RolloutError::PeriodTooLong);
        }
        let dt = if dt > T::ZERO { dt } else { T::ZERO };
        let (pose_forces, point_forces) = primitive.forces(self.phase.s());
        let change = self.time_scale.change(dt);
        let rate = self.time_scale.speed * primitive.rate();
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

        let limited;
        let coupling = if coupling.is_within(primitive.least_coupling_limit()) {
            coupling
        } else {
            limited = coupling.limited(primitive.coupling_limits());
            &limited
        };
        let (pose_systems, point_systems) = (primitive.pose_systems(), primitive.point_systems());
        let poses = core::array::from_fn(|n| {
            let (rows, [position, orientation], zeta) = (&mut self.poses[n], &pose_systems[n], &coupling.poses[n]);
            let [x, y, z, a, b, c] = pose_forces[n];
            PoseReference {
                position: rows.position.step(|_| position, &tick, &[x, y, z], &zeta.position),
                orientation: rows.orientation.step(orientation, &tick, &[a, b, c], &zeta.orientation),
            }
        });
        let points = self.points.step(|i| &point_systems[i], &tick, &point_forces, &coupling.points);

        self.phase.step(primitive.canonical(), h);
        self.time_scale.speed = self.time_scale.speed + change;
        let step = dt - self.time_lost;
        let sum = self.time + step;
        self.time_lost = (sum - self.time) - step;
        self.time = sum;

        Ok(Reference { phase: tick.s, progress, time, rate, poses, points })
    }

    /// Checks that this is a run of `primitive`: weights, gains and start of one movement with the state of another
    /// would be a plan that nobody has taught.
    ///
    /// # Errors
    /// [`RolloutError::OtherPrimitive`].
    #[inline]
    pub fn check(&self, primitive: &Primitive<T, D, P, N>) -> Result<(), RolloutError> {
        if self.fingerprint == primitive.fingerprint() { Ok(()) } else { Err(RolloutError::OtherPrimitive) }
    }

    /// `1 - exp(-a_g h)`: exact step of the goal filter, computed anew only when `h` changes.
    #[inline]
    fn goal_fraction(&mut self, h: T) -> T {
        let Some(a_g) = self.goal_filter else {
            return T::ZERO;
        };
        if h != self.goal_fraction.0 {
            self.goal_fraction = (h, part_of_the_way(a_g * h));
        }
        self.goal_fraction.1
    }

    /// New goal of the position of a pose, m. The start is never reset, so the acceleration jumps by
    /// `K dg (1-s)/tau^2`; use [`Rollout::set_goal_filter`] if that is too much.
    ///
    /// # Errors
    /// [`RolloutError::NoSuchPose`], [`RolloutError::NotFinite`], [`RolloutError::TooLarge`].
    pub fn set_goal_position(&mut self, pose: usize, goal: [T; 3]) -> Result<(), RolloutError> {
        let rows = self.poses.get_mut(pose).ok_or(RolloutError::NoSuchPose)?;
        rows.position.command(goal, self.goal_filter.is_some())
    }

    /// New goal of the orientation of a pose, either sign: it is aligned with the demonstrated goal, or without a
    /// demonstration with the present orientation. Rotation vectors always take the one nearest to the primitive's
    /// goal: 100 degrees to the other side of the start than a goal of 170 are reached by a turn of 260.
    ///
    /// # Errors
    /// [`RolloutError::NoSuchPose`], [`RolloutError::NotFinite`], [`RolloutError::NotUnit`],
    /// [`RolloutError::TurnsTooFar`], [`RolloutError::OtherPrimitive`].
    pub fn set_goal_orientation(
        &mut self,
        primitive: &Primitive<T, D, P, N>,
        pose: usize,
        goal: Quaternion<T>,
    ) -> Result<(), RolloutError> {
        self.check(primitive)?;
        if !all_finite(&goal.to_array()) {
            return Err(RolloutError::NotFinite);
        }
        let goal = goal.checked_unit(T::from_f64(1e-3)).ok_or(RolloutError::NotUnit)?;
        let rows = self.poses.get_mut(pose).ok_or(RolloutError::NoSuchPose)?;
        let taught = primitive.taught(pose).ok_or(RolloutError::NoSuchPose)?;
        rows.orientation.command(&taught, &goal, self.goal_filter.is_some())
    }

    /// New goal of the point rows.
    ///
    /// # Errors
    /// [`RolloutError::NotFinite`], [`RolloutError::TooLarge`].
    pub fn set_goal_points(&mut self, goal: [T; D]) -> Result<(), RolloutError> {
        self.points.command(goal, self.goal_filter.is_some())
    }

    /// Makes the place where the plan is now its goal, in all rows: where a coupling has bent it, it stays when the
    /// coupling ends. The phase runs on, so what is left of the forcing term (`s` of it) still fades out about the new
    /// goal.
    pub fn settle(&mut self) {
        for rows in &mut self.poses {
            rows.position.settle();
            rows.orientation.settle();
        }
        self.points.settle();
    }

    /// Goal filter `tau gd = a_g (g_commanded - g)` for the goals set from now on; 12.5 is a usual `a_g`. In f32 a
    /// filter with `a_g dt/tau` below 1e-5 stops on its way, where its steps are less than the last digit of the goal.
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
            for rows in &mut self.poses {
                rows.position.goal = rows.position.commanded;
                rows.orientation.arrive();
            }
            self.points.goal = self.points.commanded;
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
    pub fn set_duration(&mut self, primitive: &Primitive<T, D, P, N>, duration: T) -> Result<(), RolloutError> {
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
    pub fn set_speed(&mut self, primitive: &Primitive<T, D, P, N>, speed: T) -> Result<(), RolloutError> {
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
        self.time_scale.update(self.time_scale.target, self.time_scale.stopped, slew);
        Ok(())
    }

    /// Brings time to a stop at the slew rate; [`Rollout::resume`] continues the same path.
    pub fn pause(&mut self) {
        self.time_scale.update(self.time_scale.target, true, self.time_scale.slew);
    }

    /// Stops time at once: the desired velocity jumps to 0. For use when the plan must not move another tick.
    pub fn freeze(&mut self) {
        self.time_scale.stopped = true;
        self.time_scale.speed = T::ZERO;
    }

    /// Lets time run again, slewed up to the speed last asked for.
    pub fn resume(&mut self) {
        self.time_scale.update(self.time_scale.target, false, self.time_scale.slew);
    }

    fn set_target(&mut self, speed: T) {
        self.time_scale.update(speed, self.time_scale.stopped, self.time_scale.slew);
    }

    /// Present speed relative to the taught one.
    #[inline]
    pub fn speed(&self) -> T {
        self.time_scale.speed
    }

    /// Velocities of the positions of the poses in the scaled system, m: times the rate of the next step they are what
    /// it returns, m/s.
    #[inline]
    pub fn scaled_velocities(&self) -> [[T; 3]; P] {
        self.poses.each_ref().map(|pose| pose.position.state.map(|axis| axis.v()))
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

    /// True once the movement has run its duration. The plan may go on settling into its goal.
    #[inline]
    pub fn is_finished(&self) -> bool {
        self.phase.progress() >= T::ONE
    }
}

/// `1 - exp(-x)`. Of a small exponent by the series: the difference cancels, and in f32 the filter of a slow movement
/// would be percents too fast or too slow. The first omitted term is 2e-12 of the sum.
///
/// Not inlined: it is asked where a run with a goal filter changes its speed.
#[inline(never)]
fn part_of_the_way<T: Scalar>(x: T) -> T {
    let f = T::from_f64;
    if x < f(1.0 / 256.0) {
        x * (T::ONE - x * (f(1.0 / 2.0) - x * (f(1.0 / 6.0) - x * f(1.0 / 24.0))))
    } else {
        T::ONE - T::exp(-x)
    }
}
