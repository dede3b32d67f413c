//! A host that does not keep to the rules: frames by hand, on a device without a [`Client`](lab::client::Client).

use std::time::Duration;

use lab::device::Device;
use lab::transport::Transport;
use link::frame::{self, Decoder, Envelope, FRAME_BYTES};
use link::{Reply, Request};

use crate::expect;

/// Sends one request and gives its answer, or `None` if there is none within half a second.
///
/// # Panics
/// The device cannot be reached.
pub fn ask(device: &mut Device, session: u16, sequence: u16, request: &Request) -> Option<Reply> {
    let mut buffer = [0; FRAME_BYTES];
    let envelope = Envelope { session, sequence, time_ms: 0 };
    let length = expect(frame::encode(envelope, request, &mut buffer).map_err(|error| error.to_string()));
    expect(device.send(&buffer[..length]));
    let mut decoder: Decoder<FRAME_BYTES> = Decoder::new();
    let until = device.now() + Duration::from_millis(500);
    while device.now() < until {
        for reply in listen(device, &mut decoder, until) {
            if reply.answers() == Some(sequence) {
                return Some(reply);
            }
        }
    }
    None
}

/// Hears what the device says until `until`, without ever saying anything: one portion of it.
///
/// # Panics
/// The device cannot be reached.
pub fn listen(device: &mut Device, decoder: &mut Decoder<FRAME_BYTES>, until: Duration) -> Vec<Reply> {
    let mut bytes = Vec::new();
    expect(device.receive(until.saturating_sub(device.now()), &mut bytes));
    let mut rest = bytes.as_slice();
    let mut replies = Vec::new();
    while let Some(frame) = decoder.next::<Reply>(&mut rest) {
        replies.push(frame.message);
    }
    replies
}

/// Bytes that mean nothing, always the same for a seed.
#[must_use]
pub fn noise(seed: u64, count: usize) -> Vec<u8> {
    let mut state = seed | 1;
    (0..count)
        .map(|_| {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            (state >> 24) as u8
        })
        .collect()
}
