//! `Primitive`: one movement, checked once, so that the control loop needs no checks.
//!
//! `P` poses and `D` point rows on one phase, learned together and run together. Of each pose the weights come first:
//! three position rows, three orientation rows; the point rows follow.

use crate::coupling::LARGEST_ROTATION;
use crate::forcing::Weights;
use crate::gains::Systems;
use crate::orientation_rows::Taught;
use crate::vector::{clamp, clamp_norm};
use crate::{
    Basis, CanonicalSystem, Configuration, Coupling, DisplacementLimits, Gains, Group, Hemisphere, OrientationError,
    Part, PoseCoupling, PrimitiveError, Scalar, TransformationSystem, Velocity, bounds,
};

/// Rows of a pose: three of the position, three of the orientation.
pub(crate) const POSE_ROWS: usize = 6;

/// The plain tables of a primitive, as they come from an image or a file: unchecked input of [`Primitive::new`].
#[derive(Clone, Copy, Debug)]
pub struct PrimitiveTables<'a, T: Scalar, const D: usize, const P: usize> {
    /// Longest control period of a run, s. [`Rollout::step`](crate::Rollout::step) refuses a longer one.
    pub control_period: T,
    /// Duration tau of the movement, s.
    pub duration: T,
    /// Decay `alpha` of the phase, Eq. (3).
    pub alpha: T,
    /// Activation `a` of a kernel at the next centre, Eq. (2).
    pub activation: T,
    /// Number of kernels in use, 2..=N.
    pub kernel_count: usize,
    /// Weights theta, row-major `[6 P + D][kernel_count]`, in the paper's convention (the force is multiplied by K),
    /// as the number type keeps them.
    pub weights: &'a [T::Weight],
    /// Stiffness and damping.
    pub gains: Gains<T, D, P>,
    /// Orientation error of the poses.
    pub orientation_error: OrientationError,
    /// Meaning of the signs of the quaternions below.
    pub hemisphere: Hemisphere,
    /// Start of the demonstration.
    pub start: Configuration<T, D, P>,
    /// Goal.
    pub goal: Configuration<T, D, P>,
    /// Velocity at the start of the demonstration (zero if it began at rest).
    pub start_velocity: Velocity<T, D, P>,
}

/// One movement of `P` poses and `D` point rows with checked parameters; `N` = kernel capacity.
///
/// `fit::fit` learns one (feature `std`), [`Rollout`](crate::Rollout) runs it. For f32, 17 rows and N = 100 about 8 kB:
/// keep it in a static or behind a reference on a small stack, and fill it there with [`Primitive::assign`].
#[derive(Debug, PartialEq)]
pub struct Primitive<T: Scalar, const D: usize, const P: usize, const N: usize> {
    fingerprint: u32,
    control_period: T,
    duration: T,
    rate: T,
    minimum_duration: T,
    canonical: CanonicalSystem<T>,
    basis: Basis<T, N>,
    pose_weights: [Weights<T, POSE_ROWS, N>; P],
    point_weights: Weights<T, D, N>,
    systems: Systems<T, D, P>,
    orientation_error: OrientationError,
    hemisphere: Hemisphere,
    /// Largest coupling of each row: K times the largest forcing term that the movement can need.
    coupling_limits: Coupling<T, D, P>,
    /// The least of them.
    least_coupling_limit: T,
    start: Configuration<T, D, P>,
    goal: Configuration<T, D, P>,
    start_velocity: Velocity<T, D, P>,
}

/// A copy into an existing primitive ([`Clone::clone_from`]) needs no second one on the stack.
impl<T: Scalar, const D: usize, const P: usize, const N: usize> Clone for Primitive<T, D, P, N> {
    fn clone(&self) -> Self {
        let mut copy = Self::PLACEHOLDER;
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, source: &Self) {
        self.fingerprint = source.fingerprint;
        self.control_period = source.control_period;
        self.duration = source.duration;
        self.rate = source.rate;
        self.minimum_duration = source.minimum_duration;
        self.canonical = source.canonical;
        self.basis.clone_from(&source.basis);
        for (weights, source) in self.pose_weights.iter_mut().zip(&source.pose_weights) {
            weights.copy_from(source);
        }
        self.point_weights.copy_from(&source.point_weights);
        self.systems = source.systems;
        self.orientation_error = source.orientation_error;
        self.hemisphere = source.hemisphere;
        self.coupling_limits = source.coupling_limits;
        self.least_coupling_limit = source.least_coupling_limit;
        self.start = source.start;
        self.goal = source.goal;
        self.start_velocity = source.start_velocity;
    }
}

