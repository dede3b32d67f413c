//! The high-priority half of the device: the bus, its start-up, and the control cycle.
//!
//! A hardware timer calls [`DeviceController::slot`] three times per control cycle. In the start-up each slot sends at
//! most one frame. After that the three slots do different things, at 300 Hz in this order ([`Slot::next`]):
//!
//! | slot | at | what |
//! |---|---|---|
//! | [`Slot::Request`] | 0 | empty the reply slots, ask all pucks for their position and the sensor for its wrench |
//! | [`Slot::Control`] | 1.11 ms | take what has come, compute, send both torque frames, then drive and ask the hand |
//! | [`Slot::Slow`] | 2.22 ms | one question about modes, pendant or temperatures |
//!
//! No torque but zero leaves before the start-up is over, a person has activated the arm, and a person has commanded
//! it: the frames of a cycle come from [`control::Actuation`] or are zero.

mod anew;
mod brakes;
mod lateness;
mod orders;
mod outlet;

use control::law::Gains;
use control::time::periods;
use control::{Calibration, Cycle, CycleInput, CycleRecord, Fault, LoadRefusal, Payload, State};
use link::HandStage;
use pinned_init::{Init, init};
use puck::{CanFrame, MotorMode, Node, PropertyId, Reply, SafetyMode, Status, zero_torques};

use crate::application::{Controller, ControllerIo, CycleReport, Message, Slot};
use crate::background::{BackgroundPoll, PollReply};
use crate::bus::{Outlet, Pacer};
use crate::caution::Watch;
use crate::command::{Command, Refusal};
use crate::event::{Event, EventKind};
use crate::hand::Hand;
use crate::health::{Counters, Health};
use crate::port::CheckedPrimitive;
use crate::round::Round;
use crate::stage::{Stage, StartupError};
use crate::startup::Startup;
use crate::weight::StoredWeight;
use crate::wire;
use brakes::Brakes;
use lateness::Lateness;
use outlet::SlotOutlet;

/// Time that a puck may be silent before the bus is started anew: 1 s, in control periods; long after the supervisor
/// has taken the torque off.
const SILENT_CYCLES: u16 = periods(1.0);
/// Control periods without a wrench after which the sensor of an arm that rests is asked whether it sleeps: 0.2 s.
const SILENT_SENSOR: u8 = periods(0.2) as u8;
/// Unanswered questions to the safety module that mean it is gone: 100 ms, one question in two control periods.
const SAFETY_SILENCE: u16 = periods(0.1) / 2;
/// Cycles between a fault of the bus and the new start-up: three of zero torque, and time to ask the safety module for
/// IDLE.
const LAST_CYCLES: u8 = 6;
/// Cycles in a row whose torque frames could not be sent, after which the bus counts as failed.
const REFUSED_CYCLES: u8 = 6;

/// Who has the bus.
#[derive(Clone, Copy, Debug)]
enum BusPhase {
    /// The start-up.
    StartUp,
    /// The cyclic loop, with its questions beside the control cycle.
    Cyclic(BackgroundPoll),
}

/// The high-priority half of the device.
///
/// Its fields stay in their order, the large one last: behind it each of the others would cost an instruction more.
#[repr(C)]
pub struct DeviceController {
    number: u64,
    startup: Startup,
    pacer: Pacer,
    round: Round,
    hand: Hand,
    phase: BusPhase,
    counters: Counters,
    safety_mode: Option<SafetyMode>,
    /// The mode told since the last cycle.
    fresh_safety: Option<SafetyMode>,
    pendant: Option<i32>,
    temperatures: [Option<i16>; 7],
    hand_temperatures: [Option<i16>; 4],
    watch: Watch,
    /// A device that answers now and did not at the start-up.
    late: Option<Node>,
    stage: Stage,
    blocked: Option<StartupError>,
    /// A fault of the bus, to be told to the next cycle, and the cycles left until the bus is started anew.
    fault: Option<Fault>,
    last_cycles: Option<u8>,
    refused: u8,
    lateness: Lateness,
    brakes: Brakes,
    cycle: Cycle<f32, { control::MAX_KERNELS }>,
}

