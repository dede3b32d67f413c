//! An image that arrives in parts and replaces another only when it is whole and sound.

use link::image::ImageError;
use link::{Name, PrimitiveImage, Refusal};

use super::Session;
use super::directory::Entry;
use super::primitive;
use crate::store::Store;

/// A refusal with its detail.
pub(crate) type Refused = (Refusal, [u32; 2]);

/// An upload under way.
#[derive(Debug)]
pub(crate) struct Upload {
    name: Name,
    length: u32,
    crc: u32,
    pub(crate) received: u32,
}

impl<S: Store> Session<S> {
    /// Opens the spare place of the store.
    pub(crate) fn upload_begin(&mut self, name: Name, length: u32, crc: u32) -> Result<(), Refused> {
        self.upload_abort();
        let room = u32::try_from(self.store.slot_bytes()).unwrap_or(u32::MAX);
        if length > room {
            return Err((Refusal::ImageTooLarge, [length, room]));
        }
        // Better refused now than after all of it has been sent.
        if self.directory.find(&name).is_none() && self.directory.free().is_none() {
            return Err((Refusal::StoreFull, [self.directory.places().into(), 0]));
        }
        self.store.begin(usize::try_from(length).unwrap_or(usize::MAX))?;
        self.upload = Some(Upload { name, length, crc, received: 0 });
        Ok(())
    }

    /// Writes the next part.
    pub(crate) fn upload_chunk(&mut self, offset: u32, data: &[u8]) -> Result<(), Refused> {
        let upload = self.upload.as_mut().ok_or((Refusal::NoUpload, [0, 0]))?;
        if offset != upload.received {
            return Err((Refusal::UploadOrder, [upload.received, offset]));
        }
        let end = u32::try_from(data.len()).ok().and_then(|length| offset.checked_add(length));
        let Some(end) = end.filter(|end| *end <= upload.length) else {
            return Err((Refusal::ImageTooLarge, [offset.saturating_add(192), upload.length]));
        };
        self.store.write(usize::try_from(offset).unwrap_or(usize::MAX), data)?;
        upload.received = end;
        Ok(())
    }

    /// Forgets the upload.
    pub(crate) fn upload_abort(&mut self) {
        self.upload = None;
        self.store.abort();
    }

    /// Checks the image from the first byte to the last real number, then has it put into its place: which, and what will be
    /// there once that is durable.
    pub(crate) fn upload_commit(&mut self) -> Result<(u8, Entry), Refused> {
        let upload = self.upload.as_ref().ok_or((Refusal::NoUpload, [0, 0]))?;
        if upload.received != upload.length {
            // Not forgotten: the host may still send the rest.
            return Err((Refusal::UploadIncomplete, [upload.received, upload.length]));
        }
        let committed = self.check_and_commit();
        self.upload_abort();
        committed
    }

    fn check_and_commit(&mut self) -> Result<(u8, Entry), Refused> {
        let (Some(upload), Some(bytes)) = (&self.upload, self.store.staged()) else {
            return Err((Refusal::NoUpload, [0, 0]));
        };
        let image = match PrimitiveImage::parse(bytes) {
            Ok(image) => image,
            Err(ImageError::Crc { computed, stored }) => {
                // Arrived as announced, the image was wrong when it left: then its own check sum is the one that differs.
                let expected = if computed == upload.crc { stored } else { upload.crc };
                return Err((Refusal::UploadCrc, [computed, expected]));
            }
            Err(ImageError::Kernels { found }) => return Err(too_many_kernels(found)),
            Err(error) => return Err((Refusal::ImageInvalid, [error.code(), error.number()])),
        };
        if image.crc() != upload.crc {
            return Err((Refusal::UploadCrc, [image.crc(), upload.crc]));
        }
        let model = image.content().model_hash;
        if model != control::MODEL_HASH {
            return Err((Refusal::ImageModel, [model, control::MODEL_HASH]));
        }
        if *image.name() != upload.name {
            return Err((Refusal::ImageName, [0, 0]));
        }
        if let Some(saving) = &mut self.saving {
            saving.building();
        }
        primitive::build(&self.model, image.content(), &mut self.room, &mut self.primitive)?;
        let entry = Entry::of(&image);
        let place = self.directory.find(&entry.name).map(|(slot, _)| slot).or_else(|| self.directory.free());
        let Some(slot) = place else {
            return Err((Refusal::StoreFull, [self.directory.places().into(), 0]));
        };
        self.store.commit(slot)?;
        Ok((slot, entry))
    }
}

fn too_many_kernels(found: u32) -> Refused {
    let most = u32::try_from(link::image::KERNEL_LIMIT).unwrap_or(u32::MAX);
    (Refusal::TooManyKernels, [found, most])
}
