//! The lines to the host: a serial line through the ST-LINK, USB, and the second CAN bus (see `can`).

use super::clocks::UART_HZ;

/// Bits per second of the serial line, as the host opens it.
pub const BAUD: u32 = 921_600;

/// True if the serial controller takes eight samples of a bit (OVER8) instead of sixteen. With eight it divides twice
/// its clock, but its register has no place for the lowest bit of the divider: odd dividers are one too small. 48 MHz
/// is enough for sixteen samples, and with those every divider from 16 on fits.
pub const UART_EIGHT_SAMPLES: bool = false;

/// Baud rate register of the serial controller: what it divides its clock by, rounded to the nearest. 48 MHz / 52 =
/// 923 077 bits per second, 0.16 % fast. A receiver bears about 2 %.
pub const UART_BRR: u16 = ((UART_HZ + BAUD / 2) / BAUD) as u16;

/// Bits of a byte on the serial line: start, eight, stop.
pub const BITS_PER_BYTE: u32 = 10;

/// Bytes the serial controller holds in each direction by itself: 174 us of a full line, which is how long its
/// interrupt may wait. It stands above every task, so it waits for masked interrupts only.
pub const UART_FIFO_BYTES: u32 = 16;

/// Bytes received and not yet fetched, for each of the serial line and USB: 11 ms of a full serial line.
pub const RECEIVE_BYTES: usize = 1024;

/// Bytes waiting to be sent, likewise: 22 ms of a full serial line, several of the longest messages.
pub const TRANSMIT_BYTES: usize = 2048;

/// Who the USB device says it is: the test vendor and product identifiers of pid.codes, which anyone may use in a
/// laboratory and nobody may sell.
pub const USB_VENDOR: u16 = 0x1209;
/// See [`USB_VENDOR`].
pub const USB_PRODUCT: u16 = 0x0001;

/// Words of the USB controller's packet memory (4 KiB).
pub const USB_FIFO_WORDS: usize = 1024;

/// Endpoints of the USB controller in each direction.
pub const USB_ENDPOINTS: usize = 9;
