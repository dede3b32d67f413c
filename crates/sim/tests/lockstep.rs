//! The lock step's wire format, byte by byte, and its ends.

use puck::SafetyMode;
use sim::lockstep::{NEVER, REPLY_LENGTH};
use sim::{
    BYTE_TICKS, FreeJoints, HOME, Lockstep, LockstepError, OperatorConfig, PlainLine, Plant, PlantConfig, Served,
};

/// An arm nobody switches on: only the safety module speaks, and nothing happens by itself.
fn quiet_plant() -> Plant {
    let operator = OperatorConfig { idle_at: None, activate_after: None, ..OperatorConfig::default() };
    Plant::new(PlantConfig { operator, ..PlantConfig::default() }, Box::new(FreeJoints::new(HOME)))
}

fn request(kind: u8, length: u8, id: u16, t: u64, data: &[u8]) -> Vec<u8> {
    let mut bytes = vec![kind, length];
    bytes.extend(id.to_le_bytes());
    bytes.extend([0; 4]);
    bytes.extend(t.to_le_bytes());
    bytes.extend(data);
    bytes.resize(24, 0);
    bytes
}

/// Serves requests from a byte string; the replies as one byte string.
fn serve(plant: &mut Plant, requests: &[u8]) -> (Vec<Served>, Vec<u8>, Option<LockstepError>) {
    let mut replies = Vec::new();
    let mut served = Vec::new();
    let mut lockstep = Lockstep::new(requests, &mut replies);
    let error = loop {
        match lockstep.serve_one(plant) {
            Ok(last) => {
                served.push(last);
                if last.is_last() {
                    break None;
                }
            }
            Err(error) => break Some(error),
        }
    };
    (served, replies, error)
}

fn next_event(reply: &[u8]) -> u64 {
    u64::from_le_bytes(reply[8..16].try_into().unwrap())
}

#[test]
fn a_get_travels_out_and_its_reply_comes_back() {
    let mut plant = quiet_plant();
    // GET MODE to node 10: 55 bits and the stuffing of a nearly empty frame.
    let (_, sent, _) = serve(&mut plant, &request(1, 1, 0x00A, 1000, &[0x08]));
    let end = next_event(&sent);
    assert_eq!(sent.len(), REPLY_LENGTH);
    assert_eq!(sent[0], 0);
    assert!((1000 + 55 * 25..=1000 + 65 * 25).contains(&end), "{end}");

    let (_, done, _) = serve(&mut plant, &request(2, 0, 0, end, &[]));
    assert_eq!(done[0], 0b010, "transmitted");
    let latch = next_event(&done);
    assert_eq!(latch, end - 3 * 25 + 75 * 25, "the reply wants the bus 75 us after the request was received");

    let (_, started, _) = serve(&mut plant, &request(2, 0, 0, latch, &[]));
    assert_eq!(started[0], 0, "the bus has become busy, nothing has arrived");
    let arrival = next_event(&started);

    let (_, arrived, _) = serve(&mut plant, &request(2, 0, 0, arrival, &[]));
    assert_eq!(arrived[0], 0b001, "received");
    assert_eq!(arrived[1], 4);
    assert_eq!(arrived[2..4], [0x46, 0x05], "0x546: node 10 to group 6");
    assert_eq!(arrived[16..24], [0x88, 0, SafetyMode::EStop.value() as u8, 0, 0, 0, 0, 0]);
    assert_eq!(arrived[24..32], [0; 8]);
    assert_eq!(next_event(&arrived), NEVER);
}

#[test]
fn a_late_interrupt_still_finds_every_frame() {
    let mut plant = quiet_plant();
    for t in 0..3 {
        serve(&mut plant, &request(1, 1, 0x00A, 1000 + t, &[0x08]));
    }
    // 2 ms later: three of its own frames and three replies wait, one per event, each announced as due at once.
    let (mut transmitted, mut received) = (0, 0);
    for _ in 0..6 {
        let (_, reply, _) = serve(&mut plant, &request(2, 0, 0, 51_000, &[]));
        transmitted += u32::from(reply[0] >> 1 & 1);
        received += u32::from(reply[0] & 1);
    }
    assert_eq!((transmitted, received), (3, 3));
    let (_, reply, _) = serve(&mut plant, &request(2, 0, 0, 51_000, &[]));
    assert_eq!((reply[0], next_event(&reply)), (0, NEVER));
}

#[test]
fn a_time_in_the_past_cannot_change_what_was_decided() {
    let mut plant = quiet_plant();
    plant.advance(50_000);
    plant.record_bus();
    serve(&mut plant, &request(1, 1, 0x00A, 10, &[0x08]));
    assert_eq!(plant.recorded()[0].start, 50_000);
}

