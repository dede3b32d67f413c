//! A host in this process: says hello over the serial line, asks how the device is, tells it where the arm stands.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use link::frame::{Decoder, Envelope, FRAME_BYTES, encode};
use link::message::{DeviceHello, HostHello};
use link::{
    FaultRecord, LINK_VERSION, Refusal, Reply, Request, SCHEMA_HASH, Statistics, Status, StorageReport, Telemetry, Text,
};
use puck::{CanFrame, Node};
use sim::{HOME, TICKS_PER_MILLISECOND, Ticks};

use crate::world::Host;

/// Stages of the start-up, as they travel over the link.
const WAITING_FOR_ZERO: u8 = 6;
/// Everything is there but the person at the pendant.
const WAITING_FOR_ACTIVE: u8 = 9;
/// The arm can be commanded.
pub const READY: u8 = 10;
/// State of an arm without torque, and of one whose fault a person must clear.
const IDLE: u8 = 0;
const FAULT: u8 = 7;
/// State of an arm that holds.
pub const HOLD: u8 = 2;

/// Time between two questions.
const PACE: Ticks = 20 * TICKS_PER_MILLISECOND;

/// Time after which an answer is not waited for any longer.
const TIMEOUT: Ticks = 200 * TICKS_PER_MILLISECOND;

/// Frames kept from the beginning.
const FIRST: usize = 5;

/// Knowledge of the host.
#[derive(Debug, Default)]
pub struct Learned {
    /// Who the device is.
    pub hello: Option<DeviceHello>,
    /// When the device was first ready, ticks.
    pub ready_at: Option<Ticks>,
    /// The last answer.
    pub status: Option<Status>,
    /// The last counters.
    pub statistics: Option<Statistics>,
    /// The last second before a fault or a restart, if the device has kept one.
    pub fault_record: Option<FaultRecord>,
    /// The newest cycle of it.
    pub fault_cycle: Option<Telemetry>,
    /// Answers to the order to keep a weight: `None` for yes, or the refusal with its first detail.
    pub kept: Vec<Option<(Refusal, u32)>>,
    /// The storage as the device last told it.
    pub storage: Option<StorageReport>,
    /// Questions, and those that were answered.
    pub asked: u64,
    /// See above.
    pub answered: u64,
    /// The longest time from a question to its answer, ticks.
    pub slowest: Ticks,
    /// The first frames of the device on the arm's bus.
    pub first_frames: Vec<CanFrame>,
    /// Hash over time, sender and content of every frame on the arm's bus.
    pub bus_hash: u64,
    /// Frames on the arm's bus.
    pub frames: u64,
}

/// [`Learned`], shared with who set the host up.
#[derive(Clone, Debug, Default)]
pub struct SharedLearned(Arc<Mutex<Learned>>);

impl SharedLearned {
    /// Knowledge of the host.
    pub fn lock(&self) -> MutexGuard<'_, Learned> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// The host.
pub struct Inquirer {
    learned: SharedLearned,
    model_hash: u32,
    decoder: Decoder<FRAME_BYTES>,
    envelope: Envelope,
    asked_at: Ticks,
    waiting: bool,
    turn: u32,
    holds: bool,
    keeps: bool,
    /// Orders to keep a weight, whose answers may come long after other questions.
    orders: Vec<u16>,
}

impl Inquirer {
    /// A host that knows this robot model.
    #[must_use]
    pub fn new(model_hash: u32, learned: SharedLearned) -> Self {
        Self {
            learned,
            model_hash,
            decoder: Decoder::new(),
            envelope: Envelope { session: 7, ..Envelope::default() },
            asked_at: 0,
            waiting: false,
            turn: 0,
            holds: false,
            keeps: false,
            orders: Vec::new(),
        }
    }

    /// The same, which orders an arm to hold that is ready and idle, and clears its fault once the bus is up again.
    #[must_use]
    pub fn holding(self) -> Self {
        Self { holds: true, ..self }
    }

    /// The same, which has a weight kept again and again, and asks how the storage is.
    #[must_use]
    pub fn keeping(self) -> Self {
        Self { keeps: true, ..self.holding() }
    }

