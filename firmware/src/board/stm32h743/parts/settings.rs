//! Settings of the chip, looked at again and again while nothing else is to be done.
//!
//! A register keeps what was written until a disturbance turns one of its bits over, and a loop may lose its lock:
//! nobody would be told, and the arm would be driven at another rate, or not hear its bus. So the first look at each
//! place keeps what is there, and every later one compares. The CAN controllers are brought back with what they were
//! told ([`Controller::look`](super::fdcan::Controller::look)). Anything else ends the image, because the start sets
//! everything anew; what has changed is in its last words.
//!
//! A few places at a time, whenever the processor goes to sleep: all of them within some 30 ms.

use core::sync::atomic::{AtomicU32, AtomicUsize, Ordering};

use super::super::constants::chip_settings::PLACES;
use super::SelectedBoard;
use super::fdcan::{ARM_CONTROLLER, HOST_CONTROLLER};
use crate::board::panic_stop;

/// Places compared at one visit.
const AT_ONCE: usize = 2;

/// The values that were there first.
static FOUND: [AtomicU32; PLACES.len()] = [const { AtomicU32::new(0) }; PLACES.len()];

/// Places compared so far. After a wrap some are kept anew.
static TURN: AtomicUsize = AtomicUsize::new(0);

/// Looks at the next few places. In the idle task alone, once the image is in service.
pub(super) fn look() {
    let turn = TURN.load(Ordering::Relaxed);
    TURN.store(turn.wrapping_add(AT_ONCE), Ordering::Relaxed);
    for turn in [turn, turn.wrapping_add(1)] {
        ARM_CONTROLLER.look(turn);
        HOST_CONTROLLER.look(turn);
        let number = turn % PLACES.len();
        let (Some(place), Some(found)) = (PLACES.get(number), FOUND.get(number)) else { continue };
        // SAFETY: a register of a peripheral that has its clock, or of the processor; reading changes none of them.
        let value = unsafe { (place.address as *const u32).read_volatile() } & place.mask;
        if turn < PLACES.len() {
            found.store(value, Ordering::Relaxed);
        } else if value != found.load(Ordering::Relaxed) {
            panic_stop::stop::<SelectedBoard>(format_args!(
                "a setting of the chip has changed: {value:#010x} at {:#010x}, set to {:#010x}",
                place.address,
                found.load(Ordering::Relaxed)
            ));
        }
    }
}
