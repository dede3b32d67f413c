//! The home of the arm that the device keeps.

use link::{Calibration, Reply, Request};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

impl<T: Transport> Client<T> {
    /// Where the next zeroing takes the arm to stand, whose home that is, and where the last zeroing took it to stand.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn calibration(&mut self) -> Result<Calibration, HostError> {
        match self.request(&Request::Calibration)? {
            Reply::Calibration { calibration, .. } => Ok(calibration),
            _ => Err(HostError::WrongAnswer { request: "calibration" }),
        }
    }

    /// Has the device keep this home (rad) for every zeroing from now on. Returns when it is durable.
    ///
    /// # Errors
    /// As [`Client::request`]; the device refuses what cannot be the home of its arm, and everything while the arm
    /// has torque.
    pub fn calibrate(&mut self, home: [f32; 7]) -> Result<(), HostError> {
        self.order(&Request::Calibrate { home })
    }

    /// Has the device forget that home. Returns when that is durable.
    ///
    /// # Errors
    /// As [`Client::calibrate`].
    pub fn forget_calibration(&mut self) -> Result<(), HostError> {
        self.order(&Request::ForgetCalibration)
    }
}
