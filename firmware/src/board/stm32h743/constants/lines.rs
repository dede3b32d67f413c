//! The lines to the host: a serial line through the ST-LINK, USB, and the second CAN bus (see `can`).

use super::clocks::UART_HZ;

/// Bits per second of the serial line, as the host opens it.
pub const BAUD: u32 = 921_600;

/// What the serial controller divides twice its clock by (eight samples a bit), rounded to the nearest: 921 659 bits per
/// second, 0.006 % fast. A receiver bears about 2 %.
pub const UART_DIVIDER: u32 = (2 * UART_HZ + BAUD / 2) / BAUD;

/// Bits of a byte on the serial line: start, eight, stop.
pub const BITS_PER_BYTE: u32 = 10;

/// Bytes the serial controller holds in each direction by itself: 174 us of a full line, which is how long its interrupt
/// may wait. It stands above every task, so it waits for masked interrupts only.
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
