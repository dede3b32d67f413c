//! Lengths of frames on the wire, and their order in arbitration.

use fdcan_model::{Frame, Id};

#[test]
fn the_length_of_a_frame_counts_its_stuff_bits() {
    // Computed independently, by polynomial division of integers and stuffing of strings. The first also by hand: 34
    // dominant bits, 6 stuff bits, 13 bits of tail.
    let cases: [(u16, &[u8], u32); 8] = [
        (0x000, &[], 53),
        (0x014, &[0x01], 58),
        (0x404, &[0x30], 58),
        (0x401, &[0xAA, 0, 0, 0, 0, 0, 0, 0], 123),
        (0x423, &[0x80, 0, 0], 77),
        (0x7FF, &[0xFF; 8], 126),
        (0x540, &[0x88, 0, 2, 0], 87),
        (0x078, &[0x0F, 0x87, 0xC3], 77),
    ];
    for (id, data, bits) in cases {
        assert_eq!(Frame::standard(id, data).bits(), bits, "{id:#x}");
    }
    let extended = |id, length, remote| Frame { id: Id::Extended(id), remote, length, data: [0; 8] }.bits();
    assert_eq!(extended(0x1555_5555, 0, false), 68);
    assert_eq!(extended(0, 3, false), 101);
    assert_eq!(extended(0x1FFF_FFFF, 8, true), 74);
}

#[test]
fn a_remote_frame_carries_a_length_but_no_data() {
    let remote = Frame { remote: true, ..Frame::standard(0x123, &[0x55; 8]) };
    assert_eq!(remote.bits(), 48);
    assert!(remote.payload().is_empty());
}

#[test]
fn arbitration_prefers_low_identifiers_then_data_then_short_identifiers() {
    let standard = Frame::standard(0x100, &[]);
    let remote = Frame { remote: true, ..standard };
    let extended = Frame { id: Id::Extended(0x100 << 18), ..standard };
    let order = [Frame::standard(0x0FF, &[]), standard, remote, extended, Frame::standard(0x101, &[])];
    assert!(order.windows(2).all(|pair| pair[0].arbitration() < pair[1].arbitration()));
}
