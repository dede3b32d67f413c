//! A look at an arm that stands: the cycles of a fifth of a second.

use std::time::Duration;

use control::flags;
use link::Telemetry;

use super::ProcedureError;
use crate::client::{Client, Incoming};
use crate::device::Device;

/// Control cycles that are looked at: 0.2 s.
const CYCLES: usize = 60;

/// A joint that wanders farther than this meanwhile is moving (rad). Two counts of the motors are 0.3 to 0.6 mrad.
const STILL: f64 = 2e-3;

/// Longest time until these cycles have arrived.
const TIMEOUT: Duration = Duration::from_secs(5);

/// Complete cycles over 0.2 s of an arm that stands, or of a hand alone that does.
///
/// # Errors
/// [`ProcedureError::Moves`], [`ProcedureError::HandMoves`], [`ProcedureError::NotReady`] if its positions are not
/// told, and as [`Client::request`].
pub(super) fn at_rest(client: &mut Client<Device>) -> Result<Vec<Telemetry>, ProcedureError> {
    client.set_telemetry(1)?;
    let cycles = watch(client);
    client.set_telemetry(0)?;
    cycles
}

/// Mean of a quantity over the cycles.
pub(super) fn mean<const N: usize>(cycles: &[Telemetry], of: impl Fn(&Telemetry) -> [f32; N]) -> [f64; N] {
    let sum = cycles.iter().fold([0.0; N], |sum, cycle| {
        let values = of(cycle);
        std::array::from_fn(|index| sum[index] + f64::from(values[index]))
    });
    sum.map(|sum| sum / cycles.len() as f64)
}

fn watch(client: &mut Client<Device>) -> Result<Vec<Telemetry>, ProcedureError> {
    let deadline = client.now() + TIMEOUT;
    let is_arm = client.hello().capabilities.arm;
    let told = if is_arm { flags::POSITIONS_KNOWN } else { flags::HAND_READY };
    let mut cycles: Vec<Telemetry> = Vec::with_capacity(CYCLES);
    while cycles.len() < CYCLES {
        if client.now() > deadline {
            return Err(ProcedureError::NotReady("it does not tell where it stands".to_owned()));
        }
        let Some(Incoming::Telemetry(cycle)) = client.next(Duration::from_millis(50))? else { continue };
        if cycle.flags & told != 0 && cycle.lost_replies == 0 {
            cycles.push(cycle);
        }
    }
    if is_arm {
        wandering(&cycles, |cycle| cycle.q).map_or(Ok(cycles), |joint| Err(ProcedureError::Moves { joint }))
    } else {
        wandering(&cycles, |cycle| cycle.hand).map_or(Ok(cycles), |digit| Err(ProcedureError::HandMoves { digit }))
    }
}

/// The first of the angles that does not stand.
fn wandering<const N: usize>(cycles: &[Telemetry], of: impl Fn(&Telemetry) -> [f32; N]) -> Option<usize> {
    (0..N).find(|index| {
        let angles = cycles.iter().map(|cycle| f64::from(of(cycle)[*index]));
        let (least, most) =
            angles.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), q| (least.min(q), most.max(q)));
        most - least > STILL
    })
}
