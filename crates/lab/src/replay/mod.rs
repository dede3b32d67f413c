//! A log played to the device's application: what the pucks and the host said is said again, and what the device then
//! says is compared with what it said in the log.
//!
//! The application is the real one, `device::DeviceController` and `device::Session`. It begins at power-up, so the
//! log must too. Orders of a person come from the host; a log that holds the host's bus as well as the arm's holds
//! them all.

mod clock;
mod engine;

use std::collections::{BTreeMap, VecDeque};

use link::Telemetry;
use link::can::{DeviceNumber, Direction, Heading, Reassembler};
use link::frame::{self, FRAME_BYTES};
use puck::{CanFrame, Group, Node, PropertyId, get};
use serde::Serialize;
use sim::Ticks;

use canlog::{AnyFrame, LogLine};
use canlog::{BusKind, Reader};

use crate::simulation::SLOT_TICKS;
use canlog::{HostLink, Message};
use clock::LogClock;
use engine::Engine;

/// A frame of the log for which the device has nothing to show after so many slots was not sent by it.
const SEND_TIMEOUT_SLOTS: Ticks = 6;

/// A frame of the device that the log has not so many slots later, 1 s, was not on the bus.
const MISSING_SLOTS: Ticks = 900;

/// Frames that are looked through for the one in the log before the rest counts as different.
const LOOK_AHEAD: usize = 16;

/// Differences that are kept; of more only the number.
const KEPT: usize = 16;

/// Difference of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum DifferenceKind {
    /// The device sent another one instead.
    Other,
    /// The device did not send it.
    NotSent,
    /// The device sent it and the log has it not.
    NotInLog,
}

/// A frame of the device that is not as in the log.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Difference {
    /// How.
    pub kind: DifferenceKind,
    /// Time in the log, s.
    pub time_s: f64,
    /// Line of the log, 0 for a frame that it has not.
    pub line: u64,
    /// Control cycle of the device.
    pub cycle: u64,
    /// The log's frame, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub logged: Option<String>,
    /// The device's frame, in words.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sent: Option<String>,
}

/// Result of a replay.
#[derive(Debug, Clone, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Outcome {
    /// Time of the log, s.
    pub seconds: f64,
    /// Slots of the device.
    pub slots: u64,
    /// Its control cycles.
    pub cycles: u64,
    /// Frames of pucks, sensor and hand that it was given.
    pub given: u64,
    /// Frames of the device in the log.
    pub logged: u64,
    /// Frames of the device that were the same.
    pub same: u64,
    /// Requests of the host that it was given.
    pub requests: u64,
    /// Telemetry of cycles that both told, and how many of those were the same; how long computing took is left out.
    pub telemetry: (u64, u64),
    /// True if the log holds the host's bus.
    pub has_host: bool,
    /// Number of frames that differ.
    pub different: u64,
    /// The first of them.
    pub differences: Vec<Difference>,
}

/// Why a log cannot be replayed.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum ReplayError {
    /// No frame of a co-controller is in it.
    #[error("the log holds no frame that a co-controller has sent")]
    NoDevice,
    /// It begins in the middle.
    #[error(
        "the log begins in the middle: a co-controller that starts sends zero torques and MODE IDLE first, and not `{frame}`"
    )]
    Middle {
        /// The frame in their place, in words.
        frame: String,
    },
    /// Its times leap: a damaged line, or two logs in one.
    #[error("line {line}: time leaps from {from:.6} s to {to:.6} s", from = *from_us as f64 * 1e-6, to = *to_us as f64 * 1e-6)]
    Leap {
        /// The line.
        line: u64,
        /// Latest time before it, us.
        from_us: u64,
        /// Its time, us.
        to_us: u64,
    },
}

/// Longest silence in a log, us: a device asks its bus something all the time, and its slots in between are computed.
const LONGEST_SILENCE_US: u64 = 60_000_000;

/// Farthest that a line may lie before the latest one, us.
const LONGEST_STEP_BACK_US: u64 = 1_000_000;

/// A frame of the device in the log, to be matched.
struct Logged {
    at: Ticks,
    time_us: u64,
    line: u64,
    frame: CanFrame,
    words: String,
}

/// Plays a log, line after line.
pub struct Replay {
    reader: Reader,
    host: HostLink,
    /// The stream of the host to device 0, for the session to read.
    to_device: Reassembler,
    engine: Engine,
    clock: Option<LogClock>,
    /// Lines and their places until the device has sent the frames it begins with: only then is the clock known.
    early: Vec<(u64, LogLine)>,
    /// The first frame of the device and its time in the log.
    first: Option<(CanFrame, u64)>,
    /// Number seen of the frames with which a device begins.
    begun: usize,
    line: u64,
    first_us: Option<u64>,
    last_us: u64,
    logged: VecDeque<Logged>,
    sent: VecDeque<(Ticks, CanFrame)>,
    /// Bytes that the device has handed over, less those that the log shows on the host's bus.
    backlog: usize,
    told: frame::Decoder<FRAME_BYTES>,
    telemetry: BTreeMap<u32, Telemetry>,
    outcome: Outcome,
}

