//! `HandApplication`: the primitives of a hand alone, and the requests that only it knows.
//!
//! An image is converted while it arrives and never held, so it cannot be read back; requests that need an arm are
//! refused with [`Refusal::NoArm`]. Numbers become real ones here and in [`crate::record`], and nowhere else.

use control::LoadRefusal;
use device::{Action, Application, HostSession, Refused, Saved, SessionPort, finite};
use link::image::IMAGE_BYTES_LIMIT;
use link::{Capabilities, Goal, Listing, Name, Refusal, Reply, Request, StorageReport};

use crate::command::{Command, RunOptions};
use crate::device_controller::DeviceController;
use crate::image::{ImageReader, Summary};
use crate::library::{Library, PLACES, listing};
use crate::number::from_real;

const NO_ARM: Refused = (Refusal::NoArm, [0, 0]);

/// The session of a hand alone.
pub type Session<'a> = HostSession<HandApplication<'a>>;

/// The hand's own part of a session: its primitives, and the upload under way.
pub struct HandApplication<'a> {
    library: &'a mut Library,
    /// The image that is being converted.
    reader: Option<ImageReader>,
    loaded: Option<Summary>,
    /// The place that has changed.
    saved: Option<usize>,
}

impl<'a> HandApplication<'a> {
    /// Over this library.
    pub fn new(library: &'a mut Library) -> Self {
        HandApplication { library, reader: None, loaded: None, saved: None }
    }

    /// Makes sure that the control half holds the primitive of this name.
    fn load(&mut self, name: &Name, calm: bool, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let (place, entry) = self.library.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        if self.loaded.as_ref() == Some(entry) {
            return Ok(());
        }
        // Not under a command that may start the previous one.
        if !calm {
            return Err((Refusal::CommandQueueFull, [0, 0]));
        }
        let entry = entry.clone();
        let primitive = self.library.primitive(place).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        port.load(primitive).map_err(|_: LoadRefusal| (Refusal::State, [port.health().state.code().into(), 0]))?;
        self.loaded = Some(entry);
        Ok(())
    }
}

impl Application for HandApplication<'_> {
    type Controller = DeviceController;

    const CAPABILITIES: Capabilities = Capabilities { arm: false, hand: true, wrench: false };

    fn is_open(&mut self, _now_ms: u32) -> bool {
        true
    }

    fn places(&self) -> u8 {
        PLACES as u8
    }

    fn place_bytes(&self) -> u32 {
        u32::try_from(IMAGE_BYTES_LIMIT).unwrap_or(u32::MAX)
    }

    fn listing(&self, place: u8) -> Result<Option<Listing>, Refused> {
        let entry = self.library.get(place.into());
        Ok(entry.map(|entry| listing(place, entry, self.loaded.as_ref() == Some(entry))))
    }

    fn loaded(&self) -> Option<&Name> {
        self.loaded.as_ref().map(|entry| &entry.name)
    }

    fn begin(&mut self, name: &Name, length: u32) -> Result<(), Refused> {
        if self.library.place_for(name).is_none() {
            return Err((Refusal::StoreFull, [PLACES as u32, 0]));
        }
        self.library.staging.clear();
        self.reader = Some(ImageReader::new(length));
        Ok(())
    }

    fn write(&mut self, _offset: u32, data: &[u8]) -> Result<(), Refused> {
        let reader = self.reader.as_mut().ok_or((Refusal::NoUpload, [0, 0]))?;
        reader.take(data, &mut self.library.staging);
        Ok(())
    }

    fn abort(&mut self) {
        self.reader = None;
    }

    fn commit(&mut self, name: &Name, crc: u32, _: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let reader = self.reader.take().ok_or((Refusal::NoUpload, [0, 0]))?;
        let summary = reader.finish(&self.library.staging, crc)?;
        if summary.model != control::MODEL_HASH {
            return Err((Refusal::ImageModel, [summary.model, control::MODEL_HASH]));
        }
        if summary.name != *name {
            return Err((Refusal::ImageName, [0, 0]));
        }
        let place = self.library.place_for(name).ok_or((Refusal::StoreFull, [PLACES as u32, 0]))?;
        self.library.commit(place, summary)?;
        self.saved = Some(place);
        Ok(())
    }

    fn delete(&mut self, name: &Name, _: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let (place, entry) = self.library.find(name).ok_or((Refusal::NoSuchPrimitive, [0, 0]))?;
        // What runs is a copy in the control half: it goes on.
        if self.loaded.as_ref() == Some(entry) {
            self.loaded = None;
        }
        self.library.delete(place);
        self.saved = Some(place);
        Ok(())
    }

    /// Refused: only parts of an image are kept, and a new name would need the check sum of the whole.
    fn rename(&mut self, _: &Name, _: &Name, _: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        Err(NO_ARM)
    }

    fn saved(&mut self, _calm: bool, _: &mut impl SessionPort<DeviceController>) -> Option<Saved> {
        let place = self.saved.take()?;
        Some(Saved { outcome: Ok(()), place: u8::try_from(place).ok() })
    }

    fn act(
        &mut self,
        of: u16,
        request: Request,
        calm: bool,
        port: &mut impl SessionPort<DeviceController>,
    ) -> Result<Action<Command>, Refused> {
        Ok(Action::Command(match request {
            Request::Hold => Command::Hold,
            Request::Run { name, options } => {
                if options.goal != Goal::default() {
                    return Err(NO_ARM);
                }
                finite(&[options.speed])?;
                self.load(&name, calm, port)?;
                Command::Run(RunOptions {
                    speed: from_real(options.speed),
                    feedback: options.feedback && options.finger_feedback,
                    force_control: options.force_control,
                })
            }
            Request::ClearFault => Command::ClearFault,
            Request::SetSpeed { factor } => {
                finite(&[factor])?;
                Command::SetSpeed { factor: from_real(factor) }
            }
            Request::Release => Command::Release,
            Request::Tare => Command::Tare,
            Request::InitialiseHand => Command::InitialiseHand,
            Request::MoveHand { q, duration } => {
                finite(&q)?;
                finite(&[duration])?;
                Command::Move { q: q.map(from_real), duration: from_real(duration) }
            }
            // What it keeps is gone with its power.
            Request::Storage { .. } => {
                return Ok(Action::Answer(Reply::Storage { of, storage: StorageReport::default() }));
            }
            Request::KeepSecret { .. } | Request::ForgetSecret => return Err((Refusal::SecretNotOffered, [0, 0])),
            // Everything else needs an arm. Of an image only the hand's part was kept, and that in other numbers.
            _ => return Err(NO_ARM),
        }))
    }
}