/// # Errors
/// [`PrimitiveError::ControlPeriod`].
pub(crate) fn check_control_period<T: Scalar>(period: T) -> Result<(), PrimitiveError> {
    let allowed = T::from_f64(bounds::SHORTEST_CONTROL_PERIOD)..=T::from_f64(bounds::LONGEST_DURATION);
    if allowed.contains(&period) { Ok(()) } else { Err(PrimitiveError::ControlPeriod) }
}

/// Results of the check of tables, before anything is written.
struct Checked<T: Scalar, const D: usize, const P: usize, const N: usize> {
    canonical: CanonicalSystem<T>,
    basis: Basis<T, N>,
    systems: Systems<T, D, P>,
    minimum_duration: T,
    start: Configuration<T, D, P>,
    goal: Configuration<T, D, P>,
}

impl<T: Scalar, const D: usize, const P: usize, const N: usize> Primitive<T, D, P, N> {
    /// Rows of weights.
    pub const ROWS: usize = POSE_ROWS * P + D;

    /// A place to [`assign`](Primitive::assign) to, for statics: rests at the origin for a second. No movement of use.
    pub const PLACEHOLDER: Self = Self {
        fingerprint: 0,
        control_period: T::ONE,
        duration: T::ONE,
        rate: T::ONE,
        minimum_duration: T::ZERO,
        canonical: CanonicalSystem::UNIT,
        basis: Basis::FEWEST,
        pose_weights: [const { Weights::ZERO }; P],
        point_weights: Weights::ZERO,
        systems: Systems::UNIT,
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        coupling_limits: Coupling::NONE,
        least_coupling_limit: T::ZERO,
        start: Configuration::ORIGIN,
        goal: Configuration::ORIGIN,
        start_velocity: Velocity::ZERO,
    };

    /// Checks the tables and builds the primitive.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found.
    pub fn new(tables: &PrimitiveTables<'_, T, D, P>) -> Result<Self, PrimitiveError> {
        let mut primitive = Self::PLACEHOLDER;
        primitive.assign(tables)?;
        Ok(primitive)
    }

    /// Checks the tables and, if they are good, makes this primitive theirs. Everything is written in place: on a small
    /// stack there is never a second primitive.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found; then nothing has been changed.
    pub fn assign(&mut self, tables: &PrimitiveTables<'_, T, D, P>) -> Result<(), PrimitiveError> {
        let checked = Self::check(tables)?;
        let count = tables.kernel_count;
        let (poses, points) = tables.weights.split_at_checked(POSE_ROWS * P * count).unwrap_or_default();
        for (to, weights) in self.pose_weights.iter_mut().zip(poses.chunks((POSE_ROWS * count).max(1))) {
            to.assign(count, weights);
        }
        self.point_weights.assign(count, points);
        self.basis.clone_from(&checked.basis);
        self.fingerprint = tables.fingerprint();
        self.control_period = tables.control_period;
        self.duration = tables.duration;
        self.rate = T::ONE / tables.duration;
        self.minimum_duration = checked.minimum_duration;
        self.canonical = checked.canonical;
        self.systems = checked.systems;
        let limit =
            |system: &TransformationSystem<T>| system.stiffness() * system.largest_force(tables.duration, count);
        self.coupling_limits = checked.systems.each_row(limit);
        self.least_coupling_limit = T::MAX;
        for limit in self.coupling_limits.iter() {
            if *limit < self.least_coupling_limit {
                self.least_coupling_limit = *limit;
            }
        }
        self.orientation_error = tables.orientation_error;
        self.hemisphere = tables.hemisphere;
        self.start = checked.start;
        self.goal = checked.goal;
        self.start_velocity = tables.start_velocity;
        Ok(())
    }

