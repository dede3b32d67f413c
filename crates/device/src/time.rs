//! The slots of a control cycle.

/// Slots of a control cycle: request, control, slow.
pub const CYCLE_SLOTS: u32 = 3;

/// Slots per second: the rate of the timer that calls [`Controller::slot`](crate::Controller::slot) (Hz).
pub const SLOT_HZ: u32 = CYCLE_SLOTS * control::RATE_HZ;
