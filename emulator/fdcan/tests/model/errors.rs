//! Error counters, error states, bus-off and its end, faults of the bus.

use crate::bench::Notice::{Offer, Withdraw};
use crate::bench::*;
use fdcan_model::{BusError, Fault, Frame, Unit};

fn psr_state(bench: &mut Bench) -> u32 {
    bench.read(PSR) >> 5 & 0b111
}

#[test]
fn without_acknowledge_the_counter_ends_at_128_and_the_frame_is_repeated_for_ever() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::NoAcknowledge));
    bench.put(0x10);
    let mut counts = vec![0];
    while let Some(next) = bench.can.next_time().filter(|_| counts.len() < 40) {
        bench.pass_ns(next - bench.now);
        counts.push(bench.counters().0);
    }
    let expected: Vec<u32> = (0..40).map(|attempt| (8 * attempt).min(128)).collect();
    assert_eq!(counts, expected);
    assert_eq!((psr_state(&mut bench), bench.read(TXBRP)), (0b011, 1));
    assert_eq!(bench.read(IR) & (BO | EW | EP), EW | EP);
    assert!(!bench.can.status(Unit::One).bus_off);
    // Logged are only the errors that were counted.
    assert_eq!(bench.read(ECR) >> 16, 16);
    bench.pass(1000);
    assert_eq!(bench.read(PSR) & 7, 3);
}

#[test]
fn an_attempt_without_acknowledge_lasts_its_bits() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::NoAcknowledge));
    bench.put(0x10);
    let bits = Frame::standard(0x10, &[0x10]).bits() - 13;
    // Checksum delimiter, acknowledge slot, error flag 6, delimiter 8, intermission 3; passive 8 more.
    assert_eq!(bench.can.next_time(), Some(bench.now + u64::from(bits + 19) * BIT));
    bench.pass(u64::from(bits + 19) * 16);
    assert_eq!(bench.can.next_time(), Some(bench.now + u64::from(bits + 27) * BIT));
}

#[test]
fn when_somebody_acknowledges_again_the_waiting_frames_are_offered() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.put(0x11);
    bench.told();
    bench.fault(Some(Fault::NoAcknowledge));
    assert_eq!(bench.told(), [Withdraw]);
    bench.pass(5000);
    bench.fault(None);
    assert_eq!(bench.told(), [], "the attempt under way still fails");
    bench.pass(100);
    assert_eq!(bench.told(), [Offer(0x10), Offer(0x11)]);
    bench.write(IR, u32::MAX);
    bench.sent();
    assert_eq!((bench.counters(), psr_state(&mut bench)), ((127, 0), 0b010));
    assert_eq!(bench.read(IR) & EP, EP, "a status that ends is told as well");
}

#[test]
fn warning_and_passive_come_at_96_and_128() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    for (errors, state, flags) in [(11, 0b000, 0), (12, 0b010, EW), (15, 0b010, EW), (16, 0b011, EW | EP)] {
        while bench.counters().0 < 8 * errors {
            bench.can.failed(Unit::One, BusError::Bit0, bench.now);
        }
        assert_eq!((psr_state(&mut bench), bench.read(IR) & (EW | EP)), (state, flags), "{errors}");
    }
}

#[test]
fn a_passive_transmitter_still_counts_other_errors_and_leaves_the_bus() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::BitErrors { attempts: 32 }));
    bench.put(0x10);
    bench.put(0x11);
    while !bench.can.status(Unit::One).bus_off {
        let next = bench.can.next_time().unwrap();
        bench.pass_ns(next - bench.now);
    }
    // 16 attempts of 30 bits while active, 16 of 38 while passive; the first passive one is the 17th.
    assert!((1080 * BIT..1110 * BIT).contains(&(bench.now - 11 * BIT)), "{}", bench.now);
    assert_eq!((bench.counters().0, psr_state(&mut bench)), (248, 0b111));
    bench.pass_ns(100);
    assert_eq!((bench.read(CCCR), bench.read(TXBRP)), (INIT, 0b11), "INIT is set, the requests wait");
    assert_eq!(bench.read(IR) & (BO | EW | EP), BO | EW | EP);
    assert_eq!(bench.lines(), (true, false));
    assert_eq!(bench.can.next_time(), None, "without software nothing goes on");
}

