//! The configuration of an experiment from the options of the command, with a primitive that is made if there is none.

use std::fs::{File, TryLockError};
use std::path::{Path, PathBuf};

use super::failures::{failure, preparation_failure};
use super::refusal::{self, DOING, REFUSED};
use super::{Cmd, ErrorCode, Failure, Global, device};
use crate::cmd::{Output, connection, files, upload};
use experiment::header::Chosen;
use experiment::lift::Case;
use experiment::log::Log;
use experiment::preparation::{self, PreparationError, Teaching};
use experiment::{Config, ExperimentError, Grid, Mode, PlantKind, Scenario, Variation};
use lab::client::Interrupt;
use lab::input_file;
use lab::primitive_file::PrimitiveFile;
use lab::simulation::{Engine, SimulationOptions};
use lab::transport::Address;
use sim::world::ObjectKind;

/// Where the device is simulated unless said otherwise.
const DEVICE: &str = "sil:";

/// The experiment as asked for, with the primitive of the demonstration `number`; results go into `out`. What cannot be
/// tried is refused before anything is taught or written.
pub(super) fn configuration(
    command: &Cmd,
    global: &Global,
    out: &Path,
    number: u64,
    interrupt: &Interrupt,
    output: Output,
) -> Result<Config, Failure> {
    let engine = engine(global)?;
    let object = command.object.as_deref().map(object).transpose()?;
    if command.figures_only && !out.is_dir() {
        let cause = format!("there are no results in {}", out.display());
        return Err(Failure::new(ErrorCode::NoResults, REFUSED, cause));
    }
    let chosen = chosen(command, out)?;
    let object = object.or(chosen.object).unwrap_or_else(|| command.scenario.object());
    let grid = grid(command, chosen.grid);
    let plant = plant(command, chosen.plant);
    if command.primitive.is_none() && !command.figures_only {
        let cells = experiment::reach::check_untaught(command.scenario, object, &grid);
        if !cells.is_empty() {
            return Err(failure(ExperimentError::OutOfReach(cells), command));
        }
    }
    let primitive = primitive(command, plant, out, number, interrupt, output)?;
    let usual = Config::new(command.scenario, primitive);
    let config = Config {
        object,
        grid,
        // Figures are of everything that is there, unless a part of it is named.
        modes: modes(command).unwrap_or(if command.figures_only { Vec::new() } else { usual.modes }),
        seeds: seeds(command),
        engine,
        plant,
        variation: chosen.variation.filter(|_| command.vary == Variation::default()).unwrap_or(command.vary),
        jobs: command.jobs.map_or(usual.jobs, usize::from),
        out: Some(out.to_owned()),
        resume: command.resume,
        as_it_is: command.figures_only,
        keep_traces: true,
        keep_recordings: command.keep_recordings,
        ..usual
    };
    must_expect_forces(&config)?;
    if !command.figures_only {
        warn_of_speeds(command, &config, output)?;
    }
    experiment::check(&config).map_err(|error| failure(error, command))?;
    if let (Some(_), false) = (&command.primitive, command.figures_only) {
        keep(&config.primitive, &file(command, out), out)?;
    }
    Ok(config)
}

/// The configuration of the results that are there, of which figures are asked for; of other experiments, nothing.
pub(super) fn chosen(command: &Cmd, out: &Path) -> Result<Chosen, Failure> {
    if !command.figures_only {
        return Ok(Chosen::default());
    }
    // Of the three cases the one whose weight is that of the experiment.
    let folder = if command.scenario == Scenario::Lift { out.join(Case::Usual.name()) } else { out.to_owned() };
    let header = Log::header(&folder).map_err(|error| refusal::of(error, command))?;
    let header = header.filter(|header| header.experiment == command.scenario.name());
    Ok(header.map(|header| header.chosen()).unwrap_or_default())
}

/// The cells that are asked for, else those that are there.
fn grid(command: &Cmd, there: Option<Grid>) -> Grid {
    let moves = command.rotate != 0.0 || command.shift != [0.0; 2];
    match (&command.grid, there) {
        (None, Some(there)) if !moves => there,
        (given, _) => {
            let grid = given.clone().unwrap_or_else(|| command.scenario.grid());
            grid.moved(command.rotate, command.shift.map(|value| value * 0.01))
        }
    }
}

/// The plant that is asked for, else that of what is there.
fn plant(command: &Cmd, there: Option<PlantKind>) -> PlantKind {
    command.plant.or(there).unwrap_or(PlantKind::Perturbed)
}

/// Refuses modes that compare forces with an expectation that the primitive does not have. The movement with a weight
/// is rehearsed for each case.
fn must_expect_forces(config: &Config) -> Result<(), Failure> {
    let mode = config.modes.iter().find(|mode| mode.needs_expectation());
    let Some(mode) = mode.filter(|_| config.primitive.expectation.is_none() && config.scenario != Scenario::Lift)
    else {
        return Ok(());
    };
    Err(refusal::without_expectation(&config.primitive.file, *mode))
}

