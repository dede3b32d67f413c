//! `DeviceController`: the high-priority half. Owns the hand's bus and the control cycle; sans-I/O, driven by three
//! slots per cycle.
//!
//! | slot | what |
//! |---|---|
//! | request | GET P and GET SG to the group of the hand |
//! | control | the replies of this very cycle, [`Cycle::step`], the torque frame |
//! | slow | one of: initialisation, MODE where due, STAT of a silent puck; MODE, TEMP and, unless ready, STAT in turn |
//!
//! On a bus of its own the hand is answered within one slot of 300 Hz: 1015 us at worst, stuffing and puck latency
//! included, of 1111. At a rate with shorter slots the slow one comes between ([`Slot::next`]). The torque leaves in
//! the cycle of its sample, one cycle earlier than behind an arm.

use control::{LoadRefusal, Payload, State};
use device::bus::Outlet;
use device::hand::{Drive, HandFailure, HandProperties, HandRound, Initialisation, Outcome};
use device::{Controller, ControllerIo, Counters, Health, Message, Refused, Slot, Stage, StoredWeight, Watch};
use link::{Event as LinkEvent, EventKind, HandStage, Refusal};
use puck::{CanFrame, Node, PropertyId, Reply, Status, get};

use crate::DIGITS;
use crate::command::Command;
use crate::cycle::Cycle;
use crate::primitive::FingerPrimitive;
use crate::record::Record;
use crate::startup::{FoundHand, Phase, Progress, Startup};

/// Time that a puck may be silent before the hand is given up: 0.2 s, in control periods.
const SILENT_CYCLES: u16 = control::time::periods(0.2);

/// The property TEMP of every motor firmware from VERS 61.
const TEMPERATURE: PropertyId = match PropertyId::new(9) {
    Some(id) => id,
    None => unreachable!(),
};

/// Questions in a row that a puck leaves unanswered before a hand that is not driven is given up: half a second.
const UNHEARD: u8 = 5;

/// Slow slots between two polls; every eighth poll is a temperature, the others are modes: each digit's mode at 8 Hz.
const POLL_SLOTS: u32 = 8;

/// The control half.
pub struct DeviceController {
    cycle: Cycle,
    cycles: u32,
    startup: Startup,
    stage: HandStage,
    told: (HandStage, Option<(Node, HandFailure)>),
    cause: Option<(Node, HandFailure)>,
    told_phase: Option<Phase>,
    properties: Option<HandProperties>,
    initialisation: Option<Initialisation>,
    round: HandRound,
    drive: Drive,
    asked: Option<Node>,
    polled: Option<(Node, PropertyId)>,
    /// Questions for STAT since each puck last answered one, while the hand is not driven.
    unheard: [u8; DIGITS],
    tick: u32,
    temperatures: [Option<i16>; DIGITS],
    watch: Watch,
    counters: Counters,
}

/// The outlet of one slot.
struct SlotOutlet<'a, I> {
    io: &'a mut I,
    counters: &'a mut Counters,
    now_us: u64,
}

impl<I: ControllerIo<DeviceController>> Outlet for SlotOutlet<'_, I> {
    fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Slots are a third of a cycle apart and all but the request slot send one frame: the pauses pucks need come by
    /// themselves.
    fn send(&mut self, frame: CanFrame) -> bool {
        let sent = self.io.transmit(frame);
        Counters::count(if sent { &mut self.counters.frames_sent } else { &mut self.counters.frames_refused });
        sent
    }
}

impl DeviceController {
    /// At power-up.
    pub fn new() -> DeviceController {
        DeviceController {
            cycle: Cycle::new(),
            cycles: 0,
            startup: Startup::new(),
            stage: HandStage::Absent,
            told: (HandStage::Absent, None),
            cause: None,
            told_phase: None,
            properties: None,
            initialisation: None,
            round: HandRound::default(),
            drive: Drive::resting(false),
            asked: None,
            polled: None,
            unheard: [0; DIGITS],
            tick: 0,
            temperatures: [None; DIGITS],
            watch: Watch::default(),
            counters: Counters::default(),
        }
    }

