//! A session on a bench: a line, a control half that only answers, and a host that only speaks frames.

use std::collections::VecDeque;

use control::model::{ArmModel, Frames, WeightCorrection};
use control::units::JointPositions;
use control::{CycleRecord, Fault, LoadRefusal, Payload, State};
use device::{
    CheckedPrimitive, Command, Counters, DeviceController, Event, EventKind, FaultMemory, Health, Identity, QueueFull,
    RamStore, Session, SessionPort, Stage, StoredPrimitive, StoredWeight, TimedRecord, Timing,
};
use link::frame::{self, Decoder, Envelope, FRAME_BYTES, Frame};
use link::image::{FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity};
use link::message::{ChunkData, DeviceHello, HostHello};
use link::{HandStage, LINK_VERSION, Name, Refusal, Reply, Request, SCHEMA_HASH, Text};
use pinned_init::InPlaceWrite;
use puck::SafetyMode;

/// Places of the store on the bench.
pub(crate) const SLOTS: usize = 3;
/// Bytes of a place.
pub(crate) const SLOT_BYTES: usize = 4096;

/// The store on the bench.
pub(crate) type Store = RamStore<SLOTS, SLOT_BYTES>;

/// The control half and the line, as far as the session sees them.
pub(crate) struct Bench {
    /// Bytes the session has sent.
    pub(crate) line: Vec<u8>,
    /// Bytes that the line can take.
    pub(crate) room: usize,
    /// Commands that have reached the control half.
    pub(crate) commands: Vec<Command>,
    /// True if the queue of commands is full.
    pub(crate) stuck: bool,
    /// Events waiting for the session.
    pub(crate) events: VecDeque<Event>,
    /// Records waiting for the session.
    pub(crate) records: VecDeque<TimedRecord>,
    /// Durations of the primitives that were loaded.
    pub(crate) loaded: Vec<f32>,
    /// The one loaded last.
    pub(crate) primitive: Option<StoredPrimitive>,
    /// Answer of the control half to a load.
    pub(crate) load: Result<(), LoadRefusal>,
    /// The state of the control half.
    pub(crate) state: State,
    /// The state that it bridges while it coasts.
    pub(crate) bridged: State,
    /// Its latched fault.
    pub(crate) fault: Fault,
    /// The hand moves by itself.
    pub(crate) hand_moves: bool,
    /// Payload of its arm.
    pub(crate) payload: Payload,
    /// Where its arm was zeroed.
    pub(crate) zeroed_at: Option<[f32; 7]>,
    /// The weights it was given, newest last; it takes none while the arm has torque.
    pub(crate) weights: Vec<WeightCorrection>,
    /// Counters of the control half.
    pub(crate) counters: Counters,
    /// The last second before a fault.
    pub(crate) faults: Box<FaultMemory>,
}

impl SessionPort<DeviceController> for Bench {
    fn send(&mut self, bytes: &[u8]) {
        assert!(bytes.len() <= self.room, "the session sent more than there was room for");
        self.line.extend_from_slice(bytes);
    }

    fn room(&self) -> usize {
        self.room
    }

    fn command(&mut self, command: Command) -> Result<(), QueueFull> {
        if self.stuck {
            return Err(QueueFull);
        }
        self.commands.push(command);
        Ok(())
    }

    fn load(&mut self, fit: &CheckedPrimitive<'_>) -> Result<(), LoadRefusal> {
        assert_ne!(self.state, State::Run, "a primitive was exchanged under a run");
        self.load?;
        self.loaded.push(fit.primitive().movement().duration());
        self.primitive = Some(fit.primitive().clone());
        Ok(())
    }

    fn weigh(&mut self, weight: &StoredWeight) -> bool {
        let takes = !self.state.has_torque();
        if takes {
            self.weights.push(weight.correction());
        }
        takes
    }

    fn record(&mut self) -> Option<TimedRecord> {
        self.records.pop_front()
    }

    fn event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    fn health(&mut self) -> Health {
        Health {
            cycle: 1234,
            stage: Stage::Ready,
            blocked: None,
            state: self.state,
            law: if self.state == State::Coast { self.bridged } else { self.state },
            fault: self.fault,
            zeroed: true,
            zeroed_at: self.zeroed_at,
            payload: self.payload,
            has_primitive: self.primitive.is_some(),
            wrench_zeroed: Some(true),
            safety_mode: Some(SafetyMode::Active),
            pendant: Some(0x0F3F_1249),
            temperatures: [Some(30), None, None, None, None, None, Some(35)],
            hand: HandStage::NotInitialised,
            hand_moves: self.hand_moves,
            hand_temperatures: [Some(31), None, None, Some(34)],
            counters: self.counters,
        }
    }

    fn timing(&mut self) -> Timing {
        Timing { cost_worst_ticks: 30_000, ..Timing::default() }
    }

    fn fault_memory(&mut self) -> Option<&mut FaultMemory> {
        Some(&mut self.faults)
    }
}

