//! One request: who may ask it, when, and what it does.

use device::{Asker, Owner, Turn};
use link::frame::{Frame, REQUEST_AGE_LIMIT_MS};
use link::image::{IMAGE_BYTES_LIMIT, IMAGE_SCHEMA};
use link::{
    DeviceHello, Event as LinkEvent, EventKind, Goal, HostHello, LINK_VERSION, Name, Refusal, Reply, Request,
    SCHEMA_HASH, Status, Text,
};

use super::library::listing;
use super::{PLACES, Session, SessionPort, Upload};
use crate::KERNELS;
use crate::command::{Command, Refused, RunOptions};
use crate::image::ImageReader;
use crate::number::{from_real, real};

const NO_ARM: Refused = (Refusal::NoArm, [0, 0]);

impl Session<'_> {
    /// Takes one request: greets, refuses strangers, repeats answers, acts.
    pub(super) fn handle(&mut self, now_ms: u32, frame: Frame<Request>, port: &mut impl SessionPort) {
        let Frame { envelope, message } = frame;
        let of = envelope.sequence;
        let turn = match &mut self.owner {
            Some(owner) if owner.session() == envelope.session => owner.turn(of, now_ms),
            _ => Turn::New,
        };
        match turn {
            Turn::New => {}
            Turn::Again => {
                if let Some(reply) = self.owner.as_ref().and_then(Owner::answer).cloned() {
                    self.send(now_ms, &reply, port);
                }
                return;
            }
            Turn::Ignore => return,
        }
        if message == Request::Stop && !self.is_owner(envelope.session) {
            return self.stop_for_stranger(now_ms, envelope.session, of, port);
        }
        if let Err((reason, detail)) = self.admit(now_ms, envelope.session, of, &message) {
            return self.send_to(envelope.session, now_ms, &Reply::Refused { of, reason, detail }, port);
        }
        let age = now_ms.wrapping_sub(envelope.time_ms);
        let outcome = if message.moves() && age > REQUEST_AGE_LIMIT_MS {
            Err((Refusal::Stale, [age, REQUEST_AGE_LIMIT_MS]))
        } else {
            self.act(now_ms, of, message, port)
        };
        match outcome {
            Ok(Some(reply)) => self.answer(now_ms, reply, port),
            Ok(None) => {}
            Err((reason, detail)) => self.answer(now_ms, Reply::Refused { of, reason, detail }, port),
        }
    }

    fn is_owner(&self, session: u16) -> bool {
        self.owner.as_ref().is_some_and(|owner| owner.session() == session)
    }

    /// A stop only ever takes motion away: it is honoured whoever sends it, without a hello, under another host's session and in
    /// none. Repeating it stops again, so nothing is remembered of it.
    fn stop_for_stranger(&mut self, now_ms: u32, session: u16, of: u16, port: &mut impl SessionPort) {
        let asker = Asker::Stranger { session, of };
        if let Err(refused) = self.send_command(now_ms, asker, Command::Stop, port) {
            self.pass_on(now_ms, asker, Err(refused), port);
        }
    }

    /// Whether this host may ask anything; a hello that fits makes it the owner of the session.
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
                return Err((Refusal::Busy, [owner.session().into(), wait]));
            }
        }
        self.close();
        self.owner = Some(Owner::new(session, of, now_ms));
        Ok(())
    }

    /// Does what is asked. `None`: the answer comes when the control half has given it.
    fn act(
        &mut self,
        now_ms: u32,
        of: u16,
        request: Request,
        port: &mut impl SessionPort,
    ) -> Result<Option<Reply>, Refused> {
        let done = Ok(Some(Reply::Accepted { of }));
        match request {
            Request::Hello(_) => Ok(Some(Reply::Hello { of, hello: self.hello() })),
            Request::Goodbye => {
                // Answered before the session is gone: the answer carries its number.
                self.answer(now_ms, Reply::Accepted { of }, port);
                self.close();
                Ok(None)
            }
            Request::Ping => done,
            Request::Status => Ok(Some(Reply::Status { of, status: self.status(port) })),
            Request::Statistics => Ok(Some(Reply::Statistics { of, statistics: self.statistics(port) })),
            Request::List { index } => {
                if usize::from(index) >= PLACES {
                    return Err((Refusal::NoSuchPrimitive, [PLACES as u32, 0]));
                }
                let listing = self.library.get(index.into()).map(|entry| {
                    let loaded = self.loaded.as_ref() == Some(entry);
                    listing(index, entry, loaded)
                });
                Ok(Some(Reply::Listing { of, listing }))
            }
            Request::Zero { .. }
            | Request::Gravity
            | Request::Approach { .. }
            | Request::SetGoal(_)
            | Request::Calibration
            | Request::Calibrate { .. }
            | Request::ForgetCalibration => Err(NO_ARM),
            Request::Hold => self.command(now_ms, of, Command::Hold, port),
            Request::Run { name, options } => {
                if options.goal != Goal::default() {
                    return Err(NO_ARM);
                }
                finite(&[options.speed])?;
                self.load(&name, port)?;
                let options = RunOptions {
                    speed: from_real(options.speed),
                    feedback: options.feedback && options.finger_feedback,
                    force_control: options.force_control,
                };
                self.command(now_ms, of, Command::Run(options), port)
            }
            Request::Stop => self.command(now_ms, of, Command::Stop, port),
            Request::ClearFault => self.command(now_ms, of, Command::ClearFault, port),
            Request::SetSpeed { factor } => {
                finite(&[factor])?;
                self.command(now_ms, of, Command::SetSpeed { factor: from_real(factor) }, port)
            }
            Request::Release => self.command(now_ms, of, Command::Release, port),
            Request::Tare => self.command(now_ms, of, Command::Tare, port),
            Request::InitialiseHand => self.command(now_ms, of, Command::InitialiseHand, port),
            Request::MoveHand { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                let command = Command::Move { q: q.map(from_real), duration: from_real(duration) };
                self.command(now_ms, of, command, port)
            }
            Request::Telemetry { every } => {
                self.telemetry_every = every;
                done
            }
            Request::UploadBegin { name, length, crc } => {
                self.upload = None;
                let room = u32::try_from(IMAGE_BYTES_LIMIT).unwrap_or(u32::MAX);
                if length > room {
                    return Err((Refusal::ImageTooLarge, [length, room]));
                }
                if self.library.place_for(&name).is_none() {
                    return Err((Refusal::StoreFull, [PLACES as u32, 0]));
                }
                self.library.staging.clear();
                self.upload = Some(Upload { name, crc, length, reader: ImageReader::new(length) });
                done
            }
            Request::UploadChunk { offset, data } => {
                let upload = self.upload.as_mut().ok_or((Refusal::NoUpload, [0, 0]))?;
                let received = upload.reader.received();
                if offset != received {
                    return Err((Refusal::UploadOrder, [received, offset]));
                }
                let end = u32::try_from(data.len()).ok().and_then(|length| offset.checked_add(length));
                if end.is_none_or(|end| end > upload.length) {
                    return Err((Refusal::ImageTooLarge, [offset.saturating_add(192), upload.length]));
                }
                upload.reader.take(&data, &mut self.library.staging);
                done
            }
            Request::UploadCommit => {
                let place = self.commit()?;
                self.store_changed(now_ms, place, port);
                done
            }
            Request::UploadAbort => {
                self.upload = None;
                done
            }
            Request::Delete { name } => {
                let (place, entry) = self.library.find(&name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
                // What runs is a copy in the control half: it goes on.
                if self.loaded.as_ref() == Some(entry) {
                    self.loaded = None;
                }
                self.library.delete(place);
                self.store_changed(now_ms, place, port);
                done
            }
            // Only the hand's part was kept, and that in other numbers.
            Request::Read { .. } => Err(NO_ARM),
        }
    }

    /// Checks what was uploaded and puts it into its place.
    fn commit(&mut self) -> Result<usize, Refused> {
        let upload = self.upload.as_ref().ok_or((Refusal::NoUpload, [0, 0]))?;
        let received = upload.reader.received();
        if received != upload.length {
            // Not forgotten: the host may still send the rest.
            return Err((Refusal::UploadIncomplete, [received, upload.length]));
        }
        let Some(Upload { name, crc, reader, .. }) = self.upload.take() else {
            return Err((Refusal::NoUpload, [0, 0]));
        };
        let summary = reader.finish(&mut self.library.staging, crc)?;
        if summary.model != control::MODEL_HASH {
            return Err((Refusal::ImageModel, [summary.model, control::MODEL_HASH]));
        }
        if summary.name != name {
            return Err((Refusal::ImageName, [0, 0]));
        }
        let place = self.library.place_for(&name).ok_or((Refusal::StoreFull, [PLACES as u32, 0]))?;
        self.library.commit(place, summary);
        Ok(place)
    }

    /// Hands a command to the control half; its answer comes later.
    fn command(
        &mut self,
        now_ms: u32,
        of: u16,
        command: Command,
        port: &mut impl SessionPort,
    ) -> Result<Option<Reply>, Refused> {
        let session = self.owner.as_ref().map(Owner::session).ok_or((Refusal::NoSession, [0, 0]))?;
        self.send_command(now_ms, Asker::Owner { session, of }, command, port)?;
        Ok(None)
    }

    fn send_command(
        &mut self,
        now_ms: u32,
        asker: Asker,
        command: Command,
        port: &mut impl SessionPort,
    ) -> Result<(), Refused> {
        if !self.pending.has_room(command == Command::Stop) || port.command(command).is_err() {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        self.pending.push(asker, now_ms);
        Ok(())
    }

    /// Makes sure that the control half holds the primitive of this name.
    fn load(&mut self, name: &Name, port: &mut impl SessionPort) -> Result<(), Refused> {
        let (place, entry) = self.library.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        if self.loaded.as_ref() == Some(entry) {
            return Ok(());
        }
        // Not under a command that may start the previous one.
        if !self.pending.is_empty() {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        let entry = entry.clone();
        let primitive = self.library.primitive(place).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        if !port.load(primitive) {
            return Err((Refusal::State, [port.health().state.code().into(), 0]));
        }
        self.loaded = Some(entry);
        Ok(())
    }

    fn store_changed(&mut self, now_ms: u32, place: usize, port: &mut impl SessionPort) {
        let cycle = port.health().cycle;
        let code = u16::try_from(place).unwrap_or(u16::MAX);
        self.tell(now_ms, LinkEvent { cycle, kind: EventKind::Store, code, detail: 0 }, port);
    }

    fn hello(&self) -> DeviceHello {
        DeviceHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: control::MODEL_HASH,
            image_schema: IMAGE_SCHEMA,
            maximum_kernels: u16::try_from(KERNELS).unwrap_or(u16::MAX),
            slots: u8::try_from(PLACES).unwrap_or(u8::MAX),
            slot_bytes: u32::try_from(IMAGE_BYTES_LIMIT).unwrap_or(u32::MAX),
            cycles_per_second: control::RATE_HZ as u16,
            ticks_per_second: self.identity.ticks_per_second,
            simulated: self.identity.simulated,
            firmware: Text::new(self.identity.firmware),
            board: Text::new(self.identity.board),
            serial: Text::new(self.identity.serial),
        }
    }

    fn status(&self, port: &mut impl SessionPort) -> Status {
        let health = port.health();
        let record = self.latest.map(|timed| timed.record);
        Status {
            cycle: health.cycle,
            state: health.state.code(),
            fault: health.fault.code(),
            startup_stage: health.stage.code(),
            loaded: self.loaded.as_ref().map(|entry| entry.name.clone()),
            phase: record.map_or(0.0, |record| real(record.phase)),
            telemetry_every: self.telemetry_every,
            upload_received: self.upload.as_ref().map(|upload| upload.reader.received()),
            hand_stage: health.hand,
            hand: record.map_or([0.0; 4], |record| record.q.map(real)),
            hand_temperatures: health.temperatures,
            ..Status::default()
        }
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

/// Refuses numbers that are none, naming the first.
fn finite(values: &[f32]) -> Result<(), Refused> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(place) => Err((Refusal::BadValue, [u32::try_from(place).unwrap_or(u32::MAX), 0])),
        None => Ok(()),
    }
}
