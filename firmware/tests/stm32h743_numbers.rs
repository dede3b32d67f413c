//! The numbers of the STM32H743 board, from the constants its image uses.

use std::collections::BTreeMap;
use std::path::Path;

use firmware::board::stm32h743::constants::can::{
    ARM, BIT_TIMING, BIT_TIMING_OF_HSI, BITS_PER_SECOND, HOST, MEMORY_WORDS, bears_both,
};
use firmware::board::stm32h743::constants::can_settings::{ARM_INTERRUPTS, SETTINGS, settings};
use firmware::board::stm32h743::constants::chip_settings::PLACES;
use firmware::board::stm32h743::constants::clocks::*;
use firmware::board::stm32h743::constants::filters::{
    ARM_ACCEPTED, ARM_ELEMENTS, ARM_FILTERS, ARM_IDS, HOST_DEVICE, HOST_FILTERS, accepts,
};
use firmware::board::stm32h743::constants::lines::{
    BAUD, BITS_PER_BYTE, UART_BRR, UART_EIGHT_SAMPLES, UART_FIFO_BYTES,
};
use firmware::board::stm32h743::constants::memory::*;
use firmware::board::stm32h743::constants::supply::{BROWN_OUT_LEVEL, brown_out_millivolts};
use firmware::board::stm32h743::constants::timers::*;
use link::can::{DeviceNumber, Direction, Heading};
use puck::{CanFrame, CanId, Group, Node, Reply};

#[test]
fn phase_locked_loops_stay_inside_what_the_chip_bears() {
    for pll in [PLL1, PLL3] {
        assert_eq!(HSE_HZ % pll.input_divider, 0);
        assert!((8_000_000..=16_000_000).contains(&pll.comparison_hz()), "{pll:?}");
        assert!((192_000_000..=836_000_000).contains(&pll.oscillator_hz()), "{pll:?}");
        assert!(
            pll.oscillator_hz() > MEDIUM_OSCILLATOR_HZ_LIMIT,
            "the oscillator for 1 to 2 MHz would be taken: {pll:?}"
        );
        for divider in [pll.p, pll.q].into_iter().flatten() {
            assert!((1..=128).contains(&divider));
            assert_eq!(pll.oscillator_hz() % divider, 0, "a rounded frequency is not the one stated");
        }
        assert!((4..=512).contains(&pll.multiplier));
    }
    // Output P of the first loop divides by an even number on this chip, or not at all.
    assert!(PLL1.p.is_some_and(|divider| divider == 1 || divider % 2 == 0));
}

#[test]
fn clock_tree_is_the_one_the_documents_state() {
    assert_eq!(CORE_HZ, 400_000_000);
    const { assert!(CORE_HZ <= CORE_HZ_LIMIT) };
    assert_eq!((AHB_HZ, APB_HZ, TIMER_HZ), (200_000_000, 100_000_000, 200_000_000));
    assert_eq!(CAN_HZ, 80_000_000);
    const { assert!(CAN_HZ <= APB_HZ, "the message memory must be at least as fast as the controller") };
    assert_eq!(USB_HZ, 48_000_000);
}

#[test]
fn a_bit_lasts_one_microsecond_exactly_and_is_sampled_at_three_quarters() {
    assert_eq!(BIT_TIMING.quanta(), 8);
    assert_eq!(CAN_HZ % (BIT_TIMING.prescaler * BIT_TIMING.quanta()), 0, "the rate would be rounded");
    assert_eq!(BIT_TIMING.bits_per_second(), BITS_PER_SECOND);
    assert_eq!(BIT_TIMING.sample_point_per_mille(), 750);
    assert_eq!(BIT_TIMING.jump, 1);
    // What the registers can hold: prescaler 1..512, segments 1..256 and 1..128, jump no longer than the second
    // segment.
    assert!((1..=512).contains(&BIT_TIMING.prescaler) && (2..=256).contains(&BIT_TIMING.before_sample));
    assert!((2..=128).contains(&BIT_TIMING.after_sample) && BIT_TIMING.jump <= BIT_TIMING.after_sample);
}

