//! Which of several lines the host is on.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;

use firmware::board::LinkPort;
use firmware::board::line::LineSelector;
use link::Request;
use link::frame::{Decoder, Envelope, FRAME_BYTES, encode};
use link::message::{CHUNK_BYTES, ChunkData};

/// A line with what a host put in and what the device sent.
#[derive(Clone, Default)]
struct Wire(Rc<RefCell<(VecDeque<u8>, Vec<u8>)>>);

impl Wire {
    fn host_sends(&self, bytes: &[u8]) {
        self.0.borrow_mut().0.extend(bytes);
    }

    fn host_heard(&self) -> Vec<u8> {
        std::mem::take(&mut self.0.borrow_mut().1)
    }
}

impl LinkPort for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let waiting = &mut self.0.borrow_mut().0;
        let count = buffer.len().min(waiting.len());
        for place in &mut buffer[..count] {
            *place = waiting.pop_front().expect("counted above");
        }
        count
    }

    fn write(&mut self, bytes: &[u8]) {
        self.0.borrow_mut().1.extend(bytes);
    }

    fn room(&self) -> usize {
        1000 - self.0.borrow().1.len()
    }
}

/// A sound frame with a request.
fn frame(sequence: u16) -> Vec<u8> {
    let mut bytes = [0; FRAME_BYTES];
    let envelope = Envelope { session: 7, sequence, time_ms: 0 };
    let length = encode(envelope, &Request::Status, &mut bytes).expect("it fits");
    bytes[..length].to_vec()
}

/// Everything the session would get now.
fn heard(port: &mut impl LinkPort) -> Vec<u8> {
    let mut all = Vec::new();
    let mut buffer = [0; 128];
    loop {
        let count = port.read(&mut buffer);
        all.extend(&buffer[..count]);
        if count < buffer.len() {
            return all;
        }
    }
}

/// Sequence numbers of the sound frames in a stream.
fn requests(mut stream: &[u8]) -> Vec<u16> {
    let mut decoder = Decoder::<FRAME_BYTES>::new();
    let mut found = Vec::new();
    while let Some(frame) = decoder.next::<Request>(&mut stream) {
        found.push(frame.envelope.sequence);
    }
    found
}

fn three() -> ([Wire; 3], impl LinkPort) {
    let wires = [Wire::default(), Wire::default(), Wire::default()];
    let [a, b, c] = wires.clone();
    (wires, LineSelector::new(a, LineSelector::new(b, c)))
}

#[test]
fn the_conversation_is_on_the_line_that_spoke_last() {
    let (wires, mut port) = three();
    for (turn, line) in [0_usize, 2, 1, 0, 1, 2, 0].into_iter().enumerate() {
        let number = turn as u16;
        wires[line].host_sends(&frame(number));
        assert_eq!(requests(&heard(&mut port)), [number], "turn {turn}, line {line}");
        port.write(b"answer");
        for (index, wire) in wires.iter().enumerate() {
            let expected: &[u8] = if index == line { b"answer" } else { b"" };
            assert_eq!(wire.host_heard(), expected, "turn {turn}, line {index}");
        }
    }
}

#[test]
fn noise_on_another_line_never_takes_the_conversation_away() {
    let (wires, mut port) = three();
    wires[0].host_sends(&frame(1));
    assert_eq!(requests(&heard(&mut port)), [1]);
    let mut damaged = frame(2);
    damaged[3] ^= 0x10;
    let noise: Vec<u8> = (0..5000_u32).map(|n| (n.wrapping_mul(2_654_435_761) >> 13) as u8).collect();
    for wire in &wires[1..] {
        wire.host_sends(&damaged);
        wire.host_sends(&noise);
        wire.host_sends(&[0]);
    }
    for _ in 0..200 {
        assert!(requests(&heard(&mut port)).is_empty());
    }
    port.write(b"still here");
    assert_eq!(wires[0].host_heard(), b"still here");
    assert!(wires[1].host_heard().is_empty() && wires[2].host_heard().is_empty());
}

