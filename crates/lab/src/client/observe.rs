//! Looking on beside the host that commands the arm.

use std::time::Duration;

use link::message::HostHello;
use link::{LINK_VERSION, Refusal, Reply, Request, SCHEMA_HASH, Text};

use super::{BUSY_TIMEOUT, Client, session_number};
use crate::error::HostError;
use crate::transport::Transport;

/// Who looks on says something every [`super::KEEP_ALIVE`] and keeps his place for two seconds after: one whose place
/// is free in less than this time, ms, has been killed, and his place is waited for.
const GONE_MS: u32 = 1000;

impl<T: Transport> Client<T> {
    /// Opens a conversation that may look and stop, nothing else, whoever commands the arm: status, counters, listing,
    /// calibration, telemetry. Telemetry comes at least as often as it is asked for; while the other host has a stream
    /// of its own, that one is seen.
    ///
    /// # Errors
    /// As [`Client::connect`]; [`HostError::Watched`] if two others look on already.
    pub fn observe(transport: T, owner: &str) -> Result<Self, HostError> {
        let mut client = Self::begin(transport)?;
        client.look_on(owner)?;
        Ok(client)
    }

    /// Looks on anew, on the same line, once the device does not know this host any more: true if the device was
    /// started anew, false if it has let go of a host that was suspended. A stream of telemetry has to be asked for
    /// again.
    ///
    /// # Errors
    /// As [`Client::observe`].
    pub fn observe_anew(&mut self, owner: &str) -> Result<bool, HostError> {
        let restarted = self.restarted;
        (self.open, self.session, self.sequence, self.device_ms) =
            (false, session_number(self.transport.is_virtual()), 0, 0);
        // Answers to what was asked before have numbers that are given anew.
        self.answers.clear();
        self.look_on(owner).map(|()| restarted)
    }

    /// Takes the device's time (ms) of a message; it wraps after 49 days.
    pub(super) fn note_time(&mut self, time_ms: u32) {
        self.restarted |= time_ms.wrapping_sub(self.device_ms) > u32::MAX / 2;
        self.device_ms = time_ms;
    }

    fn look_on(&mut self, owner: &str) -> Result<(), HostError> {
        let hello = HostHello {
            link_version: LINK_VERSION,
            schema_hash: SCHEMA_HASH,
            model_hash: control::MODEL_HASH,
            owner: Text::new(owner),
        };
        let greeting = Request::Observe(hello.clone());
        let mut greeted = self.greet(&greeting, &hello, BUSY_TIMEOUT);
        if let Err(HostError::Refused { reason: Refusal::Busy, detail: [_, wait], .. }) = greeted
            && wait < GONE_MS
        {
            // On a machine that is busy a simulated device's time passes more slowly than this clock.
            greeted = self.greet(&greeting, &hello, 2 * Duration::from_millis(wait.into()));
        }
        if matches!(greeted, Err(HostError::NoAnswer { .. })) {
            // A device of an older version does not know the request; it knows a hello, and says what it is.
            self.open(owner, LINK_VERSION, SCHEMA_HASH, BUSY_TIMEOUT)?;
            // One of this version was silent until now. It is left to whoever wants to command it.
            self.open = false;
            let _ = self.exchange(&Request::Goodbye);
            greeted = self.greet(&greeting, &hello, BUSY_TIMEOUT);
        }
        match greeted {
            Ok(device) => self.hello = device,
            Err(HostError::Refused { reason: Refusal::Busy, detail: [_, wait_ms], .. }) => {
                return Err(HostError::Watched { wait_ms });
            }
            Err(error) => return Err(error),
        }
        (self.open, self.observing, self.restarted) = (true, true, false);
        Ok(())
    }

    /// The error for a device that another host has: with the name of that host, if the device tells an observer.
    pub(super) fn in_use(&mut self, hello: HostHello, wait_ms: u32) -> HostError {
        let ask = || {
            self.exchange(&Request::Observe(hello)).ok()?;
            let reply = self.exchange(&Request::Owner).ok()?;
            // Its place is free for others again; whether that is heard changes nothing.
            let _ = self.exchange(&Request::Goodbye);
            match reply {
                Reply::Owner { owner, .. } => owner,
                _ => None,
            }
        };
        HostError::InUse { owner: ask(), wait_ms }
    }

    /// Stops the arm, whoever commands it. Returns when the device has taken the stop.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn order_stop(&mut self) -> Result<(), HostError> {
        self.order(&Request::Stop)
    }
}
