//! `FingerPrimitive`: the hand's part of a movement primitive, in fixed point, checked.
//!
//! Made from the real numbers of an image while it is uploaded ([`crate::image`]); nothing here computes on the control
//! path.

use control::plan::load::{LONGEST_MOVEMENT, LoadError, SHORTEST_MOVEMENT};
use device::PrimitiveTrouble;
use device::recorded_filter::{self, OtherFilter};
use dmp::{GainError, Group, PrimitiveError, TransformationSystem};
use link::Refusal;
use link::image::{EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT};

use crate::forcing::Basis;
use crate::number::{Number, ZERO, from_real};
use crate::profile::{Profile, Torque};
use crate::{DIGITS, KERNELS};

/// Most a start or goal may lie outside the range of its digit (rad): what noise of a demonstration at the stops
/// leaves.
const RANGE_MARGIN: f64 = 0.05;

/// Largest magnitude of a feedback limit (rad).
const FEEDBACK_LIMIT: f32 = 3.2;

/// The real numbers of an image that stand in front of its tables, as far as they concern the hand.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Marks {
    /// Duration as taught (s).
    pub duration: f32,
    /// Decay of the phase, Eq (3).
    pub alpha: f32,
    /// Activation of a kernel at the next centre, Eq (2).
    pub activation: f32,
    /// K of the hand rows.
    pub stiffness: f32,
    /// D of the hand rows.
    pub damping: f32,
    /// Start of the demonstration: spread, F1, F2, F3 (rad).
    pub start: [f32; DIGITS],
    /// Its velocity (rad/s).
    pub start_velocity: [f32; DIGITS],
    /// Its goal (rad).
    pub goal: [f32; DIGITS],
    /// Largest displacement by feedback at rest (rad).
    pub limit: f32,
    /// Duration at which the expectation was recorded (s).
    pub recorded_duration: f32,
    /// Cut-off of the filter behind it (Hz).
    pub filter_cut_off: f32,
}

/// The first row of the hand in a movement of the arm.
const HAND: (Group, u8) = (Group::Points, control::plan::primitive::POSTURE_ROWS as u8);

/// The gains of the hand are unusable.
fn gains(error: GainError) -> PrimitiveError {
    PrimitiveError::Gains { group: HAND.0, index: HAND.1, error }
}

/// Why an image is no primitive of this device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Unfit {
    /// The movement is outside what the controller accepts.
    Movement(LoadError),
    /// The gains of the feedback are negative or beyond the range of the numbers.
    Feedback,
    /// A value of the expectation is beyond the range of the numbers.
    Expectation,
    /// The expectation was recorded through another filter.
    Filter(OtherFilter),
}

impl From<PrimitiveError> for Unfit {
    fn from(error: PrimitiveError) -> Self {
        Unfit::Movement(LoadError::Primitive(error))
    }
}

impl From<Unfit> for (Refusal, [u32; 2]) {
    fn from(unfit: Unfit) -> Self {
        match unfit {
            Unfit::Movement(error) => (Refusal::PrimitiveInvalid, PrimitiveTrouble::from(error).0),
            Unfit::Feedback => (Refusal::PrimitiveInvalid, PrimitiveTrouble::FEEDBACK.0),
            Unfit::Expectation => (Refusal::PrimitiveInvalid, PrimitiveTrouble::EXPECTATION.0),
            Unfit::Filter(other) => other.into(),
        }
    }
}

/// The four rows of the hand, with feedback and expectation of the three gauges.
#[derive(Clone, Debug)]
pub struct FingerPrimitive {
    pub(crate) duration: Number,
    /// 1/duration.
    pub(crate) rate: Number,
    pub(crate) shortest: Number,
    pub(crate) basis: Basis,
    pub(crate) weights: [[i32; DIGITS]; KERNELS],
    pub(crate) system: Option<TransformationSystem<Number>>,
    pub(crate) start: [Number; DIGITS],
    pub(crate) start_velocity: [Number; DIGITS],
    pub(crate) goal: [Number; DIGITS],
    /// K1 of the finger rows by phase; empty without feedback.
    pub(crate) sensitivity: Profile<Number, GAIN_POINTS_LIMIT>,
    /// K2 of the gauges by phase.
    pub(crate) weight: Profile<Number, GAIN_POINTS_LIMIT>,
    /// Largest zeta: K times the largest displacement.
    pub(crate) zeta_limit: Number,
    /// Expected torque of each gauge by phase; empty if none was recorded.
    pub(crate) expected: Profile<Torque, EXPECTATION_POINTS_LIMIT>,
    /// Recorded duration over the duration as taught.
    pub(crate) recorded_speed: Number,
}