/// A bench in bus-off with one frame waiting.
fn bus_off() -> Bench {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::BitErrors { attempts: 32 }));
    bench.put(0x10);
    bench.pass(2000);
    assert!(bench.can.status(Unit::One).bus_off);
    bench.write(IR, u32::MAX);
    bench.told();
    bench
}

#[test]
fn recovery_takes_129_times_eleven_recessive_bits() {
    let mut bench = bus_off();
    bench.write(CCCR, 0);
    let begin = bench.now + 100;
    assert_eq!(bench.read(PSR) & 7, 5, "the disturbance that led here");
    bench.pass_ns(begin + 5 * 11 * BIT - bench.now);
    assert_eq!(bench.counters(), (248, 5), "the receive counter counts the sequences");
    assert_eq!((bench.read(PSR) & 7, bench.read(PSR) & 7), (5, 7));
    bench.pass_ns(begin + 129 * 11 * BIT - 1 - bench.now);
    assert!(!bench.can.status(Unit::One).on_bus);
    assert_eq!((bench.can.peek(Unit::One, IR), bench.can.take_wire(Unit::One)), (0, vec![]));
    bench.pass_ns(1);
    assert!(bench.can.status(Unit::One).on_bus);
    assert_eq!((bench.counters(), psr_state(&mut bench)), ((0, 0), 0));
    assert_eq!(bench.read(IR) & (BO | EW | EP), BO | EW | EP);
    assert_eq!(bench.told(), [Offer(0x10)], "what waited is sent");
}

#[test]
fn cce_within_bus_off_throws_away_what_waited() {
    let mut bench = bus_off();
    bench.write(CCCR, INIT | CCE);
    bench.write(CCCR, INIT);
    bench.write(CCCR, 0);
    bench.pass(129 * 11 + 1);
    assert_eq!((bench.told(), bench.read(TXBRP)), (vec![], 0));
    assert!(bench.can.status(Unit::One).on_bus);
}

#[test]
fn setting_and_clearing_init_does_not_shorten_recovery() {
    let mut bench = bus_off();
    bench.write(CCCR, 0);
    bench.pass(129 * 11 - 20);
    bench.write(CCCR, INIT);
    bench.pass_ns(1000);
    bench.write(CCCR, 0);
    bench.pass(1000);
    assert!(bench.can.status(Unit::One).bus_off);
    bench.pass(500);
    assert!(!bench.can.status(Unit::One).bus_off);
}

#[test]
fn traffic_of_others_makes_recovery_longer() {
    let mut bench = bus_off();
    bench.write(CCCR, 0);
    let begin = bench.now + 100;
    let frame = Frame::standard(0x401, &[0xAA, 0, 0, 0, 0, 0, 0, 0]);
    bench.pass_ns(500 * BIT);
    bench.can.received(Unit::One, &frame, bench.now);
    // 123 bits that hold one sequence instead of eleven.
    bench.pass_ns(begin + (129 * 11 + 100) * BIT - bench.now);
    assert!(!bench.can.status(Unit::One).on_bus);
    bench.pass(22);
    assert!(bench.can.status(Unit::One).on_bus);
}

#[test]
fn reading_psr_takes_the_last_error_and_peeking_does_not() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.can.failed(Unit::One, BusError::Form, bench.now);
    assert_eq!(bench.can.peek(Unit::One, PSR) & 7, 2);
    assert_eq!((bench.read(PSR) & 7, bench.read(PSR) & 7), (2, 7));
    bench.sent();
    assert_eq!(bench.read(PSR) & 7, 0);
    bench.can.receive_failed(Unit::One, BusError::Crc, bench.now);
    assert_eq!((bench.read(PSR) & 7, bench.read(IR) >> 27 & 1), (6, 1));
    bench.receive(5);
    assert_eq!(bench.read(PSR) & 7, 0);
}

