//! Frame lengths against hand counts, an independent computation and the table of docs/barrett-can.md.

use proptest::prelude::*;
use puck::{
    CanFrame, CanId, Drives, Group, Node, PropertyId, PuckTorque, Ratios, Transmission, device, force_torque, get,
    packed_torques,
};
use sim::Noise;
use sim::wire::{frame_bits, frame_crc};

fn frame(id: u16, payload: &[u8]) -> CanFrame {
    CanFrame::from_slice(CanId::new(id).unwrap(), payload).unwrap()
}

#[test]
fn a_frame_of_zeros_is_stuffed_after_every_fifth_bit() {
    // By hand: SOF, identifier, control and CRC are 34 dominant bits, hence 6 stuff bits, and 13 bits follow.
    let zeros = frame(0, &[]);
    assert_eq!(frame_crc(&zeros), 0);
    assert_eq!(frame_bits(&zeros), 34 + 6 + 13);
}

#[test]
fn checksum_and_length_equal_an_independent_computation() {
    // Polynomial division of integers and stuffing of strings in another language; columns id, data, CRC, bits.
    let cases: [(u16, &[u8], u16, u32); 8] = [
        (0x014, &[0x01], 0x7753, 58),
        (0x404, &[0x30], 0x2ADE, 58),
        (0x401, &[0xAA, 0, 0, 0, 0, 0, 0, 0], 0x5554, 123),
        (0x423, &[0x80, 0, 0], 0x1678, 77),
        (0x7FF, &[0xFF; 8], 0x4C89, 126),
        (0x00A, &[0xAA, 0, 1, 0, 0, 0], 0x6706, 105),
        (0x540, &[0x88, 0, 2, 0], 0x3E18, 87),
        // Five equal bits, then four complements: the stuff bit counts for the next run.
        (0x078, &[0x0F, 0x87, 0xC3], 0x554B, 77),
    ];
    for (id, data, crc, bits) in cases {
        let frame = frame(id, data);
        assert_eq!((frame_crc(&frame), frame_bits(&frame)), (crc, bits), "{frame:?}");
    }
}

proptest! {
    #[test]
    fn no_frame_is_shorter_than_nominal_or_longer_than_the_worst_case(
        id in 0_u16..=0x7FF,
        payload in proptest::collection::vec(prop_oneof![Just(0_u8), Just(0xFF), any::<u8>()], 0..=8),
    ) {
        let bytes = payload.len() as u32;
        let nominal = 47 + 8 * bytes;
        let bits = frame_bits(&frame(id, &payload));
        prop_assert!(bits >= nominal && bits <= nominal + (34 + 8 * bytes - 1) / 4);
    }
}

/// GET P, seven positions, two torque frames; and with sensor: GET FT, force, torque. Bits per cycle of 2000 cycles
/// with joints anywhere within their limits, torques within the library's limits, forces to 20 N and torques to 1 N m.
fn mean_cycle(with_sensor: bool) -> f64 {
    let transmission = Transmission::new(&Ratios::WAM7).unwrap();
    let drives = Drives::new([4096; 7], [2700, 2700, 2700, 2700, 6500, 6500, 17474]).unwrap();
    let limits = [(-2.6, 2.6), (-2.0, 2.0), (-2.8, 2.8), (-0.9, 3.1), (-4.76, 1.24), (-1.6, 1.6), (-3.0, 3.0)];
    let mut noise = Noise::new(7, 0);
    let cycles = 2000;
    let mut bits = frame_bits(&get(Group::ARM, PropertyId::POSITION)) * cycles;
    if with_sensor {
        bits += frame_bits(&force_torque::get_wrench()) * cycles;
    }
    for _ in 0..cycles {
        let joints = limits.map(|(low, high)| noise.uniform(low, high));
        let counts = drives.counts(&transmission.motor_from_joint(&joints)).unwrap();
        for (node, counts) in Node::ARM.into_iter().zip(counts) {
            bits += frame_bits(&device::position_frame(node, counts, None));
        }
        let torques = [25.0, 20.0, 15.0, 15.0, 5.0, 5.0, 5.0].map(|limit| noise.uniform(-limit, limit));
        let [a, b, c, d, e, f, g] = drives.torques(&transmission.motor_torques_from_joint(&torques)).unwrap();
        bits += frame_bits(&packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [a, b, c, d]));
        bits += frame_bits(&packed_torques(Group::WRIST_TORQUES, PropertyId::TORQUE, [e, f, g, PuckTorque::ZERO]));
        if with_sensor {
            let mut counts = |limit: f64| std::array::from_fn(|_| noise.uniform(-limit, limit) as i16);
            bits += frame_bits(&device::force_frame(counts(20.0 * 256.0)));
            bits += frame_bits(&device::torque_frame(counts(4096.0), None));
        }
    }
    f64::from(bits) / f64::from(cycles)
}

#[test]
fn the_mean_cycle_has_the_documented_length() {
    // Table 6.2: 811 us for the arm, 1068 us with the sensor; what "random" meant there may shift it by a bit or three.
    assert!((mean_cycle(false) - 811.0).abs() < 5.0, "{}", mean_cycle(false));
    assert!((mean_cycle(true) - 1068.0).abs() < 6.0, "{}", mean_cycle(true));
}
