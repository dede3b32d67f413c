//! `Primitive`: one movement, checked once, so that the 300 Hz loop needs no checks.
//!
//! Holds position (3), orientation (3), posture (7) and hand (4) on one phase. The paper does not say how the posture
//! is parameterised; one 1-D row per arm joint is our reading.

use crate::orientation::is_near_enough;
use crate::vector::all_finite;
use crate::{
    Activations, Basis, CanonicalSystem, Configuration, ExpectedWrench, Experience, Feedback, ForcingTerm, Limits,
    OrientationError, Part, PrimitiveError, Quaternion, Row, Scalar, Stiffness, TableError, TransformationSystem,
    Velocity, bounds,
};

/// Rows of the end-effector position (x, y, z in the world frame, metres).
pub const POSITION_ROWS: usize = 3;
/// Rows of the end-effector orientation (body frame).
pub const ORIENTATION_ROWS: usize = 3;
/// Rows of the default posture `q_post` (one per arm joint, radians).
pub const POSTURE_ROWS: usize = 7;
/// Rows of the hand (spread, F1, F2, F3, radians).
pub const HAND_ROWS: usize = 4;
/// All rows of weights in their order: position, orientation, posture, hand.
pub const ROWS: usize = POSITION_ROWS + ORIENTATION_ROWS + POSTURE_ROWS + HAND_ROWS;
/// Longest control period, s (300 Hz): the integration is proven stable for it, and [`crate::Rollout::step`] cuts a
/// longer one to it.
pub const CONTROL_PERIOD: f64 = 1.0 / 300.0;

/// How the signs of the start and goal quaternions were chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hemisphere {
    /// Start and goal carry the signs of a sign-continuous demonstration: a run aligns its own to them.
    Demonstrated,
    /// There is no demonstration: the goal is taken on the side nearest to the current orientation.
    Nearest,
}

/// The plain tables of a primitive, as they come from an image or a file: unchecked input of [`Primitive::new`].
#[derive(Clone, Copy, Debug)]
pub struct PrimitiveTables<'a, T> {
    /// Duration tau of the movement, s.
    pub duration: T,
    /// Decay `alpha` of the phase, Eq. (3).
    pub alpha: T,
    /// Activation `a` of a kernel at the next centre, Eq. (2).
    pub activation: T,
    /// Number of kernels in use, 2..=N.
    pub kernel_count: usize,
    /// Weights theta, row-major `[ROWS][kernel_count]`, in the paper's convention (the force is multiplied by K).
    pub weights: &'a [T],
    /// Stiffness K of position, orientation, posture, hand.
    pub stiffness: [T; 4],
    /// Damping D of position, orientation, posture, hand.
    pub damping: [T; 4],
    /// Which orientation error the orientation system uses.
    pub orientation_error: OrientationError,
    /// Meaning of the signs of the two quaternions below.
    pub hemisphere: Hemisphere,
    /// Start of the demonstration.
    pub start: Configuration<T>,
    /// Goal.
    pub goal: Configuration<T>,
    /// Velocity at the start of the demonstration (zero if it began at rest).
    pub start_velocity: Velocity<T>,
    /// Gains of the sensory feedback, Eq. (8); `None` runs open loop.
    pub feedback: Option<&'a Feedback<T>>,
    /// What the sensors should feel, by phase; `None` (not recorded yet) runs open loop.
    pub expected: Option<&'a ExpectedWrench<T>>,
    /// How successful runs felt, by phase; `None` (not recorded yet) is not watched.
    pub experience: Option<&'a Experience<T>>,
}

/// One movement with checked parameters; `N` = kernel capacity.
///
/// For f32 and N = 100 about 23 kB: keep it in a static or behind a reference on a small stack, and fill it there with
/// [`Primitive::assign`] and the other `assign_` functions.
#[derive(Debug, PartialEq)]
pub struct Primitive<T, const N: usize> {
    fingerprint: u32,
    duration: T,
    rate: T,
    minimum_duration: T,
    canonical: CanonicalSystem<T>,
    forcing: ForcingTerm<T, ROWS, N>,
    position: TransformationSystem<T>,
    orientation: TransformationSystem<T>,
    orientation_error: OrientationError,
    posture: TransformationSystem<T>,
    hand: TransformationSystem<T>,
    /// Largest coupling of position, orientation, posture and hand: K times the largest forcing term that the movement
    /// can need.
    coupling_limits: [T; 4],
    hemisphere: Hemisphere,
    start: Configuration<T>,
    goal: Configuration<T>,
    start_velocity: Velocity<T>,
    // An empty table stands for one that is not there: an `Option` of kilobytes would be moved through the stack.
    feedback: Feedback<T>,
    expected: ExpectedWrench<T>,
    experience: Experience<T>,
}

