//! The USB controller with nothing in its socket.
//!
//! Without a host there is no session, no reset and no enumeration on the bus, so no flag of the controller ever rises
//! and no interrupt comes: its registers keep what is written. The reset register, whose bits clear by themselves, is
//! the chip's model.

use rigless::device::Device;
use rigless::soc::stm32h743::generated::{otg1_hs_device, otg1_hs_pwrclk};

/// The registers of the device role.
#[derive(Debug, Default)]
pub struct DeviceRole;

impl Device for DeviceRole {
    type Register = otg1_hs_device::Register;
}

/// The register of power and clock gating.
#[derive(Debug, Default)]
pub struct PowerGate;

impl Device for PowerGate {
    type Register = otg1_hs_pwrclk::Register;
}