/// Warns of the speeds of the run at which a mode that is tried cannot believe the expectation.
fn warn_of_speeds(command: &Cmd, config: &Config, output: Output) -> Result<(), Failure> {
    let (Some(expectation), true) =
        (&config.primitive.expectation, config.modes.iter().any(|mode| mode.needs_expectation()))
    else {
        return Ok(());
    };
    let usual = config.variation.speed;
    let mut speeds: Vec<f64> = match &command.sweep {
        Some(sweep) => sweep.values.iter().map(|value| sweep.variation(config.variation, *value).speed).collect(),
        None => vec![usual],
    };
    // A sweep of another factor has one speed.
    speeds.dedup();
    let primitive = config
        .primitive
        .to_primitive()
        .map_err(|cause| crate::cmd::check::failure(cause, &config.primitive.file, DOING))?;
    let (recorded, taught) = (expectation.recorded_duration, config.primitive.movement.duration);
    let trust = |speed: f64| primitive.expected().map_or(1.0, |expected| expected.trust(recorded * speed / taught));
    if let Some(words) = refusal::disbelieved(&speeds, trust) {
        output.warn(words);
    }
    Ok(())
}

/// File of the primitive that is tried in a folder.
fn file(command: &Cmd, out: &Path) -> PathBuf {
    out.join(format!("{}.toml", command.scenario))
}

/// Puts the primitive into the folder, which tells by itself what was tried in it.
fn keep(primitive: &PrimitiveFile, file: &Path, out: &Path) -> Result<(), Failure> {
    files::create_folder(out, DOING)?;
    if file.exists() {
        return Ok(());
    }
    primitive.write(file).map_err(|error| preparation_failure(error.into()))
}

/// Refuses a primitive that is not the one in the folder: results of two would lie there under the name of one.
fn must_be_the_one_there(primitive: &PrimitiveFile, file: &Path) -> Result<(), Failure> {
    if !file.exists() || PrimitiveFile::read(file).is_ok_and(|there| there.checksum() == primitive.checksum()) {
        return Ok(());
    }
    let cause = format!("{} is another primitive than {}", file.display(), primitive.file.display());
    Err(Failure::new(ErrorCode::WouldReplace, REFUSED, cause)
        .help("choose another folder with `--out`; without `--primitive` the one in the folder is tried"))
}

/// The object that is compiled in under this name, or that of the user's file.
fn object(given: &Path) -> Result<ObjectKind, Failure> {
    if let Some(Ok(kind)) = given.to_str().map(str::parse) {
        return Ok(kind);
    }
    if given.extension().is_none_or(|extension| extension != "toml") {
        let known = ObjectKind::ALL.map(ObjectKind::name).join(", ");
        let cause = format!("there is no object '{}'; there are {known}, and files NAME.toml", given.display());
        return Err(Failure::new(ErrorCode::UnknownObject, DOING, cause));
    }
    let text = input_file::read_text(given)
        .map_err(|cause| Failure::of_file(ErrorCode::FileFailed, format!("{DOING}: {}", given.display()), cause))?;
    ObjectKind::from_toml(&text).map_err(|cause| {
        let doing = format!("{DOING} refused {}", given.display());
        Failure::new(ErrorCode::ObjectInvalid, doing, input_file::parser_words(&cause))
    })
}

/// The arms that are asked for.
fn seeds(command: &Cmd) -> Vec<u64> {
    match (command.seed, &command.seeds) {
        (Some(seed), _) => vec![seed],
        (None, Some(seeds)) => seeds.clone().collect(),
        (None, None) if command.figures_only => Vec::new(),
        (None, None) => vec![1],
    }
}

/// The modes that are asked for, if any are.
fn modes(command: &Cmd) -> Option<Vec<Mode>> {
    let mut modes = command.modes.clone();
    modes.sort_unstable();
    modes.dedup();
    Some(modes).filter(|modes| !modes.is_empty())
}

fn engine(global: &Global) -> Result<Engine, Failure> {
    let text = global.device.as_deref().unwrap_or(DEVICE);
    let address = match global.address(DOING)? {
        Some(address) => address,
        None => DEVICE.parse().map_err(|error| lab::error::HostError::Address(error).into_failure(DOING))?,
    };
    let Address::Simulated(kind, options) = address else {
        return Err(Failure::new(ErrorCode::NotSimulated, DOING, format!("'{text}' is not a simulated device"))
            .help("`--device sil:`, or `--device sim:` for the firmware under QEMU, or `--device board:` for it on the emulated board"));
    };
    let ignored = device::ignored(kind, &options);
    if !ignored.is_empty() {
        let options: Vec<String> = ignored.iter().map(|(option, _)| format!("`{option}`")).collect();
        let help: Vec<String> = ignored.iter().map(|(option, help)| format!("{option}: {help}")).collect();
        let cause = format!("'{text}': an experiment does not heed {}", options.join(", "));
        return Err(Failure::new(ErrorCode::AddressInvalid, REFUSED, cause).help(help.join("; ")));
    }
    let options = SimulationOptions::from_address(kind, &options)
        .map_err(|error| connection::simulation_failure(error, DOING))?;
    Ok(options.engine)
}

