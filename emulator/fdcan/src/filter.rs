//! Acceptance filters: which frames are kept, and where.
//!
//! Source: RM0433, acceptance filtering, standard and extended message identifier filter elements.

use crate::frame::{Frame, Id};
use crate::memory::Memory;
use crate::registers::{GFC, SIDFC, XIDAM, XIDFC};

/// Action of an element.
const DISABLED: u32 = 0;
const TO_FIFO_0: u32 = 1;
const TO_FIFO_1: u32 = 2;
const REJECT: u32 = 3;
/// From here on the match is also told as one of high priority; 5 and 6 store as 1 and 2 do.
const PRIORITY: u32 = 4;
const TO_BUFFER: u32 = 7;

/// Where a frame goes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Verdict {
    /// Receive FIFO 0 or 1; `None`: the frame is dropped.
    pub(crate) fifo: Option<usize>,
    /// Number of the element that matched.
    pub(crate) element: Option<u32>,
    /// The match is told as one of high priority.
    pub(crate) priority: bool,
    /// The element stores into a dedicated receive buffer, which the model does not have.
    pub(crate) unmodelled: bool,
    /// A filter element was read that nobody has written since power-up: its byte offset.
    pub(crate) unwritten: Option<u32>,
}

impl Verdict {
    const DROPPED: Self = Self { fifo: None, element: None, priority: false, unmodelled: false, unwritten: None };
}

/// Decides; `register` reads a register of the controller.
pub(crate) fn verdict(register: impl Fn(u32) -> u32, memory: &Memory, frame: &Frame) -> Verdict {
    let global = register(GFC);
    let (list, words, id, masked, reject_remote, others) = match frame.id {
        Id::Standard(id) => (register(SIDFC), 1, u32::from(id), u32::from(id), 1 << 1, global >> 4),
        Id::Extended(id) => (register(XIDFC), 2, id, id & register(XIDAM), 1 << 0, global >> 2),
    };
    if frame.remote && global & reject_remote != 0 {
        return Verdict::DROPPED;
    }
    // More than 128 words of filters count as 128.
    let (start, count) = ((list & 0xFFFC) / 4, (list >> 16 & 0xFF).min(128 / words));
    let mut unwritten = None;
    for element in 0..count {
        let at = start + element * words;
        unwritten = (at..at + words).find(|word| !memory.is_written(*word)).map(|word| word * 4).or(unwritten);
        let (kind, action, first, second) = if words == 1 {
            let word = memory.get(at);
            (word >> 30, word >> 27 & 0b111, word >> 16 & 0x7FF, word & 0x7FF)
        } else {
            let (upper, lower) = (memory.get(at), memory.get(at + 1));
            (lower >> 30, upper >> 29, upper & 0x1FFF_FFFF, lower & 0x1FFF_FFFF)
        };
        let is_match = match (action, kind, words) {
            (DISABLED, ..) => false,
            (TO_BUFFER, ..) => masked == first,
            (_, 0, _) => (first..=second).contains(&masked),
            (_, 1, _) => masked == first || masked == second,
            (_, 2, _) => masked & second == first & second,
            // Type 3 is a range without the mask for 29 bits, and disables an element for 11.
            (.., 1) => false,
            _ => (first..=second).contains(&id),
        };
        if is_match {
            return matched(action, element, unwritten);
        }
    }
    let fifo = match others & 0b11 {
        0 => Some(0),
        1 => Some(1),
        _ => None,
    };
    Verdict { fifo, unwritten, ..Verdict::DROPPED }
}

/// Decision of the first matching element.
fn matched(action: u32, element: u32, unwritten: Option<u32>) -> Verdict {
    let priority = (PRIORITY..TO_BUFFER).contains(&action);
    let fifo = match if priority { action - PRIORITY } else { action } {
        TO_FIFO_0 => Some(0),
        TO_FIFO_1 => Some(1),
        _ => None,
    };
    debug_assert!(action != REJECT || fifo.is_none());
    Verdict { fifo, element: Some(element), priority, unmodelled: action == TO_BUFFER, unwritten }
}
