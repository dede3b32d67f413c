//! One sample of every message and one image, with different values in all fields.

use link::frame::FRAME_BYTES;
use link::image::{
    ExpectationMarks, FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity,
};
use link::message::{AccelerationSource, ChunkData};
use link::{
    Calibration, Capabilities, DeviceHello, Event, EventKind, FaultRecord, Goal, HandStage, HomeSource, HostHello,
    LinkCounters, Listing, LostImage, Name, Refusal, Reply, Request, RunOptions, Secret, SecretReport, SecretState,
    SessionOwner, Statistics, Status, StorageReport, Telemetry, Text, Weight,
};

fn name() -> Name {
    Name::new("side-grasp").unwrap()
}

fn ramp<const N: usize>(first: f32) -> [f32; N] {
    core::array::from_fn(|index| first + 0.25 * index as f32)
}

fn data() -> ChunkData {
    ChunkData::from_slice(&[0, 1, 0, 0xFF, 0x7F]).unwrap()
}

/// Every request, in the order of the enum.
pub(crate) fn requests() -> Vec<Request> {
    let goal = Goal { position: Some(ramp(1.0)), orientation: Some([1.0, 0.0, 0.0, 0.0]) };
    let options = RunOptions {
        goal: Goal { position: None, ..goal },
        speed: 0.5,
        feedback: true,
        force_control: false,
        acceleration: AccelerationSource::Differentiated,
        finger_feedback: true,
        compliant: false,
    };
    let hello =
        HostHello { link_version: 1, schema_hash: 0x1234_5678, model_hash: 0x9ABC_DEF0, owner: Text::new("anna@lab3") };
    vec![
        Request::Hello(hello),
        Request::Goodbye,
        Request::Ping,
        Request::Status,
        Request::Statistics,
        Request::List { index: 3 },
        Request::Zero { home: ramp(-1.0) },
        Request::Gravity,
        Request::Hold,
        Request::Approach { q: ramp(-0.5), duration: 2.5 },
        Request::Run { name: name(), options },
        Request::Stop,
        Request::ClearFault,
        Request::SetGoal(goal),
        Request::SetSpeed { factor: 1.5 },
        Request::Telemetry { every: 3 },
        Request::UploadBegin { name: name(), length: 4321, crc: 0xCAFE_F00D },
        Request::UploadChunk { offset: 192, data: data() },
        Request::UploadCommit,
        Request::UploadAbort,
        Request::Delete { name: name() },
        Request::Read { name: name(), offset: 384 },
        Request::Release,
        Request::Tare,
        Request::InitialiseHand,
        Request::MoveHand { q: ramp(0.5), duration: 1.25 },
        Request::Calibration,
        Request::Calibrate { home: ramp(-2.0) },
        Request::ForgetCalibration,
        Request::Observe(HostHello { link_version: 6, schema_hash: 1, model_hash: 2, owner: Text::new("eve@lab4") }),
        Request::Rename { name: name(), to: Name::new("other.2").unwrap() },
        Request::FaultRecord,
        Request::FaultCycle { record: 300, index: 299 },
        Request::Weight,
        Request::KeepWeight { hand: true, links: core::array::from_fn(|link| ramp(link as f32)) },
        Request::ForgetWeight,
        Request::Owner,
        Request::Secret,
        Request::Challenge,
        Request::Prove { proof: 0xFEDC_BA98_7654_3210 },
        Request::KeepSecret { secret: Secret::new(core::array::from_fn(|index| 0xF0 + index as u8)) },
        Request::ForgetSecret,
        Request::Storage { place: 3 },
    ]
}

/// Place of a request in the enum. A new variant does not compile here, and so cannot be forgotten above.
pub(crate) fn request_index(request: &Request) -> usize {
    match request {
        Request::Hello(_) => 0,
        Request::Goodbye => 1,
        Request::Ping => 2,
        Request::Status => 3,
        Request::Statistics => 4,
        Request::List { .. } => 5,
        Request::Zero { .. } => 6,
        Request::Gravity => 7,
        Request::Hold => 8,
        Request::Approach { .. } => 9,
        Request::Run { .. } => 10,
        Request::Stop => 11,
        Request::ClearFault => 12,
        Request::SetGoal(_) => 13,
        Request::SetSpeed { .. } => 14,
        Request::Telemetry { .. } => 15,
        Request::UploadBegin { .. } => 16,
        Request::UploadChunk { .. } => 17,
        Request::UploadCommit => 18,
        Request::UploadAbort => 19,
        Request::Delete { .. } => 20,
        Request::Read { .. } => 21,
        Request::Release => 22,
        Request::Tare => 23,
        Request::InitialiseHand => 24,
        Request::MoveHand { .. } => 25,
        Request::Calibration => 26,
        Request::Calibrate { .. } => 27,
        Request::ForgetCalibration => 28,
        Request::Observe(_) => 29,
        Request::Rename { .. } => 30,
        Request::FaultRecord => 31,
        Request::FaultCycle { .. } => 32,
        Request::Weight => 33,
        Request::KeepWeight { .. } => 34,
        Request::ForgetWeight => 35,
        Request::Owner => 36,
        Request::Secret => 37,
        Request::Challenge => 38,
        Request::Prove { .. } => 39,
        Request::KeepSecret { .. } => 40,
        Request::ForgetSecret => 41,
        Request::Storage { .. } => 42,
    }
}

