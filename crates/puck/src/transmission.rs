//! Joint space <-> motor space <-> bus units of the seven-joint arm.
//!
//! ```text
//! M1 = -N1 J1                       M4 = -N4 J4
//! M2 =  N2 J2 - (N3/n3) J3          M5 =  N5 J5 - N6 n6 J6
//! M3 = -N2 J2 - (N3/n3) J3          M6 =  N5 J5 + N6 n6 J6          M7 = -N7 J7
//! ```
//!
//! Torques go the other way through the transpose: power is the same on both sides. Two differentials couple M2 with M3
//! and M5 with M6, so a limit per joint is no limit per motor.

use core::fmt;

use crate::units::{Counts, NotFinite, PuckTorque, Real};

/// Joints (and motors) of the arm.
pub const JOINTS: usize = 7;

/// Gear ratios. N5 and N6 depend on the wrist's cable generation (9.48, 9.68 and 9.7 are documented): configure them.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct Ratios {
    /// N1, N2, N3/n3, N4, N5, N6 n6, N7: the coefficients of the matrix above, all positive.
    pub coefficients: [f64; JOINTS],
}

impl Ratios {
    /// Barrett's configuration of 2018 for the seven-joint WAM. It rounds N3/n3 = 28.25/1.68 to four decimals.
    pub const WAM7: Ratios = Ratios { coefficients: [42.0, 28.25, 16.8155, 18.0, 9.7, 9.7, 14.93] };

    /// From N1..N7 and the ratios of the two differentials, as Barrett's manual lists them.
    #[must_use]
    pub const fn from_gears(gears: [f64; JOINTS], shoulder_differential: f64, wrist_differential: f64) -> Ratios {
        let [n1, n2, n3, n4, n5, n6, n7] = gears;
        Ratios { coefficients: [n1, n2, n3 / shoulder_differential, n4, n5, n6 * wrist_differential, n7] }
    }
}

/// Reason for which no transmission was built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum TransmissionError {
    /// A ratio is NaN, infinite, zero or negative.
    Ratio,
    /// The CTS of this motor (0..=6) is not positive.
    CountsPerRevolution {
        /// Index of the motor.
        motor: usize,
    },
    /// The IPNM of this motor (0..=6) is not positive.
    UnitsPerNewtonMetre {
        /// Index of the motor.
        motor: usize,
    },
}

impl fmt::Display for TransmissionError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            TransmissionError::Ratio => formatter.write_str("gear ratio is not a positive number"),
            TransmissionError::CountsPerRevolution { motor } => {
                write!(formatter, "motor {} reports a CTS that is not positive", motor + 1)
            }
            TransmissionError::UnitsPerNewtonMetre { motor } => {
                write!(formatter, "motor {} reports an IPNM that is not positive", motor + 1)
            }
        }
    }
}

impl core::error::Error for TransmissionError {}

/// The cable transmission between motors and joints, generic over `f32` and `f64`. Bus units are the matter of
/// [`Drives`].
///
/// ```
/// use puck::{Ratios, Transmission};
///
/// let transmission: Transmission<f64> = Transmission::new(&Ratios::WAM7)?;
/// let motors = transmission.motor_from_joint(&[0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
/// assert_eq!(motors[0], -21.0);
/// # Ok::<(), puck::TransmissionError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Transmission<R> {
    ratios: [R; JOINTS],
    /// 1/ratio: the rounding of Barrett's library, which multiplies by an inverse matrix. It also spares divisions.
    inverse: [R; JOINTS],
}

impl<R: Real> Transmission<R> {
    /// A transmission with these ratios.
    ///
    /// # Errors
    /// [`TransmissionError::Ratio`] unless all, and their inverses, are positive and finite in `R`.
    pub fn new(ratios: &Ratios) -> Result<Transmission<R>, TransmissionError> {
        let inverse = ratios.coefficients.map(|ratio| R::from_f64(1.0 / ratio));
        let ratios = ratios.coefficients.map(R::from_f64);
        // In the number type: what f64 holds may be 0 or infinite in f32.
        let unusable = |ratio: &R| !(ratio.is_finite() && *ratio > R::from_f64(0.0));
        if ratios.iter().chain(&inverse).any(unusable) {
            return Err(TransmissionError::Ratio);
        }
        Ok(Transmission { ratios, inverse })
    }

    /// Motor angles (or velocities) from those of the joints, rad (rad/s).
    pub fn motor_from_joint(&self, joint: &[R; JOINTS]) -> [R; JOINTS] {
        let [n1, n2, n3, n4, n5, n6, n7] = self.ratios;
        let [j1, j2, j3, j4, j5, j6, j7] = *joint;
        [-n1 * j1, n2 * j2 - n3 * j3, -n2 * j2 - n3 * j3, -n4 * j4, n5 * j5 - n6 * j6, n5 * j5 + n6 * j6, -n7 * j7]
    }

    /// Joint angles (or velocities) from those of the motors, rad (rad/s).
    pub fn joint_from_motor(&self, motor: &[R; JOINTS]) -> [R; JOINTS] {
        let [n1, n2, n3, n4, n5, n6, n7] = self.inverse;
        let [m1, m2, m3, m4, m5, m6, m7] = *motor;
        let half = R::from_f64(0.5);
        [
            -m1 * n1,
            (m2 - m3) * half * n2,
            -(m2 + m3) * half * n3,
            -m4 * n4,
            (m5 + m6) * half * n5,
            (m6 - m5) * half * n6,
            -m7 * n7,
        ]
    }

