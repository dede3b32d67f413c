//! The state of a device that is watched: the newest of everything it told.

mod line;
mod screen;
mod terminal;

use std::collections::VecDeque;

use control::{Fault, State, flags};
use device::{HandFailure, Stage};
use dmp::CanonicalSystem;
use lab::client::Gaps;
use lab::error::explain_blocked;
use lab::primitive_file::HostPrimitive;
use lab::procedure::CHANNELS;
use link::{DeviceHello, Event, EventKind, HandStage, Statistics, Status, Telemetry};

pub use line::{Line, Streamed};
pub use screen::draw;
pub use terminal::{Screen, Wish};

/// Events that are kept.
const EVENTS: usize = 20;

/// The newest of everything a device told.
#[derive(Default)]
pub struct Watch {
    /// Who the device is.
    pub hello: DeviceHello,
    /// Its state, asked for now and then.
    pub status: Status,
    /// Its counters, asked for now and then.
    pub statistics: Statistics,
    /// The newest cycle, once one has come.
    pub telemetry: Option<Telemetry>,
    /// Cycles and messages that did not arrive.
    pub gaps: Gaps,
    /// The primitive that is expected to run, where the forces that it expects are known.
    pub primitive: Option<HostPrimitive>,
    /// Decay of its phase; the usual one where it is not known.
    pub alpha: Option<f64>,
    /// Events in words, oldest first.
    pub events: VecDeque<String>,
}

impl Watch {
    /// Takes a new cycle.
    pub fn cycle(&mut self, telemetry: Telemetry) {
        self.telemetry = Some(telemetry);
    }

    /// Takes the answer to the question for the state. Before the start-up of an arm has come so far no control cycle
    /// runs: one of before tells nothing of the arm as it is.
    pub fn answer(&mut self, status: Status) {
        let stage = Stage::from_code(status.startup_stage);
        if self.hello.capabilities.arm && !matches!(stage, Some(Stage::WaitingForActive | Stage::Ready)) {
            self.telemetry = None;
        }
        self.status = status;
    }

    /// Takes an event; in words.
    pub fn event(&mut self, event: &Event) -> &str {
        self.note(event.cycle, &words(event))
    }

    /// Keeps what has happened in this cycle; in words.
    pub(crate) fn note(&mut self, cycle: u32, what: &str) -> &str {
        if self.events.len() == EVENTS {
            self.events.pop_front();
        }
        self.events.push_back(format!("cycle {cycle}: {what}"));
        self.events.back().map_or("", String::as_str)
    }

    /// The state of the arm; the newest cycle knows it better than the last answer.
    pub fn state(&self) -> &'static str {
        let code = self.telemetry.map_or(self.status.state, |telemetry| telemetry.state);
        State::from_code(code).map_or("unknown", State::name)
    }

    /// The latched fault.
    pub fn fault(&self) -> Option<Fault> {
        let code = self.telemetry.map_or(self.status.fault, |telemetry| telemetry.fault);
        Fault::from_code(code).filter(|fault| *fault != Fault::None)
    }

    /// The reason for the present state: the fault, the start-up, or nothing.
    pub fn cause(&self) -> String {
        let stage = Stage::from_code(self.status.startup_stage);
        match (self.fault(), self.status.blocked, stage) {
            (Some(fault), ..) => format!("{fault:?}: {fault}"),
            (None, Some(numbers), _) => format!("start-up: {}", explain_blocked(numbers)),
            (None, None, Some(stage)) if stage != Stage::Ready => format!("start-up: {stage}"),
            _ => String::new(),
        }
    }

    /// Progress of the movement, 0 to 1; `None` outside a run.
    pub fn progress(&self) -> Option<f64> {
        let telemetry = self.telemetry.filter(|telemetry| {
            matches!(State::from_code(telemetry.state), Some(State::Run | State::Coast)) && telemetry.phase > 0.0
        })?;
        let alpha = self.alpha.unwrap_or(CanonicalSystem::<f64>::DEFAULT_ALPHA);
        Some((-f64::from(telemetry.phase).ln() / alpha).clamp(0.0, 1.0))
    }

    /// The wrench that the primitive expects now, N and N m.
    pub fn expected(&self) -> Option<[f64; 6]> {
        let values = self.primitive.as_ref()?.expected()?.at(self.progress()?);
        values.first_chunk().copied()
    }

    /// The newest cycle, if every joint angle has been measured: before, it carries zeros in their place.
    pub(crate) fn placed(&self) -> Option<&Telemetry> {
        self.telemetry.as_ref().filter(|cycle| cycle.flags & flags::POSITIONS_KNOWN != 0)
    }

    /// The newest cycle, if it has a wrench: without a sensor it carries zeros in its place.
    pub(crate) fn weighed(&self) -> Option<&Telemetry> {
        self.placed().filter(|cycle| cycle.flags & (flags::TARED | flags::WRENCH_STALE) != flags::WRENCH_STALE)
    }

    /// The adaptation in a few words.
    pub fn adaptation(&self) -> &'static str {
        let bits = self.telemetry.map_or(0, |telemetry| telemetry.flags);
        let has = |mask: u32| bits & mask != 0;
        match () {
            () if !has(flags::FEEDBACK) => "off",
            () if has(flags::CLAMPED) => "at its limits",
            () if has(flags::FEEDBACK_FADED) => "derated",
            () => "on",
        }
    }

    /// Duration of the newest control computation and of the longest, us.
    pub fn computation_us(&self) -> (f64, f64) {
        let us = |ticks: u32| f64::from(ticks) * 1e6 / f64::from(self.hello.ticks_per_second.max(1));
        (us(self.telemetry.map_or(0, |telemetry| telemetry.cost_ticks)), us(self.statistics.cost_worst_ticks))
    }

    /// All of it as one object; what is not known is null.
    pub fn line(&self) -> Line {
        let telemetry = self.telemetry.as_ref();
        let (now, worst) = self.computation_us();
        let hand = (self.status.hand_stage == HandStage::Ready).then_some(telemetry).flatten();
        let (placed, weighed) = (self.placed(), self.weighed());
        Line {
            state: self.state(),
            fault: self.fault().map(|fault| format!("{fault:?}")),
            cause: self.cause(),
            loaded: self.status.loaded.as_ref().map(|name| name.as_str().to_owned()),
            progress: self.progress(),
            cycle: telemetry.map(|cycle| cycle.cycle),
            phase: telemetry.map(|cycle| cycle.phase),
            q_rad: placed.map(|cycle| cycle.q),
            dq_rad_s: placed.map(|cycle| cycle.dq),
            tau_nm: telemetry.map(|cycle| cycle.tau),
            wrench_n_nm: weighed.map(|cycle| cycle.wrench),
            expected_n_nm: self.expected(),
            hand_rad: hand.map(|cycle| cycle.hand),
            hand_d_rad: hand.map(|cycle| cycle.hand_d),
            gauges_nm: hand.map(|cycle| cycle.gauges),
            adaptation: self.adaptation(),
            surprise: telemetry.map(|cycle| cycle.surprise),
            computation_us: telemetry.map(|_| now),
            worst_computation_us: worst,
            missed_deadlines: self.statistics.missed_deadlines,
            lost_replies: self.statistics.lost_replies,
            bus_errors: self.statistics.bus_errors,
            bus_restarts: self.statistics.bus_restarts,
            telemetry_lost: self.gaps.telemetry,
            telemetry_dropped: self.statistics.telemetry_dropped,
        }
    }
}

