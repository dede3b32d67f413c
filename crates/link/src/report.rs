//! Reports of the device: status, statistics, listing, events.
//!
//! Codes (`state`, `fault`, start-up stage) are numbers of `control` and `device`, which name and explain
//! them; this crate only carries them.

use serde::{Deserialize, Serialize};

use crate::name::{Name, Text};

/// Stage of the hand's start-up. Append-only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum HandStage {
    /// Not all four pucks of the hand answer: the arm is used without it.
    #[default]
    Absent,
    /// The pucks are awake; where the fingers stand is unknown until a person has the hand initialised.
    NotInitialised,
    /// The fingers drive to their open stops.
    Initialising,
    /// Positions and strain gauges are read in every cycle, the hand can be moved.
    Ready,
    /// The initialisation did not end, or a puck fell silent or lost its position. The hand is not driven.
    Failed,
}

impl HandStage {
    /// The words for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Absent => "absent",
            Self::NotInitialised => "not initialised",
            Self::Initialising => "initialising",
            Self::Ready => "ready",
            Self::Failed => "failed",
        }
    }

    /// Number of the stage in events.
    #[must_use]
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The stage with a number.
    #[must_use]
    pub const fn from_code(code: u8) -> Option<Self> {
        Some(match code {
            0 => Self::Absent,
            1 => Self::NotInitialised,
            2 => Self::Initialising,
            3 => Self::Ready,
            4 => Self::Failed,
            _ => return None,
        })
    }
}

/// The state of the device at one moment.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Status {
    /// Control cycles since start-up.
    pub cycle: u32,
    /// Code of the supervisor's state (`control::State`).
    pub state: u8,
    /// Code of the latched fault (`control::Fault`), 0 for none.
    pub fault: u8,
    /// Stage of the bus start-up (`device`), the last one when the arm is ready.
    pub startup_stage: u8,
    /// Why the start-up cannot go on, as `device` encodes it; `None` if it can.
    pub blocked: Option<[u32; 2]>,
    /// The encoders count from a known pose.
    pub zeroed: bool,
    /// Mode of the safety module: 0 E-stop, 1 idle, 2 active; `None` before it first answered.
    pub safety_mode: Option<u8>,
    /// Pendant word of the safety module, as read from the bus; `None` before it was read.
    pub pendant: Option<u32>,
    /// Name of the primitive in the control cycle.
    pub loaded: Option<Name>,
    /// Phase s of the running primitive: 1 at the start, about 0.01 at the end.
    pub phase: f32,
    /// Measured joint angles, rad.
    pub q: [f32; 7],
    /// Temperature of each arm puck, degree Celsius; `None` before it was read.
    pub temperatures: [Option<i16>; 7],
    /// Telemetry is sent every so many cycles, 0 for off.
    pub telemetry_every: u8,
    /// Bytes of the upload under way that have arrived.
    pub upload_received: Option<u32>,
    /// Stage of the hand's start-up.
    pub hand_stage: HandStage,
    /// Spread and fingers F1 to F3 as measured, rad; 0 unless the hand is ready.
    pub hand: [f32; 4],
    /// Temperature of each hand puck (F1, F2, F3, spread), degree Celsius; `None` before it was read.
    pub hand_temperatures: [Option<i16>; 4],
    /// The wrench has a zero: the arm has rested since its bus was started. `None`: there is no force/torque sensor.
    pub wrench_zeroed: Option<bool>,
}

/// Whose home counts when the arm is zeroed, and whose weight its links are taken to have. Append-only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum HomeSource {
    /// The robot model's: this arm has none of its own.
    #[default]
    Model,
    /// This arm's own, stored in the device.
    Stored,
    /// The model's: what the device had stored is damaged.
    Damaged,
    /// The model's: what the device had stored is of another layout or for another robot model.
    Foreign,
}

impl HomeSource {
    /// The words for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Model => "the model's",
            Self::Stored => "stored in the device",
            Self::Damaged => "the model's, because the stored one is damaged",
            Self::Foreign => "the model's, because the stored one is for another robot model or layout",
        }
    }
}

