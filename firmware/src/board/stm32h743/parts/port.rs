//! The line to the host: serial, USB and the second CAN bus behind one selector.

use super::host_can::HostCan;
use super::uart::Serial;
use super::usb::Usb;
use crate::board::line::LineSelector;

/// All three lines; the first that speaks is used.
pub(super) type Port = LineSelector<Serial, LineSelector<Usb, HostCan>>;

/// The lines, the serial one chosen until another is heard; `host_bus` tells whether the second CAN bus runs.
pub(super) fn new(host_bus: bool) -> Port {
    LineSelector::new(Serial, LineSelector::new(Usb, HostCan::new(host_bus)))
}
