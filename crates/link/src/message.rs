//! Messages between host and device.
//!
//! Both enums are **append-only**: postcard numbers variants and fields by position, so a variant or
//! field that moved would be read as another one. Never change or remove, only add at the end, and raise
//! `LINK_VERSION`. The first variant of each enum ([`Request::Hello`], [`Reply::Hello`]) and
//! [`Reply::Refused`] with the first refusals are frozen for ever: they are how two versions find out
//! that they do not fit.
//!
//! Units: SI. Joint arrays run from base to wrist. Quaternions (w, x, y, z).

use serde::{Deserialize, Serialize};

use crate::name::{Name, Text};
use crate::refusal::Refusal;
use crate::report::{
    Calibration, Event, FaultRecord, Listing, SecretReport, SessionOwner, Statistics, Status, StorageReport, Weight,
};
use crate::secret::Secret;
use crate::telemetry::Telemetry;

/// Most bytes of an image in one [`Request::UploadChunk`] or [`Reply::Chunk`].
///
/// 192 bytes make a frame of about 210: 2.3 ms on a serial line of 921 600 baud, so a chunk never delays
/// a stop request by more than one control cycle.
pub const CHUNK_BYTES: usize = 192;

/// The bytes of one chunk.
pub type ChunkData = heapless::Vec<u8, CHUNK_BYTES>;

/// A host's first words on a connection.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct HostHello {
    /// [`crate::LINK_VERSION`] of the host.
    pub link_version: u16,
    /// [`crate::SCHEMA_HASH`] of the host.
    pub schema_hash: u32,
    /// Hash of the robot model the host computes with (`control::MODEL_HASH`).
    pub model_hash: u32,
    /// Who is asking, for the refusal a second host gets, e.g. "anna@lab3".
    pub owner: Text,
}

/// The parts that the program of a device is made for. The [`Status`] tells which of them answer.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct Capabilities {
    /// It drives an arm.
    pub arm: bool,
    /// It drives a hand.
    pub hand: bool,
    /// It reads the wrench of a force/torque sensor.
    pub wrench: bool,
}

/// The device's answer to a matching [`HostHello`].
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct DeviceHello {
    /// [`crate::LINK_VERSION`] of the device.
    pub link_version: u16,
    /// [`crate::SCHEMA_HASH`] of the device.
    pub schema_hash: u32,
    /// Hash of the robot model in the firmware (`control::MODEL_HASH`).
    pub model_hash: u32,
    /// [`crate::image::IMAGE_SCHEMA`] the device stores.
    pub image_schema: u16,
    /// Most kernels of a primitive the device can hold.
    pub maximum_kernels: u16,
    /// Number of primitives the store can hold.
    pub slots: u8,
    /// Most bytes of one image.
    pub slot_bytes: u32,
    /// Control cycles per second, 300.
    pub cycles_per_second: u16,
    /// Unit of every `*_ticks` of the statistics: ticks per second.
    pub ticks_per_second: u32,
    /// A device that must not be mistaken for an arm: `true` under QEMU and in-process.
    pub simulated: bool,
    /// Firmware version and git revision, e.g. "0.1.0 (1a2b3c4)".
    pub firmware: Text,
    /// Board, e.g. "mps2-an500".
    pub board: Text,
    /// Serial number of the device.
    pub serial: Text,
    /// Parts that it can drive and read.
    pub capabilities: Capabilities,
    /// Instructions per tick, where time is counted in instructions as under QEMU; 0 where a clock runs.
    pub instructions_per_tick: u8,
}

/// Where a movement shall end, where it differs from the taught goal. `None` keeps the present one.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Goal {
    /// Grasp point in the world frame, m.
    pub position: Option<[f32; 3]>,
    /// Hand orientation, unit quaternion (w, x, y, z), hand to world.
    pub orientation: Option<[f32; 4]>,
}