#[test]
fn the_error_log_stops_at_255_overflows_and_is_taken_by_reading() {
    let mut bench = Bench::image(Default::default());
    for _ in 0..255 {
        bench.can.receive_failed(Unit::One, BusError::Stuff, bench.now);
    }
    assert_eq!((bench.can.peek(Unit::One, ECR) >> 16, bench.read(IR) >> 22 & 1), (255, 0));
    bench.can.receive_failed(Unit::One, BusError::Stuff, bench.now);
    assert_eq!(bench.read(IR) >> 22 & 1, 1);
    assert_eq!((bench.read(ECR) >> 16, bench.read(ECR) >> 16), (255, 0));
}

#[test]
fn receive_errors_count_by_one_make_passive_and_heal() {
    let mut bench = Bench::image(Default::default());
    for _ in 0..3 {
        bench.can.receive_failed(Unit::One, BusError::Stuff, bench.now);
    }
    assert_eq!(bench.counters(), (0, 3));
    bench.receive(5);
    assert_eq!(bench.counters(), (0, 2));
    for _ in 0..200 {
        bench.can.receive_failed(Unit::One, BusError::Stuff, bench.now);
    }
    assert_eq!(bench.counters(), (0, 0xFF), "127 and the bit that says passive");
    assert!(!bench.can.status(Unit::One).bus_off);
    bench.receive(5);
    assert_eq!(bench.counters(), (0, 127));
}

#[test]
fn a_stuck_bus_takes_a_transmitter_off_and_it_cannot_come_back() {
    let mut bench = Bench::image(Default::default());
    bench.put(0x10);
    bench.told();
    bench.fault(Some(Fault::StuckDominant));
    assert_eq!(bench.told(), [Withdraw]);
    bench.pass(6 + 8 * 31);
    assert!(bench.can.status(Unit::One).bus_off);
    assert_eq!(bench.read(PSR) & 7, 4);
    bench.write(CCCR, 0);
    bench.pass(100_000);
    assert!(bench.can.status(Unit::One).bus_off, "no recessive bit, no recovery");
    assert_eq!(bench.read(PSR) & 7, 7, "and nothing is monitored");
    bench.fault(None);
    bench.pass(129 * 11);
    assert!(bench.can.status(Unit::One).on_bus);
    assert_eq!(bench.told(), [Offer(0x10)]);
}

#[test]
fn a_stuck_bus_makes_a_silent_node_passive_and_it_joins_again() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::StuckDominant));
    bench.pass(6);
    assert_eq!(bench.counters(), (0, 1));
    bench.pass(8);
    assert_eq!(bench.counters(), (0, 9));
    bench.pass(1000);
    assert_eq!((bench.counters(), bench.can.status(Unit::One).bus_off), ((0, 0xFF), false));
    bench.fault(None);
    bench.put(0x10);
    bench.pass(10);
    assert_eq!(bench.told(), []);
    bench.pass(1);
    assert_eq!(bench.told(), [Offer(0x10)]);
}

#[test]
fn a_short_burst_of_errors_ends_by_itself() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::BitErrors { attempts: 3 }));
    bench.put(0x10);
    bench.pass(1000);
    assert_eq!((bench.counters(), bench.told()), ((24, 0), vec![Offer(0x10)]));
    bench.sent();
    assert_eq!(bench.counters(), (23, 0));
}

#[test]
fn a_fault_of_one_controller_does_not_touch_the_other() {
    let mut bench = Bench::image(Default::default());
    bench.fault(Some(Fault::NoAcknowledge));
    bench.put(0x10);
    bench.pass(5000);
    let other = bench.can.status(Unit::Two);
    assert_eq!((other.transmit_errors, other.on_bus), (0, false));
}
