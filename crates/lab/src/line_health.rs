//! The health of the bus and of the line to the host: lost cycles, gaps, times of answers, and who was late.
//!
//! All of it is derived from what the device tells anyway: the stream of control cycles and its counters.

use std::time::Duration;

use link::{Statistics, Telemetry};
use schemars::JsonSchema;
use serde::Serialize;

use crate::client::{Client, Gaps, Incoming};
use crate::demonstration::RATE;
use crate::error::HostError;
use crate::transport::Transport;

/// Cycles over which the newest success rate is taken.
const NEWEST: u32 = 100;

/// Period of the requests in a measurement.
const ASK_EVERY: Duration = Duration::from_millis(100);

/// The counters of one moment: the device's counters and those of this host.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Snapshot {
    /// Counters of the device.
    pub statistics: Statistics,
    /// Messages that this host has missed.
    pub gaps: Gaps,
    /// Requests that this host sent again.
    pub repeated: u32,
}

impl Snapshot {
    /// The counters now.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn of(client: &mut Client<impl Transport>) -> Result<Snapshot, HostError> {
        let statistics = client.statistics()?;
        Ok(Snapshot { statistics, gaps: client.gaps(), repeated: client.round_trips().repeated })
    }
}

/// Looks at the line for a time of the client's clock: every cycle is told, and a request is sent ten times a second.
///
/// # Errors
/// As [`Client::next`] and [`Client::request`].
pub fn measure(client: &mut Client<impl Transport>, time: Duration) -> Result<LineHealth, HostError> {
    client.set_telemetry(1)?;
    let before = Snapshot::of(client)?;
    client.take_answer_times();
    let (started, mut asked, mut cycles) = (client.now(), client.now(), Vec::new());
    while client.now().saturating_sub(started) < time {
        if let Some(Incoming::Telemetry(cycle)) = client.next(ASK_EVERY)? {
            cycles.push(cycle);
        }
        if client.now().saturating_sub(asked) >= ASK_EVERY {
            asked = client.now();
            client.status()?;
        }
    }
    let answers = client.take_answer_times();
    let after = Snapshot::of(client)?;
    client.set_telemetry(0)?;
    Ok(LineHealth::between(&before, &after, &cycles, &answers))
}

/// Health of the bus and of the line to the host over some time.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct LineHealth {
    /// Control cycles of the device in this time.
    pub cycles: u32,
    /// Share of the cycles that came to this host with every reply of the bus; none before one came.
    pub success_rate: Option<f64>,
    /// The same of the newest 100 cycles.
    pub success_rate_newest_100: Option<f64>,
    /// Longest time between two cycles that came, ms.
    pub longest_gap_ms: Option<f64>,
    /// Half of the answers to requests took no longer, ms; none where nothing was asked.
    pub answer_p50_ms: Option<f64>,
    /// 99 of 100 answers took no longer, ms; likewise.
    pub answer_p99_ms: Option<f64>,
    /// The slowest answer, ms; likewise.
    pub answer_max_ms: Option<f64>,
    /// Requests that were sent again because no answer came.
    pub repeated_requests: u32,
    /// Messages of the device that did not arrive here.
    pub lost_messages: u32,
    /// Telemetry that the device left out because the line was full.
    pub telemetry_dropped: u32,
    /// Replies of arm and sensor that did not come in their cycle.
    pub lost_replies: u32,
    /// Replies that came after their cycle.
    pub late_replies: u32,
    /// Cycles of the device whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// Errors that the bus controller reported.
    pub bus_errors: u32,
    /// Frames a second on the bus, sent and received; none before a cycle has passed. The share of time that they take
    /// depends on their lengths, which the device does not tell.
    pub bus_frames_per_s: Option<f64>,
    /// Error counter of the transmitter (TEC); none: the device does not tell it.
    pub transmit_error_counter: Option<u8>,
    /// Error counter of the receiver (REC); none: the device does not tell it.
    pub receive_error_counter: Option<u8>,
    /// Who was late; empty: nobody.
    pub late: Vec<&'static str>,
}