#[test]
fn a_frame_that_comes_in_pieces_after_noise_is_handed_on_whole() {
    let (wires, mut port) = three();
    wires[2].host_sends(&[0x55; 700]);
    wires[2].host_sends(&[0]);
    assert!(requests(&heard(&mut port)).is_empty());
    let bytes = frame(9);
    let mut stream = Vec::new();
    for byte in &bytes {
        wires[2].host_sends(&[*byte]);
        stream.extend(heard(&mut port));
    }
    assert_eq!(requests(&stream), [9]);
    let ended = [&[0][..], &bytes].concat();
    assert_eq!(stream, ended, "what the other line had begun is ended, and nothing of the noise comes along");
}

#[test]
fn frames_behind_the_one_that_took_the_line_are_not_lost() {
    let (wires, mut port) = three();
    let burst: Vec<u8> = (10..16).flat_map(frame).collect();
    wires[1].host_sends(&burst);
    let mut stream = heard(&mut port);
    stream.extend(heard(&mut port));
    assert_eq!(requests(&stream), [10, 11, 12, 13, 14, 15]);
}

#[test]
fn bytes_on_the_chosen_line_pass_untouched_even_if_they_are_no_frames() {
    let (wires, mut port) = three();
    let noise: Vec<u8> = (0..=255).collect();
    wires[0].host_sends(&noise);
    assert_eq!(heard(&mut port), noise, "the session counts what it cannot read; the line must not hide it");
    assert_eq!(port.room(), 1000);
}

/// A part of an image, as an upload sends it without a pause.
fn part(sequence: u16) -> Vec<u8> {
    let mut bytes = [0; FRAME_BYTES];
    let data = ChunkData::from_slice(&[0x5A; CHUNK_BYTES]).expect("it fits");
    let envelope = Envelope { session: 7, sequence, time_ms: 0 };
    let length = encode(envelope, &Request::UploadChunk { offset: 0, data }, &mut bytes).expect("it fits");
    bytes[..length].to_vec()
}

#[test]
fn a_stop_on_one_line_is_heard_wherever_in_a_frame_the_other_line_is() {
    for upload in 0..3 {
        for stop in (0..3).filter(|line| *line != upload) {
            for cut in 1..part(1).len() {
                let (wires, mut port) = three();
                wires[upload].host_sends(&part(1));
                let mut stream = heard(&mut port);
                // The session comes by in the middle of a part of the upload; the stop is there, and then the rest.
                let next = part(2);
                wires[upload].host_sends(&next[..cut]);
                stream.extend(heard(&mut port));
                wires[stop].host_sends(&frame(100));
                stream.extend(heard(&mut port));
                wires[upload].host_sends(&next[cut..]);
                wires[upload].host_sends(&part(3));
                stream.extend(heard(&mut port));
                stream.extend(heard(&mut port));
                let found = requests(&stream);
                assert!(found.contains(&100), "lines {upload} and {stop}, cut at {cut}: {found:?}");
                assert!(found.contains(&3), "lines {upload} and {stop}, cut at {cut}: {found:?}");
            }
        }
    }
}

#[test]
fn two_lines_that_speak_at_the_same_time_lose_no_frame_that_had_come_whole() {
    for (first, second) in [(0, 1), (0, 2), (1, 0), (1, 2), (2, 0), (2, 1)] {
        let (wires, mut port) = three();
        wires[0].host_sends(&frame(1));
        assert_eq!(requests(&heard(&mut port)), [1]);
        // Longer than what the session takes at a time.
        wires[first].host_sends(&part(2));
        wires[second].host_sends(&part(3));
        let stream: Vec<u8> = (0..4).flat_map(|_| heard(&mut port)).collect();
        let mut found = requests(&stream);
        found.sort_unstable();
        assert_eq!(found, [2, 3], "lines {first} and {second}");
    }
}
