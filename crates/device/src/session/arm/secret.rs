//! The secret: kept and forgotten. Whoever asks for it has proven the present one, if there is one.
//!
//! A session proves one certain secret: from the moment at which another one is durable it has proven nothing.

use link::Secret;

use crate::application::Refused;
use crate::session::arm::ArmApplication;
use crate::session::arm::saving::Change;
use crate::store::Store;

impl<S: Store> ArmApplication<S> {
    /// Has the store keep this secret.
    #[inline(never)]
    pub(super) fn keep_secret(&mut self, secret: &Secret) -> Result<(), Refused> {
        self.need_open()?;
        self.store.keep_secret(secret)?;
        self.saving = Some(Change::Secret);
        Ok(())
    }

    /// Has the store forget it.
    #[inline(never)]
    pub(super) fn forget_secret(&mut self) -> Result<(), Refused> {
        self.need_open()?;
        self.store.forget_secret()?;
        self.saving = Some(Change::Secret);
        Ok(())
    }
}