impl DeviceController {
    /// Makes, in its place, a device that has just got power: silent, without torque, at the beginning of the start-up.
    pub fn init() -> impl Init<DeviceController> {
        init!(DeviceController {
            // Never used for torque: the scales of this arm replace it before the first cycle.
            cycle <- Cycle::init(Calibration::nominal(Payload::SensorAndHand), Gains::tuned()),
            number: 0,
            startup: Startup::new(),
            pacer: Pacer::default(),
            round: Round::default(),
            hand: Hand::new(),
            phase: BusPhase::StartUp,
            counters: Counters::default(),
            safety_mode: None,
            fresh_safety: None,
            pendant: None,
            temperatures: [None; 7],
            hand_temperatures: [None; 4],
            watch: Watch::default(),
            late: None,
            stage: Stage::Enumerating,
            blocked: None,
            fault: None,
            last_cycles: None,
            refused: 0,
            lateness: Lateness::default(),
            brakes: Brakes::default(),
        })
    }

    /// Forgets the primitive. Ignored while it runs.
    pub fn unload(&mut self) {
        self.cycle.unload();
    }

    /// Stage of the start-up.
    pub fn stage(&self) -> Stage {
        let stage = self.startup.stage();
        if stage == Stage::WaitingForActive && self.safety_mode == Some(SafetyMode::Active) {
            Stage::Ready
        } else {
            stage
        }
    }

    /// Takes every frame that has come in.
    fn drain(&mut self, io: &mut impl ControllerIo<Self>) {
        while let Some(frame) = io.receive() {
            Counters::count(&mut self.counters.frames_received);
            let reply = match Reply::decode(&frame) {
                Ok(Reply::SafetyBroadcast) => {
                    Counters::count(&mut self.counters.broadcasts);
                    continue;
                }
                Ok(reply) => reply,
                Err(_) => {
                    Counters::count(&mut self.counters.malformed_frames);
                    continue;
                }
            };
            if !self.take(&reply, io) {
                Counters::count(&mut self.counters.foreign_frames);
            }
        }
    }

    /// Gives a reply to whoever waits for it; whether anybody did.
    fn take(&mut self, reply: &Reply, io: &mut impl ControllerIo<Self>) -> bool {
        if matches!(self.phase, BusPhase::StartUp) {
            let expected = self.startup.receive(reply);
            if let (true, Reply::Property { node: Node::SAFETY_MODULE, property: PropertyId::MODE, value }) =
                (expected, *reply)
            {
                self.hear_safety(value, io);
            }
            return expected;
        }
        if self.round.take(reply, &mut self.counters) {
            return true;
        }
        if self.hand.take(reply, &mut self.counters) {
            return true;
        }
        let Reply::Property { node, property, value } = *reply else {
            return false;
        };
        let BusPhase::Cyclic(poll) = &mut self.phase else {
            return false;
        };
        let Some(reply) = poll.take(node, property, value) else {
            return false;
        };
        match reply {
            PollReply::SafetyMode(value) => self.hear_safety(value, io),
            PollReply::PuckMode(puck, value) => {
                let braking = MotorMode::from_value(value) == Some(MotorMode::Idle);
                let active = self.safety_mode == Some(SafetyMode::Active);
                self.brakes.hear_puck(puck, braking, active);
            }
            PollReply::Pendant(value) => self.pendant = Some(value),
            PollReply::Temperature(joint, value) => {
                if let Some(place) = self.temperatures.get_mut(joint) {
                    *place = Some(value as i16);
                }
            }
            PollReply::HandMode(node, value) => self.hand.hear_mode(node, value),
            PollReply::HandTemperature(digit, value) => {
                if let Some(place) = self.hand_temperatures.get_mut(digit) {
                    *place = Some(value as i16);
                }
            }
            PollReply::Present(node, value) => {
                let is_ready = Status::from_value(value) == Some(Status::Ready);
                let is_told = if node == Node::FORCE_TORQUE {
                    is_ready && self.startup.has_sensor()
                } else {
                    self.hand.hear_status(node, is_ready)
                };
                if !is_told {
                    self.late = Some(node);
                }
            }
            PollReply::Status(_, value) => {
                if Status::from_value(value) != Some(Status::Ready) {
                    self.fail();
                }
            }
        }
        true
    }

    /// The safety module has told its mode. A value that nobody knows counts as IDLE: no torque.
    fn hear_safety(&mut self, value: i32, io: &mut impl ControllerIo<Self>) {
        let mode = SafetyMode::from_value(value).unwrap_or(SafetyMode::Idle);
        self.fresh_safety = Some(mode);
        self.brakes.hear_safety(mode);
        if self.safety_mode != Some(mode) {
            let is_asked_for = mode == SafetyMode::Idle && self.brakes.are_asked_for();
            self.safety_mode = Some(mode);
            self.tell(EventKind::Safety { mode, is_asked_for }, io);
        }
    }

    /// The bus or a puck has failed: take the torque off and begin anew.
    fn fail(&mut self) {
        self.fault = Some(Fault::BusFault);
        self.last_cycles.get_or_insert(LAST_CYCLES);
    }

