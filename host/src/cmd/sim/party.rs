//! Everybody who is connected to a served arm: each gets his turn, and whoever wants to stop it is heard first.

use std::collections::VecDeque;
use std::io::{ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use link::Request;
use link::frame::{Decoder, FRAME_BYTES};

/// A connection that can be read without waiting.
pub(super) trait Peer: Read + Write {}
impl<T: Read + Write> Peer for T {}

/// Connections that may say anything: the host that uses the arm, and others.
const GUESTS: usize = 4;

/// One more may say hello, ask for the state, and stop the arm.
const PLACES: usize = GUESTS + 1;

/// Time after which that place is given to the next who comes.
const STAY: Duration = Duration::from_secs(1);

/// A message is shorter than this; what is longer without an end is none.
const LONGEST_MESSAGE: usize = 2 * FRAME_BYTES;

/// Bytes of whole messages that wait for their turn; a guest who says more is not read until they have gone on.
const WAITING: usize = 4096;

/// One connection. The others speak on the same line, so messages go on as wholes.
struct Guest {
    peer: Box<dyn Peer>,
    came: Instant,
    /// The beginning of a message.
    begun: Vec<u8>,
    /// Whole messages that wait for their turn.
    messages: VecDeque<Vec<u8>>,
    waiting: usize,
    gone: bool,
}

impl Guest {
    /// Reads what has arrived, as long as there is room for it.
    fn read(&mut self) {
        let mut buffer = [0; 1024];
        while !self.gone && self.waiting < WAITING {
            match self.peer.read(&mut buffer) {
                Ok(0) => self.gone = true,
                Ok(count) => self.take(&buffer[..count]),
                Err(error) if error.kind() == ErrorKind::WouldBlock => return,
                Err(_) => self.gone = true,
            }
        }
    }

    fn take(&mut self, bytes: &[u8]) {
        for byte in bytes {
            self.begun.push(*byte);
            if *byte == 0 {
                self.waiting += self.begun.len();
                self.messages.push_back(std::mem::take(&mut self.begun));
            } else if self.begun.len() > LONGEST_MESSAGE {
                self.begun.clear();
            }
        }
    }

    /// The next message that fits into `room` bytes.
    fn next(&mut self, room: usize) -> Option<Vec<u8>> {
        let message = self.messages.pop_front_if(|message| message.len() <= room)?;
        self.waiting -= message.len();
        Some(message)
    }
}

/// The request in a message, if it is one.
fn request(message: &[u8]) -> Option<Request> {
    Decoder::<FRAME_BYTES>::new().next::<Request>(&mut &*message).map(|frame| frame.message)
}

/// Everybody who is connected.
#[derive(Default)]
pub(super) struct Party {
    guests: Vec<Guest>,
    /// Whose turn it is.
    turn: usize,
}

impl Party {
    /// True if nobody is connected.
    pub(super) fn is_empty(&self) -> bool {
        self.guests.is_empty()
    }

    /// True if one more can be welcomed: at the last place they take turns.
    pub(super) fn has_room(&self) -> bool {
        self.guests.len() < PLACES || self.guests.last().is_some_and(|last| last.came.elapsed() > STAY)
    }

    /// Takes one more in.
    pub(super) fn welcome(&mut self, peer: Box<dyn Peer>) {
        self.guests.truncate(PLACES - 1);
        self.guests.push(Guest {
            peer,
            came: Instant::now(),
            begun: Vec::new(),
            messages: VecDeque::new(),
            waiting: 0,
            gone: false,
        });
    }

    /// Messages for the device, at most `most` bytes and one more stop: stops first, then one of each guest in turn.
    /// Those who are gone leave once their last words are heard.
    pub(super) fn hear(&mut self, most: usize) -> Vec<u8> {
        let mut said = Vec::new();
        for (place, guest) in self.guests.iter_mut().enumerate() {
            guest.read();
            let restricted = place >= GUESTS;
            let mut kept = VecDeque::new();
            for message in std::mem::take(&mut guest.messages) {
                match request(&message) {
                    // One stop is as good as many.
                    Some(Request::Stop) if said.len() < most => said.extend(message),
                    Some(Request::Hello(_) | Request::Goodbye | Request::Status | Request::Stop) => {
                        kept.push_back(message);
                    }
                    _ if restricted => {}
                    _ => kept.push_back(message),
                }
            }
            guest.waiting = kept.iter().map(Vec::len).sum();
            guest.messages = kept;
        }
        let mut idle = 0;
        while idle < self.guests.len() {
            let count = self.guests.len();
            let guest = &mut self.guests[self.turn % count];
            self.turn = (self.turn + 1) % count;
            match guest.next(most.saturating_sub(said.len())) {
                Some(message) => {
                    said.extend(message);
                    idle = 0;
                }
                None => idle += 1,
            }
        }
        self.guests.retain(|guest| !guest.gone || !guest.messages.is_empty());
        said
    }

    /// Hands over what the device says. One that does not read loses bytes, as on a serial line. Nobody leaves here:
    /// one that has hung up may have said its last words before.
    pub(super) fn tell(&mut self, bytes: &[u8]) {
        for guest in &mut self.guests {
            let _ = guest.peer.write_all(bytes);
        }
    }
}

#[cfg(test)]
mod tests {
    use std::os::unix::net::UnixStream;

    use std::time::Duration;

    use control::State;
    use lab::client::Client;
    use lab::device::Device;
    use lab::procedure;
    use lab::transport::Transport;
    use link::frame::{Decoder, Envelope, encode};
    use link::{EventKind, Reply};

    use super::super::{STRIDE, STRIDE_BYTES};
    use super::*;

    fn message(request: &Request) -> Vec<u8> {
        let mut out = [0; FRAME_BYTES];
        let length = encode(Envelope::default(), request, &mut out).unwrap();
        out[..length].to_vec()
    }

    /// The two ends of a connection, one of them a guest.
    fn guest(party: &mut Party) -> UnixStream {
        let (host, arm) = UnixStream::pair().unwrap();
        arm.set_nonblocking(true).unwrap();
        host.set_nonblocking(true).unwrap();
        party.welcome(Box::new(arm));
        host
    }

    #[test]
    fn the_last_words_of_one_who_has_hung_up_are_heard_whatever_he_is_told_meanwhile() {
        let mut party = Party::default();
        let mut host = guest(&mut party);
        assert_eq!((party.hear(100), party.guests.len()), (Vec::new(), 1), "who says nothing is still there");
        // A stop and a goodbye, and the process ends while telemetry goes on.
        host.write_all(b"stop\0goodbye\0").unwrap();
        drop(host);
        party.tell(b"telemetry");
        party.tell(b"telemetry");
        assert_eq!(party.hear(100), b"stop\0goodbye\0");
        assert_eq!((party.hear(100), party.guests.len()), (Vec::new(), 0), "who is gone has left");
    }

    #[test]
    fn h6_a_flood_fills_no_memory_and_delays_neither_a_stop_nor_the_owner() {
        const MOST: usize = 440;
        let mut party = Party::default();
        let (mut owner, mut flood) = (guest(&mut party), guest(&mut party));
        let ping = message(&Request::Ping);
        let (chunk, stop) = (ping.repeat(200), message(&Request::Stop));
        let flooded = |flood: &mut UnixStream| while flood.write(&chunk).is_ok_and(|count| count == chunk.len()) {};
        for _ in 0..200 {
            flooded(&mut flood);
            assert!(party.hear(MOST).len() <= MOST);
            let guest = &party.guests[1];
            assert!(guest.waiting <= WAITING + 1024 && guest.begun.len() <= LONGEST_MESSAGE, "{}", guest.waiting);
        }
        // The owner's word goes on in the next turn, a stop before everything else.
        let status = message(&Request::Status);
        owner.write_all(&status).unwrap();
        let said = party.hear(MOST);
        assert!(said.windows(status.len()).any(|window| window == status));
        owner.write_all(&stop).unwrap();
        assert!(party.hear(MOST).starts_with(&stop));
        // Garbage without an end neither.
        let garbage = [0xA5; 4096];
        for _ in 0..200 {
            while flood.write(&garbage).is_ok_and(|count| count == garbage.len()) {}
            party.hear(MOST);
            assert!(party.guests[1].begun.len() <= LONGEST_MESSAGE);
        }
    }

    /// Device time from a guest's stop to the word that the arm stops, while three others say all they can: `said`
    /// again and again.
    fn stopping(said: &[u8]) -> Duration {
        let device = Device::open(&"sil:world=simple".parse().unwrap(), |_| {}).map_err(|_| "no device").unwrap();
        let mut arm = Client::connect(device, "test").unwrap();
        procedure::make_ready(&mut arm, true, |_| {}).unwrap();
        arm.gravity().unwrap();
        let device = arm.transport();
        let mut party = Party::default();
        let mut guests: [UnixStream; 4] = std::array::from_fn(|_| guest(&mut party));
        let (mut bytes, mut decoder, mut asked) = (Vec::new(), Decoder::<FRAME_BYTES>::new(), None);
        for turn in 0.. {
            for flood in &mut guests[1..] {
                while flood.write(said).is_ok_and(|count| count == said.len()) {}
            }
            if turn == 40 {
                // Just too late for this turn: it is heard in the next.
                device.send(&party.hear(STRIDE_BYTES)).unwrap();
                guests[0].write_all(&message(&Request::Stop)).unwrap();
                asked = Some(device.now());
            } else {
                device.send(&party.hear(STRIDE_BYTES)).unwrap();
            }
            let target = device.now() + STRIDE;
            while device.now() < target {
                bytes.clear();
                device.receive(target.saturating_sub(device.now()), &mut bytes).unwrap();
                let mut rest = bytes.as_slice();
                while let Some(frame) = decoder.next::<Reply>(&mut rest) {
                    if let (Reply::Event(event), Some(asked)) = (frame.message, asked)
                        && (event.kind, event.code) == (EventKind::State, State::SoftStop.code().into())
                    {
                        return device.now() - asked;
                    }
                }
            }
            assert!(turn < 200, "the arm never stopped");
        }
        unreachable!("the turns do not end")
    }

    #[test]
    fn h6_a_guest_s_stop_is_obeyed_within_20_ms_of_the_device_s_time_whatever_the_others_say() {
        for said in [message(&Request::Status).repeat(100), message(&Request::Ping).repeat(100), vec![0xA5; 4096]] {
            let took = stopping(&said);
            println!("{took:?}");
            assert!(took <= Duration::from_millis(20), "{took:?}");
        }
    }

    #[test]
    fn h8_a_place_is_kept_for_a_stop_and_only_for_that() {
        let mut party = Party::default();
        let _idle: Vec<UnixStream> = (0..GUESTS).map(|_| guest(&mut party)).collect();
        assert!(party.has_room());
        let mut late = guest(&mut party);
        assert!(!party.has_room(), "he has his second");
        let (stop, gravity) = (message(&Request::Stop), message(&Request::Gravity));
        late.write_all(&[gravity, stop.clone()].concat()).unwrap();
        assert_eq!(party.hear(440), stop);
        party.guests[GUESTS].came = Instant::now() - 2 * STAY;
        assert!(party.has_room());
        let _next = guest(&mut party);
        assert_eq!(party.guests.len(), PLACES);
    }
}
