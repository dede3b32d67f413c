//! The stream of control cycles, and what is missing from it.

use std::time::Duration;

use link::{Event, Request, Telemetry};

use super::{Client, Incoming};
use crate::error::HostError;
use crate::transport::Transport;

/// Samples that did not arrive.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Gaps {
    /// Telemetry messages missing between two that came.
    pub telemetry: u32,
    /// Longest run of missing telemetry messages.
    pub longest: u32,
    /// Messages of any kind that were sent but lost on the line.
    pub messages: u32,
    every: u32,
    last_cycle: Option<u32>,
    last_message: Option<u16>,
}

impl Gaps {
    /// A new stream with this decimation: what was missing before does not count as a gap.
    fn restart(&mut self, every: u8) {
        self.every = u32::from(every);
        self.last_cycle = None;
    }

    pub(super) fn telemetry(&mut self, cycle: u32) {
        if let Some(last) = self.last_cycle.filter(|_| self.every > 0) {
            let missing = (cycle.wrapping_sub(last) / self.every).saturating_sub(1);
            self.telemetry = self.telemetry.saturating_add(missing);
            self.longest = self.longest.max(missing);
        }
        self.last_cycle = Some(cycle);
    }

    pub(super) fn message(&mut self, sequence: u16) {
        if let Some(last) = self.last_message {
            let missing = sequence.wrapping_sub(last).wrapping_sub(1);
            self.messages = self.messages.saturating_add(u32::from(missing));
        }
        self.last_message = Some(sequence);
    }
}

impl<T: Transport> Client<T> {
    /// Switches the stream of telemetry: one message every so many cycles, 0 is off.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn set_telemetry(&mut self, every: u8) -> Result<(), HostError> {
        self.order(&Request::Telemetry { every })?;
        self.incoming.retain(|incoming| matches!(incoming, Incoming::Event(_)));
        self.gaps.restart(every);
        Ok(())
    }

    /// Takes out the events that have come so far; telemetry stays.
    pub fn take_events(&mut self) -> Vec<Event> {
        let mut events = Vec::new();
        self.incoming.retain(|incoming| match incoming {
            Incoming::Event(event) => {
                events.push(*event);
                false
            }
            Incoming::Telemetry(_) => true,
        });
        events
    }

    /// The stream of telemetry as an iterator that never ends by itself; it is switched off when dropped.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn telemetry(&mut self, every: u8) -> Result<TelemetryStream<'_, T>, HostError> {
        self.set_telemetry(every)?;
        Ok(TelemetryStream { client: self, events: Vec::new(), silence: Duration::from_secs(1) })
    }
}

/// Control cycles as they come. Events that come between them are kept.
pub struct TelemetryStream<'a, T: Transport> {
    client: &'a mut Client<T>,
    events: Vec<Event>,
    silence: Duration,
}

impl<T: Transport> TelemetryStream<'_, T> {
    /// The client, to send requests while the stream runs.
    pub fn client(&mut self) -> &mut Client<T> {
        self.client
    }

    /// The events that came since this was last asked.
    pub fn events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }
}

impl<T: Transport> Iterator for TelemetryStream<'_, T> {
    type Item = Result<Telemetry, HostError>;

    /// The next cycle; [`HostError::NoAnswer`] if none came for a second, whatever else did.
    fn next(&mut self) -> Option<Self::Item> {
        let end = self.client.listened + self.silence;
        loop {
            return Some(match self.client.next(end.saturating_sub(self.client.listened)) {
                Ok(Some(Incoming::Telemetry(telemetry))) => Ok(telemetry),
                Ok(Some(Incoming::Event(event))) => {
                    self.events.push(event);
                    continue;
                }
                Ok(None) => Err(HostError::NoAnswer { request: "telemetry", after: self.silence }),
                Err(error) => Err(error),
            });
        }
    }
}

impl<T: Transport> Drop for TelemetryStream<'_, T> {
    fn drop(&mut self) {
        // A device that does not answer any more has nothing to switch off.
        let _ = self.client.set_telemetry(0);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_are_counted_in_messages_not_cycles() {
        let mut gaps = Gaps::default();
        gaps.restart(3);
        [300, 303, 306, 315, 318].into_iter().for_each(|cycle| gaps.telemetry(cycle));
        assert_eq!((gaps.telemetry, gaps.longest), (2, 2));
        gaps.restart(1);
        [500, 501, 503].into_iter().for_each(|cycle| gaps.telemetry(cycle));
        assert_eq!((gaps.telemetry, gaps.longest), (3, 2));
    }

    #[test]
    fn a_number_that_wraps_is_no_gap() {
        let mut gaps = Gaps::default();
        [0xFFFE, 0xFFFF, 0, 2].into_iter().for_each(|sequence| gaps.message(sequence));
        assert_eq!(gaps.messages, 1);
    }
}
