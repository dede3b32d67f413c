//! The board put together: clocks first, then protection, then the peripherals, then what the last start left behind.

mod clock;
mod crystal;
pub mod device;
mod faults;
mod fdcan;
mod flash;
mod host_can;
mod light;
mod logger;
mod own_oscillator;
mod panic_reason;
mod pins;
mod port;
mod protection;
mod reset;
mod serial_number;
mod settings;
mod slot_timer;
mod supply;
mod tree;
mod uart;
mod usb;
mod watchdog;

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_stm32::Peripherals;
use puck::CanFrame;

use super::constants::can;
use crate::board::Parts;

/// The end has begun.
static STOPPING: AtomicBool = AtomicBool::new(false);

/// The board.
pub struct SelectedBoard {
    light: light::StatusLight,
    serial: &'static str,
    host_bus: bool,
}

impl crate::board::Board for SelectedBoard {
    type Clock = clock::Clock;
    type SlotTimer = slot_timer::SlotTimer;
    type Can = fdcan::ArmBus;
    type LinkPort = port::Port;
    type StatusLight = light::StatusLight;
    type Flash = flash::Bank2;

    const NAME: &'static str = "nucleo-h743zi2";
    const SIMULATED: bool = false;

    fn start(mut core: cortex_m::Peripherals) -> Self {
        watchdog::start();
        let cause = reset::take_cause();
        protection::start(&mut core);
        clock::start();
        crystal::wait(cause.from_service);
        let peripherals: Peripherals = embassy_stm32::init(tree::config());
        tree::repair();
        clock::start();
        crystal::watch();
        reset::enter_start(&cause);
        logger::start();
        let light = light::StatusLight::new(peripherals.PB14);
        pins::connect(pins::Pins {
            arm_receive: peripherals.PD0,
            arm_transmit: peripherals.PD1,
            host_receive: peripherals.PB5,
            host_transmit: peripherals.PB6,
            uart_receive: peripherals.PD9,
            uart_transmit: peripherals.PD8,
            usb_minus: peripherals.PA11,
            usb_plus: peripherals.PA12,
        });
        let revision = tree::revision();
        let host_bus = can::bears_both(revision);
        fdcan::start(&mut core.NVIC, host_bus);
        uart::start(&mut core.NVIC);
        let serial = serial_number::read();
        usb::start(&mut core.NVIC, serial);
        defmt::info!("reset by {=str}", cause.words);
        panic_reason::tell();
        supply::tell();
        if !host_bus {
            defmt::warn!(
                "no second CAN bus: this chip is revision {=u16:#x}, see errata sheet ES0392 2.24.2",
                revision
            );
        }
        Self { light, serial, host_bus }
    }

    fn serial(&self) -> &'static str {
        self.serial
    }

    fn split(self) -> Parts<Self> {
        Parts {
            clock: clock::Clock,
            slot_timer: slot_timer::SlotTimer,
            can: fdcan::ArmBus::take(),
            link: port::new(self.host_bus),
            light: self.light,
            flash: flash::Bank2::take(),
        }
    }

    fn sleep() {
        settings::look();
        cortex_m::asm::wfi();
    }

    fn stop(frames: &[CanFrame], reason: core::fmt::Arguments<'_>) -> ! {
        // Once only: should anything below end here again, the watchdog ends that.
        if !STOPPING.swap(true, Ordering::Relaxed) {
            // All waits below are bounded by the clock and shorter than the watchdog's window, which begins anew here.
            watchdog::feed();
            // The frames go to the controller, which needs nobody to send them; the words are written meanwhile.
            fdcan::hand_over_last(frames);
            panic_reason::write(reason);
        }
        fdcan::wait_for_last(frames);
        reset::restart()
    }
}
