//! Which of several lines the host is on: the one on which a sound frame came last.
//!
//! A board may have several lines to a host (serial, USB, CAN); one conversation goes on at a time. Every line is read
//! all the time. Bytes on the chosen line pass through untouched. On the others a [`Listener`] waits for a whole frame
//! whose check sum is right; then that line is chosen, its frame is handed on, and what is sent goes there from then
//! on. Noise on a line that nobody uses, an open input or another program's chatter never takes the conversation away.
//! A zero byte ends what the line left behind had begun: it will not come to its end here.
//!
//! The session decides if a new host may take over from the old one, not the line: it refuses a second
//! host while the first is heard, and the refusal goes back on the line the request came from.

use link::Request;
use link::frame::{Decoder, FRAME_BYTES};

use super::LinkPort;

/// Watches one line for a sound frame and keeps the bytes of the frame under way.
#[derive(Debug)]
struct Listener {
    decoder: Decoder<FRAME_BYTES>,
    frame: heapless::Vec<u8, FRAME_BYTES>,
}

impl Listener {
    const fn new() -> Self {
        Self { decoder: Decoder::new(), frame: heapless::Vec::new() }
    }

    /// Takes one byte; `true` when it ends a sound frame, which is then in `frame`, its zero byte included.
    fn hears(&mut self, byte: u8) -> bool {
        if self.frame.push(byte).is_err() {
            // Longer than any frame: the decoder refuses it by itself.
            self.frame.clear();
        }
        let sound = self.decoder.next::<Request>(&mut &[byte][..]).is_some();
        if byte == 0 && !sound {
            self.frame.clear();
        }
        sound
    }

    /// Forgets what it heard.
    fn reset(&mut self) {
        self.decoder.reset();
        self.frame.clear();
    }
}

/// Bytes looked at in one go on a line that is not chosen.
const PORTION: usize = 32;

/// One conversation over one of two lines; either may be such a pair again.
#[derive(Debug)]
pub struct LineSelector<A, B> {
    lines: (A, B),
    listeners: (Listener, Listener),
    chosen: Chosen,
    /// Bytes already read that belong to the conversation: a frame by which a line was chosen, and what came behind it.
    pending: heapless::Deque<u8, PENDING_BYTES>,
}

/// Bytes of the end of another frame, of a frame, and of the portion behind it.
const PENDING_BYTES: usize = 1 + FRAME_BYTES + PORTION;

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Chosen {
    First,
    Second,
}

impl<A: LinkPort, B: LinkPort> LineSelector<A, B> {
    /// Both lines, the first one chosen until the other is heard.
    pub const fn new(first: A, second: B) -> Self {
        Self {
            lines: (first, second),
            listeners: (Listener::new(), Listener::new()),
            chosen: Chosen::First,
            pending: heapless::Deque::new(),
        }
    }

    /// Listens to the line that is not chosen; chooses it when a sound frame has come.
    fn listen(&mut self) {
        let mut portion = [0; PORTION];
        // Bounded by the bytes the line has; a line that is never quiet is chosen or read to the end of its queue.
        for _ in 0..LISTEN_ROUNDS {
            let (count, listener) = match self.chosen {
                Chosen::First => (self.lines.1.read(&mut portion), &mut self.listeners.1),
                Chosen::Second => (self.lines.0.read(&mut portion), &mut self.listeners.0),
            };
            let mut bytes = portion.iter().take(count);
            if bytes.any(|byte| listener.hears(*byte)) {
                // The line left behind may have been in the middle of a frame: the zero ends it, or this one would be
                // taken for the rest of it, and both be lost. Beside a line that is never quiet no stop got through.
                for byte in [0].iter().chain(listener.frame.iter()).chain(bytes) {
                    // All of it fits, nothing was left of an earlier one.
                    let _ = self.pending.push_back(*byte);
                }
                listener.reset();
                self.chosen = match self.chosen {
                    Chosen::First => Chosen::Second,
                    Chosen::Second => Chosen::First,
                };
                return;
            }
            if count < PORTION {
                return;
            }
        }
    }
}

/// Portions looked at in one visit of the session: all that a line's queue of 1024 bytes holds.
const LISTEN_ROUNDS: usize = 32;

impl<A: LinkPort, B: LinkPort> LinkPort for LineSelector<A, B> {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        // Not before all of the frame by which this line was chosen is handed on: another one would cut it off.
        if self.pending.is_empty() {
            self.listen();
        }
        let mut count = 0;
        for place in buffer.iter_mut() {
            let Some(byte) = self.pending.pop_front() else { break };
            *place = byte;
            count += 1;
        }
        let rest = buffer.get_mut(count..).unwrap_or(&mut []);
        count
            + match self.chosen {
                Chosen::First => self.lines.0.read(rest),
                Chosen::Second => self.lines.1.read(rest),
            }
    }

    fn write(&mut self, bytes: &[u8]) {
        match self.chosen {
            Chosen::First => self.lines.0.write(bytes),
            Chosen::Second => self.lines.1.write(bytes),
        }
    }

    fn room(&self) -> usize {
        match self.chosen {
            Chosen::First => self.lines.0.room(),
            Chosen::Second => self.lines.1.room(),
        }
    }
}
