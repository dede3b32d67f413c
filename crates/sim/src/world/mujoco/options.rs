//! How a MuJoCo world is set up, and why it could not be.

use super::addresses::Addresses;
use super::imperfections::Imperfections;
use super::scene::Scene;
use crate::HOME;

/// How the world is set up before the first step.
#[derive(Clone, Debug)]
pub struct MujocoOptions {
    /// Joint posture in which the arm starts, at rest, rad.
    pub posture: [f64; 7],
    /// Dry and viscous friction of the seven joints (wam7.toml); off makes an ideal drive.
    pub joint_friction: bool,
    /// Table and object.
    pub scene: Scene,
    /// How the arm differs from its model.
    pub imperfections: Imperfections,
    /// Angle at which the inner finger joints are held until the hand is driven, rad: 0 is fully open, 2.44 fully closed.
    pub fingers: f64,
    /// Angle at which the spread is held until the hand is driven, rad: 0 puts F1 and F2 opposite to F3.
    pub spread: f64,
    /// Gravity along world z, m/s^2.
    pub gravity: f64,
}

impl Default for MujocoOptions {
    /// At home, with friction, the nominal arm, the small torch on the table, fingers open at 0.25 rad, gravity -9.81 m/s^2.
    fn default() -> Self {
        Self {
            posture: HOME,
            joint_friction: true,
            scene: Scene::default(),
            imperfections: Imperfections::NONE,
            fingers: 0.25,
            spread: 0.0,
            gravity: -9.81,
        }
    }
}

/// Why a MuJoCo world or its kinematics could not be set up.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// MuJoCo did not take the model: the library does not fit to this program.
    #[error("MuJoCo refuses the arm model: {0}")]
    Model(String),
    /// The model lacks a part that this program looks up by name.
    #[error("the arm model has no {kind} named `{name}`")]
    Missing {
        /// Kind of the part.
        kind: &'static str,
        /// Name looked for.
        name: String,
    },
    /// A starting joint angle is not a number within the joint's range.
    #[error("joint {joint} cannot start at {angle} rad: its range is {low} .. {high} rad")]
    Posture {
        /// Joint, 1 to 7.
        joint: usize,
        /// Angle asked for, rad.
        angle: f64,
        /// Lower end of its range, rad.
        low: f64,
        /// Upper end of its range, rad.
        high: f64,
    },
    /// The object would stand beside the table.
    #[error("the object cannot be at ({x}, {y}) m: that is not on the table")]
    OffTable {
        /// World x, m.
        x: f64,
        /// World y, m.
        y: f64,
    },
    /// A finger or spread angle, gravity, or a figure of the object or of an imperfection is not a usable number.
    #[error("{what} cannot be {value}")]
    OutOfRange {
        /// What is out of range.
        what: &'static str,
        /// The value asked for.
        value: f64,
    },
}

/// Parse, do not validate: whatever passes here can be simulated.
pub(super) fn check(options: &MujocoOptions, addresses: &Addresses) -> Result<(), WorldError> {
    for (i, (&angle, [low, high])) in options.posture.iter().zip(addresses.ranges).enumerate() {
        if !(low..=high).contains(&angle) {
            return Err(WorldError::Posture { joint: i + 1, angle, low, high });
        }
    }
    options.scene.check()?;
    options.imperfections.check()?;
    for (what, value, [low, high]) in [
        ("the finger angle", options.fingers, addresses.finger_range),
        ("the spread angle", options.spread, addresses.spread_range),
    ] {
        if !(low..=high).contains(&value) {
            return Err(WorldError::OutOfRange { what, value });
        }
    }
    if !options.gravity.is_finite() {
        return Err(WorldError::OutOfRange { what: "gravity", value: options.gravity });
    }
    Ok(())
}