impl Default for Replay {
    fn default() -> Self {
        Self {
            reader: Reader::default(),
            host: HostLink::default(),
            to_device: Reassembler::new(Direction::ToDevice, DeviceNumber::FIRST),
            engine: Engine::new(),
            clock: None,
            early: Vec::new(),
            first: None,
            begun: 0,
            line: 0,
            first_us: None,
            last_us: 0,
            logged: VecDeque::new(),
            sent: VecDeque::new(),
            backlog: 0,
            told: frame::Decoder::new(),
            telemetry: BTreeMap::new(),
            outcome: Outcome::default(),
        }
    }
}

impl Replay {
    /// Takes the next line of the log. `number`: its place in the file.
    ///
    /// # Errors
    /// [`ReplayError::Leap`]; [`ReplayError::Middle`] when the first frames of the device show that the log begins too
    /// late.
    pub fn take(&mut self, number: u64, line: LogLine) -> Result<(), ReplayError> {
        self.line = number;
        let from_us = self.first_us.map_or(line.time_us, |_| self.last_us);
        if line.time_us.saturating_sub(from_us) > LONGEST_SILENCE_US {
            return Err(ReplayError::Leap { line: number, from_us, to_us: line.time_us });
        }
        // Frames of two buses may change places, not stories: a second log in the same file begins at an earlier time.
        if from_us.saturating_sub(line.time_us) > LONGEST_STEP_BACK_US {
            return Err(ReplayError::Leap { line: number, from_us, to_us: line.time_us });
        }
        self.first_us.get_or_insert(line.time_us);
        self.last_us = self.last_us.max(line.time_us);
        if self.clock.is_none() {
            return self.begin(line);
        }
        self.play(&line);
        Ok(())
    }

    /// Waits for the frames with which a device begins. All of them: a log may also begin at a zero torque of an idle
    /// arm.
    fn begin(&mut self, line: LogLine) -> Result<(), ReplayError> {
        let AnyFrame::Data(frame) = line.frame else {
            return Ok(());
        };
        let (meaning, interface) = self.reader.read(&line);
        let is_of_device = interface.kind() == BusKind::Arm && frame.can_id().sender() == Node::HOST;
        let begins_with = puck::stop_frames();
        if is_of_device {
            if begins_with.get(self.begun) != Some(&frame) {
                return Err(ReplayError::Middle { frame: meaning.sentence() });
            }
            self.first.get_or_insert((frame, line.time_us));
            self.begun += 1;
        }
        self.early.push((self.line, line));
        if let Some((first, time_us)) = self.first.filter(|_| self.begun == begins_with.len()) {
            self.clock = Some(LogClock::from_first_frame(&first, time_us));
            self.reader = Reader::default();
            for (number, early) in std::mem::take(&mut self.early) {
                self.line = number;
                self.play(&early);
            }
        }
        Ok(())
    }

    fn play(&mut self, line: &LogLine) {
        let (Some(clock), AnyFrame::Data(frame)) = (self.clock, &line.frame) else {
            return;
        };
        let at = clock.device_time(line.time_us);
        // What arrives at the very moment of a slot comes after it.
        while self.engine.next_slot() <= at {
            self.slot();
        }
        let (meaning, interface) = self.reader.read(line);
        match interface.kind() {
            BusKind::Host => self.host_frame(frame),
            BusKind::Arm if frame.can_id().sender() == Node::HOST => {
                self.outcome.logged += 1;
                let words = format!("{} > {}: {}", meaning.from, meaning.to, meaning.sentence());
                self.logged.push_back(Logged { at, time_us: line.time_us, line: self.line, frame: *frame, words });
                self.compare();
            }
            BusKind::Arm => {
                self.outcome.given += 1;
                self.engine.receive(*frame);
            }
        }
    }

