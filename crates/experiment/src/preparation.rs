//! The primitive of an experiment, made on the spot: taught by the simulated teacher, learned, rehearsed, and with the
//! statistics of runs that succeeded; the same library calls as in `tactus teach`, `learn`, `rehearse` and
//! `statistics`.

use std::path::Path;

use sim::world::mujoco::Scene;

use super::config::Config;
use super::grid::{Cell, Grid};
use super::plant::{self, Arm};
use super::results::Key;
use super::scenario::{PlantKind, Scenario};
use super::trial::{self, Prepared, TrialError};
use super::variation::Variation;
use lab::client::Interrupt;
use lab::demonstration::error::RecordingError;
use lab::demonstration::{Demonstration, DemonstrationError, Preparation, Recording};
use lab::learn::feedback::FeedbackOptions;
use lab::learn::hand::HandMotion;
use lab::learn::memory::{MemoryError, Payload, remember_rehearsals, remember_successes};
use lab::learn::{self, LearnError, LearnOptions};
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};
use lab::procedure::Mode;
use lab::procedure::{self, ProcedureError, Recorder, record_demonstration, recording_text, teacher};
use lab::simulation::Engine;

/// Seed of arm, noise and person while a primitive is made. Experiments begin with 1, so their arms are others.
const TEACHER_SEED: u64 = 0;
/// Seeds of further demonstrations begin here: another hand that trembles, on another arm.
const FURTHER_TEACHINGS: u64 = 2_000_000;
/// Rest recorded after the simulated teacher has let go, s.
const POST_ROLL: f64 = 0.5;
/// Longest demonstration, s.
const LONGEST_DEMONSTRATION: f64 = 60.0;
/// Opening of the fingers before the grasp, rad.
const OPEN: f64 = 0.25;
/// The same for an object that may stand beside the palm: as wide as the fingers go without touching their stops, 12
/// cm to either side.
const WIDE_OPEN: f64 = 0.05;
/// Time for the fingers to close where the hand rests, s: slow enough not to strike what they meet.
const CLOSING_SECONDS: f64 = 7.0;
/// The same in a movement that lifts by itself: its teacher rests for no longer.
const LIFTING_SECONDS: f64 = 3.5;
/// Part of that time in which the fingers move.
const CLOSING: [f64; 2] = [0.06, 0.94];
/// Kernels of a movement that lifts by itself.
const LIFTING_KERNELS: usize = 100;
/// Rehearsals.
const REHEARSALS: u64 = 3;

/// Compliance of a scenario's hand: one set for all its cells and modes, chosen for what it meets.
#[derive(Debug, Clone, Copy)]
struct GraspTuning {
    /// Where the fingers close to if nothing stops them, rad.
    closed: f64,
    /// K1/K of the position rows sideways and upwards, m/N; `None`: as recommended.
    compliance: Option<[f64; 2]>,
    /// True if the plan turns by the measured torque.
    turns: bool,
    /// K of the hand rows and their K1/K, rad/(N m); `None`: as recommended.
    fingers: Option<[f64; 2]>,
}

impl GraspTuning {
    fn of(scenario: Scenario) -> GraspTuning {
        let usual = GraspTuning { closed: 2.35, compliance: None, turns: true, fingers: None };
        // A light cup slides at 1 N: half of that must bend the plan by its whole reach, and 0.3 N of it are the dead
        // band.
        let light = Some([2.0, 0.0]);
        match scenario {
            Scenario::Flashlight | Scenario::Lift => usual,
            Scenario::Cup => GraspTuning { compliance: light, ..usual },
            // What is in the way is below: the hand gives way upwards and nowhere else.
            Scenario::Bottle => GraspTuning { compliance: Some([0.0, 0.5]), turns: false, ..usual },
            // The plan of fingers that can crush what they touch is quick enough (K) and gives way enough (K1) to end
            // where they touch. They close to 0.4 rad beyond the cup, in both modes.
            Scenario::Fingers => GraspTuning { closed: 1.95, compliance: light, fingers: Some([2400.0, 3.0]), ..usual },
        }
    }
}

/// Why no primitive was made.
#[derive(Debug, thiserror::Error)]
pub enum PreparationError {
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
    /// There was no teacher, or the demonstration did not end.
    #[error("the demonstration failed: {0}")]
    Teacher(&'static str),
}

impl From<ProcedureError> for PreparationError {
    fn from(error: ProcedureError) -> Self {
        Self::Trial(error.into())
    }
}

impl From<lab::error::HostError> for PreparationError {
    fn from(error: lab::error::HostError) -> Self {
        Self::Trial(error.into())
    }
}

impl From<lab::simulation::SimulationError> for PreparationError {
    fn from(error: lab::simulation::SimulationError) -> Self {
        Self::Trial(error.into())
    }
}

/// A demonstration: what is taught, and by which of the simulated people, on which of the arms.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Teaching {
    /// Movement that is taught, and the object it is for.
    pub scenario: Scenario,
    /// The difference between plant and model.
    pub plant: PlantKind,
    /// Speed of the movement that is learned, of the one that was shown.
    pub speed: f64,
    /// Which demonstration, from 1. Each has a person who trembles in another way, and an arm of its own.
    pub number: u64,
}