    /// The next question.
    fn question(&mut self) -> Request {
        let learned = self.learned.lock();
        if learned.hello.is_none() {
            let owner = Text::new("emulated-board check");
            return Request::Hello(HostHello {
                link_version: LINK_VERSION,
                schema_hash: SCHEMA_HASH,
                model_hash: self.model_hash,
                owner,
            });
        }
        let stage = learned.status.as_ref().map(|status| status.startup_stage);
        let is_in = |state| learned.status.as_ref().is_some_and(|status| status.state == state);
        self.turn += 1;
        if self.keeps && matches!(stage, Some(WAITING_FOR_ACTIVE | READY)) {
            match self.turn % 16 {
                3 => return Request::KeepWeight { hand: true, links: [[0.0; 4]; 7] },
                11 => return Request::Storage { place: 0 },
                _ => {}
            }
        }
        match self.turn % 4 {
            0 if self.holds && is_in(IDLE) && stage == Some(READY) => Request::Hold,
            0 if self.holds && is_in(FAULT) && stage == Some(WAITING_FOR_ACTIVE) => Request::ClearFault,
            0 if stage == Some(WAITING_FOR_ZERO) => Request::Zero { home: HOME.map(|angle| angle as f32) },
            1 => Request::Statistics,
            2 => match learned.fault_record {
                Some(record) if learned.fault_cycle.is_none() => {
                    Request::FaultCycle { record: record.number, index: record.cycles.saturating_sub(1) }
                }
                _ => Request::FaultRecord,
            },
            _ => Request::Status,
        }
    }

    fn hear(&mut self, now: Ticks, reply: Reply, time_ms: u32) {
        self.envelope.time_ms = time_ms;
        let mut learned = self.learned.lock();
        if reply.answers() == Some(self.envelope.sequence) && self.waiting {
            self.waiting = false;
            learned.answered += 1;
            learned.slowest = learned.slowest.max(now - self.asked_at);
        }
        if let Some(place) = reply.answers().and_then(|of| self.orders.iter().position(|order| *order == of)) {
            self.orders.remove(place);
            learned.kept.push(match reply {
                Reply::Refused { reason, detail: [first, _], .. } => Some((reason, first)),
                _ => None,
            });
        }
        match reply {
            Reply::Storage { storage, .. } => learned.storage = Some(storage),
            Reply::Hello { hello, .. } => learned.hello = Some(hello),
            Reply::Status { status, .. } => {
                if status.startup_stage == READY {
                    learned.ready_at.get_or_insert(now);
                }
                learned.status = Some(status);
            }
            Reply::Statistics { statistics, .. } => learned.statistics = Some(statistics),
            Reply::FaultRecord { record, .. } => {
                if learned.fault_record != record {
                    (learned.fault_record, learned.fault_cycle) = (record, None);
                }
            }
            // The device has restarted.
            Reply::Refused { reason: Refusal::NoSession, .. } => learned.hello = None,
            Reply::FaultCycle { cycle, .. } => learned.fault_cycle = cycle,
            _ => {}
        }
    }
}

impl Host for Inquirer {
    fn talk(&mut self, now: Ticks, bytes: &[u8]) -> Vec<u8> {
        let mut rest = bytes;
        while let Some(frame) = self.decoder.next::<Reply>(&mut rest) {
            self.hear(now, frame.message, frame.envelope.time_ms);
        }
        let wait = if self.waiting { TIMEOUT } else { PACE };
        if now < self.asked_at + wait {
            return Vec::new();
        }
        let question = self.question();
        self.envelope.sequence = self.envelope.sequence.wrapping_add(1);
        if matches!(question, Request::KeepWeight { .. }) {
            self.orders.push(self.envelope.sequence);
        }
        self.asked_at = now;
        self.waiting = true;
        self.learned.lock().asked += 1;
        let mut frame = [0; FRAME_BYTES];
        match encode(self.envelope, &question, &mut frame) {
            Ok(length) => frame[..length].to_vec(),
            // Every request fits a frame.
            Err(_) => Vec::new(),
        }
    }

    fn see(&mut self, passage: &sim::Passage) {
        let mut learned = self.learned.lock();
        if passage.sender == Node::HOST && learned.first_frames.len() < FIRST {
            learned.first_frames.push(passage.frame);
        }
        learned.frames += 1;
        let mut hash = if learned.bus_hash == 0 { 0xCBF2_9CE4_8422_2325 } else { learned.bus_hash };
        let mut mix = |bytes: &[u8]| {
            for byte in bytes {
                hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01B3);
            }
        };
        mix(&passage.start.to_le_bytes());
        mix(&[passage.sender.number()]);
        mix(&passage.frame.can_id().raw().to_le_bytes());
        mix(passage.frame.payload());
        learned.bus_hash = hash;
    }
}
