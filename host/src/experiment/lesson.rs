//! The primitive of an experiment, made on the spot: taught by the simulated person, learned, rehearsed, and with the experience of runs that
//! succeeded; the same library calls as in `tactus teach`, `learn`, `rehearse` and `experience`.

use std::path::Path;

use sim::person::{GuidedWorld, Stage};
use sim::world::mujoco::{MujocoWorld, Scene};

use super::config::Config;
use super::grid::Grid;
use super::mode::Mode;
use super::plant::{self, Arm};
use super::results::Key;
use super::scenario::{Object, PlantKind, Scenario};
use super::trial::{self, Prepared, TrialError};
use super::variation::Variation;
use crate::client::{Client, Interrupt};
use crate::demonstration::error::RecordingError;
use crate::demonstration::{Demonstration, DemonstrationError, Preparation, Recording};
use crate::device::Device;
use crate::learn::hand::HandMotion;
use crate::learn::memory::{MemoryError, Payload, remember_rehearsals, remember_successes};
use crate::learn::{self, LearnError, LearnOptions};
use crate::primitive_file::{PrimitiveFile, PrimitiveFileError};
use crate::procedure::{self, ProcedureError, Recorder, RunRequest, Take, recording_text};
use crate::simulation::Engine;

/// Seed of arm, noise and person while a primitive is made. Experiments begin with 1, so their arms are others.
const LESSON_SEED: u64 = 0;
/// Rest recorded after the person has let go, s.
const AFTERGLOW: f64 = 0.5;
/// Longest lesson, s.
const LONGEST: f64 = 60.0;
/// Time for the fingers to close behind the movement, s.
const DWELL: f64 = 3.5;
/// Opening of the fingers before the grasp, and where they close to if nothing stops them, rad.
const FINGERS: [f64; 2] = [0.25, 2.35];
/// Part of the dwell in which the fingers move.
const CLOSING: [f64; 2] = [0.06, 0.94];
/// Rehearsals.
const REHEARSALS: u64 = 3;

