//! The home of an arm, from where it says it stands and where it really stands.
//!
//! ```text
//! home' = z + (q_true - q_read)
//! ```
//! `z`: the posture at which the last zeroing took the arm to stand. An encoder that counts from a wrong zero is
//! wrong by the same angle everywhere, so the difference at any posture is that at home. With `z` in place of the
//! stored home the same measurement made twice gives the same home, also after the first was stored.

use std::time::Duration;

use control::flags;

use super::ProcedureError;
use crate::client::{Client, Incoming};
use crate::device::Device;

/// Control cycles over which the posture is averaged: 0.2 s.
const CYCLES: usize = 60;

/// A joint that wanders farther than this meanwhile is moving (rad). Two counts of the motors are 0.3 to 0.6 mrad.
const STILL: f64 = 2e-3;

/// Longest time until these cycles have arrived.
const TIMEOUT: Duration = Duration::from_secs(5);

/// A home corrected by a measurement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HomeCorrection {
    /// Where the last zeroing took the arm to stand, rad.
    pub zeroed_at: [f32; 7],
    /// Where the arm says it stands, rad.
    pub read: [f64; 7],
    /// Where it really stands, rad.
    pub truth: [f64; 7],
    /// The home that follows, rad.
    pub home: [f32; 7],
}

/// Measures where the arm says it stands, and corrects its home by what is known better. Nothing moves and nothing is
/// stored.
///
/// # Errors
/// [`ProcedureError::NotZeroed`], [`ProcedureError::ZeroOfOthers`], [`ProcedureError::Moves`], and as
/// [`Client::request`].
pub fn correct_home(client: &mut Client<Device>, truth: [f64; 7]) -> Result<HomeCorrection, ProcedureError> {
    if !client.status()?.zeroed {
        return Err(ProcedureError::NotZeroed);
    }
    let zeroed_at = client.calibration()?.zeroed_at.ok_or(ProcedureError::ZeroOfOthers)?;
    let read = resting_posture(client)?;
    let home = std::array::from_fn(|joint| (f64::from(zeroed_at[joint]) + truth[joint] - read[joint]) as f32);
    Ok(HomeCorrection { zeroed_at, read, truth, home })
}

/// Mean joint angles over 0.2 s of an arm that stands, rad.
fn resting_posture(client: &mut Client<Device>) -> Result<[f64; 7], ProcedureError> {
    client.set_telemetry(1)?;
    let posture = watch(client);
    client.set_telemetry(0)?;
    posture
}

fn watch(client: &mut Client<Device>) -> Result<[f64; 7], ProcedureError> {
    let deadline = client.now() + TIMEOUT;
    let (mut sum, mut least, mut most) = ([0.0; 7], [f64::INFINITY; 7], [f64::NEG_INFINITY; 7]);
    let mut seen = 0;
    while seen < CYCLES {
        if client.now() > deadline {
            return Err(ProcedureError::NotReady("it does not tell where its joints are".to_owned()));
        }
        let Some(Incoming::Telemetry(cycle)) = client.next(Duration::from_millis(50))? else { continue };
        if cycle.flags & flags::POSITIONS_KNOWN == 0 || cycle.lost_replies > 0 {
            continue;
        }
        for (joint, q) in cycle.q.into_iter().map(f64::from).enumerate() {
            sum[joint] += q;
            least[joint] = least[joint].min(q);
            most[joint] = most[joint].max(q);
        }
        seen += 1;
    }
    match (0..7).find(|joint| most[*joint] - least[*joint] > STILL) {
        Some(joint) => Err(ProcedureError::Moves { joint }),
        None => Ok(sum.map(|sum| sum / CYCLES as f64)),
    }
}
