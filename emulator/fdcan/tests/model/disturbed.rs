//! Bits that fall over in registers and in the message memory, and a receive queue that lets nothing go.

use crate::bench::Notice::Offer;
use crate::bench::*;
use fdcan_model::{RemarkKind, Unit};

fn flip(bench: &mut Bench, offset: u32, bit: u32) {
    bench.can.flip(Unit::One, offset, bit, bench.now);
}

#[test]
fn a_controller_at_another_rate_understands_nobody_and_is_off_the_bus_by_what_it_sends() {
    let mut bench = Bench::image(Default::default());
    // The divider is 11 instead of 10.
    flip(&mut bench, NBTP, 16);
    flip(&mut bench, NBTP, 17);
    bench.receive(0x423);
    assert_eq!((bench.take(), bench.counters().1), (None, 1));
    bench.put(0x10);
    bench.pass(3000);
    assert!(bench.can.status(Unit::One).bus_off);
    // Set up anew it is as before.
    bench.open();
    bench.configure(Unit::One, &IMAGE);
    bench.write(CCCR, 0);
    bench.pass(2000);
    bench.put(0x11);
    assert_eq!(bench.told(), [Offer(0x11)]);
    bench.sent();
    bench.receive(0x423);
    assert_eq!(bench.take(), Some((0x423, 0x23)));
}

#[test]
fn a_bit_of_a_filter_or_of_an_enable_that_falls_over_has_its_effect_without_a_remark() {
    let mut bench = Bench::image(Default::default());
    // Into no queue, in all filters.
    for filter in 0..13 {
        bench.can.flip_memory(4 * filter, 27, bench.now);
    }
    bench.receive(0x423);
    assert_eq!(bench.take(), None);
    for filter in 0..13 {
        bench.can.flip_memory(4 * filter, 27, bench.now);
    }
    flip(&mut bench, IE, 0);
    bench.receive(0x423);
    assert_eq!((bench.lines().0, bench.remarks()), (false, vec![]));
    flip(&mut bench, IE, 0);
    assert!(bench.lines().0);
}

#[test]
fn a_stuck_receive_queue_hands_out_the_same_frame_until_its_configuration_is_opened() {
    let mut bench = Bench::image(Default::default());
    bench.receive(0x423);
    bench.can.stick_receive(Unit::One, bench.now);
    for _ in 0..100 {
        assert_eq!(bench.take(), Some((0x423, 0x23)));
    }
    bench.open();
    bench.join();
    assert_eq!(bench.take(), None);
    bench.receive(0x424);
    assert_eq!(bench.take(), Some((0x424, 0x24)));
    assert!(bench.remarks().iter().all(|(kind, _)| *kind != RemarkKind::Suspicious));
}
