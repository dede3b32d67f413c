//! Transmit buffers: dedicated ones, a FIFO or a queue; requests and their cancellation.
//!
//! Source: RM0433, Tx handling; registers TXBC, TXFQS, TXBRP, TXBAR, TXBCR, TXBTO, TXBCF.

use crate::frame::{Frame, Id};
use crate::memory::Memory;
use crate::receive::{ELEMENT_WORDS, EXTENDED, REMOTE};
use crate::registers::ir;

/// Effect of a cancelled place in the FIFO on the get index. The manual says that cancellation "is not intended" for a
/// FIFO, and in another place that the get index goes on to the next place with a pending request when its own place is
/// cancelled. Software should be right under both readings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Cancellation {
    /// The get index passes over cancelled places, at once or when it comes to them.
    #[default]
    Skipped,
    /// The get index stays on a cancelled place: nothing behind it leaves until the controller is configured anew.
    Stuck,
}

/// Configuration of the transmit buffers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layout {
    start: u32,
    element: u32,
    dedicated: u32,
    size: u32,
    is_queue: bool,
}

impl Layout {
    /// From TXBC and TXESC.
    pub(crate) fn new(txbc: u32, txesc: u32) -> Self {
        let dedicated = (txbc >> 16 & 0x3F).min(32);
        Self {
            start: (txbc & 0xFFFC) / 4,
            element: ELEMENT_WORDS[(txesc & 0b111) as usize],
            dedicated,
            size: (txbc >> 24 & 0x3F).min(32 - dedicated),
            is_queue: txbc >> 30 & 1 == 1,
        }
    }

    /// The buffer that lies `position` places behind the first of the FIFO or queue.
    fn buffer(&self, position: u32) -> u32 {
        self.dedicated + if self.size > 0 { position % self.size } else { 0 }
    }

    /// The buffer a word of the message memory belongs to.
    pub(crate) fn buffer_of(&self, word: u32) -> Option<u32> {
        let buffer = word.checked_sub(self.start)? / self.element;
        (buffer < self.dedicated + self.size).then_some(buffer)
    }
}

/// The state of all transmit buffers.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Transmit {
    /// TXBRP.
    pub(crate) pending: u32,
    /// TXBCR: cancellations that wait for the end of an attempt.
    pub(crate) cancelling: u32,
    /// TXBTO.
    pub(crate) occurred: u32,
    /// TXBCF.
    pub(crate) cancelled: u32,
    /// FIFO: place of the oldest request. Queue: where the put index stands.
    index: u32,
    /// FIFO: places from the get index to the put index.
    fill: u32,
    /// Content of each buffer when its transmission was requested.
    frames: [Frame; 32],
    policy: Cancellation,
}

/// Result of a request (TXBAR).
#[derive(Default)]
pub(crate) struct Requested {
    /// Bits of buffers that are not configured, or whose request is pending.
    pub(crate) ignored: u32,
    /// Bits of FIFO places other than those the put index names.
    pub(crate) out_of_order: u32,
    /// Byte offset of a word of the message memory that nobody has written.
    pub(crate) unwritten: Option<u32>,
}

impl Transmit {
    /// Nothing requested.
    pub(crate) fn new(policy: Cancellation) -> Self {
        let frames = [Frame::standard(0, &[]); 32];
        Self { pending: 0, cancelling: 0, occurred: 0, cancelled: 0, index: 0, fill: 0, frames, policy }
    }

    /// CCCR.CCE is set: no requests, no history, get and put index at the first place.
    pub(crate) fn reset(&mut self) {
        *self = Self::new(self.policy);
    }

    /// Content of a buffer when its transmission was requested.
    pub(crate) fn frame(&self, buffer: u8) -> Frame {
        self.frames[usize::from(buffer & 31)]
    }

    /// TXFQS.
    pub(crate) fn status(&self, layout: &Layout) -> u32 {
        if layout.size == 0 {
            return 0;
        }
        if layout.is_queue {
            let all = (0..layout.size).all(|position| self.is_pending(layout.buffer(position)));
            return layout.buffer(self.index) << 16 | u32::from(all) << 21;
        }
        let put = layout.buffer(self.index + self.fill);
        let free = layout.size - self.fill;
        free | layout.buffer(self.index) << 8 | put << 16 | u32::from(free == 0) << 21
    }

    /// TXBAR.
    pub(crate) fn request(&mut self, layout: &Layout, memory: &Memory, mask: u32) -> Requested {
        let count = layout.dedicated + layout.size;
        let configured = if count >= 32 { u32::MAX } else { (1 << count) - 1 };
        let accepted = mask & configured & !self.pending;
        let mut outcome = Requested { ignored: mask & !accepted, ..Requested::default() };
        for buffer in (0..32).filter(|buffer| accepted >> buffer & 1 == 1) {
            let (frame, unwritten) = read_element(memory, layout.start + buffer * layout.element);
            self.frames[buffer as usize] = frame;
            outcome.unwritten = outcome.unwritten.or(unwritten);
        }
        self.pending |= accepted;
        self.occurred &= !accepted;
        self.cancelled &= !accepted;
        if layout.is_queue {
            self.find_room(layout);
            return outcome;
        }
        let mut in_fifo = accepted & !((1u64 << layout.dedicated) - 1) as u32;
        while self.fill < layout.size && in_fifo >> layout.buffer(self.index + self.fill) & 1 == 1 {
            in_fifo &= !(1 << layout.buffer(self.index + self.fill));
            self.fill += 1;
        }
        outcome.out_of_order = in_fifo;
        outcome
    }

