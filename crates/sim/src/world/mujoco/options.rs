//! The set-up of a MuJoCo world.

use super::addresses::Addresses;
use super::error::WorldError;
use super::imperfections::Imperfections;
use super::scene::Scene;
use crate::{HOME, Held};

/// State of the world before the first step.
#[derive(Clone, Debug)]
pub struct MujocoOptions {
    /// Joint posture in which the arm starts, at rest, rad.
    pub posture: [f64; 7],
    /// Dry and viscous friction of the seven joints (wam7.toml); off makes an ideal drive.
    pub joint_friction: bool,
    /// Table and object.
    pub scene: Scene,
    /// Differences between the arm and its model.
    pub imperfections: Imperfections,
    /// Angle at which the inner finger joints are held until the hand is driven, rad: 0 is fully open, 2.44 fully
    /// closed.
    pub fingers: f64,
    /// Angle at which the spread is held until the hand is driven, rad: 0 puts F1 and F2 opposite to F3.
    pub spread: f64,
    /// A weight in the hand.
    pub held: Option<Held>,
    /// Gravity along world z, m/s^2.
    pub gravity: f64,
}

impl Default for MujocoOptions {
    /// At home, with friction, the nominal arm, the small torch on the table, fingers open at 0.25 rad, gravity -9.81
    /// m/s^2.
    fn default() -> Self {
        Self {
            posture: HOME,
            joint_friction: true,
            scene: Scene::default(),
            imperfections: Imperfections::NONE,
            fingers: 0.25,
            spread: 0.0,
            held: None,
            gravity: -9.81,
        }
    }
}

/// Refuses what cannot be simulated.
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