/// Where the zero of the arm's joint angles is.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Calibration {
    /// Joint angles at which the next zeroing takes the arm to stand, rad.
    pub home: [f32; 7],
    /// Whose these are.
    pub source: HomeSource,
    /// Joint angles at which the last zeroing took the arm to stand, rad; `None` if the device has not zeroed it since
    /// its bus was started.
    pub zeroed_at: Option<[f32; 7]>,
}

/// The weight of the links that gravity compensation computes with.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Weight {
    /// It was measured with sensor and hand, otherwise with the bare arm.
    pub hand: bool,
    /// Share of mass beyond the model's, and shift of the first moment x, y, z (m), of links 1 to 7; zero where the
    /// model's counts.
    pub links: [[f32; 4]; 7],
    /// Whose it is.
    pub source: HomeSource,
    /// It counts now: it is stored, the arm has been without torque since, and carries what it was measured with.
    pub in_use: bool,
}

/// The host that has the session.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct SessionOwner {
    /// Its name in its hello, for example "anna@lab3".
    pub name: Text,
    /// Time since that hello, ms.
    pub since_ms: u32,
}

/// The secret of a device, without its bytes. Append-only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize)]
pub enum SecretState {
    /// There is none: whoever has the session may do everything.
    #[default]
    Nothing,
    /// One is kept: a session has to prove that it knows it.
    Kept,
    /// One is kept that cannot be read: damaged, or of another layout. Nothing is moved or changed until another one is
    /// kept, or it is forgotten.
    Unreadable,
    /// The device has no place to keep one.
    NotOffered,
}

impl SecretState {
    /// The words for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Nothing => "none",
            Self::Kept => "kept",
            Self::Unreadable => "unreadable",
            Self::NotOffered => "not offered",
        }
    }
}

/// A device's secret, and what was tried against it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SecretReport {
    /// There is one, or none.
    pub state: SecretState,
    /// The session that asks has proven that it knows it.
    pub proven: bool,
    /// Wrong proofs since start-up.
    pub wrong_proofs: u32,
}

/// An image that the device once kept and cannot read.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct LostImage {
    /// Its place.
    pub place: u8,
    /// Its name, if that can still be read.
    pub name: Option<Name>,
    /// The place holds an image of before; what is lost may have been a deletion.
    pub older: bool,
}

/// The storage of a device: what was lost in it since it was written, and whether it still takes anything.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct StorageReport {
    /// It was blank or foreign, or nothing in it could be read: it was erased at the start.
    pub formatted: bool,
    /// It does not work at all: nothing is kept over a restart.
    pub failed: bool,
    /// The sector that cannot be erased or written: no change is taken.
    pub bad_sector: Option<u8>,
    /// Number of places whose newest image is lost.
    pub lost: u8,
    /// Settings whose newest value is lost: bit 0 the home, bit 1 the weight, bit 2 the secret. One of before counts,
    /// or none.
    pub settings_lost: u8,
    /// Damaged values that do not tell whose they are; they may be old ones that nobody misses.
    pub unread: u8,
    /// The lost image of the place that was asked for.
    pub loss: Option<LostImage>,
}

/// Counters of the receiving end of a link. Every byte that arrived is accounted for in one of these.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LinkCounters {
    /// Frames that were good.
    pub accepted: u32,
    /// Frames dropped: the byte stuffing is broken.
    pub bad_cobs: u32,
    /// Frames dropped: wrong check sum, or too short to hold one.
    pub bad_crc: u32,
    /// Frames dropped: longer than any message.
    pub too_long: u32,
    /// Frames dropped: right check sum but not a message of this version.
    pub undecodable: u32,
    /// Good frames dropped because those before them were not answered yet.
    pub overrun: u32,
}

