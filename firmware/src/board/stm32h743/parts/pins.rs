//! Which pin carries what.

use embassy_stm32::Peri;
use embassy_stm32::gpio::{AfType, Flex, OutputType, Pin, Pull, Speed};
use embassy_stm32::peripherals::{PA11, PA12, PB5, PB6, PD0, PD1, PD8, PD9};

/// Alternate function of the CAN controllers on these pins.
pub(super) const CAN: u8 = 9;
/// Alternate function of USART3 on these pins.
const UART: u8 = 7;
/// Alternate function of the USB device on these pins.
const USB: u8 = 10;

/// The pins with a peripheral behind them.
pub(super) struct Pins {
    pub(super) arm_receive: Peri<'static, PD0>,
    pub(super) arm_transmit: Peri<'static, PD1>,
    pub(super) host_receive: Peri<'static, PB5>,
    pub(super) host_transmit: Peri<'static, PB6>,
    pub(super) uart_receive: Peri<'static, PD9>,
    pub(super) uart_transmit: Peri<'static, PD8>,
    pub(super) usb_minus: Peri<'static, PA11>,
    pub(super) usb_plus: Peri<'static, PA12>,
}

/// Gives the pins to their peripherals, for good.
pub(super) fn connect(pins: Pins) {
    // A transceiver that is not connected must read as an idle bus, not as a dominant one.
    let receive = AfType::input(Pull::Up);
    let transmit = AfType::output(OutputType::PushPull, Speed::High);
    connect_one(pins.arm_receive, CAN, receive);
    connect_one(pins.arm_transmit, CAN, transmit);
    connect_one(pins.host_receive, CAN, receive);
    connect_one(pins.host_transmit, CAN, transmit);
    connect_one(pins.uart_receive, UART, receive);
    connect_one(pins.uart_transmit, UART, transmit);
    let usb = AfType::output(OutputType::PushPull, Speed::VeryHigh);
    connect_one(pins.usb_minus, USB, usb);
    connect_one(pins.usb_plus, USB, usb);
}

fn connect_one(pin: Peri<'static, impl Pin>, function: u8, kind: AfType) {
    let mut pin = Flex::new(pin);
    pin.set_as_af_unchecked(function, kind);
    // Dropping it would disconnect the pin.
    core::mem::forget(pin);
}
