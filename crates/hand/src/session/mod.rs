//! `Session`: the low-priority half, which talks with the host; the rules of `docs/protocol.md`, as `device::Session` keeps them.
//!
//! What differs: an image is converted while it arrives and never held, so it cannot be read back; requests that need an arm are
//! refused with [`Refusal::NoArm`]. Numbers become real ones here and nowhere else.

mod library;
mod request;

use control::State;
use device::{Asker, Identity, Owner, Pending, QueueFull, Timing};
use heapless::Deque;
use link::frame::{self, Decoder, Envelope, FRAME_BYTES, Frame, LINK_TIMEOUT_MS};
use link::{Event as LinkEvent, EventKind, Name, Refusal, Reply, Request, Statistics, Telemetry};

use crate::command::{Command, Refused};
use crate::core::{Event, Health};
use crate::image::{ImageReader, Summary};
use crate::number::real;
use crate::primitive::FingerPrimitive;
use crate::record::TimedRecord;

pub use library::{Library, PLACES};

/// Requests that have arrived and are not handled yet.
const INBOX: usize = 3;

/// The line to the host and the queues to the control half.
pub trait SessionPort {
    /// Hands bytes to the line. Never more than [`SessionPort::room`] said.
    fn send(&mut self, bytes: &[u8]);
    /// Bytes the line can take now.
    fn room(&self) -> usize;
    /// Queues a command; each is answered by one event, in their order.
    ///
    /// # Errors
    /// [`QueueFull`]
    fn command(&mut self, command: Command) -> Result<(), QueueFull>;
    /// Gives the control cycle another primitive; false while one runs.
    fn load(&mut self, primitive: &FingerPrimitive) -> bool;
    /// The next record, oldest first.
    fn record(&mut self) -> Option<TimedRecord>;
    /// The next event, oldest first.
    fn event(&mut self) -> Option<Event>;
    /// The state of the control half now.
    fn health(&mut self) -> Health;
    /// What the board measured about its processor.
    fn timing(&mut self) -> Timing;
}

/// An upload under way.
struct Upload {
    name: Name,
    crc: u32,
    length: u32,
    reader: ImageReader,
}

/// The device's end of the link.
pub struct Session<'a> {
    identity: Identity,
    library: &'a mut Library,
    decoder: Decoder<FRAME_BYTES>,
    inbox: Deque<Frame<Request>, INBOX>,
    overrun: u32,
    sequence: u16,
    owner: Option<Owner>,
    pending: Pending,
    upload: Option<Upload>,
    loaded: Option<Summary>,
    telemetry_every: u8,
    latest: Option<TimedRecord>,
    limited_cycles: u32,
    telemetry_dropped: u32,
    events_dropped: u32,
    link_timeouts: u32,
}

impl<'a> Session<'a> {
    /// A session without a host.
    pub fn new(identity: Identity, library: &'a mut Library) -> Self {
        Session {
            identity,
            library,
            decoder: Decoder::new(),
            inbox: Deque::new(),
            overrun: 0,
            sequence: 0,
            owner: None,
            pending: Pending::default(),
            upload: None,
            loaded: None,
            telemetry_every: 0,
            latest: None,
            limited_cycles: 0,
            telemetry_dropped: 0,
            events_dropped: 0,
            link_timeouts: 0,
        }
    }

    /// Takes bytes from the line. Never acts on them; [`Session::poll`] does.
    pub fn receive(&mut self, mut bytes: &[u8]) {
        while let Some(frame) = self.decoder.next::<Request>(&mut bytes) {
            if self.inbox.is_full() {
                self.overrun = self.overrun.wrapping_add(1);
                // The host repeats what was not answered. A stop must not wait for that: the oldest gives way.
                if frame.message != Request::Stop {
                    continue;
                }
                self.inbox.pop_front();
            }
            // There is room now: it was made above.
            let _ = self.inbox.push_back(frame);
        }
    }

