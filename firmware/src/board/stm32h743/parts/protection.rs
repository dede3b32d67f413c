//! Memory protection and caches, and which faults have a handler: set up before anything else runs.
//!
//! Six regions of the memory protection unit on top of the processor's default map. The guard below the stack and the
//! one at address 0 may not be touched by anybody. Bank 2 of the flash is *device* memory: the processor then neither
//! caches it nor reads ahead in it, so it is only touched when the store asks, and a running erasure never holds up a
//! read nobody meant. That holds at every priority (`docs/decisions/0026-bank-2-is-never-cached.md`).
//! The retained memory is not cached: a reset loses what only the cache holds. The addresses of external memory are
//! device memory too: the board has none, and the processor reads ahead wherever the default map says normal memory.
//!
//! No peripheral reads or writes memory by itself (there is no direct memory access anywhere in the image), so the data
//! cache needs no further rule.

use core::arch::global_asm;

use cortex_m::Peripherals;
use cortex_m::peripheral::MPU;
use cortex_m::peripheral::scb::Exception;

use super::super::constants::memory::{EXTERNAL, IMAGE, NULL_GUARD, RETAINED, Region, STACK_GUARD, STORE};

/// Region attributes: nobody may read, write or execute.
const NO_ACCESS: u32 = 1 << 28;
/// Region attributes: read and write, never execute, shareable device.
const DEVICE: u32 = 1 << 28 | 0b011 << 24 | 1 << 18 | 1 << 16;
/// Region attributes: read and write, never execute, normal memory that is not cached.
const NOT_CACHED: u32 = 1 << 28 | 0b011 << 24 | 0b001 << 19;
/// Unit on, with the default map behind it, also inside hard faults and while everything but those is masked
/// (HFNMIENA): bank 2 is read so, and by the default map it would go through the data cache and be stale after the next
/// write.
const ENABLE: u32 = 0b111;
/// Ignore bus faults of handlers that run above all others: they probe damaged flash words, and report.
const IGNORE_BUS_FAULTS: u32 = 1 << 8;

/// Guards, caches, faults.
pub(super) fn start(core: &mut Peripherals) {
    // Usually so after a reset; not if a boot loader or a debugger has started the image.
    // SAFETY: the image begins with its vector table.
    unsafe { core.SCB.vtor.write(IMAGE.start) };
    region(&mut core.MPU, 0, &STACK_GUARD, NO_ACCESS);
    region(&mut core.MPU, 1, &NULL_GUARD, NO_ACCESS);
    region(&mut core.MPU, 2, &STORE, DEVICE);
    region(&mut core.MPU, 3, &RETAINED, NOT_CACHED);
    let [first, second] = &EXTERNAL;
    region(&mut core.MPU, 4, first, DEVICE);
    region(&mut core.MPU, 5, second, DEVICE);
    // SAFETY: the six regions above take nothing away that is used.
    unsafe { core.MPU.ctrl.write(ENABLE) };
    cortex_m::asm::dsb();
    cortex_m::asm::isb();
    core.SCB.enable_icache();
    core.SCB.enable_dcache(&mut core.CPUID);
    core.SCB.enable(Exception::MemoryManagement);
    // SAFETY: changes what happens to faulting reads of a handler with the highest priority, see the constant.
    unsafe { core.SCB.ccr.modify(|value| value | IGNORE_BUS_FAULTS) };
}

fn region(unit: &mut MPU, number: u32, region: &Region, attributes: u32) {
    // The size is written as log2 - 1; the constants' tests say that it is a power of two and that the start fits.
    let size = region.length.trailing_zeros() - 1;
    // SAFETY: a region with the given attributes; the unit is off or the region was.
    unsafe {
        unit.rnr.write(number);
        unit.rbar.write(region.start);
        unit.rasr.write(attributes | size << 1 | 1);
    }
}

// Before main: the code of the control cycle goes to where it runs. Written by hand, because no function of Rust may
// run before its memory is there.
global_asm!(
    ".section .text.__pre_init,\"ax\",%progbits",
    ".global __pre_init",
    ".type __pre_init,%function",
    ".thumb_func",
    "__pre_init:",
    "ldr r0, =__shotcode",
    "ldr r1, =__ehotcode",
    "ldr r2, =__sihotcode",
    "1:",
    "cmp r0, r1",
    "bcs 2f",
    "ldr r3, [r2], #4",
    "str r3, [r0], #4",
    "b 1b",
    "2:",
    "dsb",
    "isb",
    "bx lr",
    ".ltorg",
);