/// Every reply, in the order of the enum.
pub(crate) fn replies() -> Vec<Reply> {
    let hello = DeviceHello {
        link_version: 1,
        schema_hash: 0x1234_5678,
        model_hash: 0x9ABC_DEF0,
        image_schema: 1,
        maximum_kernels: 100,
        slots: 8,
        slot_bytes: 16_384,
        cycles_per_second: 300,
        ticks_per_second: 25_000_000,
        simulated: true,
        firmware: Text::new("0.1.0 (1a2b3c4)"),
        board: Text::new("mps2-an500"),
        serial: Text::new("SIM-7"),
        capabilities: Capabilities { arm: true, hand: false, wrench: true },
        instructions_per_tick: 5,
    };
    let status = Status {
        cycle: 301,
        state: 4,
        fault: 2,
        startup_stage: 7,
        blocked: Some([3, 260]),
        zeroed: true,
        safety_mode: Some(2),
        pendant: Some(0x0F3F_1249),
        loaded: Some(name()),
        phase: 0.75,
        q: ramp(-1.5),
        temperatures: [None, Some(-1), Some(64), None, None, None, Some(2)],
        telemetry_every: 3,
        upload_received: Some(576),
        hand_stage: HandStage::Ready,
        hand: ramp(0.75),
        hand_temperatures: [Some(31), None, Some(33), None],
        wrench_zeroed: Some(true),
    };
    let statistics = Statistics {
        cycles: 1,
        missed_deadlines: 2,
        cost_worst_ticks: 3,
        cost_mean_ticks: 4,
        latency_worst_ticks: 5,
        lost_replies: 6,
        late_replies: 7,
        rejected_frames: 8,
        frames_sent: 9,
        frames_received: 10,
        frames_dropped: 11,
        torque_mismatches: 23,
        bus_errors: 24,
        bus_restarts: 25,
        limited_cycles: 12,
        telemetry_dropped: 13,
        events_dropped: 14,
        link_timeouts: 15,
        link: LinkCounters { accepted: 16, bad_cobs: 17, bad_crc: 18, too_long: 19, undecodable: 20, overrun: 22 },
        stack_free: 21,
        stack_size: 300,
        hand_lost_replies: 26,
    };
    let listing = Listing {
        index: 2,
        name: name(),
        length: 4321,
        crc: 0xCAFE_F00D,
        duration: 5.0,
        kernels: 50,
        expectation: true,
        loaded: false,
    };
    // From counted bytes: a field that is new needs no word here.
    let bytes: Vec<u8> = (1..=0x7F).cycle().take(FRAME_BYTES).collect();
    let (telemetry, _): (Telemetry, _) = postcard::take_from_bytes(&bytes).expect("finite numbers");
    vec![
        Reply::Hello { of: 1, hello },
        Reply::Accepted { of: 300 },
        Reply::Refused { of: 3, reason: Refusal::LinkVersion, detail: [2, 1] },
        Reply::Status { of: 4, status },
        Reply::Statistics { of: 5, statistics },
        Reply::Listing { of: 6, listing: Some(listing) },
        Reply::Chunk { of: 7, offset: 192, data: data() },
        Reply::Telemetry(telemetry),
        Reply::Event(Event { cycle: 300, kind: EventKind::LinkTimeout, code: 1, detail: 500 }),
        Reply::Calibration {
            of: 9,
            calibration: Calibration { home: ramp(-2.0), source: HomeSource::Stored, zeroed_at: Some(ramp(-1.75)) },
        },
        Reply::FaultRecord { of: 10, record: Some(FaultRecord { number: 300, fault: 9, latched: true, cycles: 299 }) },
        Reply::FaultCycle { of: 11, cycle: Some(telemetry) },
        Reply::Weight {
            of: 12,
            weight: Weight {
                hand: true,
                links: core::array::from_fn(|link| ramp(-(link as f32))),
                source: HomeSource::Foreign,
                in_use: true,
            },
        },
        Reply::Owner { of: 13, owner: Some(SessionOwner { name: Text::new("eve@lab4"), since_ms: 95_000 }) },
        Reply::Secret { of: 14, secret: SecretReport { state: SecretState::Kept, proven: true, wrong_proofs: 300 } },
        Reply::Challenge { of: 15, nonce: 0x0123_4567_89AB_CDEF },
        Reply::Storage {
            of: 16,
            storage: StorageReport {
                formatted: false,
                failed: true,
                bad_sector: Some(5),
                lost: 2,
                settings_lost: 6,
                unread: 7,
                loss: Some(LostImage { place: 3, name: Some(name()), older: true }),
            },
        },
    ]
}

