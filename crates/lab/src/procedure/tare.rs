//! The zero of force sensor and strain gauges, taken when a person asks for it.
//!
//! The device takes a zero by itself at the first rest after start-up, and before each run as far as a sensor drifts.
//! It cannot know whether a larger force is an error of the sensor or something that the hand holds or touches: a
//! person can.

use control::flags;
use link::{HandStage, Status, Telemetry};
use schemars::JsonSchema;
use serde::Serialize;

use super::ProcedureError;
use super::rest::{at_rest, mean};
use crate::client::Client;
use crate::device::Device;

/// A larger force (N) at rest is no drift of the sensor, as the device judges it before a run: something hangs on the
/// hand, or touches it.
const LOAD: f64 = 1.0;

/// A larger torque (N m) on a finger at rest is no drift of its gauge, as the device judges it before a run: the hand
/// grips something. Asked of a hand alone; of one on an arm the force sensor tells.
const GRIP: f64 = 0.05;

/// Readings of the sensors at rest, as the environment acts on the robot.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct Reading {
    /// Force on the hand in world axes, N; null without a force sensor.
    pub force_n: Option<[f64; 3]>,
    /// Torque about the grasp point in hand axes, N m; null without a force sensor.
    pub torque_nm: Option<[f64; 3]>,
    /// Torque on fingers F1 to F3, N m; null without an initialised hand.
    pub gauges_nm: Option<[f64; 3]>,
}

/// Sensors that a device has.
#[derive(Debug, Clone, Copy)]
struct Sensors {
    wrist: bool,
    fingers: bool,
}

impl Sensors {
    fn of(status: &Status) -> Self {
        Self { wrist: status.wrench_zeroed.is_some(), fingers: status.hand_stage == HandStage::Ready }
    }

    fn read(self, cycles: &[Telemetry]) -> Reading {
        let wrench = self.wrist.then(|| mean(cycles, |cycle| cycle.wrench));
        Reading {
            force_n: wrench.map(|wrench| std::array::from_fn(|axis| wrench[axis])),
            torque_nm: wrench.map(|wrench| std::array::from_fn(|axis| wrench[axis + 3])),
            gauges_nm: self.fingers.then(|| mean(cycles, |cycle| cycle.gauges)),
        }
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

/// Takes the present readings of force sensor and gauges as zero, or of those of them that the device has. Arm and hand
/// have to stand. With `loaded` what is more than the drift of a sensor becomes zero too. Nothing moves and nothing is
/// stored. `taken` hears that the device has taken the zero: what fails behind that fails to show it.
///
/// # Errors
/// [`ProcedureError::NothingToTare`], [`ProcedureError::Moves`], [`ProcedureError::HandMoves`],
/// [`ProcedureError::Loaded`], [`ProcedureError::Grips`], and as [`Client::request`].
pub fn tare(client: &mut Client<Device>, loaded: bool, taken: impl FnOnce()) -> Result<Tared, ProcedureError> {
    let status = client.status()?;
    let sensors = Sensors::of(&status);
    if !sensors.wrist && !sensors.fingers {
        return Err(ProcedureError::NothingToTare { hand: status.hand_stage });
    }
    let cycles = at_rest(client)?;
    let before = sensors.read(&cycles);
    let known = status.wrench_zeroed != Some(false);
    if let Some([x, y, z]) = before.force_n.filter(|_| known && !loaded) {
        let force = x.hypot(y).hypot(z);
        if force > LOAD {
            return Err(ProcedureError::Loaded { force });
        }
    }
    let had_zero = cycles.iter().all(|cycle| cycle.flags & flags::TARED != 0);
    if let Some(gauges) = before.gauges_nm.filter(|_| !client.hello().capabilities.arm && had_zero && !loaded)
        && let Some(finger) = (0..gauges.len()).find(|finger| gauges[*finger].abs() > GRIP)
    {
        return Err(ProcedureError::Grips { finger, torque: gauges[finger] });
    }
    client.tare()?;
    taken();
    Ok(Tared { before: known.then_some(before), after: sensors.read(&at_rest(client)?) })
}