/// Where the desired joint acceleration of Eq (10) comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub enum AccelerationSource {
    /// Computed from the plan's acceleration.
    #[default]
    Analytic,
    /// The filtered derivative of the desired joint velocity.
    Differentiated,
}

/// Options of a run. The default is the first run of a new primitive: as taught, open loop.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RunOptions {
    /// Goals that replace the taught ones.
    pub goal: Goal,
    /// Speed relative to the taught one: 1 as taught, 0.5 takes twice as long.
    pub speed: f32,
    /// The difference between measured and expected wrench bends the plan (Eqs 8, 9).
    pub feedback: bool,
    /// The force controller of Eq (12) adds its torque.
    pub force_control: bool,
    /// Acceleration used in Eq (10).
    pub acceleration: AccelerationSource,
    /// The fingers' strain gauges bend the plan of the fingers too; only with `feedback`.
    pub finger_feedback: bool,
    /// The arm gives way to what pushes it instead of insisting on the plan; Eq (11) is closed over the planned pose
    /// then, over the measured one otherwise. With `feedback` it gives way in any case.
    pub compliant: bool,
}

impl Default for RunOptions {
    fn default() -> Self {
        Self {
            goal: Goal::default(),
            speed: 1.0,
            feedback: false,
            force_control: false,
            acceleration: AccelerationSource::Analytic,
            finger_feedback: true,
            compliant: false,
        }
    }
}

