//! `ArmApplication`: the primitives of an arm with its hand, and the requests that only it knows.

mod calibration;
mod directory;
mod primitive;
mod saving;
mod secret;
mod weight;

use control::model::ArmModel;
use control::plan::load;
use control::{Command as Control, LoadRefusal, Payload, RunOptions, State};
use link::image::{ImageError, renamed_head};
use link::message::{AccelerationSource, CHUNK_BYTES, ChunkData, Goal};
use link::{Capabilities, Listing, Name, PrimitiveImage, Refusal, Reply, Request};
use pinned_init::{Init, init, zeroed};

use crate::application::{Action, Application, Refused, Saved, SessionPort, finite};
use crate::command::Command;
use crate::controller::DeviceController;
use crate::health::Health;
use crate::port::StoredPrimitive;
use crate::secret::StoredSecret;
use crate::session::host::{HostSession, Identity};
use crate::store::{Store, StoreError, stage_copy};
use directory::{Directory, Entry};
use primitive::WeightBuffer;
use saving::Change;

/// The session of an arm.
pub type Session<S> = HostSession<ArmApplication<S>>;

impl<S: Store> Session<S> {
    /// Makes a session without a host in its place. Reads the store. Until the control half knows what is mounted,
    /// primitives are checked against an arm with sensor and hand.
    pub fn init(identity: Identity, store: S) -> impl Init<Self> {
        HostSession::over(identity, ArmApplication::init(store))
    }

    /// The store, for inspection.
    pub fn store(&self) -> &S {
        &self.application.store
    }

    /// The store, for whoever makes its changes durable.
    pub fn store_mut(&mut self) -> &mut S {
        &mut self.application.store
    }
}

/// The part of an arm's session beside the conversation with its host.
#[derive(Debug)]
pub struct ArmApplication<S> {
    /// Payload of the arm that primitives are checked against; the model below is that arm.
    payload: Payload,
    model: ArmModel<f32>,
    store: S,
    directory: Directory,
    /// The change of the store that is not durable yet.
    saving: Option<Change>,
    opened: bool,
    /// The control half has not been given the weight that the store holds.
    weight_waits: bool,
    loaded: Option<Entry>,
    weights: WeightBuffer,
    /// Where primitives are built, to be checked or handed to the control half.
    primitive: StoredPrimitive,
}

impl<S: Store> ArmApplication<S> {
    fn init(store: S) -> impl Init<Self> {
        let directory = Directory::read(&store);
        let opened = store.is_open();
        init!(ArmApplication {
            payload: Payload::SensorAndHand,
            model: ArmModel::new(Payload::SensorAndHand),
            store,
            directory,
            saving: None,
            opened,
            weight_waits: true,
            loaded: None,
            weights <- zeroed::<WeightBuffer>(),
            primitive: StoredPrimitive::PLACEHOLDER,
        })
    }

    /// Checks primitives against the arm that the control half has found. What was loaded for another it has forgotten,
    /// even if it has found this one again since.
    fn follow_arm(&mut self, health: &Health) {
        if health.payload != self.payload {
            self.payload = health.payload;
            self.model = ArmModel::new(health.payload);
            self.loaded = None;
        }
        // What runs may have been replaced, and then lost its name: afterwards nobody can run it by that.
        let runs = matches!(health.state, State::Run | State::Coast);
        let is_gone = |loaded: &Entry| !runs && self.directory.find(&loaded.name).is_none();
        if !health.has_primitive || self.loaded.as_ref().is_some_and(is_gone) {
            self.loaded = None;
        }
    }

    /// Hands the primitive that has just been checked to the control half, so that its run need not be waited for.
    /// Where that cannot be done now, the run does it.
    fn preload(&mut self, slot: u8, calm: bool, port: &mut impl SessionPort<DeviceController>) {
        let Some(entry) = self.directory.get(slot).cloned() else { return };
        let health = port.health();
        if !calm || matches!(health.state, State::Run | State::Coast) {
            return;
        }
        // Checked again: the arm may have been started anew with another tool while the flash was written.
        self.follow_arm(&health);
        let fit = load::check(&self.model, &self.primitive);
        self.loaded = fit.is_ok_and(|fit| port.load(&fit).is_ok()).then_some(entry);
    }

    /// Makes sure that the control half holds the primitive of this name, as it is in the store now.
    fn load(&mut self, name: &Name, calm: bool, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        self.need_open()?;
        let (slot, entry) = self.directory.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        if self.is_leaving(slot, name) {
            return Err(StoreError::Busy.into());
        }
        let entry = entry.clone();
        let health = port.health();
        self.follow_arm(&health);
        let state = health.state;
        if self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(&entry)) {
            return Ok(());
        }
        // Not under a running primitive, nor under a command that may start one.
        if matches!(state, State::Run | State::Coast) {
            return Err((Refusal::State, [state.code().into(), 0]));
        }
        if !calm {
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
        Change::note_building(&mut self.saving);
        let fit = primitive::build(&self.model, image.content(), &mut self.weights, &mut self.primitive)?;
        // After a refusal nothing is known to be loaded: a later run loads again rather than run what is left there.
        self.loaded = None;
        port.load(&fit).map_err(|refusal| match refusal {
            LoadRefusal::Running => (Refusal::State, [State::Run.code().into(), 0]),
            // The bus has been started anew since the check began.
            LoadRefusal::OtherTool => (Refusal::OtherTool, [0, 0]),
        })?;
        self.loaded = Some(entry);
        Ok(())
    }

