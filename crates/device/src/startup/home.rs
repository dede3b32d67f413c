//! From the pose a person says the arm has, to the counts its pucks shall show; and from counts to a pose that can be.
//!
//! `P_i = floor(CTS / 2 pi * (J2MP * home)_i)`.

use control::{Calibration, model};
use puck::Counts;

use crate::calibration::reach;
use crate::command::Refusal;

/// Distance beyond its stop (rad) at which no joint of a zeroed arm stands: four times as far as one may be at home.
const BEYOND: f64 = 0.2;

/// The first joint, 1 to 7, that stands beyond its stops by these counts: then they do not count from a home.
pub(crate) fn beyond_stops(calibration: &Calibration<f32>, counts: &[Counts; 7]) -> Option<u8> {
    let motors = calibration.drives().motor_angles::<f32>(counts);
    let joints = calibration.transmission().joint_from_motor(&motors);
    let stops = model::POSITION_MIN.iter().zip(&model::POSITION_MAX);
    let is_beyond =
        |(angle, (least, most)): (f32, (&f64, &f64))| !(least - BEYOND..=most + BEYOND).contains(&f64::from(angle));
    (1..).zip(joints.into_iter().zip(stops)).find(|(_, joint)| is_beyond(*joint)).map(|(number, _)| number)
}

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
