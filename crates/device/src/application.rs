//! The two halves of a device as traits: common to an arm with its hand and to a hand alone.
//!
//! A device has two halves. The control half is a [`Controller`]: a timer drives it, three slots a control cycle. The
//! other half is a [`crate::HostSession`] over an [`Application`]: the rules of the link are those of every device, the
//! primitives and the requests that move something are those of the application.

use control::{CycleRecord, LoadRefusal, State};
use link::{Capabilities, Listing, Name, Refusal, Reply, Request, Telemetry};
use puck::CanFrame;

use crate::fault_memory::FaultMemory;
use crate::health::{Health, Timing};
use crate::secret::StoredSecret;
use crate::time::{ANSWERS_US, SLOT_HZ};
use crate::weight::StoredWeight;

/// A refusal with its detail.
pub type Refused = (Refusal, [u32; 2]);

/// The third of a control cycle that a timer tick begins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Slot {
    /// Ask for positions and wrench.
    Request,
    /// Compute and send torques.
    Control,
    /// Ask one slow question.
    Slow,
}

impl Slot {
    /// The slot of the next timer tick. Where one slot is too short for the answers to a request, the slow question
    /// fills the time in which they come.
    pub const fn next(self) -> Slot {
        match (self, ANSWERS_US * SLOT_HZ > 1_000_000) {
            (Slot::Request, false) | (Slot::Slow, true) => Slot::Control,
            (Slot::Control, false) | (Slot::Request, true) => Slot::Slow,
            (Slot::Slow, false) | (Slot::Control, true) => Slot::Request,
        }
    }
}

/// The high-priority half of a device.
pub trait Controller: Sized + 'static {
    /// A request of a person on its way to this half; each is answered by exactly one event.
    type Command: Copy + PartialEq + 'static;
    /// News and answers of this half.
    type Event: Copy + 'static;
    /// Measurements and decisions of a control cycle.
    type Record: CycleReport;
    /// A checked primitive, as it is handed over.
    type Primitive<'a>;

    /// The command that ends every motion.
    const STOP: Self::Command;

    /// One timer tick. `now_us` is the device's time in microseconds and never runs backwards.
    fn slot(&mut self, slot: Slot, now_us: u64, io: &mut impl ControllerIo<Self>);

    /// Takes a primitive for the next run: a copy, as the slots wait meanwhile.
    ///
    /// # Errors
    /// [`LoadRefusal`] while a run is in progress, or if it was checked for another arm than this. The old one stays.
    fn load(&mut self, primitive: Self::Primitive<'_>) -> Result<(), LoadRefusal>;

    /// Takes the weight of the arm's links and the payload that it declares; `false` while the arm has torque, and
    /// where there is no arm. The old one then stays.
    fn weigh(&mut self, weight: &StoredWeight) -> bool;

    /// The board began a control slot too late for its torque frames to leave in time.
    fn note_overrun(&mut self);

    /// The CAN controller reported an error; `bus_off` if it has left the bus.
    fn note_bus_error(&mut self, bus_off: bool);

    /// The state of the control half now.
    fn health(&self) -> Health;

    /// An event as a host is told it; `None` for what only people read.
    fn message(event: Self::Event, health: &Health) -> Option<Message>;
}

/// The world of the control half: a CAN controller, and the queues to the session half.
pub trait ControllerIo<C: Controller> {
    /// The next frame that has come in, oldest first.
    fn receive(&mut self) -> Option<CanFrame>;
    /// Queues a frame for sending; `false` if there is no room. Must not wait.
    fn transmit(&mut self, frame: CanFrame) -> bool;
    /// The next command of a person, oldest first.
    fn command(&mut self) -> Option<C::Command>;
    /// Hands over the measurements and decisions of a control cycle.
    fn record(&mut self, record: C::Record);
    /// Something happened.
    fn event(&mut self, event: C::Event);
}

/// The queue to the control half is full: it has not taken the previous commands yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueFull;

impl core::fmt::Display for QueueFull {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the control cycle has not taken the previous commands yet")
    }
}

impl core::error::Error for QueueFull {}

/// The line to the host and the queues to the control half, as the session sees them.
pub trait SessionPort<C: Controller> {
    /// Hands bytes to the line. Never more than [`SessionPort::room`] said.
    fn send(&mut self, bytes: &[u8]);

    /// Bytes the line can take now. The session waits with answers and drops telemetry when it is too little.
    fn room(&self) -> usize {
        usize::MAX
    }

    /// Queues a command for the control half, which answers each by exactly one event, in their order.
    ///
    /// # Errors
    /// [`QueueFull`]
    fn command(&mut self, command: C::Command) -> Result<(), QueueFull>;

    /// Gives the control cycle another primitive, which is no more than a copy. Called only while no primitive runs.
    ///
    /// # Errors
    /// As [`Controller::load`]. It must not be swallowed: the next run would be that of the old primitive.
    fn load(&mut self, primitive: C::Primitive<'_>) -> Result<(), LoadRefusal>;

    /// Gives the control cycle the weight of the arm's links, as [`Controller::weigh`].
    fn weigh(&mut self, weight: &StoredWeight) -> bool;

    /// The next record of a control cycle, oldest first.
    fn record(&mut self) -> Option<TimedRecord<C::Record>>;

    /// The next event of the control half, oldest first.
    fn event(&mut self) -> Option<C::Event>;

    /// The state of the control half now.
    fn health(&mut self) -> Health;

    /// Returns the board's measurements of its own processor.
    fn timing(&mut self) -> Timing;

    /// Memory for the last second before a fault, which the board keeps over a restart; `None` where there is no room.
    fn fault_memory(&mut self) -> Option<&mut FaultMemory> {
        None
    }
}

/// A message of the control half, as it goes over the link.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Message {
    /// The answer to the oldest command without one.
    Answer(Result<(), Refused>),
    /// News.
    News(link::Event),
}