    /// A slot of the start-up. Not inlined, nor is [`DeviceController::control`]: a board keeps the two in different
    /// memories, and the frame of the start-up stays out of the cycle's.
    #[inline(never)]
    fn start_up(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        // Answers keep the order of the commands: the next one waits while an answer is outstanding.
        if !self.startup.is_zero_pending() {
            match io.command() {
                Some(Command::Zero { home }) => self.startup.zero(&home),
                // Nothing moves and no torque flows: what a stop asks for is so already.
                Some(Command::Control(control::Command::Stop)) => self.tell(EventKind::Accepted, io),
                Some(Command::Control(_) | Command::InitialiseHand) => {
                    self.tell(EventKind::Refused(Refusal::NotReady(self.stage())), io);
                }
                None => {}
            }
        }
        let mut outlet = SlotOutlet { io, counters: &mut self.counters, pacer: &mut self.pacer, now_us, cyclic: false };
        if self.startup.advance(&mut outlet) {
            self.begin_cycles();
        } else if matches!(self.startup.stage(), Stage::Enumerating | Stage::Blocked) {
            self.suspend_hand();
        }
    }

    fn request(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        let (positions, wrench) = self.round.open();
        let mut outlet = self.outlet(now_us, io);
        outlet.send(positions);
        if let Some(wrench) = wrench {
            outlet.send(wrench);
        }
        if self.brakes.is_open() {
            self.tell_to_brake(now_us, io);
        }
    }

    /// One more word to brake, in a request slot or before zero torques.
    #[cold]
    #[inline(never)]
    fn tell_to_brake(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        if let Some(word) = self.brakes.urgent_frame() {
            self.outlet(now_us, io).send(word);
        }
    }

    /// The word to brake before the torques of a cycle; true if these are to leave too.
    #[cold]
    #[inline(never)]
    fn brakes_first(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) -> bool {
        let torques_too = self.brakes.begin_cycle(self.cycle.state().has_torque());
        self.tell_to_brake(now_us, io);
        torques_too
    }

    /// The slot that computes and sends torques.
    #[inline(never)]
    fn control(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        if !self.round.is_open() {
            // The start-up ended in the middle of a cycle.
            return;
        }
        let gathered = self.round.close(&mut self.counters);
        let hand = self.hand.sample(&mut self.counters);
        self.number += 1;
        Counters::count(&mut self.counters.cycles);
        if matches!(self.phase, BusPhase::Cyclic(poll) if poll.safety_silence() >= SAFETY_SILENCE)
            || self.round.longest_silence() >= SILENT_CYCLES
        {
            self.fail();
        }
        if self.lateness.take() {
            self.fault.get_or_insert(Fault::Overrun);
        }
        let input = CycleInput {
            cycle: self.number,
            sample: control::BusSample {
                positions: gathered.positions,
                wrench: gathered.wrench,
                safety: self.safety_of_cycle(),
                hand,
            },
            command: io.command().and_then(|command| self.obey(command, now_us, io)),
            external_fault: self.fault.take().or(self.standing_fault()),
        };
        let output = self.cycle.step(&input);
        self.brakes.want(output.actuation.requests_idle());
        if !self.brakes.is_open() || self.brakes_first(now_us, io) {
            self.send_torques(output.actuation.frames(), now_us, io);
        }
        // Torques first, then questions.
        let mut are_torques = true;
        for frame in self.hand.frames(output.actuation.hand_frame()) {
            let left = frame.is_none_or(|frame| self.outlet(now_us, io).send(frame));
            if are_torques && !left {
                self.cycle.not_sent(false, false, true);
            }
            are_torques = false;
        }
        if self.cycle.is_zero_lost() {
            self.startup.lose_zero();
        }
        io.record(output.record);
        if let Some(event) = output.event {
            self.tell(event.into(), io);
        }
        self.leave_if_lost(now_us);
        if matches!(self.phase, BusPhase::StartUp) {
            self.tell_the_rest(io);
        }
    }

    /// A reason against torque that lasts.
    fn standing_fault(&self) -> Option<Fault> {
        let hot = self.watch.is_too_hot().then_some(Fault::MotorHot);
        self.late.map(|_| Fault::OtherPayload).or(hot)
    }

    /// Mode of the safety module for the cycle: the one it told itself, unless a braking puck contradicts.
    fn safety_of_cycle(&mut self) -> Option<SafetyMode> {
        let told = self.fresh_safety.take();
        if self.brakes.are_on_under_active() { Some(SafetyMode::Idle) } else { told }
    }

