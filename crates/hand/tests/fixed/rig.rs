//! A hand alone on the simulated bus, with the whole application of the hand in this process.

use std::collections::VecDeque;

use control::LoadRefusal;

use device::time::{CYCLE_SLOTS, SLOT_HZ};
use device::{
    Controller, ControllerIo, Health, HostSession, Identity, Message, QueueFull, SessionPort, Slot, StoredWeight,
    TimedRecord, Timing,
};
use hand::{Command, DeviceController, FingerPrimitive, HandApplication, Library, Record, Session};
use link::frame::{self, Decoder, Envelope, FRAME_BYTES, LINK_TIMEOUT_MS};
use link::{HostHello, LINK_VERSION, Reply, Request, SCHEMA_HASH, Text};
use pinned_init::InPlaceWrite;
use puck::CanFrame;
use sim::{FingerObstacle, FreeJoints, HOME, Plant, PlantConfig, TICKS_PER_MICROSECOND, Ticks};

/// Ticks of one slot.
pub(crate) const SLOT_TICKS: Ticks = sim::period_ticks(SLOT_HZ);

/// Ticks of one control cycle.
pub(crate) const CYCLE_TICKS: Ticks = CYCLE_SLOTS as Ticks * SLOT_TICKS;

/// Object between the fingers unless told otherwise.
pub(crate) const OBJECT: FingerObstacle = FingerObstacle { inner: f64::INFINITY, outer: 0.45, stiffness: 2.0 };

/// Queues between the halves, and the bus.
#[derive(Default)]
struct Queues {
    received: VecDeque<CanFrame>,
    sent: Vec<CanFrame>,
    commands: VecDeque<Command>,
    records: VecDeque<TimedRecord<Record>>,
    events: VecDeque<Message>,
    /// The CAN controller has no room.
    full: bool,
}

impl ControllerIo<DeviceController> for Queues {
    fn receive(&mut self) -> Option<CanFrame> {
        self.received.pop_front()
    }
    fn transmit(&mut self, frame: CanFrame) -> bool {
        if !self.full {
            self.sent.push(frame);
        }
        !self.full
    }
    fn command(&mut self) -> Option<Command> {
        self.commands.pop_front()
    }
    fn record(&mut self, record: Record) {
        self.records.push_back(TimedRecord { record, cost_ticks: 0 });
    }
    fn event(&mut self, event: Message) {
        self.events.push_back(event);
    }
}

struct Port<'a> {
    queues: &'a mut Queues,
    core: &'a mut DeviceController,
    line: &'a mut Vec<u8>,
}

impl SessionPort<DeviceController> for Port<'_> {
    fn send(&mut self, bytes: &[u8]) {
        self.line.extend_from_slice(bytes);
    }
    fn room(&self) -> usize {
        usize::MAX
    }
    fn command(&mut self, command: Command) -> Result<(), QueueFull> {
        self.queues.commands.push_back(command);
        Ok(())
    }
    fn load(&mut self, primitive: &FingerPrimitive) -> Result<(), LoadRefusal> {
        self.core.load(primitive)
    }
    fn weigh(&mut self, weight: &StoredWeight) -> bool {
        self.core.weigh(weight)
    }
    fn record(&mut self) -> Option<TimedRecord<Record>> {
        self.queues.records.pop_front()
    }
    fn event(&mut self) -> Option<Message> {
        self.queues.events.pop_front()
    }
    fn health(&mut self) -> Health {
        self.core.health()
    }
    fn timing(&mut self) -> Timing {
        Timing::default()
    }
}

/// True if a frame that is through at this time is lost.
type Loss = Box<dyn FnMut(&CanFrame, u64) -> bool>;

/// A hello that fits.
fn hello() -> Request {
    Request::Hello(HostHello {
        link_version: LINK_VERSION,
        schema_hash: SCHEMA_HASH,
        model_hash: control::MODEL_HASH,
        owner: Text::new("rig"),
    })
}