#[test]
fn two_crystals_may_differ_by_far_more_than_crystals_do() {
    let quanta = f64::from(BIT_TIMING.quanta());
    let shorter = f64::from(BIT_TIMING.before_sample.min(BIT_TIMING.after_sample));
    // The two conditions of the CAN specification, for one of the two oscillators.
    let resynchronise = f64::from(BIT_TIMING.jump) / (20.0 * quanta);
    let sample_flag = shorter / (2.0 * (13.0 * quanta - f64::from(BIT_TIMING.after_sample)));
    assert!(resynchronise.min(sample_flag) > 0.005, "{resynchronise} {sample_flag}");
}

#[test]
fn the_chips_own_oscillator_makes_bits_that_a_crystal_understands() {
    // Both run from it, and the controller wants a clock no faster than its bus.
    let oscillator = HSI_HZ / PLL1_OF_HSI.input_divider * PLL1_OF_HSI.multiplier;
    let clock = oscillator / PLL1_OF_HSI.q.expect("an output");
    assert!((192_000_000..=836_000_000).contains(&oscillator) && clock <= HSI_HZ);
    assert!((8_000_000..=16_000_000).contains(&(HSI_HZ / PLL1_OF_HSI.input_divider)));
    let bit = BIT_TIMING_OF_HSI;
    assert_eq!(clock, BITS_PER_SECOND * bit.prescaler * bit.quanta());
    // By the two conditions of the CAN specification, with all of the difference on one side: it is 1 % off.
    let shorter = f64::from(bit.before_sample.min(bit.after_sample));
    let resynchronise = f64::from(bit.jump) / (10.0 * f64::from(bit.quanta()));
    let sample_flag = shorter / f64::from(13 * bit.quanta() - bit.after_sample);
    assert!(resynchronise.min(sample_flag) > 0.012, "{resynchronise} {sample_flag}");
}

#[test]
fn the_settings_of_the_arms_controller_are_those_that_the_manual_gives_for_its_numbers() {
    let values: Vec<(u32, u32)> =
        settings(&ARM, &BIT_TIMING, ARM_INTERRUPTS).map(|setting| (setting.offset, setting.value)).to_vec();
    // NBTP, IE, ILS, ILE; GFC, SIDFC, RXF0C, TXBC.
    for expected in [
        (0x1C, 0x0009_0401),
        (0x54, 0x0202_0209),
        (0x58, 0x200),
        (0x5C, 0b11),
        (0x80, 0x2B),
        (0x84, 0x000D_0000),
        (0xA0, 0x0020_0034),
        (0xC0, 0x0800_0234),
    ] {
        assert!(values.contains(&expected), "{expected:x?} of {values:x?}");
    }
    let mut offsets: Vec<u32> = values.iter().map(|(offset, _)| *offset).collect();
    offsets.sort_unstable();
    offsets.dedup();
    assert_eq!(offsets.len(), SETTINGS);
    // A controller that nobody is told of interrupts nobody.
    assert!(settings(&HOST, &BIT_TIMING, 0).iter().all(|setting| setting.offset & !0xF != 0x50 || setting.value == 0));
}

#[test]
fn no_place_of_the_chip_is_watched_twice_or_in_vain() {
    let mut addresses: Vec<u32> = PLACES.iter().map(|place| place.address).collect();
    addresses.sort_unstable();
    addresses.dedup();
    assert_eq!(addresses.len(), PLACES.len());
    assert!(PLACES.iter().all(|place| place.address.is_multiple_of(4) && place.mask != 0));
}

#[test]
fn control_rate_is_met_to_ten_millionths() {
    let cycle = f64::from(SLOT_TICKS * CYCLE_SLOTS) / f64::from(TIMER_HZ / SLOT_PRESCALER);
    let off = (1.0 / cycle - control::RATE) / control::RATE;
    assert!(off.abs() <= 10e-6, "{off:e}");
    assert_eq!(SLOT_HZ, control::RATE_HZ * CYCLE_SLOTS);
    assert_eq!(CLOCK_HZ % 1_000_000, 0, "microseconds would lose a fraction");
    // The clock's 32 bits must outlast the longest time between two looks at it by far.
    const { assert!(u32::MAX / CLOCK_HZ >= 10) };
}

