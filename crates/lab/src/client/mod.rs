//! `Client`: a conversation with a device.
//!
//! Opening one compares versions and hashes; nothing else is sent to a device that does not fit. After that every
//! request is answered or fails within [`ANSWER_TIMEOUT`] of the device's time; a lost answer is asked for again
//! with the same number, which the device acts on once. As long as somebody waits in [`Client::next`] or in a
//! request the device hears from this host often enough not to stop the arm; when nobody does, it stops it.

mod calibration;
mod fault_record;
mod halt;
mod interrupt;
mod motion;
mod observe;
mod secret;
mod storage;
mod telemetry;
mod transfer;
mod upload;
mod weight;

use std::collections::VecDeque;
use std::time::Duration;

use device::StoreError;
use link::frame::{self, Decoder, Envelope, FRAME_BYTES};
use link::message::{DeviceHello, HostHello};
use link::{
    Event, EventKind, LINK_VERSION, LinkCounters, Listing, Refusal, Reply, Request, SCHEMA_HASH, Statistics, Status,
    Telemetry, Text,
};

use crate::error::{Capability, HostError};
use crate::transport::Transport;

pub use fault_record::LastSecond;
pub use halt::Halted;
pub use interrupt::Interrupt;
pub use telemetry::{Gaps, TelemetryStream};
pub use transfer::Transfer;
use upload::changes_store;
pub use upload::{UploadOutcome, UploadPhase};

/// Longest time for an answer, the repetitions of its request included.
pub const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);

/// Longest time for the answer to a change of the store: it comes when the change is durable, and the flash may have
/// to erase two sectors first, each of which takes up to 4 s.
pub const STORE_TIMEOUT: Duration = Duration::from_secs(15);

/// A request without an answer is repeated after this time. Longer than most answers take on a good line; a change of
/// the store takes longer, and then the repetitions tell the device that this host is still there.
const REPEAT_AFTER: Duration = Duration::from_millis(250);

/// The device hears from this host at least so often while it waits for telemetry; it stops the arm after 500 ms.
const KEEP_ALIVE: Duration = Duration::from_millis(100);

/// A request that can move the arm is preceded by a ping if the device was heard longer ago than this: the
/// device refuses such a request when it is older than 500 ms.
const FRESH: Duration = Duration::from_millis(200);

/// A wait may end so much later than it should. Where one lasts longer, this program was suspended and did not listen.
const LATE: Duration = Duration::from_millis(200);

/// Longest wait for another host to be gone. A killed one keeps its session for half a second.
const BUSY_TIMEOUT: Duration = Duration::from_millis(1500);

/// Longest time for which a device reads its storage.
const STORE_BUSY: Duration = Duration::from_secs(3);

/// Time between two tries meanwhile.
const STORE_TRY: Duration = Duration::from_millis(20);

/// Something the device sent unasked.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Incoming {
    /// One control cycle.
    Telemetry(Telemetry),
    /// Something happened.
    Event(Event),
}

/// Times of answers that are kept, the newest.
const ANSWERS_KEPT: usize = 4096;

/// Round trips of requests, in the device's time.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct RoundTrips {
    /// Requests answered.
    pub count: u32,
    /// Requests sent again because no answer came.
    pub repeated: u32,
    /// Longest time from request to answer.
    pub worst: Duration,
    /// Sum of all these times.
    pub total: Duration,
}

/// A conversation with a device.
pub struct Client<T: Transport> {
    transport: T,
    decoder: Decoder<FRAME_BYTES>,
    hello: DeviceHello,
    session: u16,
    sequence: u16,
    device_ms: u32,
    heard: Duration,
    /// Bytes that came in, whatever they are.
    heard_bytes: usize,
    /// Time for which this host has listened at all: one that was suspended, or at work elsewhere, has not.
    listened: Duration,
    /// The same when it last heard of the device.
    listened_before: Duration,
    sent: Duration,
    incoming: VecDeque<Incoming>,
    answers: VecDeque<Reply>,
    gaps: Gaps,
    round_trips: RoundTrips,
    took: VecDeque<Duration>,
    /// A motion of the arm that this host has ordered goes on.
    moving: bool,
    /// A cycle of it has been told: the first one behind it that tells none is its end.
    seen_moving: bool,
    /// Until then a motion of the hand that this host has ordered may go on.
    hand_moves_until: Duration,
    observing: bool,
    /// The device's time has gone back: it was started anew.
    restarted: bool,
    open: bool,
    timeout: Duration,
    transfer: Transfer,
    interrupt: Interrupt,
    /// That wish has been told: what is asked for from then on is asked for in spite of it.
    is_heeded: bool,
    received: Vec<u8>,
}

