//! The home of an arm, from where it says it stands and where it really stands.
//!
//! ```text
//! home' = z + (q_true - q_read)
//! ```
//! `z`: the posture at which the last zeroing took the arm to stand. An encoder that counts from a wrong zero is
//! wrong by the same angle everywhere, so the difference at any posture is that at home. With `z` in place of the
//! stored home the same measurement made twice gives the same home, also after the first was stored.

use super::ProcedureError;
use super::rest::{at_rest, mean};
use crate::client::Client;
use crate::device::Device;

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
    let cycles = at_rest(client)?;
    Ok(mean(&cycles, |cycle| cycle.q))
}