/// Counters since start-up. They wrap at 2^32.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Statistics {
    /// Control cycles.
    pub cycles: u32,
    /// Cycles whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// Longest control computation, ticks.
    pub cost_worst_ticks: u32,
    /// Mean control computation, ticks.
    pub cost_mean_ticks: u32,
    /// Longest delay from the timer to the control task, ticks.
    pub latency_worst_ticks: u32,
    /// Replies that did not come in their cycle.
    pub lost_replies: u32,
    /// Replies that came after their cycle.
    pub late_replies: u32,
    /// Bus frames that were no valid answer to anything asked.
    pub rejected_frames: u32,
    /// Bus frames sent.
    pub frames_sent: u32,
    /// Bus frames received.
    pub frames_received: u32,
    /// Bus frames the controller could not send or take.
    pub frames_dropped: u32,
    /// Cycles in which only one of the two torque frames could be sent.
    pub torque_mismatches: u32,
    /// Errors of the bus that its controller reported.
    pub bus_errors: u32,
    /// Times the bus start-up began anew.
    pub bus_restarts: u32,
    /// Cycles in which the torque limiter was at work, among those whose records reached the link.
    pub limited_cycles: u32,
    /// Telemetry messages left out because the line was full.
    pub telemetry_dropped: u32,
    /// Events left out because the queue was full.
    pub events_dropped: u32,
    /// Motions stopped because the host fell silent.
    pub link_timeouts: u32,
    /// Counters of the device's end of the link.
    pub link: LinkCounters,
    /// Stack never used so far, bytes; 0 where it is not measured.
    pub stack_free: u32,
    /// Size of the stack, bytes; 0 where it is not measured.
    pub stack_size: u32,
    /// Replies of the hand that did not come in their cycle.
    pub hand_lost_replies: u32,
}

/// One primitive in the store.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Listing {
    /// Its place in the store.
    pub index: u8,
    /// Its name.
    pub name: Name,
    /// Bytes of the image.
    pub length: u32,
    /// Check sum of the image, [`crate::image::stored_crc`]: two images with the same length and CRC are the same.
    pub crc: u32,
    /// Duration as taught, s.
    pub duration: f32,
    /// Kernels of each row.
    pub kernels: u16,
    /// It has a table of the wrench to expect.
    pub expectation: bool,
    /// It is the one in the control cycle.
    pub loaded: bool,
}

/// The last second before a fault, as far as the device has kept it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct FaultRecord {
    /// Number of the record, from 1: another number is another record.
    pub number: u16,
    /// Code of the fault that ended it; 0: the device restarted.
    pub fault: u8,
    /// The fault has not been cleared.
    pub latched: bool,
    /// Control cycles in it, the last one being that of the fault.
    pub cycles: u16,
}

/// Kind of an event. Append-only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum EventKind {
    /// The supervisor entered a state: `code` is the state, `detail` the fault that led there, 0 for none.
    State,
    /// The movement ended and the arm holds the goal.
    Arrived,
    /// The bus start-up reached a stage: `code` is the stage.
    Startup,
    /// The safety module changed mode: `code` is the new mode, `detail` 1 if the device has asked for it: brakes alone
    /// hold the arm, for example one that was activated and fell before anybody had commanded it.
    SafetyMode,
    /// The host fell silent during a motion and the device stops it: `detail` is the silence in ms.
    LinkTimeout,
    /// The store changed: `code` is the place.
    Store,
    /// The control cycle refused a command nobody waits for any more: `code` is `control`'s reason.
    CommandRefused,
    /// The bus start-up cannot go on: `code` and `detail` as `Status::blocked`.
    Blocked,
    /// The run no longer goes as the successful ones before it: `code` is the channel of the statistics, `detail` how
    /// far the movement has come, 0 to 1000.
    Surprise,
    /// The hand reached a stage: `code` is [`HandStage`]. `detail`: the CAN node that caused it in the low 8 bits and
    /// the number of the reason (`device`) above them; 0 for none.
    Hand,
}

/// Something happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Event {
    /// Control cycle in which it happened.
    pub cycle: u32,
    /// What.
    pub kind: EventKind,
    /// See [`EventKind`].
    pub code: u16,
    /// See [`EventKind`].
    pub detail: u32,
}