#[test]
fn watchdog_waits_for_several_slots_and_the_last_frames_but_not_for_long() {
    assert_eq!(WATCHDOG_US, 10_000);
    let slot_us = 1_000_000 / SLOT_HZ;
    let fastest = WATCHDOG_US * 100 / (100 + LSI_TOLERANCE_PERCENT);
    let slowest = WATCHDOG_US * 100 / (100 - LSI_TOLERANCE_PERCENT);
    assert!(fastest > 6 * slot_us, "it would bite in the middle of the last frames");
    assert!(slowest < 12_000, "the arm would hold its last torque for too long");
    assert!((1..=4096).contains(&WATCHDOG_TICKS));
}

#[test]
fn watchdog_bears_with_the_start_and_tells_soon_that_it_has_no_oscillator() {
    assert_eq!(WATCHDOG_START_US, 512_000, "what the documents state");
    let slowest_hz = LSI_HZ * (100 - LSI_TOLERANCE_PERCENT) / 100;
    let update_us = 6 * WATCHDOG_PRESCALER * 1_000_000 / slowest_hz;
    assert!(2 * update_us < WATCHDOG_UPDATE_US, "a healthy one takes {update_us} us and would be refused");
    // All waits of the start-up happen inside its window, and leave most of what remains to the rest of it.
    let fastest = WATCHDOG_START_US * 100 / (100 + LSI_TOLERANCE_PERCENT);
    let waits = WATCHDOG_UPDATE_US + HSE_SOON_US + HSE_BLINKS * HSE_BLINK_US;
    assert!(waits + 100_000 < fastest, "the watchdog would come before the reason is written down");
    // What the counter of the clock can tell apart.
    const { assert!(HSE_BLINK_US < u32::MAX / (HSI_HZ / 1_000_000)) };
}

#[test]
fn the_end_waits_long_enough_for_the_last_frames_and_ends_before_the_watchdog() {
    // Eleven-bit identifier, eight bytes, a stuff bit after every four bits of what is stuffed, and the space behind
    // it.
    let longest_bits = 47 + 64 + (34 + 64 - 1) / 4;
    let frame_us = longest_bits * 1_000_000 / BITS_PER_SECOND;
    let last = 4;
    assert!(ARM.transmit >= last, "they would not fit into an empty queue");
    assert!(LAST_ROOM_US > (1 + last) * frame_us);
    let join_us = 129 * 11 * 1_000_000 / BITS_PER_SECOND;
    assert!(LAST_LEFT_US > join_us + last * frame_us);
    assert!(LAST_LEFT_US > (1 + (ARM.transmit - last) + last) * frame_us);
    let fastest = WATCHDOG_US * 100 / (100 + LSI_TOLERANCE_PERCENT);
    // Two milliseconds for writing down the reason.
    assert!(LAST_ROOM_US + 2 * INIT_US + LAST_LEFT_US + 2_000 < fastest, "the watchdog would cut the last frames off");
}

#[test]
fn filters_let_through_exactly_the_replies_a_wam_sends_to_its_master() {
    let motors = || Node::ARM.into_iter().chain(Node::HAND);
    let mut wanted: Vec<u16> = motors().map(|node| reply_id(node, Group::POSITION_REPLIES)).collect();
    let nodes = motors().chain([Node::FORCE_TORQUE, Node::SAFETY_MODULE]);
    wanted.extend(nodes.map(|node| reply_id(node, Group::PROPERTY_REPLIES)));
    wanted.push(reply_id(Node::FORCE_TORQUE, Group::FORCE_REPLIES));
    wanted.push(reply_id(Node::FORCE_TORQUE, Group::TORQUE_REPLIES));
    let passed: Vec<u16> = (0..0x800).filter(|id| accepts(&ARM_FILTERS, *id)).collect();
    wanted.sort_unstable();
    assert_eq!(passed, wanted);
    assert_eq!(passed.len(), ARM_IDS);
    assert!(!accepts(&ARM_FILTERS, 0x540), "broadcasts of the safety module are for the pucks");
    assert!(!accepts(&ARM_FILTERS, 0x404), "nobody but the master asks");
}

fn reply_id(sender: Node, group: Group) -> u16 {
    CanId::encode(sender, group).raw()
}

#[test]
fn every_frame_the_filters_let_through_is_one_the_application_can_read() {
    for id in ARM_ACCEPTED {
        let id = CanId::new(id).expect("eleven bits");
        let payloads: [&[u8]; 3] = [&[0x80, 0, 0], &[0x88, 0, 2, 0], &[0; 6]];
        let read = payloads.iter().filter_map(|payload| CanFrame::from_slice(id, payload));
        assert!(read.map(|frame| Reply::decode(&frame)).any(|reply| reply.is_ok()), "{id:?}");
    }
}