impl<T: Transport> Client<T> {
    /// Opens a conversation. `owner` is shown to others that find the device busy, e.g. "anna@lab3".
    ///
    /// # Errors
    /// [`HostError::Incompatible`] with both versions, [`HostError::NoAnswer`] within two seconds,
    /// [`HostError::InUse`] if another host is using the device.
    pub fn connect(transport: T, owner: &str) -> Result<Self, HostError> {
        Self::connect_as(transport, owner, LINK_VERSION, SCHEMA_HASH)
    }

    /// Opens a conversation pretending to be of a given version: to test how devices refuse.
    ///
    /// # Errors
    /// As [`Client::connect`].
    pub fn connect_as(transport: T, owner: &str, link_version: u16, schema_hash: u32) -> Result<Self, HostError> {
        let mut client = Self::begin(transport)?;
        client.open(owner, link_version, schema_hash, BUSY_TIMEOUT)?;
        Ok(client)
    }

    /// A client that has not spoken yet.
    fn begin(transport: T) -> Result<Self, HostError> {
        let now = transport.now();
        let mut client = Self {
            session: session_number(transport.is_virtual()),
            transport,
            decoder: Decoder::new(),
            hello: DeviceHello::default(),
            sequence: 0,
            device_ms: 0,
            heard: now,
            heard_bytes: 0,
            listened: Duration::ZERO,
            listened_before: Duration::ZERO,
            sent: now,
            incoming: VecDeque::new(),
            answers: VecDeque::new(),
            gaps: Gaps::default(),
            round_trips: RoundTrips::default(),
            took: VecDeque::new(),
            moving: false,
            seen_moving: false,
            hand_moves_until: Duration::ZERO,
            observing: false,
            restarted: false,
            open: false,
            timeout: ANSWER_TIMEOUT,
            transfer: Transfer::default(),
            interrupt: Interrupt::never(),
            is_heeded: false,
            received: Vec::new(),
        };
        // Ends whatever half a frame an earlier host may have left on the line.
        client.transport.send(&[0])?;
        Ok(client)
    }

    /// Says hello; waits for so long until another host is gone.
    fn open(&mut self, owner: &str, link_version: u16, schema_hash: u32, patience: Duration) -> Result<(), HostError> {
        let hello = HostHello { link_version, schema_hash, model_hash: control::MODEL_HASH, owner: Text::new(owner) };
        let greeted = self.greet(&Request::Hello(hello.clone()), &hello, patience);
        if let Err(HostError::Refused { reason: Refusal::Busy, detail: [_, wait], .. }) = greeted {
            return Err(self.in_use(hello, wait));
        }
        self.hello = greeted?;
        self.open = true;
        Ok(())
    }

    fn greet(&mut self, greeting: &Request, hello: &HostHello, patience: Duration) -> Result<DeviceHello, HostError> {
        let started = self.transport.now();
        loop {
            match self.exchange(greeting) {
                Ok(Reply::Hello { hello: device, .. }) => {
                    // The device has compared; comparing here too catches a device that does not.
                    differs(Refusal::LinkVersion, hello.link_version, device.link_version)?;
                    differs_hash(Refusal::Schema, hello.schema_hash, device.schema_hash)?;
                    differs_hash(Refusal::Model, hello.model_hash, device.model_hash)?;
                    return Ok(device);
                }
                Ok(_) => return Err(HostError::WrongAnswer { request: "hello" }),
                Err(HostError::Refused { reason: Refusal::LinkVersion, detail: [host, device], .. }) => {
                    differs(Refusal::LinkVersion, host, device)?;
                    return Err(HostError::WrongAnswer { request: "hello" });
                }
                Err(HostError::Refused { reason: reason @ (Refusal::Schema | Refusal::Model), detail, .. }) => {
                    differs_hash(reason, detail[0], detail[1])?;
                    return Err(HostError::WrongAnswer { request: "hello" });
                }
                Err(HostError::Refused { reason: Refusal::Busy, detail: [_, wait], .. })
                    if self.transport.now().saturating_sub(started) < patience =>
                {
                    let until = self.transport.now() + Duration::from_millis(u64::from(wait.clamp(10, 600)));
                    while self.transport.now() < until {
                        self.pump(until.saturating_sub(self.transport.now()))?;
                    }
                }
                Err(error) => return Err(error),
            }
        }
    }