/// A copy into an existing primitive ([`Clone::clone_from`]) needs no second one on the stack.
impl<T: Scalar, const N: usize> Clone for Primitive<T, N> {
    fn clone(&self) -> Self {
        let mut copy = Self::PLACEHOLDER;
        copy.clone_from(self);
        copy
    }

    fn clone_from(&mut self, source: &Self) {
        self.fingerprint = source.fingerprint;
        self.duration = source.duration;
        self.rate = source.rate;
        self.minimum_duration = source.minimum_duration;
        self.canonical = source.canonical;
        self.forcing.copy_from(&source.forcing);
        self.position = source.position;
        self.orientation = source.orientation;
        self.orientation_error = source.orientation_error;
        self.posture = source.posture;
        self.hand = source.hand;
        self.coupling_limits = source.coupling_limits;
        self.hemisphere = source.hemisphere;
        self.start = source.start;
        self.goal = source.goal;
        self.start_velocity = source.start_velocity;
        self.feedback.copy_from(&source.feedback);
        self.expected.copy_from(&source.expected);
        self.experience.copy_from(&source.experience);
    }
}

/// What is computed from tables before anything is written.
struct Checked<T, const N: usize> {
    canonical: CanonicalSystem<T>,
    basis: Basis<T, N>,
    systems: [TransformationSystem<T>; 4],
    minimum_duration: T,
    start: Configuration<T>,
    goal: Configuration<T>,
}

impl<T: Scalar, const N: usize> Primitive<T, N> {
    /// Something to [`assign`](Primitive::assign) to, for statics: rests at the origin for a second. No movement of use.
    pub const PLACEHOLDER: Self = {
        let system = TransformationSystem::unit();
        let origin = Configuration {
            position: [T::ZERO; POSITION_ROWS],
            orientation: Quaternion::IDENTITY,
            posture: [T::ZERO; POSTURE_ROWS],
            hand: [T::ZERO; HAND_ROWS],
        };
        Self {
            fingerprint: 0,
            duration: T::ONE,
            rate: T::ONE,
            minimum_duration: T::ZERO,
            canonical: CanonicalSystem::unit(),
            forcing: ForcingTerm::without_force(Basis::fewest()),
            position: system,
            orientation: system,
            orientation_error: OrientationError::Quaternion,
            posture: system,
            hand: system,
            coupling_limits: [T::ZERO; 4],
            hemisphere: Hemisphere::Nearest,
            start: origin,
            goal: origin,
            start_velocity: Velocity::ZERO,
            feedback: Feedback::EMPTY,
            expected: ExpectedWrench::EMPTY,
            experience: Experience::EMPTY,
        }
    };

    /// Checks the tables and builds the primitive.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found.
    pub fn new(tables: &PrimitiveTables<'_, T>) -> Result<Self, PrimitiveError> {
        let mut primitive = Self::PLACEHOLDER;
        primitive.assign(tables)?;
        Ok(primitive)
    }

