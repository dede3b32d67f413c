//! `FingerPrimitive`: the hand's part of a movement primitive, in fixed point, checked.
//!
//! Four point rows of `dmp` without a pose, and the three gauges that bend them. Made from the real numbers of an image
//! ([`FingerTables`]) when its upload is complete.

use control::model::FINGER_TORQUE_MAX;
use control::plan::bounds::{self as arm, Quantity};
use control::plan::load::{LONGEST_MOVEMENT, LoadError, SHORTEST_MOVEMENT};
use control::plan::primitive::RowGroup;
use device::PrimitiveDefect;
use device::recorded_filter::{self, OtherFilter};
use dmp::{
    Configuration, Coupling, CouplingGains, DisplacementLimits, ExpectedSensors, Gain, Gains, Group, Hemisphere,
    OrientationError, PrimitiveError, PrimitiveTables, RolloutError, Scalar, StartState, Velocity, bounds,
};
use link::Refusal;
use link::image::{EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT};

use crate::number::{Number, ZERO, constant, from_real};
use crate::{DIGITS, FINGERS, KERNELS};

/// Most a start or goal may lie outside the range of its digit (rad): what noise of a demonstration at the stops
/// leaves.
const RANGE_MARGIN: f64 = 0.05;

/// The control period (s).
pub(crate) const PERIOD: Number = constant(control::PERIOD);

/// Movement of the digits.
pub type Movement = dmp::Primitive<Number, DIGITS, 0, KERNELS>;

/// One run of it.
pub type Rollout = dmp::Rollout<Number, DIGITS, 0, KERNELS>;

/// The values of a table as numbers of the control path.
fn numbers(table: &[[f32; FINGERS]]) -> impl Iterator<Item = Number> + '_ {
    table.iter().flatten().copied().map(from_real)
}

/// Values of a table with a column for each finger, point after point.
type Table<const POINTS: usize> = heapless::Vec<[f32; FINGERS], POINTS>;

/// The hand's part of an image, in its real numbers, not checked yet.
#[derive(Clone, Debug, Default)]
pub struct FingerTables {
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
    /// Mass (kg) and centre (m) of the load that it was recorded with.
    pub load_mass: f32,
    /// See `load_mass`.
    pub load_centre: [f32; 3],
    /// Runs behind it.
    pub trials: f32,
    /// Smallest relative spread that counts.
    pub spread_floor: f32,
    /// Cut-off of the filter behind it (Hz).
    pub filter_cut_off: f32,
    /// Kernels of each row.
    pub kernels: usize,
    /// Weights, row after row, as [`Number`] keeps them.
    pub weights: heapless::Vec<i32, { DIGITS * KERNELS }>,
    /// K1 of the finger rows by phase; empty without feedback.
    pub sensitivity: Table<GAIN_POINTS_LIMIT>,
    /// K2 of the gauges by phase.
    pub weight: Table<GAIN_POINTS_LIMIT>,
    /// Expected torque of each gauge by phase (N m); empty if none was recorded.
    pub expected: Table<EXPECTATION_POINTS_LIMIT>,
}

impl FingerTables {
    /// Without values.
    pub const EMPTY: FingerTables = FingerTables {
        duration: 0.0,
        alpha: 0.0,
        activation: 0.0,
        stiffness: 0.0,
        damping: 0.0,
        start: [0.0; DIGITS],
        start_velocity: [0.0; DIGITS],
        goal: [0.0; DIGITS],
        limit: 0.0,
        recorded_duration: 0.0,
        load_mass: 0.0,
        load_centre: [0.0; 3],
        trials: 0.0,
        spread_floor: 0.0,
        filter_cut_off: 0.0,
        kernels: 0,
        weights: heapless::Vec::new(),
        sensitivity: heapless::Vec::new(),
        weight: heapless::Vec::new(),
        expected: heapless::Vec::new(),
    };

    /// Forgets all tables.
    pub(crate) fn clear(&mut self) {
        self.weights.clear();
        self.sensitivity.clear();
        self.weight.clear();
        self.expected.clear();
    }