    fn check(tables: &PrimitiveTables<'_, T, D, P>) -> Result<Checked<T, D, P, N>, PrimitiveError> {
        let duration = tables.duration;
        if !(duration > T::ZERO && duration <= T::from_f64(bounds::LONGEST_DURATION)) {
            return Err(PrimitiveError::Duration);
        }
        check_control_period(tables.control_period)?;
        let canonical = CanonicalSystem::new(tables.alpha).ok_or(PrimitiveError::Alpha)?;
        if tables.kernel_count < 2 || tables.kernel_count > N {
            return Err(PrimitiveError::KernelCount);
        }
        let basis = Basis::new(&canonical, tables.kernel_count, tables.activation).ok_or(PrimitiveError::Activation)?;
        if tables.weights.len() != Self::ROWS * tables.kernel_count {
            return Err(PrimitiveError::WeightCount);
        }
        if !tables.weights.iter().all(|weight| T::from_weight(*weight).is_finite()) {
            return Err(PrimitiveError::Weight);
        }
        let systems = Systems::new(&tables.gains)?;
        let mut minimum_duration = T::ZERO;
        for (group, index, system) in systems.iter() {
            let shortest = tables.control_period / system.largest_step();
            if !(duration > shortest) {
                return Err(PrimitiveError::Unstable { group, index });
            }
            if shortest > minimum_duration {
                minimum_duration = shortest;
            }
        }
        if let Err(error) = tables.check_weights(&basis, &systems) {
            // Those of a movement learned in millimetres are too large too, and are not the mistake: its ends are.
            return Err(tables.check_ends().err().unwrap_or(error));
        }
        let (start, goal) = tables.check_ends()?;
        Ok(Checked { canonical, basis, systems, minimum_duration, start, goal })
    }

    /// Tells movements apart: equal for equal tables.
    #[inline]
    pub(crate) fn fingerprint(&self) -> u32 {
        self.fingerprint
    }

    /// Longest control period of a run, s.
    #[inline]
    #[must_use]
    pub fn control_period(&self) -> T {
        self.control_period
    }

    /// Duration tau as taught, s.
    #[inline]
    #[must_use]
    pub fn duration(&self) -> T {
        self.duration
    }

    /// 1/tau, 1/s.
    #[inline]
    #[must_use]
    pub fn rate(&self) -> T {
        self.rate
    }

    /// Shortest duration at which the integration is stable at the control period, s (0.057 s for the default gains at
    /// 300 Hz).
    #[inline]
    #[must_use]
    pub fn minimum_duration(&self) -> T {
        self.minimum_duration
    }

    /// The clock, Eq. (3).
    #[inline]
    #[must_use]
    pub fn canonical(&self) -> &CanonicalSystem<T> {
        &self.canonical
    }

    /// Kernels of all rows, Eq. (2).
    #[inline]
    #[must_use]
    pub fn basis(&self) -> &Basis<T, N> {
        &self.basis
    }

    /// Weight `theta_i` of a row, in the order of [`PrimitiveTables::weights`]; `None` outside.
    #[must_use]
    pub fn weight(&self, row: usize, i: usize) -> Option<T> {
        if i >= self.basis.count() {
            return None;
        }
        match self.pose_weights.get(row / POSE_ROWS) {
            Some(weights) => weights.get(row % POSE_ROWS, i),
            None => self.point_weights.get(row.checked_sub(POSE_ROWS * P)?, i),
        }
    }

    /// Forcing terms at the phase `s`, Eq. (2): of each pose position and orientation, and of the point rows.
    #[inline]
    #[must_use]
    pub fn forces(&self, s: T) -> ([[T; 6]; P], [T; D]) {
        let (mut poses, mut points) = ([[T::ZERO; POSE_ROWS]; P], [T::ZERO; D]);
        let scale = self.basis.each(s, |i, kernels| {
            for (sums, weights) in poses.iter_mut().zip(&self.pose_weights) {
                weights.add(i, kernels, sums);
            }
            self.point_weights.add(i, kernels, &mut points);
        });
        (poses.map(|sums| sums.map(|f| f * scale)), points.map(|f| f * scale))
    }

    /// Springs and dampers of position and orientation of each pose.
    #[inline]
    #[must_use]
    pub fn pose_systems(&self) -> &[[TransformationSystem<T>; 2]; P] {
        &self.systems.poses
    }

