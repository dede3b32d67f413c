//! `HostSession`: the low-priority half of a device, which talks with the host.
//!
//! Sans-I/O: bytes go in by [`HostSession::receive`], everything else happens in [`HostSession::poll`] through a
//! [`SessionPort`]. The rules are those of `docs/protocol.md`:
//!
//! - nothing is answered before a matching hello; one host at a time, and no other one can delay what it asks;
//! - a stop is obeyed from anybody, whatever its number;
//! - observers are told what the host is told, and can change nothing;
//! - every request is answered once, and acted on once however often it is repeated;
//! - a request for the control half is answered when that half has taken or refused it;
//! - what moves is stopped when the host has been silent for half a second ([`LINK_TIMEOUT_MS`]), before anything else;
//! - an image replaces another only when it is complete, undamaged and fit for this device;
//! - a change of the store is answered when it is durable;
//! - a device that keeps a secret moves and changes nothing for a session that has not proven to know it.

mod inbox;
mod lock;
mod observers;
mod owner;
mod pending;
mod request;
mod upload;

use control::State;
use link::frame::{self, Decoder, Envelope, FRAME_BYTES, LINK_TIMEOUT_MS};
use link::{Event, EventKind, Refusal, Reply, Request, Statistics, Telemetry};
use pinned_init::{Init, init};

use crate::application::{Application, Controller, CycleReport, Message, Refused, SessionPort, TimedRecord};
use inbox::Inbox;
use lock::Lock;
use observers::Observers;
use owner::Owner;
pub use pending::PENDING_COMMANDS;
use pending::{Pending, Requester};
use upload::Upload;

/// Bytes that the session keeps free on the line for an answer before it sends telemetry.
const ANSWER_ROOM: usize = FRAME_BYTES;

/// Who the device is, for its hello.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Identity {
    /// Firmware version and git revision.
    pub firmware: &'static str,
    /// Board.
    pub board: &'static str,
    /// Serial number.
    pub serial: &'static str,
    /// Under QEMU or in-process.
    pub simulated: bool,
    /// Unit of all `*_ticks`: ticks per second.
    pub ticks_per_second: u32,
    /// Instructions per tick, where time is counted in instructions as under QEMU; 0 where a clock runs.
    pub instructions_per_tick: u8,
}

/// The device's end of the link.
///
/// That of an arm takes about 35 kB beside the store; [`crate::RamStore`] should be a static of its own, lent as
/// `&mut`.
#[derive(Debug)]
pub struct HostSession<A: Application> {
    identity: Identity,
    pub(super) application: A,
    decoder: Decoder<FRAME_BYTES>,
    inbox: Inbox,
    overrun: u32,
    sequence: u16,
    owner: Option<Owner>,
    observers: Observers,
    lock: Lock,
    pending: Pending,
    upload: Option<Upload>,
    /// Session and number of the request whose change is being saved.
    saving: Option<(u16, u16)>,
    telemetry_every: u8,
    latest: Option<TimedRecord<<A::Controller as Controller>::Record>>,
    limited_cycles: u32,
    telemetry_dropped: u32,
    events_dropped: u32,
    link_timeouts: u32,
}

impl<A: Application> HostSession<A> {
    /// Makes a session without a host in its place.
    pub fn over(identity: Identity, application: impl Init<A>) -> impl Init<Self> {
        init!(HostSession {
            identity,
            application <- application,
            decoder: Decoder::new(),
            inbox: Inbox::default(),
            overrun: 0,
            sequence: 0,
            owner: None,
            observers: Observers::default(),
            lock: Lock::default(),
            pending: Pending::default(),
            upload: None,
            saving: None,
            telemetry_every: 0,
            latest: None,
            limited_cycles: 0,
            telemetry_dropped: 0,
            events_dropped: 0,
            link_timeouts: 0,
        })
    }

    /// Takes bytes from the line. Never acts on them; [`HostSession::poll`] does.
    pub fn receive(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.next::<Request>(&mut bytes) {
            let is_owner = self.is_owner(frame.envelope.session);
            // A host repeats what was not answered.
            if !self.inbox.push(frame, is_owner) {
                self.overrun = self.overrun.wrapping_add(1);
            }
        }
    }

