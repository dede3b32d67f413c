//! From the pose a person says the arm has, to the counts its pucks shall show.
//!
//! `P_i = floor(CTS / 2 pi * (J2MP * home)_i)`.

use control::Calibration;
use puck::Counts;

use crate::calibration::reach;
use crate::command::Refusal;

/// The counts of the seven motors at `home` (rad).
///
/// # Errors
/// [`Refusal::HomeOutOfRange`] with the joint whose angle is not a number or out of reach, or whose motor would leave
/// the 22 bits of the bus.
pub(crate) fn home_counts(calibration: &Calibration<f32>, home: &[f32; 7]) -> Result<[Counts; 7], Refusal> {
    for (joint, angle) in (0_u8..).zip(home) {
        if !reach(joint.into()).contains(angle) {
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
