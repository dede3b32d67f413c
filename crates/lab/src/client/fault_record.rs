//! The last second before a fault, as the device has kept it.

use link::{FaultRecord, Reply, Request, Telemetry};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

/// The record of the last fault.
#[derive(Debug, Clone, PartialEq)]
pub struct LastSecond {
    /// The fault, and how much there is.
    pub record: FaultRecord,
    /// Its cycles, oldest first; those that a restart has damaged are missing.
    pub cycles: Vec<Telemetry>,
}

impl<T: Transport> Client<T> {
    /// The record of the last fault, without its cycles; `None` if there was none, or if it keeps no record.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn fault_record(&mut self) -> Result<Option<FaultRecord>, HostError> {
        match self.request(&Request::FaultRecord)? {
            Reply::FaultRecord { record, .. } => Ok(record),
            _ => Err(HostError::WrongAnswer { request: "fault record" }),
        }
    }

    /// The same with its cycles. Takes about a second: one request for each.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn last_second(&mut self) -> Result<Option<LastSecond>, HostError> {
        loop {
            let Some(record) = self.fault_record()? else { return Ok(None) };
            let mut cycles = Vec::new();
            for index in 0..record.cycles {
                match self.request(&Request::FaultCycle { record: record.number, index })? {
                    Reply::FaultCycle { cycle, .. } => cycles.extend(cycle),
                    _ => return Err(HostError::WrongAnswer { request: "fault cycle" }),
                }
            }
            // A fault that came meanwhile has taken its place: then that one is wanted.
            if self.fault_record()?.is_some_and(|now| now.number == record.number) {
                return Ok(Some(LastSecond { record, cycles }));
            }
        }
    }
}