/// Host to device. Every request is answered by exactly one [`Reply`] that carries its sequence number.
///
/// Repeating a request with the same sequence number is safe: the device answers again but acts once.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub enum Request {
    /// Opens a session; nothing else is answered before it. Answer: [`Reply::Hello`]. Frozen.
    Hello(HostHello),
    /// Closes the session, so that another host need not wait for the time-out.
    Goodbye,
    /// Keeps the session alive while the arm moves; does nothing else.
    Ping,
    /// Asks for [`Reply::Status`].
    Status,
    /// Asks for [`Reply::Statistics`].
    Statistics,
    /// Asks for [`Reply::Listing`] of one place in the store.
    List {
        /// 0 to `slots - 1`.
        index: u8,
    },
    /// Tells the device where the arm stands: the motor encoders count from there.
    Zero {
        /// Joint angles of the present pose, rad.
        home: [f32; 7],
    },
    /// Compensates gravity so that a person can lead the arm.
    Gravity,
    /// Holds the present pose.
    Hold,
    /// Moves the joints smoothly to a pose.
    Approach {
        /// Joint angles to reach, rad.
        q: [f32; 7],
        /// Time for it, s; 0 lets the device choose.
        duration: f32,
    },
    /// Runs a stored primitive.
    Run {
        /// Name of the primitive.
        name: Name,
        /// Options of the run.
        options: RunOptions,
    },
    /// Ends any motion: soft stop. Accepted in every state, and from anybody: it needs no session.
    Stop,
    /// Clears a latched fault whose cause is gone.
    ClearFault,
    /// Moves the goal of the running primitive.
    SetGoal(Goal),
    /// Changes the speed of the running primitive.
    SetSpeed {
        /// Relative to the taught speed.
        factor: f32,
    },
    /// Switches the stream of [`Reply::Telemetry`].
    Telemetry {
        /// One message every so many cycles: 1 is 300 Hz, 0 is off.
        every: u8,
    },
    /// Starts an upload; one that was under way is forgotten.
    UploadBegin {
        /// Name in the store. An image of that name is replaced only by the commit.
        name: Name,
        /// Bytes of the image.
        length: u32,
        /// Check sum of the image, [`crate::image::stored_crc`].
        crc: u32,
    },
    /// The next bytes of the image, in order.
    UploadChunk {
        /// Position of the first byte.
        offset: u32,
        /// The bytes.
        data: ChunkData,
    },
    /// Checks the image and puts it into the store.
    UploadCommit,
    /// Forgets the upload; the store is as before.
    UploadAbort,
    /// Removes a primitive from the store.
    Delete {
        /// Name of the primitive.
        name: Name,
    },
    /// Reads a stored image back. Answer: [`Reply::Chunk`].
    Read {
        /// Name of the primitive.
        name: Name,
        /// Position of the first byte.
        offset: u32,
    },
    /// Gives up torque: zero-torque frames, then none. An arm that is not braked sinks.
    Release,
    /// Takes the present wrench as zero.
    Tare,
    /// Opens the hand to its stops and lets it count from there. The fingers move, for about five seconds.
    InitialiseHand,
    /// Moves spread and fingers smoothly.
    MoveHand {
        /// Spread and fingers F1 to F3 (inner links), rad.
        q: [f32; 4],
        /// Time for it, s; 0 lets the device choose.
        duration: f32,
    },
    /// Asks for [`Reply::Calibration`].
    Calibration,
    /// Keeps a home of this arm's own, for every zeroing from now on; refused while the arm has torque. Answered when
    /// it is durable.
    Calibrate {
        /// Joint angles at which the arm stands when it is zeroed, rad.
        home: [f32; 7],
    },
    /// Forgets that home: the model's counts again. Refused while the arm has torque, answered when it is durable.
    ForgetCalibration,
    /// Opens the session of an observer, beside that of the host that commands: it may look and stop, nothing else.
    /// Answer: [`Reply::Hello`].
    Observe(HostHello),
    /// Gives a stored primitive another name. Answered when it is durable.
    Rename {
        /// Name of the primitive.
        name: Name,
        /// Its name from then on; none that the store holds.
        to: Name,
    },
    /// Asks for [`Reply::FaultRecord`].
    FaultRecord,
    /// Asks for [`Reply::FaultCycle`].
    FaultCycle {
        /// Number of the record, [`FaultRecord::number`].
        record: u16,
        /// Cycle of it, 0 for the oldest.
        index: u16,
    },
    /// Asks for [`Reply::Weight`].
    Weight,
    /// Keeps the weight of this arm's links, for gravity compensation from the next moment without torque on. Answered
    /// when it is durable.
    KeepWeight {
        /// It was measured with sensor and hand, otherwise with the bare arm.
        hand: bool,
        /// Share of mass beyond the model's, and shift of the first moment x, y, z (m), of links 1 to 7.
        links: [[f32; 4]; 7],
    },
    /// Forgets that weight: the model's counts again. Answered when it is durable.
    ForgetWeight,
    /// Asks for [`Reply::Owner`].
    Owner,
    /// Asks for [`Reply::Secret`].
    Secret,
    /// Asks for [`Reply::Challenge`]; an earlier one counts no more.
    Challenge,
    /// Proves that the host knows the device's secret, for as long as its session lasts. A challenge is good for one
    /// try.
    Prove {
        /// [`Secret::proof`] of the challenge and of this session.
        proof: u64,
    },
    /// Keeps this secret; it crosses the line as it is. Answered when it is durable.
    KeepSecret {
        /// The secret that has to be proven from then on.
        secret: Secret,
    },
    /// Forgets the secret: whoever has the session may do everything again. Answered when it is durable.
    ForgetSecret,
    /// Asks for [`Reply::Storage`].
    Storage {
        /// The place whose loss is told, 0 to `slots - 1`.
        place: u8,
    },
}

