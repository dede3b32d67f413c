//! The slots of a control cycle.

/// Slots of a control cycle: request, control, slow.
pub const CYCLE_SLOTS: u32 = 3;

/// Slots per second: the rate of the timer that calls [`Controller::slot`](crate::Controller::slot) (Hz).
pub const SLOT_HZ: u32 = CYCLE_SLOTS * control::RATE_HZ;

/// Time until all answers to the requests of a cycle have come (us): 1.03 ms on the bus with every stuff bit, and 75 us
/// in the pucks.
pub const ANSWERS_US: u32 = 1_105;
