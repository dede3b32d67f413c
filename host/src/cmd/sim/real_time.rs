//! `RealTime`: virtual time that passes as wall time does, and never makes up for much that the machine was late.

use std::time::{Duration, Instant};

/// Most virtual time that is made up for after a delay. Programs on the line live by the wall clock: an arm that made
/// up for half a second at once would take each of them for silent (500 ms).
const MOST: Duration = Duration::from_millis(20);

/// Virtual time held against the wall clock from a beginning on.
#[derive(Debug)]
pub(super) struct RealTime {
    /// Virtual time at the beginning.
    begun: Duration,
    /// The beginning on the wall clock.
    started: Instant,
    delay: Delay,
}

impl RealTime {
    /// From this virtual time on, and from now.
    pub(super) fn begin(now: Duration) -> Self {
        Self { begun: now, started: Instant::now(), delay: Delay::default() }
    }

    /// Time to wait so that virtual time, which is `now`, does not run ahead.
    pub(super) fn wait(&mut self, now: Duration) -> Duration {
        self.delay.wait(now.saturating_sub(self.begun), self.started.elapsed())
    }
}

/// Delay of virtual time behind wall time that is never caught up.
#[derive(Debug, Default)]
struct Delay {
    lost: Duration,
}

impl Delay {
    /// Time to wait now so that virtual time does not run ahead; both times are since the beginning.
    fn wait(&mut self, virtual_time: Duration, wall_time: Duration) -> Duration {
        self.lost = self.lost.max(wall_time.saturating_sub(virtual_time).saturating_sub(MOST));
        (virtual_time + self.lost).saturating_sub(wall_time)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const STRIDE: Duration = Duration::from_millis(2);

    /// Virtual time that passes in the second after the machine stood still for so long.
    fn after(delay: Duration) -> Duration {
        let (mut real_time, mut virtual_time, mut wall_time) = (Delay::default(), Duration::ZERO, delay);
        while wall_time < delay + Duration::from_secs(1) {
            virtual_time += STRIDE;
            // A computed stride takes an instant.
            wall_time += real_time.wait(virtual_time, wall_time).max(Duration::from_micros(50));
        }
        virtual_time
    }

    #[test]
    fn a_machine_that_was_late_makes_up_for_a_moment_and_no_more() {
        let second = Duration::from_secs(1);
        for (delay, caught_up) in [(0, 0), (10, 10), (20, 20), (500, 20), (60_000, 20)] {
            let passed = after(Duration::from_millis(delay));
            let expected = second + Duration::from_millis(caught_up);
            let error = passed.abs_diff(expected);
            assert!(error <= 2 * STRIDE, "after {delay} ms: {passed:?} instead of {expected:?}");
        }
    }

    #[test]
    fn two_delays_lose_no_more_than_both() {
        let mut real_time = Delay::default();
        assert_eq!(real_time.wait(Duration::from_secs(1), Duration::from_secs(2)), Duration::ZERO);
        assert_eq!(real_time.wait(Duration::from_secs(2), Duration::from_secs(2)), Duration::from_millis(980));
    }
}
