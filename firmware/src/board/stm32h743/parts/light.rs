//! The status light: the red light-emitting diode LD3.

use core::convert::Infallible;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::pac::gpio::vals::Moder;
use embassy_stm32::pac::{GPIOB, RCC};
use embassy_stm32::peripherals::PB14;
use embedded_hal::digital::{ErrorType, OutputPin};

/// Number of the diode's pin in its port.
const PIN: usize = 14;

/// Switches it before the board's peripherals are handed out.
pub(super) fn before_all(lit: bool) {
    RCC.ahb4enr().modify(|w| w.set_gpioben(true));
    // A clock that was just enabled reaches the peripheral two bus cycles later; reading back waits for that.
    RCC.ahb4enr().read();
    GPIOB.bsrr().write(|w| if lit { w.set_bs(PIN, true) } else { w.set_br(PIN, true) });
    GPIOB.moder().modify(|w| w.set_moder(PIN, Moder::OUTPUT));
}

/// The diode.
pub struct StatusLight(Output<'static>);

impl StatusLight {
    /// Dark.
    pub(super) fn new(pin: Peri<'static, PB14>) -> Self {
        Self(Output::new(pin, Level::Low, Speed::Low))
    }
}

impl ErrorType for StatusLight {
    type Error = Infallible;
}

impl OutputPin for StatusLight {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.set_low();
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.set_high();
        Ok(())
    }
}
