//! `Lateness`: which control cycles were late of late, and whether they are too many.

use heapless::Deque;

/// Late cycles in a row that stop the arm.
const IN_A_ROW: u8 = 3;

/// Late cycles within [`WINDOW`] that stop the arm.
const IN_A_SECOND: usize = 10;

/// A second, in control cycles.
const WINDOW: u64 = control::time::RATE as u64;

/// The late cycles of the last second.
#[derive(Clone, Debug, Default)]
pub(super) struct Lateness {
    /// Numbers of the last late cycles, the oldest first.
    late: Deque<u64, IN_A_SECOND>,
    /// Length of the row that the last one ends.
    row: u8,
    is_too_much: bool,
}

impl Lateness {
    /// Something of the cycle with this number was late. Any number of times is once.
    #[cold]
    #[inline(never)]
    pub(super) fn note(&mut self, cycle: u64) {
        let last = self.late.back().copied();
        if last == Some(cycle) {
            return;
        }
        self.row = if last.is_some_and(|last| last.wrapping_add(1) == cycle) { self.row.saturating_add(1) } else { 1 };
        if self.late.is_full() {
            self.late.pop_front();
        }
        // There is room now.
        let _ = self.late.push_back(cycle);
        let first = self.late.front().filter(|_| self.late.is_full());
        let crowded = first.is_some_and(|first| cycle.saturating_sub(*first) < WINDOW);
        self.is_too_much |= self.row >= IN_A_ROW || crowded;
    }

    /// True, once, if too many cycles were late.
    pub(super) fn take(&mut self) -> bool {
        let is_too_much = self.is_too_much;
        if is_too_much {
            *self = Lateness::default();
        }
        is_too_much
    }
}
