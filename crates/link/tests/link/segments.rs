//! The stream over CAN frames: whole if nothing happens to it, and never wrong in silence if something does.

use std::collections::VecDeque;

use link::Request;
use link::can::{
    DeviceNumber, Direction, FULL_FRAME_BITS, Heading, LINE_BYTES_PER_SECOND, Reassembler, SEGMENT_BYTES, Segment,
    Segmenter, filter,
};
use link::frame::{self, Decoder, Envelope, FRAME_BYTES};
use proptest::prelude::*;

use crate::samples::requests;

const DEVICE: DeviceNumber = DeviceNumber::FIRST;

fn cut(mut stream: &[u8]) -> Vec<Segment> {
    let mut segmenter = Segmenter::new(Direction::ToDevice, DEVICE);
    std::iter::from_fn(|| segmenter.cut(&mut stream)).collect()
}

fn reassembler() -> Reassembler {
    Reassembler::new(Direction::ToDevice, DEVICE)
}

fn join(receiver: &mut Reassembler, segments: &[Segment]) -> Vec<u8> {
    segments.iter().flat_map(|segment| receiver.take(segment.id(), segment.data()).to_vec()).collect()
}

/// The frames of some requests, one after the other, and the requests.
fn conversation(count: usize) -> (Vec<u8>, Vec<Request>) {
    let requests: Vec<Request> = requests().into_iter().cycle().take(count).collect();
    let mut stream = Vec::new();
    for (sequence, request) in requests.iter().enumerate() {
        let mut buffer = [0; FRAME_BYTES];
        let envelope = Envelope { session: 7, sequence: sequence as u16, time_ms: 0 };
        let length = frame::encode(envelope, request, &mut buffer).unwrap();
        stream.extend_from_slice(&buffer[..length]);
    }
    (stream, requests)
}

/// Returns the device's reading of the bytes: number and message.
fn read(bytes: &[u8]) -> Vec<(u16, Request)> {
    let (mut decoder, mut rest) = (Decoder::<FRAME_BYTES>::new(), bytes);
    std::iter::from_fn(|| decoder.next::<Request>(&mut rest))
        .map(|frame| (frame.envelope.sequence, frame.message))
        .collect()
}

#[test]
fn identifiers_name_direction_device_and_place() {
    let heading = Heading { direction: Direction::ToDevice, device: DEVICE, sequence: 0 };
    assert_eq!(heading.id(), 0x010);
    let device = DeviceNumber::new(15).unwrap();
    assert_eq!(Heading { direction: Direction::ToHost, device, sequence: 15 }.id(), 0x3FF);
    assert_eq!((device.number(), device.to_string()), (15, "15".to_owned()));
    assert_eq!((DEVICE.number(), DEVICE.to_string()), (0, "0".to_owned()));
    assert_eq!(DeviceNumber::new(16), None);
    let known = (0..=u16::MAX).filter_map(|id| Some((id, Heading::parse(id)?)));
    let mut count = 0;
    for (id, heading) in known {
        assert_eq!(heading.id(), id);
        let (wanted, mask) = filter(heading.direction, heading.device);
        assert_eq!(id & mask, wanted);
        count += 1;
    }
    assert_eq!(count, 2 * 16 * 16);
}

#[test]
fn no_puck_of_an_arm_would_take_a_segment_for_an_order() {
    for id in (0..0x800).filter(|id| Heading::parse(*id).is_some()) {
        // Bit 10 would make it a group, which all pucks have; the low five bits are the node.
        assert_eq!(id & 0x400, 0);
        assert!(id & 0x1F > 14, "{id:#05X}");
    }
}

#[test]
fn a_filter_passes_its_sixteen_identifiers_and_no_other() {
    for direction in [Direction::ToDevice, Direction::ToHost] {
        for number in 0..16 {
            let device = DeviceNumber::new(number).unwrap();
            let (wanted, mask) = filter(direction, device);
            let passed: Vec<u16> = (0..0x800).filter(|id| id & mask == wanted).collect();
            assert_eq!(passed.len(), 16);
            let mine = |heading: Heading| (heading.direction, heading.device) == (direction, device);
            assert!(passed.iter().all(|id| Heading::parse(*id).is_some_and(mine)));
        }
    }
}

#[test]
fn line_rate_is_that_of_back_to_back_full_frames() {
    assert_eq!(FULL_FRAME_BITS, 111);
    assert!((LINE_BYTES_PER_SECOND - 72_072.07).abs() < 0.01);
}

#[test]
fn a_frame_carries_nothing_but_the_stream() {
    let (stream, _) = conversation(40);
    let segments = cut(&stream);
    assert_eq!(segments.len(), stream.len().div_ceil(SEGMENT_BYTES));
    assert_eq!(join(&mut reassembler(), &segments), stream);
}

#[test]
fn every_single_lost_segment_costs_at_most_two_messages_and_is_counted() {
    let (stream, sent) = conversation(12);
    let segments = cut(&stream);
    for lost in 1..segments.len() - 1 {
        let mut damaged = segments.clone();
        damaged.remove(lost);
        let mut receiver = reassembler();
        let got = read(&join(&mut receiver, &damaged));
        assert_eq!(receiver.counters().gaps, 1, "segment {lost}");
        assert!(got.len() + 2 >= sent.len(), "segment {lost}: {} of {}", got.len(), sent.len());
        assert!(got.iter().all(|(number, request)| sent[usize::from(*number)] == *request));
    }
}

