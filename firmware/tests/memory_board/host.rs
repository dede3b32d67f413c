//! The test's processor and its host: calls each task when its interrupt would, and talks with the session in frames.

use std::cell::RefCell;
use std::convert::Infallible;
use std::pin::Pin;
use std::rc::Rc;
use std::task::{Context, Poll, Waker};

use control::Payload;
use control::model::{ArmModel, Frames};
use control::units::JointPositions;
use device::storage::Opening;
use device::{Controller as _, DeviceController, FaultMemory, Store};
use firmware::application::{
    self, Application, ArmSession, CorePlace, Log, LogTask, Memory, ReceiveTask, SessionTask, SlotTask, StackUse,
    StorageScratch, TransmitTask,
};
use firmware::board::Board;
use firmware::meters::Meters;
use flash::{FlashChip, FlashPort, VirtualClock};
use link::frame::{self, Decoder, Envelope, FRAME_BYTES};
use link::image::{FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity};
use link::message::{ChunkData, HostHello};
use link::{Event, LINK_VERSION, Name, PrimitiveImage, Reply, Request, SCHEMA_HASH, Status, Text};
use rtic_core::Mutex;
use sim::{FreeJoints, HOME, Plant, PlantConfig, TICKS_PER_SECOND, Ticks};

use crate::board::{Can, MemoryBoard, SLOT_TICKS, Shared, set_now};

/// Something two tasks share.
struct Lock<T>(Rc<RefCell<T>>);

impl<T> Clone for Lock<T> {
    fn clone(&self) -> Self {
        Self(self.0.clone())
    }
}

impl<T> Lock<T> {
    fn new(content: T) -> Self {
        Self(Rc::new(RefCell::new(content)))
    }
}

impl<T> Mutex for Lock<T> {
    type T = T;

    fn lock<R>(&mut self, action: impl FnOnce(&mut T) -> R) -> R {
        action(&mut self.0.borrow_mut())
    }
}

/// The lines that people would read.
#[derive(Clone, Copy, Default)]
pub(crate) struct Heard {
    pub(crate) events: usize,
    pub(crate) opening: Option<Opening>,
}

#[derive(Clone, Default)]
struct Notes(Rc<RefCell<Heard>>);

impl Log for Notes {
    fn event(&mut self, _event: &device::Event) {
        self.0.borrow_mut().events += 1;
    }

    fn lost(&mut self, count: u32) {
        panic!("{count} frames or events were lost between the tasks");
    }

    fn storage(&mut self, opening: &Opening) {
        self.0.borrow_mut().opening = Some(*opening);
    }
}

/// The processor, the arm and the host.
pub(crate) struct Host {
    plant: Plant,
    silicon: Shared,
    now: Ticks,
    core: Lock<&'static mut DeviceController>,
    can: Lock<Can>,
    session: Lock<&'static mut ArmSession>,
    slot_task: SlotTask<MemoryBoard, DeviceController>,
    receive_task: ReceiveTask,
    transmit_task: TransmitTask,
    session_task: SessionTask<MemoryBoard, DeviceController>,
    log_task: LogTask,
    storage_task: Pin<Box<dyn Future<Output = Infallible>>>,
    flash_clock: VirtualClock,
    meters: Meters,
    notes: Notes,
    decoder: Decoder<FRAME_BYTES>,
    sequence: u16,
    device_ms: u32,
    events: Vec<Event>,
    /// The session's task does not come back: a defect that no test knows.
    session_hangs: bool,
}

impl Host {
    /// From now on the task of the session does not come back, or it does again.
    pub(crate) fn hang(&mut self, session_hangs: bool) {
        self.session_hangs = session_hangs;
    }

    /// State and fault of the control half, which nobody has to ask the session for.
    pub(crate) fn core(&self) -> (control::State, control::Fault) {
        let health = self.core.0.borrow().health();
        (health.state, health.fault)
    }

