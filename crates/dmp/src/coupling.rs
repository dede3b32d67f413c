//! `Feedback` and `Coupling`: Eq. (8), the term by which felt forces bend the plan.
//!
//! `zeta = K1 J_sensor^T K2 (F - F_expected)`, F = wrench of the ENVIRONMENT ON THE ROBOT: an unexpected push along +x
//! moves the plan towards +x. `zeta` stands inside the right-hand side of Eqs. (9) and (6), so a constant one settles
//! at `x = g + zeta/K` and at the angle `2 asin(zeta_o/K_o)`. Beyond `zeta_o = K_o` there is no equilibrium and the
//! plan would spin, therefore `|zeta_p| <= K dx_max` and `|zeta_o| <= K_o sin(theta_max/2)`.

use crate::vector::{clamp, clamp_norm, cross, rotate};
use crate::{Entry, OrientationError, PhaseTable, Scalar, TableError, bounds};

/// Sensor values: force x, y, z (N), torque x, y, z (N m), torque on finger F1, F2, F3 (N m).
pub const SENSORS: usize = 9;
/// Task dimensions with feedback: position 3, orientation 3, hand 4 (the spread has no gauge).
pub const COUPLED_ROWS: usize = 10;
/// Most samples of a gain over the phase.
pub const GAIN_CAPACITY: usize = 32;

/// Diagonal gains, constant or by phase.
pub type GainSchedule<T, const COLUMNS: usize> = PhaseTable<T, COLUMNS, GAIN_CAPACITY>;

/// How far feedback may displace the plan in steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<T> {
    /// `dx_max`, m.
    pub displacement: T,
    /// `theta_max`, rad (0..pi).
    pub rotation: T,
    /// Largest displacement of a hand joint, rad.
    pub hand: T,
}

/// Gains and limits of Eq. (8).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Feedback<T> {
    sensitivity: GainSchedule<T, COUPLED_ROWS>,
    weight: GainSchedule<T, SENSORS>,
    limits: Limits<T>,
}

/// `zeta` of one tick, in the unit of the rows (m, rad) times the stiffness.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling<T> {
    /// Position rows, world frame.
    pub position: [T; 3],
    /// Orientation rows, body frame.
    pub orientation: [T; 3],
    /// Hand rows (spread, F1, F2, F3).
    pub hand: [T; 4],
}

impl<T: Scalar> Coupling<T> {
    /// No feedback: the plan runs open loop.
    pub const NONE: Self = Self { position: [T::ZERO; 3], orientation: [T::ZERO; 3], hand: [T::ZERO; 4] };

    /// True if no value can be beyond its limit (of position, orientation, posture, hand): the sum of all magnitudes
    /// is within the least. A NaN makes it false.
    #[inline]
    pub(crate) fn is_within(&self, &[position, orientation, _, hand]: &[T; 4]) -> bool {
        let sum = |values: &[T]| values.iter().fold(T::ZERO, |sum, value| sum + value.abs());
        let least = |a: T, b: T| if a < b { a } else { b };
        sum(&self.position) + sum(&self.orientation) + sum(&self.hand) <= least(least(position, orientation), hand)
    }

    /// Each value cut to its limit; one that is not a number counts as 0.
    #[cold]
    pub(crate) fn limited(&self, &[position, orientation, _, hand]: &[T; 4]) -> Self {
        Self {
            position: self.position.map(|zeta| clamp(zeta, position)),
            orientation: self.orientation.map(|zeta| clamp(zeta, orientation)),
            hand: self.hand.map(|zeta| clamp(zeta, hand)),
        }
    }
}

/// `J_sensor^T` for a wrist sensor and finger gauges: where the sensor sits relative to the controlled point.
///
/// [`SensorMap::IDENTITY`] is right if the forces are in the world frame and the torques in the body frame at the
/// controlled point already; this is how an expectation should be recorded.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SensorMap<T> {
    /// Rotation from the frame of the force values to the world, row by row.
    pub force: [[T; 3]; 3],
    /// Rotation from the frame of the torque values to the body, row by row.
    pub torque: [[T; 3]; 3],
    /// From the sensor's origin to the controlled point, in the frame of the torque values, m.
    ///
    /// Only meaningful if forces and torques come in the same frame; zero otherwise.
    pub lever: [T; 3],
}

impl<T: Scalar> SensorMap<T> {
    const UNIT: [[T; 3]; 3] = [[T::ONE, T::ZERO, T::ZERO], [T::ZERO, T::ONE, T::ZERO], [T::ZERO, T::ZERO, T::ONE]];

    /// Sensor values are already in the frames of the task.
    pub const IDENTITY: Self = Self { force: Self::UNIT, torque: Self::UNIT, lever: [T::ZERO; 3] };

    /// `J_sensor^T e`: generalised force on the ten task rows.
    #[inline]
    pub fn to_task(&self, e: &[T; SENSORS]) -> [T; COUPLED_ROWS] {
        let [fx, fy, fz, tx, ty, tz, f1, f2, f3] = *e;
        let (force, torque) = ([fx, fy, fz], [tx, ty, tz]);
        let moment = cross(&self.lever, &force);
        let at_point = core::array::from_fn(|i| torque[i] - moment[i]);
        let [px, py, pz] = rotate(&self.force, &force);
        let [rx, ry, rz] = rotate(&self.torque, &at_point);
        [px, py, pz, rx, ry, rz, T::ZERO, f1, f2, f3]
    }
}