#[test]
fn after_a_gap_nothing_is_delivered_before_the_next_message() {
    // Three messages of 30 bytes; a lost segment of the first one must not let its tail through.
    let message = |byte: u8| [vec![byte; 30], vec![0]].concat();
    let mut segments = cut(&[message(1), message(2), message(3)].concat());
    segments.remove(1);
    let expected = [vec![1; SEGMENT_BYTES], vec![0], message(2), message(3)].concat();
    assert_eq!(join(&mut reassembler(), &segments), expected);
}

#[test]
fn every_doubled_segment_is_taken_once() {
    let (stream, _) = conversation(12);
    let twice: Vec<Segment> = cut(&stream).into_iter().flat_map(|segment| [segment, segment]).collect();
    let mut receiver = reassembler();
    assert_eq!(join(&mut receiver, &twice), stream);
    assert_eq!((receiver.counters().duplicates as usize, receiver.counters().gaps), (twice.len() / 2, 0));
}

#[test]
fn segments_that_overtake_each_other_never_give_a_wrong_message() {
    let (stream, sent) = conversation(12);
    let segments = cut(&stream);
    for first in 0..segments.len() - 1 {
        let mut swapped = segments.clone();
        swapped.swap(first, first + 1);
        let mut receiver = reassembler();
        let got = read(&join(&mut receiver, &swapped));
        assert!(receiver.counters().gaps >= 1, "segment {first}");
        assert!(got.iter().all(|(number, request)| sent[usize::from(*number)] == *request));
        assert!(got.len() + 3 >= sent.len(), "segment {first}");
    }
}

#[test]
fn a_new_host_is_understood_from_its_first_message_wherever_the_old_one_ended() {
    let (stream, sent) = conversation(3);
    for ended in 0..20 {
        let mut receiver = reassembler();
        join(&mut receiver, &cut(&[0xAA; 8 * 20][..8 * ended + 3]));
        // A host sends a zero byte first.
        let fresh = cut(&[&[0], stream.as_slice()].concat());
        let got = read(&join(&mut receiver, &fresh));
        assert_eq!(got.len(), sent.len(), "after {ended} segments");
    }
}

#[test]
fn frames_of_others_and_malformed_ones_bring_nothing() {
    let mut receiver = reassembler();
    assert!(receiver.take(0x210, &[1, 2]).is_empty(), "the other direction");
    assert!(receiver.take(0x030, &[1, 2]).is_empty(), "another device");
    assert!(receiver.take(0x404, &[0x30]).is_empty(), "the arm's bus");
    assert_eq!(receiver.counters(), link::can::SegmentCounters::default());
    assert!(receiver.take(0x010, &[]).is_empty());
    assert!(receiver.take(0x010, &[1; 9]).is_empty());
    assert_eq!(receiver.counters().malformed, 2);
}

/// Disturbances of a segment on a bad bus.
#[derive(Debug, Clone, Copy)]
enum Fate {
    Arrives,
    Lost,
    Doubled,
    Late(usize),
}

fn fate() -> impl Strategy<Value = Fate> {
    prop_oneof![
        12 => Just(Fate::Arrives),
        1 => Just(Fate::Lost),
        1 => Just(Fate::Doubled),
        1 => (1_usize..5).prop_map(Fate::Late),
    ]
}

fn suffer(segments: &[Segment], fates: &[Fate]) -> Vec<Segment> {
    let mut late: VecDeque<(usize, Segment)> = VecDeque::new();
    let mut arrived = Vec::new();
    for (place, segment) in segments.iter().enumerate() {
        match fates[place % fates.len()] {
            Fate::Arrives => arrived.push(*segment),
            Fate::Lost => {}
            Fate::Doubled => arrived.extend([*segment, *segment]),
            Fate::Late(by) => late.push_back((place + by, *segment)),
        }
        while late.front().is_some_and(|(due, _)| *due <= place) {
            arrived.extend(late.pop_front().map(|(_, segment)| segment));
        }
    }
    arrived.extend(late.into_iter().map(|(_, segment)| segment));
    arrived
}

proptest! {
    #[test]
    fn any_stream_in_any_portions_comes_out_as_it_went_in(
        stream in prop::collection::vec(any::<u8>(), 0..400),
        portions in prop::collection::vec(1_usize..40, 1..60),
    ) {
        let mut segmenter = Segmenter::new(Direction::ToHost, DEVICE);
        let mut receiver = Reassembler::new(Direction::ToHost, DEVICE);
        let (mut rest, mut back, mut turn) = (stream.as_slice(), Vec::new(), portions.iter().cycle());
        while !rest.is_empty() {
            let (mut portion, behind) = rest.split_at(rest.len().min(*turn.next().unwrap()));
            while let Some(segment) = segmenter.cut(&mut portion) {
                back.extend_from_slice(&receiver.take(segment.id(), segment.data()));
            }
            rest = behind;
        }
        prop_assert_eq!(back, stream);
        prop_assert_eq!(receiver.counters().gaps, 0);
    }

    #[test]
    fn a_bad_bus_loses_messages_and_never_changes_one(fates in prop::collection::vec(fate(), 1..300)) {
        let (stream, sent) = conversation(24);
        let got = read(&join(&mut reassembler(), &suffer(&cut(&stream), &fates)));
        for (number, request) in got {
            prop_assert_eq!(&sent[usize::from(number)], &request);
        }
    }

    #[test]
    fn any_frames_at_all_do_no_harm(
        frames in prop::collection::vec((any::<u16>(), prop::collection::vec(any::<u8>(), 0..12)), 0..200)
    ) {
        let mut receiver = reassembler();
        for (id, data) in frames {
            prop_assert!(receiver.take(id, &data).len() <= SEGMENT_BYTES + 1);
        }
    }
}