impl Teaching {
    /// Seed of arm, noise and person.
    fn seed(&self) -> u64 {
        if self.number <= 1 { TEACHER_SEED } else { FURTHER_TEACHINGS + self.number }
    }
}

/// Makes the primitive of a demonstration on `jobs` processors. `say` hears what is being done; `file` is where it will
/// be written.
///
/// # Errors
/// [`PreparationError`]
pub fn make(
    teaching: Teaching,
    file: &Path,
    jobs: usize,
    interrupt: &Interrupt,
    say: &mut dyn FnMut(&str),
) -> Result<PrimitiveFile, PreparationError> {
    let Teaching { scenario, plant, .. } = teaching;
    let arm = Arm { engine: Engine::InProcess, kind: plant, variation: Variation::default(), seed: teaching.seed() };
    say("teaching");
    let recording = teach(scenario, &arm, interrupt)?;
    say("learning");
    let primitive = learn(teaching, &recording, file)?;
    say("rehearsing");
    rehearsed(&Config { plant, jobs, ..Config::new(scenario, primitive) }, interrupt)
}

/// The primitive of an experiment with the expectation of new rehearsals; the object is there only where its weight
/// is what shall be expected.
///
/// # Errors
/// [`PreparationError`]
pub fn rehearsed(config: &Config, interrupt: &Interrupt) -> Result<PrimitiveFile, PreparationError> {
    let scene = match config.scenario {
        // What shall be expected is the weight, in its place.
        Scenario::Lift => {
            let frame = config.frame().ok_or(PreparationError::Teacher("the movement arrives from nowhere"))?;
            Scene::with(config.object_at(&frame, Cell::default()))
        }
        // The hand shall give way to the table: so it is not expected.
        Scenario::Bottle => Scene::NOTHING,
        // A movement that expects no contact answers to every one.
        Scenario::Flashlight | Scenario::Cup | Scenario::Fingers => Scene::EMPTY,
    };
    let arm =
        Arm { engine: Engine::InProcess, kind: config.plant, variation: Variation::default(), seed: TEACHER_SEED };
    let mut primitive = config.primitive.clone();
    let movement = primitive.without_memory();
    let seeds: Vec<u64> = (1..=REHEARSALS).collect();
    // A weight is only measured where it is lifted: an arm that gives way would leave it on the table.
    let exact = config.scenario == Scenario::Lift;
    let options = if exact { Mode::Track } else { Mode::OpenLoop }.options();
    let runs = in_parallel(config.jobs, &seeds, |seed| rehearsal(&movement, &arm, scene, *seed, options, interrupt));
    let recordings = runs.into_iter().collect::<Result<Vec<_>, _>>()?;
    remember_rehearsals(&mut primitive, &recordings, movement.movement.duration, Payload::default(), true)?;
    Ok(primitive)
}

/// Does something with every item, some at a time; the results are in the order of the items.
pub(super) fn in_parallel<Item: Sync, Done: Send>(
    jobs: usize,
    items: &[Item],
    work: impl Fn(&Item) -> Done + Sync,
) -> Vec<Done> {
    let mut done = Vec::with_capacity(items.len());
    for some in items.chunks(jobs.max(1)) {
        std::thread::scope(|scope| {
            let work = &work;
            let threads: Vec<_> = some.iter().map(|item| scope.spawn(move || work(item))).collect();
            for thread in threads {
                match thread.join() {
                    Ok(result) => done.push(result),
                    Err(panic) => std::panic::resume_unwind(panic),
                }
            }
        });
    }
    done
}