    /// Springs and dampers of the point rows.
    #[inline]
    #[must_use]
    pub fn point_systems(&self) -> &[TransformationSystem<T>; D] {
        &self.systems.points
    }

    /// Coordinates of the orientation rows.
    #[inline]
    #[must_use]
    pub fn orientation_error(&self) -> OrientationError {
        self.orientation_error
    }

    /// Largest coupling of each row.
    #[inline]
    pub(crate) fn coupling_limits(&self) -> &Coupling<T, D, P> {
        &self.coupling_limits
    }

    /// The least of the largest couplings.
    #[inline]
    pub(crate) fn least_coupling_limit(&self) -> T {
        self.least_coupling_limit
    }

    /// `zeta` cut so that it displaces the plan by no more than `limits` in steady state: `|zeta_p| <= K dx_max`,
    /// `|zeta_o| <= K_o sin(theta_max/2)` (of [`OrientationError::RotationVector`] `K_o theta_max`), each point row to
    /// its own. A value that is not a number counts as 0, and so does a limit that is negative or no number; a rotation
    /// limit above pi counts as pi. [`DisplacementLimits::check`] says so beforehand.
    #[must_use]
    pub fn limited_coupling(
        &self,
        zeta: &Coupling<T, D, P>,
        limits: &DisplacementLimits<T, D, P>,
    ) -> Coupling<T, D, P> {
        // `!(limit > 0)` is also true of a NaN, which would limit nothing; a negative limit would turn the push round.
        let bound = |limit: T| if limit > T::ZERO { limit } else { T::ZERO };
        let pose = |n: usize| {
            let (zeta, limits, [position, orientation]) = (&zeta.poses[n], &limits.poses[n], &self.systems.poses[n]);
            let rotation = bound(limits.rotation);
            let rotation =
                if rotation > T::from_f64(LARGEST_ROTATION) { T::from_f64(core::f64::consts::PI) } else { rotation };
            let largest_rotation = match self.orientation_error {
                OrientationError::Quaternion => T::sin_cos(rotation * T::from_f64(0.5)).0,
                OrientationError::RotationVector => rotation,
            };
            PoseCoupling {
                position: clamp_norm(&zeta.position, bound(limits.displacement) * position.stiffness()),
                orientation: clamp_norm(&zeta.orientation, largest_rotation * orientation.stiffness()),
            }
        };
        let point = |i: usize| clamp(zeta.points[i], bound(limits.points[i]) * self.systems.points[i].stiffness());
        Coupling { poses: core::array::from_fn(pose), points: core::array::from_fn(point) }
    }

    /// Stiffness K of the position rows of each pose.
    #[must_use]
    pub fn position_stiffness(&self) -> [T; P] {
        core::array::from_fn(|n| self.systems.poses[n][0].stiffness())
    }

    /// Start and goal orientation of a pose, and how they are meant.
    pub(crate) fn taught(&self, pose: usize) -> Option<Taught<T>> {
        Some(Taught {
            start: self.start.poses.get(pose)?.orientation,
            goal: self.goal.poses.get(pose)?.orientation,
            duration: self.duration,
            error: self.orientation_error,
            hemisphere: self.hemisphere,
        })
    }

    /// Choice of the quaternion signs.
    #[inline]
    #[must_use]
    pub fn hemisphere(&self) -> Hemisphere {
        self.hemisphere
    }

    /// Start of the demonstration.
    #[inline]
    #[must_use]
    pub fn start(&self) -> &Configuration<T, D, P> {
        &self.start
    }

    /// Velocity at the start of the demonstration.
    #[inline]
    #[must_use]
    pub fn start_velocity(&self) -> &Velocity<T, D, P> {
        &self.start_velocity
    }

    /// Goal of the demonstration.
    #[inline]
    #[must_use]
    pub fn goal(&self) -> &Configuration<T, D, P> {
        &self.goal
    }
}

