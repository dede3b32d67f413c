//! Sending: FIFO, queue, dedicated buffers, what the wire is told, retransmission.

use crate::bench::Notice::{Offer, Withdraw};
use crate::bench::*;
use fdcan_model::{BusError, Frame, Id, Options, RemarkKind, Unit, WireEvent};

/// A queue of eight in place of the image's FIFO.
const QUEUE: u32 = 1 << 30 | 0x0800_0234;
/// Two dedicated buffers and a FIFO of two.
const MIXED: u32 = 0x0202_0234;

#[test]
fn a_fifo_offers_at_once_and_in_order() {
    let mut bench = Bench::image(Default::default());
    assert_eq!(bench.fifo(), [8, 0, 0, 0]);
    for id in [0x30, 0x20, 0x10] {
        assert!(bench.put(id));
    }
    assert_eq!(bench.told(), [Offer(0x30), Offer(0x20), Offer(0x10)]);
    assert_eq!((bench.fifo(), bench.read(TXBRP)), ([5, 0, 3, 0], 0b111));
    bench.sent();
    assert_eq!((bench.fifo(), bench.read(TXBRP), bench.read(TXBTO)), ([6, 1, 3, 0], 0b110, 0b001));
    assert_eq!(bench.told(), [], "the rest stays offered");
}

#[test]
fn a_full_fifo_says_so_and_goes_round() {
    let mut bench = Bench::image(Default::default());
    for round in 0..3 {
        let taken = (0..20).take_while(|_| bench.put(0x10 + round)).count();
        assert_eq!(taken, if round == 0 { 8 } else { 5 });
        assert_eq!(bench.fifo()[0], 0);
        assert_eq!(bench.fifo()[3], 1);
        for _ in 0..5 {
            bench.sent();
        }
        assert_eq!(bench.fifo()[0], 5);
    }
    assert_eq!(bench.remarks(), []);
}

#[test]
fn the_offered_frame_is_the_element() {
    let mut bench = Bench::image(Default::default());
    let words = [1 << 30 | 0x1234_5678, 5 << 16, 0x0403_0201, 0x0807_0605];
    for (index, word) in words.into_iter().enumerate() {
        bench.set(TRANSMIT_AT + 4 * index as u32, word);
    }
    bench.write(TXBAR, 1);
    bench.element(1, 0x55);
    bench.set(TRANSMIT_AT + 16, 1 << 29 | 0x55 << 18);
    bench.write(TXBAR, 2);
    let frames: Vec<Frame> = bench
        .can
        .take_wire(Unit::One)
        .into_iter()
        .filter_map(|event| if let WireEvent::Offer { frame, .. } = event { Some(frame) } else { None })
        .collect();
    assert_eq!(frames[0].id, Id::Extended(0x1234_5678));
    assert_eq!(frames[0].payload(), [1, 2, 3, 4, 5]);
    assert_eq!((frames[1].id, frames[1].remote, frames[1].length), (Id::Standard(0x55), true, 1));
}

#[test]
fn several_requests_in_one_write_keep_the_fifos_order() {
    let mut bench = Bench::image(Default::default());
    for _ in 0..6 {
        bench.put(1);
        bench.sent();
    }
    bench.told();
    for (place, id) in [(6, 0x60), (7, 0x70), (0, 0x80)] {
        bench.element(place, id);
    }
    bench.write(TXBAR, 0b1100_0001);
    assert_eq!(bench.told(), [Offer(0x60), Offer(0x70), Offer(0x80)]);
    assert_eq!(bench.fifo(), [5, 6, 1, 0]);
}

#[test]
fn transmission_is_told_only_for_the_buffers_that_ask() {
    let mut bench = Bench::image(Default::default());
    bench.write(TXBTIE, 0b10);
    bench.put(1);
    bench.put(2);
    bench.sent();
    assert_eq!(bench.read(IR), 0);
    bench.sent();
    assert_eq!(bench.read(IR), TC | TFE);
    assert_eq!(bench.read(TXBTO), 0b11);
    // A new request of the same buffer takes the history back.
    for _ in 0..6 {
        bench.put(3);
        bench.sent();
    }
    bench.put(4);
    assert_eq!(bench.read(TXBTO), 0xFE);
}

#[test]
fn nothing_is_offered_before_the_controller_has_joined() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, INIT);
    bench.pass_ns(1000);
    bench.put(0x10);
    assert_eq!((bench.told(), bench.read(TXBRP)), (vec![], 1));
    bench.write(CCCR, 0);
    bench.pass(11);
    assert_eq!(bench.told(), []);
    bench.pass(1);
    assert_eq!(bench.told(), [Offer(0x10)]);
}

#[test]
fn setting_init_takes_back_what_waits_and_forgets_nothing() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.told();
    bench.write(CCCR, INIT);
    bench.pass_ns(1000);
    assert_eq!((bench.told(), bench.read(TXBRP)), (vec![Withdraw], 1));
    bench.write(CCCR, 0);
    bench.pass(12);
    assert_eq!(bench.told(), [Offer(0x10)]);
}

