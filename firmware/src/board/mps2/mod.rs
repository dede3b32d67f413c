//! QEMU's `mps2-an500` (Cortex-M7) with a CAN controller and a host link that live in the simulator.
//!
//! The machine has no CAN controller. What would be silicon on a real board is here an interrupt above all others
//! (`can`), which exchanges frames with the simulator in lock step by semihosting (`lockstep`): virtual time stands
//! still while the simulator computes, and frames arrive at exact virtual times. The address map and the lines of the
//! peripherals are those of Arm's application notes AN385 and AN500, as QEMU models them.

mod can;
mod clock;
pub mod device;
mod flash;
mod light;
mod link;
mod link_buffer;
mod lockstep;
mod logger;
mod slot_timer;

use cortex_m_rt::{ExceptionFrame, exception};
use puck::CanFrame;
use semihosting::io::Write;
use semihosting::process::ExitCode;

use super::{Parts, panic_stop};

/// The board.
pub struct SelectedBoard(());

impl super::Board for SelectedBoard {
    type Clock = clock::Clock;
    type SlotTimer = slot_timer::SlotTimer;
    type Can = can::Can;
    type LinkPort = link::Port;
    type StatusLight = light::StatusLight;
    type Flash = flash::Flash;

    const NAME: &'static str = "mps2-an500";
    const SIMULATED: bool = true;

    fn start(mut core: cortex_m::Peripherals) -> Self {
        clock::start();
        logger::start();
        can::start(&mut core.NVIC);
        Self(())
    }

    fn serial(&self) -> &'static str {
        "qemu"
    }

    fn split(self) -> Parts<Self> {
        Parts {
            clock: clock::Clock,
            slot_timer: slot_timer::SlotTimer,
            can: can::Can,
            link: link::Port::new(),
            light: light::StatusLight,
            flash: flash::Flash,
        }
    }

    fn sleep() {
        // QEMU's other thread moves virtual time on to the next timer as soon as the core is halted. On a busy machine
        // it may do so before the core's thread has accounted for what it executed since it last looked at the time, by
        // which the timer then is late. So the core looks at the time right before it halts; masked, so that no task
        // comes between the two.
        #[cfg(feature = "wfi")]
        cortex_m::interrupt::free(|_| {
            clock::synchronise();
            cortex_m::asm::wfi();
        });
        #[cfg(not(feature = "wfi"))]
        cortex_m::asm::nop();
    }

    fn stop(frames: &[CanFrame], reason: core::fmt::Arguments<'_>) -> ! {
        // Frames first: words can wait, motors cannot.
        can::send_last(frames);
        if let Ok(mut words) = semihosting::io::stderr() {
            // Plain text between the binary log frames; nothing is left to do if stderr is gone.
            let _ = writeln!(words, "\n{reason}");
        }
        ExitCode::FAILURE.exit_process()
    }
}

/// QEMU's stack has no guard and can always be read.
#[exception]
unsafe fn HardFault(frame: &ExceptionFrame) -> ! {
    panic_stop::after_hard_fault::<SelectedBoard>(core::ptr::from_ref(frame).addr() as u32, Some(frame))
}
