//! Protection, synchronisation, interrupt lines, values after reset.

use crate::bench::*;
use fdcan_model::{Controllers, Options, RemarkKind, Unit};

#[test]
fn after_reset_the_registers_have_the_manuals_values() {
    let bench = Bench::new(Options::default());
    let values = [
        (0x000, 0x3214_1218),
        (0x004, 0x8765_4321),
        (CCCR, 1),
        (NBTP, 0x0600_0A03),
        (PSR, 0x707),
        (0x00C, 0xA33),
        (XIDAM, 0x1FFF_FFFF),
        (0x028, 0xFFFF_0000),
        (IR, 0),
        (TXFQS, 0),
        (RXF0S, 0),
    ];
    for (offset, value) in values {
        assert_eq!(bench.can.peek(Unit::Two, offset), value, "{offset:#x}");
    }
}

#[test]
fn configuration_without_cce_is_ignored_and_named() {
    let mut bench = Bench::new(Options::default());
    let registers = [
        (NBTP, "NBTP"),
        (GFC, "GFC"),
        (SIDFC, "SIDFC"),
        (XIDFC, "XIDFC"),
        (XIDAM, "XIDAM"),
        (RXF0C, "RXF0C"),
        (RXF1C, "RXF1C"),
        (0x0BC, "RXESC"),
        (TXBC, "TXBC"),
        (0x0C8, "TXESC"),
        (0x0F0, "TXEFC"),
        (0x014, "RWD"),
        (0x020, "TSCC"),
        (0x048, "TDCR"),
        (0x00C, "DBTP"),
    ];
    for (offset, name) in registers {
        let before = bench.read(offset);
        bench.write(offset, !before & 0x0011_1114);
        assert_eq!(bench.read(offset), before, "{name}");
        assert_eq!(bench.remarks(), [(RemarkKind::Ignored, name)]);
    }
    // The same with both bits set is taken, without a remark.
    bench.open();
    bench.write(NBTP, 0x0009_0401);
    assert_eq!(bench.read(NBTP), 0x0009_0401);
    assert_eq!(bench.remarks(), []);
}

#[test]
fn a_running_controller_keeps_its_configuration() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, CCE);
    bench.write(NBTP, 0);
    assert_eq!(bench.read(NBTP), 0x0009_0401);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "CCCR"), (RemarkKind::Ignored, "NBTP")]);
}

#[test]
fn init_is_read_back_after_a_delay_and_cce_waits_for_it() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, INIT);
    assert_eq!(bench.read(CCCR) & INIT, 0);
    bench.write(CCCR, INIT | CCE);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "CCCR")]);
    bench.pass_ns(100);
    assert_eq!(bench.read(CCCR) & 0b11, INIT);
    bench.write(CCCR, INIT | CCE);
    assert_eq!(bench.read(CCCR) & 0b11, INIT | CCE);
    assert!(bench.remarks().is_empty());
}

#[test]
fn init_written_twice_within_the_delay_is_remarked_on() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, INIT);
    bench.write(CCCR, 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "CCCR")]);
}

#[test]
fn clearing_init_clears_cce() {
    let mut bench = Bench::new(Options::default());
    bench.open();
    bench.write(CCCR, CCE);
    assert_eq!(bench.read(CCCR) & CCE, 0);
}

#[test]
fn without_a_kernel_clock_init_never_changes() {
    let mut bench = Bench { can: Controllers::new(Options::default()), now: 0 };
    bench.write(CCCR, 0);
    bench.pass_ns(1_000_000_000);
    assert_eq!(bench.read(CCCR), INIT);
    assert_eq!(bench.can.next_time(), None);
    bench.can.set_kernel_clock(KERNEL_HZ, bench.now);
    bench.pass_ns(1000);
    assert_eq!(bench.read(CCCR), 0);
}

#[test]
fn setting_cce_resets_the_handlers_but_not_the_interrupt_flags() {
    let mut bench = Bench::with(Options::default(), &[(GFC, 0), (RXF1C, 0x0004_1000)]);
    bench.receive(0x123);
    assert!(bench.put(0x10) && bench.put(0x11) && bench.put(0x12));
    bench.sent();
    bench.write(TXBCR, 0b100);
    let registers = [RXF0S, TXFQS, TXBRP, TXBTO, TXBCF];
    let before = registers.map(|offset| bench.read(offset));
    assert!(before.iter().all(|value| *value != 0), "{before:x?}");
    bench.open();
    assert_eq!(registers.map(|offset| bench.read(offset)), [0, 8, 0, 0, 0]);
    assert_eq!(bench.read(IR) & (TC | 1), TC | 1);
}