/// Device, bus and host in one.
pub(crate) struct Rig {
    pub(crate) plant: Plant,
    core: DeviceController,
    session: Box<Session<'static>>,
    queues: Queues,
    slot: Slot,
    ticks: u64,
    decoder: Decoder<FRAME_BYTES>,
    sequence: u16,
    /// The host pings by itself.
    pub(crate) alive: bool,
    /// Messages of the device, unasked or as an answer.
    pub(crate) heard: Vec<Reply>,
    /// Every record.
    pub(crate) records: Vec<Record>,
    /// Every frame the device sent.
    pub(crate) sent: Vec<CanFrame>,
    /// Frames from the bus that this takes away do not arrive.
    pub(crate) lose: Loss,
}

impl Rig {
    /// A hand that is switched on in this moment, with `obstacle` in the way of each finger.
    pub(crate) fn new(obstacle: FingerObstacle) -> Rig {
        let mut world = FreeJoints::weightless(HOME);
        (0..3).for_each(|finger| world.obstruct(finger, obstacle));
        let config = PlantConfig { hand_alone: true, ..PlantConfig::default() };
        let identity = Identity {
            firmware: "test",
            board: "test",
            serial: "test",
            simulated: true,
            ticks_per_second: 25_000_000,
            instructions_per_tick: 0,
        };
        let library: &'static mut Library = Box::leak(Box::new(Library::EMPTY));
        let Ok(session) = Box::new_uninit().write_init(HostSession::over(identity, HandApplication::new(library)));
        let mut rig = Rig {
            plant: Plant::new(config, Box::new(world)),
            core: DeviceController::new(),
            session,
            queues: Queues::default(),
            slot: Slot::Request,
            ticks: 10 * SLOT_TICKS,
            decoder: Decoder::new(),
            sequence: 0,
            alive: true,
            heard: Vec::new(),
            records: Vec::new(),
            sent: Vec::new(),
            lose: Box::new(|_, _| false),
        };
        assert!(matches!(rig.ask(hello()), Reply::Hello { .. }));
        rig
    }

    /// With a hand that has been found and initialised.
    pub(crate) fn ready(obstacle: FingerObstacle) -> Rig {
        let mut rig = Rig::new(obstacle);
        rig.wait(5.0, |rig| rig.health().hand == link::HandStage::NotInitialised);
        rig.accept(Request::InitialiseHand);
        rig.wait(20.0, |rig| rig.health().hand == link::HandStage::Ready);
        rig.run(0.1);
        rig
    }

    pub(crate) fn health(&self) -> Health {
        self.core.health()
    }

    /// The latest record.
    pub(crate) fn now(&self) -> Record {
        *self.records.last().expect("a record")
    }

    /// One slot.
    pub(crate) fn step(&mut self) {
        let now = self.ticks;
        while let Some(at) = self.plant.next_event().filter(|at| *at <= now) {
            if let Some(frame) = self.plant.event(at).received
                && !(self.lose)(&frame, at)
            {
                self.queues.received.push_back(frame);
            }
        }
        self.plant.advance(now);
        let now_us = now / TICKS_PER_MICROSECOND;
        self.core.slot(self.slot, now_us, &mut self.queues);
        self.records.extend(self.queues.records.iter().map(|timed| timed.record));
        let mut line = Vec::new();
        let Rig { core, session, queues, .. } = self;
        session.poll(now_us, &mut Port { queues, core, line: &mut line });
        let mut rest = line.as_slice();
        while let Some(frame) = self.decoder.next::<Reply>(&mut rest) {
            self.heard.push(frame.message);
        }
        for frame in self.queues.sent.drain(..) {
            self.sent.push(frame);
            self.plant.submit(now, frame);
        }
        self.slot = self.slot.next();
        self.ticks += SLOT_TICKS;
        if self.alive && (self.ticks / SLOT_TICKS).is_multiple_of(200) {
            self.send(&Request::Ping);
        }
    }

    /// A frame arrives beside those of the simulated bus, in the next slot.
    pub(crate) fn hear(&mut self, frame: CanFrame) {
        self.queues.received.push_back(frame);
    }