/// Why no primitive was made.
#[derive(Debug, thiserror::Error)]
pub enum LessonError {
    /// The simulated device failed or refused.
    #[error(transparent)]
    Trial(#[from] TrialError),
    /// The demonstration is none.
    #[error(transparent)]
    Demonstration(#[from] DemonstrationError),
    /// The recording reads back wrong.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// It cannot be learned.
    #[error(transparent)]
    Learn(#[from] LearnError),
    /// It cannot be remembered.
    #[error(transparent)]
    Memory(#[from] MemoryError),
    /// The file cannot be written.
    #[error(transparent)]
    File(#[from] PrimitiveFileError),
    /// Nobody was there to teach, or the lesson did not end.
    #[error("the lesson failed: {0}")]
    Person(&'static str),
}

impl From<ProcedureError> for LessonError {
    fn from(error: ProcedureError) -> Self {
        Self::Trial(error.into())
    }
}

impl From<crate::error::HostError> for LessonError {
    fn from(error: crate::error::HostError) -> Self {
        Self::Trial(error.into())
    }
}

impl From<crate::simulation::SimulationError> for LessonError {
    fn from(error: crate::simulation::SimulationError) -> Self {
        Self::Trial(error.into())
    }
}

/// Makes the primitive of a scenario. `say` hears what is being done; `file` is where it will be written.
///
/// # Errors
/// [`LessonError`]
pub fn make(
    scenario: Scenario,
    plant: PlantKind,
    file: &Path,
    interrupt: &Interrupt,
    say: &mut dyn FnMut(&str),
) -> Result<PrimitiveFile, LessonError> {
    let arm = Arm { engine: Engine::InProcess, kind: plant, variation: Variation::default(), seed: LESSON_SEED };
    say("teaching");
    let recording = teach(scenario, &arm, interrupt)?;
    say("learning");
    let mut primitive = learn(scenario, &recording, file)?;
    say("rehearsing");
    rehearse(scenario, &arm, &mut primitive, interrupt)?;
    Ok(primitive)
}

/// The person shows the movement on an empty table.
fn teach(scenario: Scenario, arm: &Arm, interrupt: &Interrupt) -> Result<Recording, LessonError> {
    let lesson = scenario.lesson();
    let mut options = plant::options(arm, LESSON_SEED, lesson.start(), Scene::EMPTY);
    (options.person, options.lesson) = (Some(LESSON_SEED), lesson);
    let mut client = trial::connect(&options, interrupt)?;
    procedure::make_ready(&mut client, true, |_| {})?;
    procedure::travel(&mut client, lesson.start().map(|angle| angle as f32), |_| {})?;
    client.gravity()?;
    let mut recorder = Recorder::start(
        &mut client,
        Vec::new(),
        "Tactus recording of a demonstration by hand, 300 Hz (simulated arm, simulated person)",
    )?;
    person(&mut client).ok_or(LessonError::Person("nobody stands beside the arm"))?.person_mut().begin();
    let mut done_at = None;
    loop {
        let Take::Cycle(telemetry) = recorder.take(&mut client)? else { continue };
        if control::State::from_code(telemetry.state) != Some(control::State::Gravity) {
            return Err(LessonError::Person("the arm stopped"));
        }
        let seconds = recorder.rows() as f64 / crate::demonstration::RATE;
        if done_at.is_none() && person(&mut client).is_some_and(|world| world.person().stage() == Stage::Done) {
            done_at = Some(seconds + AFTERGLOW);
        }
        if seconds > LONGEST {
            return Err(LessonError::Person("the person did not come to an end"));
        }
        if done_at.is_some_and(|at| seconds >= at) {
            break;
        }
    }
    let bytes = recorder.finish(&mut client)?;
    client.hold()?;
    Ok(Recording::parse(Path::new("demonstration.csv"), &bytes)?)
}

fn person(client: &mut Client<Device>) -> Option<&mut GuidedWorld<MujocoWorld>> {
    let world: &mut dyn std::any::Any = client.transport().simulation()?.world();
    world.downcast_mut()
}

/// Movement of the arm as shown, with fingers that close where the hand rests.
fn learn(scenario: Scenario, recording: &Recording, file: &Path) -> Result<PrimitiveFile, LessonError> {
    let shown = Demonstration::prepare(recording, &Preparation::default())?.duration();
    let dwell = if scenario.lifts_itself() { 0.0 } else { DWELL };
    let lesson = scenario.lesson();
    // Within the lesson the hand rests from its arrival on; people need a moment longer than the path that they follow.
    let arrival = lesson.arrival() / lesson.path().duration() * shown;
    let closes = CLOSING.map(|share| (arrival + share * DWELL) / (shown + dwell));
    let fingers = |angle: f64| [0.0, angle, angle, angle];
    let options = LearnOptions {
        dwell,
        hand: HandMotion {
            start: fingers(FINGERS[0]),
            goal: fingers(FINGERS[1]),
            window: (closes[0], closes[1].min(1.0)),
        },
        ..LearnOptions::named(scenario.name())
    };
    Ok(learn::learn(recording, file, &options)?.primitive)
}

/// Plays the movement without feedback and remembers what it felt like: on the empty table, or without it where the hand shall give way to it.
fn rehearse(
    scenario: Scenario,
    arm: &Arm,
    primitive: &mut PrimitiveFile,
    interrupt: &Interrupt,
) -> Result<(), LessonError> {
    let movement = primitive.without_memory();
    let scene = if scenario == Scenario::Bottle { Scene::NOTHING } else { Scene::EMPTY };
    let image = movement.to_image()?;
    let name = link::Name::new(&movement.name).map_err(|_| LessonError::Person("the primitive has no name"))?;
    let mut recordings = Vec::new();
    for trial in 1..=REHEARSALS {
        let options = plant::options(arm, trial, movement.start.posture, scene);
        let mut client = trial::connect(&options, interrupt)?;
        client.upload(&image, |_, _, _| {})?;
        procedure::make_ready(&mut client, true, |_| {})?;
        procedure::go_to_start(&mut client, &movement.start, |_| {})?;
        let request = RunRequest::new(name.clone(), movement.duration, Mode::OpenLoop.of_run().options());
        let mut cycles = Vec::new();
        procedure::play(&mut client, &request, &mut |cycle| cycles.push(*cycle))?;
        recordings.push(parse(&cycles, &format!("rehearsal {trial}"))?);
    }
    remember_rehearsals(primitive, &recordings, movement.duration, Payload::default(), true)?;
    Ok(())
}

fn parse(cycles: &[link::Telemetry], name: &str) -> Result<Recording, LessonError> {
    let bytes =
        recording_text(cycles, "Tactus recording, 300 Hz (simulated arm)").map_err(ProcedureError::Recording)?;
    Ok(Recording::parse(Path::new(name), &bytes)?)
}

/// Runs with the object in a few places; those that succeed become what the device watches later runs by. Gives how many succeeded of how many.
///
/// Their seed is that of the lesson, so no trial of an experiment is among them.
///
/// # Errors
/// [`LessonError`]; too few successes leave the primitive without experience, which is no error.
pub fn experience(
    config: &Config,
    object: Object,
    grid: &Grid,
    interrupt: &Interrupt,
    primitive: &mut PrimitiveFile,
) -> Result<(usize, usize), LessonError> {
    let config = Config { object, primitive: primitive.clone(), variation: Variation::default(), ..config.clone() };
    let prepared = Prepared::of(&config)?;
    let mut recordings = Vec::new();
    for (index, &cell) in grid.cells.iter().enumerate() {
        let key = Key { index, cell, mode: Mode::Adaptive, seed: LESSON_SEED };
        let trial = trial::run(&config, &prepared, key, interrupt)?;
        if trial.report.outcome.is_success() {
            // The lift is none of the primitive's.
            let end = trial.report.measures.lift_s;
            let run: Vec<link::Telemetry> = trial
                .telemetry
                .iter()
                .zip(&trial.trace.cycles)
                .filter(|(_, cycle)| cycle.time <= end)
                .map(|(telemetry, _)| *telemetry)
                .collect();
            recordings.push(parse(&run, &format!("run {}", index + 1))?);
        }
    }
    if recordings.len() >= dmp::fit::FEWEST_TRIALS {
        remember_successes(primitive, &recordings)?;
    }
    Ok((recordings.len(), grid.cells.len()))
}