    fn request(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        let (HandStage::Ready, Some(properties)) = (self.stage, self.properties) else {
            return;
        };
        let frames = self.round.open(properties.gauge);
        let mut outlet = SlotOutlet { io, counters: &mut self.counters, now_us };
        for frame in frames {
            outlet.send(frame);
        }
    }

    fn control(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        self.cycles = self.cycles.wrapping_add(1);
        Counters::count(&mut self.counters.cycles);
        let sample = self.round.close(&mut self.counters);
        let silent = self.round.silent_for(SILENT_CYCLES).filter(|_| self.stage == HandStage::Ready);
        if let Some(node) = silent {
            self.fail(node, HandFailure::Silent);
        }
        let sample = sample.filter(|_| self.stage == HandStage::Ready);
        let command = io.command();
        let refused = match command {
            Some(Command::InitialiseHand) => self.initialise().err(),
            Some(Command::Stop | Command::Release) if self.stage == HandStage::Initialising => {
                self.enter(HandStage::NotInitialised, None);
                None
            }
            _ => None,
        };
        self.cycle.heat(self.watch.is_too_hot());
        let output = self.cycle.step(sample.as_ref(), command.filter(|_| refused.is_none()));
        let record = Record { cycle: self.cycles, ..output.record };
        io.record(record);
        if let Some(reason) = refused {
            io.event(Message::Answer(Err(reason)));
        }
        if let Some(answer) = output.answer {
            // Only now that the cycle lets go of the hand as well does its initialisation begin.
            if command == Some(Command::InitialiseHand) && answer.is_ok() {
                self.begin_initialisation(now_us);
            }
            io.event(Message::Answer(answer.map_err(|refused| self.with_stage(refused))));
        }
        if let Some((state, fault)) = output.entered {
            self.news(io, EventKind::State, state.code().into(), fault.code().into());
        }
        if output.arrived {
            self.news(io, EventKind::Arrived, 0, 0);
        }
        if self.stage == HandStage::Ready {
            let frame = self.drive.torque_frame(output.frame);
            let mut outlet = SlotOutlet { io, counters: &mut self.counters, now_us };
            let left = frame.is_some_and(|frame| outlet.send(frame));
            if output.frame.is_some() && !left {
                self.cycle.not_sent();
            }
        }
    }

    fn slow(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        self.tick = self.tick.wrapping_add(1);
        let mut outlet = SlotOutlet { io, counters: &mut self.counters, now_us };
        let Some(properties) = self.properties else {
            match self.startup.advance(&mut outlet) {
                Progress::Busy => {}
                Progress::Found(FoundHand { properties, units_per_newton_metre }) => {
                    self.cycle.calibrate(units_per_newton_metre);
                    self.properties = Some(properties);
                    self.enter(HandStage::NotInitialised, None);
                }
                Progress::Unfit(node, failure) => self.cause = Some((node, failure)),
            }
            return;
        };
        if let Some(initialisation) = &mut self.initialisation {
            match initialisation.advance(&properties, &mut outlet) {
                Outcome::Busy => {}
                Outcome::Done => self.enter(HandStage::Ready, None),
                Outcome::Failed(node, failure) => self.fail(node, failure),
            }
            return;
        }
        if let Some(frame) = self.drive.mode_frame() {
            if outlet.send(frame) {
                self.drive.mode_sent();
            }
            return;
        }
        let suspect = self.round.suspect().filter(|_| self.stage == HandStage::Ready);
        if let Some(node) = suspect {
            self.asked = Some(node);
            outlet.send(get(node, PropertyId::STAT));
        } else if self.stage != HandStage::Ready && self.tick % POLL_SLOTS == POLL_SLOTS / 2 {
            self.ask_whether_awake(now_us, io);
        } else if self.tick.is_multiple_of(POLL_SLOTS) {
            let turn = self.tick / POLL_SLOTS;
            let property = if turn.is_multiple_of(5) { TEMPERATURE } else { PropertyId::MODE };
            let digit = if property == TEMPERATURE { turn / 5 } else { turn - turn / 5 };
            if let Some(node) = Node::HAND.get(digit as usize % DIGITS) {
                self.polled = Some((*node, property));
                outlet.send(get(*node, property));
            }
        }
    }