    /// Power on: an arm in its home posture, a device with this flash.
    pub(crate) fn new(chip: FlashChip) -> Self {
        set_now(0);
        let flash_clock = VirtualClock::default();
        let silicon = Shared::default();
        let board = MemoryBoard { silicon: silicon.clone(), flash: FlashPort::new(chip, flash_clock.clone()) };
        let serial = board.serial();
        let memory = Box::leak(Box::new(Memory::new()));
        let (core, faults) = (Box::new(CorePlace::uninit()), Box::new(FaultMemory::BLANK));
        let Application { core, can, session, slot_task, receive_task, transmit_task, session_task, log_task, flash } =
            application::start("test", serial, board.split(), memory, Box::leak(core), Box::leak(faults));
        let (session, notes) = (Lock::new(session), Notes::default());
        let room = Box::leak(Box::new(StorageScratch::new()));
        Self {
            plant: Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(HOME))),
            silicon,
            now: 0,
            core: Lock::new(core),
            can: Lock::new(can),
            storage_task: Box::pin(application::keep_library(flash, room, session.clone(), notes.clone())),
            session,
            slot_task,
            receive_task,
            transmit_task,
            session_task,
            log_task,
            flash_clock,
            meters: Meters::new(),
            notes,
            decoder: Decoder::new(),
            sequence: 0,
            device_ms: 0,
            events: Vec::new(),
            session_hangs: false,
        }
    }

    /// The log so far.
    pub(crate) fn log(&self) -> Heard {
        *self.notes.0.borrow()
    }

    /// True if the device knows what it holds.
    pub(crate) fn is_library_open(&self) -> bool {
        self.session.0.borrow().store().is_open()
    }

    /// Does what happens next: something on the bus, or a slot.
    fn step(&mut self) {
        let slot = self.silicon.borrow().next_slot.expect("the timer of the slots runs");
        match self.plant.next_event().filter(|at| *at < slot) {
            Some(at) => {
                self.set(at);
                let event = self.plant.event(at);
                if event.transmitted {
                    let mut silicon = self.silicon.borrow_mut();
                    silicon.waiting = silicon.waiting.saturating_sub(1);
                }
                if let Some(frame) = event.received {
                    self.silicon.borrow_mut().received.push_back(frame);
                    self.receive_task.run(self.can.clone(), &self.meters);
                }
                if event.transmitted {
                    self.transmit();
                }
            }
            None => {
                self.set(slot);
                self.plant.advance(slot);
                self.silicon.borrow_mut().next_slot = Some(slot + SLOT_TICKS);
                self.slot_task.run(self.core.clone(), self.can.clone(), &self.meters);
                self.transmit();
                if !self.session_hangs {
                    let (task, core, meters) = (&mut self.session_task, self.core.clone(), &self.meters);
                    let news = self.session.lock(|session| task.run(session, core, meters, StackUse::default));
                    if news {
                        self.log_task.run(&self.meters, &mut self.notes);
                    }
                }
            }
        }
        let mut context = Context::from_waker(Waker::noop());
        let Poll::Pending = self.storage_task.as_mut().poll(&mut context);
    }

    fn set(&mut self, now: Ticks) {
        self.now = now.max(self.now);
        set_now(self.now);
        self.flash_clock.set(self.now);
    }

    fn transmit(&mut self) {
        self.transmit_task.run(self.can.clone());
        while let Some(frame) = { self.silicon.borrow_mut().outgoing.pop_front() } {
            self.plant.submit(self.now, frame);
        }
    }

    /// Lets time pass, s, and takes what the device says meanwhile.
    pub(crate) fn wait(&mut self, seconds: f64) {
        let end = self.now + (seconds * TICKS_PER_SECOND as f64) as Ticks;
        while self.now < end {
            self.step();
        }
        self.listen(None);
    }

    /// As [`Self::wait`], but says every 0.1 s that somebody is there: an arm that moves stops otherwise.
    pub(crate) fn stay(&mut self, seconds: f64) {
        for _ in 0..(seconds * 10.0) as u32 {
            self.wait(0.1);
            self.accepted(Request::Ping);
        }
    }

    /// Takes what the device has sent; the answer to `of`, if it is there.
    fn listen(&mut self, of: Option<u16>) -> Option<Reply> {
        let bytes = std::mem::take(&mut self.silicon.borrow_mut().to_host);
        let mut rest = bytes.as_slice();
        let mut answer = None;
        while let Some(frame) = self.decoder.next::<Reply>(&mut rest) {
            self.device_ms = frame.envelope.time_ms;
            match frame.message {
                Reply::Event(event) => self.events.push(event),
                reply if reply.answers() == of && of.is_some() => answer = Some(reply),
                _ => {}
            }
        }
        answer
    }

    /// Asks and waits for the answer, 10 s at most.
    pub(crate) fn ask(&mut self, request: Request) -> Option<Reply> {
        self.sequence += 1;
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope { session: 7, sequence: self.sequence, time_ms: self.device_ms };
        let length = frame::encode(envelope, &request, &mut buffer).expect("a request fits a frame");
        self.silicon.borrow_mut().from_host.extend(&buffer[..length]);
        let end = self.now + 10 * TICKS_PER_SECOND;
        while self.now < end {
            self.step();
            if let Some(reply) = self.listen(Some(self.sequence)) {
                return Some(reply);
            }
        }
        None
    }

    /// Asks for something that must be accepted.
    pub(crate) fn accepted(&mut self, request: Request) {
        let what = format!("{request:?}");
        let reply = self.ask(request);
        assert!(matches!(reply, Some(Reply::Accepted { .. })), "{what}: {reply:?}");
    }

    /// Opens the session.
    pub(crate) fn greet(&mut self) {
        let hello = HostHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: control::MODEL_HASH,
            owner: Text::new("test"),
        };
        let reply = self.ask(Request::Hello(hello));
        assert!(matches!(reply, Some(Reply::Hello { .. })), "{reply:?}");
    }

    /// The status.
    pub(crate) fn status(&mut self) -> Status {
        match self.ask(Request::Status) {
            Some(Reply::Status { status, .. }) => status,
            other => panic!("{other:?}"),
        }
    }

    /// Waits for an event, 20 s at most, saying now and then that somebody is there.
    pub(crate) fn wait_for(&mut self, what: &str, is_it: impl Fn(&Event) -> bool) {
        for _ in 0..200 {
            if std::mem::take(&mut self.events).iter().any(&is_it) {
                return;
            }
            self.accepted(Request::Ping);
            self.wait(0.1);
        }
        panic!("{what} did not come");
    }

    /// Sends an image and has it committed.
    pub(crate) fn upload(&mut self, name: &str, image: &[u8]) {
        let crc = PrimitiveImage::parse(image).expect("a sound image").crc();
        let name = Name::new(name).expect("a name");
        self.accepted(Request::UploadBegin { name, length: image.len() as u32, crc });
        for (index, part) in image.chunks(192).enumerate() {
            let data = ChunkData::from_slice(part).expect("a part fits");
            self.accepted(Request::UploadChunk { offset: index as u32 * 192, data });
        }
        self.accepted(Request::UploadCommit);
    }

    /// Names in the library, in the order of their places.
    pub(crate) fn names(&mut self) -> Vec<String> {
        let mut names = Vec::new();
        for index in 0..application::PRIMITIVES as u8 {
            match self.ask(Request::List { index }) {
                Some(Reply::Listing { listing: Some(entry), .. }) => names.push(entry.name.as_str().to_owned()),
                Some(Reply::Listing { listing: None, .. }) => {}
                other => panic!("{other:?}"),
            }
        }
        names
    }
}

