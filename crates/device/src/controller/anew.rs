//! Between the start-up and the cyclic loop: how the one hands the bus to the other.

use crate::application::ControllerIo;
use crate::background::BackgroundPoll;
use crate::health::Counters;
use crate::round::Round;

use super::brakes::Brakes;
use super::lateness::Lateness;
use super::{BusPhase, DeviceController};

impl DeviceController {
    /// The start-up is over: the next request slot begins the cyclic loop.
    pub(super) fn begin_cycles(&mut self) {
        let (Some(calibration), Some(safety)) = (self.startup.calibration(), self.startup.safety_properties()) else {
            return;
        };
        self.cycle.reset();
        // After a reset no state has torque, and only torque makes the cycle refuse.
        if self.cycle.calibrate(*calibration).is_err() {
            return;
        }
        if !self.startup.is_zeroed() {
            self.cycle.lose_zero();
        }
        self.phase = BusPhase::Cyclic(BackgroundPoll::new(safety));
        self.round = Round::new(self.startup.has_sensor());
        match self.startup.take_hand() {
            Some(found) => self.hand.begin(found),
            None => self.hand.resume(),
        }
        if self.startup.take_tare() {
            self.cycle.forget_tare();
        }
        (self.fault, self.last_cycles, self.fresh_safety) = (None, None, None);
        self.refused = 0;
        self.lateness = Lateness::default();
        self.brakes = Brakes::default();
    }

    /// Leaves the cyclic loop.
    #[cold]
    #[inline(never)]
    pub(super) fn restart(&mut self, now_us: u64) {
        Counters::count(&mut self.counters.restarts);
        self.phase = BusPhase::StartUp;
        self.startup.restart(now_us, self.cycle.last_counts());
        self.cycle.reset();
        self.suspend_hand();
    }

    /// Tells what waits behind the answers to commands: the next cycle may be minutes away.
    #[cold]
    #[inline(never)]
    pub(super) fn tell_the_rest(&mut self, io: &mut impl ControllerIo<Self>) {
        while let Some(event) = self.cycle.untold() {
            self.tell(event.into(), io);
        }
    }

    /// The bus is searched anew, also where a zeroing out of the loop has failed: what the loop knew of the hand is no
    /// longer asked for.
    pub(super) fn suspend_hand(&mut self) {
        self.hand.suspend();
        self.late = None;
        self.hand_temperatures = [None; 4];
    }
}
