//! `Lock`: challenges and proofs, by which a session shows that it knows the secret of the device.
//!
//! ```text
//! nonce = start xor moment
//! ```
//! `moment` is the device's time in us, one more than the last one where that has not passed: it never comes twice in
//! the life of a start, and so no nonce does. `start` is a hash under the secret of the time of the first challenge and
//! of what the arm measured last. There is no hardware source of random numbers here: a nonce of an earlier start comes
//! again if its first challenge came in the same microsecond, with the same noise of the sensors, and this one too.

use link::{Refusal, Reply, Request, Secret, SecretReport, SecretState, Telemetry};

use crate::application::{Application, CycleReport, Refused};
use crate::secret::StoredSecret;
use crate::session::host::HostSession;

/// Time after a wrong proof in which no challenge is given, ms: two guesses a second at a number of 64 bits.
const PAUSE_MS: u32 = 500;

/// The device's side of the proofs, over all sessions since start-up.
#[derive(Debug, Default)]
pub(super) struct Lock {
    now_us: u64,
    /// Moment of the newest challenge.
    moment: u64,
    /// Drawn with the first challenge.
    start: Option<u64>,
    /// Time of the newest wrong proof, ms.
    wrong_ms: Option<u32>,
    wrong_proofs: u32,
}

impl Lock {
    /// Notes the device's time.
    pub(super) fn tick(&mut self, now_us: u64) {
        self.now_us = now_us;
    }

    /// Time until the next challenge is given, ms.
    fn wait(&self, now_ms: u32) -> u32 {
        self.wrong_ms.map_or(0, |wrong_ms| PAUSE_MS.saturating_sub(now_ms.wrapping_sub(wrong_ms)))
    }

    /// A number that was given to nobody since start-up. `noise` is asked for the first one.
    fn nonce(&mut self, secret: &Secret, noise: impl FnOnce() -> Telemetry) -> u64 {
        self.moment = self.now_us.max(self.moment.wrapping_add(1));
        let moment = self.moment;
        let start = *self.start.get_or_insert_with(|| {
            let Telemetry { cycle, q, dq, tau, wrench, gauges, cost_ticks, .. } = noise();
            let measured = q.into_iter().chain(dq).chain(tau).chain(wrench).chain(gauges).map(f32::to_bits);
            secret.hash([moment].into_iter().chain([cycle, cost_ticks].into_iter().chain(measured).map(u64::from)))
        });
        start ^ moment
    }

    /// A wrong proof has come.
    fn refuse(&mut self, now_ms: u32) -> Refused {
        self.wrong_ms = Some(now_ms);
        self.wrong_proofs = self.wrong_proofs.saturating_add(1);
        (Refusal::WrongProof, [0, 0])
    }
}

/// Nothing here is inlined: its frames would lie on the stack below the check of a primitive, which goes deepest.
impl<A: Application> HostSession<A> {
    /// Refuses what moves or changes something to a session that has not proven to know the secret, if there is one.
    #[inline(never)]
    pub(super) fn need_proof(&self, request: &Request) -> Result<(), Refused> {
        if !A::KEEPS_SECRET || !request.is_guarded() {
            return Ok(());
        }
        match self.application.secret()? {
            StoredSecret::Nothing => Ok(()),
            StoredSecret::Kept(secret) if self.owner.as_ref().is_some_and(|owner| owner.knows(&secret)) => Ok(()),
            StoredSecret::Kept(_) => Err((Refusal::Locked, [0, 0])),
            StoredSecret::Unreadable if matches!(request, Request::KeepSecret { .. } | Request::ForgetSecret) => Ok(()),
            StoredSecret::Unreadable => Err((Refusal::SecretUnreadable, [0, 0])),
        }
    }

