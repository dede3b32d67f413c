//! Why a configuration makes no plant.

use puck::{TransmissionError, UnknownFirmware};

/// A configuration that describes no arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlantError {
    /// Ratio, CTS or IPNM is not positive.
    #[error("the arm's drives: {0}")]
    Drives(TransmissionError),
    /// No property table for a firmware version.
    #[error("the arm's firmware: {0}")]
    Firmware(UnknownFirmware),
}

impl From<TransmissionError> for PlantError {
    fn from(error: TransmissionError) -> Self {
        Self::Drives(error)
    }
}

impl From<UnknownFirmware> for PlantError {
    fn from(error: UnknownFirmware) -> Self {
        Self::Firmware(error)
    }
}