    /// A segment on the host's bus: what the host said is said again, what the device said is compared.
    fn host_frame(&mut self, frame: &CanFrame) {
        self.outcome.has_host = true;
        let id = frame.can_id().raw();
        if Heading::parse(id).is_some_and(|heading| heading.direction == Direction::ToDevice) {
            let bytes = self.to_device.take(id, frame.payload());
            self.engine.hear(&bytes);
        } else {
            self.backlog = self.backlog.saturating_sub(frame.payload().len());
        }
        let Some((_, messages)) = self.host.take(frame) else {
            return;
        };
        for message in messages {
            match message {
                Message::Request(_) => self.outcome.requests += 1,
                Message::Reply(link::Reply::Telemetry(logged)) => {
                    if let Some(told) = self.telemetry.remove(&logged.cycle) {
                        self.outcome.telemetry.0 += 1;
                        let same = Telemetry { cost_ticks: logged.cost_ticks, ..told } == logged;
                        self.outcome.telemetry.1 += u64::from(same);
                    }
                }
                Message::Reply(_) => {}
            }
        }
    }

    /// One slot of the device.
    fn slot(&mut self) {
        let at = self.engine.next_slot();
        let (frames, bytes) = self.engine.run_slot(self.backlog);
        self.sent.extend(frames.into_iter().map(|frame| (at, frame)));
        self.backlog += bytes.len();
        let mut rest = bytes.as_slice();
        while let Some(frame) = self.told.next::<link::Reply>(&mut rest) {
            if let link::Reply::Telemetry(telemetry) = frame.message {
                self.telemetry.insert(telemetry.cycle, telemetry);
            }
        }
        self.compare();
        // What the log says and the device does not.
        while let Some(logged) = self.logged.pop_front_if(|logged| logged.at + SEND_TIMEOUT_SLOTS * SLOT_TICKS < at) {
            self.differ(DifferenceKind::NotSent, Some(&logged), None);
        }
        // What the device says and the log does not.
        while let Some(sent) = self.sent.pop_front_if(|(slot, _)| *slot + MISSING_SLOTS * SLOT_TICKS < at) {
            self.differ(DifferenceKind::NotInLog, None, Some(sent));
        }
        // Without a host's bus nobody takes the bytes away.
        if !self.outcome.has_host {
            self.backlog = 0;
        }
    }

    /// Matches what both have.
    fn compare(&mut self) {
        while let (Some(logged), Some((slot, sent))) = (self.logged.front(), self.sent.front()) {
            if logged.frame == *sent {
                self.outcome.same += 1;
                if *sent == get(Group::ARM, PropertyId::POSITION)
                    && let Some(clock) = &mut self.clock
                {
                    clock.follow(sent, logged.time_us, *slot);
                }
            } else if logged.frame.can_id() == sent.can_id() && logged.frame.payload().first() == sent.payload().first()
            {
                // The same kind of frame with other contents.
                let (Some(logged), Some(sent)) = (self.logged.pop_front(), self.sent.pop_front()) else {
                    return;
                };
                self.differ(DifferenceKind::Other, Some(&logged), Some(sent));
                continue;
            } else if let Some(place) = self.sent.iter().take(LOOK_AHEAD).position(|(_, sent)| *sent == logged.frame) {
                let extra: Vec<_> = self.sent.drain(..place).collect();
                for sent in extra {
                    self.differ(DifferenceKind::NotInLog, None, Some(sent));
                }
                continue;
            } else {
                let Some(logged) = self.logged.pop_front() else {
                    return;
                };
                self.differ(DifferenceKind::NotSent, Some(&logged), None);
                continue;
            }
            self.logged.pop_front();
            self.sent.pop_front();
        }
    }

    fn differ(&mut self, kind: DifferenceKind, logged: Option<&Logged>, sent: Option<(Ticks, CanFrame)>) {
        self.outcome.different += 1;
        if self.outcome.differences.len() >= KEPT {
            return;
        }
        let slot_us = sent.zip(self.clock).map(|((slot, _), clock)| clock.log_time(slot));
        let time_us = logged.map(|logged| logged.time_us).or(slot_us).unwrap_or(self.last_us);
        let sent = sent.map(|(_, frame)| self.words(frame));
        self.outcome.differences.push(Difference {
            kind,
            time_s: time_us.saturating_sub(self.first_us.unwrap_or(0)) as f64 * 1e-6,
            line: logged.map_or(0, |logged| logged.line),
            cycle: self.engine.cycles(),
            logged: logged.map(|logged| logged.words.clone()),
            sent,
        });
    }

    /// A frame of the device in words, read with what the log has told of the pucks.
    fn words(&self, frame: CanFrame) -> String {
        let arm = self.reader.interfaces().iter().find(|interface| interface.kind() == BusKind::Arm);
        let mut decoder = arm.map(|interface| interface.decoder.clone()).unwrap_or_default();
        let meaning = decoder.read(&AnyFrame::Data(frame));
        format!("{} > {}: {}", meaning.from, meaning.to, meaning.sentence())
    }