    /// A part of an image, for a host that compares.
    fn read(&self, of: u16, name: &Name, offset: u32) -> Result<Reply, Refused> {
        self.need_open()?;
        let (slot, _) = self.directory.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        let image = self.store.image(slot).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        let rest = usize::try_from(offset).ok().and_then(|start| image.get(start..)).unwrap_or_default();
        let part = rest.get(..CHUNK_BYTES.min(rest.len())).unwrap_or_default();
        let data = ChunkData::from_slice(part).unwrap_or_default();
        Ok(Reply::Chunk { of, offset, data })
    }

    /// The place of a primitive that no run uses.
    fn find_unused(&self, name: &Name, port: &mut impl SessionPort<DeviceController>) -> Result<u8, Refused> {
        self.need_open()?;
        let (slot, entry) = self.directory.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        let loaded = self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(entry));
        if loaded && matches!(port.health().state, State::Run | State::Coast) {
            return Err((Refusal::InUse, [0, 0]));
        }
        Ok(slot)
    }

    /// Writes the image of a place, under another name, to where an upload would grow.
    fn stage_renamed(&mut self, slot: u8, to: &Name) -> Result<Entry, Refused> {
        let invalid = |error: ImageError| (Refusal::ImageInvalid, [error.code(), error.number()]);
        let image = self.store.image(slot).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        // Memory may have been damaged since the upload: a new check sum must not hide it.
        PrimitiveImage::parse(image).map_err(invalid)?;
        let head = renamed_head(image, to).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        stage_copy(&mut self.store, slot, &head)?;
        let staged = self.store.staged().ok_or((Refusal::NoUpload, [0, 0]))?;
        Ok(Entry::of(&PrimitiveImage::parse(staged).map_err(invalid)?))
    }

    fn check_and_commit(&mut self, name: &Name, crc: u32) -> Result<(u8, Entry), Refused> {
        let Some(bytes) = self.store.staged() else {
            return Err((Refusal::NoUpload, [0, 0]));
        };
        let image = match PrimitiveImage::parse(bytes) {
            Ok(image) => image,
            Err(ImageError::Crc { computed, stored }) => {
                // Arrived as announced, the image was wrong when it left: then its own check sum is the one that
                // differs.
                let expected = if computed == crc { stored } else { crc };
                return Err((Refusal::UploadCrc, [computed, expected]));
            }
            Err(ImageError::Kernels { found }) => return Err(too_many_kernels(found)),
            Err(error) => return Err((Refusal::ImageInvalid, [error.code(), error.number()])),
        };
        if image.crc() != crc {
            return Err((Refusal::UploadCrc, [image.crc(), crc]));
        }
        let model = image.content().model_hash;
        if model != control::MODEL_HASH {
            return Err((Refusal::ImageModel, [model, control::MODEL_HASH]));
        }
        if image.name() != name {
            return Err((Refusal::ImageName, [0, 0]));
        }
        Change::note_building(&mut self.saving);
        primitive::build(&self.model, image.content(), &mut self.weights, &mut self.primitive)?;
        let entry = Entry::of(&image);
        let place = self.directory.find(&entry.name).map(|(slot, _)| slot).or_else(|| self.directory.free(&self.store));
        let Some(slot) = place else {
            return Err((Refusal::StoreFull, [self.directory.places().into(), 0]));
        };
        self.store.commit(slot)?;
        Ok((slot, entry))
    }
}

impl<S: Store> Application for ArmApplication<S> {
    type Controller = DeviceController;

    const CAPABILITIES: Capabilities = Capabilities { arm: true, hand: true, wrench: true };

    const KEEPS_SECRET: bool = true;

    fn is_open(&mut self, now_ms: u32) -> bool {
        !self.is_opening(now_ms)
    }

    fn secret(&self) -> Result<StoredSecret, Refused> {
        self.need_open()?;
        Ok(self.store.secret())
    }

    fn places(&self) -> u8 {
        self.directory.places()
    }

    fn place_bytes(&self) -> u32 {
        u32::try_from(self.store.slot_bytes()).unwrap_or(u32::MAX)
    }

    fn listing(&self, place: u8) -> Result<Option<Listing>, Refused> {
        self.need_open()?;
        Ok(self.directory.get(place).map(|entry| {
            let loaded = self.loaded.as_ref().is_some_and(|loaded| loaded.is_same(entry));
            entry.listing(place, loaded)
        }))
    }

    fn follow(&mut self, health: &Health) {
        self.follow_arm(health);
    }

    fn loaded(&self) -> Option<&Name> {
        self.loaded.as_ref().map(|entry| &entry.name)
    }