    /// Does everything that is due. Call it at least every millisecond or two; `now_us` is the device's time.
    pub fn poll(&mut self, now_us: u64, port: &mut impl SessionPort) {
        #[allow(
            clippy::cast_possible_truncation,
            reason = "milliseconds wrap after 49 days, and all compare by difference"
        )]
        let now_ms = (now_us / 1000) as u32;
        self.forward_events(now_ms, port);
        self.drop_unanswered(now_ms, port);
        while port.room() >= 2 * FRAME_BYTES {
            let Some(frame) = self.inbox.pop_front() else {
                break;
            };
            self.handle(now_ms, frame, port);
        }
        self.forward_records(now_ms, port);
        self.watch_host(now_ms, port);
    }

    fn forward_events(&mut self, now_ms: u32, port: &mut impl SessionPort) {
        while let Some(event) = port.event() {
            let answer = match event {
                Event::News(news) => {
                    self.tell(now_ms, news, port);
                    continue;
                }
                Event::Answer(answer) => answer,
            };
            match (self.pending.answered(), answer) {
                (Some(asker), answer) => self.pass_on(now_ms, asker, answer, port),
                (None, Ok(())) => {}
                (None, Err((reason, [detail, _]))) => {
                    let cycle = port.health().cycle;
                    let code = reason.code().into();
                    self.tell(now_ms, LinkEvent { cycle, kind: EventKind::CommandRefused, code, detail }, port);
                }
            }
        }
    }

    fn drop_unanswered(&mut self, now_ms: u32, port: &mut impl SessionPort) {
        while let Some((asker, waited)) = self.pending.expired(now_ms) {
            self.pass_on(now_ms, asker, Err((Refusal::NoAnswer, [waited, 0])), port);
        }
    }

    /// Tells whoever asked what became of a command; a host that has left meanwhile is told nothing.
    fn pass_on(&mut self, now_ms: u32, asker: Asker, outcome: Result<(), Refused>, port: &mut impl SessionPort) {
        let reply = |of| match outcome {
            Ok(()) => Reply::Accepted { of },
            Err((reason, detail)) => Reply::Refused { of, reason, detail },
        };
        match asker {
            Asker::Owner { session, of } if self.owner.as_ref().map(Owner::session) == Some(session) => {
                self.answer(now_ms, reply(of), port);
            }
            Asker::Stranger { session, of } if port.room() >= FRAME_BYTES => {
                self.send_to(session, now_ms, &reply(of), port);
            }
            _ => {}
        }
    }

    fn forward_records(&mut self, now_ms: u32, port: &mut impl SessionPort) {
        while let Some(timed) = port.record() {
            self.latest = Some(timed);
            if timed.record.flags & (control::flags::JOINT_LIMITED | control::flags::RATE_LIMITED) != 0 {
                self.limited_cycles = self.limited_cycles.wrapping_add(1);
            }
            let due = self.owner.is_some() && timed.record.cycle.checked_rem(self.telemetry_every.into()) == Some(0);
            if !due {
                continue;
            }
            if port.room() >= 2 * FRAME_BYTES {
                self.send(now_ms, &Reply::Telemetry(telemetry(&timed)), port);
            } else {
                self.telemetry_dropped = self.telemetry_dropped.wrapping_add(1);
            }
        }
    }

    /// Stops a motion whose host has fallen silent or gone, and ends its session: what it says next may be stale.
    fn watch_host(&mut self, now_ms: u32, port: &mut impl SessionPort) {
        let silence = self.owner.as_ref().map(|owner| owner.silence(now_ms));
        if silence.is_some_and(|silence| silence < LINK_TIMEOUT_MS) {
            return;
        }
        let health = port.health();
        let moving = matches!(health.state, State::Approach | State::Run | State::Coast);
        // Without a host the stop may be on its way already.
        if !moving || (silence.is_none() && !self.pending.is_empty()) {
            return;
        }
        if port.command(Command::Stop).is_err() {
            // Tried again in the next poll: the session stays open until the stop is on its way.
            return;
        }
        self.pending.push(Asker::Device, now_ms);
        self.link_timeouts = self.link_timeouts.wrapping_add(1);
        let news =
            LinkEvent { cycle: health.cycle, kind: EventKind::LinkTimeout, code: 0, detail: silence.unwrap_or(0) };
        self.tell(now_ms, news, port);
        self.close();
    }

    /// Ends the session of the present host.
    fn close(&mut self) {
        self.owner = None;
        self.telemetry_every = 0;
        self.upload = None;
    }

    /// Sends an answer and keeps it for a repetition of its request.
    fn answer(&mut self, now_ms: u32, reply: Reply, port: &mut impl SessionPort) {
        if port.room() >= FRAME_BYTES {
            self.send(now_ms, &reply, port);
        }
        if let Some(owner) = &mut self.owner {
            owner.remember(reply);
        }
    }

    /// Sends an event if anybody listens and the line has room.
    fn tell(&mut self, now_ms: u32, event: LinkEvent, port: &mut impl SessionPort) {
        if self.owner.is_none() {
            return;
        }
        if port.room() >= FRAME_BYTES {
            self.send(now_ms, &Reply::Event(event), port);
        } else {
            self.events_dropped = self.events_dropped.wrapping_add(1);
        }
    }

    fn send(&mut self, now_ms: u32, reply: &Reply, port: &mut impl SessionPort) {
        let session = self.owner.as_ref().map_or(0, Owner::session);
        self.send_to(session, now_ms, reply, port);
    }

    fn send_to(&mut self, session: u16, now_ms: u32, reply: &Reply, port: &mut impl SessionPort) {
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope { session, sequence: self.sequence, time_ms: now_ms };
        if let Some(frame) = frame::encode(envelope, reply, &mut buffer).ok().and_then(|length| buffer.get(..length)) {
            self.sequence = self.sequence.wrapping_add(1);
            port.send(frame);
        }
    }

    fn statistics(&self, port: &mut impl SessionPort) -> Statistics {
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
            lost_replies: 0,
            late_replies: counters.late_replies,
            rejected_frames: counters.malformed_frames.wrapping_add(counters.foreign_frames),
            frames_sent: counters.frames_sent,
            frames_received: counters.frames_received,
            frames_dropped: counters.frames_refused,
            torque_mismatches: 0,
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

/// A record as telemetry. The hand's torques stand in the first four places of `tau`: spread, F1, F2, F3; the arm's fields are 0.
fn telemetry(timed: &TimedRecord) -> Telemetry {
    let record = &timed.record;
    let [spread, f1, f2, f3] = record.torque.map(real);
    Telemetry {
        cycle: record.cycle,
        state: record.state.code(),
        fault: record.fault.code(),
        flags: record.flags,
        phase: real(record.phase),
        tau: [spread, f1, f2, f3, 0.0, 0.0, 0.0],
        pose_d: [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        lost_replies: record.lost,
        cost_ticks: timed.cost_ticks,
        hand: record.q.map(real),
        hand_d: record.q_d.map(real),
        gauges: record.gauges.map(real),
        ..Telemetry::default()
    }
}
