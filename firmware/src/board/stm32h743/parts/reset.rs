//! Why the chip started: what the chip says, and how far the image was when it happened.
//!
//! The chip cannot tell a restart that the image asked for from one that a debug probe asked for, nor where the
//! watchdog met the image. So the image notes its phase in memory that a restart keeps. After power came that memory
//! holds anything, but then the chip says so, and the phase is not looked at.

use core::cell::UnsafeCell;
use core::mem::MaybeUninit;

use cortex_m::peripheral::SCB;
use embassy_stm32::pac::RCC;

/// Progress of the image; numbers that memory holds by chance once in a billion times.
#[derive(Clone, Copy)]
#[repr(u32)]
pub(super) enum Phase {
    /// The clock tree is being set up.
    Clocks = 0x5441_0001,
    /// Everything else up to the first slot.
    Start = 0x5441_0002,
    /// Slots come.
    Service = 0x5441_0003,
    /// The last words are told and a restart was asked for.
    End = 0x5441_0004,
    /// The 8 MHz are waited for, and the bus was told so if anybody can have been left with a torque.
    Waiting = 0x5441_0005,
    /// As [`Phase::Clocks`], behind a service: a motor may still hold a torque.
    ClocksAfterService = 0x5441_0006,
    /// As [`Phase::Start`], likewise.
    StartAfterService = 0x5441_0007,
}

struct Place(UnsafeCell<MaybeUninit<u32>>);

// SAFETY: one word, written and read volatile and whole.
unsafe impl Sync for Place {}

/// Not cleared by a start.
#[unsafe(link_section = ".uninit.phase")]
static PHASE: Place = Place(UnsafeCell::new(MaybeUninit::uninit()));

/// The image has come so far.
pub(super) fn enter(phase: Phase) {
    // SAFETY: see `Place`.
    unsafe { PHASE.0.get().cast::<u32>().write_volatile(phase as u32) };
}

/// The phase in the memory, or whatever the memory holds.
fn phase() -> u32 {
    // SAFETY: see `Place`; every bit pattern is a number.
    unsafe { PHASE.0.get().cast::<u32>().read_volatile() }
}

/// Restarts the chip, so that the next start knows that the image wanted it.
pub(super) fn restart() -> ! {
    if phase() != Phase::Waiting as u32 {
        enter(Phase::End);
    }
    cortex_m::asm::dsb();
    SCB::sys_reset()
}

/// The cause of a start.
pub(super) struct Cause {
    /// For people.
    pub(super) words: &'static str,
    /// Power has been there all the time, and the image was in service, at its end, or in a start behind one of these
    /// that was reset before it told anybody: a motor may hold a torque.
    pub(super) from_service: bool,
}

/// The clock tree runs, in a start of this cause.
pub(super) fn enter_start(cause: &Cause) {
    enter(if cause.from_service { Phase::StartAfterService } else { Phase::Start });
}

/// Takes what made the chip start, and begins the first phase. Called first of all, once.
pub(super) fn take_cause() -> Cause {
    const OWED: [Phase; 4] = [Phase::Service, Phase::End, Phase::ClocksAfterService, Phase::StartAfterService];
    let phase = phase();
    let flags = RCC.rsr().read();
    // Every reset also pulls the reset pin, and power also reports brown-out: the most telling cause first.
    let has_power = !(flags.porrstf() || flags.borrstf());
    let from_service = has_power && OWED.iter().any(|owed| *owed as u32 == phase);
    enter(if from_service { Phase::ClocksAfterService } else { Phase::Clocks });
    // So that the next start tells its own. Behind the phase, which without these flags would be believed.
    RCC.rsr().modify(|w| w.set_rmvf(true));
    let words = if flags.iwdg1rstf() || flags.wwdg1rstf() {
        by_watchdog(phase)
    } else if flags.sftrstf() {
        if phase == Phase::End as u32 || phase == Phase::Waiting as u32 { "the image itself" } else { "a debug probe" }
    } else if flags.porrstf() || flags.borrstf() {
        "power"
    } else if flags.pinrstf() {
        "the reset pin: button or debug probe"
    } else {
        "an unknown cause"
    };
    Cause { words, from_service }
}

/// Where the watchdog met the image.
fn by_watchdog(phase: u32) -> &'static str {
    const CLOCKS: u32 = Phase::Clocks as u32;
    const CLOCKS_AGAIN: u32 = Phase::ClocksAfterService as u32;
    const START: u32 = Phase::Start as u32;
    const START_AGAIN: u32 = Phase::StartAfterService as u32;
    const SERVICE: u32 = Phase::Service as u32;
    const END: u32 = Phase::End as u32;
    match phase {
        CLOCKS | CLOCKS_AGAIN => "the watchdog: the clock tree did not run after 512 ms",
        START | START_AGAIN => "the watchdog: no control slot had begun 512 ms after the start",
        SERVICE => "the watchdog: no control slot had begun for 10 ms",
        END => "the watchdog, at the end of the image",
        _ => "the watchdog",
    }
}