    /// The CAN controller leaves the bus, and comes back at once.
    pub(crate) fn bus_off(&mut self) {
        self.core.note_bus_error(true);
    }

    /// The CAN controller takes no frames from now on, or takes them again.
    pub(crate) fn jam(&mut self, full: bool) {
        self.queues.full = full;
    }

    /// So many seconds.
    pub(crate) fn run(&mut self, seconds: f64) {
        (0..(seconds * f64::from(SLOT_HZ)) as usize).for_each(|_| self.step());
    }

    /// Until something is so, at most `seconds`.
    #[track_caller]
    pub(crate) fn wait(&mut self, seconds: f64, mut done: impl FnMut(&Rig) -> bool) {
        for _ in 0..(seconds * f64::from(SLOT_HZ)) as usize {
            if done(self) {
                return;
            }
            self.step();
        }
        panic!("it did not happen within {seconds} s: {:?}", self.health());
    }

    fn send(&mut self, request: &Request) -> u16 {
        self.sequence = self.sequence.wrapping_add(1);
        let time_ms = (self.ticks / TICKS_PER_MICROSECOND / 1000) as u32;
        self.put(Envelope { session: 7, sequence: self.sequence, time_ms }, request);
        self.sequence
    }

    /// The answer to a host without a session.
    #[track_caller]
    pub(crate) fn ask_as_stranger(&mut self, request: Request) -> Reply {
        const OF: u16 = 60_000;
        self.heard.clear();
        self.put(Envelope { session: 999, sequence: OF, time_ms: 0 }, &request);
        self.run(0.1);
        self.heard.iter().find(|reply| reply.answers() == Some(OF)).expect("an answer").clone()
    }

    /// The host says its last word. Another one says hello just when the half second has passed in which the first was
    /// silent.
    pub(crate) fn change_hosts(&mut self) {
        self.alive = false;
        let milliseconds = |rig: &Rig| (rig.ticks / TICKS_PER_MICROSECOND / 1000) as u32;
        let last = milliseconds(self);
        self.accept(Request::Ping);
        while milliseconds(self) < last + LINK_TIMEOUT_MS {
            self.step();
        }
        let time_ms = milliseconds(self);
        self.put(Envelope { session: 8, sequence: 1, time_ms }, &hello());
    }

    fn put(&mut self, envelope: Envelope, request: &Request) {
        let mut buffer = [0; FRAME_BYTES];
        let length = frame::encode(envelope, request, &mut buffer).expect("it fits");
        self.session.receive(&buffer[..length]);
    }

    /// The answer to a request.
    #[track_caller]
    pub(crate) fn ask(&mut self, request: Request) -> Reply {
        let of = self.send(&request);
        for _ in 0..100 {
            self.step();
            if let Some(reply) = self.heard.iter().rev().find(|reply| reply.answers() == Some(of)) {
                return reply.clone();
            }
        }
        panic!("no answer to {}", request.name());
    }

    /// A request that must be accepted.
    #[track_caller]
    pub(crate) fn accept(&mut self, request: Request) {
        let reply = self.ask(request);
        assert!(matches!(reply, Reply::Accepted { .. }), "{reply:?}");
    }

    /// Why a request is refused.
    #[track_caller]
    pub(crate) fn refusal(&mut self, request: Request) -> link::Refusal {
        match self.ask(request) {
            Reply::Refused { reason, .. } => reason,
            reply => panic!("{reply:?}"),
        }
    }

    /// Uploads an image.
    #[track_caller]
    pub(crate) fn upload(&mut self, name: &str, image: &[u8]) {
        let (name, crc) = (link::Name::new(name).expect("a name"), link::image::stored_crc(image));
        self.accept(Request::UploadBegin { name, length: image.len() as u32, crc });
        for (index, part) in image.chunks(192).enumerate() {
            let data = link::message::ChunkData::from_slice(part).expect("it fits");
            self.accept(Request::UploadChunk { offset: 192 * index as u32, data });
        }
        self.accept(Request::UploadCommit);
    }
}
