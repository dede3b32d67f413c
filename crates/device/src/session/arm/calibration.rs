//! The home of this arm: told, kept, forgotten.
//!
//! Only the next zeroing uses it; an arm that counts already goes on counting from where it was zeroed.

use link::{Refusal, Reply};

use crate::application::{Refused, SessionPort};
use crate::calibration::{Home, HomeError};
use crate::controller::DeviceController;
use crate::session::arm::ArmApplication;
use crate::session::arm::saving::Change;
use crate::store::Store;

impl<S: Store> ArmApplication<S> {
    /// Returns the home of the arm and where its zero is.
    pub(super) fn calibration(&self, of: u16, port: &mut impl SessionPort<DeviceController>) -> Result<Reply, Refused> {
        self.need_open()?;
        let calibration = self.store.home().calibration(port.health().zeroed_at);
        Ok(Reply::Calibration { of, calibration })
    }

    /// Has the store keep this home.
    pub(super) fn calibrate(
        &mut self,
        home: [f32; 7],
        port: &mut impl SessionPort<DeviceController>,
    ) -> Result<(), Refused> {
        self.need_open()?;
        let home = Home::new(home)?;
        self.need_no_torque(port)?;
        self.store.keep_home(&home)?;
        self.saving = Some(Change::Home);
        Ok(())
    }

    /// Has the store forget it.
    pub(super) fn forget_calibration(&mut self, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        self.need_open()?;
        self.need_no_torque(port)?;
        self.store.forget_home()?;
        self.saving = Some(Change::Home);
        Ok(())
    }

    /// Whoever carries the arm by torque computes with the present zero: not the moment to decide about another.
    fn need_no_torque(&self, port: &mut impl SessionPort<DeviceController>) -> Result<(), Refused> {
        let state = port.health().state;
        if state.has_torque() { Err((Refusal::HasTorque, [state.code().into(), 0])) } else { Ok(()) }
    }
}

impl From<HomeError> for Refused {
    fn from(error: HomeError) -> Self {
        (Refusal::HomeImplausible, error.detail())
    }
}