    /// Who the device is.
    pub fn hello(&self) -> &DeviceHello {
        &self.hello
    }

    /// Succeeds if the program of the device is made for this part.
    ///
    /// # Errors
    /// [`HostError::Lacks`]
    pub fn require(&self, capability: Capability) -> Result<(), HostError> {
        capability.of(self.hello.capabilities)
    }

    /// Ends waiting, and stops the arm, when the user interrupts.
    pub fn set_interrupt(&mut self, interrupt: Interrupt) {
        (self.interrupt, self.is_heeded) = (interrupt, false);
    }

    /// Longest wait for an answer.
    pub fn set_timeout(&mut self, timeout: Duration) {
        self.timeout = timeout;
    }

    /// The transport, e.g. to reach into a simulated world. Bytes belong to the client.
    pub fn transport(&mut self) -> &mut T {
        &mut self.transport
    }

    /// Time of the transport's clock.
    pub fn now(&self) -> Duration {
        self.transport.now()
    }

    /// True if that clock is virtual.
    pub fn is_virtual(&self) -> bool {
        self.transport.is_virtual()
    }

    /// True if the arm is a simulated one, as far as can be known here: the device says so, or its time is virtual.
    /// The image on an emulated board does not know it, and behind a socket nobody does.
    pub fn is_simulated(&self) -> bool {
        self.hello.simulated || self.transport.is_virtual()
    }

    /// Counters of this end of the link.
    pub fn counters(&self) -> LinkCounters {
        self.decoder.counters()
    }

    /// Messages and telemetry that did not arrive.
    pub fn gaps(&self) -> Gaps {
        self.gaps
    }

    /// Throughput of the last upload.
    pub fn transfer(&self) -> Transfer {
        self.transfer
    }

    /// Response times of the device.
    pub fn round_trips(&self) -> RoundTrips {
        self.round_trips
    }

    /// Times that the newest answers took, oldest first, since this was last asked. Answers to a change of the store
    /// are not among them: these wait for the flash.
    pub fn take_answer_times(&mut self) -> Vec<Duration> {
        self.took.drain(..).collect()
    }

    /// Sends a request and waits for its answer. Nothing is begun for a user who has interrupted before.
    ///
    /// # Errors
    /// [`HostError::Refused`], [`HostError::NoAnswer`] after the time-out, [`HostError::Transport`]; of what begins a
    /// motion, or gives torque, [`HostError::Left`] and [`HostError::Interrupted`].
    pub fn request(&mut self, request: &Request) -> Result<Reply, HostError> {
        if self.interrupt.is_raised() && !self.is_heeded && motion::begins(request, self.moving) {
            return Err(self.interrupted());
        }
        if request.moves() && self.transport.now().saturating_sub(self.heard) > FRESH {
            self.exchange(&Request::Ping)?;
        }
        // What moves is refused at once: it would begin when nobody expects it any more.
        let reply = if request.moves() { self.exchange(request) } else { self.exchange_when_read(request) }?;
        self.note_order(request);
        Ok(reply)
    }

    /// A request that is answered by a plain yes.
    fn order(&mut self, request: &Request) -> Result<(), HostError> {
        match self.request(request)? {
            Reply::Accepted { .. } => Ok(()),
            _ => Err(HostError::WrongAnswer { request: request.name() }),
        }
    }

    /// As [`Client::exchange`]; waits for a device that is still reading its storage, as it does after a start, or that
    /// writes a change of a host that has gone.
    fn exchange_when_read(&mut self, request: &Request) -> Result<Reply, HostError> {
        let begins = matches!(request, Request::UploadBegin { .. });
        let patience = if begins || changes_store(request) { STORE_TIMEOUT } else { STORE_BUSY };
        let (end, busy) = (self.transport.now() + patience, StoreError::Busy.code());
        loop {
            match self.exchange(request) {
                Err(HostError::Refused { reason: Refusal::StoreFailed, detail: [code, _], .. })
                    if code == busy && self.transport.now() < end =>
                {
                    self.pump(STORE_TRY)?;
                }
                answered => return answered,
            }
        }
    }