    /// Does everything that is due: answers, events, requests, telemetry, time-outs. Call it at least every
    /// millisecond or two; `now_us` is the device's time.
    pub fn poll(&mut self, now_us: u64, port: &mut impl SessionPort<A::Controller>) {
        let now_ms = milliseconds(now_us);
        self.lock.tick(now_us);
        self.observers.forget_silent(now_ms);
        self.forward_events(now_ms, port);
        self.drop_unanswered(now_ms, port);
        self.settle(now_ms, port);
        let open = self.application.is_open(now_ms);
        // The time-out is served before each request: no host inherits the motion of another.
        while self.watch_host(now_ms, port) {
            let present = self.owner.as_ref().map(Owner::session);
            // An order of a host that has left is not decided yet: nobody comes before its motion is known and stopped.
            let undecided = present.is_none() && self.pending.holds_orders();
            // A stop waits neither for that, nor for the store, nor for room: what is not answered its host repeats.
            let stops_only = !open || undecided || port.room() < 2 * ANSWER_ROOM;
            let is_owner = |session| present == Some(session);
            let Some(frame) = self.inbox.pop(now_ms, present.is_none(), stops_only, is_owner) else { break };
            self.handle(now_ms, frame, port);
        }
        // A store in memory is done at once.
        self.settle(now_ms, port);
        self.forward_records(now_ms, port);
    }

    /// Events of the control half: answers to commands, and news.
    fn forward_events(&mut self, now_ms: u32, port: &mut impl SessionPort<A::Controller>) {
        while let Some(event) = port.event() {
            let health = port.health();
            match A::Controller::message(event, &health) {
                None => {}
                Some(Message::News(news)) => self.tell(now_ms, news, port),
                Some(Message::Answer(answer)) => match (self.pending.answered(), answer) {
                    (Some(requester), answer) => self.pass_on(now_ms, requester, answer, port),
                    (None, Ok(())) => {}
                    (None, Err((reason, [detail, _]))) => {
                        let (cycle, code) = (health.cycle as u32, reason.code().into());
                        self.tell(now_ms, Event { cycle, kind: EventKind::CommandRefused, code, detail }, port);
                    }
                },
            }
        }
    }

    /// Commands the control half has not answered for too long.
    fn drop_unanswered(&mut self, now_ms: u32, port: &mut impl SessionPort<A::Controller>) {
        while let Some((requester, waited)) = self.pending.expired(now_ms) {
            self.pass_on(now_ms, requester, Err((Refusal::NoAnswer, [waited, 0])), port);
        }
    }

    /// Tells whoever asked what became of a command; a host that has left meanwhile is told nothing.
    fn pass_on(
        &mut self,
        now_ms: u32,
        requester: Requester,
        outcome: Result<(), Refused>,
        port: &mut impl SessionPort<A::Controller>,
    ) {
        let reply = |of| match outcome {
            Ok(()) => Reply::Accepted { of },
            Err((reason, detail)) => Reply::Refused { of, reason, detail },
        };
        match requester {
            Requester::Owner { session, of } if self.owner.as_ref().map(Owner::session) == Some(session) => {
                self.answer(now_ms, reply(of), port);
            }
            Requester::OtherHost { session, of } if port.room() >= FRAME_BYTES => {
                self.send_to(session, now_ms, &reply(of), port);
            }
            _ => {}
        }
    }

    /// Answers the host whose change has become durable, or has failed.
    fn settle(&mut self, now_ms: u32, port: &mut impl SessionPort<A::Controller>) {
        let Some(saved) = self.application.saved(self.pending.is_empty(), port) else { return };
        let present = self.owner.as_ref().map(Owner::session);
        if let Some((_, of)) = self.saving.take().filter(|(session, _)| present == Some(*session)) {
            let reply = match saved.outcome {
                Ok(()) => Reply::Accepted { of },
                Err((reason, detail)) => Reply::Refused { of, reason, detail },
            };
            self.answer(now_ms, reply, port);
        }
        if let Some(place) = saved.place {
            let cycle = port.health().cycle as u32;
            self.tell(now_ms, Event { cycle, kind: EventKind::Store, code: place.into(), detail: 0 }, port);
        }
    }

    /// Cycle records: the latest is kept, every so many go out as telemetry if the line has room.
    fn forward_records(&mut self, now_ms: u32, port: &mut impl SessionPort<A::Controller>) {
        const LIMITED: u32 =
            control::flags::JOINT_LIMITED | control::flags::MOTOR_LIMITED | control::flags::RATE_LIMITED;
        while let Some(timed) = port.record() {
            self.latest = Some(timed);
            if timed.record.flags() & LIMITED != 0 {
                self.limited_cycles = self.limited_cycles.wrapping_add(1);
            }
            let telemetry = Telemetry { cost_ticks: timed.cost_ticks, ..timed.record.telemetry() };
            if let Some(memory) = port.fault_memory() {
                memory.take(&telemetry);
            }
            let number = timed.record.number();
            let is_due = number.checked_rem(self.telemetry_every.into()) == Some(0);
            let owner = self.owner.as_ref().filter(|_| is_due).map(Owner::session);
            // Once for all: observers take what the owner is told as well, for the line has no room for it twice.
            let Some(session) = owner.or_else(|| self.observers.awaiting(number)) else { continue };
            if port.room() >= FRAME_BYTES + ANSWER_ROOM {
                self.send_to(session, now_ms, &Reply::Telemetry(telemetry), port);
            } else {
                self.telemetry_dropped = self.telemetry_dropped.wrapping_add(1);
            }
        }
    }