impl LineHealth {
    /// Judges the time between two snapshots by its cycles, one message each, and by the times of its answers.
    pub fn between(before: &Snapshot, after: &Snapshot, cycles: &[Telemetry], answers: &[Duration]) -> LineHealth {
        let since = |of: fn(&Statistics) -> u32| of(&after.statistics).wrapping_sub(of(&before.statistics));
        let passed = since(|counters| counters.cycles);
        let frames = since(|counters| counters.frames_sent).saturating_add(since(|counters| counters.frames_received));
        let seconds = f64::from(passed) / RATE;
        let mut sorted: Vec<f64> = answers.iter().map(|took| took.as_secs_f64() * 1e3).collect();
        sorted.sort_by(f64::total_cmp);
        let share = |part: f64| {
            let rank = (part * sorted.len() as f64).ceil() as usize;
            sorted.get(rank.max(1) - 1).copied()
        };
        let mut health = LineHealth {
            cycles: passed,
            success_rate: success(cycles, u32::MAX),
            success_rate_newest_100: success(cycles, NEWEST),
            longest_gap_ms: longest_gap(cycles).map(|gap| f64::from(gap) * 1e3 / RATE),
            answer_p50_ms: share(0.5),
            answer_p99_ms: share(0.99),
            answer_max_ms: share(1.0),
            repeated_requests: after.repeated.wrapping_sub(before.repeated),
            lost_messages: after.gaps.messages.wrapping_sub(before.gaps.messages),
            telemetry_dropped: since(|counters| counters.telemetry_dropped),
            lost_replies: since(|counters| counters.lost_replies),
            late_replies: since(|counters| counters.late_replies),
            missed_deadlines: since(|counters| counters.missed_deadlines),
            bus_errors: since(|counters| counters.bus_errors),
            bus_frames_per_s: (passed > 0).then(|| f64::from(frames) / seconds),
            transmit_error_counter: None,
            receive_error_counter: None,
            late: Vec::new(),
        };
        let timeouts = since(|counters| counters.link_timeouts);
        let LineHealth { lost_messages, repeated_requests, telemetry_dropped, .. } = health;
        health.late = [
            (health.lost_replies + health.late_replies > 0, "the arm's bus: replies missing or late"),
            (health.missed_deadlines > 0, "the device: deadlines missed"),
            (lost_messages + repeated_requests + telemetry_dropped > 0, "the line to the host: messages lost"),
            (timeouts > 0, "the host: it fell silent"),
        ]
        .into_iter()
        .filter_map(|(is_late, who)| is_late.then_some(who))
        .collect();
        health
    }

    /// The most important of it in one line.
    pub fn summary(&self) -> String {
        let rate = self.success_rate_newest_100.map_or("no cycle".to_owned(), |rate| format!("{:.1} %", rate * 100.0));
        let gap = self.longest_gap_ms.map_or(String::new(), |gap| format!(", longest gap {gap:.1} ms"));
        let late = if self.late.is_empty() { "nobody".to_owned() } else { self.late.join("; ") };
        format!("{rate} complete{gap}; late: {late}")
    }

    /// The figures in words, each with its name.
    pub fn rows(&self) -> Vec<(&'static str, String)> {
        let or = |value: Option<String>| value.unwrap_or_else(|| "nothing came".to_owned());
        let percent = |value: Option<f64>| or(value.map(|share| format!("{:.1} %", share * 100.0)));
        let answers = match (self.answer_p50_ms, self.answer_p99_ms, self.answer_max_ms) {
            (Some(half), Some(most), Some(worst)) => format!("{half:.2}, {most:.2}, {worst:.2} ms"),
            _ => "nothing was asked".to_owned(),
        };
        vec![
            ("complete cycles, newest 100", percent(self.success_rate_newest_100)),
            ("complete cycles, all", percent(self.success_rate)),
            ("longest gap", or(self.longest_gap_ms.map(|gap| format!("{gap:.1} ms")))),
            ("answers: half, 99 %, slowest", answers),
            ("messages lost, left out", format!("{}, {}", self.lost_messages, self.telemetry_dropped)),
            ("replies lost, late", format!("{}, {}", self.lost_replies, self.late_replies)),
            ("bus errors", self.bus_errors.to_string()),
            ("bus frames", or(self.bus_frames_per_s.map(|rate| format!("{rate:.0} a second")))),
            ("bus error counters", "not told by the device".to_owned()),
            ("who was late", if self.late.is_empty() { "nobody".to_owned() } else { self.late.join("; ") }),
        ]
    }
}