impl Request {
    /// True if the request can set the arm in motion or change a motion. Such a request is refused when it
    /// is older than [`crate::frame::REQUEST_AGE_LIMIT_MS`], so that a host that was suspended does not
    /// move an arm somebody now stands beside.
    #[must_use]
    pub fn moves(&self) -> bool {
        match self {
            Self::Zero { .. }
            | Self::Gravity
            | Self::Hold
            | Self::Approach { .. }
            | Self::Run { .. }
            | Self::ClearFault
            | Self::SetGoal(_)
            | Self::SetSpeed { .. }
            | Self::Release
            | Self::Tare
            | Self::InitialiseHand
            | Self::MoveHand { .. } => true,
            Self::Hello(_)
            | Self::Goodbye
            | Self::Ping
            | Self::Status
            | Self::Statistics
            | Self::List { .. }
            | Self::Stop
            | Self::Telemetry { .. }
            | Self::UploadBegin { .. }
            | Self::UploadChunk { .. }
            | Self::UploadCommit
            | Self::UploadAbort
            | Self::Delete { .. }
            | Self::Read { .. }
            // Only the next zeroing uses what they change, and that moves.
            | Self::Calibration
            | Self::Calibrate { .. }
            | Self::ForgetCalibration
            | Self::Observe(_)
            | Self::Rename { .. }
            | Self::FaultRecord
            | Self::FaultCycle { .. }
            // An arm that has torque goes on as it is.
            | Self::Weight
            | Self::KeepWeight { .. }
            | Self::ForgetWeight
            | Self::Owner
            | Self::Secret
            | Self::Challenge
            | Self::Prove { .. }
            | Self::KeepSecret { .. }
            | Self::ForgetSecret
            | Self::Storage { .. } => false,
        }
    }

    /// True if the request moves the arm or its hand, or changes what the device keeps: a device that keeps a secret
    /// does it only for a session that has proven to know it.
    #[must_use]
    pub fn is_guarded(&self) -> bool {
        match self {
            Self::UploadBegin { .. }
            | Self::UploadChunk { .. }
            | Self::UploadCommit
            | Self::UploadAbort
            | Self::Delete { .. }
            | Self::Rename { .. }
            | Self::Calibrate { .. }
            | Self::ForgetCalibration
            | Self::KeepWeight { .. }
            | Self::ForgetWeight
            | Self::KeepSecret { .. }
            | Self::ForgetSecret => true,
            // `Stop` is none of these that move.
            request => request.moves(),
        }
    }

    /// The name of the request in messages to people.
    #[must_use]
    pub fn name(&self) -> &'static str {
        match self {
            Self::Hello(_) => "hello",
            Self::Goodbye => "goodbye",
            Self::Ping => "ping",
            Self::Status => "status",
            Self::Statistics => "statistics",
            Self::List { .. } => "list",
            Self::Zero { .. } => "zero",
            Self::Gravity => "gravity",
            Self::Hold => "hold",
            Self::Approach { .. } => "approach",
            Self::Run { .. } => "run",
            Self::Stop => "stop",
            Self::ClearFault => "clear fault",
            Self::SetGoal(_) => "set goal",
            Self::SetSpeed { .. } => "set speed",
            Self::Telemetry { .. } => "telemetry",
            Self::UploadBegin { .. } => "upload begin",
            Self::UploadChunk { .. } => "upload chunk",
            Self::UploadCommit => "upload commit",
            Self::UploadAbort => "upload abort",
            Self::Delete { .. } => "delete",
            Self::Read { .. } => "read",
            Self::Release => "release",
            Self::Tare => "tare",
            Self::InitialiseHand => "initialise hand",
            Self::MoveHand { .. } => "move hand",
            Self::Calibration => "calibration",
            Self::Calibrate { .. } => "calibrate",
            Self::ForgetCalibration => "forget calibration",
            Self::Observe(_) => "observe",
            Self::Rename { .. } => "rename",
            Self::FaultRecord => "fault record",
            Self::FaultCycle { .. } => "fault cycle",
            Self::Weight => "weight",
            Self::KeepWeight { .. } => "keep weight",
            Self::ForgetWeight => "forget weight",
            Self::Owner => "owner",
            Self::Secret => "secret",
            Self::Challenge => "challenge",
            Self::Prove { .. } => "prove",
            Self::KeepSecret { .. } => "keep secret",
            Self::ForgetSecret => "forget secret",
            Self::Storage { .. } => "storage",
        }
    }
}

