//! The weight of an arm's links, which its device keeps.

use control::Payload;
use control::model::{LinkWeight, WeightCorrection};
use link::{Reply, Request, Weight};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

impl<T: Transport> Client<T> {
    /// Returns the weight that the device takes the links to have, and whose it is.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn weight(&mut self) -> Result<Weight, HostError> {
        match self.request(&Request::Weight)? {
            Reply::Weight { weight, .. } => Ok(weight),
            _ => Err(HostError::WrongAnswer { request: "weight" }),
        }
    }

    /// Has the device keep this weight. Returns when it is durable; it counts once the arm has no torque.
    ///
    /// # Errors
    /// As [`Client::request`]; the device refuses what no arm can have.
    pub fn keep_weight(&mut self, weight: &WeightCorrection) -> Result<(), HostError> {
        let links = weight.links().map(|LinkWeight { share, shift: [x, y, z] }| [share, x, y, z]);
        self.order(&Request::KeepWeight { hand: weight.payload() == Payload::SensorAndHand, links })
    }

    /// Has the device forget it. Returns when that is durable.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn forget_weight(&mut self) -> Result<(), HostError> {
        self.order(&Request::ForgetWeight)
    }
}
