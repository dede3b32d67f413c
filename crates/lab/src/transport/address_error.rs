//! Why a text is no address of a device.

use crate::quoted;

/// Why a text is no address.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum AddressError {
    /// The part before the colon names no kind of device.
    #[error(
        "'{0}' names no kind of device; there are sim:, sil:, board:, hand:, tcp:HOST:PORT, unix:PATH, serial:PORT[@BAUD] and can:INTERFACE[/N]"
    )]
    Kind(String),
    /// Something is missing behind the colon.
    #[error("'{0}' is incomplete; it should look like {1}")]
    Incomplete(String, &'static str),
    /// An option of a simulator that there is not.
    #[error(
        "simulated devices have the options seed=NUMBER, arm=NUMBER, held=KG@X:Y:Z, world=NAME, line=serial|can, bus=FILE, flash=FILE and faults=FILE, not '{0}'; two commas in the name of a FILE are one of it"
    )]
    Option(String),
    /// An option of the emulated board that there is not.
    #[error(
        "board: has the options of the other simulated devices, and report=FILE, cancellation=skipped|stuck, revision=0xNNNN and fault=KIND@MICROSECONDS[:ARGUMENT], not '{0}'"
    )]
    BoardOption(String),
    /// An option that is given twice.
    #[error("'{0}' is given twice; one of the two would be ignored")]
    Twice(String),
    /// An option that this simulated device does not have.
    #[error("a hand alone has the options seed=NUMBER, world=empty, line=serial|can and bus=FILE, not '{0}'")]
    HandOption(String),
    /// A file whose name elsewhere means standard output.
    #[error("'{0}': elsewhere that is standard output; a file of that name is './-'")]
    StandardOutput(String),
    /// A value that is no number, or one that is too large; the largest there is.
    #[error("'{0}': a whole number from 0 to {1} is expected")]
    Number(String, u64),
    /// A text that was not Unicode: what could not be read was replaced.
    #[error("'{0}' is no text in UTF-8")]
    NotText(String),
    /// A device number that there is not.
    #[error("devices on a CAN bus have the numbers 0 to 15, not '{0}'")]
    DeviceNumber(String),
}

impl AddressError {
    /// The address that was probably meant, as an advice; `None` where the message says all there is to say.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        let Self::Kind(text) = self else { return None };
        let word = text.trim_end_matches(':');
        let meant = match word {
            "sim" | "sil" | "board" | "hand" => format!("{word}:"),
            _ if word.starts_with("/dev/") || word.starts_with("COM") => format!("serial:{word}"),
            _ if word.starts_with("can") || word.starts_with("vcan") || word.starts_with("slcan") => {
                format!("can:{word}")
            }
            _ if word.ends_with(".sock") => format!("unix:{word}"),
            _ => return None,
        };
        Some(format!("`--device {}`", quoted::text(&meant)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: the address goes into the line as it is.
    #[test]
    fn an_address_with_a_space_is_advised_as_one_word() {
        let help = |text: &str| AddressError::Kind(text.to_owned()).help();
        assert_eq!(help("my arm.sock").as_deref(), Some("`--device 'unix:my arm.sock'`"));
        assert_eq!(help("/dev/ttyACM0").as_deref(), Some("`--device serial:/dev/ttyACM0`"));
    }
}
