//! Losses of a device's storage.

use link::{LostImage, Reply, Request, StorageReport};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

impl<T: Transport> Client<T> {
    /// Returns how the storage of the device is, and the images that were lost in it.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn storage(&mut self) -> Result<(StorageReport, Vec<LostImage>), HostError> {
        let report = self.storage_of(0)?;
        let mut lost = Vec::from_iter(report.loss.clone());
        for place in 1..self.hello.slots {
            if lost.len() >= usize::from(report.lost) {
                break;
            }
            lost.extend(self.storage_of(place)?.loss);
        }
        Ok((report, lost))
    }

    fn storage_of(&mut self, place: u8) -> Result<StorageReport, HostError> {
        match self.request(&Request::Storage { place })? {
            Reply::Storage { storage, .. } => Ok(storage),
            _ => Err(HostError::WrongAnswer { request: "storage" }),
        }
    }
}