/// Stiffnesses that the clamps of Eq. (8) are relative to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness<T> {
    /// `K` of the position rows.
    pub position: T,
    /// `K_o` of the orientation rows.
    pub orientation: T,
    /// `K` of the hand rows.
    pub hand: T,
    /// Kind of orientation error.
    pub orientation_error: OrientationError,
}

impl<T: Scalar> Feedback<T> {
    /// With sensitivity `K1` per task row, weight `K2` per sensor, and limits.
    ///
    /// # Errors
    /// [`TableError::Negative`] for a negative gain or limit, [`TableError::TooLarge`] for one beyond [`bounds`] or a
    /// rotation limit above pi, [`TableError::NotFinite`] for a limit that is not a number.
    pub fn new(
        sensitivity: GainSchedule<T, COUPLED_ROWS>,
        weight: GainSchedule<T, SENSORS>,
        limits: Limits<T>,
    ) -> Result<Self, TableError> {
        let feedback = Self { sensitivity, weight, limits };
        feedback.check()?;
        Ok(feedback)
    }

    fn check(&self) -> Result<(), TableError> {
        let Limits { displacement, rotation, hand } = self.limits;
        if !(displacement.is_finite() && rotation.is_finite() && hand.is_finite()) {
            return Err(TableError::NotFinite);
        }
        let gains = self.sensitivity.samples().iter().flatten();
        if gains
            .chain(self.weight.samples().iter().flatten())
            .chain(&[displacement, rotation, hand])
            .any(|&value| value < T::ZERO)
        {
            return Err(TableError::Negative);
        }
        let limits = [
            (displacement, bounds::LARGEST_DISPLACEMENT, Entry::Displacement),
            // Pi as somebody else may have rounded it.
            (rotation, core::f64::consts::PI + 1e-6, Entry::Rotation),
            (hand, bounds::LARGEST_HAND_DISPLACEMENT + 1e-6, Entry::Hand),
        ];
        let limit = limits.into_iter().find(|(value, largest, _)| *value > T::from_f64(*largest));
        if let Some((_, _, entry)) = limit {
            return Err(TableError::TooLarge(entry));
        }
        if let Some((point, column)) = self.sensitivity.first_beyond(bounds::LARGEST_FEEDBACK_GAIN) {
            return Err(TableError::TooLarge(Entry::Sensitivity { point, column }));
        }
        if let Some((point, column)) = self.weight.first_beyond(bounds::LARGEST_FEEDBACK_GAIN) {
            return Err(TableError::TooLarge(Entry::SensorWeight { point, column }));
        }
        Ok(())
    }

    /// Stands for feedback that is not there; never leaves this crate.
    pub(crate) const EMPTY: Self = Self {
        sensitivity: PhaseTable::EMPTY,
        weight: PhaseTable::EMPTY,
        limits: Limits { displacement: T::ZERO, rotation: T::ZERO, hand: T::ZERO },
    };

    /// As [`Feedback::new`], in place: `K1` and `K2` point after point. After an error it is empty.
    pub(crate) fn assign(
        &mut self,
        sensitivity: impl IntoIterator<Item = T>,
        weight: impl IntoIterator<Item = T>,
        limits: Limits<T>,
    ) -> Result<(), TableError> {
        self.limits = limits;
        let filled = self.sensitivity.assign(sensitivity).and_then(|()| self.weight.assign(weight));
        let result = filled.and_then(|()| self.check());
        if result.is_err() {
            self.clear();
        }
        result
    }

    pub(crate) fn copy_from(&mut self, other: &Self) {
        self.sensitivity.copy_from(&other.sensitivity);
        self.weight.copy_from(&other.weight);
        self.limits = other.limits;
    }

    pub(crate) fn clear(&mut self) {
        self.sensitivity.clear();
        self.weight.clear();
        self.limits = Self::EMPTY.limits;
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.sensitivity.samples().is_empty()
    }

    /// Sensitivity `K1` over the phase.
    pub fn sensitivity(&self) -> &GainSchedule<T, COUPLED_ROWS> {
        &self.sensitivity
    }

    /// Weight `K2` over the phase.
    pub fn weight(&self) -> &GainSchedule<T, SENSORS> {
        &self.weight
    }

    /// Limits.
    pub fn limits(&self) -> &Limits<T> {
        &self.limits
    }

    /// `zeta` at progress `u` for the error `F - F_expected`, clamped. A value that is not a number counts as 0.
    pub fn coupling(&self, u: T, error: &[T; SENSORS], map: &SensorMap<T>, stiffness: &Stiffness<T>) -> Coupling<T> {
        let (k1, k2) = (self.sensitivity.at(u), self.weight.at(u));
        let task = map.to_task(&core::array::from_fn(|i| k2[i] * error[i]));
        let zeta: [T; COUPLED_ROWS] = core::array::from_fn(|i| k1[i] * task[i]);
        let largest_rotation = match stiffness.orientation_error {
            OrientationError::Quaternion => {
                T::sin_cos(self.limits.rotation * T::from_f64(0.5)).0 * stiffness.orientation
            }
            OrientationError::RotationVector => self.limits.rotation * stiffness.orientation,
        };
        let [px, py, pz, rx, ry, rz, hand @ ..] = zeta;
        Coupling {
            position: clamp_norm(&[px, py, pz], self.limits.displacement * stiffness.position),
            orientation: clamp_norm(&[rx, ry, rz], largest_rotation),
            hand: hand.map(|zeta| clamp(zeta, self.limits.hand * stiffness.hand)),
        }
    }
}