    /// Checks the tables and, if they are good, makes this primitive theirs. Everything is written in place: on a small
    /// stack there is never a second primitive.
    ///
    /// # Errors
    /// The first [`PrimitiveError`] found; then nothing has been changed.
    pub fn assign(&mut self, tables: &PrimitiveTables<'_, T>) -> Result<(), PrimitiveError> {
        let checked = Self::check(tables)?;
        // The only check that is left to the writer; it refuses before it writes.
        if !self.forcing.assign(&checked.basis, tables.weights) {
            return Err(PrimitiveError::Weight);
        }
        self.fingerprint = tables.fingerprint();
        self.duration = tables.duration;
        self.rate = T::ONE / tables.duration;
        self.minimum_duration = checked.minimum_duration;
        self.canonical = checked.canonical;
        [self.position, self.orientation, self.posture, self.hand] = checked.systems;
        self.coupling_limits = checked
            .systems
            .map(|system| system.stiffness() * bounds::largest_force(&system, tables.duration, tables.kernel_count));
        self.orientation_error = tables.orientation_error;
        self.hemisphere = tables.hemisphere;
        self.start = checked.start;
        self.goal = checked.goal;
        self.start_velocity = tables.start_velocity;
        self.feedback.clear();
        self.expected.clear();
        self.experience.clear();
        if let Some(feedback) = tables.feedback {
            self.feedback.copy_from(feedback);
        }
        if let Some(expected) = tables.expected {
            self.expected.copy_from(expected);
        }
        if let Some(experience) = tables.experience {
            self.experience.copy_from(experience);
        }
        Ok(())
    }

    fn check(tables: &PrimitiveTables<'_, T>) -> Result<Checked<T, N>, PrimitiveError> {
        let duration = tables.duration;
        if !(duration > T::ZERO && duration <= T::from_f64(bounds::LONGEST_DURATION)) {
            return Err(PrimitiveError::Duration);
        }
        let canonical = CanonicalSystem::new(tables.alpha).ok_or(PrimitiveError::Alpha)?;
        if tables.kernel_count < 2 || tables.kernel_count > N {
            return Err(PrimitiveError::KernelCount);
        }
        let basis = Basis::new(&canonical, tables.kernel_count, tables.activation).ok_or(PrimitiveError::Activation)?;
        if tables.weights.len() != ROWS * tables.kernel_count {
            return Err(PrimitiveError::WeightCount);
        }
        if !all_finite(tables.weights) {
            return Err(PrimitiveError::Weight);
        }
        let systems = tables.systems()?;
        let mut minimum_duration = T::ZERO;
        for (row, system) in [Row::Position, Row::Orientation, Row::Posture, Row::Hand].into_iter().zip(&systems) {
            let shortest = T::from_f64(CONTROL_PERIOD) / system.largest_step();
            if !(duration > shortest) {
                return Err(PrimitiveError::Unstable(row));
            }
            if shortest > minimum_duration {
                minimum_duration = shortest;
            }
        }
        tables.check_weights(&basis, &systems)?;
        if !tables.start.is_finite() {
            return Err(PrimitiveError::Start);
        }
        if !tables.goal.is_finite() {
            return Err(PrimitiveError::Goal);
        }
        if !tables.start_velocity.is_finite() {
            return Err(PrimitiveError::StartVelocity);
        }
        let too_large = |part: Part, place: Option<(Row, u8)>| match place {
            Some((row, index)) => Err(PrimitiveError::TooLarge { part, row, index }),
            None => Ok(()),
        };
        too_large(Part::Start, tables.start.out_of_bounds())?;
        too_large(Part::Goal, tables.goal.out_of_bounds())?;
        too_large(Part::StartVelocity, tables.start_velocity.out_of_bounds())?;
        let start = tables.start.normalised().ok_or(PrimitiveError::StartNotUnit)?;
        let goal = tables.goal.normalised().ok_or(PrimitiveError::GoalNotUnit)?;
        // With an undemonstrated goal the sign is free and the angle at most 180 degrees.
        let to = match tables.hemisphere {
            Hemisphere::Demonstrated => goal.orientation,
            Hemisphere::Nearest => goal.orientation.aligned_with(&start.orientation),
        };
        if tables.orientation_error == OrientationError::Quaternion && !is_near_enough(&start.orientation, &to) {
            return Err(PrimitiveError::TurnsTooFar);
        }
        Ok(Checked { canonical, basis, systems, minimum_duration, start, goal })
    }

    /// Tells movements apart: equal for equal tables. Feedback, expectation and experience may change under a run and
    /// do not count.
    #[inline]
    pub(crate) fn fingerprint(&self) -> u32 {
        self.fingerprint
    }

    /// Duration tau as taught, s.
    #[inline]
    pub fn duration(&self) -> T {
        self.duration
    }

    /// 1/tau, 1/s.
    #[inline]
    pub(crate) fn rate(&self) -> T {
        self.rate
    }

