//! The edge between the application and a board: what a board must offer, and the board this image is for.
//!
//! A board is one module below this one. It provides `SelectedBoard` (made once, at start-up), the module `device` for
//! RTIC (interrupts named by their *role*: `SLOT_TIMER`, `CAN_RECEIVE`, `CAN_TRANSMIT` and two lines for software
//! tasks), a defmt logger, and [`Board::stop`] for the end. The binaries name nothing else.

use embedded_can::nb;
use embedded_hal::digital::OutputPin;
use embedded_storage_async::nor_flash::NorFlash;
use puck::CanFrame;

pub mod line;
#[cfg(target_os = "none")]
pub mod panic_stop;

#[cfg(all(target_os = "none", feature = "board-mps2"))]
mod mps2;
#[cfg(all(target_os = "none", feature = "board-mps2"))]
pub use mps2::{SelectedBoard, device};

pub mod stm32h743;
#[cfg(all(target_os = "none", feature = "board-stm32h743"))]
pub use stm32h743::{SelectedBoard, device};

/// Everything a board offers at start-up.
pub trait Board: Sized {
    /// See [`Clock`].
    type Clock: Clock;
    /// See [`SlotTimer`].
    type SlotTimer: SlotTimer;
    /// The controller of the arm's bus. Its interrupts are `CAN_RECEIVE` (a frame arrived) and `CAN_TRANSMIT` (there is
    /// room for another frame).
    type Can: nb::Can<Frame = CanFrame> + CanStatus;
    /// See [`LinkPort`].
    type LinkPort: LinkPort;
    /// Lit while the supervisor lets torque through: people beside the arm see it before they touch it.
    type StatusLight: OutputPin;
    /// The flash in which the device keeps its library, and nothing else: address 0 is the first byte of that region.
    /// Its operations are awaited in the idle task alone, where they may take as long as they like; they must not mask
    /// interrupts meanwhile.
    type Flash: NorFlash;

    /// Name for people, e.g. "mps2-an500".
    const NAME: &'static str;
    /// A board that is only simulated must not be mistaken for an arm.
    const SIMULATED: bool;

    /// Sets up clocks and peripherals. Call once, with interrupts masked; nothing fires before they are unmasked.
    #[cfg(target_os = "none")]
    fn start(core: cortex_m::Peripherals) -> Self;

    /// Serial number, which tells this board from others of its kind.
    fn serial(&self) -> &'static str;

    /// The peripherals, for the tasks that own them.
    fn split(self) -> Parts<Self>;

    /// Rests a processor that has nothing to do: sleeps until the next interrupt, or only a moment. Called with
    /// interrupts unmasked.
    fn sleep();

    /// The end: sends these frames, waits until they are on the bus as far as the bus allows, says why, and stops or
    /// restarts the processor. Called with interrupts masked, from anywhere, perhaps in the middle of a transfer.
    fn stop(frames: &[CanFrame], reason: core::fmt::Arguments<'_>) -> !;
}

/// The peripherals of a board, each for the task that owns it.
pub struct Parts<B: Board> {
    /// Time.
    pub clock: B::Clock,
    /// The timer that makes the slots.
    pub slot_timer: B::SlotTimer,
    /// The arm's bus.
    pub can: B::Can,
    /// The line to the host.
    pub link: B::LinkPort,
    /// The status light.
    pub light: B::StatusLight,
    /// The library's flash.
    pub flash: B::Flash,
}

/// Time since start-up.
pub trait Clock: Copy {
    /// Ticks per second.
    const HZ: u32;

    /// Instructions that the processor executes per tick, where time is counted in instructions; 0 where a clock runs.
    const INSTRUCTIONS_PER_TICK: u8 = 0;

    /// Ticks since start-up.
    fn ticks(self) -> u64;

    /// Ticks since start-up, modulo 2^32: one register read, to measure short spans in the control task.
    fn short_ticks(self) -> u32;

    /// Microseconds since start-up.
    fn now_us(self) -> u64 {
        // Whole seconds first: multiplying all ticks by a million would overflow 64 bits within days.
        let (ticks, per_second) = (self.ticks(), u64::from(Self::HZ));
        ticks / per_second * 1_000_000 + ticks % per_second * 1_000_000 / per_second
    }
}

/// The 900 Hz timer that makes three slots of a control cycle. Its interrupt is `SLOT_TIMER`.
pub trait SlotTimer {
    /// Starts the timer: the first slot comes at least one period from now.
    fn start(&mut self);

    /// Takes the interrupt back and returns how long ago the slot began, ticks of [`Clock`].
    fn acknowledge(&mut self) -> u32;

    /// True if the next slot has already begun.
    fn is_due(&self) -> bool;
}

/// The state of a CAN controller, and its counts of frames.
pub trait CanStatus {
    /// Once a control cycle: brings a controller back that takes no part in the bus, and counts that as leaving it.
    fn tend(&mut self) {
        // A controller that cannot leave the bus needs nobody.
    }

    /// Frames handed over that have not been on the wire yet.
    fn waiting(&self) -> usize;

    /// Received frames lost because nobody fetched them in time, since start-up.
    fn overruns(&self) -> u32;

    /// Times the controller left the bus because of errors, or took no part in it any more, since start-up. It comes
    /// back by itself.
    fn bus_offs(&self) -> u32 {
        // A controller that cannot leave the bus never does.
        0
    }
}

/// The byte stream to the host.
pub trait LinkPort {
    /// Moves received bytes into `buffer`, and returns how many. Bytes for which the board had no room are missing: the
    /// message they belong to fails its check sum, and the host repeats it.
    fn read(&mut self, buffer: &mut [u8]) -> usize;

    /// Sends bytes in order, at most [`Self::room`].
    fn write(&mut self, bytes: &[u8]);

    /// Bytes that can be sent now.
    fn room(&self) -> usize;
}

/// Stack of the image: painted at start-up, so that its deepest use can be seen later.
#[cfg(target_os = "none")]
pub mod stack {
    /// Bytes reserved for the stack.
    #[must_use]
    pub fn size() -> u32 {
        cortex_m_stack::stack_size()
    }

    /// Bytes never used so far. Reads all of the free stack: costs two instructions a word, at low priority only.
    #[must_use]
    pub fn never_used() -> u32 {
        cortex_m_stack::stack_painted()
    }
}
