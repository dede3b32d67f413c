//! `Gains` and `Stiffness`: spring and damper of every row, as plain numbers.

use crate::{Coupling, Group, OrientationError, PoseCoupling, PrimitiveError, Scalar, TransformationSystem};

/// Stiffness K and damping D of a row, Eq. (1), or of three rows of a pose: dimensionless.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Gain<T> {
    /// Stiffness K.
    pub stiffness: T,
    /// Damping D.
    pub damping: T,
}

/// Gains of one pose.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct PoseGains<T> {
    /// Of the position.
    pub position: Gain<T>,
    /// Of the orientation.
    pub orientation: Gain<T>,
}

/// Gains of all rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains<T, const D: usize, const P: usize> {
    /// Of the poses.
    pub poses: [PoseGains<T>; P],
    /// Of each point row.
    pub points: [Gain<T>; D],
}

/// Stiffness of all rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness<T, const D: usize, const P: usize> {
    /// Of position and orientation of each pose.
    pub poses: [[T; 2]; P],
    /// Of each point row.
    pub points: [T; D],
}

impl<T: Scalar, const D: usize, const P: usize> Stiffness<T, D, P> {
    /// The same for all rows.
    #[must_use]
    pub fn uniform(stiffness: T) -> Self {
        Self { poses: [[stiffness; 2]; P], points: [stiffness; D] }
    }
}

impl<T: Scalar, const D: usize, const P: usize> Gains<T, D, P> {
    /// Damping without overshoot: `D = 2 sqrt(K)`, of an orientation by
    /// [`OrientationError::critical_damping`].
    #[must_use]
    pub fn critically_damped(stiffness: &Stiffness<T, D, P>, error: OrientationError) -> Self {
        let linear = |stiffness: T| {
            let root = T::sqrt(stiffness);
            Gain { stiffness, damping: root + root }
        };
        let angular = |stiffness: T| Gain { stiffness, damping: error.critical_damping(stiffness) };
        Self {
            poses: stiffness.poses.map(|[k, k_o]| PoseGains { position: linear(k), orientation: angular(k_o) }),
            points: stiffness.points.map(linear),
        }
    }

    /// The same in another number type.
    #[must_use]
    pub fn cast<U: Scalar>(&self) -> Gains<U, D, P> {
        let number = |value: T| U::from_f64(value.to_f64());
        let gain = |gain: Gain<T>| Gain { stiffness: number(gain.stiffness), damping: number(gain.damping) };
        Gains {
            poses: self
                .poses
                .map(|pose| PoseGains { position: gain(pose.position), orientation: gain(pose.orientation) }),
            points: self.points.map(gain),
        }
    }

    /// All gains: of each pose position and orientation, then the point rows.
    pub(crate) fn iter(&self) -> impl Iterator<Item = &Gain<T>> {
        self.poses.iter().flat_map(|pose| [&pose.position, &pose.orientation]).chain(&self.points)
    }
}

/// Checked springs and dampers of all rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Systems<T, const D: usize, const P: usize> {
    /// Of position and orientation of each pose.
    pub(crate) poses: [[TransformationSystem<T>; 2]; P],
    pub(crate) points: [TransformationSystem<T>; D],
}

impl<T: Scalar, const D: usize, const P: usize> Systems<T, D, P> {
    /// Unit gains, for what rests.
    pub(crate) const UNIT: Self =
        Self { poses: [[TransformationSystem::UNIT; 2]; P], points: [TransformationSystem::UNIT; D] };

    pub(crate) fn new(gains: &Gains<T, D, P>) -> Result<Self, PrimitiveError> {
        let system = |group: Group, place: usize, gain: &Gain<T>| {
            TransformationSystem::new(gain.stiffness, gain.damping).map_err(|error| {
                let index = u8::try_from(place).unwrap_or(u8::MAX);
                PrimitiveError::Gains { group, index, error }
            })
        };
        let mut systems = Self::UNIT;
        for (n, (to, gains)) in systems.poses.iter_mut().zip(&gains.poses).enumerate() {
            *to = [
                system(Group::Position, 3 * n, &gains.position)?,
                system(Group::Orientation, 3 * n, &gains.orientation)?,
            ];
        }
        for (i, (to, gain)) in systems.points.iter_mut().zip(&gains.points).enumerate() {
            *to = system(Group::Points, i, gain)?;
        }
        Ok(systems)
    }

    /// All of them with group and place of their first row.
    pub(crate) fn iter(&self) -> impl Iterator<Item = (Group, u8, &TransformationSystem<T>)> {
        let number = |place: usize| u8::try_from(place).unwrap_or(u8::MAX);
        let poses = self.poses.iter().enumerate().flat_map(move |(n, [position, orientation])| {
            [(Group::Position, number(3 * n), position), (Group::Orientation, number(3 * n), orientation)]
        });
        poses.chain(self.points.iter().enumerate().map(move |(i, system)| (Group::Points, number(i), system)))
    }

    /// A value for each row.
    pub(crate) fn each_row(&self, value: impl Fn(&TransformationSystem<T>) -> T) -> Coupling<T, D, P> {
        Coupling {
            poses: self.poses.map(|[position, orientation]| PoseCoupling {
                position: [value(&position); 3],
                orientation: [value(&orientation); 3],
            }),
            points: self.points.map(|system| value(&system)),
        }
    }
}
