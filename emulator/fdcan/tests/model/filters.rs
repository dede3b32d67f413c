//! Acceptance filters: element types and actions, frames that match none, remote frames.

use crate::bench::*;
use fdcan_model::{Frame, Id, Options, RemarkKind, Unit};

/// A bench with standard filters at 0x800 and one with extended filters at 0x900; both FIFOs hold 32 frames.
fn bench(standard: &[u32], extended: &[[u32; 2]], gfc: u32) -> Bench {
    let lists = [(standard.len() as u32) << 16 | 0x800, (extended.len() as u32) << 16 | 0x900];
    let mut bench = Bench::with(
        Options::default(),
        &[(SIDFC, lists[0]), (XIDFC, lists[1]), (GFC, gfc), (RXF1C, 0x0020_1000), (XIDAM, 0x0FFF_FFFF)],
    );
    for (index, word) in standard.iter().chain(extended.iter().flatten()).enumerate() {
        let at = if index < standard.len() { 0x800 + 4 * index } else { 0x900 + 4 * (index - standard.len()) };
        bench.set(at as u32, *word);
    }
    bench
}

/// A filter element for standard identifiers: type, action, first and second identifier.
fn element(kind: u32, action: u32, first: u32, second: u32) -> u32 {
    kind << 30 | action << 27 | first << 16 | second
}

/// A filter element for extended identifiers.
fn pair(kind: u32, action: u32, first: u32, second: u32) -> [u32; 2] {
    [action << 29 | first, kind << 30 | second]
}

/// Which of these identifiers reach FIFO 0 and which FIFO 1.
fn passed(bench: &mut Bench, frames: impl IntoIterator<Item = Frame>) -> (Vec<u32>, Vec<u32>) {
    let mut passed = (Vec::new(), Vec::new());
    for frame in frames {
        let before = [RXF0S, RXF1S].map(|offset| bench.can.peek(Unit::One, offset) & 0x7F);
        bench.receive_frame(&frame);
        let after = [RXF0S, RXF1S].map(|offset| bench.can.peek(Unit::One, offset) & 0x7F);
        let id = match frame.id {
            Id::Standard(id) => id.into(),
            Id::Extended(id) => id,
        };
        if after[0] > before[0] {
            passed.0.push(id);
        }
        if after[1] > before[1] {
            passed.1.push(id);
        }
    }
    passed
}

fn standard(ids: impl IntoIterator<Item = u16>) -> impl Iterator<Item = Frame> {
    ids.into_iter().map(|id| Frame::standard(id, &[]))
}

fn extended(ids: impl IntoIterator<Item = u32>) -> impl Iterator<Item = Frame> {
    ids.into_iter().map(|id| Frame { id: Id::Extended(id), remote: false, length: 0, data: [0; 8] })
}

const REJECT_OTHERS: u32 = 0b10_1011;

#[test]
fn a_range_takes_both_ends_and_what_lies_between() {
    let mut bench = bench(&[element(0, 1, 0x100, 0x103)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard(0x0FE..0x106)).0, [0x100, 0x101, 0x102, 0x103]);
}

#[test]
fn a_dual_element_takes_two_identifiers() {
    let mut bench = bench(&[element(1, 1, 0x100, 0x103)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard(0x0FE..0x106)).0, [0x100, 0x103]);
}

#[test]
fn a_masked_element_compares_where_the_mask_has_ones() {
    let mut bench = bench(&[element(2, 2, 0x105, 0x7FB)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard(0x0FE..0x109)), (vec![], vec![0x101, 0x105]));
}

#[test]
fn disabled_elements_match_nothing() {
    let mut bench = bench(&[element(3, 1, 0, 0x7FF), element(0, 0, 0, 0x7FF)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard(0..8)), (vec![], vec![]));
}

#[test]
fn the_first_match_decides_and_its_number_is_stored() {
    let reject = element(1, 3, 0x101, 0x101);
    let range = element(0, 1, 0x100, 0x103);
    let mut bench = bench(&[0, reject, range], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard(0x100..0x104)).0, [0x100, 0x102, 0x103]);
    assert_eq!(bench.can.peek_memory(RECEIVE_AT + 4) >> 24, 2);
}

