//! defmt over RTT: a buffer in memory that the debug probe reads while the processor runs.
//!
//! Not defmt-rtt, which masks *all* interrupts from the first to the last byte of a message, and the control slot with
//! them. Only tasks below priority 10 log (never the slot or the CAN tasks), so masking those is enough. A message for
//! which there is no room is lost, whole or in part, and the reader finds the next one by its frame mark: nobody ever
//! waits for a probe.

use core::cell::UnsafeCell;
use core::sync::atomic::{AtomicU32, Ordering, compiler_fence};

use cortex_m::register::{basepri, basepri_max};

use super::super::constants::timers::CLOCK_HZ;
use super::clock;
use super::device::level;

/// Highest logical priority that may log.
const HIGHEST_LOGGING: u8 = 9;

/// Bytes kept for the probe: it looks a few hundred times a second, and a start-up tells about 1 kB.
const BUFFER_BYTES: usize = 4096;

/// Channel flag: skip what does not fit.
const SKIP: u32 = 0;

/// The block that the probe searches for in memory.
#[repr(C)]
struct ControlBlock {
    id: [u8; 16],
    up_channels: u32,
    down_channels: u32,
    name: *const u8,
    buffer: *mut u8,
    size: u32,
    /// Where the next byte goes; written by us.
    write: AtomicU32,
    /// Where the probe reads next; written by the probe.
    read: AtomicU32,
    flags: AtomicU32,
}

struct Buffer(UnsafeCell<[u8; BUFFER_BYTES]>);

// SAFETY: written between `acquire` and `release` only, where every other task that logs is masked.
unsafe impl Sync for Buffer {}

/// Not cached, not cleared: old bytes are never shown, because both positions start at 0.
#[unsafe(link_section = ".uninit.log")]
static BUFFER: Buffer = Buffer(UnsafeCell::new([0; BUFFER_BYTES]));

// SAFETY: the fields that change are atomic, the others are constant after `start`.
unsafe impl Sync for ControlBlock {}

/// The name by which probes and their tools find the block. Its identification is written at start-up, last of all:
/// what an earlier image left in memory, or the image in the flash, must not be mistaken for it.
#[unsafe(no_mangle)]
#[unsafe(link_section = ".uninit.log_control")]
static _SEGGER_RTT: Shared<ControlBlock> = Shared(UnsafeCell::new(ControlBlock {
    id: [0; 16],
    up_channels: 0,
    down_channels: 0,
    name: core::ptr::null(),
    buffer: core::ptr::null_mut(),
    size: 0,
    write: AtomicU32::new(0),
    read: AtomicU32::new(0),
    flags: AtomicU32::new(0),
}));

#[repr(transparent)]
struct Shared<T>(UnsafeCell<T>);

// SAFETY: the control block is written whole at start-up with interrupts masked; later only its atomics change. The
// encoder and the mask are touched between `acquire` and `release` only.
unsafe impl<T> Sync for Shared<T> {}

/// Name of the channel, by which readers know that it is defmt.
static NAME: [u8; 6] = *b"defmt\0";

static ENCODER: Shared<(defmt::Encoder, u8)> = Shared(UnsafeCell::new((defmt::Encoder::new(), 0)));

/// Makes the channel known. Called once, at start-up.
pub(super) fn start() {
    let block = ControlBlock {
        id: [0; 16],
        up_channels: 1,
        down_channels: 0,
        name: NAME.as_ptr(),
        buffer: BUFFER.0.get().cast(),
        size: BUFFER_BYTES as u32,
        write: AtomicU32::new(0),
        read: AtomicU32::new(0),
        flags: AtomicU32::new(SKIP),
    };
    let place = _SEGGER_RTT.0.get();
    // SAFETY: see `Shared`.
    unsafe { place.write_volatile(block) };
    cortex_m::asm::dmb();
    // SAFETY: see `Shared`.
    unsafe { (&raw mut (*place).id).write_volatile(*b"SEGGER RTT\0\0\0\0\0\0") };
}

/// Copies bytes to the probe's buffer as far as they fit.
fn put(bytes: &[u8]) {
    // SAFETY: the block is constant but for its atomics since `start`.
    let block = unsafe { &*_SEGGER_RTT.0.get() };
    let mut write = block.write.load(Ordering::Relaxed) as usize;
    let read = block.read.load(Ordering::Relaxed) as usize;
    for byte in bytes {
        let next = if write + 1 >= BUFFER_BYTES { 0 } else { write + 1 };
        if next == read || write >= BUFFER_BYTES {
            break;
        }
        // SAFETY: `write` is inside the buffer; see `Buffer`.
        unsafe { BUFFER.0.get().cast::<u8>().add(write).write_volatile(*byte) };
        write = next;
    }
    // The bytes before the position that says that they are there.
    compiler_fence(Ordering::SeqCst);
    cortex_m::asm::dmb();
    block.write.store(write as u32, Ordering::Relaxed);
}

#[defmt::global_logger]
struct Logger;

// SAFETY: messages cannot interleave: between `acquire` and `release` every other task that logs is masked.
unsafe impl defmt::Logger for Logger {
    fn acquire() {
        let mask = basepri::read();
        basepri_max::write(level(HIGHEST_LOGGING));
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *ENCODER.0.get() };
        state.1 = mask;
        state.0.start_frame(put);
    }

    unsafe fn flush() {}

    unsafe fn release() {
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *ENCODER.0.get() };
        state.0.end_frame(put);
        let mask = state.1;
        // SAFETY: restores the mask found by `acquire`, after the last use of the state.
        unsafe { basepri::write(mask) };
    }

    unsafe fn write(bytes: &[u8]) {
        // SAFETY: see `Shared`.
        let state = unsafe { &mut *ENCODER.0.get() };
        state.0.write(bytes, put);
    }
}

defmt::timestamp!("{=u64:us}", clock::now() / (CLOCK_HZ as u64 / 1_000_000));
