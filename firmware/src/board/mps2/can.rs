//! The simulated CAN controller: three transmit mailboxes, a receive FIFO, two interrupt lines.
//!
//! Frames leave in the order in which they were handed over (`docs/lockstep.md`). What silicon would do by itself is
//! done here by the interrupt `BUS_WIRE`, above every task: it fires at the very tick at which a frame has left
//! the wire.

use core::cell::RefCell;
use core::convert::Infallible;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use heapless::Deque;
use puck::CanFrame;

use super::clock;
use super::device::{Interrupt, NVIC_PRIO_BITS, TIMER1, Timer};
use super::link_buffer::Buffer;
use super::lockstep::{FlashReply, FlashRequest, Gone, Reply, Request, Wire};
use crate::board::CanStatus;

/// Logical priority of `BUS_WIRE`: above every task (the highest has 12), as silicon would be.
const WIRE_PRIORITY: u8 = 14;

/// Frames the controller takes before it says "would block". Small, as in real controllers without a queue, so that
/// the interrupt-driven path is used in every test.
const MAILBOXES: usize = 3;

/// Received frames the controller holds. `CAN_RECEIVE` may wait for the longest control slot, 0.5 ms: 9 shortest
/// frames of the bus; 16 leaves room.
const FIFO_DEPTH: usize = 16;

/// Time for the last frames, ticks: 3 ms, enough for 20 frames in front of them.
const LAST_FRAMES_TIME: u64 = 75_000;

static CONTROLLER: Mutex<RefCell<Option<Controller>>> = Mutex::new(RefCell::new(None));

/// The simulated silicon.
pub(super) struct Controller {
    wire: Wire,
    /// Tick of the next event on the bus.
    next: u64,
    waiting: usize,
    received: Deque<CanFrame, FIFO_DEPTH>,
    overruns: u32,
    /// Bytes from the host travel on the same wire.
    pub(super) link: Buffer,
}

impl Controller {
    /// Tells the simulator something that happens now.
    pub(super) fn tell(&mut self, request: &Request<'_>) {
        // What happened on the bus before now comes first: time on the wire never runs backwards.
        let now = clock::now();
        while self.next <= now {
            self.exchange(self.next, &Request::Event);
        }
        self.exchange(now, request);
        self.arm();
    }

    /// Asks something of the flash, which lives on the same wire; bytes it hands over fill `sink`.
    pub(super) fn flash(&mut self, request: FlashRequest<'_>, sink: &mut [u8]) -> FlashReply {
        let now = clock::now();
        while self.next <= now {
            self.exchange(self.next, &Request::Event);
        }
        let Ok(reply) = self.wire.exchange_into(now, &Request::Flash(request), sink) else {
            panic!("the simulator is gone");
        };
        self.take(&reply);
        self.arm();
        reply.flash
    }

    fn event(&mut self) {
        // Exactly the scheduled time, however late the interrupt is.
        while self.next <= clock::now() {
            self.exchange(self.next, &Request::Event);
        }
        self.arm();
    }

    fn exchange(&mut self, time: u64, request: &Request<'_>) {
        match self.wire.exchange(time, request) {
            Ok(reply) => self.take(&reply),
            Err(Gone) => panic!("the simulator is gone"),
        }
    }

    fn take(&mut self, reply: &Reply) {
        self.next = reply.next;
        if reply.transmitted {
            self.waiting = self.waiting.saturating_sub(1);
            NVIC::pend(Interrupt::CAN_TRANSMIT);
        }
        if let Some(frame) = reply.received {
            if self.received.push_back(frame).is_err() {
                self.overruns = self.overruns.wrapping_add(1);
            }
            NVIC::pend(Interrupt::CAN_RECEIVE);
        }
        self.link.take(reply.link());
    }

