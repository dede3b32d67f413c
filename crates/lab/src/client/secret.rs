//! The secret of a device: proven, kept, forgotten.

use std::time::Duration;

use link::{Refusal, Reply, Request, Secret, SecretReport, SecretState};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

impl<T: Transport> Client<T> {
    /// Asks for the device's secret without its bytes: is there one, and has this session proven to know it?
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn secret(&mut self) -> Result<SecretReport, HostError> {
        match self.request(&Request::Secret)? {
            Reply::Secret { secret, .. } => Ok(secret),
            _ => Err(HostError::WrongAnswer { request: "secret" }),
        }
    }

    /// Proves to a device that keeps a secret that this host knows it: as long as this conversation lasts, the device
    /// then does what is asked. To another device nothing is said of the secret.
    ///
    /// # Errors
    /// As [`Client::request`]; the device refuses a wrong one with [`Refusal::WrongProof`].
    pub fn unlock(&mut self, secret: &Secret) -> Result<SecretState, HostError> {
        let SecretReport { state, proven, .. } = self.secret()?;
        if state == SecretState::Kept && !proven {
            let nonce = self.challenge()?;
            self.order(&Request::Prove { proof: secret.proof(nonce, self.session) })?;
        }
        Ok(state)
    }

    /// Asks for a challenge; shortly after a wrong proof, whoever it came from, there is none yet.
    fn challenge(&mut self) -> Result<u64, HostError> {
        let mut answer = self.request(&Request::Challenge);
        if let Err(HostError::Refused { reason: Refusal::ProofTooSoon, detail: [wait, _], .. }) = answer {
            // A millisecond more: the device counts whole ones.
            let until = self.now() + Duration::from_millis(u64::from(wait.min(1000)) + 1);
            while self.now() < until {
                self.pump(until.saturating_sub(self.now()))?;
            }
            answer = self.request(&Request::Challenge);
        }
        match answer? {
            Reply::Challenge { nonce, .. } => Ok(nonce),
            _ => Err(HostError::WrongAnswer { request: "challenge" }),
        }
    }

    /// Has the device keep this secret, which crosses the line as it is. Returns when that is durable; this
    /// conversation then has to prove it like any other.
    ///
    /// # Errors
    /// As [`Client::request`]; a device that keeps one already has to be given the proof of that one before.
    pub fn keep_secret(&mut self, secret: &Secret) -> Result<(), HostError> {
        self.order(&Request::KeepSecret { secret: *secret })
    }

    /// Has the device forget its secret. Returns when that is durable.
    ///
    /// # Errors
    /// As [`Client::keep_secret`].
    pub fn forget_secret(&mut self) -> Result<(), HostError> {
        self.order(&Request::ForgetSecret)
    }
}