impl FingerPrimitive {
    /// A place for one.
    pub const EMPTY: FingerPrimitive = FingerPrimitive {
        duration: ZERO,
        rate: ZERO,
        shortest: ZERO,
        basis: Basis::EMPTY,
        weights: [[0; DIGITS]; KERNELS],
        system: None,
        start: [ZERO; DIGITS],
        start_velocity: [ZERO; DIGITS],
        goal: [ZERO; DIGITS],
        sensitivity: Profile::new(),
        weight: Profile::new(),
        zeta_limit: ZERO,
        expected: Profile::new(),
        recorded_speed: ZERO,
    };

    /// Forgets what the place held.
    pub fn clear(&mut self) {
        self.system = None;
        self.basis = Basis::EMPTY;
        self.sensitivity.clear();
        self.weight.clear();
        self.expected.clear();
    }

    /// Takes the numbers in front of the tables.
    ///
    /// # Errors
    /// [`Unfit`]: the place holds nothing of use then.
    pub fn begin(&mut self, marks: &Marks, kernels: usize) -> Result<(), Unfit> {
        self.clear();
        let duration = f64::from(marks.duration);
        if !(SHORTEST_MOVEMENT..=LONGEST_MOVEMENT).contains(&duration) {
            return Err(Unfit::Movement(LoadError::Duration));
        }
        let (alpha, activation) = (f64::from(marks.alpha), f64::from(marks.activation));
        if !(2.3..=13.82).contains(&alpha) {
            return Err(PrimitiveError::Alpha.into());
        }
        if !(0.05..=0.95).contains(&activation) {
            return Err(PrimitiveError::Activation.into());
        }
        self.basis = Basis::new(kernels, alpha, activation).ok_or(PrimitiveError::KernelCount)?;
        let (stiffness, damping) = (from_real(marks.stiffness), from_real(marks.damping));
        /// Largest K and D: D^2 + 4 K and the products with angles and phase speeds stay far from saturation.
        const GAIN_LIMITS: [f32; 2] = [1e5, 4e4];
        let [largest_stiffness, largest_damping] = GAIN_LIMITS;
        if marks.stiffness.abs() > largest_stiffness {
            return Err(gains(GainError::Stiffness).into());
        }
        if marks.damping.abs() > largest_damping {
            return Err(gains(GainError::Damping).into());
        }
        let system = TransformationSystem::new(stiffness, damping).map_err(gains)?;
        self.duration = Number::constant(duration);
        self.rate = Number::constant(1.0 / duration);
        self.shortest = Number::constant(control::PERIOD) / system.largest_step();
        if self.duration <= self.shortest {
            return Err(PrimitiveError::Unstable { group: HAND.0, index: HAND.1 }.into());
        }
        let ends = [(&marks.start, PrimitiveError::Start), (&marks.goal, PrimitiveError::Goal)];
        for (end, error) in ends {
            let outside = end
                .iter()
                .zip(crate::RANGES)
                .any(|(angle, [low, high])| !(low - RANGE_MARGIN..=high + RANGE_MARGIN).contains(&f64::from(*angle)));
            if outside {
                return Err(error.into());
            }
        }
        /// Faster than any digit.
        const SPEED_LIMIT: f32 = 10.0;
        if marks.start_velocity.iter().any(|velocity| velocity.abs() > SPEED_LIMIT) {
            return Err(PrimitiveError::StartVelocity.into());
        }
        if !(0.0..=FEEDBACK_LIMIT).contains(&marks.limit) {
            return Err(Unfit::Feedback);
        }
        self.start = marks.start.map(from_real);
        self.start_velocity = marks.start_velocity.map(from_real);
        self.goal = marks.goal.map(from_real);
        self.zeta_limit = from_real(marks.limit) * stiffness;
        self.system = Some(system);
        Ok(())
    }

    /// All tables are in: checks what only they tell.
    ///
    /// # Errors
    /// [`Unfit`]: the place holds nothing of use then.
    pub fn finish(&mut self, marks: &Marks) -> Result<(), Unfit> {
        let negative = |value: Number| value < ZERO;
        if self.sensitivity.any(negative) || self.weight.any(negative) {
            return Err(Unfit::Feedback);
        }
        if !self.expected.is_empty() {
            recorded_filter::check(marks.filter_cut_off).map_err(Unfit::Filter)?;
            let speed = f64::from(marks.recorded_duration) / f64::from(marks.duration);
            if !(speed > 0.0 && speed < 1e3) {
                return Err(Unfit::Expectation);
            }
            self.recorded_speed = Number::constant(speed);
        }
        Ok(())
    }

    /// True if it holds a movement.
    pub fn is_whole(&self) -> bool {
        self.system.is_some()
    }

    /// Duration as taught (s).
    pub fn duration(&self) -> Number {
        self.duration
    }

    /// Where the hand begins (rad), spread first.
    pub fn start(&self) -> &[Number; DIGITS] {
        &self.start
    }

    /// True if it knows what the gauges should feel.
    pub fn has_expectation(&self) -> bool {
        !self.expected.is_empty()
    }
}