    /// Nothing else tells of a puck that has restarted, or has no power any more, while the hand is not driven: they
    /// take turns.
    fn ask_whether_awake(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        let digit = (self.tick / POLL_SLOTS) as usize % DIGITS;
        let (Some(node), Some(unheard)) = (Node::HAND.get(digit).copied(), self.unheard.get_mut(digit)) else {
            return;
        };
        if *unheard >= UNHEARD {
            self.fail(node, HandFailure::Silent);
            return;
        }
        let mut outlet = SlotOutlet { io, counters: &mut self.counters, now_us };
        if outlet.send(get(node, PropertyId::STAT)) {
            *unheard += 1;
            self.asked = Some(node);
        }
    }

    fn take(&mut self, frame: &CanFrame) {
        Counters::count(&mut self.counters.frames_received);
        let Ok(reply) = Reply::decode(frame) else {
            Counters::count(&mut self.counters.malformed_frames);
            return;
        };
        let heard = match reply {
            Reply::Position { node, primary, secondary } => match (node.hand_index(), self.properties) {
                (Some(digit), Some(_)) => {
                    let initialising = self.initialisation.as_mut();
                    if !initialising.is_some_and(|initialisation| initialisation.receive_position(digit, primary)) {
                        self.round.take_position(digit, primary, secondary, &mut self.counters);
                    }
                    true
                }
                _ => false,
            },
            Reply::Property { node, property, value } => {
                node.hand_index().is_some_and(|digit| self.take_property(digit, node, property, value))
            }
            _ => false,
        };
        if !heard {
            Counters::count(&mut self.counters.foreign_frames);
        }
    }

    fn take_property(&mut self, digit: usize, node: Node, property: PropertyId, value: i32) -> bool {
        let Some(properties) = self.properties else {
            return self.startup.receive(digit, node, property, value);
        };
        if let Some(initialisation) = &mut self.initialisation {
            return initialisation.receive(digit, node, property, value);
        }
        if property == properties.gauge {
            self.round.take_gauge(digit, value, &mut self.counters);
            return true;
        }
        if property == PropertyId::STAT && self.asked == Some(node) {
            self.asked = None;
            if let Some(unheard) = self.unheard.get_mut(digit) {
                *unheard = 0;
            }
            if Status::from_value(value) != Some(Status::Ready) {
                self.fail(node, HandFailure::Reset);
            }
            return true;
        }
        if self.polled == Some((node, property)) {
            self.polled = None;
            if property == PropertyId::MODE {
                self.drive.hear_mode(node, value);
            } else if let Some(place) = self.temperatures.get_mut(digit) {
                *place = i16::try_from(value).ok();
                self.watch.look(self.temperatures.iter().copied().flatten(), None);
            }
            return true;
        }
        false
    }

    /// A refusal for a hand that is not ready, in the words of its stage, of which the cycle knows nothing.
    fn with_stage(&self, (reason, detail): Refused) -> Refused {
        match (reason, self.stage) {
            (Refusal::HandNotReady, HandStage::Initialising) => (Refusal::HandBusy, detail),
            (Refusal::HandNotReady, _) if self.properties.is_none() => (Refusal::NoHand, detail),
            _ => (reason, detail),
        }
    }

    /// Refuses an initialisation that cannot begin now.
    fn initialise(&self) -> Result<(), Refused> {
        match (self.stage, self.properties) {
            (HandStage::Initialising, _) => Err((Refusal::HandBusy, [0, 0])),
            (HandStage::Absent, _) | (_, None) => Err((Refusal::NoHand, [0, 0])),
            _ => Ok(()),
        }
    }

    fn begin_initialisation(&mut self, now_us: u64) {
        // Braking after a stop: that word may not have left.
        let driven = self.stage == HandStage::Ready || self.drive.mode_frame().is_some();
        self.enter(HandStage::Initialising, None);
        self.drive = Drive::resting(false);
        self.initialisation = Some(Initialisation::new(driven, now_us));
    }

