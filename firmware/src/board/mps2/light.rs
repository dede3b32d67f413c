//! The status light: the board's first light-emitting diode.

use core::convert::Infallible;

use embedded_hal::digital::{ErrorType, OutputPin};

use super::device::LEDS;

/// The diode; QEMU keeps its register and shows it to nobody.
pub struct StatusLight;

impl ErrorType for StatusLight {
    type Error = Infallible;
}

impl OutputPin for StatusLight {
    fn set_low(&mut self) -> Result<(), Infallible> {
        LEDS.write(0);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        LEDS.write(1);
        Ok(())
    }
}
