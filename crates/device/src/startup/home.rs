//! From the pose a person says the arm has, to the counts its pucks shall show.
//!
//! `P_i = floor(CTS / 2 pi * (J2MP * home)_i)`.

use control::{Calibration, model};
use puck::Counts;

use crate::command::Refusal;

/// How far beyond the joint's range a home pose may lie, rad: home is at the stops, and stops are where cables stretch.
const MARGIN: f32 = 0.05;

/// The counts of the seven motors at `home` (rad).
///
/// # Errors
/// [`Refusal::HomeOutOfRange`] with the joint whose angle is not a number or out of reach, or whose motor would leave the
/// 22 bits of the bus.
pub(crate) fn home_counts(calibration: &Calibration<f32>, home: &[f32; 7]) -> Result<[Counts; 7], Refusal> {
    let limits = model::POSITION_MIN.into_iter().zip(model::POSITION_MAX);
    for (joint, (angle, (least, most))) in (0_u8..).zip(home.iter().zip(limits)) {
        let range = least as f32 - MARGIN..=most as f32 + MARGIN;
        if !range.contains(angle) {
            return Err(Refusal::HomeOutOfRange { joint });
        }
    }
    let motor = calibration.transmission().motor_from_joint(home);
    // The angles are finite by the check above.
    let counts = calibration.drives().counts(&motor).map_err(|_| Refusal::HomeOutOfRange { joint: 0 })?;
    for (joint, count) in (0_u8..).zip(counts) {
        if count.wrapped() != count {
            return Err(Refusal::HomeOutOfRange { joint });
        }
    }
    Ok(counts)
}