#[test]
fn a_queue_sends_the_lowest_identifier_first_and_of_equals_the_lowest_buffer() {
    let mut bench = Bench::with(Options::default(), &[(TXBC, QUEUE)]);
    assert_eq!(bench.fifo(), [0, 0, 0, 0], "a queue has no free level and no get index");
    bench.put(0x30);
    bench.put(0x20);
    bench.put(0x20);
    bench.told();
    bench.put(0x10);
    assert_eq!(bench.told(), [Withdraw, Offer(0x10), Offer(0x20), Offer(0x20), Offer(0x30)]);
    for done in [0b1000, 0b1010, 0b1110, 0b1111] {
        bench.sent();
        assert_eq!(bench.read(TXBTO), done);
    }
}

#[test]
fn a_full_queue_says_so_and_its_put_index_finds_the_free_place() {
    let mut bench = Bench::with(Options::default(), &[(TXBC, QUEUE)]);
    for id in 0..8 {
        assert!(bench.put(0x20 + (id ^ 5)));
    }
    assert_eq!(bench.fifo()[3], 1);
    // The lowest identifier stands in buffer 5.
    bench.sent();
    assert_eq!(bench.fifo(), [0, 0, 5, 0]);
}

#[test]
fn a_frame_on_the_wire_is_not_taken_back_for_a_better_one() {
    let mut bench = Bench::with(Options::default(), &[(TXBC, QUEUE)]);
    bench.put(0x30);
    bench.can.begun(Unit::One, bench.now);
    bench.put(0x10);
    assert_eq!(bench.told(), [Offer(0x30), Offer(0x10)]);
}

#[test]
fn dedicated_buffers_compete_with_the_oldest_of_the_fifo() {
    let mut bench = Bench::with(Options::default(), &[(TXBC, MIXED)]);
    assert_eq!(bench.fifo(), [2, 2, 2, 0]);
    for (buffer, id) in [(0, 0x15), (1, 0x40), (2, 0x20), (3, 0x10)] {
        bench.element(buffer, id);
    }
    bench.write(TXBAR, 0b1111);
    assert_eq!(bench.told(), [Offer(0x15), Offer(0x20), Offer(0x10), Offer(0x40)]);
    assert_eq!(bench.fifo(), [0, 2, 2, 1]);
}

#[test]
fn a_lost_or_failed_attempt_is_repeated() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.told();
    bench.can.lost_arbitration(Unit::One, bench.now);
    bench.can.failed(Unit::One, BusError::Bit1, bench.now);
    assert_eq!((bench.told(), bench.read(TXBRP), bench.counters()), (vec![], 1, (8, 0)));
    assert_eq!(bench.read(PSR) & 7, 4);
    bench.sent();
    assert_eq!((bench.read(TXBTO), bench.counters()), (1, (7, 0)));
}

#[test]
fn without_automatic_retransmission_one_attempt_ends_the_request() {
    let mut bench = Bench::with(Options::default(), &[(CCCR, INIT | CCE | DAR)]);
    bench.put(0x10);
    bench.put(0x20);
    bench.told();
    bench.can.lost_arbitration(Unit::One, bench.now);
    assert_eq!(bench.told(), [Withdraw, Offer(0x20)]);
    assert_eq!([TXBRP, TXBTO, TXBCF].map(|offset| bench.read(offset)), [0b10, 0, 0b01]);
    bench.can.failed(Unit::One, BusError::Acknowledge, bench.now);
    assert_eq!([TXBRP, TXBTO, TXBCF].map(|offset| bench.read(offset)), [0, 0, 0b11]);
    assert_eq!(bench.fifo(), [8, 2, 2, 0]);
}

#[test]
fn requests_that_cannot_be_are_remarked_on() {
    let mut bench = Bench::image(Default::default());
    bench.write(TXBAR, 1 << 8);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "TXBAR")]);
    bench.put(1);
    bench.write(TXBAR, 1);
    assert_eq!(bench.remarks(), [(RemarkKind::Ignored, "TXBAR")]);
    bench.element(5, 5);
    bench.write(TXBAR, 1 << 5);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "TXBAR")]);
    bench.write(TXBAR, 1 << 1);
    assert_eq!(bench.remarks(), [(RemarkKind::Unwritten, "RAM")], "nobody wrote this element");
}

#[test]
fn an_element_written_while_it_waits_is_remarked_on() {
    let mut bench = Bench::image(Default::default());
    bench.put(1);
    bench.set(TRANSMIT_AT + 12, 0);
    assert_eq!(bench.remarks(), [(RemarkKind::Suspicious, "RAM")]);
    bench.set(TRANSMIT_AT + 16, 0);
    bench.sent();
    bench.set(TRANSMIT_AT + 12, 0);
    assert_eq!(bench.remarks(), []);
}
