//! Why a conversation with a device failed, with exit code, stable number and remedy.
//!
//! Numbers: the hundreds are the exit code; 500 and up are the refusals of the link, in their order.

use std::time::Duration;

use device::{HomeError, PrimitiveTrouble, StartupTrouble};
use link::{ImageError, Refusal};

use crate::failure::{Exit, Failure};
use crate::transport::{AddressError, TransportError};

/// Why a conversation with a device failed.
#[derive(Debug, thiserror::Error)]
pub enum HostError {
    /// The address of the device cannot be read.
    #[error(transparent)]
    Address(#[from] AddressError),
    /// The bytes do not get through.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Host and device do not fit together.
    #[error("{what}: host has {host}, device has {device}")]
    Incompatible {
        /// What differs, in the words of the refusal.
        what: Refusal,
        /// Version or hash of this tool.
        host: String,
        /// Version or hash of the firmware.
        device: String,
    },
    /// The device did not answer.
    #[error("the device did not answer '{request}' within {:.1} s", .after.as_secs_f64())]
    NoAnswer {
        /// What was asked.
        request: &'static str,
        /// How long was waited, in the device's time.
        after: Duration,
    },
    /// The device refused a request.
    #[error("the device refused '{request}': {}", explain(*.reason, *.detail))]
    Refused {
        /// What was asked.
        request: &'static str,
        /// Why not.
        reason: Refusal,
        /// Numbers that belong to the reason.
        detail: [u32; 2],
    },
    /// The device answered with something that is no answer to what was asked.
    #[error("the device answered '{request}' with another message")]
    WrongAnswer {
        /// What was asked.
        request: &'static str,
    },
    /// The image to be uploaded is not sound.
    #[error("the image cannot be uploaded: {0}")]
    Image(#[from] ImageError),
    /// What was read back from the device is not what was sent.
    #[error("reading the primitive back gave other bytes, the first at {offset}")]
    ReadBack {
        /// Where.
        offset: usize,
    },
    /// The arm did not come to rest after a stop was accepted.
    #[error("the arm was told to stop but still moves after {} ms", .after.as_millis())]
    NotStopped {
        /// How long was waited.
        after: Duration,
    },
    /// The user interrupted; the arm was stopped.
    #[error("interrupted; the arm has stopped")]
    Interrupted,
}

/// The refusal with its numbers put into words.
fn explain(reason: Refusal, detail: [u32; 2]) -> String {
    let [first, second] = detail;
    match reason {
        Refusal::Busy => format!("{reason}; it can be taken over in {second} ms"),
        Refusal::Stale => format!("{reason} ({first} ms, at most {second} ms are allowed)"),
        Refusal::Faulted => match u8::try_from(first).ok().and_then(control::Fault::from_code) {
            Some(fault) => format!("{reason}: {fault}"),
            None => format!("{reason}: number {first}"),
        },
        Refusal::State => match u8::try_from(first).ok().and_then(control::State::from_code) {
            Some(state) => format!("{reason}: {state}"),
            None => format!("{reason}: number {first}"),
        },
        Refusal::NotReady => match u8::try_from(first).ok().and_then(device::Stage::from_code) {
            Some(stage) => format!("{reason}: {stage}"),
            None => format!("{reason}: stage {first}"),
        },
        Refusal::SafetyMode => match first {
            0 => format!("{reason}: it is in E-stop"),
            1 => format!("{reason}: it is idle"),
            _ => format!("{reason}: its mode is unknown"),
        },
        Refusal::BadValue => format!("{reason} (number {})", first.saturating_add(1)),
        Refusal::StoreFull => format!("{reason}: all {first} places are taken"),
        Refusal::ImageTooLarge | Refusal::TooManyKernels => {
            format!("{reason}: {first}, at most {second}")
        }
        Refusal::UploadIncomplete => format!("{reason}: {first} of {second} bytes arrived"),
        Refusal::UploadOrder => format!("{reason}: at {second} instead of {first}"),
        Refusal::UploadCrc => {
            format!("{reason}: check sum {first:#010x} instead of {second:#010x}")
        }
        Refusal::ImageModel => format!("{reason}: {first:#010x}, the device has {second:#010x}"),
        Refusal::ImageInvalid => format!("{reason} (reason {first}, {second})"),
        Refusal::PrimitiveInvalid => format!("{reason}: {}", PrimitiveTrouble(detail)),
        Refusal::NoAnswer => format!("{reason} within {first} ms"),
        Refusal::HasTorque => match u8::try_from(first).ok().and_then(control::State::from_code) {
            Some(state) => format!("{reason}: {state}"),
            None => format!("{reason}: state {first}"),
        },
        Refusal::HomeImplausible => match HomeError::from_detail(detail) {
            Some(error) => format!("{reason}: {error}"),
            None => format!("{reason}: J{}", first.saturating_add(1)),
        },
        _ => reason.to_string(),
    }
}

/// The reason for which a bus start-up is blocked, in words, from the numbers in a status or event.
#[must_use]
pub fn explain_blocked(numbers: [u32; 2]) -> String {
    StartupTrouble(numbers).to_string()
}

/// Numbers of the refusals, by their code.
const REFUSAL_CODES: [&str; Refusal::ALL.len()] = [
    "E500", "E501", "E502", "E503", "E504", "E505", "E506", "E507", "E508", "E509", "E510", "E511", "E512", "E513",
    "E514", "E515", "E516", "E517", "E518", "E519", "E520", "E521", "E522", "E523", "E524", "E525", "E526", "E527",
    "E528", "E529", "E530", "E531", "E532", "E533", "E534", "E535", "E536", "E537", "E538", "E539", "E540", "E541",
    "E542", "E543", "E544", "E545", "E546",
];

impl HostError {
    /// Exit code of a command that fails with this.
    #[must_use]
    pub fn exit(&self) -> Exit {
        match self {
            Self::Address(_) => Exit::Usage,
            Self::Transport(TransportError::NotFound { .. } | TransportError::Permission { .. }) => Exit::NoDevice,
            Self::Transport(TransportError::Can(trouble)) => trouble.exit(),
            Self::Transport(TransportError::Other(_)) => Exit::Internal,
            Self::Transport(TransportError::Closed | TransportError::Io(_))
            | Self::NoAnswer { .. }
            | Self::NotStopped { .. } => Exit::LinkLost,
            Self::Incompatible { .. } => Exit::Incompatible,
            Self::Refused { .. } => Exit::Refused,
            Self::Image(_) | Self::ReadBack { .. } => Exit::Invalid,
            Self::WrongAnswer { .. } => Exit::Internal,
            Self::Interrupted => Exit::Interrupted,
        }
    }

    /// Stable number.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::WrongAnswer { .. } => "E101",
            Self::Transport(TransportError::Can(trouble)) => trouble.code(),
            Self::Transport(TransportError::Other(_)) => "E102",
            Self::Address(_) => "E201",
            Self::Transport(TransportError::NotFound { .. }) => "E301",
            Self::Transport(TransportError::Permission { .. }) => "E302",
            Self::Incompatible { what: Refusal::Schema, .. } => "E402",
            Self::Incompatible { what: Refusal::Model, .. } => "E403",
            Self::Incompatible { .. } => "E401",
            Self::Refused { reason, .. } => REFUSAL_CODES.get(usize::from(reason.code())).copied().unwrap_or("E500"),
            Self::Image(_) => "E651",
            Self::ReadBack { .. } => "E652",
            Self::Transport(TransportError::Closed | TransportError::Io(_)) => "E701",
            Self::NoAnswer { .. } => "E702",
            Self::NotStopped { .. } => "E703",
            Self::Interrupted => "E130",
        }
    }

