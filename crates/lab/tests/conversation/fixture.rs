//! A device in virtual time: the real session, a control half that does as it is told, and a line that can be cut.

use std::collections::VecDeque;
use std::time::Duration;

use control::model::ArmModel;
use control::{CycleRecord, LoadRefusal, Payload, State};
use device::{
    CheckedPrimitive, Command, Counters, DeviceController, Event, EventKind, Health, Identity, QueueFull, RamStore,
    Session, SessionPort, Stage, StoreError, StoredWeight, TimedRecord, Timing,
};
use lab::client::Client;
use lab::transport::{Transport, TransportError};
use link::frame::{Decoder, FRAME_BYTES, Frame};
use link::image::{FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity};
use link::{Name, Refusal, Reply};
use pinned_init::InPlaceWrite;

/// One step of the virtual clock: a third of a control cycle.
pub(crate) const STEP: Duration = Duration::from_nanos(1_111_111);

/// A control half that takes every command and does what it says at once.
pub(crate) struct Half {
    pub(crate) state: State,
    pub(crate) hand: link::HandStage,
    pub(crate) commands: Vec<Command>,
    pub(crate) events: VecDeque<Event>,
    pub(crate) records: VecDeque<TimedRecord>,
    pub(crate) line: Vec<u8>,
}

impl SessionPort<DeviceController> for Half {
    fn send(&mut self, bytes: &[u8]) {
        self.line.extend_from_slice(bytes);
    }

    fn command(&mut self, command: Command) -> Result<(), QueueFull> {
        self.commands.push(command);
        if let Command::Control(command) = command {
            self.state = match command {
                control::Command::Gravity => State::Gravity,
                control::Command::Run(_) => State::Run,
                control::Command::Stop => State::SoftStop,
                _ => State::Hold,
            };
        }
        self.events.push_back(Event { cycle: 0, kind: EventKind::Accepted });
        Ok(())
    }

    fn load(&mut self, _fit: &CheckedPrimitive<'_>) -> Result<(), LoadRefusal> {
        Ok(())
    }

    fn weigh(&mut self, _: &StoredWeight) -> bool {
        true
    }

    fn record(&mut self) -> Option<TimedRecord> {
        self.records.pop_front()
    }

    fn event(&mut self) -> Option<Event> {
        self.events.pop_front()
    }

    fn health(&mut self) -> Health {
        Health {
            cycle: 0,
            stage: Stage::Ready,
            blocked: None,
            state: self.state,
            law: self.state,
            fault: control::Fault::None,
            zeroed: true,
            zeroed_at: None,
            has_primitive: true,
            payload: Payload::SensorAndHand,
            wrench_zeroed: Some(true),
            safety_mode: None,
            pendant: None,
            temperatures: [None; 7],
            hand: self.hand,
            hand_moves: false,
            hand_temperatures: [None; 4],
            counters: Counters::default(),
        }
    }

    fn timing(&mut self) -> Timing {
        Timing::default()
    }
}

/// A device in virtual time, with a line that can be cut or lose frames.
pub(crate) struct Device {
    pub(crate) session: Box<Session<RamStore<3, 4096>>>,
    pub(crate) half: Half,
    pub(crate) steps: u32,
    /// Of these, those that had passed when it was started the last time.
    pub(crate) booted: u32,
    /// Every so many portions from the host are lost; 0: none.
    pub(crate) lose_every: u32,
    /// Every so many portions to the host are lost; 0: none.
    pub(crate) lose_answers_every: u32,
    pub(crate) portions: u32,
    pub(crate) answers: u32,
    /// The device is dead.
    pub(crate) dead: bool,
    /// The cable is out.
    pub(crate) unplugged: bool,
    /// Its hello says that it drives no arm.
    pub(crate) armless: bool,
    /// It tells an event in place of every control cycle.
    pub(crate) without_cycles: bool,
    /// Answers that are still to be "the storage is being read".
    pub(crate) reading: u32,
    /// Steps for which the host is suspended in its next wait.
    pub(crate) suspended: u32,
    /// Control cycles for which a stop still brakes, and the way of each joint so far (rad).
    pub(crate) braking: (u32, f32),
}

impl Device {
    pub(crate) fn new() -> Self {
        let identity = Identity {
            firmware: "1.2.3",
            board: "test",
            serial: "T-1",
            simulated: true,
            ticks_per_second: 25_000_000,
            instructions_per_tick: 0,
        };
        let Ok(session) = Box::new_uninit().write_init(Session::init(identity, RamStore::new()));
        Self {
            session,
            half: Half {
                state: State::Hold,
                hand: link::HandStage::Absent,
                commands: Vec::new(),
                events: VecDeque::new(),
                records: VecDeque::new(),
                line: Vec::new(),
            },
            steps: 0,
            booted: 0,
            lose_every: 0,
            lose_answers_every: 0,
            portions: 0,
            answers: 0,
            dead: false,
            unplugged: false,
            armless: false,
            without_cycles: false,
            reading: 0,
            suspended: 0,
            braking: (0, 0.0),
        }
    }