    /// Stops a motion whose host has fallen silent or gone, and ends its session: what it says next may be stale. False
    /// if the stop found no room: nothing else may happen before it has.
    fn watch_host(&mut self, now_ms: u32, port: &mut impl SessionPort<A::Controller>) -> bool {
        let silence = self.owner.as_ref().map(|owner| owner.silence(now_ms));
        if silence.is_some_and(|silence| silence < LINK_TIMEOUT_MS) {
            return true;
        }
        let health = port.health();
        // By the law: a lost reply that is bridged while the arm holds is no motion.
        let active = matches!(health.law, State::Gravity | State::Approach | State::Run);
        let moving = active || health.hand_moves;
        // Without a host the stop may be on its way already.
        if !moving || (silence.is_none() && !self.pending.is_empty()) {
            return true;
        }
        if port.command(A::Controller::STOP).is_err() {
            // Tried again in the next poll: the session stays open until the stop is on its way.
            return false;
        }
        self.pending.push(Requester::Device, now_ms);
        self.link_timeouts = self.link_timeouts.wrapping_add(1);
        let (cycle, detail) = (health.cycle as u32, silence.unwrap_or(0));
        self.tell(now_ms, Event { cycle, kind: EventKind::LinkTimeout, code: 0, detail }, port);
        self.close();
        true
    }

    /// Ends the session of the present host.
    fn close(&mut self) {
        self.owner = None;
        // A host that comes after may have its number: it is not answered for what another asked.
        self.saving = None;
        self.telemetry_every = 0;
        self.upload_abort();
    }

    /// Sends an answer and keeps it for a repetition of its request.
    fn answer(&mut self, now_ms: u32, reply: Reply, port: &mut impl SessionPort<A::Controller>) {
        if port.room() >= FRAME_BYTES {
            self.send(now_ms, &reply, port);
        }
        if let Some(owner) = &mut self.owner {
            owner.remember(reply);
        }
    }

    /// Sends an event if anybody listens and the line has room.
    fn tell(&mut self, now_ms: u32, event: Event, port: &mut impl SessionPort<A::Controller>) {
        let owner = self.owner.as_ref().map(Owner::session);
        let Some(session) = owner.or_else(|| self.observers.any()) else { return };
        if port.room() >= FRAME_BYTES {
            self.send_to(session, now_ms, &Reply::Event(event), port);
        } else {
            self.events_dropped = self.events_dropped.wrapping_add(1);
        }
    }

    /// Sends a message to the host that has the session.
    fn send(&mut self, now_ms: u32, reply: &Reply, port: &mut impl SessionPort<A::Controller>) {
        let session = self.owner.as_ref().map_or(0, Owner::session);
        self.send_to(session, now_ms, reply, port);
    }

    /// Sends a message to a host, be it the one that has the session or not.
    fn send_to(&mut self, session: u16, now_ms: u32, reply: &Reply, port: &mut impl SessionPort<A::Controller>) {
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope { session, sequence: self.sequence, time_ms: now_ms };
        if let Some(frame) = frame::encode(envelope, reply, &mut buffer).ok().and_then(|length| buffer.get(..length)) {
            self.sequence = self.sequence.wrapping_add(1);
            port.send(frame);
        }
    }

    /// All counters: those of the control half, of the board, and its own.
    fn statistics(&self, port: &mut impl SessionPort<A::Controller>) -> Statistics {
        let counters = port.health().counters;
        let timing = port.timing();
        let mut link = self.decoder.counters();
        link.overrun = self.overrun;
        Statistics {
            cycles: counters.cycles,
            missed_deadlines: counters.overruns,
            cost_worst_ticks: timing.cost_worst_ticks,
            cost_mean_ticks: timing.cost_mean_ticks,
            latency_worst_ticks: timing.latency_worst_ticks,
            lost_replies: counters.lost_replies,
            late_replies: counters.late_replies,
            rejected_frames: counters.malformed_frames.wrapping_add(counters.foreign_frames),
            frames_sent: counters.frames_sent,
            frames_received: counters.frames_received,
            frames_dropped: counters.frames_refused,
            torque_mismatches: counters.torque_mismatches,
            bus_errors: counters.bus_errors,
            bus_restarts: counters.restarts,
            limited_cycles: self.limited_cycles,
            telemetry_dropped: self.telemetry_dropped,
            events_dropped: self.events_dropped,
            link_timeouts: self.link_timeouts,
            link,
            stack_free: timing.stack_free,
            stack_size: timing.stack_size,
            hand_lost_replies: counters.hand_lost_replies,
        }
    }
}

/// The device's time as it stands in envelopes, where it wraps after 49 days.
const fn milliseconds(now_us: u64) -> u32 {
    (now_us / 1000) as u32
}
