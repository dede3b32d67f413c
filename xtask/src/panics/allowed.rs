//! The places where an image may panic, each with the reason why nothing from outside gets it there.
//!
//! Whatever panics all the same ends like every fault of the image: zero torques and idle to arm and hand, the reason
//! kept, restart (`firmware/src/board/panic_stop.rs`); on the emulated board the image ends.

use super::kind::Kind;
use crate::board::Board;

/// Code that may panic.
pub(super) struct Allowed {
    /// A crate, a module or a function: everything below it.
    pub(super) who: &'static str,
    /// In which ways.
    pub(super) kinds: &'static [Kind],
    /// In the images for this board only, if it is one's own code.
    pub(super) board: Option<Board>,
    /// Why it does not happen, or what it means if it does.
    pub(super) why: &'static str,
}

impl Allowed {
    /// True if it is about this function.
    pub(super) fn covers(&self, function: &str, kind: Kind, board: Board) -> bool {
        let below = function.strip_prefix(self.who).is_some_and(|rest| rest.is_empty() || rest.starts_with("::"));
        below && self.kinds.contains(&kind) && self.board.is_none_or(|only| only == board)
    }
}

const fn row(who: &'static str, kinds: &'static [Kind], why: &'static str) -> Allowed {
    Allowed { who, kinds, board: None, why }
}

const fn emulated(who: &'static str, kinds: &'static [Kind], why: &'static str) -> Allowed {
    Allowed { who, kinds, board: Some(Board::Mps2), why }
}

const fn real(who: &'static str, kinds: &'static [Kind], why: &'static str) -> Allowed {
    Allowed { who, kinds, board: Some(Board::Stm32h743), why }
}

use Kind::{Abort, Borrow, Division, Index, Message, Resumed, Unwrap};

/// Our own code: single modules, for single reasons. Anything else in it fails the build.
const OURS: &[Allowed] = &[
    row("dmp::scalar::kernels", &[Index], "2 <= count <= N kernels by the constructor: every slice of them exists"),
    row("control::act::limit", &[Index], "a group is a constant list of motors"),
    row("device::storage", &[Resumed], "each is awaited once, by the library's task, which never ends"),
    row("hand::image::ImageReader::real", &[Division], "a header with fewer than two kernels is refused"),
    row("arm::app", &[Resumed], "RTIC makes a task anew each time it is spawned"),
    row("hand::app", &[Resumed], "RTIC makes a task anew each time it is spawned"),
];

/// The boards' code below the application.
const BOARDS: &[Allowed] = &[
    row("Reset", &[Abort], "behind `main`, which does not return"),
    emulated(
        "device::startup::Startup::perform",
        &[Division],
        "the ring of a heapless::spsc queue, inlined: its length is a constant; the compiler merged two such places",
    ),
    emulated("firmware::board::mps2", &[Message], "the simulator is gone, or was never there: the image ends"),
    emulated("firmware::board::mps2", &[Resumed], "each is awaited once, by the library's task"),
    emulated(
        "firmware::application::slot",
        &[Borrow, Message],
        "the emulated controller's lock (`can::with`), three of its uses joined by the compiler",
    ),
    emulated("semihosting", &[Message], "files of QEMU's own; printing the last words"),
    real("firmware::board::stm32h743", &[Resumed], "each is awaited once, by the library's task"),
    real(
        "embassy_stm32",
        &[Message, Unwrap, Division],
        "the clock tree at start-up, before the bus: constants, the same at each start",
    ),
    real("stm32_metapac", &[Message], "places in the message memory: the layout's constants and a six-bit index"),
];

/// Other people's.
const DEPENDENCIES: &[Allowed] = &[
    row("cobs", &[Index], "a block is read only after its end was found to be inside the frame"),
    row(
        "heapless::spsc",
        &[Division],
        "a queue has room by its constructor; its two ends know its length at run time only (a view, not `[T; N]`)",
    ),
    row("critical_section", &[Borrow], "borrowed with interrupts masked, by closures that borrow nothing else"),
    row("embedded_storage_async", &[Resumed], "each is awaited once, by the library's task"),
    row("sequential_storage", &[Resumed], "each is awaited once, by the library's task"),
    row(
        "sequential_storage",
        &[Index, Message, Unwrap],
        "lengths are held against page and buffer first; cuts and damage are tested in crates/device/tests/storage",
    ),
    real(
        "synopsys_usb_otg",
        &[Index, Borrow, Message, Unwrap],
        "a packet that does not fit its buffer is an error; numbers of endpoints are the chip's own; the memory of our four \
         endpoints is taken once, at the start, and every start is the same",
    ),
    real(
        "usb_device",
        &[Index, Borrow, Message, Unwrap],
        "our descriptors, smaller than its buffer; a packet that does not fit is an error",
    ),
    real("usbd_serial", &[Index, Message], "both ends of its buffer are held against its length first"),
];

/// All of them.
pub(super) fn all() -> impl Iterator<Item = &'static Allowed> {
    [OURS, BOARDS, DEPENDENCIES].into_iter().flatten()
}

/// Crates of ours that must not panic for any input.
pub(super) const LIBRARIES: [&str; 6] = ["dmp", "puck", "link", "control", "device", "hand"];

#[cfg(test)]
mod tests {
    use super::{Kind, all, real, row};
    use crate::board::Board;

    #[test]
    fn a_row_covers_what_is_below_it_and_nothing_beside() {
        let allowed = row("dmp::table", &[Kind::Index], "");
        assert!(allowed.covers("dmp::table", Kind::Index, Board::Mps2));
        assert!(allowed.covers("dmp::table::PhaseTable::at", Kind::Index, Board::Stm32h743));
        assert!(!allowed.covers("dmp::tables::at", Kind::Index, Board::Mps2));
        assert!(!allowed.covers("dmp::table::PhaseTable::at", Kind::Unwrap, Board::Mps2));
        assert!(!allowed.covers("dmp", Kind::Index, Board::Mps2));
        assert!(!real("usb_device", &[Kind::Index], "").covers("usb_device::poll", Kind::Index, Board::Mps2));
    }

    #[test]
    fn every_row_has_its_reason() {
        for allowed in all() {
            assert!(!allowed.why.is_empty() && !allowed.kinds.is_empty(), "{}", allowed.who);
        }
    }
}
