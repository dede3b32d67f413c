//! Why the chip started: read once, then forgotten by the chip.

use embassy_stm32::pac::RCC;

/// What made the chip start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Cause {
    /// Power came, or fell too low for a while.
    Power,
    /// The watchdog: no slot had begun for 10 ms.
    Watchdog,
    /// The image itself: after its last words.
    Software,
    /// The reset button or a debugger.
    Pin,
    /// None of the causes the chip tells apart.
    Unknown,
}

impl Cause {
    /// For people.
    pub(super) const fn words(self) -> &'static str {
        match self {
            Self::Power => "power",
            Self::Watchdog => "the watchdog: no control slot had begun for 10 ms",
            Self::Software => "the image itself",
            Self::Pin => "the reset button or a debugger",
            Self::Unknown => "an unknown cause",
        }
    }
}

/// Reads the cause and clears it, so that the next start tells its own.
pub(super) fn take_cause() -> Cause {
    let flags = RCC.rsr().read();
    RCC.rsr().modify(|w| w.set_rmvf(true));
    // Every reset also pulls the reset pin, and power also reports brown-out: the most telling cause first.
    if flags.iwdg1rstf() || flags.wwdg1rstf() {
        Cause::Watchdog
    } else if flags.sftrstf() {
        Cause::Software
    } else if flags.porrstf() || flags.borrstf() {
        Cause::Power
    } else if flags.pinrstf() {
        Cause::Pin
    } else {
        Cause::Unknown
    }
}