    fn exchange(&mut self, request: &Request) -> Result<Reply, HostError> {
        self.sequence = self.sequence.wrapping_add(1);
        let of = self.sequence;
        let started = self.transport.now();
        // The age of a request counts from here: a repetition is not younger than the first attempt.
        let envelope = Envelope { session: self.session, sequence: of, time_ms: self.device_ms };
        self.send(envelope, request)?;
        let mut repeat_at = started + REPEAT_AFTER;
        let timeout = if changes_store(request) { self.timeout.max(STORE_TIMEOUT) } else { self.timeout };
        loop {
            if let Some(reply) = self.take_answer(of) {
                let took = self.transport.now().saturating_sub(started);
                self.round_trips.count += 1;
                self.round_trips.worst = self.round_trips.worst.max(took);
                self.round_trips.total += took;
                if timeout == self.timeout {
                    if self.took.len() >= ANSWERS_KEPT {
                        self.took.pop_front();
                    }
                    self.took.push_back(took);
                }
                return match reply {
                    Reply::Refused { reason, detail, .. } => {
                        Err(HostError::Refused { request: request.name(), reason, detail })
                    }
                    reply => Ok(reply),
                };
            }
            let now = self.transport.now();
            let deadline = started + timeout;
            if now >= deadline {
                let strange = if self.counters().accepted == 0 { self.heard_bytes } else { 0 };
                return Err(HostError::unanswered(request.name(), timeout, strange));
            }
            if now >= repeat_at {
                self.round_trips.repeated += 1;
                self.send_again(envelope, request)?;
                repeat_at = now + REPEAT_AFTER;
            }
            self.pump(repeat_at.min(deadline).saturating_sub(now))?;
        }
    }

    fn take_answer(&mut self, of: u16) -> Option<Reply> {
        // Answers to pings, and to requests that were given up, are not waited for.
        while let Some(reply) = self.answers.pop_front() {
            if reply.answers() == Some(of) {
                return Some(reply);
            }
        }
        None
    }

    fn send(&mut self, envelope: Envelope, request: &Request) -> Result<(), HostError> {
        self.send_behind(&[], envelope, request)
    }

    fn send_behind(&mut self, head: &[u8], envelope: Envelope, request: &Request) -> Result<(), HostError> {
        let mut buffer = [0; FRAME_BYTES];
        // No request is longer than a frame; `the_largest_messages_fit` in `link` proves it.
        let length = frame::encode(envelope, request, &mut buffer)
            .map_err(|error| crate::transport::TransportError::other(error.to_string()))?;
        self.sent = self.transport.now();
        Ok(self.transport.send(&[head, &buffer[..length]].concat())?)
    }

    /// As [`Client::send`], after a zero byte: half a message may stand on the line, and one that follows is lost with
    /// it.
    fn send_again(&mut self, envelope: Envelope, request: &Request) -> Result<(), HostError> {
        self.send_behind(&[0], envelope, request)
    }

    /// Waits for bytes and sorts what they carry.
    fn pump(&mut self, timeout: Duration) -> Result<(), HostError> {
        let mut bytes = std::mem::take(&mut self.received);
        bytes.clear();
        let begun = self.transport.now();
        // A wait shorter than the step of a virtual clock would not let its time pass at all.
        let received = self.transport.receive(timeout.max(Duration::from_micros(10)), &mut bytes);
        self.listened += self.transport.now().saturating_sub(begun).min(timeout + LATE);
        self.heard_bytes += bytes.len();
        let mut rest = bytes.as_slice();
        while let Some(frame) = self.decoder.next::<Reply>(&mut rest) {
            // What the device says to others carries numbers of the same series.
            self.gaps.message(frame.envelope.sequence);
            // An observer takes what the device tells the one that commands.
            let is_told = matches!(frame.message, Reply::Telemetry(_) | Reply::Event(_));
            if frame.envelope.session == self.session || (self.observing && is_told) {
                self.sort(frame);
            }
        }
        self.received = bytes;
        Ok(received?)
    }

    fn sort(&mut self, frame: frame::Frame<Reply>) {
        (self.heard, self.listened_before) = (self.transport.now(), self.listened);
        self.note_time(frame.envelope.time_ms);
        match frame.message {
            Reply::Telemetry(telemetry) => {
                self.gaps.telemetry(telemetry.cycle);
                self.note_state(telemetry.state);
                self.incoming.push_back(Incoming::Telemetry(telemetry));
            }
            Reply::Event(event) => {
                // A movement that has ended needs no stop: it ended in hold, which the arm shall keep.
                self.moving &= match event.kind {
                    EventKind::Arrived => false,
                    EventKind::State => u8::try_from(event.code).is_ok_and(motion::is_moving),
                    _ => true,
                };
                self.incoming.push_back(Incoming::Event(event));
            }
            answer => self.answers.push_back(answer),
        }
    }

