//! Reasons for which the device refuses a request, each with an explanation and a remedy.
//!
//! Append-only and part of the wire format. The texts live beside the codes so that a host of the same
//! version can never show a bare number.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Why a request was refused. `detail` in the comments are the two numbers of `Reply::Refused`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Refusal {
    /// `detail` = link version of host, of device. Frozen.
    LinkVersion,
    /// `detail` = schema hash of host, of device. Frozen.
    Schema,
    /// `detail` = model hash of host, of device. Frozen.
    Model,
    /// No session: the first request must be a hello. Frozen.
    NoSession,
    /// Another host has the session. `detail` = its session number, ms until it may be taken over. Frozen.
    Busy,
    /// The request was older than the limit when it came. `detail` = age, limit, ms.
    Stale,
    /// A number in the request is not finite or outside its range. `detail` = position of the first such.
    BadValue,
    /// The arm must be zeroed first.
    NotZeroed,
    /// The bus start-up has not finished. `detail` = stage.
    NotReady,
    /// The safety module is not in the mode the request needs. `detail` = its mode.
    SafetyMode,
    /// A fault is latched. `detail` = fault code.
    Faulted,
    /// Not possible in this state. `detail` = state code.
    State,
    /// The control cycle has not taken the previous command yet.
    CommandQueueFull,
    /// No primitive of that name (or at that place) in the store.
    NoSuchPrimitive,
    /// All places of the store are taken. `detail` = places.
    StoreFull,
    /// The image is larger than a place. `detail` = its bytes, bytes of a place.
    ImageTooLarge,
    /// No upload under way.
    NoUpload,
    /// A chunk out of order. `detail` = offset expected, offset given.
    UploadOrder,
    /// The upload is not complete. `detail` = bytes received, bytes announced.
    UploadIncomplete,
    /// The check sum of the upload differs from the announced one. `detail` = computed, announced.
    UploadCrc,
    /// The image is not a valid primitive image. `detail` = code of the image error, its first number.
    ImageInvalid,
    /// The image was made for another robot model. `detail` = model of image, of device.
    ImageModel,
    /// The name inside the image differs from the name of the upload.
    ImageName,
    /// Too many kernels. `detail` = kernels of the image, most the device holds.
    TooManyKernels,
    /// The primitive's content is outside what the controller accepts. `detail` = code, row or joint.
    PrimitiveInvalid,
    /// The primitive is being used by the control cycle.
    InUse,
    /// The arm is farther from the taught start than the controller accepts.
    FarFromStart,
    /// The storage failed. `detail` = code of the store.
    StoreFailed,
    /// Not all joint positions have been measured.
    PositionsMissing,
    /// The target lies outside the soft joint limits.
    OutsideJointLimits,
    /// The goal lies outside the workspace.
    OutsideWorkspace,
    /// The arm still moves, or the cause of the stop is still there.
    CauseRemains,
    /// The arm moves too fast for this.
    Moving,
    /// No wrench is measured and the request needs one.
    WrenchMissing,
    /// The control cycle did not answer in time. `detail` = ms waited.
    NoAnswer,
    /// Zeroing needs a resting arm whose safety module is idle.
    ZeroNeedsIdle,
    /// There is no hand, or it does not work. `detail` = stage of the hand.
    NoHand,
    /// The hand must be initialised first. `detail` = stage of the hand.
    HandNotReady,
    /// The target lies outside what the hand can reach.
    HandOutOfRange,
    /// The expectation was recorded through another filter. `detail` = cut-off of the image, of the device, in mHz.
    ImageFilter,
    /// Feedback or force control needs an expectation and the primitive has none.
    NoExpectation,
    /// A digit of the hand is farther from the taught start than the controller accepts.
    HandFarFromStart,
    /// The force at rest is not the weight of the hand, so it cannot be taken as zero.
    ForceAtRest,
    /// The hand can only be initialised at rest: not during a run, and not while the hand is being initialised.
    HandBusy,
    /// The device drives a hand alone: it has no arm to do this with.
    NoArm,
    /// A home posture is not that of this arm. `detail` = joint (0 for J1), and what is wrong with its angle: 0 not a
    /// number, 1 outside the joint's range, 2 too far from the model's home.
    HomeImplausible,
    /// The arm has torque. `detail` = state code.
    HasTorque,
    /// The host observes: it may look and stop, nothing else.
    Observing,
    /// Another primitive in the store has this name.
    NameTaken,
    /// A weight of the links cannot be that of an arm. `detail` = link (0 for the one that J1 turns), and what is wrong
    /// with it: 0 not a number, 1 the mass, 2 the centre of mass.
    WeightImplausible,
    /// The device keeps a secret, and this session has not proven to know it.
    Locked,
    /// The proof is wrong, or there was no challenge: each is good for one try.
    WrongProof,
    /// A wrong proof has just come. `detail` = time until the next challenge, ms.
    ProofTooSoon,
    /// The device keeps no secret, so there is nothing to prove.
    NoSecret,
    /// The device keeps a secret that it cannot read.
    SecretUnreadable,
    /// The device has no place to keep a secret.
    SecretNotOffered,
    /// The bus was started anew while the primitive was checked, and what hangs on the wrist is another now.
    OtherTool,
    /// A sector of the storage cannot be erased or written. `detail` = its number.
    StoreWorn,
}

