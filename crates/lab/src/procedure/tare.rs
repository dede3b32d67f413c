//! The zero of force sensor and strain gauges, taken when a person asks for it.
//!
//! The device takes a zero by itself at the first rest after start-up, and before each run as far as a sensor drifts.
//! It cannot know whether a larger force is an error of the sensor or something that the hand holds or touches: a
//! person can.

use link::Telemetry;
use schemars::JsonSchema;
use serde::Serialize;

use super::ProcedureError;
use super::rest::{at_rest, mean};
use crate::client::Client;
use crate::device::Device;

/// A larger force (N) at rest is no drift of the sensor, as the device judges it before a run: something hangs on the
/// hand, or touches it.
const LOAD: f64 = 1.0;

/// Readings of the sensors at rest, as the environment acts on the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Reading {
    /// Force on the hand in world axes, N.
    pub force_n: [f64; 3],
    /// Torque about the grasp point in hand axes, N m.
    pub torque_nm: [f64; 3],
    /// Torque on fingers F1 to F3, N m.
    pub gauges_nm: [f64; 3],
}

impl Reading {
    fn of(cycles: &[Telemetry]) -> Self {
        let wrench = mean(cycles, |cycle| cycle.wrench);
        Self {
            force_n: std::array::from_fn(|axis| wrench[axis]),
            torque_nm: std::array::from_fn(|axis| wrench[axis + 3]),
            gauges_nm: mean(cycles, |cycle| cycle.gauges),
        }
    }

    fn force(&self) -> f64 {
        let [x, y, z] = self.force_n;
        x.hypot(y).hypot(z)
    }
}

/// A zero that was taken.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Tared {
    /// Readings before; null where the wrench had no zero yet, so that they tell nothing.
    pub before: Option<Reading>,
    /// Readings with the new zero.
    pub after: Reading,
}

/// Takes the present readings of force sensor and gauges as zero. The arm has to stand. With `loaded` a force that is
/// more than the drift of a sensor becomes zero too. Nothing moves and nothing is stored.
///
/// # Errors
/// [`ProcedureError::Moves`], [`ProcedureError::Loaded`], and as [`Client::request`].
pub fn tare(client: &mut Client<Device>, loaded: bool) -> Result<Tared, ProcedureError> {
    let known = client.status()?.wrench_zeroed == Some(true);
    let before = Reading::of(&at_rest(client)?);
    if known && !loaded && before.force() > LOAD {
        return Err(ProcedureError::Loaded { force: before.force() });
    }
    client.tare()?;
    Ok(Tared { before: known.then_some(before), after: Reading::of(&at_rest(client)?) })
}
