//! `tactus teach`: the arm becomes weightless, a person shows a movement, and it is recorded.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::time::Instant;

use clap::Args;
use rustix::termios::{QueueSelector, tcflush};
use schemars::JsonSchema;
use serde::Serialize;
use sim::teacher::TaughtMovement;

use super::files::{Counted, RecordingFile};
use super::{ErrorCode, Failure, Global, connection, files};
use lab::client::Client;
use lab::demonstration::{FEWEST_SAMPLES, RATE};
use lab::device::Device;
use lab::error::Capability;
use lab::procedure::{self, Demonstrated, ProcedureError, Recorder, teacher};
use lab::simulation::{DEFAULT_SEED, SimulationOptions};

/// Rest that is recorded after the simulated teacher has let go, s.
const POST_ROLL: f64 = 0.5;

/// Longest demonstration, s.
const LONGEST_DEMONSTRATION: f64 = 120.0;

/// Options of `teach`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Where the recording goes, CSV (see docs/recording-format.md)
    #[arg(long, short, value_name = "FILE", default_value = "demonstration.csv")]
    pub output: PathBuf,
    /// Posture the arm moves to before it becomes weightless: seven joint angles, rad. A simulated arm has a default
    #[arg(long, value_name = "Q1,...,Q7", value_parser = start_posture, allow_hyphen_values = true)]
    pub from: Option<Posture>,
    /// Duration of the recording, 0.2 to 3600 s. Without it: until Enter is pressed, at most 120, or a simulated
    /// teacher lets go
    #[arg(long, value_name = "SECONDS", value_parser = recorded, allow_hyphen_values = true)]
    pub duration: Option<f64>,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Seed of the simulated teacher's hand [default: 1]
    #[arg(long)]
    pub teacher: Option<u64>,
    /// Movement that the simulated teacher shows [default: demonstration]
    #[arg(long, value_enum)]
    pub movement: Option<MovementName>,
}

/// The movements that the simulated teacher can show.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, clap::ValueEnum)]
pub enum MovementName {
    /// A side grasp with turns about every axis
    #[default]
    Demonstration,
    /// A level side grasp of a standing flashlight
    Flashlight,
    /// A side grasp of a cup
    Cup,
    /// A grasp of a lying bottle from above
    Bottle,
    /// A grasp and a lift
    Lift,
}

impl MovementName {
    fn movement(self) -> TaughtMovement {
        match self {
            MovementName::Demonstration => TaughtMovement::SmallTorch,
            MovementName::Flashlight => TaughtMovement::Flashlight,
            MovementName::Cup => TaughtMovement::Cup,
            MovementName::Bottle => TaughtMovement::Bottle,
            MovementName::Lift => TaughtMovement::Lift,
        }
    }
}

/// Seven joint angles, rad.
pub type Posture = [f32; 7];

/// Records a demonstration.
///
/// # Errors
/// The device fails or refuses, or the file cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "teach";
    let output = global.output();
    let mut file = RecordingFile::create(&command.output, global, &[], DOING)?;
    let started = Instant::now();
    let movement = command.movement.unwrap_or_default();
    let mut client = connection::open(global, DOING, |options| {
        options.teacher = Some(command.teacher.unwrap_or(DEFAULT_SEED));
        options.movement = movement.movement();
        clear_the_table(options);
    })?;
    client.require(Capability::Arm).map_err(|error| error.into_failure(DOING))?;
    let nobody = |when: &str| Failure::new(ErrorCode::NobodyToAsk, DOING, format!("nobody can press Enter {when}"));
    let alone = global.non_interactive && command.duration.is_none();
    if alone && default_posture(&mut client, movement).is_none() {
        return Err(nobody("at the end of the movement"));
    }
    refuse_absent_teacher(command, &mut client)?;
    if command.from.is_some() && default_posture(&mut client, movement).is_some() {
        return Err(Failure::new(
            ErrorCode::StartIsFixed,
            DOING,
            "the simulated teacher knows one movement, and where it begins",
        ));
    }
    connection::ready(&mut client, command.at_home, output, DOING)?;
    let failed = |error| connection::failure(error, DOING);

    if let Some(posture) = command.from.or_else(|| default_posture(&mut client, movement)) {
        let spinner = output.spinner("moving to the start");
        let travelled = procedure::travel(&mut client, posture, |passed| {
            spinner.set_message(format!("moving to the start, {passed:.0} s"));
        });
        spinner.finish_and_clear();
        travelled.map_err(failed)?;
    }

    let notes = format!(
        "Tactus recording of a demonstration by hand, {} Hz\n{}",
        control::RATE_HZ,
        files::origin(&client, None)
    );
    file.expect_notes(&notes);
    client.gravity().map_err(|error| failed(error.into()))?;
    let recorded = Recorder::start(&mut client, &mut file.file, &notes)
        .and_then(|recorder| record(command, global, &mut client, recorder));
    // Whatever happened, nobody holds the arm any more: let it hold itself.
    let held = client.hold();
    let recorded = recorded.and_then(|recorded| Ok(held.map(|()| recorded)?));
    connection::tell_speed(&client, started, output);
    let recorded = recorded.map_err(failed).and_then(|(shown, gaps, is_shown)| match is_shown {
        true => Ok((shown.samples, shown.seconds, gaps)),
        false => Err(nobody("any more: standard input has ended")),
    });
    let (samples, duration_s, gaps) = file.end(recorded, output)?;
    output.result(
        &Taught { file: files::text(&command.output), samples, duration_s, gaps },
        format!("{samples} samples, {duration_s:.1} s, {gaps} lost"),
    )
}

