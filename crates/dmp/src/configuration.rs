//! `Configuration` and `Velocity`: one value for each row of a primitive, in the units of the world.

use crate::vector::all_finite;
use crate::{HAND_ROWS, ORIENTATION_ROWS, POSITION_ROWS, POSTURE_ROWS, Quaternion, Row, Scalar, bounds};

/// A full set of values: pose of the end-effector, posture, hand.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Configuration<T> {
    /// Position of the end-effector in the world frame, m.
    pub position: [T; POSITION_ROWS],
    /// Orientation of the end-effector, body -> world.
    pub orientation: Quaternion<T>,
    /// Default posture, rad.
    pub posture: [T; POSTURE_ROWS],
    /// Hand joints (spread, F1, F2, F3), rad.
    pub hand: [T; HAND_ROWS],
}

impl<T: Scalar> Configuration<T> {
    pub(crate) fn is_finite(&self) -> bool {
        all_finite(&self.position)
            && all_finite(&self.orientation.to_array())
            && all_finite(&self.posture)
            && all_finite(&self.hand)
    }

    /// The first value that no movement needs, orientations apart.
    pub(crate) fn out_of_bounds(&self) -> Option<(Row, u8)> {
        first_out_of_bounds(
            [(Row::Position, &self.position), (Row::Posture, &self.posture), (Row::Hand, &self.hand)],
            bounds::LARGEST_VALUE,
        )
    }

    /// With the quaternion made exactly unit; `None` if it is off by more than 1e-3.
    pub(crate) fn normalised(&self) -> Option<Self> {
        let orientation = self.orientation.checked_unit(T::from_f64(1e-3))?;
        Some(Self { orientation, ..*self })
    }
}

/// Physical velocities that belong to a [`Configuration`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Velocity<T> {
    /// Linear velocity in the world frame, m/s.
    pub position: [T; POSITION_ROWS],
    /// Angular velocity in the BODY frame, rad/s.
    pub orientation: [T; ORIENTATION_ROWS],
    /// Posture velocity, rad/s.
    pub posture: [T; POSTURE_ROWS],
    /// Hand velocity, rad/s.
    pub hand: [T; HAND_ROWS],
}

impl<T: Scalar> Velocity<T> {
    /// At rest.
    pub const ZERO: Self = Self {
        position: [T::ZERO; POSITION_ROWS],
        orientation: [T::ZERO; ORIENTATION_ROWS],
        posture: [T::ZERO; POSTURE_ROWS],
        hand: [T::ZERO; HAND_ROWS],
    };

    pub(crate) fn is_finite(&self) -> bool {
        all_finite(&self.position)
            && all_finite(&self.orientation)
            && all_finite(&self.posture)
            && all_finite(&self.hand)
    }

    /// The first value that no movement needs.
    pub(crate) fn out_of_bounds(&self) -> Option<(Row, u8)> {
        first_out_of_bounds(
            [
                (Row::Position, &self.position),
                (Row::Orientation, &self.orientation),
                (Row::Posture, &self.posture),
                (Row::Hand, &self.hand),
            ],
            bounds::LARGEST_SPEED,
        )
    }
}

/// Group and place of the first value beyond `largest`.
fn first_out_of_bounds<T: Scalar, const G: usize>(groups: [(Row, &[T]); G], largest: f64) -> Option<(Row, u8)> {
    groups.into_iter().find_map(|(row, values)| {
        let place = bounds::first_beyond(values, largest)?;
        Some((row, u8::try_from(place).unwrap_or(u8::MAX)))
    })
}
