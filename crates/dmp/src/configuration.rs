//! `Configuration` and `Velocity`: one value for each row of a primitive, in the units of the world.

use crate::vector::all_finite;
use crate::{Group, Quaternion, Scalar, bounds};

/// Position and orientation of one end-effector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Pose<T> {
    /// Position in the world frame, m.
    pub position: [T; 3],
    /// Orientation, body -> world.
    pub orientation: Quaternion<T>,
}

impl<T: Scalar> Pose<T> {
    /// At the origin, not turned.
    pub const IDENTITY: Self = Self { position: [T::ZERO; 3], orientation: Quaternion::IDENTITY };
}

/// Linear and angular velocity of one end-effector.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Twist<T> {
    /// Linear velocity in the world frame, m/s.
    pub linear: [T; 3],
    /// Angular velocity in the BODY frame, rad/s.
    pub angular: [T; 3],
}

impl<T: Scalar> Twist<T> {
    /// At rest.
    pub const ZERO: Self = Self { linear: [T::ZERO; 3], angular: [T::ZERO; 3] };
}

/// A value for each row: `P` poses and `D` point rows (joint angles, rad, or anything else that is a number).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration<T, const D: usize, const P: usize> {
    /// Poses of the end-effectors.
    pub poses: [Pose<T>; P],
    /// Point rows.
    pub points: [T; D],
}

impl<T: Scalar, const D: usize, const P: usize> Configuration<T, D, P> {
    /// Every value 0, every orientation the identity.
    pub const ORIGIN: Self = Self { poses: [Pose::IDENTITY; P], points: [T::ZERO; D] };

    /// The same in another number type.
    #[must_use]
    pub fn cast<U: Scalar>(&self) -> Configuration<U, D, P> {
        let number = |value: T| U::from_f64(value.to_f64());
        Configuration {
            poses: self.poses.map(|pose| {
                let [w, x, y, z] = pose.orientation.to_array().map(number);
                Pose { position: pose.position.map(number), orientation: Quaternion::new(w, x, y, z) }
            }),
            points: self.points.map(number),
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        let finite = |pose: &Pose<T>| all_finite(&pose.position) && all_finite(&pose.orientation.to_array());
        self.poses.iter().all(finite) && all_finite(&self.points)
    }

    /// The first value that no movement needs, orientations apart.
    pub(crate) fn out_of_bounds(&self) -> Option<(Group, u8)> {
        let poses = self.poses.iter().enumerate().map(|(n, pose)| (Group::Position, 3 * n, pose.position.as_slice()));
        first_beyond(poses.chain([(Group::Points, 0, self.points.as_slice())]), T::from_f64(bounds::LARGEST_VALUE))
    }

    /// With the quaternions made exactly unit; `None` if one is off by more than 1e-3.
    pub(crate) fn normalised(&self) -> Option<Self> {
        let mut unit = *self;
        for pose in &mut unit.poses {
            pose.orientation = pose.orientation.checked_unit(T::from_f64(1e-3))?;
        }
        Some(unit)
    }
}

/// Physical velocities that belong to a [`Configuration`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity<T, const D: usize, const P: usize> {
    /// Of the poses.
    pub poses: [Twist<T>; P],
    /// Of the point rows, per second.
    pub points: [T; D],
}

impl<T: Scalar, const D: usize, const P: usize> Velocity<T, D, P> {
    /// At rest.
    pub const ZERO: Self = Self { poses: [Twist::ZERO; P], points: [T::ZERO; D] };

    /// The same in another number type.
    #[must_use]
    pub fn cast<U: Scalar>(&self) -> Velocity<U, D, P> {
        let number = |value: T| U::from_f64(value.to_f64());
        Velocity {
            poses: self
                .poses
                .map(|twist| Twist { linear: twist.linear.map(number), angular: twist.angular.map(number) }),
            points: self.points.map(number),
        }
    }

    pub(crate) fn is_finite(&self) -> bool {
        self.poses.iter().all(|twist| all_finite(&twist.linear) && all_finite(&twist.angular))
            && all_finite(&self.points)
    }

    /// The first value that no movement needs.
    pub(crate) fn out_of_bounds(&self) -> Option<(Group, u8)> {
        let poses = self.poses.iter().enumerate().flat_map(|(n, twist)| {
            [(Group::Position, 3 * n, twist.linear.as_slice()), (Group::Orientation, 3 * n, twist.angular.as_slice())]
        });
        first_beyond(poses.chain([(Group::Points, 0, self.points.as_slice())]), T::from_f64(bounds::LARGEST_SPEED))
    }
}

/// Group and place of the first value beyond `largest`; each item holds the place of its first value.
fn first_beyond<'a, T: Scalar>(
    mut values: impl Iterator<Item = (Group, usize, &'a [T])>,
    largest: T,
) -> Option<(Group, u8)> {
    values.find_map(|(group, first, values)| {
        let place = first + bounds::first_beyond(values, largest)?;
        Some((group, u8::try_from(place).unwrap_or(u8::MAX)))
    })
}