    /// What the user can do about it.
    #[must_use]
    pub fn help(&self) -> Option<String> {
        let help = match self {
            Self::Address(_) => "for a simulated arm use `--device sim:`",
            Self::Transport(TransportError::NotFound { .. }) => {
                "check cable and name of the device; for a simulated arm use `--device sim:`"
            }
            Self::Transport(TransportError::Permission { .. }) => {
                "let your user open serial ports: `sudo usermod -aG dialout $USER`, then log in again"
            }
            Self::Transport(TransportError::Closed | TransportError::Io(_)) => {
                "check the cable; the device stops the arm by itself after half a second"
            }
            Self::Transport(TransportError::Can(trouble)) => return Some(trouble.help()),
            Self::Transport(TransportError::Other(_)) | Self::WrongAnswer { .. } | Self::Interrupted => return None,
            Self::Incompatible { what, .. } => what.remedy(),
            Self::NoAnswer { .. } => {
                "check that the device has power, that its firmware runs, and that no other program is connected to it; then try again"
            }
            Self::Refused { reason, .. } => reason.remedy(),
            Self::Image(_) => "make the primitive again with `tactus learn`",
            Self::ReadBack { .. } => "upload again; if it persists the device's storage is worn out",
            Self::NotStopped { .. } => "press the emergency stop",
        };
        Some(help.to_owned())
    }

    /// The error as the failure of a command that was `doing` something.
    #[must_use]
    pub fn into_failure(self, doing: impl Into<String>) -> Failure {
        let help = self.help();
        let failure = Failure::new(self.exit(), self.code(), doing, self);
        match help {
            Some(help) => failure.help(help),
            None => failure,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_refusal_has_a_number_of_its_own_in_order() {
        for reason in Refusal::ALL {
            let error = HostError::Refused { request: "run", reason, detail: [0, 0] };
            assert_eq!(error.code(), format!("E{}", 500 + u16::from(reason.code())));
            assert!(error.help().is_some() && error.to_string().starts_with("the device refused 'run': "));
        }
    }

    #[test]
    fn the_hundreds_of_a_number_are_its_exit_code() {
        let closed = HostError::from(TransportError::Closed);
        let silent = HostError::NoAnswer { request: "status", after: Duration::from_secs(2) };
        let differs = HostError::Incompatible { what: Refusal::Schema, host: "1".into(), device: "2".into() };
        for error in [closed, silent, differs, ImageError::Magic.into(), HostError::ReadBack { offset: 3 }] {
            assert_eq!(error.code().as_bytes()[1] - b'0', error.exit() as u8, "{error}");
        }
        assert_eq!(HostError::Interrupted.exit() as u8, 130);
    }

    #[test]
    fn a_refusal_names_the_state_and_the_fault_behind_its_numbers() {
        let text = |reason, detail| HostError::Refused { request: "run", reason, detail }.to_string();
        assert!(text(Refusal::State, [6, 0]).contains("soft stop"));
        assert!(text(Refusal::Faulted, [3, 0]).contains("soft limits"));
        assert!(text(Refusal::TooManyKernels, [142, 100]).contains("142, at most 100"));
    }
}