/// The person shows the movement on an empty table; one that shall find the table in its way, without it.
fn teach(scenario: Scenario, arm: &Arm, interrupt: &Interrupt) -> Result<Recording, PreparationError> {
    let movement = scenario.taught_movement();
    let scene = if scenario == Scenario::Bottle { Scene::NOTHING } else { Scene::EMPTY };
    let mut options = plant::options(arm, arm.seed, movement.start(), scene);
    (options.teacher, options.movement) = (Some(arm.seed), movement);
    let mut client = trial::connect(&options, interrupt)?;
    procedure::make_ready(&mut client, true, |_| {})?;
    procedure::travel(&mut client, movement.start().map(|angle| angle as f32), |_| {})?;
    client.gravity()?;
    let rate = control::RATE_HZ;
    let notes = format!("Tactus recording of a demonstration by hand, {rate} Hz (simulated arm, simulated teacher)");
    let recorder = Recorder::start(&mut client, Vec::new(), &notes)?;
    if !teacher::begin(&mut client) {
        return Err(PreparationError::Teacher("nobody stands beside the arm"));
    }
    let shown = record_demonstration(&mut client, recorder, LONGEST_DEMONSTRATION, POST_ROLL, |client, _| {
        teacher::has_finished(client)
    })?;
    if !shown.is_complete {
        return Err(PreparationError::Teacher("the simulated teacher did not come to an end"));
    }
    client.hold()?;
    Ok(Recording::parse(Path::new("demonstration.csv"), &shown.output)?)
}

/// Movement of the arm as shown, with fingers that close where the hand rests.
fn learn(teaching: Teaching, recording: &Recording, file: &Path) -> Result<PrimitiveFile, PreparationError> {
    let Teaching { scenario, speed, .. } = teaching;
    let shown = Demonstration::prepare(recording, &Preparation::default())?.duration() / speed;
    let tuning = GraspTuning::of(scenario);
    let (closing, dwell) =
        if scenario.lifts_itself() { (LIFTING_SECONDS, 0.0) } else { (CLOSING_SECONDS, CLOSING_SECONDS) };
    let movement = scenario.taught_movement();
    // Within the demonstration the hand rests from its arrival on; people need a moment longer than the path that they
    // follow.
    let arrival = movement.arrival() / movement.path().duration() * shown;
    let closes = CLOSING.map(|share| (arrival + share * closing) / (shown + dwell));
    let fingers = |angle: f64| [0.0, angle, angle, angle];
    let usual = LearnOptions::named(scenario.name());
    let options = LearnOptions {
        speed,
        dwell,
        hand: HandMotion {
            start: fingers(if scenario == Scenario::Flashlight { WIDE_OPEN } else { OPEN }),
            goal: fingers(tuning.closed),
            window: (closes[0], closes[1].min(1.0)),
        },
        feedback: FeedbackOptions {
            hand_stiffness: tuning.fingers.map(|[stiffness, _]| stiffness),
            ..FeedbackOptions::default()
        },
        // A movement that arrives, waits and lifts has more to say in its last part than the usual kernels can.
        kernels: if scenario.lifts_itself() { LIFTING_KERNELS } else { usual.kernels },
        ..usual
    };
    let mut primitive = learn::learn(recording, file, &options)?.primitive;
    let (position, hand) = (primitive.gains.position.stiffness, primitive.gains.hand.stiffness);
    if let Some(feedback) = &mut primitive.feedback {
        for row in &mut feedback.k1 {
            if let (Some([sideways, upwards]), [x, y, z, ..]) = (tuning.compliance, row.as_mut_slice()) {
                (*x, *y, *z) = (sideways * position, sideways * position, upwards * position);
            }
            if let (false, Some(rotation)) = (tuning.turns, row.get_mut(3..6)) {
                rotation.fill(0.0);
            }
            if let (Some([_, compliance]), Some(fingers)) = (tuning.fingers, row.get_mut(7..)) {
                fingers.fill(compliance * hand);
            }
        }
    }
    Ok(primitive)
}

/// Plays the movement once without feedback.
fn rehearsal(
    movement: &PrimitiveFile,
    arm: &Arm,
    scene: Scene,
    seed: u64,
    options_of_rehearsal: link::RunOptions,
    interrupt: &Interrupt,
) -> Result<Recording, PreparationError> {
    let options = plant::options(arm, seed, movement.start.posture, scene);
    let mut client = trial::connect(&options, interrupt)?;
    client.upload(&movement.to_image()?, |_, _, _| {})?;
    procedure::make_ready(&mut client, true, |_| {})?;
    let mut cycles = Vec::new();
    procedure::play_once(&mut client, movement, options_of_rehearsal, &mut |cycle| cycles.push(*cycle))?;
    parse(&cycles, &format!("rehearsal {seed}"))
}

fn parse(cycles: &[link::Telemetry], name: &str) -> Result<Recording, PreparationError> {
    let bytes = recording_text(cycles, &notes()).map_err(ProcedureError::Recording)?;
    Ok(Recording::parse(Path::new(name), &bytes)?)
}

