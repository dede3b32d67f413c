//! Putting a primitive into the device: sent in parts, checked and committed there, read back here.

use link::image::stored_crc;
use link::{Listing, Name, PrimitiveImage, Refusal, Request};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

/// Phase of an upload.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum UploadPhase {
    /// Bytes are sent.
    Send,
    /// The device checks the image and puts it into its place.
    Commit,
    /// The stored bytes are read back and compared.
    Verify,
}

/// Result of an upload.
#[derive(Debug, Clone, PartialEq)]
pub enum UploadOutcome {
    /// The image was sent, stored and read back.
    Stored(Listing),
    /// The very same image was there already; nothing was sent.
    AlreadyThere(Listing),
}

impl<T: Transport> Client<T> {
    /// Uploads an image. `progress` hears the phase, the bytes done and the bytes in all.
    ///
    /// Whatever fails, the device keeps what it had under that name until the moment the new image is complete.
    ///
    /// # Errors
    /// [`HostError::Image`] for bytes that are no image (nothing is sent), [`HostError::ReadBack`], and as
    /// [`Client::request`].
    pub fn upload(
        &mut self,
        image: &[u8],
        mut progress: impl FnMut(UploadPhase, usize, usize),
    ) -> Result<UploadOutcome, HostError> {
        let parsed = PrimitiveImage::parse(image)?;
        let name = parsed.name().clone();
        if let Some(there) = self.find(&name)?.filter(|there| is_same(there, image)) {
            return Ok(UploadOutcome::AlreadyThere(there));
        }
        if let Err(error) = self.send_image(&name, image, &mut progress) {
            // Best effort: the device forgets the parts anyway when the session ends.
            let _ = self.request(&Request::UploadAbort);
            return Err(error);
        }
        match self.read_image(&name, |done| progress(UploadPhase::Verify, done, image.len())) {
            Ok(stored) if stored == image => {}
            Ok(stored) => {
                let same = stored.iter().zip(image).take_while(|(there, here)| there == here).count();
                return Err(HostError::ReadBack { offset: same });
            }
            // The device of a hand alone converts an image while it arrives and keeps none: its check sum over every
            // byte, compared below, has to do.
            Err(HostError::Refused { reason: Refusal::NoArm, .. }) => {}
            Err(error) => return Err(error),
        }
        match self.find(&name)? {
            Some(listing) if is_same(&listing, image) => Ok(UploadOutcome::Stored(listing)),
            _ => Err(HostError::ReadBack { offset: 0 }),
        }
    }

    fn send_image(
        &mut self,
        name: &Name,
        image: &[u8],
        progress: &mut impl FnMut(UploadPhase, usize, usize),
    ) -> Result<(), HostError> {
        let length = u32::try_from(image.len()).unwrap_or(u32::MAX);
        self.order(&Request::UploadBegin { name: name.clone(), length, crc: stored_crc(image) })?;
        self.send_parts(image, |done| progress(UploadPhase::Send, done, image.len()))?;
        progress(UploadPhase::Commit, 0, 1);
        self.order(&Request::UploadCommit)?;
        progress(UploadPhase::Commit, 1, 1);
        Ok(())
    }

    /// The image that the device stores under a name.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn find(&mut self, name: &Name) -> Result<Option<Listing>, HostError> {
        Ok(self.list()?.into_iter().find(|listing| listing.name == *name))
    }

    /// Gives a stored primitive another name.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn rename(&mut self, name: &Name, to: &Name) -> Result<(), HostError> {
        self.order(&Request::Rename { name: name.clone(), to: to.clone() })
    }

    /// Removes a primitive.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn delete(&mut self, name: &Name) -> Result<(), HostError> {
        self.order(&Request::Delete { name: name.clone() })
    }
}

/// True if a listing is that of this very image.
fn is_same(listing: &Listing, image: &[u8]) -> bool {
    usize::try_from(listing.length) == Ok(image.len()) && listing.crc == stored_crc(image)
}

/// True if the answer comes when a change of the store is durable.
pub(super) fn changes_store(request: &Request) -> bool {
    matches!(
        request,
        Request::UploadCommit
            | Request::Delete { .. }
            | Request::Rename { .. }
            | Request::Calibrate { .. }
            | Request::ForgetCalibration
            | Request::KeepWeight { .. }
            | Request::ForgetWeight
            | Request::KeepSecret { .. }
            | Request::ForgetSecret
    )
}
