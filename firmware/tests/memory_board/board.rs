//! A board of memory: its controller, line, light and flash belong to the simulator, its time to the test.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::rc::Rc;

use device::time::SLOT_HZ;
use embedded_can::nb;
use embedded_hal::digital::{ErrorType, OutputPin};
use firmware::board::{self, Board, CanStatus, LinkPort, Parts};
use flash::FlashPort;
use puck::CanFrame;
use sim::{TICKS_PER_SECOND, Ticks};

/// Ticks of one slot.
pub(crate) const SLOT_TICKS: Ticks = sim::period_ticks(SLOT_HZ);

/// Frames the controller takes before it says "would block".
const MAILBOXES: usize = 3;

thread_local! {
    /// Now, in this test.
    static NOW: Cell<Ticks> = const { Cell::new(0) };
}

/// Lets time pass.
pub(crate) fn set_now(now: Ticks) {
    NOW.set(now);
}

#[derive(Clone, Copy)]
pub(crate) struct Clock;

impl board::Clock for Clock {
    const HZ: u32 = TICKS_PER_SECOND as u32;

    fn ticks(self) -> u64 {
        NOW.get()
    }

    fn short_ticks(self) -> u32 {
        NOW.get() as u32
    }
}

/// State that would be registers.
#[derive(Default)]
pub(crate) struct Silicon {
    /// When the next slot begins; `None`: the timer stands still.
    pub(crate) next_slot: Option<Ticks>,
    /// Frames handed over that the bus has not taken yet.
    pub(crate) outgoing: VecDeque<CanFrame>,
    /// Frames on the bus that are not confirmed.
    pub(crate) waiting: usize,
    pub(crate) received: VecDeque<CanFrame>,
    pub(crate) from_host: VecDeque<u8>,
    pub(crate) to_host: Vec<u8>,
    pub(crate) light: bool,
}

pub(crate) type Shared = Rc<RefCell<Silicon>>;

pub(crate) struct SlotTimer(Shared);

impl board::SlotTimer for SlotTimer {
    fn start(&mut self) {
        self.0.borrow_mut().next_slot = Some(NOW.get() + 10 * SLOT_TICKS);
    }

    fn acknowledge(&mut self) -> u32 {
        0
    }

    fn is_due(&self) -> bool {
        false
    }
}

pub(crate) struct Can(Shared);

impl nb::Can for Can {
    type Frame = CanFrame;
    type Error = NoError;

    fn transmit(&mut self, frame: &CanFrame) -> ::nb::Result<Option<CanFrame>, NoError> {
        let mut silicon = self.0.borrow_mut();
        if silicon.waiting >= MAILBOXES {
            return Err(::nb::Error::WouldBlock);
        }
        silicon.waiting += 1;
        silicon.outgoing.push_back(*frame);
        Ok(None)
    }

    fn receive(&mut self) -> ::nb::Result<CanFrame, NoError> {
        self.0.borrow_mut().received.pop_front().ok_or(::nb::Error::WouldBlock)
    }
}

/// A bus without errors.
#[derive(Debug)]
pub(crate) enum NoError {}

impl embedded_can::Error for NoError {
    fn kind(&self) -> embedded_can::ErrorKind {
        match *self {}
    }
}

impl CanStatus for Can {
    fn waiting(&self) -> usize {
        self.0.borrow().waiting
    }

    fn overruns(&self) -> u32 {
        0
    }
}

pub(crate) struct Line(Shared);

impl LinkPort for Line {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let mut silicon = self.0.borrow_mut();
        let count = buffer.len().min(silicon.from_host.len());
        for (place, byte) in buffer.iter_mut().zip(silicon.from_host.drain(..count)) {
            *place = byte;
        }
        count
    }

    fn write(&mut self, bytes: &[u8]) {
        self.0.borrow_mut().to_host.extend_from_slice(bytes);
    }

    fn room(&self) -> usize {
        2048
    }
}

pub(crate) struct Light(Shared);

impl ErrorType for Light {
    type Error = Infallible;
}

impl OutputPin for Light {
    fn set_low(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().light = false;
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Infallible> {
        self.0.borrow_mut().light = true;
        Ok(())
    }
}

/// The board.
pub(crate) struct MemoryBoard {
    pub(crate) silicon: Shared,
    pub(crate) flash: FlashPort,
}

impl Board for MemoryBoard {
    type Clock = Clock;
    type SlotTimer = SlotTimer;
    type Can = Can;
    type LinkPort = Line;
    type StatusLight = Light;
    type Flash = FlashPort;

    const NAME: &'static str = "memory";
    const SIMULATED: bool = true;

    fn serial(&self) -> &'static str {
        "test"
    }

    fn split(self) -> Parts<Self> {
        let Self { silicon, flash } = self;
        Parts {
            clock: Clock,
            slot_timer: SlotTimer(silicon.clone()),
            can: Can(silicon.clone()),
            link: Line(silicon.clone()),
            light: Light(silicon),
            flash,
        }
    }

    fn sleep() {
        // The test calls the tasks: nothing interrupts.
    }

    fn stop(_frames: &[CanFrame], reason: core::fmt::Arguments<'_>) -> ! {
        panic!("{reason}")
    }
}