/// An event in a few words.
fn words(event: &Event) -> String {
    let code = u8::try_from(event.code).unwrap_or(u8::MAX);
    match event.kind {
        EventKind::State => {
            let state = State::from_code(code).map_or("unknown state", State::name);
            let fault =
                u8::try_from(event.detail).ok().and_then(Fault::from_code).filter(|fault| *fault != Fault::None);
            fault.map_or_else(|| state.to_owned(), |fault| format!("{state}: {fault}"))
        }
        EventKind::Arrived => "the movement has ended".to_owned(),
        EventKind::Startup => {
            Stage::from_code(code).map_or_else(|| "start-up".to_owned(), |stage| format!("start-up: {stage}"))
        }
        EventKind::SafetyMode if event.detail != 0 => {
            "safety module: idle, as the device asked for it: brakes alone hold the arm".to_owned()
        }
        EventKind::SafetyMode => format!(
            "safety module: {}",
            ["emergency stop", "idle", "active"].get(usize::from(code)).unwrap_or(&"unknown")
        ),
        EventKind::LinkTimeout => format!("the host was silent for {} ms: stopped", event.detail),
        EventKind::Store => format!("place {code} of the library changed"),
        EventKind::CommandRefused => "a command was refused".to_owned(),
        EventKind::Blocked => format!("start-up: {}", explain_blocked([event.code.into(), event.detail])),
        EventKind::Surprise => {
            let channel = CHANNELS.get(usize::from(event.code)).unwrap_or(&"a channel");
            format!("not as the successful runs: {channel}, {:.0} % on the way", f64::from(event.detail) / 10.0)
        }
        EventKind::Hand => {
            let stage = HandStage::from_code(code).map_or("unknown", HandStage::name);
            HandFailure::from_number(event.detail).map_or_else(
                || format!("hand: {stage}"),
                |(node, failure)| format!("hand: {stage}: its puck {} {failure}", node.number()),
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(kind: EventKind, code: u16, detail: u32) -> String {
        words(&Event { cycle: 0, kind, code, detail })
    }

    #[test]
    fn an_activation_that_the_device_took_back_is_told_as_its_own_wish_and_a_lost_hand_with_its_puck() {
        assert_eq!(told(EventKind::SafetyMode, 1, 0), "safety module: idle");
        assert!(told(EventKind::SafetyMode, 1, 1).contains("the device asked for it"));
        assert_eq!(told(EventKind::Hand, 3, 0), "hand: ready");
        let missing = HandFailure::Missing.number(puck::Node::SPREAD);
        assert_eq!(told(EventKind::Hand, 0, missing), "hand: absent: its puck 14 does not answer");
    }
}