#[test]
fn the_hosts_bus_lets_through_the_segments_to_this_device_alone() {
    let passed: Vec<u16> = (0..0x800).filter(|id| accepts(&HOST_FILTERS, *id)).collect();
    let wanted: Vec<u16> = (0..16)
        .map(|sequence| Heading { direction: Direction::ToDevice, device: HOST_DEVICE, sequence }.id())
        .collect();
    assert_eq!(passed, wanted);
    let other = DeviceNumber::new(1).expect("a small number");
    assert!(!accepts(&HOST_FILTERS, Heading { direction: Direction::ToDevice, device: other, sequence: 0 }.id()));
}

#[test]
fn queues_of_both_controllers_fit_the_message_memory_side_by_side() {
    assert_eq!(ARM.filters, ARM_ELEMENTS as u32);
    for memory in [ARM, HOST] {
        assert!(memory.receive <= 64 && memory.transmit <= 32 && memory.filters <= 128);
        assert!(memory.filters_at + memory.filters <= memory.receive_at);
    }
    assert!(ARM.end() <= HOST.filters_at, "one controller would write into the other's queues");
    assert!(HOST.end() <= MEMORY_WORDS);
}

#[test]
fn both_controllers_run_only_on_chips_without_the_fault_of_the_message_memory() {
    // Revisions Z, Y (and W), X, V.
    let revisions = [0x1001, 0x1003, 0x2001, 0x2003];
    assert_eq!(revisions.map(bears_both), [false, false, true, true]);
}

#[test]
fn receive_queues_outlast_the_time_until_somebody_fetches() {
    // Shortest frame without stuffing, and the space behind it: 47 bits. A slot is the longest anyone is kept waiting.
    let slot_us = 1_000_000 / SLOT_HZ;
    assert!(ARM.receive > slot_us / 47, "a slot full of the shortest frames must fit");
    // Full frames without stuffing, 111 bits, on the host's bus: the session comes by every slot, or misses a few.
    assert!(HOST.receive > 6 * slot_us / 111);
    assert!(HOST.transmit > 2 * slot_us / 111, "the line would fall silent between two visits of the session");
}

/// Bits per second that the serial controller makes of its baud rate register, as the reference manual says: with
/// sixteen samples a bit the register is the divider; with eight the divider is that of twice the clock, its lowest
/// four bits stand one place lower and the lowest is lost; the register's bit 3 must be clear.
fn serial_rate(clock_hz: u32, register: u16, eight_samples: bool) -> f64 {
    let register = u32::from(register);
    if eight_samples {
        assert_eq!(register & 0b1000, 0, "the register has a bit where none may be");
        f64::from(2 * clock_hz) / f64::from(register & !0xF | (register & 0b111) << 1)
    } else {
        f64::from(clock_hz) / f64::from(register)
    }
}

#[test]
fn the_serial_line_runs_at_the_rate_the_host_opens_it_with() {
    let rate = serial_rate(UART_HZ, UART_BRR, UART_EIGHT_SAMPLES);
    assert_eq!(rate.round(), 923_077.0, "what the documents state");
    let off = rate / f64::from(BAUD) - 1.0;
    assert!(off.abs() < 0.002, "{off}");
    const { assert!(UART_BRR >= 16, "the controller divides by 16 at least") };
    let fifo_us = UART_FIFO_BYTES * BITS_PER_BYTE * 1_000_000 / BAUD;
    assert!(fifo_us > 100);
    // The set-up of 5a5e456, 100 MHz and eight samples of divider 217: half a percent off, not 0.006 %.
    assert_eq!(serial_rate(100_000_000, 0xD4, true).round(), 925_926.0);
}

#[test]
fn image_and_store_share_no_byte_of_flash_and_begin_at_sectors() {
    assert!(!IMAGE.overlaps(&STORE));
    for region in [IMAGE, STORE] {
        assert_eq!(region.start % SECTOR_BYTES, 0);
        assert_eq!(region.length % SECTOR_BYTES, 0);
        assert!(region.start >= 0x0800_0000 && region.end() <= 0x0820_0000, "2 MiB from 0x0800_0000 on");
    }
    // The two banks: an operation in one must not stop the other.
    assert!(IMAGE.end() <= 0x0810_0000 && STORE.start >= 0x0810_0000);
    assert_eq!(SECTOR_BYTES % FLASH_WORD_BYTES, 0);
    const { assert!(STORE.length / SECTOR_BYTES >= 4, "the storage wants a spare sector and some to wear") };
}

