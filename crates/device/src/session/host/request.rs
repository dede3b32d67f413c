//! One request: who may ask it, when, and what it does on every device.

use link::frame::{Frame, REQUEST_AGE_LIMIT_MS};
use link::{DeviceHello, HostHello, LINK_VERSION, Refusal, Reply, Request, SCHEMA_HASH, Status, Text};

use crate::application::{Action, Application, Controller, CycleReport, Refused, SessionPort};
use crate::session::host::HostSession;
use crate::session::host::owner::{Owner, RequestOrder};
use crate::session::host::pending::Requester;
use crate::session::host::upload::Upload;
use crate::wire::StartupFailure;

impl<A: Application> HostSession<A> {
    /// Takes one request: greets, refuses other hosts, repeats answers, acts.
    pub(super) fn handle(&mut self, now_ms: u32, frame: Frame<Request>, port: &mut impl SessionPort<A::Controller>) {
        let Frame { envelope, message } = frame;
        let of = envelope.sequence;
        // Before the order of the requests: a stop must not be taken for a repetition or for a late one.
        if message == Request::Stop {
            return self.stop(now_ms, envelope.session, of, port);
        }
        if let Request::Observe(hello) = &message {
            let reply = match self.admit_observer(now_ms, envelope.session, hello) {
                Ok(()) => Reply::Hello { of, hello: self.hello() },
                Err((reason, detail)) => Reply::Refused { of, reason, detail },
            };
            return self.send_to(envelope.session, now_ms, &reply, port);
        }
        if !matches!(message, Request::Hello(_)) && self.observers.hear(envelope.session, now_ms) {
            let reply = self.show(now_ms, envelope.session, of, message, port);
            let reply = reply.unwrap_or_else(|(reason, detail)| Reply::Refused { of, reason, detail });
            return self.send_to(envelope.session, now_ms, &reply, port);
        }
        let order = match &mut self.owner {
            // A host that was started anew, under the number that it had.
            Some(owner) if matches!(message, Request::Hello(_)) && owner.protected_for(now_ms) == 0 => {
                RequestOrder::New
            }
            Some(owner) if owner.session() == envelope.session => owner.order(of, now_ms),
            _ => RequestOrder::New,
        };
        match order {
            RequestOrder::New => {}
            RequestOrder::Again => {
                if let Some(reply) = self.owner.as_ref().and_then(Owner::answer).cloned() {
                    self.send(now_ms, &reply, port);
                }
                return;
            }
            RequestOrder::Ignore => return,
        }
        if let Err((reason, detail)) = self.admit(now_ms, envelope.session, of, &message) {
            return self.send_to(envelope.session, now_ms, &Reply::Refused { of, reason, detail }, port);
        }
        let age = now_ms.wrapping_sub(envelope.time_ms);
        let outcome = if message.moves() && age > REQUEST_AGE_LIMIT_MS {
            Err((Refusal::Stale, [age, REQUEST_AGE_LIMIT_MS]))
        } else {
            self.need_proof(&message).and_then(|()| self.act(now_ms, of, message, port))
        };
        match outcome {
            Ok(Some(reply)) => self.answer(now_ms, reply, port),
            Ok(None) => {}
            Err((reason, detail)) => self.answer(now_ms, Reply::Refused { of, reason, detail }, port),
        }
    }

    pub(super) fn is_owner(&self, session: u16) -> bool {
        self.owner.as_ref().is_some_and(|owner| owner.session() == session)
    }

    /// A stop only ever takes motion away: it is honoured whoever sends it, without a hello, under another host's
    /// session and in none. Repeating it stops again. One that comes while another is on its way to the control half is
    /// left unanswered: the arm stops, and its host repeats it.
    fn stop(&mut self, now_ms: u32, session: u16, of: u16, port: &mut impl SessionPort<A::Controller>) {
        let is_new = match &mut self.owner {
            Some(owner) if owner.session() == session => owner.order(of, now_ms) == RequestOrder::New,
            _ => false,
        };
        let requester = if is_new { Requester::Owner { session, of } } else { Requester::OtherHost { session, of } };
        if !is_new && self.pending.holds_stop_of_others() {
            return;
        }
        if let Err(refused) = self.send_command(now_ms, requester, A::Controller::STOP, port) {
            self.pass_on(now_ms, requester, Err(refused), port);
        }
    }

    /// Refuses a host that may not ask. A hello that fits makes it the owner of the session.
    fn admit(&mut self, now_ms: u32, session: u16, of: u16, message: &Request) -> Result<(), Refused> {
        let Request::Hello(hello) = message else {
            return if self.is_owner(session) { Ok(()) } else { Err((Refusal::NoSession, [0, 0])) };
        };
        compare(hello)?;
        if session == 0 {
            return Err((Refusal::BadValue, [0, 0]));
        }
        if let Some(owner) = self.owner.as_ref().filter(|owner| owner.session() != session) {
            let wait = owner.protected_for(now_ms);
            if wait > 0 {
                return Err((Refusal::Busy, [0, wait]));
            }
        }
        self.close();
        self.observers.leave(session);
        self.welcome(session, of, hello, now_ms);
        Ok(())
    }