    /// Shortest duration at which the integration is stable at 300 Hz, s (0.057 s for the default gains).
    #[inline]
    pub fn minimum_duration(&self) -> T {
        self.minimum_duration
    }

    /// The clock, Eq. (3).
    #[inline]
    pub fn canonical(&self) -> &CanonicalSystem<T> {
        &self.canonical
    }

    /// The forcing term of all rows, Eq. (2).
    #[inline]
    pub fn forcing(&self) -> &ForcingTerm<T, ROWS, N> {
        &self.forcing
    }

    /// Spring and damper of the position rows.
    #[inline]
    pub fn position(&self) -> &TransformationSystem<T> {
        &self.position
    }

    /// Spring and damper of the orientation rows.
    #[inline]
    pub fn orientation(&self) -> &TransformationSystem<T> {
        &self.orientation
    }

    /// Coordinates of the orientation rows.
    #[inline]
    pub fn orientation_error(&self) -> OrientationError {
        self.orientation_error
    }

    /// Spring and damper of the posture rows.
    #[inline]
    pub fn posture(&self) -> &TransformationSystem<T> {
        &self.posture
    }

    /// Spring and damper of the hand rows.
    #[inline]
    pub fn hand(&self) -> &TransformationSystem<T> {
        &self.hand
    }

    /// Largest coupling of position, orientation, posture and hand.
    #[inline]
    pub(crate) fn coupling_limits(&self) -> &[T; 4] {
        &self.coupling_limits
    }

    /// How quaternion signs are chosen.
    #[inline]
    pub fn hemisphere(&self) -> Hemisphere {
        self.hemisphere
    }

    /// Start of the demonstration.
    #[inline]
    pub fn start(&self) -> &Configuration<T> {
        &self.start
    }

    /// Velocity at the start of the demonstration.
    #[inline]
    pub fn start_velocity(&self) -> &Velocity<T> {
        &self.start_velocity
    }

    /// Goal of the demonstration.
    #[inline]
    pub fn goal(&self) -> &Configuration<T> {
        &self.goal
    }

    /// Gains of the sensory feedback.
    #[inline]
    pub fn feedback(&self) -> Option<&Feedback<T>> {
        (!self.feedback.is_empty()).then_some(&self.feedback)
    }

    /// What the sensors should feel.
    #[inline]
    pub fn expected(&self) -> Option<&ExpectedWrench<T>> {
        (!self.expected.is_empty()).then_some(&self.expected)
    }

    /// How successful runs felt.
    #[inline]
    pub fn experience(&self) -> Option<&Experience<T>> {
        (!self.experience.is_empty()).then_some(&self.experience)
    }

    /// Replaces the expectation, e.g. after the open-loop run that recorded it; `None` runs open loop.
    pub fn set_expected(&mut self, expected: Option<&ExpectedWrench<T>>) {
        match expected {
            Some(expected) => self.expected.copy_from(expected),
            None => self.expected.clear(),
        }
    }

    /// Replaces the feedback by values that come one by one, as from a stored image: `K1` and `K2` by phase, point after
    /// point, and the limits.
    ///
    /// # Errors
    /// As [`Feedback::new`] and [`crate::PhaseTable::new`], [`TableError::Shape`] for a point that is cut short; the
    /// primitive then has no feedback and runs open loop.
    pub fn assign_feedback(
        &mut self,
        sensitivity: impl IntoIterator<Item = T>,
        weight: impl IntoIterator<Item = T>,
        limits: Limits<T>,
    ) -> Result<(), TableError> {
        self.feedback.assign(sensitivity, weight, limits)
    }

    /// Replaces the expectation by values that come one by one, point after point; recorded at the duration
    /// `recorded_duration` (s).
    ///
    /// # Errors
    /// As [`ExpectedWrench::new`], [`TableError::Shape`] for a point that is cut short; the primitive then has no
    /// expectation and runs open loop.
    pub fn assign_expected(
        &mut self,
        samples: impl IntoIterator<Item = T>,
        recorded_duration: T,
    ) -> Result<(), TableError> {
        self.expected.assign(samples, recorded_duration)
    }

