//! Hosts that look on beside the one that has the session.

/// Observers at a time.
const OBSERVERS: usize = 2;

/// An observer that has said nothing for so long is gone, ms. It holds nothing that moves, so it may be slow.
const SILENCE_MS: u32 = 2000;

#[derive(Debug, Clone, Copy)]
struct Observer {
    session: u16,
    heard_ms: u32,
    /// Telemetry every so many cycles, 0 for none.
    every: u8,
}

impl Observer {
    fn silence(&self, now_ms: u32) -> u32 {
        now_ms.wrapping_sub(self.heard_ms)
    }
}

/// Everybody who looks on.
#[derive(Debug, Default)]
pub(super) struct Observers([Option<Observer>; OBSERVERS]);

impl Observers {
    fn present(&self) -> impl Iterator<Item = &Observer> {
        self.0.iter().flatten()
    }

    fn find(&mut self, session: u16) -> Option<&mut Observer> {
        self.0.iter_mut().flatten().find(|observer| observer.session == session)
    }

    /// Takes an observer in.
    ///
    /// # Errors
    /// Time until one that has fallen silent has to go, ms, if there is no room.
    pub(super) fn admit(&mut self, session: u16, now_ms: u32) -> Result<(), u32> {
        if self.hear(session, now_ms) {
            return Ok(());
        }
        match self.0.iter_mut().find(|place| place.is_none()) {
            Some(place) => {
                *place = Some(Observer { session, heard_ms: now_ms, every: 0 });
                Ok(())
            }
            None => {
                let longest = self.present().map(|observer| observer.silence(now_ms)).max().unwrap_or(0);
                Err(SILENCE_MS.saturating_sub(longest))
            }
        }
    }

    /// Notes that an observer was heard; false if the session is not that of one.
    pub(super) fn hear(&mut self, session: u16, now_ms: u32) -> bool {
        self.find(session).map(|observer| observer.heard_ms = now_ms).is_some()
    }

    /// An observer goes.
    pub(super) fn leave(&mut self, session: u16) {
        self.forget(|observer| observer.session == session);
    }

    /// Those who have been silent for too long are gone.
    pub(super) fn forget_silent(&mut self, now_ms: u32) {
        self.forget(|observer| observer.silence(now_ms) >= SILENCE_MS);
    }

    fn forget(&mut self, who: impl Fn(&Observer) -> bool) {
        for place in &mut self.0 {
            if place.as_ref().is_some_and(&who) {
                *place = None;
            }
        }
    }

    /// An observer asks for telemetry every so many cycles, 0 for none.
    pub(super) fn set_telemetry(&mut self, session: u16, every: u8) {
        if let Some(observer) = self.find(session) {
            observer.every = every;
        }
    }

    /// Session of an observer for whom a cycle is due.
    pub(super) fn awaiting(&self, cycle: u32) -> Option<u16> {
        let mut due = self.present().filter(|observer| cycle.checked_rem(observer.every.into()) == Some(0));
        due.next().map(|observer| observer.session)
    }

    /// Session of any observer.
    pub(super) fn any(&self) -> Option<u16> {
        self.present().next().map(|observer| observer.session)
    }
}
