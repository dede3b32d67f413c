//! defmt over semihosting to QEMU's standard error: the standard streams in and out belong to the simulator.
//!
//! Read it with `defmt-print -e IMAGE`. A message is gathered in memory and leaves as one write. Only tasks below
//! priority 10 log (never the slot or the CAN tasks), so masking those, instead of all interrupts, is enough and never
//! delays the control cycle.

use core::cell::UnsafeCell;

use cortex_m::register::{basepri, basepri_max};
use heapless::Vec;
use semihosting::fd::{AsFd, OwnedFd};
use semihosting::sys;
use semihosting::sys::arm_compat::{OpenMode, sys_open};

use super::clock;
use super::device::{NVIC_PRIO_BITS, PERIPHERAL_HZ};

/// Highest logical priority that may log.
const HIGHEST_LOGGING: u8 = 9;

/// Bytes of one message; the rest of a longer one is lost.
const MESSAGE_BYTES: usize = 256;

#[defmt::global_logger]
struct Logger;

struct State {
    stream: Option<OwnedFd>,
    encoder: defmt::Encoder,
    message: Vec<u8, MESSAGE_BYTES>,
    /// Mask to restore when the message is complete.
    mask: u8,
}

struct Shared(UnsafeCell<State>);

// SAFETY: `State` is touched between `acquire` and `release` only, where every other task that logs is masked, and by
// `start`, before any task runs.
unsafe impl Sync for Shared {}

static STATE: Shared =
    Shared(UnsafeCell::new(State { stream: None, encoder: defmt::Encoder::new(), message: Vec::new(), mask: 0 }));

/// Opens standard error. Without it messages are dropped.
pub(super) fn start() {
    let stream = sys_open(c":tt", OpenMode::WRONLY_APPEND_BINARY).ok();
    // SAFETY: called once at start-up, with interrupts masked.
    unsafe { (*STATE.0.get()).stream = stream };
}

// SAFETY: messages cannot interleave: see `Shared`.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        let mask = basepri::read();
        basepri_max::write(((1 << NVIC_PRIO_BITS) - HIGHEST_LOGGING) << (8 - NVIC_PRIO_BITS));
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *STATE.0.get() };
        state.mask = mask;
        state.message.clear();
        state.encoder.start_frame(|bytes| gather(&mut state.message, bytes));
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.end_frame(|bytes| gather(&mut state.message, bytes));
        if let Some(stream) = &state.stream {
            // A log that cannot be written must not stop an arm.
            let _ = sys::write(stream.as_fd(), &state.message);
        }
        let mask = state.mask;
        // SAFETY: restores the mask found by `acquire`, after the last use of the state.
        unsafe { basepri::write(mask) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *STATE.0.get() };
        state.encoder.write(bytes, |bytes| gather(&mut state.message, bytes));
    }
}

fn gather(message: &mut Vec<u8, MESSAGE_BYTES>, bytes: &[u8]) {
    for byte in bytes {
        let _ = message.push(*byte);
    }
}

defmt::timestamp!("{=u64:us}", clock::now() * 1_000_000 / u64::from(PERIPHERAL_HZ));
