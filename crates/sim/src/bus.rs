//! One CAN bus at 1 Mbit/s in virtual time: queues, arbitration, and the record of what went over it.
//!
//! The rule that makes runs repeatable: arbitration is decided only when the bus is free *at a time the
//! co-controller has already reached*. A frame submitted later can then never change the past, however long
//! the simulator or the firmware took to compute. Among the frames ready at that moment the lowest identifier
//! wins; equal identifiers go by order of submission. Each node sends its own frames in order (a FIFO mailbox).
//!
//! The interframe space is part of a frame's time on the wire, and delivery happens at its end: 3 us later than a
//! real controller's interrupt, in exchange for one event per frame instead of two.

use crate::time::{TICKS_PER_BIT, Ticks};
use crate::trace::BusTrace;
use crate::wire::{INTERFRAME_BITS, frame_ticks};
use puck::{CanFrame, Node};

/// A frame in a node's transmit queue.
#[derive(Clone, Copy, Debug)]
struct Waiting {
    ready: Ticks,
    sequence: u64,
    sender: Node,
    frame: CanFrame,
}

/// A frame on the wire, or one that has just left it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    /// Start of frame.
    pub start: Ticks,
    /// End of the interframe space: the bus is free again.
    pub end: Ticks,
    /// Who transmits. The host is [`Node::HOST`].
    pub sender: Node,
    /// What is transmitted.
    pub frame: CanFrame,
}

impl Passage {
    /// When every receiver has the frame: end of frame, three bits before the bus is free.
    #[must_use]
    pub fn received_at(&self) -> Ticks {
        self.end - Ticks::from(INTERFRAME_BITS) * TICKS_PER_BIT
    }
}

/// The bus: what waits, what is on the wire, what has been.
#[derive(Clone, Debug, Default)]
pub struct Bus {
    waiting: Vec<Waiting>,
    on_wire: Option<Passage>,
    free_at: Ticks,
    submissions: u64,
    trace: BusTrace,
    log: Option<Vec<Passage>>,
}

impl Bus {
    /// Puts a frame into the transmit queue of `sender`; it competes for the bus from `ready` on.
    pub fn queue(&mut self, ready: Ticks, sender: Node, frame: CanFrame) {
        self.submissions += 1;
        self.waiting.push(Waiting { ready, sequence: self.submissions, sender, frame });
    }

    /// Takes back everything a node has not yet begun to send: it has lost its power or left the bus.
    pub fn withdraw(&mut self, sender: Node) {
        self.waiting.retain(|waiting| waiting.sender != sender);
    }

    /// When the bus next has something to do, as far as is known now: the end of the frame on the wire, or a start.
    #[must_use]
    pub fn next_time(&self) -> Option<Ticks> {
        match self.on_wire {
            Some(passage) => Some(passage.end),
            None => self.heads().map(|waiting| waiting.ready.max(self.free_at)).min(),
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
    /// `now` must be a time the co-controller has reached, and everything else that happens at `now` must have been done.
    pub fn arbitrate(&mut self, now: Ticks) -> bool {
        if self.on_wire.is_some() || now < self.free_at {
            return false;
        }
        let winner = self
            .heads()
            .filter(|waiting| waiting.ready <= now)
            .min_by_key(|waiting| (waiting.frame.can_id().raw(), waiting.sequence))
            .copied();
        let Some(winner) = winner else { return false };
        self.waiting.retain(|waiting| waiting.sequence != winner.sequence);
        let end = now + frame_ticks(&winner.frame);
        let passage = Passage { start: now, end, sender: winner.sender, frame: winner.frame };
        self.trace.note(&passage);
        if let Some(log) = &mut self.log {
            log.push(passage);
        }
        self.on_wire = Some(passage);
        true
    }

    /// Whether a frame is on the wire.
    #[must_use]
    pub fn is_busy(&self) -> bool {
        self.on_wire.is_some()
    }

    /// What went over the bus so far; the frame on the wire counts from its start.
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

    /// The first unsent frame of each node: only these compete.
    fn heads(&self) -> impl Iterator<Item = &Waiting> {
        self.waiting.iter().filter(|candidate| {
            !self.waiting.iter().any(|other| other.sender == candidate.sender && other.sequence < candidate.sequence)
        })
    }
}