/// Where the movement begins.
pub(crate) fn start_posture() -> [f32; 7] {
    [0.0, 0.5, 0.0, 1.5, 0.0, 0.5, 0.0]
}

/// A movement of 2 s from there, with some weights to make it as long as a taught one.
pub(crate) fn image(name: &str) -> Vec<u8> {
    let kernels = 25;
    let weights = vec![0.0; 17 * kernels];
    let [a, b, c, d, e, f, g] = start_posture();
    let mut content: ImageContent<&[f32]> = ImageContent {
        model_hash: control::MODEL_HASH,
        duration: 2.0,
        alpha: 4.605,
        activation: 0.7,
        stiffness: [200.0; 4],
        damping: [28.28, 20.0, 28.28, 28.28],
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: waypoint(start_posture()),
        start_velocity: WaypointVelocity::default(),
        goal: waypoint([a + 0.2, b, c, d - 0.2, e, f, g]),
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
    let mut bytes = vec![0; link::image::IMAGE_BYTES_LIMIT];
    let length = content.encode(&Name::new(name).expect("a name"), &mut bytes).expect("it fits");
    bytes.truncate(length);
    bytes
}

fn waypoint(posture: [f32; 7]) -> Waypoint {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let [x, y, z, w, i, j, k] = Frames::new(&model, &JointPositions::from_array(posture)).tool_pose().to_f32();
    Waypoint { position: [x, y, z], orientation: [w, i, j, k], posture, hand: [0.0; 4] }
}
