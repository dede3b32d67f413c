//! An image that arrives in parts and replaces another only when it is whole and sound.

use link::{Name, Refusal};

use crate::application::{Application, Refused, SessionPort};
use crate::session::host::HostSession;
use crate::store::StoreError;

/// An upload under way.
#[derive(Debug)]
pub(super) struct Upload {
    name: Name,
    length: u32,
    crc: u32,
    received: u32,
}

impl Upload {
    /// Bytes that have arrived.
    pub(super) fn received(&self) -> u32 {
        self.received
    }
}

impl<A: Application> HostSession<A> {
    /// Prepares a place for an image, over another upload under way.
    pub(super) fn upload_begin(&mut self, name: Name, length: u32, crc: u32) -> Result<(), Refused> {
        self.upload_abort();
        let room = self.application.place_bytes();
        if length > room {
            return Err((Refusal::ImageTooLarge, [length, room]));
        }
        self.application.begin(&name, length)?;
        self.upload = Some(Upload { name, length, crc, received: 0 });
        Ok(())
    }

    /// Takes the next part.
    pub(super) fn upload_chunk(&mut self, offset: u32, data: &[u8]) -> Result<(), Refused> {
        let upload = self.upload.as_mut().ok_or((Refusal::NoUpload, [0, 0]))?;
        if offset != upload.received {
            return Err((Refusal::UploadOrder, [upload.received, offset]));
        }
        let end = u32::try_from(data.len()).map_or(u32::MAX, |length| offset.saturating_add(length));
        if end > upload.length {
            return Err((Refusal::ImageTooLarge, [end, upload.length]));
        }
        self.application.write(offset, data)?;
        upload.received = end;
        Ok(())
    }

    /// Forgets the upload.
    pub(super) fn upload_abort(&mut self) {
        self.upload = None;
        self.application.abort();
    }

    /// Has the image checked from the first byte to the last real number, and put into its place.
    pub(super) fn upload_commit(&mut self, port: &mut impl SessionPort<A::Controller>) -> Result<(), Refused> {
        let upload = self.upload.as_ref().ok_or((Refusal::NoUpload, [0, 0]))?;
        if upload.received != upload.length {
            // Not forgotten: the host may still send the rest.
            return Err((Refusal::UploadIncomplete, [upload.received, upload.length]));
        }
        let committed = self.application.commit(&upload.name, upload.crc, port);
        let busy = StoreError::Busy.code();
        // Not forgotten either while the storage is at work: the host asks again.
        if !matches!(committed, Err((Refusal::StoreFailed, [code, _])) if code == busy) {
            self.upload_abort();
        }
        committed
    }
}