    /// TXBCR; a buffer in `begun` is on the wire and finished first. Returns the buffers cancelled now.
    pub(crate) fn cancel(&mut self, layout: &Layout, mask: u32, begun: u32) -> u32 {
        let asked = mask & self.pending;
        self.cancelling |= asked & begun;
        let now = asked & !begun;
        self.pending &= !now;
        self.cancelled |= now;
        self.pass_over(layout);
        now
    }

    /// The attempt of a buffer is over for good: it was sent, or it failed and is not to be repeated.
    pub(crate) fn end(&mut self, layout: &Layout, buffer: u8, is_sent: bool) {
        let (buffer, bit) = (u32::from(buffer), 1 << buffer);
        self.pending &= !bit;
        if is_sent {
            self.occurred |= bit;
        }
        if self.cancelling & bit != 0 || !is_sent {
            self.cancelled |= bit;
        }
        self.cancelling &= !bit;
        if !layout.is_queue && self.fill > 0 && buffer == layout.buffer(self.index) {
            self.step(layout);
        }
        self.pass_over(layout);
        if layout.is_queue {
            self.find_room(layout);
        }
    }

    /// The pending buffers in the order in which they will be sent.
    pub(crate) fn plan(&self, layout: &Layout) -> Vec<u8> {
        let by_priority = |buffers: &mut Vec<u32>| {
            buffers.retain(|buffer| self.is_pending(*buffer));
            buffers.sort_by_key(|buffer| (self.frames[*buffer as usize].arbitration(), *buffer));
        };
        let mut free: Vec<u32> = (0..layout.dedicated).collect();
        let mut ordered: Vec<u32> = Vec::new();
        if layout.is_queue {
            free.extend((0..layout.size).map(|position| layout.buffer(position)));
        } else {
            let places = (0..self.fill).map(|position| layout.buffer(self.index + position));
            // A place without a request that the get index does not pass over ends the FIFO.
            let stuck = self.policy == Cancellation::Stuck;
            ordered.extend(places.take_while(|place| !stuck || self.is_pending(*place)));
            ordered.retain(|place| self.is_pending(*place));
        }
        by_priority(&mut free);
        // Only the oldest place of the FIFO competes with the dedicated buffers.
        let mut plan = Vec::new();
        let (mut free, mut ordered) = (free.into_iter().peekable(), ordered.into_iter().peekable());
        let key = |buffer: u32| (self.frames[buffer as usize].arbitration(), buffer);
        loop {
            let next = match (free.peek(), ordered.peek()) {
                (Some(a), Some(b)) if key(*a) > key(*b) => ordered.next(),
                (Some(_), _) => free.next(),
                (None, _) => ordered.next(),
            };
            let Some(buffer) = next else { return plan };
            plan.push(buffer as u8);
        }
    }

    /// The FIFO holds nothing between get and put index.
    pub(crate) fn is_empty(&self) -> bool {
        self.fill == 0
    }

    fn is_pending(&self, buffer: u32) -> bool {
        self.pending >> buffer & 1 == 1
    }

    /// The get index goes on by one.
    fn step(&mut self, layout: &Layout) {
        self.index = (self.index + 1) % layout.size;
        self.fill -= 1;
    }

    /// The get index goes on to the next place with a request, if cancelled places are passed over.
    fn pass_over(&mut self, layout: &Layout) {
        while self.policy == Cancellation::Skipped && self.fill > 0 && !self.is_pending(layout.buffer(self.index)) {
            self.step(layout);
        }
    }

    /// Queue: the put index goes on to the next free place, if there is one.
    fn find_room(&mut self, layout: &Layout) {
        for _ in 0..layout.size {
            if !self.is_pending(layout.buffer(self.index)) {
                return;
            }
            self.index = (self.index + 1) % layout.size;
        }
    }
}

/// Flags of IR for a change of the transmit buffers, `txbtie` and `txbcie` allowing them.
pub(crate) fn flags(before: &Transmit, after: &Transmit, txbtie: u32, txbcie: u32) -> u32 {
    let set = |new: u32, flag: u32| if new != 0 { flag } else { 0 };
    set(after.occurred & !before.occurred & txbtie, ir::TC)
        | set(after.cancelled & !before.cancelled & txbcie, ir::TCF)
        | if after.is_empty() && !before.is_empty() { ir::TFE } else { 0 }
}

/// Reads an element; also the byte offset of a word that nobody has written.
fn read_element(memory: &Memory, at: u32) -> (Frame, Option<u32>) {
    let [head, control, low, high] = [0, 1, 2, 3].map(|word| memory.get(at + word));
    let is_extended = head & EXTENDED != 0;
    let id = if is_extended { Id::Extended(head & 0x1FFF_FFFF) } else { Id::Standard((head >> 18 & 0x7FF) as u16) };
    let remote = head & REMOTE != 0;
    let length = (control >> 16 & 0xF).min(8) as u8;
    let words = if remote { 2 } else { 2 + u32::from(length).div_ceil(4) };
    let unwritten = (at..at + words).find(|word| !memory.is_written(*word)).map(|word| word * 4);
    let mut frame = Frame { id, remote, length, data: [0; 8] };
    for (place, byte) in frame.data.iter_mut().zip(low.to_le_bytes().into_iter().chain(high.to_le_bytes())) {
        *place = byte;
    }
    (frame, unwritten)
}