/// Runs with the object in many places; those that succeed become what the device watches later runs by. Gives how
/// many succeeded of how many.
///
/// Every run has an arm of its own, and the modes of the scenario are mixed, because the device knows neither of
/// them: each mode where it has a chance. Arms and places are none of an experiment's trials.
///
/// # Errors
/// [`PreparationError`]; too few successes leave the primitive without statistics, which is no error.
pub fn statistics(
    config: &Config,
    interrupt: &Interrupt,
    primitive: &mut PrimitiveFile,
) -> Result<(usize, usize), PreparationError> {
    let config = Config { primitive: primitive.clone(), variation: Variation::default(), ..config.clone() };
    let prepared = Prepared::of(&config)?;
    let keys = practice(&config.grid, &config.modes);
    let runs = in_parallel(config.jobs, &keys, |&key| -> Result<Option<Recording>, PreparationError> {
        let trial = trial::run(&config, &prepared, key, interrupt)?;
        let saturated = trial.telemetry.iter().any(|cycle| cycle.flags & control::flags::SENSOR_SATURATED != 0);
        if !trial.report.outcome.is_success() || saturated {
            return Ok(None);
        }
        // Lift and hold are none of the primitive's.
        Ok(Some(parse(&trial.telemetry, &format!("run {}", key.index + 1))?.running()))
    });
    let recordings: Vec<Recording> = runs.into_iter().filter_map(Result::transpose).collect::<Result<_, _>>()?;
    if recordings.len() >= dmp::fit::FEWEST_TRIALS {
        remember_successes(primitive, &recordings)?;
    }
    Ok((recordings.len(), keys.len()))
}

/// Where and how statistics are gathered: `(mode, runs, part of the grid about the goal)`. The less a mode answers to
/// what it feels, the nearer the object must be.
const PRACTICE: [(Mode, usize, f64); 4] = [
    (Mode::OpenLoop, 20, 0.5),
    (Mode::ForceControl, 16, 0.6),
    (Mode::Adaptive, 20, 1.0),
    (Mode::RigidFingers, 12, 1.0),
];
/// First of the seeds of arms that gather statistics; experiments count from 1 to at most 1000.
const PRACTICE_SEED: u64 = 1_000_000;

/// The runs that gather statistics: places spread evenly over the extent of a grid (the points of Halton), each with
/// another arm.
fn practice(grid: &Grid, modes: &[Mode]) -> Vec<Key> {
    let extent = |values: &[i32]| {
        let bound = |pick: fn(i32, i32) -> i32| f64::from(values.iter().copied().reduce(pick).unwrap_or(0));
        (bound(i32::min), bound(i32::max))
    };
    let (along, sideways) = (extent(&grid.columns()), extent(&grid.rows()));
    let at = |(low, high): (f64, f64), share: f64, part: f64| (part * (low + (high - low) * share)).round() as i32;
    let mut keys = Vec::new();
    for (mode, runs, part) in PRACTICE.into_iter().filter(|(mode, ..)| modes.contains(mode)) {
        for point in 1..=runs {
            let cell = Cell {
                along_mm: at(along, radical_inverse(point, 2), part),
                sideways_mm: at(sideways, radical_inverse(point, 3), part),
            };
            let index = keys.len();
            keys.push(Key { index, cell, mode, seed: PRACTICE_SEED + index as u64 });
        }
    }
    keys
}

/// The digits of `number` in `base`, mirrored at the point: a coordinate of Halton's sequence.
fn radical_inverse(mut number: usize, base: usize) -> f64 {
    let (mut value, mut digit) = (0.0, 1.0);
    while number > 0 {
        digit /= base as f64;
        value += digit * (number % base) as f64;
        number /= base;
    }
    value
}

/// Note at the head of recordings that are not kept.
fn notes() -> String {
    format!("Tactus recording, {} Hz (simulated arm)", control::RATE_HZ)
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn statistics_are_gathered_by_arms_of_its_own_all_over_the_grid_and_near_the_goal_without_feedback() {
        let keys = practice(&Grid::paper(), &Mode::PAPER);
        assert_eq!(keys.iter().map(|key| key.seed).collect::<BTreeSet<_>>().len(), keys.len());
        assert!(keys.iter().all(|key| key.seed > 1000));
        let farthest =
            |mode: Mode| keys.iter().filter(|key| key.mode == mode).map(|key| key.cell.distance()).fold(0.0, f64::max);
        let by_mode = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive].map(farthest);
        assert!(by_mode.is_sorted_by(|less, more| less < more) && by_mode[2] > 0.2, "{by_mode:?}");
        let within = |cell: Cell| (-240..=40).contains(&cell.along_mm) && (-120..=80).contains(&cell.sideways_mm);
        assert!(keys.iter().all(|key| within(key.cell)));
        assert!(practice(&Grid::paper(), &[Mode::Adaptive]).iter().all(|key| key.mode == Mode::Adaptive));
    }
}