    /// Both frames of the cycle, or zeros: pucks keep their last torque until they are told another.
    fn send_torques(&mut self, frames: Option<[CanFrame; 2]>, now_us: u64, io: &mut impl ControllerIo<Self>) {
        let [arm, wrist] = frames.unwrap_or_else(zero_torques);
        let mut outlet = self.outlet(now_us, io);
        let sent = (outlet.send(arm), outlet.send(wrist));
        if sent == (true, true) {
            self.refused = 0;
            return;
        }
        self.cycle.not_sent(!sent.0, !sent.1, false);
        if sent != (false, false) {
            Counters::count(&mut self.counters.torque_mismatches);
        }
        self.refused = self.refused.saturating_add(1);
        if self.refused >= REFUSED_CYCLES {
            // The bus may recover by itself; motion does not. A fault as long as it goes on, so that nobody arms.
            self.fault = Some(Fault::BusFault);
        }
    }

    /// After a cycle: goes back to the start-up when the pucks have lost power, failed, or shall be zeroed again.
    fn leave_if_lost(&mut self, now_us: u64) {
        if !self.startup.is_done() {
            // A command has sent the start-up back to zeroing.
            self.phase = BusPhase::StartUp;
            self.cycle.reset();
            return;
        }
        if self.safety_mode == Some(SafetyMode::EStop) {
            self.restart(now_us);
            return;
        }
        let late = self.late.map(StartupError::AnswersLate).or(self.startup.contradiction());
        if let Some(error) = late.filter(|_| !self.cycle.state().has_torque()) {
            // What the arm carries decides its gravity: everything is asked anew.
            self.restart(now_us);
            self.startup.note(error);
            return;
        }
        match &mut self.last_cycles {
            Some(0) => self.restart(now_us),
            Some(left) => *left -= 1,
            None => {}
        }
    }

    /// The slot that asks one slow question.
    #[inline(never)]
    fn ask_slowly(&mut self, now_us: u64, io: &mut impl ControllerIo<Self>) {
        let known = Iterator::chain(self.temperatures.iter(), &self.hand_temperatures).copied().flatten();
        self.cycle.set_caution(self.watch.look(known, self.pendant));
        let writable = self.startup.safety_properties().is_some_and(|safety| safety.mode_is_writable);
        if let Some(frame) = self.brakes.frame(self.safety_mode, writable)
            && !self.ask_for_brakes(frame, now_us, io)
        {
            return;
        }
        let counts = self.cycle.last_counts().map(|motors| motors.map(|(counts, _)| counts));
        if counts.is_some_and(|counts| self.startup.doubts_posture(&counts)) {
            self.cycle.lose_zero();
        }
        let BusPhase::Cyclic(poll) = &mut self.phase else {
            return;
        };
        let mut outlet = SlotOutlet { io, counters: &mut self.counters, pacer: &mut self.pacer, now_us, cyclic: true };
        // Not under torque: unzeroed, the safety module watches other speeds.
        if !self.cycle.state().has_torque() && self.startup.revoke_zero(&mut outlet) {
            return;
        }
        let rests = self.safety_mode == Some(SafetyMode::Idle) && !self.cycle.state().has_torque();
        let (missing, digit) = self.startup.absent(rests);
        // One that has restarted sleeps, and nothing but a start-up wakes it.
        let silent = rests && self.cycle.wrench_age().is_none_or(|age| age >= SILENT_SENSOR);
        let absent = (missing || silent, digit.or_else(|| self.hand.puck_in_doubt(self.number, rests)));
        let question = match (poll.begin(), self.round.suspect()) {
            (Some(safety), _) => Some(safety),
            // A hand that drives on goes before a puck that is silent.
            (None, Some(node)) if !self.hand.has_word() => Some(poll.suspect(node)),
            (None, _) if self.hand.act(&mut outlet) => None,
            (None, _) if self.brakes.look(self.safety_mode) => Some(poll.first_mode()),
            (None, _) => poll.other(self.hand.answers_questions(), absent, self.brakes.suspect()),
        };
        if let Some(frame) = question {
            outlet.send(frame);
        }
    }

    /// Sends a request to brake, or a word to do so; true if a question may leave in the same slot.
    #[cold]
    #[inline(never)]
    fn ask_for_brakes(&mut self, frame: CanFrame, now_us: u64, io: &mut impl ControllerIo<Self>) -> bool {
        if !self.outlet(now_us, io).send(frame) {
            self.brakes.ask_again();
        }
        self.brakes.leaves_room()
    }