/// The part of a cycle's record that every device has.
pub trait CycleReport: Copy + core::fmt::Debug + 'static {
    /// Number of the cycle, modulo 2^32.
    fn number(&self) -> u32;
    /// State after it.
    fn state(&self) -> State;
    /// Bits of [`control::flags`].
    fn flags(&self) -> u32;
    /// All of it for a host, but its cost.
    fn telemetry(&self) -> Telemetry;
}

/// One control cycle together with what only its caller can measure.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct TimedRecord<R = CycleRecord> {
    /// Measurements and decisions of the cycle.
    pub record: R,
    /// Duration of its computation, ticks; 0 where that is not measured.
    pub cost_ticks: u32,
}

/// Outcome of a request to an application.
#[allow(
    clippy::large_enum_variant,
    reason = "no allocation on the device, and the answer is sent from where it is returned to"
)]
#[derive(Debug)]
pub enum Action<C> {
    /// A command for the control half; its answer is that of the request.
    Command(C),
    /// The answer.
    Answer(Reply),
    /// A change of what is stored has begun; [`Application::saved`] tells what became of it.
    Save,
}

/// A change of what is stored that is over.
#[derive(Clone, Copy, Debug)]
pub struct Saved {
    /// Durable, or why not.
    pub outcome: Result<(), Refused>,
    /// The place that holds something else now.
    pub place: Option<u8>,
}

/// The primitives of a device, and the requests that only it knows.
pub trait Application {
    /// The other half.
    type Controller: Controller;

    /// The parts that it can drive and read, mounted or not.
    const CAPABILITIES: Capabilities;

    /// True once it is known what is stored. Until then, and not for long, requests wait.
    fn is_open(&mut self, now_ms: u32) -> bool;

    /// It has a place to keep a secret.
    const KEEPS_SECRET: bool = false;

    /// The secret that is kept.
    ///
    /// # Errors
    /// That is not known yet.
    fn secret(&self) -> Result<StoredSecret, Refused> {
        Ok(StoredSecret::Nothing)
    }

    /// Number of places for primitives.
    fn places(&self) -> u8;

    /// Size of a place, bytes of an image.
    fn place_bytes(&self) -> u32;

    /// Returns the description of the primitive at a place; `None` if the place is free.
    ///
    /// # Errors
    /// Why that cannot be told.
    fn listing(&self, place: u8) -> Result<Option<Listing>, Refused>;

    /// Learns from the control half's health what it has forgotten since, before a host is told what it holds.
    fn follow(&mut self, _health: &Health) {}

    /// Name of the primitive that the control half holds.
    fn loaded(&self) -> Option<&Name>;

    /// Prepares for an image of this name and length, which fits into a place. Another upload has been given up before.
    ///
    /// # Errors
    /// Why it cannot be taken.
    fn begin(&mut self, name: &Name, length: u32) -> Result<(), Refused>;

    /// Takes the next part of the image.
    ///
    /// # Errors
    /// Why it cannot be taken.
    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), Refused>;

    /// Forgets the upload.
    fn abort(&mut self);

    /// Checks the image, which is whole, and begins to save it.
    ///
    /// # Errors
    /// The first thing that is wrong with the image.
    fn commit(&mut self, name: &Name, crc: u32, port: &mut impl SessionPort<Self::Controller>) -> Result<(), Refused>;

    /// Begins to delete a primitive.
    ///
    /// # Errors
    /// Why it stays.
    fn delete(&mut self, name: &Name, port: &mut impl SessionPort<Self::Controller>) -> Result<(), Refused>;

    /// Begins to give a primitive another name.
    ///
    /// # Errors
    /// Why it keeps its name.
    fn rename(&mut self, name: &Name, to: &Name, port: &mut impl SessionPort<Self::Controller>) -> Result<(), Refused>;

    /// A change that is over now. `calm`: no command is on its way to the control half.
    fn saved(&mut self, calm: bool, port: &mut impl SessionPort<Self::Controller>) -> Option<Saved>;

    /// Does what is asked, where it is not the same on every device. `of` is the request's number; `calm` as above.
    ///
    /// # Errors
    /// Why it is not done.
    fn act(
        &mut self,
        of: u16,
        request: Request,
        calm: bool,
        port: &mut impl SessionPort<Self::Controller>,
    ) -> Result<Action<<Self::Controller as Controller>::Command>, Refused>;
}

/// Refuses numbers that are none, naming the first.
///
/// # Errors
/// [`Refusal::BadValue`] with its place.
pub fn finite(values: &[f32]) -> Result<(), Refused> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(place) => Err((Refusal::BadValue, [u32::try_from(place).unwrap_or(u32::MAX), 0])),
        None => Ok(()),
    }
}
