//! Why a conversation with a device failed, with its number.

use std::fmt;
use std::time::Duration;

use control::model::WeightError;
use device::{HomeError, PrimitiveDefect, Stage, StartupFailure};
use link::{Capabilities, ImageError, Refusal, SessionOwner};

use crate::error_code::ErrorCode;
use crate::failure::Failure;
use crate::output_file::OutputError;
use crate::startup_guide::stage_remedy;
use crate::transport::{AddressError, TransportError};

/// A part that a device can drive or read, as its hello says.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Capability {
    /// [`link::Capabilities::arm`]
    Arm,
    /// [`link::Capabilities::hand`]
    Hand,
}

impl Capability {
    /// Succeeds if it is one of these.
    ///
    /// # Errors
    /// [`HostError::Lacks`]
    pub fn of(self, capabilities: Capabilities) -> Result<(), HostError> {
        let there = match self {
            Self::Arm => capabilities.arm,
            Self::Hand => capabilities.hand,
        };
        if there { Ok(()) } else { Err(HostError::Lacks(self)) }
    }
}

impl fmt::Display for Capability {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Arm => "drive an arm",
            Self::Hand => "drive a hand",
        })
    }
}

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
        /// The difference, in the words of the refusal.
        what: Refusal,
        /// Version or hash of this tool.
        host: String,
        /// Version or hash of the firmware.
        device: String,
    },
    /// The device did not answer.
    #[error("the device did not answer '{request}' within {:.1} s", .after.as_secs_f64())]
    NoAnswer {
        /// The request.
        request: &'static str,
        /// Time waited, in the device's time.
        after: Duration,
    },
    /// Something answers at the line, and it is no device.
    #[error("what is at the other end is no Tactus device: it said {bytes} bytes, and none of its messages")]
    Strange {
        /// Bytes that came.
        bytes: usize,
    },
    /// The program of the device is not made for a part that the command needs.
    #[error("the device does not {0}")]
    Lacks(Capability),
    /// The device refused a request.
    #[error("the device refused '{request}': {}", explain(*.reason, *.detail))]
    Refused {
        /// The request.
        request: &'static str,
        /// Why not.
        reason: Refusal,
        /// Numbers that belong to the reason.
        detail: [u32; 2],
    },
    /// Another host has the device.
    #[error("{}", in_use(.owner.as_ref(), *.wait_ms))]
    InUse {
        /// The host, if the device tells.
        owner: Option<SessionOwner>,
        /// Time after which the device can be had if that host has fallen silent, ms.
        wait_ms: u32,
    },
    /// As many look on as the device has places for.
    #[error(
        "two other programs look on at the device already, as many as it has places for; one that has fallen silent gives way in {wait_ms} ms"
    )]
    Watched {
        /// Time after which there is a place if one of them has fallen silent, ms.
        wait_ms: u32,
    },
    /// The device answered with something that is no answer to what was asked.
    #[error("the device answered '{request}' with another message")]
    WrongAnswer {
        /// The request.
        request: &'static str,
    },
    /// The image to be uploaded is not sound.
    #[error("the image cannot be uploaded: {0}")]
    Image(#[from] ImageError),
    /// The bytes read back from the device are not those that were sent.
    #[error("reading the primitive back gave other bytes, the first at {offset}")]
    ReadBack {
        /// Where.
        offset: usize,
    },
    /// The arm did not come to rest after a stop was accepted.
    #[error("the arm was told to stop but still moves after {} ms", .after.as_millis())]
    NotStopped {
        /// Time waited.
        after: Duration,
    },
    /// The user interrupted; the arm was stopped.
    #[error("interrupted; the arm has stopped")]
    Interrupted,
    /// The user interrupted a program that had set nothing in motion, or whose motion had ended.
    #[error("interrupted; nothing that this command began moves, so nothing was stopped: `tactus stop` stops the arm")]
    Left,
}