    pub(crate) fn step(&mut self) {
        self.steps += 1;
        if self.steps.is_multiple_of(3) {
            let cycle = u64::from(self.steps / 3);
            if self.half.state == State::SoftStop && self.braking.0 > 0 {
                self.braking = (self.braking.0 - 1, self.braking.1 + 0.002);
            }
            let record = CycleRecord { cycle, state: self.half.state, q: [self.braking.1; 7], ..CycleRecord::EMPTY };
            if self.without_cycles {
                self.half.events.push_back(Event { cycle, kind: EventKind::Arrived });
            } else {
                self.half.records.push_back(TimedRecord { record, cost_ticks: 7 });
            }
        }
        if !self.dead {
            self.session.poll((STEP * (self.steps - self.booted)).as_micros() as u64, &mut self.half);
        }
    }

    /// A reset: it knows nobody any more, and its time begins anew.
    pub(crate) fn restart(&mut self) {
        *self = Self { steps: self.steps, booted: self.steps, ..Self::new() };
    }
}

/// True if the present one of a series is one that gets lost.
pub(crate) fn is_lost(every: u32, count: &mut u32) -> bool {
    *count += 1;
    every > 0 && count.is_multiple_of(every)
}

impl Transport for Device {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        if self.unplugged {
            return Err(TransportError::Closed);
        }
        if !is_lost(self.lose_every, &mut self.portions) {
            self.session.receive(bytes);
        }
        Ok(())
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        if self.suspended > 0 {
            // As a read does whose time is over when the program goes on: what has come is still to be read.
            (0..std::mem::take(&mut self.suspended)).for_each(|_| self.step());
            return Ok(());
        }
        let until = self.now() + timeout;
        while self.half.line.is_empty() && self.now() < until {
            self.step();
        }
        let mut bytes = std::mem::take(&mut self.half.line);
        if self.armless {
            bytes = without_arm(&bytes);
        }
        if self.reading > 0 {
            bytes = still_reading(&bytes, &mut self.reading);
        }
        if !bytes.is_empty() && !is_lost(self.lose_answers_every, &mut self.answers) {
            out.extend_from_slice(&bytes);
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        STEP * self.steps
    }

    fn is_virtual(&self) -> bool {
        true
    }
}

/// The same answers, but that a hello says that the device drives no arm.
pub(crate) fn without_arm(bytes: &[u8]) -> Vec<u8> {
    changed(bytes, |message| {
        if let Reply::Hello { hello, .. } = message {
            hello.capabilities.arm = false;
        }
    })
}

/// The same answers, but that the first `count` of them refuse because the storage is being read.
fn still_reading(bytes: &[u8], count: &mut u32) -> Vec<u8> {
    changed(bytes, |message| {
        if let (Some(of), true) = (message.answers(), *count > 0) {
            *count -= 1;
            *message = Reply::Refused { of, reason: Refusal::StoreFailed, detail: [StoreError::Busy.code(), 0] };
        }
    })
}

fn changed(mut bytes: &[u8], mut change: impl FnMut(&mut Reply)) -> Vec<u8> {
    let (mut decoder, mut out) = (Decoder::<FRAME_BYTES>::new(), Vec::new());
    while let Some(Frame { envelope, mut message }) = decoder.next::<Reply>(&mut bytes) {
        change(&mut message);
        let mut buffer = [0; FRAME_BYTES];
        let length = link::frame::encode(envelope, &message, &mut buffer).unwrap();
        out.extend_from_slice(&buffer[..length]);
    }
    out
}

pub(crate) fn connected() -> Client<Device> {
    Client::connect(Device::new(), "test").unwrap()
}

pub(crate) fn image(name: &str, duration: f32) -> Vec<u8> {
    let posture = [0.0, 0.5, 0.0, 1.5, 0.0, 0.5, 0.0];
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let q = control::units::JointPositions::from_array(posture);
    let [x, y, z, w, i, j, k] = control::model::Frames::new(&model, &q).tool_pose().to_f32();
    let there = Waypoint { position: [x, y, z], orientation: [w, i, j, k], posture, hand: [0.0; 4] };
    let content: ImageContent<&[f32]> = ImageContent {
        model_hash: control::MODEL_HASH,
        duration,
        alpha: 4.605,
        activation: 0.7,
        stiffness: [200.0; 4],
        damping: [28.28, 20.0, 28.28, 28.28],
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: there,
        start_velocity: WaypointVelocity::default(),
        goal: there,
        clamps: FeedbackClamps { position: 0.2, orientation: 0.5, hand: 0.5 },
        marks: Default::default(),
        kernels: 20,
        k1: &[],
        k2: &[],
        weights: &[0.0; 17 * 20],
        expected_mean: &[],
        statistics_trials: 0,
        statistics_mean: &[],
        statistics_spread: &[],
    };
    let mut bytes = vec![0; 4096];
    let length = content.encode(&Name::new(name).unwrap(), &mut bytes).unwrap();
    bytes.truncate(length);
    bytes
}