    fn outlet<'a, I: ControllerIo<Self>>(&'a mut self, now_us: u64, io: &'a mut I) -> SlotOutlet<'a, I> {
        SlotOutlet { io, counters: &mut self.counters, pacer: &mut self.pacer, now_us, cyclic: true }
    }

    /// Tells a change of the stage, and a new reason for which the start-up cannot go on.
    fn tell_stage(&mut self, io: &mut impl ControllerIo<Self>) {
        let stage = self.stage();
        let error = self.startup.error();
        if error.is_some() && error != self.blocked {
            self.blocked = error;
            self.tell(EventKind::Blocked(error.unwrap_or(StartupError::NoSafetyModule)), io);
        } else if error.is_none() {
            self.blocked = None;
        }
        if stage != self.stage {
            self.stage = stage;
            self.tell(EventKind::Startup(stage), io);
        }
    }

    fn tell(&self, kind: EventKind, io: &mut impl ControllerIo<Self>) {
        io.event(Event { cycle: self.number, kind });
    }
}

impl Controller for DeviceController {
    type Command = Command;
    type Event = Event;
    type Record = CycleRecord;
    type Primitive<'a> = &'a CheckedPrimitive<'a>;

    const STOP: Command = Command::Control(control::Command::Stop);

    fn slot(&mut self, slot: Slot, now_us: u64, io: &mut impl ControllerIo<Self>) {
        self.drain(io);
        match (self.phase, slot) {
            (BusPhase::StartUp, _) => self.start_up(now_us, io),
            (BusPhase::Cyclic(_), Slot::Request) => self.request(now_us, io),
            (BusPhase::Cyclic(_), Slot::Control) => self.control(now_us, io),
            (BusPhase::Cyclic(_), Slot::Slow) => self.ask_slowly(now_us, io),
        }
        match self.startup.zero_answer() {
            Some(Ok(())) => self.tell(EventKind::Accepted, io),
            Some(Err(reason)) => self.tell(EventKind::Refused(reason), io),
            None => {}
        }
        self.tell_stage(io);
        if let Some((stage, cause)) = self.hand.news() {
            self.hand_temperatures = if stage == HandStage::Failed { [None; 4] } else { self.hand_temperatures };
            self.tell(EventKind::Hand { stage, cause }, io);
        }
    }

    fn load(&mut self, fit: &CheckedPrimitive<'_>) -> Result<(), LoadRefusal> {
        self.cycle.load(fit)
    }

    fn weigh(&mut self, weight: &StoredWeight) -> bool {
        let taken = self.cycle.weigh(&weight.correction());
        taken.map(|()| self.startup.declare(weight.declared())).is_ok()
    }

    fn note_overrun(&mut self) {
        Counters::count(&mut self.counters.overruns);
        self.lateness.note(self.number);
    }

    fn note_bus_error(&mut self, bus_off: bool) {
        Counters::count(&mut self.counters.bus_errors);
        if bus_off && matches!(self.phase, BusPhase::Cyclic(_)) {
            self.fail();
        }
    }

    fn health(&self) -> Health {
        Health {
            cycle: self.number,
            stage: self.stage(),
            blocked: self.startup.error(),
            state: self.cycle.state(),
            law: self.cycle.law(),
            fault: self.cycle.fault(),
            zeroed: self.startup.is_zeroed(),
            zeroed_at: self.startup.zeroed_at(),
            payload: self.cycle.payload(),
            has_primitive: self.cycle.primitive().is_some(),
            wrench_zeroed: self.startup.has_sensor().then(|| self.cycle.is_wrench_zeroed()),
            safety_mode: self.safety_mode,
            pendant: self.pendant,
            temperatures: self.temperatures,
            hand: self.hand.stage(),
            hand_moves: self.hand.stage() == HandStage::Initialising || self.cycle.moves_hand(),
            hand_temperatures: self.hand_temperatures,
            counters: self.counters,
        }
    }

    fn message(event: Event, health: &Health) -> Option<Message> {
        match event.kind {
            EventKind::Accepted => Some(Message::Answer(Ok(()))),
            EventKind::Refused(reason) => Some(Message::Answer(Err(wire::refusal(reason, health)))),
            _ => wire::event(event).map(Message::News),
        }
    }
}

impl CycleReport for CycleRecord {
    fn number(&self) -> u32 {
        self.cycle as u32
    }

    fn state(&self) -> State {
        self.state
    }

    fn flags(&self) -> u32 {
        self.flags
    }

    fn telemetry(&self) -> link::Telemetry {
        wire::telemetry(self)
    }
}
