//! One primitive played on a simulated arm, with everything that came of it.

use std::path::Path;

use control::{RATE_HZ, State};
use lab::arm;
use lab::demonstration::Recording;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::{self, Recorder, Take};
use lab::tracking::Tracking;
use link::{EventKind, Name, RunOptions, Statistics, Telemetry};
use sim::BusTrace;

use crate::{Arm, expect, simulation};

/// Cycles recorded behind the arrival at the goal: 1 s.
const POST_ROLL: usize = RATE_HZ as usize;

/// Cycles after which a movement that has not arrived is a failure: 30 s.
const TIMEOUT: usize = 30 * RATE_HZ as usize;

/// Result of one run.
pub struct Execution {
    /// Every cycle from the start of the run.
    pub telemetry: Vec<Telemetry>,
    /// The recording, byte by byte.
    pub bytes: Vec<u8>,
    /// The recording, read back.
    pub recording: Recording,
    /// Measured against desired pose.
    pub tracking: Tracking,
    /// Telemetry messages that the link lost.
    pub gaps: u32,
    /// Counters of the device since it was switched on.
    pub statistics: Statistics,
    /// Counters of the bus since then.
    pub trace: BusTrace,
    /// Where the grasp point really is at the end, m.
    pub grasp_point: [f64; 3],
}

impl Execution {
    /// The cycles in which the plan was played.
    #[must_use]
    pub fn running(&self) -> Vec<Telemetry> {
        let run = self.telemetry.iter().filter(|cycle| State::from_code(cycle.state) == Some(State::Run));
        run.copied().collect()
    }
}

/// Uploads a primitive and moves the arm to the posture in which it begins.
///
/// # Panics
/// The device refuses, or the arm does not arrive.
#[track_caller]
pub fn prepare(arm: &mut Arm, file: &PrimitiveFile) {
    expect(arm.upload(&expect(file.to_image()), |_, _, _| {}));
    expect(procedure::travel(arm, file.start.posture.map(|angle| angle as f32), |_| {}));
}

/// Starts the primitive that the arm is prepared for, as taught.
///
/// # Panics
/// The device refuses.
#[track_caller]
pub fn begin(arm: &mut Arm, file: &PrimitiveFile) {
    expect(arm.run(&expect(Name::new(&file.name)), RunOptions::default()));
}

/// Plays a primitive from a device that is ready to a second behind the arrival.
///
/// # Panics
/// Anything goes wrong.
#[track_caller]
pub fn play(arm: &mut Arm, file: &PrimitiveFile) -> Execution {
    prepare(arm, file);
    let mut recorder = expect(Recorder::start(arm, Vec::new(), "whole-system test"));
    arm.take_events();
    begin(arm, file);
    let mut telemetry = Vec::new();
    let mut end = TIMEOUT;
    while telemetry.len() < end {
        match expect(recorder.take(arm)) {
            Take::Cycle(cycle) => telemetry.push(cycle),
            Take::Event(event) => match event.kind {
                EventKind::Arrived => end = telemetry.len() + POST_ROLL,
                EventKind::State => expect(procedure::after(event.code, event.detail)),
                _ => {}
            },
        }
    }
    assert!(end < TIMEOUT, "the movement never arrived");
    let bytes = expect(recorder.finish(arm));
    let recording = expect(Recording::parse(Path::new("run"), &bytes));
    let statistics = expect(arm.statistics());
    let gaps = arm.gaps().telemetry;
    let plant = simulation(arm.transport()).plant();
    let grasp_point = plant.world().grasp_pose().position;
    Execution {
        tracking: expect(Tracking::of_run(&recording)),
        trace: plant.trace(),
        telemetry,
        bytes,
        recording,
        gaps,
        statistics,
        grasp_point,
    }
}

/// Takes telemetry for so many cycles.
///
/// # Panics
/// The stream is off, or the device falls silent.
#[track_caller]
pub fn watch(arm: &mut Arm, cycles: usize) -> Vec<Telemetry> {
    let stream = expect(arm.telemetry(1));
    stream.take(cycles).map(expect).collect()
}

/// The grasp point at the joint angles of a cycle, m.
#[must_use]
pub fn grasp_point(cycle: &Telemetry) -> [f64; 3] {
    arm::tool_pose(&cycle.q.map(f64::from)).0
}

/// Distance of two points, m.
#[must_use]
pub fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}

/// The first cycle whose torques leave the limits of the arm, if any does.
#[must_use]
pub fn beyond_torque_limits(telemetry: &[Telemetry]) -> Option<&Telemetry> {
    let limits = &*arm::TORQUE_LIMITS;
    // The limits are doubles, the torques were single precision all the way.
    telemetry
        .iter()
        .find(|cycle| cycle.tau.iter().zip(limits).any(|(tau, limit)| f64::from(tau.abs()) > limit * (1.0 + 1e-6)))
}

/// The largest step of a torque between two neighbouring cycles, relative to the limiter's rate of that joint.
#[must_use]
pub fn largest_torque_step(telemetry: &[Telemetry]) -> f64 {
    let steps = telemetry.windows(2).flat_map(|pair| {
        (0..7).map(|joint| {
            f64::from(pair[1].tau[joint] - pair[0].tau[joint]).abs() / control::act::limit::STEP_LIMIT[joint]
        })
    });
    steps.fold(0.0, f64::max)
}
