//! The project's own configuration, with the values that were seen by running the image.

use crate::bench::*;
use fdcan_model::{Options, Unit};

/// Frames of the arm for the host: positions (3) and properties (6) of the motors 1 to 7 and 11 to 14, properties of
/// the force/torque sensor (8) and the safety module (10), force (10) and torque (11) of the sensor.
fn identifiers() -> Vec<u16> {
    let motors = (1..=7).chain(11..=14);
    let reply = |node: u16, group: u16| 0x400 | node << 5 | group;
    let mut ids: Vec<u16> = motors.flat_map(|node| [reply(node, 3), reply(node, 6)]).collect();
    ids.extend([reply(8, 6), reply(10, 6), reply(8, 10), reply(8, 11)]);
    ids
}

fn image() -> Bench {
    let mut bench = Bench::image(Default::default());
    for (index, pair) in identifiers().chunks(2).enumerate() {
        let element = 0b01 << 30 | 1 << 27 | u32::from(pair[0]) << 16 | u32::from(pair[1]);
        bench.set(4 * index as u32, element);
    }
    bench
}

#[test]
fn exactly_26_identifiers_of_2048_pass() {
    let mut bench = image();
    let mut passed = Vec::new();
    for id in 0..0x800 {
        bench.receive(id);
        passed.extend(bench.take().map(|(id, _)| id as u16));
    }
    let mut expected = identifiers();
    expected.sort_unstable();
    assert_eq!(passed.len(), 26);
    assert_eq!(passed, expected);
    assert_eq!(bench.remarks(), []);
}

#[test]
fn the_bit_rate_is_a_million_sampled_at_three_quarters() {
    let timing = image().can.status(Unit::One).timing.unwrap();
    assert_eq!((timing.bits_per_second(), timing.sample_point_per_mille()), (1_000_000, 750));
    assert_eq!((timing.quanta(), timing.jump, timing.bits(11)), (8, 1, 11_000));
}

#[test]
fn the_image_configures_and_runs_without_a_remark() {
    let mut bench = image();
    for id in 0..100 {
        bench.put(1 + id % 0x1F);
        bench.sent();
        bench.receive(0x423);
        assert!(bench.take().is_some());
    }
    assert_eq!(bench.remarks(), []);
    let registers = [NBTP, SIDFC, RXF0C, TXBC, GFC, IE, ILS].map(|offset| bench.read(offset));
    assert_eq!(registers, [0x0009_0401, 0x000D_0000, 0x0020_0034, 0x0800_0234, 0x2B, 0x0200_0209, 0x200]);
}

#[test]
fn the_host_bus_fills_its_fifo_of_32() {
    let mut bench = Bench::new(Options::default());
    bench.configure(Unit::Two, &[(NBTP, 0x0009_0401), (TXBC, 0x2000_06B8)]);
    bench.can.write(Unit::Two, CCCR, 0, bench.now);
    bench.pass(20);
    for place in 0..32 {
        for word in 0..4 {
            bench.set(0x6B8 + 16 * place + 4 * word, 0);
        }
        bench.can.write(Unit::Two, TXBAR, 1 << place, bench.now);
    }
    assert_eq!(bench.can.peek(Unit::Two, TXFQS), 1 << 21);
    assert_eq!(bench.can.take_wire(Unit::Two).len(), 32);
    assert_eq!(bench.remarks(), []);
}