/// A session with its bench and one host.
pub(crate) struct Rig<S: device::Store = Store> {
    /// The session under test.
    pub(crate) session: Box<Session<S>>,
    /// Everything around it.
    pub(crate) bench: Bench,
    /// The device's time, ms.
    pub(crate) now_ms: u64,
    /// The host's session number.
    pub(crate) number: u16,
    /// The host's last sequence number.
    pub(crate) sequence: u16,
    /// Bytes that the hosts have sent, as whoever listens on the line records them.
    pub(crate) said: Vec<u8>,
    decoder: Decoder<FRAME_BYTES>,
}

impl Rig {
    /// A session nobody has spoken to.
    pub(crate) fn new() -> Self {
        Self::over(Store::new())
    }

    /// A session with an open conversation.
    pub(crate) fn greeted() -> Self {
        let mut rig = Self::new();
        rig.greet();
        rig
    }
}

impl<S: device::Store> Rig<S> {
    /// A session over a store of another kind, nobody has spoken to.
    pub(crate) fn over(store: S) -> Self {
        let identity = Identity {
            firmware: "1.2.3 (abcdef0)",
            board: "bench",
            serial: "B-1",
            simulated: true,
            ticks_per_second: 25_000_000,
            instructions_per_tick: 0,
        };
        let mut bench = Bench {
            line: Vec::new(),
            room: 4096,
            commands: Vec::new(),
            stuck: false,
            events: VecDeque::new(),
            records: VecDeque::new(),
            loaded: Vec::new(),
            primitive: None,
            load: Ok(()),
            state: State::Hold,
            bridged: State::Run,
            fault: Fault::None,
            hand_moves: false,
            payload: Payload::SensorAndHand,
            zeroed_at: None,
            weights: Vec::new(),
            counters: Counters::default(),
            faults: Box::new(FaultMemory::BLANK),
        };
        bench.faults.resume();
        let Ok(session) = Box::new_uninit().write_init(Session::init(identity, store));
        Self { session, bench, now_ms: 10_000, number: 77, sequence: 0, said: Vec::new(), decoder: Decoder::new() }
    }

    /// Says hello as the present host.
    pub(crate) fn greet(&mut self) -> DeviceHello {
        match self.ask(Request::Hello(hello())) {
            Some(Reply::Hello { hello, .. }) => hello,
            other => panic!("no hello but {other:?}"),
        }
    }

    /// Puts a request on the line, decided on `age_ms` ago, and lets the session look at it.
    pub(crate) fn put(&mut self, sequence: u16, age_ms: u32, request: &Request) {
        let mut buffer = [0; FRAME_BYTES];
        let time_ms = (self.now_ms as u32).wrapping_sub(age_ms);
        let envelope = Envelope { session: self.number, sequence, time_ms };
        let length = frame::encode(envelope, request, &mut buffer).unwrap();
        self.said.extend_from_slice(&buffer[..length]);
        self.session.receive(&buffer[..length]);
        self.poll();
    }

    /// Sends a request with the next number and gives the answer that comes at once, if any.
    pub(crate) fn ask(&mut self, request: Request) -> Option<Reply> {
        self.sequence = self.sequence.wrapping_add(1);
        self.put(self.sequence, 0, &request);
        self.answer()
    }

    /// The answer to the last request among what was sent.
    pub(crate) fn answer(&mut self) -> Option<Reply> {
        let of = self.sequence;
        self.sent().into_iter().map(|frame| frame.message).find(|reply| reply.answers() == Some(of))
    }

    /// Asks and expects to be refused.
    pub(crate) fn refused(&mut self, request: Request) -> (Refusal, [u32; 2]) {
        match self.ask(request) {
            Some(Reply::Refused { reason, detail, .. }) => (reason, detail),
            other => panic!("not refused but {other:?}"),
        }
    }

    /// Asks for something that is done at once.
    pub(crate) fn done(&mut self, request: Request) {
        match self.ask(request) {
            Some(Reply::Accepted { .. }) => {}
            other => panic!("not accepted but {other:?}"),
        }
    }

    /// Asks for something of the control half, which takes it.
    pub(crate) fn commanded(&mut self, request: Request) {
        assert_eq!(self.ask(request), None, "answered before the control half had decided");
        self.event(EventKind::Accepted);
        assert!(matches!(self.answer(), Some(Reply::Accepted { .. })));
    }

    /// The control half tells something.
    pub(crate) fn event(&mut self, kind: EventKind) {
        self.bench.events.push_back(Event { cycle: 1234, kind });
        self.poll();
    }

    /// A control cycle ends.
    pub(crate) fn cycle(&mut self, number: u64, fault: Fault) {
        let record = CycleRecord { cycle: number, state: self.bench.state, fault, ..CycleRecord::EMPTY };
        self.bench.fault = fault;
        self.bench.records.push_back(TimedRecord { record, cost_ticks: 99 });
        self.poll();
    }