    /// Tells if there is a secret. `is_owner`: the session that commands asks.
    #[inline(never)]
    pub(super) fn secret_report(&self, of: u16, is_owner: bool) -> Result<Reply, Refused> {
        let stored = self.application.secret()?;
        let owner = self.owner.as_ref().filter(|_| is_owner);
        let state = if A::KEEPS_SECRET { stored.state() } else { SecretState::NotOffered };
        let proven = matches!(stored, StoredSecret::Kept(secret) if owner.is_some_and(|owner| owner.knows(&secret)));
        Ok(Reply::Secret { of, secret: SecretReport { state, proven, wrong_proofs: self.lock.wrong_proofs } })
    }

    /// Gives the session a number to prove the secret with.
    #[inline(never)]
    pub(super) fn challenge(&mut self, now_ms: u32, of: u16) -> Result<Reply, Refused> {
        let secret = self.secret_to_prove()?;
        let wait = self.lock.wait(now_ms);
        if wait > 0 {
            return Err((Refusal::ProofTooSoon, [wait, 0]));
        }
        let latest = self.latest.as_ref();
        let nonce = self.lock.nonce(&secret, || latest.map(|timed| timed.record.telemetry()).unwrap_or_default());
        if let Some(owner) = &mut self.owner {
            owner.challenge(nonce);
        }
        Ok(Reply::Challenge { of, nonce })
    }

    /// Compares a proof with the one that is right. Its challenge is used up, right or wrong.
    #[inline(never)]
    pub(super) fn prove(&mut self, now_ms: u32, proof: u64) -> Result<(), Refused> {
        let secret = self.secret_to_prove()?;
        let is_right = self.owner.as_mut().is_some_and(|owner| owner.prove(&secret, proof));
        if is_right { Ok(()) } else { Err(self.lock.refuse(now_ms)) }
    }

    fn secret_to_prove(&self) -> Result<Secret, Refused> {
        match self.application.secret()? {
            StoredSecret::Kept(secret) => Ok(secret),
            StoredSecret::Nothing => Err((Refusal::NoSecret, [0, 0])),
            StoredSecret::Unreadable => Err((Refusal::SecretUnreadable, [0, 0])),
        }
    }
}

#[cfg(test)]
mod tests {
    extern crate std;

    use std::vec::Vec;

    use super::*;

    const SECRET: Secret = Secret::new([7; 16]);

    /// The nonces of a start whose challenges came at these times, us.
    fn nonces(times: &[u64], telemetry: Telemetry) -> Vec<u64> {
        let mut lock = Lock::default();
        times
            .iter()
            .map(|time| {
                lock.tick(*time);
                lock.nonce(&SECRET, || telemetry)
            })
            .collect()
    }

    #[test]
    fn no_nonce_comes_twice_in_a_start_however_fast_or_slowly_challenges_are_asked_for() {
        let times: Vec<u64> = (0..3000).map(|n| if n % 3 == 0 { 1000 * n } else { 5_000_000 }).collect();
        let mut nonces = nonces(&times, Telemetry::default());
        nonces.sort_unstable();
        nonces.dedup();
        assert_eq!(nonces.len(), times.len());
    }

    #[test]
    fn two_starts_have_no_nonce_in_common_if_their_first_challenges_differ_by_a_microsecond_or_by_any_noise() {
        let times: Vec<u64> = (0..500).map(|n| 1_000_000 + n).collect();
        let first = nonces(&times, Telemetry::default());
        let noise = Telemetry { wrench: [0.0, 0.0, 0.0, 0.0, 0.0, 1e-6], ..Telemetry::default() };
        let later: Vec<u64> = times.iter().map(|time| time + 1).collect();
        for second in [nonces(&later, Telemetry::default()), nonces(&times, noise)] {
            assert!(!second.iter().any(|nonce| first.contains(nonce)));
        }
    }

    #[test]
    fn a_pause_ends_after_half_a_second_also_where_the_clock_wraps() {
        for wrong_ms in [1000, u32::MAX - 100] {
            let mut lock = Lock::default();
            assert_eq!(lock.wait(wrong_ms), 0);
            lock.refuse(wrong_ms);
            let waits = [0, 1, 499, 500, 70_000].map(|ms: u32| lock.wait(wrong_ms.wrapping_add(ms)));
            assert_eq!(waits, [500, 499, 1, 0, 0]);
        }
    }
}