    fn fail(&mut self, node: Node, failure: HandFailure) {
        self.cycle.hand_failed();
        self.enter(HandStage::Failed, Some((node, failure)));
        if matches!(failure, HandFailure::Reset | HandFailure::Silent) {
            // Whatever was known of it may be gone: it is looked for again. What counts as known to people is that it
            // failed.
            self.properties = None;
            self.startup = Startup::new();
            self.temperatures = [None; DIGITS];
            self.watch = Watch::default();
        }
    }

    /// Enters a stage with drives at rest: whatever the pucks did before, they are told to stop.
    fn enter(&mut self, stage: HandStage, cause: Option<(Node, HandFailure)>) {
        self.stage = stage;
        self.cause = cause;
        self.initialisation = None;
        self.round = HandRound::default();
        // A digit that holds after its initialisation may go on holding.
        self.drive = Drive::resting(stage != HandStage::Ready);
        self.asked = None;
        self.polled = None;
        self.unheard = [0; DIGITS];
    }

    /// Tells what is new of start-up and hand.
    fn tell(&mut self, io: &mut impl ControllerIo<Self>) {
        let phase = self.startup.phase();
        if self.told_phase != Some(phase) {
            self.told_phase = Some(phase);
            let stage = self.health().stage.code();
            self.news(io, EventKind::Startup, stage.into(), 0);
        }
        let now = (self.stage, self.cause);
        if now != core::mem::replace(&mut self.told, now) {
            let detail = self.cause.map_or(0, |(node, failure)| failure.number(node));
            self.news(io, EventKind::Hand, self.stage.code().into(), detail);
        }
    }

    fn news(&self, io: &mut impl ControllerIo<Self>, kind: EventKind, code: u16, detail: u32) {
        io.event(Message::News(LinkEvent { cycle: self.cycles, kind, code, detail }));
    }
}

impl Controller for DeviceController {
    type Command = Command;
    type Event = Message;
    type Record = Record;
    type Primitive<'a> = &'a FingerPrimitive;

    const STOP: Command = Command::Stop;

    fn slot(&mut self, slot: Slot, now_us: u64, io: &mut impl ControllerIo<Self>) {
        while let Some(frame) = io.receive() {
            self.take(&frame);
        }
        match slot {
            Slot::Request => self.request(now_us, io),
            Slot::Control => self.control(now_us, io),
            Slot::Slow => self.slow(now_us, io),
        }
        self.tell(io);
    }

    fn load(&mut self, primitive: &FingerPrimitive) -> Result<(), LoadRefusal> {
        if self.cycle.load(primitive) { Ok(()) } else { Err(LoadRefusal::Running) }
    }

    /// A hand alone has no arm to carry.
    fn weigh(&mut self, _: &StoredWeight) -> bool {
        false
    }

    fn note_overrun(&mut self) {
        Counters::count(&mut self.counters.overruns);
    }

    /// The bus may recover by itself; motion does not. The pucks hear zeros as soon as there is a bus again.
    fn note_bus_error(&mut self, bus_off: bool) {
        Counters::count(&mut self.counters.bus_errors);
        if bus_off {
            self.cycle.hand_failed();
        }
    }

    fn health(&self) -> Health {
        Health {
            cycle: self.cycles.into(),
            stage: match self.startup.phase() {
                Phase::Enumerating => Stage::Enumerating,
                Phase::Waking => Stage::Waking,
                Phase::Reading => Stage::Reading,
                Phase::Done => Stage::Ready,
            },
            state: self.cycle.state(),
            // Lost replies are bridged in a run alone.
            law: if self.cycle.state() == State::Coast { State::Run } else { self.cycle.state() },
            fault: self.cycle.fault(),
            hand: self.stage,
            // A move is a state of the cycle.
            hand_moves: self.stage == HandStage::Initialising,
            hand_temperatures: self.temperatures,
            counters: self.counters,
            blocked: None,
            zeroed: false,
            zeroed_at: None,
            payload: Payload::SensorAndHand,
            has_primitive: false,
            wrench_zeroed: None,
            safety_mode: None,
            pendant: None,
            temperatures: [None; 7],
        }
    }

    fn message(event: Message, _: &Health) -> Option<Message> {
        Some(event)
    }
}

impl Default for DeviceController {
    fn default() -> Self {
        DeviceController::new()
    }
}