/// Words for a device that another host has.
fn in_use(owner: Option<&SessionOwner>, wait_ms: u32) -> String {
    let who = match owner {
        Some(SessionOwner { name, since_ms }) if !name.as_str().is_empty() => {
            // A name is what another program says: nothing of it may command this terminal.
            let name: String = name.as_str().chars().filter(|letter| !letter.is_control()).collect();
            format!("{name} has been using the arm for {}", age(*since_ms))
        }
        _ => "another program is using the arm".to_owned(),
    };
    format!("{who}; if it has fallen silent it gives way in {wait_ms} ms")
}

/// A time in words: two units at most.
fn age(ms: u32) -> String {
    match ms / 1000 {
        seconds @ 0..60 => format!("{seconds} s"),
        seconds @ 60..3600 => format!("{} min {} s", seconds / 60, seconds % 60),
        seconds => format!("{} h {} min", seconds / 3600, seconds / 60 % 60),
    }
}

/// The refusal with its numbers put into words.
fn explain(reason: Refusal, detail: [u32; 2]) -> String {
    let [first, second] = detail;
    match reason {
        Refusal::Busy => format!("{reason} for another {second} ms"),
        Refusal::Stale => format!("{reason} ({first} ms, at most {second} ms are allowed)"),
        Refusal::Faulted => match u8::try_from(first).ok().and_then(control::Fault::from_code) {
            Some(fault) => format!("{reason}: {fault}"),
            None => format!("{reason}: number {first}"),
        },
        Refusal::State => match u8::try_from(first).ok().and_then(control::State::from_code) {
            Some(state) => format!("{reason}: {state}"),
            None => format!("{reason}: number {first}"),
        },
        Refusal::NotReady => match u8::try_from(first).ok().and_then(Stage::from_code) {
            Some(stage) => format!("{reason}: {stage}"),
            None => format!("{reason}: stage {first}"),
        },
        Refusal::SafetyMode => match first {
            0 => format!("{reason}: it is in E-stop"),
            1 => format!("{reason}: it is idle"),
            2 => format!("{reason}: it is active, and the motors brake; press Shift-Idle, then Shift-Activate"),
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
        Refusal::PrimitiveInvalid => format!("{reason}: {}", PrimitiveDefect(detail)),
        Refusal::NoAnswer => format!("{reason} within {first} ms"),
        Refusal::ProofTooSoon => format!("{reason}; it takes the next in {first} ms"),
        Refusal::HasTorque => match u8::try_from(first).ok().and_then(control::State::from_code) {
            Some(state) => format!("{reason}: {state}"),
            None => format!("{reason}: state {first}"),
        },
        Refusal::HomeImplausible => match HomeError::from_detail(detail) {
            Some(error) => format!("{reason}: {error}"),
            None => format!("{reason}: J{}", first.saturating_add(1)),
        },
        Refusal::WeightImplausible => match WeightError::from_detail(detail) {
            Some(error) => format!("{reason}: {error}"),
            None => format!("{reason}: link {}", first.saturating_add(1)),
        },
        _ => reason.to_string(),
    }
}

/// The reason for which a bus start-up is blocked, in words, from the numbers in a status or event.
#[must_use]
pub fn explain_blocked(numbers: [u32; 2]) -> String {
    StartupFailure(numbers).to_string()
}

impl HostError {
    /// Stable number.
    #[must_use]
    pub fn code(&self) -> ErrorCode {
        match self {
            Self::WrongAnswer { .. } => ErrorCode::WrongAnswer,
            Self::Transport(TransportError::Can(problem)) => problem.code(),
            // The line of a simulated device is sound where the log of its bus cannot be written.
            Self::Transport(TransportError::Other(cause)) => {
                cause.downcast_ref().map_or(ErrorCode::LineFailed, OutputError::code)
            }
            Self::Address(_) => ErrorCode::AddressInvalid,
            Self::Transport(TransportError::NotFound { .. }) => ErrorCode::DeviceNotFound,
            Self::Transport(TransportError::Permission { .. }) => ErrorCode::PermissionDenied,
            Self::Transport(TransportError::Busy { .. }) => ErrorCode::PortInUse,
            Self::Incompatible { what: Refusal::Schema, .. } => ErrorCode::LinkSchema,
            Self::Incompatible { what: Refusal::Model, .. } => ErrorCode::RobotModel,
            Self::Incompatible { .. } => ErrorCode::LinkVersion,
            Self::Lacks(_) => ErrorCode::CapabilityMissing,
            Self::Refused { reason, .. } => ErrorCode::Refused(*reason),
            Self::InUse { .. } | Self::Watched { .. } => ErrorCode::Refused(Refusal::Busy),
            Self::Image(_) => ErrorCode::ImageInvalid,
            Self::ReadBack { .. } => ErrorCode::ReadBackDiffers,
            Self::Transport(TransportError::Closed | TransportError::HungUp | TransportError::Io(_)) => {
                ErrorCode::LineClosed
            }
            Self::NoAnswer { .. } => ErrorCode::NoAnswer,
            Self::Strange { .. } => ErrorCode::NoTactus,
            Self::NotStopped { .. } => ErrorCode::NotStopped,
            Self::Interrupted | Self::Left => ErrorCode::Interrupted,
        }
    }

    /// A request that nobody answered for so long, on a line on which so many bytes were none of a device.
    pub(crate) fn unanswered(request: &'static str, after: Duration, strange: usize) -> Self {
        if strange > 0 { Self::Strange { bytes: strange } } else { Self::NoAnswer { request, after } }
    }

    /// The error as the failure of a command that was `doing` something.
    #[must_use]
    pub fn into_failure(self, doing: impl Into<String>) -> Failure {
        let help = match &self {
            Self::Transport(TransportError::Can(problem)) => problem.help(),
            Self::Address(error) => error.help(),
            Self::Transport(TransportError::HungUp) => Some(
                "look whether that program still runs, `tactus sim` for example; a device stops its arm by itself \
                 after half a second"
                    .to_owned(),
            ),
            Self::Watched { .. } => {
                Some("end one of them; `tactus stop` stops the arm from here, however many look on".to_owned())
            }
            Self::Refused { reason: Refusal::NotReady, detail: [stage, _], .. } => {
                let stage = u8::try_from(*stage).ok().and_then(Stage::from_code);
                stage.and_then(stage_remedy).map(str::to_owned)
            }
            _ => None,
        };
        let failure = Failure::new(self.code(), doing, self);
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
            assert_eq!(error.code().to_string(), format!("E{}", 500 + u16::from(reason.code())));
            assert!(error.to_string().starts_with("the device refused 'run': "));
            assert!(error.into_failure("run").help.is_some());
        }
    }

    #[test]
    fn a_device_without_an_arm_is_refused_by_the_name_of_what_it_lacks() {
        let hand_alone = Capabilities { arm: false, hand: true, wrench: false };
        assert!(Capability::Hand.of(hand_alone).is_ok());
        let error = Capability::Arm.of(hand_alone).unwrap_err();
        assert_eq!(error.to_string(), "the device does not drive an arm");
        assert_eq!((error.code().exit() as u8, error.code().to_string()), (4, "E405".to_owned()));
        assert!(error.code().remedy().contains("--device"));
    }

    #[test]
    fn a_refusal_names_the_state_and_the_fault_behind_its_numbers() {
        let text = |reason, detail| HostError::Refused { request: "run", reason, detail }.to_string();
        assert!(text(Refusal::State, [6, 0]).contains("soft stop"));
        assert!(text(Refusal::Faulted, [3, 0]).contains("soft limits"));
        assert!(text(Refusal::TooManyKernels, [142, 100]).contains("142, at most 100"));
    }
}