/// Refuses options of the simulated teacher where nobody of the kind stands beside the arm: a person would be asked to
/// guide it, and nobody would know that they were ignored.
fn refuse_absent_teacher(command: &Cmd, client: &mut Client<Device>) -> Result<(), Failure> {
    let given = [("--movement", command.movement.is_some()), ("--teacher", command.teacher.is_some())];
    match given.into_iter().find(|(_, is_given)| *is_given) {
        Some((option, _)) if !teacher::is_present(client) => {
            let cause = format!("`{option}` is for the simulated teacher, and none stands beside this arm");
            Err(Failure::new(ErrorCode::CommandLine, "teach refused", cause)
                .help("leave it out; `--device sil:` with the MuJoCo world has a simulated teacher"))
        }
        _ => Ok(()),
    }
}

/// Data of `tactus --json teach`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Taught {
    /// The demonstration that was written.
    pub file: String,
    /// Its samples.
    pub samples: usize,
    /// Its duration, s.
    pub duration_s: f64,
    /// Samples lost on the link.
    pub gaps: u32,
}

/// Records until the person is done; gives the recording, the number of samples that were lost on the link, and whether
/// anybody said that the movement is shown.
fn record<'file>(
    command: &Cmd,
    global: &Global,
    client: &mut Client<Device>,
    recorder: Recorder<&'file mut Counted>,
) -> Result<(Demonstrated<&'file mut Counted>, u32, bool), ProcedureError> {
    let output = global.output();
    let guided = teacher::begin(client);
    let enter = (!guided && command.duration.is_none()).then(wait_for_enter);
    if guided {
        output.say("a simulated teacher guides the hand");
    } else if enter.is_some() {
        output
            .say(format!("guide the arm; press Enter when the movement is shown, within {LONGEST_DEMONSTRATION:.0} s"));
    }
    let spinner = output.spinner("recording");
    let limit = command.duration.unwrap_or(LONGEST_DEMONSTRATION);
    let post_roll = if guided { POST_ROLL } else { 0.0 };
    let shown = procedure::record_demonstration(client, recorder, limit, post_roll, |client, seconds| {
        spinner.set_message(format!("recording, {seconds:.1} s"));
        (guided && teacher::has_finished(client)) || enter.as_ref().is_some_and(|enter| enter.is_finished())
    });
    spinner.finish_and_clear();
    let shown = shown?;
    if enter.as_ref().is_some_and(|enter| !enter.is_finished()) {
        output.warn(format!(
            "nobody pressed Enter within {limit:.0} s: the recording has ended by itself, perhaps in the middle of the \
             movement"
        ));
    }
    let ended_unsaid = enter.filter(|enter| enter.is_finished()).is_some_and(|enter| !enter.join().unwrap_or(false));
    Ok((shown, client.gaps().telemetry, !ended_unsaid))
}

/// A thread that ends when Enter is pressed from now on; false if standard input has ended, and nobody can press it any
/// more.
fn wait_for_enter() -> std::thread::JoinHandle<bool> {
    let stdin = std::io::stdin();
    if stdin.is_terminal() {
        // An Enter of before, while the arm started or went to where the movement begins, shows no end of it.
        let _ = tcflush(&stdin, QueueSelector::IFlush);
    }
    std::thread::spawn(|| std::io::stdin().read_line(&mut String::new()).is_ok_and(|bytes| bytes > 0))
}

/// Takes the object off the table: what is shown is the way, and a hand that is guided would push it over. The first
/// demonstration keeps it, because its grasp ends beside it.
fn clear_the_table(options: &mut SimulationOptions) {
    #[cfg(feature = "mujoco")]
    if options.movement != TaughtMovement::SmallTorch {
        options.scene = sim::world::mujoco::Scene::EMPTY;
    }
    let _ = options;
}

/// Where the simulated teacher's path begins, if there is one.
fn default_posture(client: &mut Client<Device>, movement: MovementName) -> Option<Posture> {
    teacher::is_present(client).then(|| movement.movement().start().map(|angle| angle as f32))
}

/// Seven joint angles that the arm may stand at.
fn start_posture(text: &str) -> Result<Posture, String> {
    let angles = posture(text)?;
    for (joint, angle) in angles.iter().enumerate() {
        let (min, max) = (control::model::SOFT_MIN[joint], control::model::SOFT_MAX[joint]);
        if !(min..=max).contains(&f64::from(*angle)) {
            return Err(format!("J{}: {angle} rad is outside {min:.2} to {max:.2} rad", joint + 1));
        }
    }
    Ok(angles)
}

/// Seven numbers separated by commas.
pub(super) fn posture(text: &str) -> Result<Posture, String> {
    let values: Result<Vec<f32>, _> = text.split(',').map(|part| part.trim().parse::<f32>()).collect();
    let values = values.map_err(|_| format!("`{text}` is not a list of numbers separated by commas"))?;
    if values.iter().any(|value| !value.is_finite()) {
        return Err("every angle must be finite".to_owned());
    }
    let found = values.len();
    values.try_into().map_err(|_| format!("7 joint angles are expected, {found} are given"))
}

/// Duration of a recording, s: a shorter one cannot be read again.
pub(super) fn recorded(text: &str) -> Result<f64, String> {
    let shortest = FEWEST_SAMPLES as f64 / RATE;
    match duration(text) {
        Ok(seconds) if seconds >= shortest => Ok(seconds),
        _ => Err(format!("a time between {shortest} and 3600 s is expected")),
    }
}

/// A time worth waiting for, s.
pub(super) fn duration(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(seconds) if seconds > 0.0 && seconds <= 3600.0 => Ok(seconds),
        _ => Err("a time between 0 and 3600 s is expected, and more than 0".to_owned()),
    }
}
