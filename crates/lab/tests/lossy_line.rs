//! Procedures on a line that loses what the device says once, and beside others who stop the arm.

use std::path::Path;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use device::Stage;
use lab::client::Client;
use lab::demonstration::Recording;
use lab::device::Device;
use lab::learn::{LearnOptions, learn};
use lab::procedure::{self, ProcedureError, RunRequest};
use lab::simulation::{Engine, Simulation, SimulationOptions, WorldKind};
use lab::transport::{Transport, TransportError};
use link::frame::{Decoder, Envelope, FRAME_BYTES, Frame, encode};
use link::{Event, EventKind, HandStage, Name, Reply, Request, RunOptions};
use sim::{PendantAction, TICKS_PER_SECOND};

use crate::common;

/// The session of somebody else, who only stops.
const OTHERS: u16 = 7;

/// A line to a simulated arm that its host takes for a real one.
struct Line {
    simulation: Simulation,
    requests: Decoder<FRAME_BYTES>,
    replies: Decoder<FRAME_BYTES>,
    /// No `Arrived` comes through.
    loses_arrivals: bool,
    /// No cycle comes through whose number can be divided by five.
    loses_cycles: bool,
    /// Somebody else stops the arm once its hand is seen to be initialised.
    stops_hand: bool,
    /// Zeroings that the host asked for.
    zeroings: Arc<AtomicU32>,
    /// Stops that it asked for.
    stops: Arc<AtomicU32>,
}

impl Line {
    fn new(adjust: impl FnOnce(&mut SimulationOptions)) -> Self {
        let mut options = SimulationOptions::new(Engine::InProcess, 1, WorldKind::Simple);
        adjust(&mut options);
        Self {
            simulation: Simulation::start(&options).unwrap(),
            requests: Decoder::new(),
            replies: Decoder::new(),
            loses_arrivals: false,
            loses_cycles: false,
            stops_hand: false,
            zeroings: Arc::default(),
            stops: Arc::default(),
        }
    }

    fn connected(self) -> Client<Device> {
        Client::connect(Device::Own(Box::new(self)), "test").unwrap()
    }

    /// The part of a message of the device that comes through.
    fn passed(&mut self, envelope: Envelope, mut message: Reply) -> Option<Reply> {
        match &mut message {
            Reply::Event(Event { kind: EventKind::Arrived, .. }) if self.loses_arrivals => return None,
            Reply::Telemetry(cycle) if self.loses_cycles && cycle.cycle.is_multiple_of(5) => return None,
            Reply::Hello { hello, .. } => hello.simulated = false,
            Reply::Status { status, .. } if self.stops_hand && status.hand_stage == HandStage::Initialising => {
                self.stops_hand = false;
                let stop = Envelope { session: OTHERS, sequence: 1, time_ms: envelope.time_ms };
                self.simulation.send(&bytes(stop, &Request::Stop)).unwrap();
            }
            _ => {}
        }
        (envelope.session != OTHERS).then_some(message)
    }
}

fn bytes<M: link::frame::Message>(envelope: Envelope, message: &M) -> Vec<u8> {
    let mut buffer = [0; FRAME_BYTES];
    let length = encode(envelope, message, &mut buffer).unwrap();
    buffer[..length].to_vec()
}

impl Transport for Line {
    fn send(&mut self, bytes: &[u8]) -> Result<(), TransportError> {
        let mut rest = bytes;
        while let Some(frame) = self.requests.next::<Request>(&mut rest) {
            self.zeroings.fetch_add(u32::from(matches!(frame.message, Request::Zero { .. })), Ordering::Relaxed);
            self.stops.fetch_add(u32::from(frame.message == Request::Stop), Ordering::Relaxed);
        }
        self.simulation.send(bytes)
    }

    fn receive(&mut self, timeout: Duration, out: &mut Vec<u8>) -> Result<(), TransportError> {
        let mut heard = Vec::new();
        self.simulation.receive(timeout, &mut heard)?;
        let mut rest = &heard[..];
        while let Some(Frame { envelope, message }) = self.replies.next::<Reply>(&mut rest) {
            if let Some(message) = self.passed(envelope, message) {
                out.extend(bytes(envelope, &message));
            }
        }
        Ok(())
    }

    fn now(&self) -> Duration {
        self.simulation.now()
    }
}

/// An arm that is ready, on a line that loses every arrival.
fn ready_arm() -> Client<Device> {
    let mut client = Line { loses_arrivals: true, ..Line::new(|_| {}) }.connected();
    procedure::start_up(&mut client, true, Stage::Ready, |_| {}).unwrap();
    client
}

/// The change that makes it fail: a motion has arrived only where that is told.
#[test]
fn a_motion_whose_arrival_is_lost_on_the_line_ends_all_the_same() {
    let mut client = ready_arm();
    let posture = common::START.map(|angle| angle as f32);
    procedure::travel(&mut client, posture, |_| {}).unwrap();
    let passed = procedure::slide_postures(&mut client, &[posture], &[3.0], |_| {}).unwrap();
    assert!(!passed[0].up.is_empty() && !passed[0].down.is_empty());
}

