//! Frames survive any chunking; garbage is dropped and counted, never taken and never a panic.

use crate::golden::longest_telemetry_frame;
use crate::samples::{replies, requests};
use link::frame::{self, Decoder, EncodeError, Envelope, FRAME_BYTES, MESSAGE_BYTES, Message, PAYLOAD_BYTES};
use link::message::{ChunkData, HostHello};
use link::{LINK_VERSION, LinkCounters, Name, Reply, Request, SCHEMA_HASH, Text};
use proptest::prelude::*;

const ENVELOPE: Envelope = Envelope { session: 0xA0B1, sequence: 0xC2D3, time_ms: 0x0102_0304 };

fn frame_of(message: &impl Message) -> Vec<u8> {
    let mut buffer = [0; FRAME_BYTES];
    let length = frame::encode(ENVELOPE, message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

fn dropped(counters: LinkCounters) -> u32 {
    counters.bad_cobs + counters.bad_crc + counters.too_long + counters.undecodable
}

/// Reads all of `bytes` as requests.
fn read(decoder: &mut Decoder, mut bytes: &[u8]) -> Vec<Request> {
    core::iter::from_fn(|| decoder.next::<Request>(&mut bytes)).map(|frame| frame.message).collect()
}

/// A small generator of bytes, so that the long tests need no shrinking machinery.
struct Noise(u64);

impl Noise {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    fn bytes(&mut self, count: usize) -> Vec<u8> {
        (0..count).map(|_| self.next().to_le_bytes()[2]).collect()
    }
}

#[test]
fn every_message_survives_a_frame() {
    for request in requests() {
        let frame = frame_of(&request);
        let mut input = frame.as_slice();
        let back = Decoder::<FRAME_BYTES>::new().next::<Request>(&mut input).unwrap();
        assert_eq!((back.envelope, back.message), (ENVELOPE, request));
        assert_eq!(frame.iter().filter(|byte| **byte == 0).count(), 1, "a zero byte only at the end");
    }
    for reply in replies() {
        let frame = frame_of(&reply);
        let mut input = frame.as_slice();
        let back = Decoder::<FRAME_BYTES>::new().next::<Reply>(&mut input).unwrap();
        assert_eq!((back.envelope, back.message), (ENVELOPE, reply));
    }
}

#[test]
fn the_largest_messages_fit() {
    let data: ChunkData = (0..=255).take(link::message::CHUNK_BYTES).collect();
    let chunk = Reply::Chunk { of: u16::MAX, offset: u32::MAX, data };
    assert!(frame_of(&chunk).len() <= FRAME_BYTES);
    let text = Text::new(&"x".repeat(100));
    assert_eq!(text.as_str().len(), link::name::TEXT_BYTES);
    for mut reply in replies() {
        if let Reply::Hello { hello, .. } = &mut reply {
            (hello.firmware, hello.board, hello.serial) = (text.clone(), text.clone(), text.clone());
            (hello.slot_bytes, hello.ticks_per_second) = (u32::MAX, u32::MAX);
        }
        if let Reply::Status { status, .. } = &mut reply {
            status.loaded = Name::new(&"n".repeat(link::name::NAME_BYTES)).ok();
            (status.cycle, status.blocked, status.pendant) = (u32::MAX, Some([u32::MAX; 2]), Some(u32::MAX));
            (status.temperatures, status.hand_temperatures) = ([Some(i16::MIN); 7], [Some(i16::MIN); 4]);
        }
        if let Reply::Telemetry(telemetry) = &mut reply {
            (telemetry.cycle, telemetry.flags, telemetry.cost_ticks) = (u32::MAX, u32::MAX, u32::MAX);
            assert!(frame_of(&reply).len() <= longest_telemetry_frame());
            assert!(longest_telemetry_frame() <= FRAME_BYTES);
            continue;
        }
        assert!(postcard::to_slice(&reply, &mut [0; MESSAGE_BYTES]).is_ok(), "{reply:?}");
    }
    assert_eq!(FRAME_BYTES, PAYLOAD_BYTES + 2, "one byte of stuffing up to 254 bytes, and the zero");
}

/// A message of any length.
#[derive(Debug, Clone, PartialEq, serde::Serialize, serde::Deserialize)]
struct Long(heapless::Vec<u8, { 2 * MESSAGE_BYTES }>);

impl Long {
    /// One of so many bytes, two of which are its length.
    fn of(bytes: usize) -> Self {
        Self((0..bytes - 2).map(|byte| byte as u8).collect())
    }
}

impl Message for Long {
    fn tolerates_more(&self) -> bool {
        false
    }

    fn foreign_hello(_: &[u8]) -> Option<Self> {
        None
    }
}

#[test]
fn a_message_of_the_stated_length_travels_and_one_byte_more_is_refused() {
    let longest = Long::of(MESSAGE_BYTES);
    let frame = frame_of(&longest);
    assert_eq!(frame.len(), FRAME_BYTES);
    let back = Decoder::<FRAME_BYTES>::new().next::<Long>(&mut frame.as_slice()).unwrap();
    assert_eq!((back.envelope, back.message), (ENVELOPE, longest));
    let refused = frame::encode(ENVELOPE, &Long::of(MESSAGE_BYTES + 1), &mut [0; 2 * FRAME_BYTES]);
    assert_eq!(refused, Err(EncodeError::MessageTooLong));
    let words = [EncodeError::MessageTooLong, EncodeError::BufferTooSmall].map(|error| error.to_string());
    assert_eq!(words, ["the message is longer than a frame can carry", "the buffer is smaller than the frame"]);
}

#[test]
fn a_connection_that_is_opened_anew_forgets_the_frame_that_had_begun() {
    let frame = frame_of(&Request::Ping);
    for begun in [&frame[..5], &[1; 2 * FRAME_BYTES]] {
        let mut decoder = Decoder::new();
        assert_eq!(read(&mut decoder, begun), []);
        decoder.reset();
        assert_eq!(read(&mut decoder, &frame), [Request::Ping]);
        assert_eq!(decoder.counters(), LinkCounters { accepted: 1, ..LinkCounters::default() });
    }
}

#[test]
fn encoding_into_a_short_buffer_is_refused() {
    let request = &requests()[0];
    let length = frame_of(request).len();
    for room in 0..length {
        assert_eq!(frame::encode(ENVELOPE, request, &mut vec![0; room]), Err(EncodeError::BufferTooSmall), "{room}");
    }
    assert_eq!(frame::encode(ENVELOPE, request, &mut vec![0; length]), Ok(length));
}

#[test]
fn any_chunking_gives_the_same_messages() {
    let stream: Vec<u8> = requests().iter().flat_map(frame_of).collect();
    for size in 1..300 {
        let mut decoder = Decoder::new();
        let messages: Vec<Request> = stream.chunks(size).flat_map(|part| read(&mut decoder, part)).collect();
        assert_eq!(messages, requests(), "portions of {size}");
    }
}

#[test]
fn garbage_before_a_frame_costs_no_more_than_one_frame() {
    let mut decoder = Decoder::new();
    assert_eq!(read(&mut decoder, &[1, 2, 3, 4, 5]), []);
    // The garbage runs into the first frame and spoils it; the second one is whole.
    let messages = read(&mut decoder, &[frame_of(&Request::Ping), frame_of(&Request::Stop)].concat());
    assert_eq!(messages, [Request::Stop]);
    assert_eq!(dropped(decoder.counters()), 1);
}

#[test]
fn idle_zero_bytes_are_not_counted() {
    let mut decoder = Decoder::new();
    assert_eq!(read(&mut decoder, &[0; 1000]), []);
    assert_eq!(decoder.counters(), LinkCounters::default());
}

#[test]
fn each_reason_has_its_counter() {
    let mut decoder = Decoder::new();
    read(&mut decoder, &[9, 1, 0]);
    assert_eq!(decoder.counters().bad_cobs, 1);

    let mut flipped = frame_of(&Request::Status);
    flipped[3] ^= 0x40;
    read(&mut decoder, &flipped);
    read(&mut decoder, &[2, 7, 0]);
    assert_eq!(decoder.counters().bad_crc, 2, "a wrong check sum, and too few bytes to hold one");

    read(&mut decoder, &[vec![1; FRAME_BYTES + 1], vec![0]].concat());
    assert_eq!(decoder.counters().too_long, 1);

    // A reply read as a request: variant 8 takes no such fields and leaves bytes over.
    read(&mut decoder, &frame_of(&replies()[8]));
    assert_eq!(decoder.counters().undecodable, 1);
    assert_eq!(decoder.counters().accepted, 0);

    assert_eq!(read(&mut decoder, &frame_of(&Request::Ping)), [Request::Ping], "and it still works");
}

/// The frame of a message whose payload (envelope and message) was changed, with a check sum that is right again.
fn frame_with(message: &impl Message, change: impl FnOnce(&mut Vec<u8>)) -> Vec<u8> {
    let mut payload = frame_of(message);
    payload.pop();
    let length = cobs::decode_in_place(&mut payload).unwrap();
    payload.truncate(length - 4);
    change(&mut payload);
    let crc = frame::CRC.checksum(&payload);
    payload.extend(crc.to_le_bytes());
    let mut stuffed = vec![0; FRAME_BYTES];
    let length = cobs::encode(&payload, &mut stuffed);
    stuffed.truncate(length + 1);
    stuffed
}

#[test]
fn a_hello_of_a_later_version_with_more_fields_is_still_understood() {
    let longer = |request: &Request| frame_with(request, |payload| payload.extend([1, 2, 3]));
    let mut decoder = Decoder::new();
    assert_eq!(read(&mut decoder, &longer(&requests()[0])), &requests()[..1]);
    assert_eq!(read(&mut decoder, &longer(&Request::Ping)), [], "any other message must end where it ends");
    let hello = replies().into_iter().find(|reply| matches!(reply, Reply::Hello { .. })).expect("a hello");
    let frame = frame_with(&hello, |payload| payload.extend([1, 2, 3]));
    let back = Decoder::<FRAME_BYTES>::new().next::<Reply>(&mut frame.as_slice());
    assert_eq!(back.map(|frame| frame.message), Some(hello), "the device's as well");
}

/// Bytes of the envelope, the number of the message, the link version and the schema hash of the sample hello.
const UP_TO_THE_SCHEMA: usize = 8 + 1 + 1 + 5;

#[test]
fn a_hello_of_another_version_with_fewer_fields_still_tells_its_version() {
    let whole = frame_with(&requests()[0], |payload| assert!(payload.len() > UP_TO_THE_SCHEMA + 5));
    assert_eq!(read(&mut Decoder::new(), &whole), &requests()[..1]);
    // Without the owner, without the model hash too, cut in the middle of either, and with bytes in their place that
    // are neither.
    for kept in UP_TO_THE_SCHEMA..UP_TO_THE_SCHEMA + 5 + 10 {
        for strange in [vec![], vec![0xFF; 7]] {
            let frame = frame_with(&requests()[0], |payload| {
                payload.truncate(kept);
                payload.extend(&strange);
            });
            let mut decoder = Decoder::new();
            let messages = read(&mut decoder, &frame);
            let [Request::Hello(hello)] = messages.as_slice() else { panic!("{kept} bytes: {messages:?}") };
            assert_eq!((hello.link_version, hello.schema_hash), (1, 0x1234_5678));
            assert_eq!(decoder.counters().accepted, 1);
        }
    }
    // The device's hello has the number of the request in front.
    let Some(hello) = replies().into_iter().find(|reply| matches!(reply, Reply::Hello { .. })) else {
        panic!("no hello")
    };
    let of = hello.answers();
    for kept in UP_TO_THE_SCHEMA + 1..UP_TO_THE_SCHEMA + 20 {
        let frame = frame_with(&hello, |payload| payload.truncate(kept));
        let found = Decoder::<FRAME_BYTES>::new().next::<Reply>(&mut frame.as_slice()).map(|frame| frame.message);
        let Some(Reply::Hello { of: answered, hello }) = found else { panic!("{kept} bytes: {found:?}") };
        assert_eq!((Some(answered), hello.link_version, hello.schema_hash), (of, 1, 0x1234_5678));
    }
}

#[test]
fn only_a_hello_may_be_followed_by_bytes_that_this_version_does_not_know() {
    /// True if the message is read although a byte follows it.
    fn is_read<M: Message>(message: &M) -> bool {
        let frame = frame_with(message, |payload| payload.push(1));
        Decoder::<FRAME_BYTES>::new().next::<M>(&mut frame.as_slice()).is_some()
    }
    for reply in replies() {
        assert_eq!(is_read(&reply), matches!(reply, Reply::Hello { .. }), "{reply:?}");
    }
    for request in requests() {
        assert_eq!(is_read(&request), matches!(request, Request::Hello(_)), "{request:?}");
    }
}

#[test]
fn a_hello_that_is_cut_is_of_another_version_if_the_link_s_or_the_schema_s_differs() {
    let Request::Hello(sample) = &requests()[0] else { panic!("no hello") };
    for (link_version, schema_hash) in [(LINK_VERSION, SCHEMA_HASH ^ 1), (LINK_VERSION + 1, SCHEMA_HASH)] {
        let hello = Request::Hello(HostHello { link_version, schema_hash, ..sample.clone() });
        let frame = frame_with(&hello, |payload| payload.truncate(payload.len() - 1));
        let messages = read(&mut Decoder::new(), &frame);
        let [Request::Hello(told)] = messages.as_slice() else { panic!("{messages:?}") };
        assert_eq!((told.link_version, told.schema_hash), (link_version, schema_hash));
    }
}

#[test]
fn a_damaged_hello_of_this_version_and_every_other_short_message_is_dropped() {
    let Request::Hello(sample) = &requests()[0] else { panic!("no hello") };
    let ours = Request::Hello(HostHello { link_version: LINK_VERSION, schema_hash: SCHEMA_HASH, ..sample.clone() });
    for (message, fewer) in [(&ours, 1..15), (&requests()[9], 1..20)] {
        for fewer in fewer {
            let frame = frame_with(message, |payload| payload.truncate(payload.len() - fewer));
            let mut decoder = Decoder::new();
            assert_eq!(read(&mut decoder, &frame), [], "{fewer} bytes fewer");
            assert_eq!(decoder.counters().undecodable, 1);
        }
    }
}

#[test]
fn c1_a_single_flipped_bit_anywhere_is_never_accepted() {
    for request in requests() {
        let frame = frame_of(&request);
        for bit in 0..8 * (frame.len() - 1) {
            let mut damaged = frame.clone();
            damaged[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(read(&mut Decoder::new(), &damaged), [], "{request:?} bit {bit}");
        }
    }
}

#[test]
fn c1_a_truncated_frame_is_never_accepted() {
    for request in requests() {
        let frame = frame_of(&request);
        for length in 1..frame.len() - 1 {
            let mut decoder = Decoder::new();
            assert_eq!(read(&mut decoder, &[&frame[..length], &[0]].concat()), []);
            assert_eq!(dropped(decoder.counters()), 1);
        }
    }
}

/// Number of random cases: that of the environment variable, which `cargo xtask fuzz` sets, or `usual`.
fn cases(variable: &str, usual: u32) -> u32 {
    std::env::var(variable).ok().and_then(|number| number.parse().ok()).unwrap_or(usual)
}

/// 10^6 frames of noise, or as many as `cargo xtask fuzz` wants: nothing accepted, nothing lost from the count.
#[test]
fn c1_noise_is_dropped_and_every_frame_of_it_counted() {
    let mut noise = Noise(0x1234_5678_9ABC_DEF1);
    let mut decoder: Decoder = Decoder::new();
    let mut frames = 0;
    let mut open = false;
    let wanted = cases("TACTUS_FUZZ_FRAMES", 1_000_000);
    while frames < wanted {
        // Mostly short runs, some longer than any frame.
        let size = if noise.next().is_multiple_of(512) { 400 } else { 64 };
        let mut bytes = noise.bytes(size);
        bytes.iter_mut().for_each(|byte| *byte = if *byte < 24 { 0 } else { *byte });
        for byte in &bytes {
            frames += u32::from(*byte == 0 && open);
            open = *byte != 0;
        }
        assert_eq!(read(&mut decoder, &bytes), []);
    }
    let counters = decoder.counters();
    assert_eq!(counters.accepted, 0);
    assert_eq!(dropped(counters), frames);
}

/// A sound request in which one to eight bytes are others, and nothing else: it is never accepted, unless the damage
/// left it as it was or cut it into a frame that is sound.
#[test]
fn c1_a_damaged_request_is_never_accepted() {
    let mut noise = Noise(0x0BAD_CAFE);
    let mut decoder: Decoder = Decoder::new();
    let samples: Vec<Vec<u8>> = requests().iter().map(frame_of).collect();
    for _ in 0..cases("TACTUS_FUZZ_FRAMES", 100_000) {
        let sound = &samples[noise.next() as usize % samples.len()];
        let mut frame = sound.clone();
        for _ in 0..1 + noise.next() % 8 {
            let place = noise.next() as usize % (frame.len() - 1);
            frame[place] = noise.next() as u8;
        }
        if frame != *sound {
            assert_eq!(read(&mut decoder, &[frame, vec![0]].concat()), []);
        }
    }
    assert_eq!(decoder.counters().accepted, 0);
}

/// Good frames among damaged ones: exactly the good ones come through.
#[test]
fn c1_good_frames_between_noise_all_arrive() {
    let mut noise = Noise(77);
    let mut decoder = Decoder::new();
    let samples = requests();
    for _ in 0..20_000 {
        let request = &samples[noise.next() as usize % samples.len()];
        let count = noise.next() as usize % 300;
        let stream = [noise.bytes(count), vec![0], frame_of(request)].concat();
        assert_eq!(read(&mut decoder, &stream), std::slice::from_ref(request));
    }
    assert_eq!(decoder.counters().accepted, 20_000);
}

proptest! {
    #[test]
    fn any_bytes_in_any_portions_are_harmless(parts in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..600), 0..8)) {
        let mut whole = Decoder::new();
        let mut portions = Decoder::new();
        read(&mut whole, &parts.concat());
        for part in &parts {
            read(&mut portions, part);
        }
        prop_assert_eq!(whole.counters(), portions.counters());
    }

    #[test]
    fn uploads_of_any_content_survive(offset: u32, data in prop::collection::vec(any::<u8>(), 0..=192), session: u16, sequence: u16, time_ms: u32) {
        let request = Request::UploadChunk { offset, data: ChunkData::from_slice(&data).unwrap() };
        let envelope = Envelope { session, sequence, time_ms };
        let mut buffer = [0; FRAME_BYTES];
        let length = frame::encode(envelope, &request, &mut buffer).unwrap();
        let back = Decoder::<FRAME_BYTES>::new().next::<Request>(&mut &buffer[..length]).unwrap();
        prop_assert_eq!(back.envelope, envelope);
        prop_assert_eq!(back.message, request);
    }

    #[test]
    fn approaches_survive_to_the_last_bit(bits: [u32; 7], duration in any::<f32>()) {
        let request = Request::Approach { q: bits.map(f32::from_bits), duration };
        let back = Decoder::<FRAME_BYTES>::new().next::<Request>(&mut frame_of(&request).as_slice()).unwrap();
        let Request::Approach { q, duration: back } = back.message else { panic!("another message") };
        prop_assert_eq!(q.map(f32::to_bits), bits);
        prop_assert_eq!(back.to_bits(), duration.to_bits());
    }

    #[test]
    fn names_follow_their_rule(text in "\\PC{0,40}") {
        let plain = text.bytes().all(|b| b.is_ascii_alphanumeric() || b"-_.".contains(&b));
        let good = plain && (1..=32).contains(&text.len()) && !text.starts_with(['-', '.']);
        prop_assert_eq!(Name::new(&text).is_ok(), good);
    }
}

#[test]
fn a_bad_name_does_not_come_in_over_the_wire() {
    let frame = frame_with(&Request::Delete { name: Name::new("abcdefghij").unwrap() }, |payload| {
        let at = payload.windows(3).position(|window| window == b"abc").unwrap();
        payload[at..at + 3].copy_from_slice(b"../");
    });
    let mut decoder = Decoder::new();
    assert_eq!(read(&mut decoder, &frame), []);
    assert_eq!(decoder.counters().undecodable, 1);
}