/// Device to host. `of` is the sequence number of the request that is answered.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[allow(
    clippy::large_enum_variant,
    reason = "no allocation on the device, so the largest message sets the size; boxing is not to be had"
)]
pub enum Reply {
    /// Session open. Frozen.
    Hello {
        /// Request answered.
        of: u16,
        /// Who the device is.
        hello: DeviceHello,
    },
    /// Request carried out, or handed to the control cycle.
    Accepted {
        /// Request answered.
        of: u16,
    },
    /// Request not carried out; nothing changed. Frozen.
    Refused {
        /// Request answered.
        of: u16,
        /// Why.
        reason: Refusal,
        /// Numbers that belong to the reason, see [`Refusal`]; 0 where it has none.
        detail: [u32; 2],
    },
    /// Answer to [`Request::Status`].
    Status {
        /// Request answered.
        of: u16,
        /// The state of the device.
        status: Status,
    },
    /// Answer to [`Request::Statistics`].
    Statistics {
        /// Request answered.
        of: u16,
        /// Counters since start-up.
        statistics: Statistics,
    },
    /// Answer to [`Request::List`].
    Listing {
        /// Request answered.
        of: u16,
        /// The primitive that is stored there; `None` if the place is empty.
        listing: Option<Listing>,
    },
    /// Answer to [`Request::Read`].
    Chunk {
        /// Request answered.
        of: u16,
        /// Position of the first byte.
        offset: u32,
        /// The bytes; fewer than asked for, or none, at the end of the image.
        data: ChunkData,
    },
    /// One control cycle, unasked, while the stream is on.
    Telemetry(Telemetry),
    /// Something happened, unasked.
    Event(Event),
    /// Answer to [`Request::Calibration`].
    Calibration {
        /// Request answered.
        of: u16,
        /// Where the arm's zero is.
        calibration: Calibration,
    },
    /// Answer to [`Request::FaultRecord`].
    FaultRecord {
        /// Request answered.
        of: u16,
        /// The record of the last fault; `None` if there was none, or the device keeps none.
        record: Option<FaultRecord>,
    },
    /// Answer to [`Request::FaultCycle`].
    FaultCycle {
        /// Request answered.
        of: u16,
        /// The cycle, its values rounded to 16 bits; `None` behind the last one, if another record has taken the place
        /// of this one, and if a reset has damaged it.
        cycle: Option<Telemetry>,
    },
    /// Answer to [`Request::Weight`].
    Weight {
        /// Request answered.
        of: u16,
        /// The weight of the links.
        weight: Weight,
    },
    /// Answer to [`Request::Owner`].
    Owner {
        /// Request answered.
        of: u16,
        /// The host that has the session; `None`: nobody has.
        owner: Option<SessionOwner>,
    },
    /// Answer to [`Request::Secret`].
    Secret {
        /// Request answered.
        of: u16,
        /// The secret without its bytes, and if this session has proven to know it.
        secret: SecretReport,
    },
    /// Answer to [`Request::Challenge`].
    Challenge {
        /// Request answered.
        of: u16,
        /// A number that the device has given to nobody since it started.
        nonce: u64,
    },
    /// Answer to [`Request::Storage`].
    Storage {
        /// Request answered.
        of: u16,
        /// Losses and condition of the storage.
        storage: StorageReport,
    },
}

impl Reply {
    /// Sequence number of the request this answers; `None` for what the device sends unasked.
    #[must_use]
    pub fn answers(&self) -> Option<u16> {
        match self {
            Self::Hello { of, .. }
            | Self::Accepted { of }
            | Self::Refused { of, .. }
            | Self::Status { of, .. }
            | Self::Statistics { of, .. }
            | Self::Listing { of, .. }
            | Self::Chunk { of, .. }
            | Self::Calibration { of, .. }
            | Self::FaultRecord { of, .. }
            | Self::FaultCycle { of, .. }
            | Self::Weight { of, .. }
            | Self::Owner { of, .. }
            | Self::Secret { of, .. }
            | Self::Challenge { of, .. }
            | Self::Storage { of, .. } => Some(*of),
            Self::Telemetry(_) | Self::Event(_) => None,
        }
    }
}