    /// The checks that are the hand's own, and those of the tables that `dmp` fills one after another: a primitive is
    /// not to be left half filled.
    fn check(&self) -> Result<(), Unfit> {
        if !(SHORTEST_MOVEMENT..=LONGEST_MOVEMENT).contains(&f64::from(self.duration)) {
            return Err(Unfit::Movement(LoadError::Duration));
        }
        for (end, error) in [(&self.start, PrimitiveError::Start), (&self.goal, PrimitiveError::Goal)] {
            let reached = |(angle, [low, high]): (&f32, [f64; 2])| {
                (low - RANGE_MARGIN..=high + RANGE_MARGIN).contains(&f64::from(*angle))
            };
            if !end.iter().zip(crate::RANGES).all(reached) {
                return Err(Unfit::Movement(LoadError::Primitive(error)));
            }
        }
        self.check_bounds().map_err(|quantity| Unfit::Movement(LoadError::Bound(quantity)))?;
        let gain = |value: &f32| (0.0..=bounds::LARGEST_COUPLING_GAIN).contains(&f64::from(*value));
        let gains_hold = self.sensitivity.iter().chain(&self.weight).flatten().all(gain);
        if !gains_hold || self.limits().check().is_err() {
            return Err(Unfit::Feedback);
        }
        if !self.expected.is_empty() {
            recorded_filter::check(self.filter_cut_off).map_err(Unfit::Filter)?;
            let torque = |value: &f32| f64::from(*value).abs() <= FINGER_TORQUE_MAX;
            // As the number it becomes: what is below the resolution is 0 there.
            let duration = from_real(self.recorded_duration);
            let is_real = duration > ZERO && duration <= constant(bounds::LONGEST_DURATION);
            if !(is_real && self.expected.iter().flatten().all(torque)) {
                return Err(Unfit::Expectation);
            }
        }
        Ok(())
    }

    /// The numbers that an arm bounds in the same way.
    fn check_bounds(&self) -> Result<(), Quantity> {
        let rows = RowGroup::Hand;
        if !arm::within(&[self.stiffness, self.damping], arm::GAIN) {
            return Err(Quantity::Gain(rows));
        }
        if !arm::within(&[self.limit], arm::DISPLACEMENT[2]) {
            return Err(Quantity::Displacement(rows));
        }
        if !arm::within(&self.start_velocity, arm::of(&arm::SPEED, rows)) {
            return Err(Quantity::StartVelocity(rows));
        }
        arm::check_marks(self.load_mass, &self.load_centre, self.trials, self.spread_floor)
    }

    fn limits(&self) -> DisplacementLimits<Number, DIGITS, 0> {
        DisplacementLimits { poses: [], points: [from_real(self.limit); DIGITS] }
    }
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
    /// Of the rows of the hand, which come behind the posture's in a movement of the arm.
    fn from(error: PrimitiveError) -> Self {
        let row = |index: u8| index.saturating_add(control::plan::primitive::POSTURE_ROWS as u8);
        Unfit::Movement(LoadError::Primitive(match error {
            PrimitiveError::Gains { group: group @ Group::Points, index, error } => {
                PrimitiveError::Gains { group, index: row(index), error }
            }
            PrimitiveError::Unstable { group: group @ Group::Points, index } => {
                PrimitiveError::Unstable { group, index: row(index) }
            }
            PrimitiveError::WeightTooLarge { group: group @ Group::Points, index, kernel } => {
                PrimitiveError::WeightTooLarge { group, index: row(index), kernel }
            }
            PrimitiveError::TooLarge { part, group: group @ Group::Points, index } => {
                PrimitiveError::TooLarge { part, group, index: row(index) }
            }
            error => error,
        }))
    }
}

impl From<Unfit> for (Refusal, [u32; 2]) {
    fn from(unfit: Unfit) -> Self {
        match unfit {
            Unfit::Movement(error) => (Refusal::PrimitiveInvalid, PrimitiveDefect::from(error).0),
            Unfit::Feedback => (Refusal::PrimitiveInvalid, PrimitiveDefect::FEEDBACK.0),
            Unfit::Expectation => (Refusal::PrimitiveInvalid, PrimitiveDefect::EXPECTATION.0),
            Unfit::Filter(other) => other.into(),
        }
    }
}

/// The four rows of the hand, with feedback and expectation of the three gauges.
#[derive(Debug)]
pub struct FingerPrimitive {
    movement: Movement,
    gains: CouplingGains<Number, FINGERS, FINGERS, GAIN_POINTS_LIMIT>,
    limits: DisplacementLimits<Number, DIGITS, 0>,
    expected: ExpectedSensors<Number, FINGERS, EXPECTATION_POINTS_LIMIT>,
    present: bool,
}

impl FingerPrimitive {
    /// A place for one.
    pub const EMPTY: FingerPrimitive = FingerPrimitive {
        movement: Movement::PLACEHOLDER,
        gains: CouplingGains::EMPTY,
        limits: DisplacementLimits::NONE,
        expected: ExpectedSensors::EMPTY,
        present: false,
    };

