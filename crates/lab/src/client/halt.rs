//! Stopping an arm that another host has in its hands.

use std::time::Duration;

use link::{LINK_VERSION, Refusal, Request, SCHEMA_HASH};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

/// A device that has taken a stop.
pub enum Halted<T: Transport> {
    /// It talks with this host now.
    Ours(Box<Client<T>>),
    /// It talks with another host, for this reason nothing more can be asked.
    Others(HostError),
}

impl<T: Transport> Client<T> {
    /// Stops the arm first and opens a conversation then: a stop needs none, so it works while another host has the
    /// device.
    ///
    /// # Errors
    /// As [`Client::connect`], except that a busy device is none; [`HostError::Refused`] if the stop was not taken.
    pub fn halt(transport: T, owner: &str) -> Result<Halted<T>, HostError> {
        let mut client = Self::begin(transport)?;
        let stopped = match client.exchange(&Request::Stop) {
            Ok(_) => true,
            // A device of an older version, which the hello will name.
            Err(HostError::Refused { reason: Refusal::NoSession, .. }) => false,
            Err(error) => return Err(error),
        };
        match client.open(owner, LINK_VERSION, SCHEMA_HASH, Duration::ZERO) {
            Ok(()) => Ok(Halted::Ours(Box::new(client))),
            Err(error @ HostError::InUse { .. }) if stopped => Ok(Halted::Others(error)),
            Err(error) => Err(error),
        }
    }
}