/// Share of complete cycles among the newest of the span that the cycles cover.
fn success(cycles: &[Telemetry], newest: u32) -> Option<f64> {
    let (first, last) = (cycles.first()?.cycle, cycles.last()?.cycle);
    let span = last.wrapping_sub(first).saturating_add(1).min(newest);
    let good = cycles.iter().filter(|cycle| last.wrapping_sub(cycle.cycle) < span && cycle.lost_replies == 0);
    Some(good.count() as f64 / f64::from(span))
}

/// Longest way from one cycle that came to the next, cycles.
fn longest_gap(cycles: &[Telemetry]) -> Option<u32> {
    cycles.windows(2).map(|pair| pair[1].cycle.wrapping_sub(pair[0].cycle)).max()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn snapshot(statistics: Statistics) -> Snapshot {
        Snapshot { statistics, gaps: Gaps::default(), repeated: 0 }
    }

    fn cycle(number: u32, lost_replies: u8) -> Telemetry {
        Telemetry { cycle: number, lost_replies, ..Telemetry::default() }
    }

    #[test]
    fn cli_12_the_rate_counts_cycles_that_did_not_come_and_cycles_without_a_reply() {
        // 150 cycles across the wrap; 20 of the newest 100 did not come, one came incomplete.
        let numbers = (0..150u32).filter(|number| !(60..80).contains(number));
        let cycles: Vec<Telemetry> =
            numbers.map(|number| cycle(number.wrapping_sub(50), u8::from(number == 149))).collect();
        let before = snapshot(Statistics { cycles: u32::MAX, ..Statistics::default() });
        let after =
            snapshot(Statistics { cycles: 299, frames_sent: 1000, frames_received: 500, ..Statistics::default() });
        let answers: Vec<Duration> = (1..=200).map(Duration::from_millis).collect();
        let health = LineHealth::between(&before, &after, &cycles, &answers);
        assert_eq!(health.success_rate_newest_100, Some(0.79));
        assert!((health.success_rate.unwrap() - 129.0 / 150.0).abs() < 1e-12);
        assert!((health.longest_gap_ms.unwrap() - 21.0 * 1e3 / RATE).abs() < 1e-9);
        let answers = (health.answer_p50_ms, health.answer_p99_ms, health.answer_max_ms);
        assert_eq!(answers, (Some(100.0), Some(198.0), Some(200.0)));
        // 1500 frames in 300 cycles.
        assert_eq!(health.bus_frames_per_s, Some(5.0 * RATE));
    }

    #[test]
    fn cli_12_whoever_was_late_is_named_and_nobody_else() {
        let none = snapshot(Statistics::default());
        let late = |after: Snapshot| LineHealth::between(&none, &after, &[], &[]).late;
        assert!(late(none).is_empty());
        let zero = Statistics::default();
        let mut gaps = Gaps::default();
        gaps.messages = 1;
        for (after, who) in [
            (snapshot(Statistics { lost_replies: 1, ..zero }), "the arm's bus"),
            (snapshot(Statistics { late_replies: 1, ..zero }), "the arm's bus"),
            (snapshot(Statistics { missed_deadlines: 1, ..zero }), "the device"),
            (snapshot(Statistics { telemetry_dropped: 1, ..zero }), "the line"),
            (snapshot(Statistics { link_timeouts: 1, ..zero }), "the host"),
            (Snapshot { repeated: 1, ..none }, "the line"),
            (Snapshot { gaps, ..none }, "the line"),
        ] {
            let late = late(after);
            assert!(late.len() == 1 && late[0].starts_with(who), "{who}: {late:?}");
        }
    }
}