#[test]
fn frames_that_match_no_element_go_where_gfc_says() {
    for (anfs, fifos) in [(0, (1, 0)), (1, (0, 1)), (2, (0, 0)), (3, (0, 0))] {
        let mut bench = bench(&[0], &[], anfs << 4);
        let (first, second) = passed(&mut bench, standard([0x123]));
        assert_eq!((first.len(), second.len()), fifos);
        if anfs == 0 {
            assert_eq!(bench.can.peek_memory(RECEIVE_AT + 4) >> 31, 1, "the element says that no filter matched");
        }
    }
}

#[test]
fn a_list_ends_after_128_elements() {
    let mut elements = [0; 129];
    elements[128] = element(0, 1, 0x200, 0x200);
    elements[127] = element(0, 1, 0x100, 0x100);
    let mut bench = bench(&elements, &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard([0x100, 0x200])).0, [0x100]);
}

#[test]
fn an_empty_list_matches_nothing() {
    let mut bench = bench(&[], &[], 0b01_0000);
    assert_eq!(passed(&mut bench, standard([5])), (vec![], vec![5]));
}

#[test]
fn remote_frames_are_filtered_or_rejected_by_kind() {
    let remote = |id| Frame { id, remote: true, length: 2, data: [0; 8] };
    let frames = [remote(Id::Standard(5)), remote(Id::Extended(6))];
    for (gfc, ids) in [(0b00, vec![5, 6]), (0b01, vec![5]), (0b10, vec![6]), (0b11, vec![])] {
        let mut bench = bench(&[], &[], gfc);
        assert_eq!(passed(&mut bench, frames).0, ids, "{gfc:b}");
    }
}

#[test]
fn extended_elements_have_the_same_types_behind_the_mask() {
    let ids = [0x100, 0x101, 0x102, 0x103, 0x1000_0101];
    // The mask of the bench takes the highest bit off before an element is compared, but not for type 3.
    let cases: [([u32; 2], &[u32]); 4] = [
        (pair(0, 1, 0x101, 0x102), &[0x101, 0x102, 0x1000_0101]),
        (pair(1, 1, 0x101, 0x103), &[0x101, 0x103, 0x1000_0101]),
        (pair(2, 1, 0x101, 0x1FFF_FFFD), &[0x101, 0x103, 0x1000_0101]),
        (pair(3, 1, 0x101, 0x102), &[0x101, 0x102]),
    ];
    for (element, accepted) in cases {
        let mut bench = bench(&[], &[element], REJECT_OTHERS);
        assert_eq!(passed(&mut bench, extended(ids)).0, accepted, "{element:x?}");
    }
    let mut bench = bench(&[element(0, 1, 0, 0x7FF)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, extended(ids)).0, [], "the list of standard identifiers is another one");
}

#[test]
fn an_extended_frame_is_stored_with_its_whole_identifier() {
    let mut bench = bench(&[], &[pair(0, 2, 0, 0x1FFF_FFFF)], REJECT_OTHERS);
    bench.receive_frame(&Frame { id: Id::Extended(0x1234_5678), remote: false, length: 1, data: [9; 8] });
    assert_eq!(bench.can.peek_memory(0x1000), 1 << 30 | 0x1234_5678);
}

#[test]
fn a_match_of_high_priority_is_told_apart() {
    let only = element(0, 4, 0x10, 0x10);
    let store = element(0, 6, 0x20, 0x20);
    let mut bench = bench(&[only, store], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard([0x10])), (vec![], vec![]));
    assert_eq!((bench.read(IR) >> 8 & 1, bench.read(HPMS)), (1, 0));
    assert_eq!(passed(&mut bench, standard([0x20, 0x20])), (vec![], vec![0x20, 0x20]));
    // Element 1, stored in FIFO 1, at place 1.
    assert_eq!(bench.read(HPMS), 1 << 8 | 0b11 << 6 | 1);
}

#[test]
fn a_dedicated_receive_buffer_is_not_modelled() {
    let mut bench = bench(&[element(0, 7, 0x10, 0)], &[], REJECT_OTHERS);
    assert_eq!(passed(&mut bench, standard([0x10])), (vec![], vec![]));
    assert!(bench.remarks().contains(&(RemarkKind::Unmodelled, "SIDFC")));
}

#[test]
fn a_filter_that_nobody_wrote_is_remarked_on() {
    let mut bench = Bench::with(Options::default(), &[(SIDFC, 1 << 16 | 0x2000)]);
    bench.receive(5);
    assert!(bench.remarks().contains(&(RemarkKind::Unwritten, "RAM")));
}