    /// The log has ended.
    ///
    /// # Errors
    /// [`ReplayError::NoDevice`]
    pub fn finish(mut self) -> Result<Outcome, ReplayError> {
        if self.clock.is_none() {
            return Err(ReplayError::NoDevice);
        }
        // What the device sent last may have been on its way when the log ended; what the log has must have been sent.
        let end = self.engine.next_slot();
        for sent in std::mem::take(&mut self.sent) {
            if sent.0 + SEND_TIMEOUT_SLOTS * SLOT_TICKS < end {
                self.differ(DifferenceKind::NotInLog, None, Some(sent));
            }
        }
        for logged in std::mem::take(&mut self.logged) {
            self.differ(DifferenceKind::NotSent, Some(&logged), None);
        }
        let seconds = self.last_us.saturating_sub(self.first_us.unwrap_or(0)) as f64 * 1e-6;
        Ok(Outcome { seconds, slots: self.engine.slots(), cycles: self.engine.cycles(), ..self.outcome })
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;
    use crate::simulation::{Engine, Simulation, SimulationOptions, WorldKind};

    /// The arm's bus during the start-up of a simulated device.
    fn start_up() -> Vec<LogLine> {
        let mut simulation =
            Simulation::start(&SimulationOptions::new(Engine::InProcess, 1, WorldKind::Simple)).unwrap();
        simulation.keep_traffic();
        simulation.advance_until(Duration::from_secs(4), |_| false).unwrap();
        let lines = simulation.take_traffic().into_iter().map(|passage| LogLine {
            time_us: passage.end / sim::TICKS_PER_MICROSECOND,
            interface: canlog::ARM_INTERFACE.into(),
            frame: AnyFrame::Data(passage.frame),
        });
        lines.collect()
    }

    fn replayed(lines: Vec<LogLine>) -> Outcome {
        let mut replay = Replay::default();
        for (number, line) in (1..).zip(lines) {
            replay.take(number, line).unwrap();
        }
        replay.finish().unwrap()
    }

    /// A co-controller that fell silent in the log was played to one that speaks, and nothing differed.
    ///
    /// The change that makes it fail: frames that the log has not are looked for before the next one that it has.
    #[test]
    fn what_the_device_says_behind_the_last_frame_of_the_log_is_a_difference() {
        let lines = start_up();
        assert_eq!(replayed(lines.clone()).different, 0);
        let of_device =
            |line: &LogLine| matches!(&line.frame, AnyFrame::Data(frame) if frame.can_id().sender() == Node::HOST);
        for silent_from in [1_000_000, 3_000_000] {
            let silenced: Vec<LogLine> =
                lines.iter().filter(|line| line.time_us < silent_from || !of_device(line)).cloned().collect();
            let left_out = (lines.len() - silenced.len()) as u64;
            let outcome = replayed(silenced);
            assert!(outcome.different > 3 && outcome.different + 3 >= left_out, "{left_out}: {outcome:?}");
            let first = &outcome.differences[0];
            assert_eq!(first.kind, DifferenceKind::NotInLog);
            let late = first.time_s - silent_from as f64 * 1e-6;
            assert!((-0.2..0.5).contains(&late), "{first:?}");
        }
    }

    /// Frames that a fault had lost or changed stood in the log, and the device of the replay received them.
    ///
    /// The change that makes it fail: the log of a simulation has frames of pucks as they were sent.
    #[test]
    fn the_log_of_a_start_up_with_faults_replays_and_has_what_was_received() {
        let folder = tempfile::tempdir().unwrap();
        let (script, log) = (folder.path().join("faults.toml"), folder.path().join("bus.log"));
        let lost = "{ at = 0.3, what.drop = { kind = \"property\", from = [4], most = 3 } }";
        let changed = "{ at = 0.6, what.flip = { kind = \"property\", from = [10], most = 2 } }";
        let text = format!("[[scenario]]\nname = \"a\"\nfrom = \"power-up\"\ninject = [{lost}, {changed}]\n");
        std::fs::write(&script, text).unwrap();
        let mut simulation = Simulation::start(&SimulationOptions {
            faults: Some(script.to_str().unwrap().to_owned()),
            bus_log: Some(log.clone()),
            ..SimulationOptions::new(Engine::InProcess, 1, WorldKind::Simple)
        })
        .unwrap();
        simulation.advance_until(Duration::from_secs(4), |_| false).unwrap();
        simulation.log_buses(&[]).unwrap();
        let lines: Vec<LogLine> =
            std::fs::read_to_string(&log).unwrap().lines().map(|line| line.parse().unwrap()).collect();
        assert!(lines.len() > 300);
        let outcome = replayed(lines);
        assert_eq!(outcome.different, 0, "{outcome:?}");
    }
}