    fn begin(&mut self, name: &Name, length: u32) -> Result<(), Refused> {
        // Better refused now than after all of it has been sent.
        if self.directory.find(name).is_none() && self.directory.free(&self.store).is_none() {
            return Err((Refusal::StoreFull, [self.directory.places().into(), 0]));
        }
        Ok(self.store.begin(usize::try_from(length).unwrap_or(usize::MAX))?)
    }

    fn write(&mut self, offset: u32, data: &[u8]) -> Result<(), Refused> {
        Ok(self.store.write(usize::try_from(offset).unwrap_or(usize::MAX), data)?)
    }

    fn abort(&mut self) {
        self.store.abort();
    }

    fn commit(&mut self, name: &Name, crc: u32, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        self.follow_arm(&port.health());
        let (slot, entry) = self.check_and_commit(name, crc)?;
        self.saving = Some(Change::Place { slot, built: true, entry: Some(entry) });
        Ok(())
    }

    fn delete(&mut self, name: &Name, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let slot = self.find_unused(name, port)?;
        self.store.delete(slot)?;
        self.saving = Some(Change::Place { slot, built: false, entry: None });
        Ok(())
    }

    fn rename(&mut self, name: &Name, to: &Name, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let slot = self.find_unused(name, port)?;
        if self.directory.find(to).is_some() {
            return Err((Refusal::NameTaken, [0, 0]));
        }
        let entry = self.stage_renamed(slot, to)?;
        self.store.commit(slot)?;
        self.saving = Some(Change::Place { slot, built: false, entry: Some(entry) });
        Ok(())
    }

    fn saved(&mut self, calm: bool, port: &mut impl SessionPort<DeviceController>) -> Option<Saved> {
        self.hand_over_weight(port);
        self.settle(calm, port)
    }

    fn act(
        &mut self,
        of: u16,
        request: Request,
        calm: bool,
        port: &mut impl SessionPort<DeviceController>,
    ) -> Result<Action<Command>, Refused> {
        let command = match request {
            Request::Zero { home } => {
                finite(&home)?;
                if !calm {
                    // A zeroing takes up to 170 ms, and a second one behind it would be given up before its turn.
                    return Err((Refusal::CommandQueueFull, [0, 0]));
                }
                return Ok(Action::Command(Command::Zero { home }));
            }
            Request::InitialiseHand => return Ok(Action::Command(Command::InitialiseHand)),
            Request::Gravity => Control::Gravity,
            Request::Hold => Control::Hold,
            Request::Approach { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                Control::Approach { q, duration }
            }
            Request::Run { name, options } => {
                let options = run_options(&options)?;
                self.load(&name, calm, port)?;
                Control::Run(options)
            }
            Request::ClearFault => Control::ClearFault,
            Request::SetGoal(goal) => Control::SetGoal(control_goal(&goal)?),
            Request::SetSpeed { factor } => {
                finite(&[factor])?;
                Control::SetSpeed { factor }
            }
            Request::Release => Control::Release,
            Request::Tare => Control::Tare,
            Request::MoveHand { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                Control::MoveHand { q, duration }
            }
            Request::Read { name, offset } => return self.read(of, &name, offset).map(Action::Answer),
            Request::Calibration => return self.calibration(of, port).map(Action::Answer),
            Request::Calibrate { home } => return self.calibrate(home, port).map(|()| Action::Save),
            Request::ForgetCalibration => return self.forget_calibration(port).map(|()| Action::Save),
            Request::Weight => return self.weight(of, port).map(Action::Answer),
            Request::KeepWeight { hand, links } => return self.keep_weight(hand, &links).map(|()| Action::Save),
            Request::ForgetWeight => return self.forget_weight().map(|()| Action::Save),
            Request::KeepSecret { secret } => return self.keep_secret(&secret).map(|()| Action::Save),
            Request::ForgetSecret => return self.forget_secret().map(|()| Action::Save),
            Request::Storage { place } => return self.storage(of, place).map(Action::Answer),
            // What every device does in the same way has not come here.
            Request::Hello(_)
            | Request::Goodbye
            | Request::Ping
            | Request::Status
            | Request::Statistics
            | Request::List { .. }
            | Request::Stop
            | Request::Telemetry { .. }
            | Request::UploadBegin { .. }
            | Request::UploadChunk { .. }
            | Request::UploadCommit
            | Request::UploadAbort
            | Request::Delete { .. }
            | Request::Observe(_)
            | Request::Rename { .. }
            | Request::FaultRecord
            | Request::FaultCycle { .. }
            | Request::Owner
            | Request::Secret
            | Request::Challenge
            | Request::Prove { .. } => return Ok(Action::Answer(Reply::Accepted { of })),
        };
        Ok(Action::Command(command.into()))
    }
}

fn too_many_kernels(found: u32) -> Refused {
    let most = u32::try_from(link::image::KERNEL_LIMIT).unwrap_or(u32::MAX);
    (Refusal::TooManyKernels, [found, most])
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
        acceleration: match options.acceleration {
            AccelerationSource::Analytic => control::AccelerationSource::Analytic,
            AccelerationSource::Differentiated => control::AccelerationSource::Differentiated,
        },
        finger_feedback: options.finger_feedback,
        compliant: options.compliant,
    })
}
