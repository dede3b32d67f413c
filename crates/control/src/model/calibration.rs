//! The differences from arm to arm: encoder and torque scales, and what is mounted on the tool plate.

use core::fmt;

use puck::{Drives, Ratios, Transmission, TransmissionError};

use crate::model::wam7;
use crate::real::Real;

/// Torque units per N m of the hand's motors where nothing else is known.
const NOMINAL_HAND_UNITS: [i32; 4] = [20_000; 4];

/// Payload on the tool plate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Payload {
    /// The bare arm; the tool frame is the tool plate.
    None,
    /// Force/torque sensor and BH8-280 hand; the tool frame is the grasp point.
    SensorAndHand,
}

/// Scales of one arm, read from its pucks at start-up, and its payload.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibration<R: Real> {
    pub(crate) transmission: Transmission<R>,
    pub(crate) drives: Drives,
    pub(crate) payload: Payload,
    pub(crate) hand_units_per_newton_metre: [i32; 4],
}

/// Why a calibration is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CalibrationError {
    /// Counts per revolution of this motor (0 = M1) are not in 256 to 65536.
    CountsPerRevolution(u8),
    /// Torque counts per N m of this motor (0 = M1) are not in 500 to 50000.
    TorqueCounts(u8),
    /// Torque counts per N m of this digit of the hand (0 = F1, 3 = spread) are not in 500 to 50000.
    HandTorqueCounts(u8),
    /// The transmission does not accept these scales.
    Transmission(TransmissionError),
}

impl fmt::Display for CalibrationError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            CalibrationError::CountsPerRevolution(motor) => {
                write!(formatter, "puck {}: counts per revolution are not in 256..=65536", motor + 1)
            }
            CalibrationError::TorqueCounts(motor) => {
                write!(formatter, "puck {}: torque counts per N m are not in 500..=50000", motor + 1)
            }
            CalibrationError::HandTorqueCounts(digit) => {
                write!(formatter, "puck {}: torque counts per N m are not in 500..=50000", digit + 11)
            }
            CalibrationError::Transmission(error) => error.fmt(formatter),
        }
    }
}

impl core::error::Error for CalibrationError {}

impl<R: Real> Calibration<R> {
    /// Checks the scales read from the pucks (CTS and IPNM, M1 first).
    ///
    /// The bounds are a factor of several around every puck known: a puck that answers with garbage must not scale
    /// torques.
    ///
    /// # Errors
    /// [`CalibrationError`] names the first puck whose scale is out of bounds.
    pub fn new(
        counts_per_revolution: [i32; 7],
        torque_counts: [i32; 7],
        payload: Payload,
    ) -> Result<Calibration<R>, CalibrationError> {
        for (motor, (counts, torque)) in (0u8..).zip(counts_per_revolution.iter().zip(&torque_counts)) {
            if !(256..=65_536).contains(counts) {
                return Err(CalibrationError::CountsPerRevolution(motor));
            }
            if !(500..=50_000).contains(torque) {
                return Err(CalibrationError::TorqueCounts(motor));
            }
        }
        Ok(Calibration {
            transmission: Transmission::new(&Ratios::WAM7).map_err(CalibrationError::Transmission)?,
            drives: Drives::new(counts_per_revolution, torque_counts).map_err(CalibrationError::Transmission)?,
            payload,
            hand_units_per_newton_metre: NOMINAL_HAND_UNITS,
        })
    }

    /// The nominal scales of the model file, for tests and until an arm has been asked for its own.
    pub fn nominal(payload: Payload) -> Calibration<R> {
        Calibration::new([wam7::ENCODER_COUNTS as i32; 7], wam7::TORQUE_COUNTS.map(|counts| counts as i32), payload)
            .expect("the scales of the model file are valid, which a test proves")
    }

    /// The same with the hand's own scales (IPNM of F1, F2, F3, spread).
    ///
    /// # Errors
    /// [`CalibrationError::HandTorqueCounts`] names the first puck whose scale is out of bounds.
    pub fn with_hand(self, units_per_newton_metre: [i32; 4]) -> Result<Calibration<R>, CalibrationError> {
        for (digit, units) in (0u8..).zip(&units_per_newton_metre) {
            if !(500..=50_000).contains(units) {
                return Err(CalibrationError::HandTorqueCounts(digit));
            }
        }
        Ok(Calibration { hand_units_per_newton_metre: units_per_newton_metre, ..self })
    }

    /// Torque units per N m at the motor of F1, F2, F3, spread.
    pub fn hand_units_per_newton_metre(&self) -> &[i32; 4] {
        &self.hand_units_per_newton_metre
    }

    /// Joint and motor space.
    pub fn transmission(&self) -> &Transmission<R> {
        &self.transmission
    }

    /// Scales of the pucks.
    pub fn drives(&self) -> &Drives {
        &self.drives
    }

    /// The payload.
    pub fn payload(&self) -> Payload {
        self.payload
    }
}