/// Seen: the one event that tells of the end of a motion was lost. The command ended well, and its farewell stopped the
/// arm that was to hold its place.
///
/// The change that makes it fail: to the client a motion goes on until an event tells of its end, whatever the status
/// (first) or the cycles (second) say.
#[test]
fn an_arm_whose_arrival_is_lost_on_the_line_is_not_stopped_when_its_program_ends() {
    let posture = common::START.map(|angle| angle as f32);
    for by_cycles in [false, true] {
        let stops = Arc::new(AtomicU32::new(0));
        let mut client = Line { loses_arrivals: true, stops: stops.clone(), ..Line::new(|_| {}) }.connected();
        procedure::start_up(&mut client, true, Stage::Ready, |_| {}).unwrap();
        if by_cycles {
            procedure::slide_postures(&mut client, &[posture], &[3.0], |_| {}).map(drop).unwrap();
        } else {
            procedure::travel(&mut client, posture, |_| {}).unwrap();
        }
        drop(client);
        assert_eq!(stops.load(Ordering::Relaxed), 0, "by cycles: {by_cycles}");
    }
}

/// The change that makes it fail: a run has arrived only where that is told.
#[test]
fn a_run_whose_arrival_is_lost_on_the_line_ends_all_the_same() {
    let text = common::text(&common::rows(3.0));
    let recording = Recording::parse(Path::new("demo.csv"), text.as_bytes()).unwrap();
    let learned = learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive;
    let mut client = ready_arm();
    client.upload(&learned.to_image().unwrap(), |_, _, _| {}).unwrap();
    procedure::go_to_start(&mut client, &learned.start, |_| {}).unwrap();
    let request = RunRequest::new(Name::new("reach").unwrap(), learned.movement.duration, RunOptions::default());
    let mut last = 0;
    let outcome = procedure::play(&mut client, &request, &mut |cycle| last = cycle.state).unwrap();
    let taught = learned.movement.duration;
    assert!((taught..taught + 2.0).contains(&outcome.arrived_s), "{} s of {taught} s", outcome.arrived_s);
    assert_eq!(control::State::from_code(last), Some(control::State::Hold));
}

/// Seen: where a fifth of the cycles was lost on the line, a demonstration of 2 s was recorded for 2.5 s, and `teach`
/// said that it was 2 s long.
///
/// The change that makes it fail: the time of a recording is the number of its samples.
#[test]
fn a_demonstration_is_as_long_as_was_asked_for_where_cycles_are_lost_on_the_line() {
    let mut client = Line { loses_cycles: true, ..Line::new(|_| {}) }.connected();
    procedure::start_up(&mut client, true, Stage::Ready, |_| {}).unwrap();
    client.gravity().unwrap();
    let recorder = procedure::Recorder::start(&mut client, Vec::new(), "").unwrap();
    let begun = client.now();
    let shown = procedure::record_demonstration(&mut client, recorder, 2.0, 0.0, |_, _| false).unwrap();
    let took = (client.now() - begun).as_secs_f64();
    assert!((1.95..2.1).contains(&took) && (1.95..2.1).contains(&shown.seconds), "{took} s, {} s", shown.seconds);
    assert!((450..500).contains(&shown.samples), "{}", shown.samples);
    client.hold().unwrap();
}

/// The change that makes it fail: a hand that is not initialised any more is waited for.
#[test]
fn a_hand_whose_initialisation_somebody_else_stops_is_told_at_once() {
    let mut client = Line { stops_hand: true, ..Line::new(|_| {}) }.connected();
    procedure::start_up(&mut client, true, Stage::Ready, |_| {}).unwrap();
    let begun = client.now();
    let refused = procedure::initialise_hand(&mut client);
    assert!(matches!(refused, Err(ProcedureError::Hand("its initialisation was stopped"))), "{refused:?}");
    assert!(client.now() - begun < Duration::from_secs(2), "{:?}", client.now() - begun);
}

/// The change that makes it fail: `--at-home` is believed as often as the arm loses its zero.
#[test]
fn a_persons_word_that_the_arm_is_at_home_holds_for_one_zeroing_only() {
    let zeroings = Arc::new(AtomicU32::new(0));
    let line = Line::new(|options| {
        // Nobody activates it. It is zeroed, then somebody hits the emergency stop, and its motors lose their counts.
        options.plant.operator.activate_after = None;
        options.plant.operator.script = vec![
            (8 * TICKS_PER_SECOND, PendantAction::PressEStop),
            (10 * TICKS_PER_SECOND, PendantAction::ReleaseEStop),
            (10 * TICKS_PER_SECOND, PendantAction::ShiftIdle),
        ];
    });
    let mut client = Line { zeroings: zeroings.clone(), ..line }.connected();
    let refused = procedure::start_up(&mut client, true, Stage::Ready, |_| {});
    assert!(matches!(refused, Err(ProcedureError::NotZeroed)), "{refused:?}");
    assert!(client.now() > Duration::from_secs(10));
    assert_eq!(zeroings.load(Ordering::Relaxed), 1);
}