#[test]
fn link_bytes_cross_in_both_directions_at_the_speed_of_the_line() {
    let mut plant = quiet_plant();
    let mut bytes = request(4, 5, 0, 1000, &[]);
    bytes.extend(b"hello");
    let (served, reply, error) = serve(&mut plant, &bytes);
    assert_eq!(served, [Served::Link, Served::EndOfStream]);
    assert!(error.is_none());
    assert_eq!(reply.len(), REPLY_LENGTH);
    plant.advance(1000 + 2 * BYTE_TICKS);
    assert_eq!(plant.take_from_device(), b"he");
    assert_eq!(plant.link_backlog(), 3);
    plant.advance(1000 + 5 * BYTE_TICKS);
    assert_eq!(plant.take_from_device(), b"llo");

    let now = plant.now();
    plant.link_to_device(&[7; 100]);
    let (_, early, _) = serve(&mut plant, &request(2, 0, 0, now, &[]));
    assert_eq!((early[0], next_event(&early)), (0, now + 64 * BYTE_TICKS));
    let (_, first, _) = serve(&mut plant, &request(2, 0, 0, now + 64 * BYTE_TICKS, &[]));
    assert_eq!((first[0], first[4], first.len()), (0b100, 64, REPLY_LENGTH + 64));
    assert_eq!(next_event(&first), now + 100 * BYTE_TICKS);
    let (_, second, _) = serve(&mut plant, &request(2, 0, 0, now + 100 * BYTE_TICKS, &[]));
    assert_eq!((second[0], second[4], &second[REPLY_LENGTH..]), (0b100, 36, &[7; 36][..]));
    assert_eq!(next_event(&second), NEVER);
}

#[test]
fn what_was_withdrawn_never_leaves_and_what_has_begun_is_still_told() {
    let mut plant = quiet_plant();
    for t in 0..3 {
        serve(&mut plant, &request(1, 1, 0x00A, 1000 + t, &[0x08]));
    }
    let (served, reply, _) = serve(&mut plant, &request(6, 0, 0, 1010, &[]));
    assert_eq!(served, [Served::Withdraw, Served::EndOfStream]);
    assert_eq!(reply[0], 0b1000, "the first of them is on the wire");
    let (_, done, _) = serve(&mut plant, &request(2, 0, 0, 50_000, &[]));
    assert_eq!(done[0], 0b010, "its end");
    let (_, arrived, _) = serve(&mut plant, &request(2, 0, 0, 50_000, &[]));
    assert_eq!(arrived[0], 0b001, "the answer");
    assert_eq!(next_event(&arrived), NEVER, "and nothing of the other two");
    let (_, reply, _) = serve(&mut plant, &request(6, 0, 0, 50_001, &[]));
    assert_eq!(reply[0], 0, "nothing of the firmware is on the wire");
}

#[test]
fn a_line_without_delay_hands_bytes_over_at_once() {
    let mut plant = quiet_plant();
    plant.set_link_line(Box::new(PlainLine::default()));
    serve(&mut plant, &request(2, 0, 0, 1000, &[]));
    plant.link_to_device(&[7; 100]);
    let (_, reply, _) = serve(&mut plant, &request(2, 0, 0, 1000, &[]));
    assert_eq!((reply[0], reply[4], reply.len()), (0b100, 64, REPLY_LENGTH + 64));
    assert_eq!(next_event(&reply), 1000, "there is more");
    let (_, reply, _) = serve(&mut plant, &request(2, 0, 0, 1000, &[]));
    assert_eq!((reply[4], next_event(&reply)), (36, NEVER));
    let mut bytes = request(4, 3, 0, 1000, &[]);
    bytes.extend([1, 2, 3]);
    serve(&mut plant, &bytes);
    assert_eq!(plant.take_from_device(), [1, 2, 3]);
}

#[test]
fn a_good_bye_is_answered_and_ends_the_run() {
    let mut plant = quiet_plant();
    let (served, replies, error) = serve(&mut plant, &request(3, 0, 0, 77_000, &[]));
    assert_eq!(served, [Served::Bye]);
    assert_eq!(replies.len(), REPLY_LENGTH);
    assert!(error.is_none());
    assert_eq!(plant.now(), 77_000);
}

#[test]
fn the_end_of_the_stream_is_told_from_a_death_in_the_middle_of_a_request() {
    let mut plant = quiet_plant();
    let (served, _, error) = serve(&mut plant, &[]);
    assert_eq!(served, [Served::EndOfStream]);
    assert!(error.is_none());
    let (_, _, error) = serve(&mut plant, &request(2, 0, 0, 5, &[])[..10]);
    assert!(matches!(error, Some(LockstepError::Truncated { received: 10, expected: 24 })));
    let mut cut = request(4, 9, 0, 5, &[]);
    cut.extend([1, 2, 3]);
    let (_, _, error) = serve(&mut plant, &cut);
    assert!(matches!(error, Some(LockstepError::Truncated { received: 27, expected: 33 })));
}

#[test]
fn words_on_standard_output_are_recognised_as_such() {
    let mut plant = quiet_plant();
    let mut stray = b"hello from a stray println!".to_vec();
    let (_, replies, error) = serve(&mut plant, &stray);
    assert!(matches!(error, Some(LockstepError::Reserved)));
    assert!(replies.is_empty(), "nothing is answered to nonsense");
    stray[4..8].fill(0);
    let (_, _, error) = serve(&mut plant, &stray);
    assert!(matches!(error, Some(LockstepError::Kind { kind: b'h' })));
}

#[test]
fn frames_that_no_controller_could_send_are_refused() {
    let mut plant = quiet_plant();
    let (_, _, error) = serve(&mut plant, &request(1, 9, 0x00A, 5, &[]));
    assert!(matches!(error, Some(LockstepError::Frame { id: 0x00A, length: 9 })));
    let (_, _, error) = serve(&mut plant, &request(1, 1, 0x800, 5, &[]));
    assert!(matches!(error, Some(LockstepError::Frame { id: 0x800, length: 1 })));
    assert_eq!(plant.trace().total(), 0);
}