    /// Forgets what the place held.
    pub fn clear(&mut self) {
        self.present = false;
    }

    /// Takes over another one, without a copy on the stack.
    pub fn copy_from(&mut self, other: &Self) {
        self.movement.clone_from(&other.movement);
        self.gains.copy_from(&other.gains);
        self.limits = other.limits;
        self.expected.copy_from(&other.expected);
        self.present = other.present;
    }

    /// Takes the tables of an image. Computes in floating point: at upload, never on the control path.
    ///
    /// # Errors
    /// [`Unfit`]: nothing has changed then.
    pub fn assign(&mut self, tables: &FingerTables) -> Result<(), Unfit> {
        tables.check()?;
        let gain = Gain { stiffness: from_real(tables.stiffness), damping: from_real(tables.damping) };
        let at = |points: [f32; DIGITS]| Configuration { poses: [], points: points.map(from_real) };
        self.movement.assign(&PrimitiveTables {
            control_period: PERIOD,
            duration: from_real(tables.duration),
            alpha: from_real(tables.alpha),
            activation: from_real(tables.activation),
            kernel_count: tables.kernels,
            weights: &tables.weights,
            gains: Gains { poses: [], points: [gain; DIGITS] },
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Demonstrated,
            start: at(tables.start),
            goal: at(tables.goal),
            start_velocity: Velocity { poses: [], points: tables.start_velocity.map(from_real) },
        })?;
        self.gains.clear();
        self.expected.clear();
        self.limits = tables.limits();
        self.present = true;
        if !tables.sensitivity.is_empty() {
            let (sensitivity, weight) = (numbers(&tables.sensitivity), numbers(&tables.weight));
            self.gains.assign(sensitivity, weight).map_err(|_| Unfit::Feedback)?;
        }
        if !tables.expected.is_empty() {
            let recorded_duration = from_real(tables.recorded_duration);
            self.expected.assign(numbers(&tables.expected), recorded_duration).map_err(|_| Unfit::Expectation)?;
        }
        Ok(())
    }

    /// True if it holds a movement.
    pub fn is_whole(&self) -> bool {
        self.present
    }

    /// The movement.
    pub fn movement(&self) -> &Movement {
        &self.movement
    }

    /// True if it knows what the gauges should feel.
    pub fn has_expectation(&self) -> bool {
        !self.expected.is_empty()
    }

    /// A run from `start` (rad), at rest, at `speed` relative to the taught one; the goal is the stored one.
    ///
    /// # Errors
    /// As [`dmp::Rollout::start`] and [`dmp::Rollout::set_speed`].
    pub fn run(&self, start: &[Number; DIGITS], speed: Number) -> Result<Rollout, RolloutError> {
        let start = StartState::at_rest(Configuration { poses: [], points: *start });
        let mut rollout = Rollout::start(&self.movement, &start)?;
        // The first speed acts at once; later ones are approached at the rollout's slew rate.
        rollout.set_speed_slew(None)?;
        rollout.set_speed(&self.movement, speed)?;
        rollout.set_speed_slew(Some(Number::from_f64(Rollout::DEFAULT_SLEW)))?;
        Ok(rollout)
    }

    /// Torques that the gauges should feel now (N m); `None` if none were recorded.
    pub fn expected(&self, rollout: &Rollout) -> Option<[Number; FINGERS]> {
        self.has_expectation().then(|| self.expected.at(rollout.progress()))
    }

    /// Trust in the expectation at the speed of this run, 1 to 0; see [`dmp::ExpectedSensors::trust`].
    pub fn trust(&self, rollout: &Rollout) -> Number {
        self.expected.trust(self.expected.recorded_duration() * self.movement.rate() * rollout.speed())
    }

    /// Eq (8) for the fingers: `zeta = K1 K2 (F - F_des)` within the limits; of the error, `share` counts (0 to 1).
    pub fn coupling(
        &self,
        rollout: &Rollout,
        gauges: &[Number; FINGERS],
        share: Number,
    ) -> Coupling<Number, DIGITS, 0> {
        let Some(expected) = self.expected(rollout).filter(|_| !self.gains.is_empty()) else {
            return Coupling::NONE;
        };
        let error = core::array::from_fn(|finger| (gauges[finger] - expected[finger]) * share);
        let [f1, f2, f3] = self.gains.zeta(rollout.progress(), &error, |weighted| *weighted);
        self.movement.limited_coupling(&Coupling { poses: [], points: [ZERO, f1, f2, f3] }, &self.limits)
    }
}