    /// Replaces the experience by values that come one by one, point after point.
    ///
    /// # Errors
    /// As [`Experience::new`], [`TableError::Shape`] also for a point that is cut short; the primitive then has no
    /// experience and is not watched.
    pub fn assign_experience(
        &mut self,
        mean: impl IntoIterator<Item = T>,
        spread: impl IntoIterator<Item = T>,
        trials: u16,
    ) -> Result<(), TableError> {
        self.experience.assign(mean, spread, trials)
    }

    pub(crate) fn stiffness(&self) -> Stiffness<T> {
        Stiffness {
            position: self.position.stiffness(),
            orientation: self.orientation.stiffness(),
            hand: self.hand.stiffness(),
            orientation_error: self.orientation_error,
        }
    }
}

impl<T: Scalar> PrimitiveTables<'_, T> {
    /// FNV-1a over the values of the movement, folded to 32 bits.
    fn fingerprint(&self) -> u32 {
        let ends =
            [&self.start, &self.goal].map(|end| (end.position, end.orientation.to_array(), end.posture, end.hand));
        let ends = ends.iter().flat_map(|(position, orientation, posture, hand)| {
            position.iter().chain(orientation).chain(posture).chain(hand)
        });
        let gains = self.stiffness.iter().chain(&self.damping);
        let values =
            [&self.duration, &self.alpha, &self.activation].into_iter().chain(gains).chain(ends).chain(self.weights);
        let choices = [
            self.kernel_count as u64,
            u64::from(self.orientation_error == OrientationError::RotationVector),
            u64::from(self.hemisphere == Hemisphere::Nearest),
        ];
        let words = choices.into_iter().chain(values.map(|value| value.bits()));
        let hash = words.fold(0xcbf2_9ce4_8422_2325_u64, |hash, word| {
            // Word by word instead of byte by byte; the rotation brings the high bits of a product back to where it
            // mixes.
            (hash ^ word).wrapping_mul(0x0000_0100_0000_01b3).rotate_left(29)
        });
        (hash ^ (hash >> 32)) as u32
    }

    fn gains(&self) -> [(T, T); 4] {
        core::array::from_fn(|i| (self.stiffness[i], self.damping[i]))
    }

    /// The forcing term is nowhere larger than a movement can need. It is a mean of the weights times s, so it is
    /// enough to look at the centres of the kernels and half-way between them.
    fn check_weights<const N: usize>(
        &self,
        basis: &Basis<T, N>,
        systems: &[TransformationSystem<T>; 4],
    ) -> Result<(), PrimitiveError> {
        let largest = systems.map(|system| bounds::largest_force(&system, self.duration, self.kernel_count));
        let place = |index: usize| u8::try_from(index).unwrap_or(u8::MAX);
        let rows = || self.weights.chunks_exact(self.kernel_count).enumerate();
        for kernel in 0..self.kernel_count {
            let centre = basis.centre(kernel).unwrap_or(T::ONE);
            let half = basis.centre(kernel + 1).map_or(centre, |next| (centre + next) * T::from_f64(0.5));
            let (at, between) = (basis.evaluate(centre), basis.evaluate(half));
            for (row, weights) in rows() {
                let (group, _) = Row::of_weights(row);
                let largest = largest[group as usize];
                let weight = |i: usize| weights.get(i).copied().unwrap_or(T::ZERO);
                let force = |activations: &Activations<T, N>| {
                    activations.active().fold(T::ZERO, |sum, i| sum + activations.factor(i) * weight(i))
                };
                let alone = weight(kernel) * centre * T::from_f64(1.0 / bounds::LARGEST_CANCELLATION);
                if [alone, force(&at), force(&between)].into_iter().any(|force| !(force.abs() <= largest)) {
                    return Err(PrimitiveError::WeightTooLarge { row: place(row), kernel: place(kernel) });
                }
            }
        }
        Ok(())
    }

    fn systems(&self) -> Result<[TransformationSystem<T>; 4], PrimitiveError> {
        let [position, orientation, posture, hand] = self.gains();
        let system = |row, (k, d)| TransformationSystem::new(k, d).map_err(|error| PrimitiveError::Gains(row, error));
        Ok([
            system(Row::Position, position)?,
            system(Row::Orientation, orientation)?,
            system(Row::Posture, posture)?,
            system(Row::Hand, hand)?,
        ])
    }
}