    /// Gives the session to a host. A function of its own: its copies of the name take no stack while others work.
    #[inline(never)]
    fn welcome(&mut self, session: u16, of: u16, hello: &HostHello, now_ms: u32) {
        self.owner = Some(Owner::new(session, of, hello.owner.clone(), now_ms));
    }

    /// Does what is asked. `None`: the answer comes when the control half has given it, or the change is saved.
    fn act(
        &mut self,
        now_ms: u32,
        of: u16,
        request: Request,
        port: &mut impl SessionPort<A::Controller>,
    ) -> Result<Option<Reply>, Refused> {
        match request {
            // Answered before it comes here.
            Request::Observe(_) => {}
            Request::Hello(_) => return Ok(Some(Reply::Hello { of, hello: self.hello() })),
            Request::Goodbye => {
                // Answered before the session is gone: the answer carries its number.
                self.answer(now_ms, Reply::Accepted { of }, port);
                self.close();
                return Ok(None);
            }
            Request::Ping => {}
            Request::Status => return Ok(Some(Reply::Status { of, status: self.status(port) })),
            Request::Statistics => return Ok(Some(Reply::Statistics { of, statistics: self.statistics(port) })),
            Request::List { index } => return self.listing(of, index, port).map(Some),
            Request::Telemetry { every } => self.telemetry_every = every,
            Request::UploadBegin { name, length, crc } => self.upload_begin(name, length, crc)?,
            Request::UploadChunk { offset, data } => self.upload_chunk(offset, &data)?,
            Request::UploadCommit => {
                self.upload_commit(port)?;
                return self.save(of);
            }
            Request::UploadAbort => self.upload_abort(),
            Request::Delete { name } => {
                self.application.delete(&name, port)?;
                return self.save(of);
            }
            Request::Rename { name, to } => {
                // The new image grows where an upload would.
                self.upload_abort();
                let begun = self.application.rename(&name, &to, port);
                if begun.is_err() {
                    self.application.abort();
                }
                begun?;
                return self.save(of);
            }
            Request::FaultRecord | Request::FaultCycle { .. } => return Ok(Some(fault_record(of, &request, port))),
            Request::Owner => return Ok(Some(self.owner_report(now_ms, of))),
            Request::Secret => return self.secret_report(of, true).map(Some),
            Request::Challenge => return self.challenge(now_ms, of).map(Some),
            Request::Prove { proof } => self.prove(now_ms, proof)?,
            request => {
                return match self.application.act(of, request, self.pending.is_empty(), port)? {
                    Action::Command(command) => self.command(now_ms, of, command, port),
                    Action::Answer(reply) => Ok(Some(reply)),
                    Action::Save => self.save(of),
                };
            }
        }
        Ok(Some(Reply::Accepted { of }))
    }

    /// Admits a host that only looks, beside the one that has the session.
    fn admit_observer(&mut self, now_ms: u32, session: u16, hello: &HostHello) -> Result<(), Refused> {
        compare(hello)?;
        if session == 0 || self.is_owner(session) {
            return Err((Refusal::BadValue, [0, 0]));
        }
        self.observers.admit(session, now_ms).map_err(|wait| (Refusal::Busy, [0, wait]))
    }

    /// Answers an observer. Nothing of this changes anything but what it is sent.
    fn show(
        &mut self,
        now_ms: u32,
        session: u16,
        of: u16,
        request: Request,
        port: &mut impl SessionPort<A::Controller>,
    ) -> Result<Reply, Refused> {
        match request {
            Request::Ping => {}
            Request::Goodbye => self.observers.leave(session),
            Request::Telemetry { every } => self.observers.set_telemetry(session, every),
            Request::Status => return Ok(Reply::Status { of, status: self.status(port) }),
            Request::Statistics => return Ok(Reply::Statistics { of, statistics: self.statistics(port) }),
            Request::List { index } => return self.listing(of, index, port),
            Request::FaultRecord | Request::FaultCycle { .. } => return Ok(fault_record(of, &request, port)),
            Request::Owner => return Ok(self.owner_report(now_ms, of)),
            Request::Secret => return self.secret_report(of, false),
            Request::Calibration | Request::Weight | Request::Storage { .. } => {
                let calm = self.pending.is_empty();
                if let Action::Answer(reply) = self.application.act(of, request, calm, port)? {
                    return Ok(reply);
                }
            }
            _ => return Err((Refusal::Observing, [0, 0])),
        }
        Ok(Reply::Accepted { of })
    }

