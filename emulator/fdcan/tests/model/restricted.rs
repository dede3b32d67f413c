//! The message memory that answers too late, restricted operation, and INIT that is read late after bus-off.

use crate::bench::Notice::{Offer, Withdraw};
use crate::bench::*;
use fdcan_model::{BusError, Fault, Handler, RemarkKind, Unit};

/// CCCR: restricted operation.
const ASM: u32 = 1 << 2;
/// IR: the message memory did not answer in time.
const MRAF: u32 = 1 << 17;

/// A bench whose controller could not read the frame it was to send.
fn restricted() -> Bench {
    let mut bench = Bench::image(Default::default());
    bench.can.starve(Unit::One, Handler::Transmit, bench.now);
    assert_eq!(bench.read(IR) & MRAF, 0, "nothing to read yet");
    bench.put(0x10);
    bench
}

#[test]
fn a_frame_that_cannot_be_read_takes_the_controller_into_restricted_operation() {
    let mut bench = restricted();
    assert_eq!((bench.read(CCCR), bench.read(IR) & MRAF), (ASM, MRAF));
    assert!(bench.can.status(Unit::One).on_bus);
    assert_eq!(bench.lines(), (false, false), "the image of this bench asked for other flags");
    bench.write(IE, MRAF);
    assert_eq!(bench.lines(), (true, false));
    assert!(bench.remarks().is_empty());
}

#[test]
fn a_restricted_controller_sends_nothing_and_receives_all() {
    let mut bench = restricted();
    bench.put(0x11);
    bench.pass(5000);
    assert_eq!((bench.told(), bench.read(TXBRP)), (vec![], 0b11));
    bench.receive(0x423);
    assert_eq!(bench.take(), Some((0x423, 0x23)));
    // Its flag is taken back, and it stays as it is.
    bench.write(IR, u32::MAX);
    bench.put(0x12);
    assert_eq!((bench.told(), bench.read(IR) & MRAF, bench.read(CCCR)), (vec![], 0, ASM));
}

#[test]
fn a_restricted_controller_counts_no_errors() {
    let mut bench = restricted();
    for _ in 0..40 {
        bench.can.receive_failed(Unit::One, BusError::Stuff, bench.now);
    }
    bench.fault(Some(Fault::BitErrors { attempts: 32 }));
    bench.pass(3000);
    assert_eq!((bench.counters(), bench.can.status(Unit::One).bus_off), ((0, 0), false));
}

#[test]
fn clearing_asm_ends_restricted_operation_and_what_waited_leaves() {
    let mut bench = restricted();
    bench.write(CCCR, 0);
    assert_eq!((bench.read(CCCR), bench.told()), (0, vec![Offer(0x10)]));
    // Once only: the memory answers again.
    bench.sent();
    bench.put(0x11);
    assert_eq!((bench.told(), bench.read(CCCR)), (vec![Offer(0x11)], 0));
    assert!(bench.remarks().is_empty());
}

#[test]
fn software_sets_asm_only_in_configuration() {
    let mut bench = Bench::image(Default::default());
    bench.write(CCCR, ASM);
    assert_eq!((bench.read(CCCR), bench.remarks()), (0, vec![(RemarkKind::Ignored, "CCCR")]));
    bench.open();
    bench.write(CCCR, INIT | CCE | ASM);
    bench.write(CCCR, ASM);
    bench.pass(20);
    bench.put(0x10);
    assert_eq!((bench.told(), bench.read(CCCR)), (vec![], ASM));
}

#[test]
fn a_frame_on_the_wire_is_finished_before_the_next_one_cannot_be_read() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.can.begun(Unit::One, bench.now);
    bench.put(0x11);
    bench.can.starve(Unit::One, Handler::Transmit, bench.now);
    assert_eq!(bench.read(CCCR), 0);
    bench.told();
    bench.sent();
    assert_eq!((bench.read(CCCR), bench.read(TXBRP), bench.told()), (ASM, 0b10, vec![Withdraw]));
}

#[test]
fn a_received_frame_that_cannot_be_stored_is_lost_and_told_and_nothing_else_changes() {
    let mut bench = Bench::image(Default::default());
    bench.can.starve(Unit::One, Handler::Receive, bench.now);
    bench.receive(0x423);
    assert_eq!((bench.held(), bench.read(IR) & MRAF, bench.read(CCCR)), ([0; 5], MRAF, 0));
    bench.receive(0x424);
    assert_eq!(bench.take(), Some((0x424, 0x24)));
}

#[test]
fn after_bus_off_init_is_read_later_than_the_flag_and_only_then_cce_can_be_set() {
    for lag in [0, 50_000] {
        let mut bench = Bench::image(Default::default());
        bench.can.set_init_lag(Unit::One, lag);
        bench.fault(Some(Fault::BitErrors { attempts: 32 }));
        bench.put(0x10);
        while !bench.can.status(Unit::One).bus_off {
            let next = bench.can.next_time().expect("attempts");
            bench.pass_ns(next - bench.now);
        }
        let begin = bench.now;
        assert_eq!((bench.read(IR) & BO, bench.read(CCCR)), (BO, 0), "lag {lag}");
        assert!(!bench.can.status(Unit::One).on_bus, "the bus is left at once");
        bench.write(CCCR, INIT | CCE);
        assert_eq!(bench.remarks().first(), Some(&(RemarkKind::Ignored, "CCCR")));
        bench.pass_ns(begin + 99 + lag - bench.now);
        assert_eq!(bench.can.peek(Unit::One, CCCR), 0);
        bench.pass_ns(1);
        assert_eq!(bench.can.peek(Unit::One, CCCR), INIT);
    }
}
