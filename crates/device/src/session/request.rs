//! One request: who may ask it, when, and what it does.

use control::plan::load;
use control::{Command as Control, LoadRefusal, RunOptions, State};
use link::frame::{Frame, REQUEST_AGE_LIMIT_MS};
use link::message::{AccelerationSource, CHUNK_BYTES, ChunkData, Goal, PoseFeedback};
use link::{
    DeviceHello, Event, EventKind, HostHello, LINK_VERSION, Name, PrimitiveImage, Refusal, Reply, Request, SCHEMA_HASH,
    Status, Text,
};

use super::Session;
use super::owner::{Owner, Turn};
use super::pending::Asker;
use super::primitive;
use super::upload::Refused;
use super::wire::{self, StartupTrouble};
use crate::command::Command;
use crate::health::Health;
use crate::port::SessionPort;
use crate::store::{Store, StoreError};

impl<S: Store> Session<S> {
    /// Takes one request: greets, refuses strangers, repeats answers, acts.
    pub(crate) fn handle(&mut self, now_ms: u32, frame: Frame<Request>, port: &mut impl SessionPort) {
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
        if let Err(refused) = self.send_command(now_ms, asker, Control::Stop.into(), port) {
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
                self.need_open()?;
                if index >= self.directory.places() {
                    return Err((Refusal::NoSuchPrimitive, [self.directory.places().into(), 0]));
                }
                let listing = self.directory.get(index).map(|entry| {
                    let loaded = self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(entry));
                    entry.listing(index, loaded)
                });
                Ok(Some(Reply::Listing { of, listing }))
            }
            Request::Zero { home } => {
                finite(&home)?;
                self.command(now_ms, of, Command::Zero { home }, port)
            }
            Request::Gravity => self.command(now_ms, of, Control::Gravity.into(), port),
            Request::Hold => self.command(now_ms, of, Control::Hold.into(), port),
            Request::Approach { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                self.command(now_ms, of, Control::Approach { q, duration }.into(), port)
            }
            Request::Run { name, options } => {
                let options = run_options(&options)?;
                self.load(&name, port)?;
                self.command(now_ms, of, Control::Run(options).into(), port)
            }
            Request::Stop => self.command(now_ms, of, Control::Stop.into(), port),
            Request::ClearFault => self.command(now_ms, of, Control::ClearFault.into(), port),
            Request::SetGoal(goal) => self.command(now_ms, of, Control::SetGoal(control_goal(&goal)?).into(), port),
            Request::SetSpeed { factor } => {
                finite(&[factor])?;
                self.command(now_ms, of, Control::SetSpeed { factor }.into(), port)
            }
            Request::Release => self.command(now_ms, of, Control::Release.into(), port),
            Request::Tare => self.command(now_ms, of, Control::Tare.into(), port),
            Request::InitialiseHand => self.command(now_ms, of, Command::InitialiseHand, port),
            Request::MoveHand { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                self.command(now_ms, of, Control::MoveHand { q, duration }.into(), port)
            }
            Request::Telemetry { every } => {
                self.telemetry_every = every;
                done
            }
            Request::UploadBegin { name, length, crc } => {
                self.upload_begin(name, length, crc)?;
                done
            }
            Request::UploadChunk { offset, data } => {
                self.upload_chunk(offset, &data)?;
                done
            }
            Request::UploadCommit => {
                self.follow_arm(port.health().payload);
                let (slot, entry) = self.upload_commit()?;
                self.save(of, slot, Some(entry));
                Ok(None)
            }
            Request::UploadAbort => {
                self.upload_abort();
                done
            }
            Request::Delete { name } => {
                let slot = self.delete(&name, port)?;
                self.save(of, slot, None);
                Ok(None)
            }
            Request::Read { name, offset } => {
                self.need_open()?;
                let (slot, _) = self.directory.find(&name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
                let image = self.store.image(slot).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
                let rest = usize::try_from(offset).ok().and_then(|start| image.get(start..)).unwrap_or_default();
                let part = rest.get(..CHUNK_BYTES.min(rest.len())).unwrap_or_default();
                let data = ChunkData::from_slice(part).unwrap_or_default();
                Ok(Some(Reply::Chunk { of, offset, data }))
            }
            Request::Calibration => self.calibration(of, port).map(Some),
            Request::Calibrate { home } => {
                self.calibrate(of, home, port)?;
                Ok(None)
            }
            Request::ForgetCalibration => {
                self.forget_calibration(of, port)?;
                Ok(None)
            }
        }
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
        let stop = matches!(command, Command::Control(Control::Stop));
        if !self.pending.has_room(stop) || port.command(command).is_err() {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        self.pending.push(asker, now_ms);
        Ok(())
    }

    /// Hands the primitive that has just been checked to the control half, so that its run need not be waited for. Where that cannot be
    /// done now, the run does it.
    pub(super) fn preload(&mut self, slot: u8, port: &mut impl SessionPort) {
        let Some(entry) = self.directory.get(slot).cloned() else { return };
        let health = port.health();
        if !self.pending.is_empty() || matches!(health.state, State::Run | State::Coast) {
            return;
        }
        // Checked again: the arm may have been started anew with another tool while the flash was written.
        self.follow_arm(health.payload);
        let fit = load::check(&self.model, &self.primitive);
        self.loaded = fit.is_ok_and(|fit| port.load(&fit).is_ok()).then_some(entry);
    }