#[test]
fn transmit_requests_and_cancellations_are_ignored_while_cce_is_set() {
    let mut bench = Bench::image(Default::default());
    bench.open();
    bench.write(TXBAR, 1);
    bench.write(TXBCR, 1);
    assert_eq!(bench.read(TXBRP), 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "TXBAR"), (RemarkKind::Ignored, "TXBCR")]);
}

#[test]
fn mode_bits_need_cce_and_some_can_be_cleared_without() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, DAR);
    assert_eq!(bench.read(CCCR), 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "CCCR")]);
    bench.open();
    // DAR, and MON, which the model does not have.
    bench.write(CCCR, INIT | CCE | DAR | 1 << 5);
    assert_eq!(bench.read(CCCR), INIT | CCE | DAR | 1 << 5);
    assert_eq!(bench.remarks(), [(RemarkKind::Unmodelled, "CCCR")]);
    bench.write(CCCR, DAR | 1 << 5);
    bench.pass_ns(1000);
    bench.write(CCCR, 0);
    assert_eq!(bench.read(CCCR), DAR, "MON can be cleared at any time, DAR cannot");
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "CCCR")]);
}

#[test]
fn read_only_and_missing_registers_leave_remarks() {
    let mut bench = Bench::new(Options::default());
    for (offset, name) in [(0x000, "CREL"), (PSR, "PSR"), (TXBRP, "TXBRP"), (TXFQS, "TXFQS"), (RXF0S, "RXF0S")] {
        bench.write(offset, u32::MAX);
        assert_eq!(bench.remarks(), [(RemarkKind::Ignored, name)]);
    }
    bench.read(0x008);
    assert_eq!(bench.remarks(), [(RemarkKind::Unmodelled, "reserved")]);
    assert_eq!(bench.read(IR), 1 << 29);
    // Time-triggered operation.
    bench.write(0x100, 1);
    assert_eq!(bench.remarks(), [(RemarkKind::Unmodelled, "reserved")]);
}

#[test]
fn functions_the_model_does_not_have_are_named_when_asked_for() {
    let mut bench = Bench::new(Options::default());
    bench.open();
    for (offset, none, some, name) in [
        (0x020, 0, 1, "TSCC"),
        (0x028, 0xFFFF_0000, 1, "TOCC"),
        (0x0F0, 0x40, 1 << 16, "TXEFC"),
        (0x010, 0, 0x10, "TEST"),
    ] {
        bench.write(offset, none);
        assert_eq!(bench.remarks(), []);
        bench.write(offset, some);
        assert_eq!(bench.remarks(), [(RemarkKind::Unmodelled, name)]);
    }
}

#[test]
fn interrupt_lines_follow_flags_enables_selection_and_acknowledgement() {
    let mut bench = Bench::image(Default::default());
    assert_eq!(bench.lines(), (false, false));
    bench.receive(0x423);
    assert_eq!(bench.lines(), (true, false));
    bench.put(0x10);
    bench.sent();
    assert_eq!(bench.lines(), (true, true));
    bench.write(IR, TC);
    assert_eq!(bench.lines(), (true, false));
    bench.write(ILE, 0b10);
    assert_eq!(bench.lines(), (false, false));
    bench.write(ILS, 0x201);
    assert_eq!(bench.lines(), (false, true));
    bench.write(IE, 0);
    assert_eq!(bench.lines(), (false, false));
    // Writing 0 clears nothing.
    bench.write(IR, 0);
    assert_eq!(bench.read(IR) & 1, 1);
    bench.write(IR, 1);
    assert_eq!(bench.read(IR) & 1, 0);
}

#[test]
fn a_reset_clears_the_registers_takes_frames_back_and_keeps_the_memory() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    assert_eq!(bench.told(), [Notice::Offer(0x10)]);
    bench.can.reset(bench.now);
    assert_eq!(bench.told(), [Notice::Withdraw]);
    assert_eq!([CCCR, NBTP, TXBRP, IE].map(|offset| bench.read(offset)), [1, 0x0600_0A03, 0, 0]);
    assert_eq!(bench.can.peek_memory(TRANSMIT_AT), 0x10 << 18);
    // A frame that the wire had begun before means nothing afterwards.
    bench.sent();
    assert_eq!(bench.read(TXBTO), 0);
}