    /// Lets the session work.
    pub(crate) fn poll(&mut self) {
        self.session.poll(1000 * self.now_ms, &mut self.bench);
    }

    /// Lets time pass, a millisecond at a time.
    pub(crate) fn wait(&mut self, milliseconds: u64) {
        for _ in 0..milliseconds {
            self.now_ms += 1;
            self.poll();
        }
    }

    /// Takes what the session has sent.
    pub(crate) fn sent(&mut self) -> Vec<Frame<Reply>> {
        let line = std::mem::take(&mut self.bench.line);
        let mut bytes = line.as_slice();
        std::iter::from_fn(|| self.decoder.next::<Reply>(&mut bytes)).collect()
    }

    /// Uploads an image as a host does, up to and including the commit.
    pub(crate) fn upload(&mut self, name: &str, image: &[u8]) -> Option<Reply> {
        self.send_parts(name, image);
        self.ask(Request::UploadCommit)
    }

    /// Uploads an image that is taken.
    pub(crate) fn store(&mut self, name: &str, image: &[u8]) {
        match self.upload(name, image) {
            Some(Reply::Accepted { .. }) => {}
            Some(Reply::Refused { reason: Refusal::PrimitiveInvalid, detail, .. }) => {
                panic!("not taken: {}", device::PrimitiveDefect(detail))
            }
            other => panic!("not taken but {other:?}"),
        }
    }

    /// Uploads all parts of an image.
    pub(crate) fn send_parts(&mut self, name: &str, image: &[u8]) {
        self.send_parts_as(name, link::image::stored_crc(image), image);
    }

    /// Uploads all parts of an image that was announced with this check sum.
    pub(crate) fn send_parts_as(&mut self, name: &str, crc: u32, image: &[u8]) {
        self.done(Request::UploadBegin { name: Name::new(name).unwrap(), length: image.len() as u32, crc });
        for (index, part) in image.chunks(192).enumerate() {
            self.done(Request::UploadChunk { offset: 192 * index as u32, data: ChunkData::from_slice(part).unwrap() });
        }
    }

    /// Names in the store, as the listing tells them.
    pub(crate) fn names(&mut self) -> Vec<String> {
        (0..SLOTS as u8)
            .filter_map(|index| match self.ask(Request::List { index }) {
                Some(Reply::Listing { listing, .. }) => listing.map(|listing| listing.name.to_string()),
                other => panic!("no listing but {other:?}"),
            })
            .collect()
    }
}

/// The arm primitives are checked against.
pub(crate) fn model() -> ArmModel<f32> {
    ArmModel::new(Payload::SensorAndHand)
}

/// A hello that fits.
pub(crate) fn hello() -> HostHello {
    HostHello {
        link_version: LINK_VERSION,
        schema_hash: SCHEMA_HASH,
        model_hash: control::MODEL_HASH,
        owner: Text::new("bench"),
    }
}

/// An image this arm can run: from one posture to another, straight, with so many kernels.
pub(crate) fn image(name: &str, duration: f32, kernels: usize) -> Vec<u8> {
    image_with(name, duration, kernels, |_| {})
}

/// The same after `change`.
pub(crate) fn image_with(
    name: &str,
    duration: f32,
    kernels: usize,
    change: impl FnOnce(&mut ImageContent<&[f32]>),
) -> Vec<u8> {
    let weights = vec![0.0; 17 * kernels];
    let mut content: ImageContent<&[f32]> = ImageContent {
        model_hash: control::MODEL_HASH,
        duration,
        alpha: 4.605,
        activation: 0.7,
        stiffness: [200.0; 4],
        damping: [28.28, 20.0, 28.28, 28.28],
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: waypoint([0.0, 0.5, 0.0, 1.5, 0.0, 0.5, 0.0]),
        start_velocity: WaypointVelocity::default(),
        goal: waypoint([0.3, 0.7, 0.0, 1.3, 0.0, 0.5, 0.0]),
        clamps: FeedbackClamps { position: 0.2, orientation: 0.5, hand: 0.5 },
        marks: Default::default(),
        kernels,
        k1: &[],
        k2: &[],
        weights: &weights,
        expected_mean: &[],
        statistics_trials: 0,
        statistics_mean: &[],
        statistics_spread: &[],
    };
    // The same rotation has two signs; a demonstration would have kept the one of its start.
    let dot: f32 = content.start.orientation.iter().zip(content.goal.orientation).map(|(a, b)| a * b).sum();
    content.goal.orientation = content.goal.orientation.map(|part| part * dot.signum());
    change(&mut content);
    let mut bytes = vec![0; link::image::IMAGE_BYTES_LIMIT];
    let length = content.encode(&Name::new(name).unwrap(), &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}

fn waypoint(posture: [f32; 7]) -> Waypoint {
    let [x, y, z, w, i, j, k] = Frames::new(&model(), &JointPositions::from_array(posture)).tool_pose().to_f32();
    Waypoint { position: [x, y, z], orientation: [w, i, j, k], posture, hand: [0.0; 4] }
}