    /// Motor torques from joint torques, N m: the inverse transpose of [`Transmission::motor_from_joint`].
    pub fn motor_torques_from_joint(&self, joint: &[R; JOINTS]) -> [R; JOINTS] {
        let [n1, n2, n3, n4, n5, n6, n7] = self.inverse;
        let [t1, t2, t3, t4, t5, t6, t7] = *joint;
        let half = R::from_f64(0.5);
        let (pitch, roll) = (t2 * half * n2, t3 * half * n3);
        let (wrist_yaw, wrist_pitch) = (t5 * half * n5, t6 * half * n6);
        [-t1 * n1, pitch - roll, -pitch - roll, -t4 * n4, wrist_yaw - wrist_pitch, wrist_yaw + wrist_pitch, -t7 * n7]
    }

    /// Joint torques from motor torques, N m: the transpose of [`Transmission::motor_from_joint`].
    pub fn joint_torques_from_motor(&self, motor: &[R; JOINTS]) -> [R; JOINTS] {
        let [n1, n2, n3, n4, n5, n6, n7] = self.ratios;
        let [m1, m2, m3, m4, m5, m6, m7] = *motor;
        [-n1 * m1, n2 * (m2 - m3), -n3 * (m2 + m3), -n4 * m4, n5 * (m5 + m6), n6 * (m6 - m5), -n7 * m7]
    }
}

/// Encoder and torque units of the seven motors, as the pucks report them. They differ by up to 30 % between arms: read
/// them, never assume them.
///
/// This turns bus units into motor units; [`Transmission`] turns motors into joints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Drives {
    counts_per_revolution: [i32; JOINTS],
    units_per_newton_metre: [i32; JOINTS],
}

impl Drives {
    /// From CTS and IPNM of the seven pucks.
    ///
    /// # Errors
    /// [`TransmissionError`] naming the motor whose value is zero or negative.
    pub fn new(
        counts_per_revolution: [i32; JOINTS],
        units_per_newton_metre: [i32; JOINTS],
    ) -> Result<Drives, TransmissionError> {
        if let Some(motor) = counts_per_revolution.iter().position(|counts| *counts <= 0) {
            return Err(TransmissionError::CountsPerRevolution { motor });
        }
        if let Some(motor) = units_per_newton_metre.iter().position(|units| *units <= 0) {
            return Err(TransmissionError::UnitsPerNewtonMetre { motor });
        }
        Ok(Drives { counts_per_revolution, units_per_newton_metre })
    }

    /// CTS of each motor: counts per revolution.
    #[must_use]
    pub const fn counts_per_revolution(&self) -> &[i32; JOINTS] {
        &self.counts_per_revolution
    }

    /// IPNM of each motor: current units per N m.
    #[must_use]
    pub const fn units_per_newton_metre(&self) -> &[i32; JOINTS] {
        &self.units_per_newton_metre
    }

    /// Motor angles in rad to counts, rounded down as Barrett's library does. Not wrapped to 22 bits.
    ///
    /// # Errors
    /// [`NotFinite`] if an angle is NaN or infinite.
    pub fn counts<R: Real>(&self, motor: &[R; JOINTS]) -> Result<[Counts; JOINTS], NotFinite> {
        if motor.iter().any(|angle| !angle.is_finite()) {
            return Err(NotFinite);
        }
        let mut counts = [Counts(0); JOINTS];
        for ((count, angle), cts) in counts.iter_mut().zip(motor).zip(self.counts_per_revolution) {
            let per_radian = R::from_f64(cts as f64 / core::f64::consts::TAU);
            *count = Counts((per_radian * *angle).floor().to_i32());
        }
        Ok(counts)
    }

    /// Unwrapped counts to motor angles in rad.
    #[must_use]
    pub fn motor_angles<R: Real>(&self, counts: &[Counts; JOINTS]) -> [R; JOINTS] {
        let mut angles = [R::from_f64(0.0); JOINTS];
        for ((angle, count), cts) in angles.iter_mut().zip(counts).zip(self.counts_per_revolution) {
            *angle = R::from_i32(count.0) * R::from_f64(core::f64::consts::TAU / cts as f64);
        }
        angles
    }

    /// Motor torques in N m to puck units: times IPNM, saturated to +-8191, rounded down.
    ///
    /// # Errors
    /// [`NotFinite`] if a torque is NaN or infinite: none of the seven is then returned.
    pub fn torques<R: Real>(&self, motor: &[R; JOINTS]) -> Result<[PuckTorque; JOINTS], NotFinite> {
        let mut torques = [PuckTorque::ZERO; JOINTS];
        for ((units, torque), ipnm) in torques.iter_mut().zip(motor).zip(self.units_per_newton_metre) {
            *units = PuckTorque::from_units(R::from_i32(ipnm) * *torque)?;
        }
        Ok(torques)
    }

    /// Puck units to motor torques in N m.
    #[must_use]
    pub fn motor_torques<R: Real>(&self, torques: &[PuckTorque; JOINTS]) -> [R; JOINTS] {
        let mut motor = [R::from_f64(0.0); JOINTS];
        for ((torque, units), ipnm) in motor.iter_mut().zip(torques).zip(self.units_per_newton_metre) {
            *torque = R::from_i32(units.units() as i32) / R::from_i32(ipnm);
        }
        motor
    }
}