    /// The next thing the device sends unasked; `None` if nothing came within `timeout` of listening. Keeps the session
    /// alive.
    ///
    /// # Errors
    /// [`HostError::Interrupted`] after the arm has been stopped, [`HostError::NoAnswer`] if the device has fallen
    /// silent, [`HostError::Refused`] if it knows this host no longer, [`HostError::Transport`].
    pub fn next(&mut self, timeout: Duration) -> Result<Option<Incoming>, HostError> {
        let deadline = self.listened + timeout;
        loop {
            if self.interrupt.is_raised() {
                return Err(self.interrupted());
            }
            if let Some(incoming) = self.incoming.pop_front() {
                return Ok(Some(incoming));
            }
            self.take_pongs()?;
            if self.listened >= deadline {
                return Ok(None);
            }
            // Answers to pings come many times within this; without them the line is dead.
            let silence = self.listened.saturating_sub(self.listened_before);
            if silence >= self.timeout {
                return Err(HostError::NoAnswer { request: "ping", after: silence });
            }
            let now = self.transport.now();
            if now.saturating_sub(self.sent) >= KEEP_ALIVE {
                self.sequence = self.sequence.wrapping_add(1);
                let envelope = Envelope { session: self.session, sequence: self.sequence, time_ms: self.device_ms };
                self.send(envelope, &Request::Ping)?;
            }
            let ping_due = (self.sent + KEEP_ALIVE).saturating_sub(now);
            self.pump(deadline.saturating_sub(self.listened).min(ping_due))?;
        }
    }

    /// Takes the answers to pings. A device that has let go of this host, or was started anew, answers them too: what
    /// is waited for will not come.
    fn take_pongs(&mut self) -> Result<(), HostError> {
        while let Some(answer) = self.answers.pop_front() {
            if let Reply::Refused { reason: reason @ Refusal::NoSession, detail, .. } = answer {
                return Err(HostError::Refused { request: "ping", reason, detail });
            }
        }
        Ok(())
    }

    /// The state of the device.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn status(&mut self) -> Result<Status, HostError> {
        match self.request(&Request::Status)? {
            Reply::Status { status, .. } => {
                self.note_status(&status);
                Ok(status)
            }
            _ => Err(HostError::WrongAnswer { request: "status" }),
        }
    }

    /// The counters of the device.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn statistics(&mut self) -> Result<Statistics, HostError> {
        match self.request(&Request::Statistics)? {
            Reply::Statistics { statistics, .. } => Ok(statistics),
            _ => Err(HostError::WrongAnswer { request: "statistics" }),
        }
    }

    /// The primitives the device stores.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn list(&mut self) -> Result<Vec<Listing>, HostError> {
        let mut stored = Vec::new();
        for index in 0..self.hello.slots {
            match self.request(&Request::List { index })? {
                Reply::Listing { listing, .. } => stored.extend(listing),
                _ => return Err(HostError::WrongAnswer { request: "list" }),
            }
        }
        Ok(stored)
    }
}

impl<T: Transport> Drop for Client<T> {
    /// Stops an arm this host has set in motion, and frees the device. Does not wait: errors find nobody here,
    /// and the device stops the arm by itself when it hears nothing more.
    fn drop(&mut self) {
        if !self.open {
            return;
        }
        let farewell = [Request::Stop, Request::Goodbye];
        for request in farewell.iter().skip(usize::from(!self.moving)) {
            self.sequence = self.sequence.wrapping_add(1);
            let envelope = Envelope { session: self.session, sequence: self.sequence, time_ms: self.device_ms };
            if self.send(envelope, request).is_err() {
                return;
            }
        }
    }
}

fn differs(what: Refusal, host: impl Into<u32>, device: impl Into<u32>) -> Result<(), HostError> {
    let (host, device) = (host.into(), device.into());
    if host == device {
        return Ok(());
    }
    Err(HostError::Incompatible { what, host: format!("version {host}"), device: format!("version {device}") })
}

fn differs_hash(what: Refusal, host: u32, device: u32) -> Result<(), HostError> {
    if host == device {
        return Ok(());
    }
    Err(HostError::Incompatible { what, host: format!("{host:#010x}"), device: format!("{device:#010x}") })
}

/// A number that no other host on this line is likely to have. A simulated device has no other hosts, and its
/// runs must not differ.
fn session_number(is_virtual: bool) -> u16 {
    use std::hash::{BuildHasher, Hasher};
    if is_virtual {
        return 1;
    }
    let random = std::collections::hash_map::RandomState::new().build_hasher().finish();
    (random % 0xFFFF) as u16 + 1
}
