//! One CAN bus at 1 Mbit/s in virtual time: queues, arbitration, and the record of what went over it.
//!
//! The rule that makes runs repeatable: arbitration is decided only when the bus is free *at a time the
//! co-controller has already reached*. A frame submitted later can then never change the past, however long
//! the simulator or the firmware took to compute. Among the frames ready at that moment the lowest identifier
//! wins; equal identifiers go by order of submission. Each node sends its own frames in order (a FIFO mailbox).
//!
//! The interframe space is part of a frame's time on the wire, and delivery happens at its end: 3 us later than a
//! real controller's interrupt, in exchange for one event per frame instead of two.

use crate::time::Ticks;
use crate::trace::BusTrace;
use crate::wire::{Passage, frame_ticks};
use puck::{CanFrame, Node};
use std::collections::VecDeque;

/// A frame in a node's transmit queue.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    ready: Ticks,
    sequence: u64,
    frame: CanFrame,
}

/// Under this number the frames of foreign programs queue and are kept: no device of an arm has it. The identifiers of
/// their frames are theirs to choose.
pub const FOREIGN: Node = match Node::new(31) {
    Some(node) => node,
    None => unreachable!(),
};

/// One transmit queue for each of the 32 node numbers.
type Queues = [VecDeque<Waiting>; 32];

/// The bus: what waits, what is on the wire, what has been.
#[derive(Clone, Debug, Default)]
pub struct Bus {
    queues: Queues,
    /// Bit n: node n has something to send.
    senders: u32,
    on_wire: Option<Passage>,
    free_at: Ticks,
    submissions: u64,
    trace: BusTrace,
    log: Option<Vec<Passage>>,
    heard: Option<Vec<Passage>>,
}

impl Bus {
    /// Puts a frame into the transmit queue of `sender`; it competes for the bus from `ready` on.
    pub fn queue(&mut self, ready: Ticks, sender: Node, frame: CanFrame) {
        self.submissions += 1;
        self.queues[usize::from(sender.number())].push_back(Waiting { ready, sequence: self.submissions, frame });
        self.senders |= 1 << sender.number();
    }

    /// Takes back everything a node has not yet begun to send: it has lost its power or left the bus.
    pub fn withdraw(&mut self, sender: Node) {
        self.queues[usize::from(sender.number())].clear();
        self.senders &= !(1 << sender.number());
    }

    /// When the bus next has something to do, as far as is known now: the end of the frame on the wire, or a start.
    #[must_use]
    pub fn next_time(&self) -> Option<Ticks> {
        match self.on_wire {
            Some(passage) => Some(passage.end),
            None => self.heads().map(|(_, waiting)| waiting.ready.max(self.free_at)).min(),
        }
    }

    /// Takes the frame off the wire whose time has come, and frees the bus.
    pub fn finish(&mut self, now: Ticks) -> Option<Passage> {
        let passage = self.on_wire.take_if(|passage| passage.end <= now)?;
        self.free_at = passage.end;
        Some(passage)
    }

    /// If the bus is free, starts the winner among the frames that are ready; `true` if one was started.
    ///
    /// `now` must be a time the co-controller has reached, and everything else that happens at `now` must have been
    /// done.
    pub fn arbitrate(&mut self, now: Ticks) -> bool {
        if self.on_wire.is_some() || now < self.free_at {
            return false;
        }
        let ready = self.heads().filter(|(_, waiting)| waiting.ready <= now);
        let winner = ready.min_by_key(|(_, waiting)| (waiting.frame.can_id().raw(), waiting.sequence));
        let Some((sender, Waiting { frame, .. })) = winner.map(|(sender, waiting)| (sender, *waiting)) else {
            return false;
        };
        let queue = &mut self.queues[usize::from(sender.number())];
        queue.pop_front();
        if queue.is_empty() {
            self.senders &= !(1 << sender.number());
        }
        let passage = Passage { start: now, end: now + frame_ticks(&frame), sender, frame };
        self.trace.note(&passage);
        if let Some(log) = &mut self.log {
            log.push(passage);
        }
        self.on_wire = Some(passage);
        true
    }

    /// Frames of a node that wait for the bus.
    #[must_use]
    pub fn waiting(&self, sender: Node) -> usize {
        self.queues[usize::from(sender.number())].len()
    }

    /// True while a frame is on the wire.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.on_wire.is_some()
    }

    /// Who sends the frame on the wire.
    #[must_use]
    pub fn sender(&self) -> Option<Node> {
        self.on_wire.map(|passage| passage.sender)
    }

    /// Statistics of the bus so far; the frame on the wire counts from its start.
    #[must_use]
    pub fn trace(&self) -> &BusTrace {
        &self.trace
    }

    /// Starts to keep every frame from now on, for logs and tests.
    pub fn record(&mut self) {
        self.log.get_or_insert_with(Vec::new);
    }

    /// The frames kept since [`Bus::record`], oldest first; empty if it was never called.
    #[must_use]
    pub fn recorded(&self) -> &[Passage] {
        self.log.as_deref().unwrap_or(&[])
    }

    /// Takes out the frames kept so far; keeping goes on.
    pub fn take_recorded(&mut self) -> Vec<Passage> {
        self.log.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// Starts to keep what is noted as heard.
    pub fn record_heard(&mut self) {
        self.heard.get_or_insert_with(Vec::new);
    }

    /// A frame has arrived.
    pub fn note_heard(&mut self, passage: &Passage) {
        if let Some(heard) = &mut self.heard {
            heard.push(*passage);
        }
    }

    /// Takes out what was heard so far; keeping goes on.
    pub fn take_heard(&mut self) -> Vec<Passage> {
        self.heard.as_mut().map(std::mem::take).unwrap_or_default()
    }

    /// The first unsent frame of each node: only these compete.
    fn heads(&self) -> impl Iterator<Item = (Node, &Waiting)> {
        let mut remaining = self.senders;
        std::iter::from_fn(move || {
            // 32 trailing zeros, nobody left, is no node number.
            let sender = Node::new(u8::try_from(remaining.trailing_zeros()).ok()?)?;
            remaining &= remaining - 1;
            self.queues[usize::from(sender.number())].front().map(|waiting| (sender, waiting))
        })
    }
}
