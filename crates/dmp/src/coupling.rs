//! `Coupling` and `CouplingGains`: Eq. (8), the term by which measured forces bend the plan.
//!
//! `zeta = K1 J_sensor^T K2 (F - F_expected)`, F = wrench of the ENVIRONMENT ON THE ROBOT: an unexpected push along +x
//! moves the plan towards +x. `zeta` stands inside the right-hand side of Eqs. (9) and (6), so a constant one settles
//! at `x = g + zeta/K` and at the angle `2 asin(zeta_o/K_o)`. Beyond `zeta_o = K_o` there is no equilibrium and the
//! plan would spin, therefore `|zeta_p| <= K dx_max` and `|zeta_o| <= K_o sin(theta_max/2)`
//! ([`DisplacementLimits`], [`Primitive::limited_coupling`](crate::Primitive::limited_coupling)).
//!
//! Sensors and their Jacobian are the caller's: [`CouplingGains::zeta`] takes the map from sensors to rows as a
//! function.

use crate::vector::clamp;
use crate::{Entry, PhaseTable, Scalar, TableError, bounds};

/// Largest limit of a rotation (rad): pi as somebody else may have rounded it.
pub(crate) const LARGEST_ROTATION: f64 = core::f64::consts::PI + 1e-6;

/// `zeta` of one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseCoupling<T> {
    /// Position rows, world frame.
    pub position: [T; 3],
    /// Orientation rows, body frame.
    pub orientation: [T; 3],
}

impl<T: Scalar> PoseCoupling<T> {
    /// No coupling.
    pub const NONE: Self = Self { position: [T::ZERO; 3], orientation: [T::ZERO; 3] };
}

/// `zeta` of one tick, in the unit of the rows (m, rad) times the stiffness. Any row can have one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Coupling<T, const D: usize, const P: usize> {
    /// Of the poses.
    pub poses: [PoseCoupling<T>; P],
    /// Of the point rows.
    pub points: [T; D],
}

impl<T: Scalar, const D: usize, const P: usize> Coupling<T, D, P> {
    /// No coupling: the plan runs open loop.
    pub const NONE: Self = Self { poses: [PoseCoupling::NONE; P], points: [T::ZERO; D] };

    /// Every value through `f`.
    #[inline]
    #[must_use]
    pub fn map(&self, mut f: impl FnMut(T) -> T) -> Self {
        Self {
            poses: self.poses.map(|pose| PoseCoupling {
                position: pose.position.map(&mut f),
                orientation: pose.orientation.map(&mut f),
            }),
            points: self.points.map(&mut f),
        }
    }

    /// All values in the order of the weights: of each pose position and orientation, then the point rows.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &T> + Clone {
        self.poses.iter().flat_map(|pose| pose.position.iter().chain(&pose.orientation)).chain(&self.points)
    }

    /// True if no magnitude is above `least`. A NaN makes it false.
    #[inline]
    pub(crate) fn is_within(&self, least: T) -> bool {
        // No early end: without a branch the comparisons run in parallel.
        let within = |values: &[T]| values.iter().fold(true, |within, value| within & (value.abs() <= least));
        let poses = |all: bool, pose: &PoseCoupling<T>| all & within(&pose.position) & within(&pose.orientation);
        self.poses.iter().fold(true, poses) & within(&self.points)
    }

    /// Each value cut to its limit; one that is not a number counts as 0.
    #[cold]
    pub(crate) fn limited(&self, limits: &Self) -> Self {
        let pose = |n: usize| PoseCoupling {
            position: core::array::from_fn(|i| clamp(self.poses[n].position[i], limits.poses[n].position[i])),
            orientation: core::array::from_fn(|i| clamp(self.poses[n].orientation[i], limits.poses[n].orientation[i])),
        };
        Self {
            poses: core::array::from_fn(pose),
            points: core::array::from_fn(|i| clamp(self.points[i], limits.points[i])),
        }
    }
}

/// Largest displacement of one pose by a coupling in steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PoseLimits<T> {
    /// `dx_max`, m.
    pub displacement: T,
    /// `theta_max`, rad (0..pi).
    pub rotation: T,
}

/// Largest displacement of the plan by a coupling in steady state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DisplacementLimits<T, const D: usize, const P: usize> {
    /// Of the poses.
    pub poses: [PoseLimits<T>; P],
    /// Of each point row, in its unit.
    pub points: [T; D],
}

impl<T: Scalar, const D: usize, const P: usize> DisplacementLimits<T, D, P> {
    /// No displacement at all.
    pub const NONE: Self =
        Self { poses: [PoseLimits { displacement: T::ZERO, rotation: T::ZERO }; P], points: [T::ZERO; D] };