impl Refusal {
    /// Every refusal, in the order of its code.
    pub const ALL: [Self; 58] = [
        Self::LinkVersion,
        Self::Schema,
        Self::Model,
        Self::NoSession,
        Self::Busy,
        Self::Stale,
        Self::BadValue,
        Self::NotZeroed,
        Self::NotReady,
        Self::SafetyMode,
        Self::Faulted,
        Self::State,
        Self::CommandQueueFull,
        Self::NoSuchPrimitive,
        Self::StoreFull,
        Self::ImageTooLarge,
        Self::NoUpload,
        Self::UploadOrder,
        Self::UploadIncomplete,
        Self::UploadCrc,
        Self::ImageInvalid,
        Self::ImageModel,
        Self::ImageName,
        Self::TooManyKernels,
        Self::PrimitiveInvalid,
        Self::InUse,
        Self::FarFromStart,
        Self::StoreFailed,
        Self::PositionsMissing,
        Self::OutsideJointLimits,
        Self::OutsideWorkspace,
        Self::CauseRemains,
        Self::Moving,
        Self::WrenchMissing,
        Self::NoAnswer,
        Self::ZeroNeedsIdle,
        Self::NoHand,
        Self::HandNotReady,
        Self::HandOutOfRange,
        Self::ImageFilter,
        Self::NoExpectation,
        Self::HandFarFromStart,
        Self::ForceAtRest,
        Self::HandBusy,
        Self::NoArm,
        Self::HomeImplausible,
        Self::HasTorque,
        Self::Observing,
        Self::NameTaken,
        Self::WeightImplausible,
        Self::Locked,
        Self::WrongProof,
        Self::ProofTooSoon,
        Self::NoSecret,
        Self::SecretUnreadable,
        Self::SecretNotOffered,
        Self::OtherTool,
        Self::StoreWorn,
    ];