    /// Who has the session. A function of its own for the same reason.
    #[inline(never)]
    fn owner_report(&self, now_ms: u32, of: u16) -> Reply {
        Reply::Owner { of, owner: self.owner.as_ref().map(|owner| owner.report(now_ms)) }
    }

    fn listing(&mut self, of: u16, index: u8, port: &mut impl SessionPort<A::Controller>) -> Result<Reply, Refused> {
        self.application.follow(&port.health());
        let places = self.application.places();
        let listing = self.application.listing(index)?;
        if index < places {
            Ok(Reply::Listing { of, listing })
        } else {
            Err((Refusal::NoSuchPrimitive, [places.into(), 0]))
        }
    }

    /// Notes who is answered when the change that has begun is saved.
    fn save(&mut self, of: u16) -> Result<Option<Reply>, Refused> {
        self.saving = self.owner.as_ref().map(|owner| (owner.session(), of));
        Ok(None)
    }

    /// Hands a command to the control half; its answer comes later.
    fn command(
        &mut self,
        now_ms: u32,
        of: u16,
        command: <A::Controller as Controller>::Command,
        port: &mut impl SessionPort<A::Controller>,
    ) -> Result<Option<Reply>, Refused> {
        let session = self.owner.as_ref().map(Owner::session).ok_or((Refusal::NoSession, [0, 0]))?;
        self.send_command(now_ms, Requester::Owner { session, of }, command, port)?;
        Ok(None)
    }

    fn send_command(
        &mut self,
        now_ms: u32,
        requester: Requester,
        command: <A::Controller as Controller>::Command,
        port: &mut impl SessionPort<A::Controller>,
    ) -> Result<(), Refused> {
        if !self.pending.has_room(command == A::Controller::STOP) || port.command(command).is_err() {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        self.pending.push(requester, now_ms);
        Ok(())
    }

    fn hello(&self) -> DeviceHello {
        DeviceHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: control::MODEL_HASH,
            image_schema: link::image::IMAGE_SCHEMA,
            maximum_kernels: u16::try_from(link::image::KERNEL_LIMIT).unwrap_or(u16::MAX),
            slots: self.application.places(),
            slot_bytes: self.application.place_bytes(),
            cycles_per_second: control::RATE_HZ as u16,
            ticks_per_second: self.identity.ticks_per_second,
            simulated: self.identity.simulated,
            firmware: Text::new(self.identity.firmware),
            board: Text::new(self.identity.board),
            serial: Text::new(self.identity.serial),
            capabilities: A::CAPABILITIES,
            instructions_per_tick: self.identity.instructions_per_tick,
        }
    }

    fn status(&mut self, port: &mut impl SessionPort<A::Controller>) -> Status {
        let health = port.health();
        self.application.follow(&health);
        let latest = self.latest.map(|timed| timed.record.telemetry()).unwrap_or_default();
        Status {
            cycle: health.cycle as u32,
            state: health.state.code(),
            fault: health.fault.code(),
            startup_stage: health.stage.code(),
            blocked: health.blocked.map(|error| StartupFailure::from(error).0),
            zeroed: health.zeroed,
            safety_mode: health.safety_mode.and_then(|mode| u8::try_from(mode.value()).ok()),
            pendant: health.pendant.map(i32::cast_unsigned),
            loaded: self.application.loaded().cloned(),
            phase: latest.phase,
            q: latest.q,
            temperatures: health.temperatures,
            telemetry_every: self.telemetry_every,
            upload_received: self.upload.as_ref().map(Upload::received),
            hand_stage: health.hand,
            hand: latest.hand,
            hand_temperatures: health.hand_temperatures,
            wrench_zeroed: health.wrench_zeroed,
        }
    }
}

/// Answers from the record of the last fault.
fn fault_record<C: Controller>(of: u16, request: &Request, port: &mut impl SessionPort<C>) -> Reply {
    let memory = port.fault_memory();
    match *request {
        Request::FaultCycle { record, index } => {
            Reply::FaultCycle { of, cycle: memory.and_then(|memory| memory.cycle(record, index)) }
        }
        _ => Reply::FaultRecord { of, record: memory.and_then(|memory| memory.record()) },
    }
}

/// Refuses a host that does not fit, in the order in which a difference explains the next.
fn compare(hello: &HostHello) -> Result<(), Refused> {
    if hello.link_version != LINK_VERSION {
        return Err((Refusal::LinkVersion, [hello.link_version.into(), LINK_VERSION.into()]));
    }
    if hello.schema_hash != SCHEMA_HASH {
        return Err((Refusal::Schema, [hello.schema_hash, SCHEMA_HASH]));
    }
    if hello.model_hash != control::MODEL_HASH {
        return Err((Refusal::Model, [hello.model_hash, control::MODEL_HASH]));
    }
    Ok(())
}
