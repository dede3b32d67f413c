//! The weight of the arm's links: told, kept, forgotten, and handed to the control half.
//!
//! It may be kept while the arm has torque, as a calibration leaves it; the control half takes it when there is none.
//! Nothing here is inlined: its frames would lie on the stack below the check of a primitive, which goes deepest.

use control::Payload;
use control::model::{LinkWeight, WeightCorrection};
use link::{Refusal, Reply, Weight};

use crate::application::{Refused, SessionPort};
use crate::controller::DeviceController;
use crate::session::arm::ArmApplication;
use crate::session::arm::saving::Change;
use crate::store::Store;
use crate::weight::StoredWeight;

impl<S: Store> ArmApplication<S> {
    /// Returns the weight that counts, and whose it is.
    #[inline(never)]
    pub(super) fn weight(&self, of: u16, port: &mut impl SessionPort<DeviceController>) -> Result<Reply, Refused> {
        self.need_open()?;
        let stored = self.store.weight();
        let correction = stored.correction();
        let kept = matches!(stored, StoredWeight::Kept(_));
        let weight = Weight {
            hand: correction.payload() == Payload::SensorAndHand,
            links: correction.links().map(|LinkWeight { share, shift: [x, y, z] }| [share, x, y, z]),
            source: stored.source(),
            in_use: kept && !self.weight_waits && port.health().payload == correction.payload(),
        };
        Ok(Reply::Weight { of, weight })
    }

    /// Has the store keep this weight.
    #[inline(never)]
    pub(super) fn keep_weight(&mut self, hand: bool, links: &[[f32; 4]; 7]) -> Result<(), Refused> {
        self.need_open()?;
        let payload = if hand { Payload::SensorAndHand } else { Payload::None };
        let links = links.map(|[share, x, y, z]| LinkWeight { share, shift: [x, y, z] });
        let weight = WeightCorrection::new(payload, links);
        let weight = weight.map_err(|error| (Refusal::WeightImplausible, error.detail()))?;
        self.store.keep_weight(&weight)?;
        self.saving = Some(Change::Weight);
        Ok(())
    }

    /// Has the store forget it.
    #[inline(never)]
    pub(super) fn forget_weight(&mut self) -> Result<(), Refused> {
        self.need_open()?;
        self.store.forget_weight()?;
        self.saving = Some(Change::Weight);
        Ok(())
    }

    /// Gives the control half the weight that the store holds, as soon as the arm has no torque.
    #[inline(never)]
    pub(super) fn hand_over_weight(&mut self, port: &mut impl SessionPort<DeviceController>) {
        if self.weight_waits && self.opened && !port.health().state.has_torque() {
            self.weight_waits = !port.weigh(&self.store.weight());
        }
    }
}