    /// Number on the wire.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// Returns the reason, in one sentence without full stop.
    #[must_use]
    pub const fn explanation(self) -> &'static str {
        match self {
            Self::LinkVersion => "host and device speak different versions of the link",
            Self::Schema => "host and device lay out their messages differently",
            Self::Model => "host and device compute with different models of the robot",
            Self::NoSession => "the device has no session with this host",
            Self::Busy => "another host is connected to the device",
            Self::Stale => "the request was too old when it arrived",
            Self::BadValue => "a number in the request is not finite or out of range",
            Self::NotZeroed => "the arm is not zeroed, so its joint angles are unknown",
            Self::NotReady => "the device is still starting up the arm's bus",
            Self::SafetyMode => "the safety module does not allow torque",
            Self::Faulted => "a fault is latched",
            Self::State => "the device is in a state that does not allow this",
            Self::CommandQueueFull => "the control cycle has not taken the previous command yet",
            Self::NoSuchPrimitive => "the device stores no primitive of that name",
            Self::StoreFull => "the device has no room for another primitive",
            Self::ImageTooLarge => "the image is larger than the device can store",
            Self::NoUpload => "there is no upload under way",
            Self::UploadOrder => "a part of the image arrived out of order",
            Self::UploadIncomplete => "parts of the image are missing",
            Self::UploadCrc => "the image arrived damaged",
            Self::ImageInvalid => "the image is not a valid primitive image",
            Self::ImageModel => "the primitive was made for another robot model",
            Self::ImageName => "the image carries another name than the upload",
            Self::TooManyKernels => "the primitive has more kernels than the device can hold",
            Self::PrimitiveInvalid => "the primitive is outside what the controller accepts",
            Self::InUse => "the primitive is in use by the control cycle",
            Self::FarFromStart => "the arm is not near the start of the primitive",
            Self::StoreFailed => "the device could not write its storage",
            Self::PositionsMissing => "not all joint positions are measured",
            Self::OutsideJointLimits => "the target lies outside the joint limits",
            Self::OutsideWorkspace => "the goal lies outside the arm's workspace",
            Self::CauseRemains => "the cause of the stop is still present",
            Self::Moving => "the arm moves too fast for this",
            Self::WrenchMissing => "no wrench is measured",
            Self::NoAnswer => "the control cycle did not answer",
            Self::ZeroNeedsIdle => "the arm can only be zeroed at rest, while the safety module is idle",
            Self::NoHand => "the arm has no hand that works",
            Self::HandNotReady => "the hand is not initialised, so its finger angles are unknown",
            Self::HandOutOfRange => "the target lies outside the hand's range",
            Self::ImageFilter => "the expectation was recorded through another filter than the device has",
            Self::NoExpectation => "the primitive has no expected forces",
            Self::HandFarFromStart => "the hand is not near where the primitive starts",
            Self::ForceAtRest => "the force at rest is not the weight of the hand",
            Self::HandBusy => "the hand is being moved or initialised",
            Self::NoArm => "the device drives a hand alone, without an arm",
            Self::HomeImplausible => "the home posture cannot be that of this arm",
            Self::HasTorque => "the arm has torque",
            Self::Observing => "an observer may look and stop, nothing else",
            Self::NameTaken => "the device stores another primitive of that name",
            Self::WeightImplausible => "the weight of the links cannot be that of an arm",
            Self::Locked => "the device keeps a secret, and this session has not proven to know it",
            Self::WrongProof => "the secret is not that of the device",
            Self::ProofTooSoon => "somebody has just given the device a wrong secret",
            Self::NoSecret => "the device keeps no secret",
            Self::SecretUnreadable => "the device keeps a secret that it cannot read",
            Self::SecretNotOffered => "the device has no place to keep a secret",
            Self::OtherTool => "the arm was found with another tool while the primitive was checked",
            Self::StoreWorn => "a sector of the storage cannot be erased or written, so nothing more is kept",
        }
    }

    /// Returns the remedy, as an instruction to the user.
    #[must_use]
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::LinkVersion | Self::Schema => {
                "flash the firmware that belongs to this tool, or use the tool that belongs to the firmware"
            }
            Self::Model => "build tool and firmware from the same model file",
            Self::NoSession => {
                "enter the command again: the device had not heard it for half a second, and let go of it"
            }
            Self::Busy => {
                "end the program there, or enter the command again if it has ended; `tactus stop` stops the arm from \
                 here, `tactus monitor` looks on"
            }
            Self::Stale => "send the request again",
            Self::BadValue => "correct the value",
            Self::NotZeroed => {
                "bring the arm to its home pose by hand; `tactus run`, `teach` and `hand` zero it there with `--at-home`"
            }
            Self::NotReady => {
                "wait for the start-up to finish; if it does not, `tactus status` tells what is in its way"
            }
            Self::SafetyMode => "press Shift+Activate on the pendant",
            Self::Faulted => "remove the cause, then `tactus stop --clear-fault`",
            Self::State => "stop the present motion first: `tactus stop`",
            Self::CommandQueueFull => "send the request again",
            Self::NoSuchPrimitive => "`tactus list` shows what is stored; `tactus upload` adds one",
            Self::StoreFull => "`tactus list` shows what is stored; `tactus delete NAME` frees a place",
            Self::ImageTooLarge => "learn the primitive with fewer kernels, or leave out its expectation",
            Self::NoUpload | Self::UploadOrder | Self::UploadIncomplete | Self::UploadCrc => "`tactus upload` again",
            Self::ImageInvalid | Self::ImageName => "make the image again with `tactus upload`",
            Self::ImageModel => "learn the primitive again with the present model",
            Self::TooManyKernels => "learn the primitive with fewer kernels",
            Self::PrimitiveInvalid => "`tactus check` names what is outside the limits",
            Self::InUse => "stop the motion, then try again",
            Self::FarFromStart => "`tactus run` goes to the start first; let nobody move the arm meanwhile",
            Self::StoreFailed => "try again; if it persists the storage is worn out",
            Self::PositionsMissing => "check the CAN wiring and the pucks",
            Self::OutsideJointLimits | Self::OutsideWorkspace => "choose a target the arm can reach",
            Self::CauseRemains => "remove the cause and let the arm come to rest",
            Self::Moving => "let the arm come to rest",
            Self::WrenchMissing => {
                "check the force sensor and its cable; one that has lost its power is woken behind Shift-Idle"
            }
            Self::NoAnswer => "send the request again; if it persists restart the device",
            Self::ZeroNeedsIdle => "press Shift+Idle on the pendant, hold the arm still, then zero it",
            Self::NoHand => "check the hand's cable; its four pucks are looked for when the arm's bus starts",
            Self::HandNotReady => "`tactus hand init`; its fingers will open",
            Self::HandOutOfRange => "choose a spread from 0 to 180 degrees and fingers from 0 to 140 degrees",
            Self::ImageFilter | Self::NoExpectation => "record the expectation: `tactus rehearse`",
            Self::HandFarFromStart => "`tactus hand to S,F1,F2,F3` moves it to the start",
            Self::ForceAtRest => "free the hand of load and contact; if it persists the sensor is adrift",
            Self::HandBusy => "wait until the hand has finished, or stop the motion",
            Self::NoArm => "ask the device that drives the arm",
            Self::HomeImplausible => "measure that joint again; angles are in rad, from J1 to J7",
            Self::HasTorque => "support the arm, press Shift+Idle on the pendant, then try again",
            Self::Observing => {
                "`tactus stop` stops the arm; commands that do more, like `tactus run`, connect as the host that commands"
            }
            Self::NameTaken => "choose another name, or delete that primitive first: `tactus delete NAME`",
            Self::WeightImplausible => "empty the hand, free the arm, and calibrate again: `tactus calibrate gravity`",
            Self::Locked => "name the file with its secret: `--secret-file FILE`, or set TACTUS_SECRET_FILE",
            Self::WrongProof => {
                "ask for the file of this device; without one its library has to be erased (docs/lab-guide.md)"
            }
            Self::ProofTooSoon => "try again in a second; `tactus secret status` counts the wrong ones",
            Self::NoSecret => "nothing has to be proven; `tactus secret set FILE` has it keep one",
            Self::SecretUnreadable => "`tactus secret set FILE` has it keep another one, `tactus secret clear` none",
            Self::SecretNotOffered => "keep those off its line who shall not command it",
            Self::OtherTool => {
                "enter the command again: it is then checked for what the arm carries now, which `tactus calibrate \
                 payload` tells"
            }
            Self::StoreWorn => {
                "save what it keeps with `tactus get NAME` and `tactus config dump`, then restart it once: where that \
                 does not help its flash is worn out; what is in it still runs"
            }
        }
    }
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.explanation())
    }
}

impl core::error::Error for Refusal {}