    /// Checks that the limits are numbers, not negative and within [`bounds`].
    ///
    /// # Errors
    /// [`TableError::NotFinite`], [`TableError::Negative`], [`TableError::TooLarge`], also for a rotation above pi.
    pub fn check(&self) -> Result<(), TableError> {
        let poses = self.poses.iter().flat_map(|pose| {
            [
                (pose.displacement, bounds::LARGEST_DISPLACEMENT, Entry::Displacement),
                (pose.rotation, LARGEST_ROTATION, Entry::Rotation),
            ]
        });
        let points = self
            .points
            .iter()
            .map(|limit| (*limit, bounds::LARGEST_POINT_DISPLACEMENT + 1e-6, Entry::PointDisplacement));
        let all = || poses.clone().chain(points.clone());
        if all().any(|(value, _, _)| !value.is_finite()) {
            return Err(TableError::NotFinite);
        }
        if all().any(|(value, _, _)| value < T::ZERO) {
            return Err(TableError::Negative);
        }
        match all().find(|(value, largest, _)| *value > T::from_f64(*largest)) {
            Some((_, _, entry)) => Err(TableError::TooLarge(entry)),
            None => Ok(()),
        }
    }
}

/// `K1` of `ROWS` coupled rows and `K2` of `SENSORS` sensors, each constant or by phase in up to `CAPACITY` samples.
///
/// `ROWS` are those rows that the sensors can bend, in an order of the caller's.
#[derive(Clone, Debug, PartialEq)]
pub struct CouplingGains<T, const ROWS: usize, const SENSORS: usize, const CAPACITY: usize> {
    sensitivity: PhaseTable<T, ROWS, CAPACITY>,
    weight: PhaseTable<T, SENSORS, CAPACITY>,
}

impl<T: Scalar, const ROWS: usize, const SENSORS: usize, const CAPACITY: usize>
    CouplingGains<T, ROWS, SENSORS, CAPACITY>
{
    /// With sensitivity `K1` per coupled row and weight `K2` per sensor.
    ///
    /// # Errors
    /// [`TableError::Negative`] for a negative gain, [`TableError::TooLarge`] for one beyond [`bounds`].
    pub fn new(
        sensitivity: PhaseTable<T, ROWS, CAPACITY>,
        weight: PhaseTable<T, SENSORS, CAPACITY>,
    ) -> Result<Self, TableError> {
        let gains = Self { sensitivity, weight };
        gains.check()?;
        Ok(gains)
    }

    fn check(&self) -> Result<(), TableError> {
        let gains = self.sensitivity.samples().iter().flatten().chain(self.weight.samples().iter().flatten());
        if gains.into_iter().any(|&value| value < T::ZERO) {
            return Err(TableError::Negative);
        }
        if let Some((point, column)) = self.sensitivity.first_beyond(bounds::LARGEST_COUPLING_GAIN) {
            return Err(TableError::TooLarge(Entry::Sensitivity { point, column }));
        }
        if let Some((point, column)) = self.weight.first_beyond(bounds::LARGEST_COUPLING_GAIN) {
            return Err(TableError::TooLarge(Entry::SensorWeight { point, column }));
        }
        Ok(())
    }

    /// No gains: for statics that are filled by [`assign`](Self::assign).
    pub const EMPTY: Self = Self { sensitivity: PhaseTable::EMPTY, weight: PhaseTable::EMPTY };

    /// As [`CouplingGains::new`], in place: `K1` and `K2` point after point.
    ///
    /// # Errors
    /// As [`CouplingGains::new`] and [`PhaseTable::assign`]; the gains are then empty.
    pub fn assign(
        &mut self,
        sensitivity: impl IntoIterator<Item = T>,
        weight: impl IntoIterator<Item = T>,
    ) -> Result<(), TableError> {
        let filled = self.sensitivity.assign(sensitivity).and_then(|()| self.weight.assign(weight));
        let result = filled.and_then(|()| self.check());
        if result.is_err() {
            self.clear();
        }
        result
    }

    /// Takes over the gains of others, and only what they hold.
    pub fn copy_from(&mut self, other: &Self) {
        self.sensitivity.copy_from(&other.sensitivity);
        self.weight.copy_from(&other.weight);
    }

    /// Forgets all gains.
    pub fn clear(&mut self) {
        self.sensitivity.clear();
        self.weight.clear();
    }

    /// True without gains.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.sensitivity.samples().is_empty()
    }

    /// Sensitivity `K1` over the phase.
    #[must_use]
    pub fn sensitivity(&self) -> &PhaseTable<T, ROWS, CAPACITY> {
        &self.sensitivity
    }

    /// Weight `K2` over the phase.
    #[must_use]
    pub fn weight(&self) -> &PhaseTable<T, SENSORS, CAPACITY> {
        &self.weight
    }

    /// `K1 J^T K2 e` at progress `u` for the error `e = F - F_expected`; `to_rows` is `J^T`.
    #[inline]
    #[must_use]
    pub fn zeta(&self, u: T, error: &[T; SENSORS], to_rows: impl FnOnce(&[T; SENSORS]) -> [T; ROWS]) -> [T; ROWS] {
        // Without an index: a loop that is not unrolled would check it.
        let (mut rows, mut weighted) = (self.sensitivity.at(u), self.weight.at(u));
        weighted.iter_mut().zip(error).for_each(|(weight, error)| *weight = *weight * *error);
        rows.iter_mut().zip(to_rows(&weighted)).for_each(|(row, force)| *row = *row * force);
        rows
    }
}
