//! The status light: the red light-emitting diode LD3.

use core::convert::Infallible;

use embassy_stm32::Peri;
use embassy_stm32::gpio::{Level, Output, Speed};
use embassy_stm32::peripherals::PB14;
use embedded_hal::digital::{ErrorType, OutputPin};

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