/// The primitive that is given, the one that was made here before, or a new one.
fn primitive(
    command: &Cmd,
    plant: PlantKind,
    out: &Path,
    number: u64,
    interrupt: &Interrupt,
    output: Output,
) -> Result<PrimitiveFile, Failure> {
    let file = file(command, out);
    if let Some(given) = &command.primitive {
        let primitive = upload::read(given, DOING)?;
        must_be_the_one_there(&primitive, &file)?;
        return Ok(primitive);
    }
    if command.figures_only && !file.is_file() {
        let cause = format!("{} is not there", file.display());
        return Err(Failure::new(ErrorCode::NoResults, REFUSED, cause)
            .help("name the primitive that was tried with `--primitive`, or the folder with `--out`"));
    }
    let is_new = !out.exists();
    // A folder that cannot be had is told before the minutes of teaching.
    let _kept = if command.figures_only { None } else { kept(out)? };
    if file.is_file() {
        output.say(format!("the primitive is {}", file.display()));
        let primitive = upload::read(&file, DOING)?;
        if primitive.statistics.is_some() || command.figures_only || Log::is_begun(out) {
            return Ok(primitive);
        }
        // Somebody broke off while they were gathered. Without them nothing watches the trials, and none is told.
        let spinner = output.spinner("recording successful runs");
        let watched = with_statistics(command, plant, primitive, &file, interrupt, output);
        spinner.finish_and_clear();
        return watched.map_err(preparation_failure);
    }
    let teaching = Teaching { scenario: command.scenario, plant, speed: command.learn_speed, number };
    let made = taught(command, teaching, &file, interrupt, output);
    if is_new && made.is_err() {
        // It is removed only if it is empty; who broke off after the teaching finds the primitive.
        let _ = std::fs::remove_dir(out);
    }
    let primitive = made.map_err(preparation_failure)?;
    output.say(format!("taught, learned and rehearsed: {}", file.display()));
    Ok(primitive)
}

/// Makes the folder, and keeps it for this program until the file is closed: of two that make a primitive in it, the
/// second would replace that of the first, with which trials may have begun. A file system without locks keeps nothing.
fn kept(out: &Path) -> Result<Option<File>, Failure> {
    files::create_folder(out, DOING)?;
    let Ok(folder) = File::open(out) else { return Ok(None) };
    match folder.try_lock() {
        Ok(()) => Ok(Some(folder)),
        Err(TryLockError::Error(_)) => Ok(None),
        Err(TryLockError::WouldBlock) => {
            let cause = format!("another experiment makes its primitive in {}", out.display());
            Err(Failure::new(ErrorCode::FileFailed, REFUSED, cause)
                .help("wait for the other experiment in this folder, or choose another one with `--out`"))
        }
    }
}

/// A new primitive, written into `file`.
fn taught(
    command: &Cmd,
    teaching: Teaching,
    file: &Path,
    interrupt: &Interrupt,
    output: Output,
) -> Result<PrimitiveFile, PreparationError> {
    let spinner = output.spinner("teaching");
    let jobs = command.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
    let made = preparation::make(teaching, file, jobs, interrupt, &mut |doing| {
        spinner.set_message(doing.to_owned());
    })
    .and_then(|primitive| {
        // Whatever becomes of the statistics, the primitive is worth keeping.
        primitive.write(file)?;
        spinner.set_message("recording successful runs");
        with_statistics(command, teaching.plant, primitive, file, interrupt, output)
    });
    spinner.finish_and_clear();
    made
}

/// The primitive with the statistics of successful runs, written into its file.
fn with_statistics(
    command: &Cmd,
    plant: PlantKind,
    mut primitive: PrimitiveFile,
    file: &Path,
    interrupt: &Interrupt,
    output: Output,
) -> Result<PrimitiveFile, PreparationError> {
    let usual = Config::new(command.scenario, primitive.clone());
    let jobs = command.jobs.map_or(usual.jobs, usize::from);
    let config = Config { plant, jobs, ..usual };
    let (held, of) = preparation::statistics(&config, interrupt, &mut primitive)?;
    output.say(match primitive.statistics {
        Some(_) => format!("{held} of {of} runs succeeded; what is usual was learned from them"),
        None => format!("{held} of {of} runs succeeded: too few to learn what is usual, and nothing is watched"),
    });
    primitive.write(file)?;
    Ok(primitive)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The change that makes it fail: the folder is made and not kept.
    #[test]
    fn a_folder_in_which_a_primitive_is_made_is_refused_to_another_experiment() {
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("cup");
        let first = kept(&out).unwrap();
        let refused = kept(&out).unwrap_err();
        assert_eq!(refused.code.to_string(), "E236");
        assert!(refused.to_string().contains("another experiment makes its primitive in"), "{refused}");
        drop(first);
        assert!(kept(&out).is_ok(), "it is free again");
    }
}