    /// Sets timer 1 to the next event.
    fn arm(&self) {
        TIMER1.control.write(Timer::STOP);
        TIMER1.interrupt.write(1);
        if self.next == u64::MAX {
            return;
        }
        // An event beyond the timer's 171 s makes it fire early, which finds nothing due and arms it again.
        let ticks = self.next.saturating_sub(clock::now()).clamp(2, u64::from(u32::MAX)) as u32;
        TIMER1.reload.write(ticks - 1);
        TIMER1.value.write(ticks - 1);
        TIMER1.control.write(Timer::RUN);
    }
}

/// Connects to the simulator and lets the wire interrupt.
pub(super) fn start(nvic: &mut NVIC) {
    let Ok(wire) = Wire::open() else {
        panic!("no semihosting: start QEMU with -semihosting-config enable=on");
    };
    let controller =
        Controller { wire, next: u64::MAX, waiting: 0, received: Deque::new(), overruns: 0, link: Buffer::new() };
    critical_section::with(|section| CONTROLLER.borrow_ref_mut(section).replace(controller));
    let level = ((1 << NVIC_PRIO_BITS) - WIRE_PRIORITY) << (8 - NVIC_PRIO_BITS);
    // SAFETY: the priority is above every RTIC ceiling, and the handler shares nothing with RTIC's resources.
    unsafe {
        nvic.set_priority(Interrupt::BUS_WIRE, level);
        NVIC::unmask(Interrupt::BUS_WIRE);
    }
    // The first exchange tells the simulator that the image lives, and learns when the bus first does something.
    with(|controller| controller.tell(&Request::Event));
}

/// Runs `action` on the silicon, nothing in between.
pub(super) fn with<T>(action: impl FnOnce(&mut Controller) -> T) -> T {
    critical_section::with(|section| match &mut *CONTROLLER.borrow_ref_mut(section) {
        Some(controller) => action(controller),
        None => panic!("the CAN controller is used before it is started"),
    })
}

/// Timer 1: something happens on the bus.
#[unsafe(no_mangle)]
extern "C" fn BUS_WIRE() {
    with(Controller::event);
}

/// The controller as the tasks see it.
pub struct Can;

impl embedded_can::nb::Can for Can {
    type Frame = CanFrame;
    type Error = Infallible;

    /// Waiting frames are never replaced: with three mailboxes and a queue behind them, order matters more.
    fn transmit(&mut self, frame: &CanFrame) -> nb::Result<Option<CanFrame>, Infallible> {
        with(|controller| {
            if controller.waiting >= MAILBOXES {
                return Err(nb::Error::WouldBlock);
            }
            controller.waiting += 1;
            controller.tell(&Request::Send(frame));
            Ok(None)
        })
    }

    fn receive(&mut self) -> nb::Result<CanFrame, Infallible> {
        with(|controller| controller.received.pop_front().ok_or(nb::Error::WouldBlock))
    }
}

impl CanStatus for Can {
    fn waiting(&self) -> usize {
        with(|controller| controller.waiting)
    }

    fn overruns(&self) -> u32 {
        with(|controller| controller.overruns)
    }
}

/// Sends frames with interrupts masked, and lets the bus run for 3 ms.
///
/// Opens the wire anew: the panic that led here may have come from inside the controller. If it came from the wire
/// itself there is nobody to talk to. For the same reason nobody knows how many frames are in front of these, so the
/// time is fixed.
pub(super) fn send_last(frames: &[CanFrame]) {
    TIMER1.control.write(Timer::STOP);
    let _ = speak_last(frames);
}

fn speak_last(frames: &[CanFrame]) -> Result<(), Gone> {
    let mut wire = Wire::open()?;
    let mut next = u64::MAX;
    for frame in frames {
        next = wire.exchange(clock::now(), &Request::Send(frame))?.next;
    }
    let end = clock::now() + LAST_FRAMES_TIME;
    while clock::now() < end {
        if next <= clock::now() {
            next = wire.exchange(next, &Request::Event)?.next;
        }
    }
    wire.exchange(clock::now(), &Request::Bye)?;
    Ok(())
}
