//! The link on the host's bus: segments to messages of host and device.

use link::can::{DeviceNumber, Direction, Heading, Reassembler};
use link::frame::{self, FRAME_BYTES};
use link::{Reply, Request};
use puck::CanFrame;

use crate::decoder::Meaning;

/// One direction of the conversation with one device.
struct Stream {
    device: DeviceNumber,
    direction: Direction,
    segments: Reassembler,
    messages: frame::Decoder<FRAME_BYTES>,
}

/// Reads the segments of all devices on a host's bus, in their order.
#[derive(Default)]
pub struct HostLink {
    streams: Vec<Stream>,
}

/// A message that was complete with a segment.
#[derive(Debug, Clone, PartialEq)]
pub enum Message {
    /// From the host.
    Request(Request),
    /// From the device.
    Reply(Reply),
}

impl HostLink {
    /// True if a frame has the identifier of a segment.
    #[must_use]
    pub fn is_segment(frame: &CanFrame) -> bool {
        Heading::parse(frame.can_id().raw()).is_some()
    }

    /// Takes a frame: which way it goes, and the messages that are complete with it. `None`: no segment.
    pub fn take(&mut self, frame: &CanFrame) -> Option<(Heading, Vec<Message>)> {
        let id = frame.can_id().raw();
        let heading = Heading::parse(id)?;
        let stream = self.stream(heading);
        let piece = stream.segments.take(id, frame.payload());
        let mut rest = &*piece;
        let mut messages = Vec::new();
        match heading.direction {
            Direction::ToDevice => {
                while let Some(frame) = stream.messages.next::<Request>(&mut rest) {
                    messages.push(Message::Request(frame.message));
                }
            }
            Direction::ToHost => {
                while let Some(frame) = stream.messages.next::<Reply>(&mut rest) {
                    messages.push(Message::Reply(frame.message));
                }
            }
        }
        Some((heading, messages))
    }

    /// Gaps among the segments of all streams, and messages that were damaged.
    #[must_use]
    pub fn damage(&self) -> (u32, u32) {
        let gaps = self.streams.iter().map(|stream| stream.segments.counters().gaps).sum();
        let bad = self.streams.iter().map(|stream| {
            let counters = stream.messages.counters();
            counters.bad_cobs + counters.bad_crc + counters.too_long + counters.undecodable
        });
        (gaps, bad.sum())
    }

    /// The meaning of a frame.
    pub fn read(&mut self, frame: &CanFrame) -> Option<Meaning> {
        let (heading, messages) = self.take(frame)?;
        let device = format!("device {}", heading.device);
        let (from, to) = match heading.direction {
            Direction::ToDevice => ("host".to_owned(), device),
            Direction::ToHost => (device, "host".to_owned()),
        };
        let ended: Vec<String> = messages.iter().map(words).collect();
        let segment = format!("segment {:2}", heading.sequence);
        let text = if ended.is_empty() { segment } else { format!("{segment}, end of {}", ended.join(" and ")) };
        Some(Meaning::link(from, to, text))
    }

    fn stream(&mut self, heading: Heading) -> &mut Stream {
        let (device, direction) = (heading.device, heading.direction);
        let place = self.streams.iter().position(|stream| (stream.device, stream.direction) == (device, direction));
        let place = place.unwrap_or_else(|| {
            let segments = Reassembler::new(direction, device);
            self.streams.push(Stream { device, direction, segments, messages: frame::Decoder::new() });
            self.streams.len() - 1
        });
        &mut self.streams[place]
    }
}

/// A message in a few words.
fn words(message: &Message) -> String {
    match message {
        Message::Request(Request::UploadChunk { offset, data }) => {
            format!("'upload chunk' ({} bytes at {offset})", data.len())
        }
        Message::Request(Request::Run { name, .. }) => format!("'run' {}", name.as_str()),
        Message::Request(request) => format!("'{}'", request.name()),
        Message::Reply(Reply::Hello { .. }) => "hello".to_owned(),
        Message::Reply(Reply::Accepted { of }) => format!("'accepted' (request {of})"),
        Message::Reply(Reply::Refused { of, reason, .. }) => format!("'refused' (request {of}: {reason})"),
        Message::Reply(Reply::Status { .. }) => "status".to_owned(),
        Message::Reply(Reply::Statistics { .. }) => "statistics".to_owned(),
        Message::Reply(Reply::Listing { .. }) => "listing".to_owned(),
        Message::Reply(Reply::Chunk { offset, data, .. }) => format!("chunk ({} bytes at {offset})", data.len()),
        Message::Reply(Reply::Telemetry(telemetry)) => format!("telemetry of cycle {}", telemetry.cycle),
        Message::Reply(Reply::Event(event)) => format!("event {:?}", event.kind),
        Message::Reply(Reply::Calibration { .. }) => "calibration".to_owned(),
        Message::Reply(Reply::FaultRecord { .. }) => "fault record".to_owned(),
        Message::Reply(Reply::FaultCycle { .. }) => "fault cycle".to_owned(),
        Message::Reply(Reply::Weight { .. }) => "weight".to_owned(),
        Message::Reply(Reply::Owner { .. }) => "owner".to_owned(),
        Message::Reply(Reply::Secret { .. }) => "secret".to_owned(),
        Message::Reply(Reply::Challenge { .. }) => "challenge".to_owned(),
        Message::Reply(Reply::Storage { .. }) => "storage".to_owned(),
    }
}
