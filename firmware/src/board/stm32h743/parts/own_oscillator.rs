//! Frames by the chip's own oscillator, for motors that hold the torque of an image whose 8 MHz have ended.
//!
//! Nothing else ends that torque but the safety module, when it misses the traffic. The oscillator is about 1 % off. A
//! motor follows a difference of up to 1.25 %: an edge comes every ten bits at least, and shifts the sample by one
//! quantum of eighty. So these frames usually arrive, and one that does not leaves everything as it was.
//!
//! Works in the state after a reset: core and buses run from that oscillator already.

use embassy_stm32::pac::gpio::vals::{Moder, Pupdr};
use embassy_stm32::pac::rcc::vals::{Fdcansel, Plldiv, Pllm, Plln, Pllrge, Pllsrc, Pllvcosel};
use embassy_stm32::pac::{GPIOD, RCC};
use puck::CanFrame;

use super::super::constants::clocks::{LOCK_US, PLL1_OF_HSI};
use super::{clock, fdcan, pins};

/// Pins of the arm's receiver and transmitter in port D.
const RECEIVE: usize = 0;
const TRANSMIT: usize = 1;

/// Sends these frames and takes the controller off the bus again. Afterwards only a restart makes the clocks what the
/// start-up expects.
pub(super) fn send(frames: &[CanFrame]) {
    if !run_loop() {
        return;
    }
    RCC.d2ccip1r().modify(|w| w.set_fdcansel(Fdcansel::PLL1_Q));
    RCC.ahb4enr().modify(|w| w.set_gpioden(true));
    // A clock that was just enabled reaches the peripheral two bus cycles later; reading back waits for that.
    RCC.ahb4enr().read();
    GPIOD.pupdr().modify(|w| w.set_pupdr(RECEIVE, Pupdr::PULL_UP));
    for pin in [RECEIVE, TRANSMIT] {
        GPIOD.afr(0).modify(|w| w.set_afr(pin, pins::CAN));
        GPIOD.moder().modify(|w| w.set_moder(pin, Moder::ALTERNATE));
    }
    fdcan::send_by_own_oscillator(frames);
}

/// Sets the loop up and waits for it; tells whether it has locked.
fn run_loop() -> bool {
    RCC.pllckselr().modify(|w| {
        w.set_pllsrc(Pllsrc::HSI);
        w.set_divm(0, Pllm::from_bits(PLL1_OF_HSI.input_divider as u8));
    });
    RCC.pllcfgr().modify(|w| {
        w.set_pllvcosel(0, Pllvcosel::WIDE_VCO);
        w.set_pllrge(0, Pllrge::RANGE8);
        w.set_divpen(0, false);
        w.set_divqen(0, true);
        w.set_divren(0, false);
    });
    RCC.plldivr(0).modify(|w| {
        w.set_plln(Plln::from_bits(PLL1_OF_HSI.multiplier as u16 - 1));
        w.set_pllq(Plldiv::from_bits(PLL1_OF_HSI.q.unwrap_or(1) as u8 - 1));
    });
    RCC.cr().modify(|w| w.set_pllon(0, true));
    clock::within_early(LOCK_US, || RCC.cr().read().pllrdy(0))
}