#[test]
fn regions_of_memory_do_not_overlap_and_stay_inside_what_there_is() {
    let all = [HOT_DATA, EMERGENCY_STACK, DATA, RETAINED, STACK, NULL_GUARD, HOT_CODE];
    for (index, region) in all.iter().enumerate() {
        let inside = |memory: &Region| region.start >= memory.start && region.end() <= memory.end();
        assert_eq!([ITCM, DTCM, AXI].iter().filter(|memory| inside(memory)).count(), 1, "{region:?}");
        for other in &all[index + 1..] {
            assert!(!region.overlaps(other), "{region:?} {other:?}");
        }
    }
    assert_eq!((ITCM.length, DTCM.length, AXI.length), (64 * 1024, 128 * 1024, 512 * 1024));
}

#[test]
fn the_guard_is_what_the_stack_meets_first() {
    assert_eq!(STACK_GUARD.end(), STACK.start);
    assert_eq!(STACK.start % 8, 0);
    // A frame that fits into the stack cannot reach below the guard, and the guard takes no memory away.
    const { assert!(STACK_GUARD.length >= STACK.length) };
    for memory in [ITCM, DTCM, AXI] {
        assert!(!STACK_GUARD.overlaps(&memory), "{memory:?}");
    }
    // What the protection unit can express: a power of two from 32 bytes on, aligned to its size.
    for region in [STACK_GUARD, NULL_GUARD, STORE] {
        assert!(region.length.is_power_of_two() && region.length >= 32, "{region:?}");
        assert_eq!(region.start % region.length, 0, "{region:?}");
    }
}

#[test]
fn brown_out_lies_between_what_the_flash_needs_and_what_the_supply_may_fall_to() {
    let levels: Vec<u32> = (0..4).map(brown_out_millivolts).collect();
    assert_eq!(levels, [1_600, 2_100, 2_400, 2_700]);
    // The chip programs its flash from 1.71 V on; 3.3 V may be a tenth low, and a transceiver works from 3.0 V on.
    let wanted = brown_out_millivolts(BROWN_OUT_LEVEL);
    assert!(wanted > 1_710 + 500 && wanted < 2_970 - 500, "{wanted}");
}

#[test]
fn no_address_of_external_memory_is_normal_memory_that_the_processor_may_read_ahead() {
    // The default map: normal memory from here to there, which this board has not.
    let mut at = 0x6000_0000;
    for region in &EXTERNAL {
        assert_eq!(region.start, at, "a gap");
        assert!(region.length.is_power_of_two() && region.start % region.length == 0, "{region:?}");
        at = region.end();
    }
    assert_eq!(at, 0xA000_0000);
}

/// `NAME : ORIGIN = 0x.., LENGTH = ..K` of the linker script.
fn regions_of_the_linker() -> BTreeMap<String, Region> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("memory/stm32h743.x");
    let script = std::fs::read_to_string(path).expect("the linker script is part of the package");
    let region = |line: &str| {
        let (name, rest) = line.trim().split_once(" : ORIGIN = 0x")?;
        let (start, length) = rest.split_once(", LENGTH = ")?;
        let length: u32 = length.strip_suffix('K')?.parse().ok()?;
        Some((name.to_owned(), Region { start: u32::from_str_radix(start, 16).ok()?, length: length * 1024 }))
    };
    script.lines().filter_map(region).collect()
}

#[test]
fn linker_script_and_constants_say_the_same() {
    let expected = [
        ("FLASH", IMAGE),
        ("HOTCODE", HOT_CODE),
        ("HOTDATA", HOT_DATA),
        ("EMERGENCY", EMERGENCY_STACK),
        ("STACK", STACK),
        ("RAM", DATA),
        ("RETAINED", RETAINED),
    ];
    let expected: BTreeMap<String, Region> = expected.map(|(name, region)| (name.to_owned(), region)).into();
    assert_eq!(regions_of_the_linker(), expected);
}