impl<T: Scalar, const D: usize, const P: usize> PrimitiveTables<'_, T, D, P> {
    /// FNV-1a over the values of the movement, folded to 32 bits.
    fn fingerprint(&self) -> u32 {
        let choices = [
            self.kernel_count as u64,
            u64::from(self.orientation_error == OrientationError::RotationVector),
            u64::from(self.hemisphere == Hemisphere::Nearest),
        ];
        let numbers = [self.control_period, self.duration, self.alpha, self.activation];
        let gains = self.gains.iter().flat_map(|gain| [gain.stiffness, gain.damping]);
        let ends = [&self.start, &self.goal].into_iter().flat_map(|end| {
            let poses = end.poses.iter().flat_map(|pose| pose.position.into_iter().chain(pose.orientation.to_array()));
            poses.chain(end.points)
        });
        let values = numbers
            .into_iter()
            .chain(gains)
            .chain(ends)
            .chain(self.weights.iter().map(|weight| T::from_weight(*weight)));
        let words = choices.into_iter().chain(values.map(|value| value.bits()));
        let hash = words.fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
            // Word by word instead of byte by byte; the rotation brings the high bits of a product back to where it
            // mixes.
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29)
        });
        (hash ^ (hash >> 32)) as u32
    }

    /// Start and goal with exactly unit quaternions.
    fn check_ends(&self) -> Result<(Configuration<T, D, P>, Configuration<T, D, P>), PrimitiveError> {
        if !self.start.is_finite() {
            return Err(PrimitiveError::Start);
        }
        if !self.goal.is_finite() {
            return Err(PrimitiveError::Goal);
        }
        if !self.start_velocity.is_finite() {
            return Err(PrimitiveError::StartVelocity);
        }
        let too_large = |part: Part, place: Option<(Group, u8)>| match place {
            Some((group, index)) => Err(PrimitiveError::TooLarge { part, group, index }),
            None => Ok(()),
        };
        too_large(Part::Start, self.start.out_of_bounds())?;
        too_large(Part::Goal, self.goal.out_of_bounds())?;
        too_large(Part::StartVelocity, self.start_velocity.out_of_bounds())?;
        let start = self.start.normalised().ok_or(PrimitiveError::StartNotUnit)?;
        let goal = self.goal.normalised().ok_or(PrimitiveError::GoalNotUnit)?;
        for (from, to) in start.poses.iter().zip(&goal.poses) {
            // With an undemonstrated goal the sign is free and the angle at most 180 degrees.
            let to = match self.hemisphere {
                Hemisphere::Demonstrated => to.orientation,
                Hemisphere::Nearest => to.orientation.aligned_with(&from.orientation),
            };
            if !self.orientation_error.can_turn(&from.orientation, &to) {
                return Err(PrimitiveError::TurnsTooFar);
            }
        }
        Ok((start, goal))
    }

    /// The forcing term is nowhere larger than a movement can need. It is a mean of the weights times s, so it is
    /// enough to look at the centres of the kernels and half-way between them.
    fn check_weights<const N: usize>(
        &self,
        basis: &Basis<T, N>,
        systems: &Systems<T, D, P>,
    ) -> Result<(), PrimitiveError> {
        let number = |place: usize| u8::try_from(place).unwrap_or(u8::MAX);
        let largest = systems.each_row(|system| system.largest_force(self.duration, self.kernel_count));
        let rows = || self.weights.chunks_exact(self.kernel_count).zip(largest.iter()).enumerate();
        for kernel in 0..self.kernel_count {
            let centre = basis.centre(kernel).unwrap_or(T::ONE);
            let half = basis.centre(kernel + 1).map_or(centre, |next| (centre + next) * T::from_f64(0.5));
            for s in [centre, half] {
                let activations = basis.evaluate(s);
                for (row, (weights, &largest)) in rows() {
                    let weight = |i: usize| weights.get(i).map_or(T::ZERO, |weight| T::from_weight(*weight));
                    let force = activations.active().fold(T::ZERO, |sum, i| sum + activations.factor(i) * weight(i));
                    let alone = weight(kernel) * centre * T::from_f64(1.0 / bounds::LARGEST_CANCELLATION);
                    if [alone, force].into_iter().any(|force| !(force.abs() <= largest)) {
                        let (group, index) = Group::of_weights(row, P);
                        let (index, kernel) = (number(index), number(kernel));
                        return Err(PrimitiveError::WeightTooLarge { group, index, kernel });
                    }
                }
            }
        }
        Ok(())
    }
}
