//! Transmit cancellation: what the manual says, and both readings where it does not.

use crate::bench::Notice::{Offer, Withdraw};
use crate::bench::*;
use fdcan_model::Cancellation::{Skipped, Stuck};
use fdcan_model::{BusError, Fault, Options, RemarkKind, Unit};

/// A bench whose FIFO has sent three frames and holds four more, at places 3 to 6.
fn four_waiting(policy: fdcan_model::Cancellation) -> Bench {
    let mut bench = Bench::image(policy);
    for _ in 0..3 {
        bench.put(1);
        bench.sent();
    }
    for id in 0x13..0x17 {
        bench.put(id);
    }
    bench.told();
    bench.write(IR, u32::MAX);
    bench
}

#[test]
fn skipped_the_whole_fifo_can_be_cancelled_and_used_again() {
    let mut bench = four_waiting(Skipped);
    bench.write(TXBCIE, 1 << 4);
    bench.write(TXBCR, u32::MAX);
    assert_eq!(bench.told(), [Withdraw]);
    assert_eq!([TXBRP, TXBCF, IR].map(|offset| bench.read(offset)), [0, 0b0111_1000, TCF | TFE]);
    assert_eq!(bench.fifo(), [8, 7, 7, 0]);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "TXBCR")]);
    for id in 0x20..0x28 {
        assert!(bench.put(id));
    }
    assert_eq!(bench.told().len(), 8);
}

#[test]
fn stuck_the_fifo_waits_for_ever_until_it_is_configured_anew() {
    let mut bench = four_waiting(Stuck);
    bench.write(TXBCR, u32::MAX);
    assert_eq!(bench.told(), [Withdraw]);
    assert_eq!((bench.read(TXBRP), bench.fifo()), (0, [4, 3, 7, 0]));
    for id in 0x20..0x24 {
        assert!(bench.put(id));
    }
    assert!(!bench.put(0x24), "four places are lost");
    bench.pass(100_000);
    assert_eq!((bench.told(), bench.read(TXBRP).count_ones()), (vec![], 4));
    // INIT and CCE, as the manual's reset of TXFQS and TXBRP asks for.
    bench.open();
    bench.join();
    assert_eq!(bench.fifo(), [8, 0, 0, 0]);
    bench.put(0x30);
    assert_eq!(bench.told(), [Offer(0x30)]);
}

#[test]
fn a_cancelled_place_in_the_middle_is_passed_over_or_ends_the_fifo() {
    for (policy, left) in [(Skipped, vec![Offer(0x13), Offer(0x15), Offer(0x16)]), (Stuck, vec![Offer(0x13)])] {
        let mut bench = four_waiting(policy);
        bench.write(TXBCR, 1 << 4);
        assert_eq!(bench.fifo(), [4, 3, 7, 0], "the get index and the free level remain unchanged");
        let told = bench.told();
        assert_eq!((told[0], &told[1..]), (Withdraw, &left[..]));
        bench.sent();
        assert_eq!(bench.fifo()[1], if policy == Skipped { 5 } else { 4 });
    }
}

#[test]
fn skipped_cancelling_the_oldest_moves_the_get_index_on() {
    let mut bench = four_waiting(Skipped);
    bench.write(TXBCR, 1 << 3);
    assert_eq!(bench.fifo(), [5, 4, 7, 0]);
}

#[test]
fn a_frame_on_the_wire_is_finished_and_told_as_both() {
    let mut bench = four_waiting(Skipped);
    bench.can.begun(Unit::One, bench.now);
    bench.write(TXBCR, u32::MAX);
    assert_eq!([TXBRP, TXBCR, TXBTO & 0x7F, TXBCF].map(|offset| bench.read(offset) & 0x78), [8, 8, 0, 0x70]);
    assert_eq!(bench.told(), [Withdraw], "the wire keeps what has begun");
    bench.sent();
    assert_eq!([TXBRP, TXBCR, TXBTO, TXBCF].map(|offset| bench.read(offset) & 0x78), [0, 0, 8, 0x78]);
    assert_eq!(bench.fifo(), [8, 7, 7, 0]);
}

#[test]
fn a_cancelled_frame_on_the_wire_that_fails_is_not_repeated() {
    let mut bench = four_waiting(Skipped);
    bench.can.begun(Unit::One, bench.now);
    bench.write(TXBCR, 1 << 3);
    bench.can.failed(Unit::One, BusError::Acknowledge, bench.now);
    assert_eq!([TXBRP, TXBTO, TXBCF].map(|offset| bench.read(offset) & 0x78), [0x70, 0, 8]);
    assert_eq!(bench.fifo()[1], 4);
}

#[test]
fn a_wire_that_learns_late_that_a_frame_had_begun_gets_the_same_end() {
    for policy in [Skipped, Stuck] {
        let mut bench = four_waiting(policy);
        bench.write(TXBCR, u32::MAX);
        assert_eq!(bench.told(), [Withdraw]);
        bench.can.still_on_wire(Unit::One, bench.now);
        assert_eq!([TXBRP, TXBCR, TXBTO, TXBCF].map(|offset| bench.read(offset) & 0x78), [8, 8, 0, 0x70]);
        bench.put(0x20);
        assert_eq!(bench.told(), if policy == Skipped { vec![Offer(0x20)] } else { vec![] });
        bench.sent();
        assert_eq!([TXBRP, TXBTO, TXBCF].map(|offset| bench.read(offset) & 0xF8), [0x80, 8, 0x78]);
        // The second answer for the same frame changes nothing.
        bench.can.still_on_wire(Unit::One, bench.now);
        assert_eq!(bench.read(TXBRP), 0x80);
    }
}

#[test]
fn a_withdrawal_for_another_reason_keeps_the_frame_on_the_wire_at_the_head() {
    let mut bench = Bench::image(Skipped);
    bench.put(0x10);
    bench.put(0x11);
    bench.told();
    bench.fault(Some(Fault::NoAcknowledge));
    assert_eq!(bench.told(), [Withdraw]);
    bench.can.still_on_wire(Unit::One, bench.now);
    bench.sent();
    assert_eq!((bench.read(TXBTO), bench.counters()), (1, (0, 0)), "this frame was before the fault");
    bench.pass(100);
    assert_eq!(bench.counters(), (8, 0), "the next one meets it");
}

#[test]
fn a_queue_may_be_cancelled_without_a_remark() {
    let mut bench = Bench::with(Options::default(), &[(TXBC, 1 << 30 | 0x0800_0234)]);
    bench.put(0x10);
    bench.put(0x11);
    bench.told();
    bench.write(TXBCR, 0b01);
    assert_eq!(bench.told(), [Withdraw, Offer(0x11)]);
    assert_eq!((bench.read(TXBRP), bench.remarks()), (0b10, vec![]));
}

#[test]
fn after_bus_off_both_readings_differ_as_the_image_met_them() {
    for (policy, fifo, offered) in [(Skipped, [8, 7, 7, 0], 1), (Stuck, [4, 3, 7, 0], 0)] {
        let mut bench = four_waiting(policy);
        bench.fault(Some(Fault::BitErrors { attempts: 32 }));
        bench.pass(2000);
        assert!(bench.can.status(Unit::One).bus_off);
        bench.told();
        bench.write(TXBCR, u32::MAX);
        bench.write(CCCR, 0);
        assert_eq!(bench.fifo(), fifo);
        bench.pass(129 * 11 + 1);
        bench.put(0x20);
        assert_eq!(bench.told().len(), offered);
    }
}
