//! The receive FIFOs: indices, full, overwriting, acknowledgement, and frames before the controller has joined.

use crate::bench::*;
use fdcan_model::{Frame, Options, RemarkKind, Unit};

/// FIFO 0 with these bits of RXF0C beside the image's start address.
fn fifo(bits: u32) -> Bench {
    Bench::with(Options::default(), &[(RXF0C, bits | RECEIVE_AT)])
}

const FULL: u32 = 1 << 2;
const LOST: u32 = 1 << 3;

#[test]
fn a_frame_is_stored_with_identifier_length_and_data() {
    let mut bench = Bench::image(Default::default());
    bench.receive_frame(&Frame::standard(0x423, &[1, 2, 3, 4, 5, 6]));
    let words = [0, 4, 8, 12].map(|offset| bench.can.peek_memory(RECEIVE_AT + offset));
    assert_eq!(words, [0x423 << 18, 6 << 16, 0x0403_0201, 0x0605]);
    assert_eq!(bench.held(), [1, 0, 1, 0, 0]);
    assert_eq!(bench.read(IR), 1);
}

#[test]
fn frames_come_out_in_order_across_the_end_of_the_fifo() {
    let mut bench = fifo(3 << 16);
    for id in 0x100..0x10A {
        bench.receive(id);
        assert_eq!(bench.take(), Some((id.into(), u32::from(id) & 0xFF)));
    }
    assert_eq!(bench.held(), [0, 1, 1, 0, 0]);
}

#[test]
fn a_full_fifo_keeps_what_it_has_and_tells_the_loss() {
    let mut bench = fifo(2 << 16);
    bench.receive(1);
    assert_eq!(bench.read(IR) & (FULL | LOST), 0);
    bench.receive(2);
    assert_eq!(bench.read(IR) & (FULL | LOST), FULL);
    bench.receive(3);
    assert_eq!(bench.held(), [2, 0, 0, 1, 1]);
    assert_eq!(bench.read(IR) & (FULL | LOST), FULL | LOST);
    assert_eq!([bench.take(), bench.take(), bench.take()], [Some((1, 1)), Some((2, 2)), None]);
    // The bit in the status register is a copy of the flag.
    bench.write(IR, LOST);
    assert_eq!(bench.held()[4], 0);
}

#[test]
fn an_overwriting_fifo_drops_the_oldest_without_a_word() {
    let mut bench = fifo(1 << 31 | 2 << 16);
    for id in 1..4 {
        bench.receive(id);
    }
    assert_eq!(bench.held(), [2, 1, 1, 1, 0]);
    assert_eq!([bench.take(), bench.take(), bench.take()], [Some((2, 2)), Some((3, 3)), None]);
}

#[test]
fn the_watermark_is_told_when_it_is_reached() {
    let mut bench = fifo(2 << 24 | 8 << 16);
    bench.receive(1);
    assert_eq!(bench.read(IR) & 0b10, 0);
    bench.receive(2);
    assert_eq!(bench.read(IR) & 0b10, 0b10);
    bench.write(IR, 0b10);
    bench.receive(3);
    assert_eq!(bench.read(IR) & 0b10, 0);
}

#[test]
fn acknowledging_the_last_of_several_takes_all_of_them() {
    let mut bench = Bench::image(Default::default());
    for id in 1..5 {
        bench.receive(id);
    }
    bench.write(RXF0A, 2);
    assert_eq!(bench.held(), [1, 3, 4, 0, 0]);
    assert_eq!(bench.remarks(), []);
}

#[test]
fn acknowledging_what_the_fifo_does_not_hold_is_remarked_on() {
    let mut bench = Bench::image(Default::default());
    bench.receive(1);
    bench.write(RXF0A, 4);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "RXF0A")]);
    assert_eq!(bench.held()[1], 5, "the silicon does not check");
}

#[test]
fn a_fifo_without_places_loses_every_frame() {
    let mut bench = fifo(0);
    bench.receive(1);
    assert_eq!(bench.held(), [0, 0, 0, 0, 1]);
    assert_eq!(bench.read(IR), LOST);
}

#[test]
fn fifo_1_has_flags_of_its_own() {
    let to_fifo_1 = 2 << 27 | 0x7FF;
    let mut bench = Bench::with(Options::default(), &[(RXF1C, 0x0001_1000), (SIDFC, 1 << 16 | 0x800)]);
    bench.set(0x800, to_fifo_1);
    bench.receive(7);
    assert_eq!((bench.read(IR), bench.read(RXF0S)), (1 << 4 | 1 << 6, 0));
    assert_eq!(bench.read(RXF1S), 1 | 1 << 24);
    bench.receive(8);
    assert_eq!(bench.read(IR) >> 7 & 1, 1);
}

#[test]
fn the_controller_joins_after_eleven_recessive_bits() {
    let mut bench = Bench::new(Options::default());
    bench.configure(Unit::One, &IMAGE);
    bench.write(CCCR, 0);
    bench.pass_ns(100 + 11 * BIT - 1);
    assert!(!bench.can.status(Unit::One).on_bus);
    assert_eq!(bench.can.peek(Unit::One, PSR) >> 3 & 0b11, 0, "synchronising");
    bench.pass_ns(1);
    assert!(bench.can.status(Unit::One).on_bus);
    assert_eq!(bench.read(PSR) >> 3 & 0b11, 1, "idle");
}

#[test]
fn a_frame_under_way_while_the_controller_joins_is_lost() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, INIT);
    bench.pass_ns(1000);
    bench.write(CCCR, 0);
    bench.pass_ns(100 + 5 * BIT);
    // This frame began before INIT was cleared; its end is eleven recessive bits.
    bench.can.received(Unit::One, &Frame::standard(1, &[]), bench.now);
    assert_eq!(bench.held()[0], 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Lost, "PSR")]);
    assert_eq!(bench.can.next_time(), Some(bench.now - 10 + 11 * BIT), "the wait begins again");
    // This one began before the controller had joined, and ends after.
    bench.pass(20);
    bench.can.received(Unit::One, &Frame::standard(2, &[]), bench.now);
    assert_eq!(bench.remarks(), [(RemarkKind::Lost, "PSR")]);
    bench.receive(3);
    assert_eq!(bench.take(), Some((3, 3)));
}

#[test]
fn a_stopped_controller_receives_nothing() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, INIT);
    bench.pass_ns(1000);
    bench.receive(1);
    assert_eq!((bench.held()[0], bench.read(IR)), (0, 0));
}