/// Place of a reply in the enum.
pub(crate) fn reply_index(reply: &Reply) -> usize {
    match reply {
        Reply::Hello { .. } => 0,
        Reply::Accepted { .. } => 1,
        Reply::Refused { .. } => 2,
        Reply::Status { .. } => 3,
        Reply::Statistics { .. } => 4,
        Reply::Listing { .. } => 5,
        Reply::Chunk { .. } => 6,
        Reply::Telemetry(_) => 7,
        Reply::Event(_) => 8,
        Reply::Calibration { .. } => 9,
        Reply::FaultRecord { .. } => 10,
        Reply::FaultCycle { .. } => 11,
        Reply::Weight { .. } => 12,
        Reply::Owner { .. } => 13,
        Reply::Secret { .. } => 14,
        Reply::Challenge { .. } => 15,
        Reply::Storage { .. } => 16,
    }
}

/// Every kind of event, in the order of the enum.
pub(crate) const EVENT_KINDS: [EventKind; 10] = [
    EventKind::State,
    EventKind::Arrived,
    EventKind::Startup,
    EventKind::SafetyMode,
    EventKind::LinkTimeout,
    EventKind::Store,
    EventKind::CommandRefused,
    EventKind::Blocked,
    EventKind::Surprise,
    EventKind::Hand,
];

/// Place of an event kind in the enum.
pub(crate) fn event_index(kind: EventKind) -> usize {
    match kind {
        EventKind::State => 0,
        EventKind::Arrived => 1,
        EventKind::Startup => 2,
        EventKind::SafetyMode => 3,
        EventKind::LinkTimeout => 4,
        EventKind::Store => 5,
        EventKind::CommandRefused => 6,
        EventKind::Blocked => 7,
        EventKind::Surprise => 8,
        EventKind::Hand => 9,
    }
}

/// The tables of the sample image, kept apart because the content borrows them.
pub(crate) struct Tables {
    k1: Vec<f32>,
    k2: Vec<f32>,
    weights: Vec<f32>,
    mean: Vec<f32>,
    statistics_mean: Vec<f32>,
    statistics_spread: Vec<f32>,
    kernels: usize,
}

impl Tables {
    /// Tables with so many kernels and points.
    pub(crate) fn new(kernels: usize, gain_points: usize, expectation_points: usize, statistics_points: usize) -> Self {
        let series = |count: usize, step: f32| (0..count).map(|index| step * index as f32 - 1.0).collect();
        Self {
            k1: series(10 * gain_points, 0.5),
            k2: series(9 * gain_points, 0.25),
            weights: series(17 * kernels, 0.125),
            mean: series(9 * expectation_points, 2.0),
            statistics_mean: series(12 * statistics_points, 3.0),
            statistics_spread: series(12 * statistics_points, 5.0),
            kernels,
        }
    }

    /// A content with these tables.
    pub(crate) fn content(&self) -> ImageContent<&[f32]> {
        let waypoint = |shift: f32| Waypoint {
            position: ramp(shift),
            orientation: [0.5, -0.5, 0.5, shift],
            posture: ramp(shift + 1.0),
            hand: ramp(shift + 2.0),
        };
        ImageContent {
            model_hash: 0x9ABC_DEF0,
            duration: 5.0,
            alpha: 4.605,
            activation: 0.7,
            stiffness: [200.0, 201.0, 202.0, 203.0],
            damping: [28.0, 20.0, 29.0, 30.0],
            orientation_error: OrientationError::RotationVector,
            hemisphere: Hemisphere::Demonstrated,
            start: waypoint(0.5),
            start_velocity: WaypointVelocity {
                position: ramp(0.0),
                orientation: ramp(1.0),
                posture: ramp(2.0),
                hand: ramp(3.0),
            },
            goal: waypoint(-0.5),
            clamps: FeedbackClamps { position: 0.23, orientation: 0.5, hand: 0.25 },
            marks: ExpectationMarks {
                recorded_duration: 5.5,
                payload_mass: 0.75,
                payload_centre: [0.01, 0.02, 0.03],
                filter_cutoff: 7.5,
                trials: 3.0,
                spread_floor: 0.1,
            },
            statistics_trials: 7,
            kernels: self.kernels,
            k1: &self.k1,
            k2: &self.k2,
            weights: &self.weights,
            expected_mean: &self.mean,
            statistics_mean: &self.statistics_mean,
            statistics_spread: &self.statistics_spread,
        }
    }

    /// The image of these tables.
    pub(crate) fn image(&self) -> Vec<u8> {
        let mut bytes = vec![0; link::image::IMAGE_BYTES_LIMIT];
        let length = self.content().encode(&name(), &mut bytes).unwrap();
        bytes.truncate(length);
        bytes
    }
}