    /// Makes sure that the control half holds the primitive of this name, as it is in the store now.
    fn load(&mut self, name: &Name, port: &mut impl SessionPort) -> Result<(), Refused> {
        self.need_open()?;
        let (slot, entry) = self.directory.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        if self.is_deleting(slot) {
            return Err(StoreError::Busy.into());
        }
        let entry = entry.clone();
        let Health { state, stage, payload, .. } = port.health();
        self.follow_arm(payload);
        if self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(&entry)) {
            return Ok(());
        }
        // Not under a running primitive, nor under a command that may start one.
        if matches!(state, State::Run | State::Coast) {
            return Err((Refusal::State, [state.code().into(), 0]));
        }
        if !self.pending.is_empty() {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        let bytes = self.store.image(slot).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        // Checked again: memory may have been damaged since the upload, and the image may be from before the firmware.
        let image =
            PrimitiveImage::parse(bytes).map_err(|error| (Refusal::ImageInvalid, [error.code(), error.number()]))?;
        let model = image.content().model_hash;
        if model != control::MODEL_HASH {
            return Err((Refusal::ImageModel, [model, control::MODEL_HASH]));
        }
        if let Some(saving) = &mut self.saving {
            saving.building();
        }
        let fit = primitive::build(&self.model, image.content(), &mut self.room, &mut self.primitive)?;
        // After a refusal nothing is known to be loaded: a later run loads again rather than run what is left there.
        self.loaded = None;
        port.load(&fit).map_err(|refusal| match refusal {
            LoadRefusal::Running => (Refusal::State, [State::Run.code().into(), 0]),
            // The bus has been started anew since the check began.
            LoadRefusal::OtherTool => (Refusal::NotReady, [stage.code().into(), 0]),
        })?;
        self.loaded = Some(entry);
        Ok(())
    }

    fn delete(&mut self, name: &Name, port: &mut impl SessionPort) -> Result<u8, Refused> {
        self.need_open()?;
        let (slot, entry) = self.directory.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        let loaded = self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(entry));
        if loaded && matches!(port.health().state, State::Run | State::Coast) {
            return Err((Refusal::InUse, [0, 0]));
        }
        self.store.delete(slot)?;
        Ok(slot)
    }

    pub(super) fn store_changed(&mut self, now_ms: u32, slot: u8, port: &mut impl SessionPort) {
        let cycle = wire::cycle(port.health().cycle);
        self.tell(now_ms, Event { cycle, kind: EventKind::Store, code: slot.into(), detail: 0 }, port);
    }

    fn hello(&self) -> DeviceHello {
        DeviceHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: control::MODEL_HASH,
            image_schema: link::image::IMAGE_SCHEMA,
            maximum_kernels: u16::try_from(link::image::KERNEL_LIMIT).unwrap_or(u16::MAX),
            slots: self.directory.places(),
            slot_bytes: u32::try_from(self.store.slot_bytes()).unwrap_or(u32::MAX),
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
            cycle: wire::cycle(health.cycle),
            state: health.state.code(),
            fault: health.fault.code(),
            startup_stage: health.stage.code(),
            blocked: health.blocked.map(|error| StartupTrouble::from(error).0),
            zeroed: health.zeroed,
            safety_mode: health.safety_mode.and_then(|mode| u8::try_from(mode.value()).ok()),
            pendant: health.pendant.map(i32::cast_unsigned),
            loaded: self.loaded.as_ref().map(|entry| entry.name.clone()),
            phase: record.map_or(0.0, |record| record.phase),
            q: record.map_or([0.0; 7], |record| record.q),
            temperatures: health.temperatures,
            telemetry_every: self.telemetry_every,
            upload_received: self.upload.as_ref().map(|upload| upload.received),
            hand_stage: health.hand,
            hand: record.map_or([0.0; 4], |record| record.hand),
            hand_temperatures: health.hand_temperatures,
            wrench_zeroed: health.wrench_zeroed,
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

fn control_goal(goal: &Goal) -> Result<control::Goal, Refused> {
    finite(goal.position.as_ref().map_or(&[], |position| position.as_slice()))?;
    finite(goal.orientation.as_ref().map_or(&[], |orientation| orientation.as_slice()))?;
    Ok(control::Goal { position: goal.position, orientation: goal.orientation })
}

fn run_options(options: &link::RunOptions) -> Result<RunOptions, Refused> {
    finite(&[options.speed])?;
    Ok(RunOptions {
        goal: control_goal(&options.goal)?,
        speed: options.speed,
        feedback: options.feedback,
        force_control: options.force_control,
        pose_feedback: match options.pose_feedback {
            PoseFeedback::Measured => control::PoseFeedback::Measured,
            PoseFeedback::Planned => control::PoseFeedback::Planned,
        },
        acceleration: match options.acceleration {
            AccelerationSource::Analytic => control::AccelerationSource::Analytic,
            AccelerationSource::Differentiated => control::AccelerationSource::Differentiated,
        },
        finger_feedback: options.finger_feedback,
        compliant: options.compliant,
    })
}
