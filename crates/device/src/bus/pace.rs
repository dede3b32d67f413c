//! The pauses that Barrett's devices need between frames, measured in device time.
//!
//! A puck acknowledges no SET and drops some that follow each other too closely; a puck that wakes disturbs the bus.
//! The rules live at the single point through which every frame of the start-up leaves, not in the steps.

use puck::{Action, CanFrame, Destination, Node, PropertyId, Request};

/// Between any two frames of the start-up, us.
pub(crate) const FRAME_GAP_US: u64 = 1_000;
/// Between two SETs to the safety module, us.
pub(crate) const SAFETY_GAP_US: u64 = 10_000;
/// Between two wakes, us: each may glitch the transceivers, and too many errors put the controller off the bus.
pub(crate) const WAKE_GAP_US: u64 = 10_000;

/// When frames of each kind last left.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Pacer {
    frame: Option<u64>,
    safety: Option<u64>,
    wake: Option<u64>,
}

/// True if `gap` has passed since `last`.
fn passed(last: Option<u64>, gap: u64, now_us: u64) -> bool {
    last.is_none_or(|last| now_us.saturating_sub(last) >= gap)
}

/// True if a frame is a SET to the safety module, and whether it is a wake.
fn kind(frame: &CanFrame) -> (bool, bool) {
    match Request::decode(frame) {
        Ok(Request { to, action: Action::Set { property, .. }, .. }) => {
            (to == Destination::Node(Node::SAFETY_MODULE), property == PropertyId::STAT)
        }
        _ => (false, false),
    }
}

impl Pacer {
    /// True if this frame may leave now.
    pub(crate) fn permits(&self, frame: &CanFrame, now_us: u64) -> bool {
        let (safety, wake) = kind(frame);
        passed(self.frame, FRAME_GAP_US, now_us)
            && (!safety || passed(self.safety, SAFETY_GAP_US, now_us))
            && (!wake || passed(self.wake, WAKE_GAP_US, now_us))
    }

    /// True if this frame may leave now although others leave in the same slot, as in the cyclic loop.
    pub(crate) fn permits_in_cycle(&self, frame: &CanFrame, now_us: u64) -> bool {
        let (safety, _) = kind(frame);
        !safety || passed(self.safety, SAFETY_GAP_US, now_us)
    }

    /// This frame has left.
    pub(crate) fn note(&mut self, frame: &CanFrame, now_us: u64) {
        let (safety, wake) = kind(frame);
        self.frame = Some(now_us);
        if safety {
            self.safety = Some(now_us);
        }
        if wake {
            self.wake = Some(now_us);
        }
    }
}
