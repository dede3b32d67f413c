//! `tactus experiment`: the same movement on objects that are not where it expects them.

use std::ops::RangeInclusive;
use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, experiment_values as values};
use experiment::sweep::Point;
use experiment::{Comparison, Grid, Mode, PlantKind, Scenario, Summary, Sweep, Variation};

/// Options of `experiment`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Which experiment
    #[arg(value_enum)]
    pub scenario: Scenario,
    /// Where the object stands: `paper` (8 x 6 cells, 4 cm apart), a part of it such as `4x3`, or cells
    /// ALONG:SIDEWAYS in cm such as `-24:8,0:0`
    #[arg(long, visible_alias = "cells", allow_hyphen_values = true)]
    pub grid: Option<Grid>,
    /// Rotate the grid about its middle, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, value_parser = values::degrees, allow_hyphen_values = true)]
    pub rotate: f64,
    /// Shift the grid along the approach and sideways, cm
    #[arg(long, value_name = "ALONG,SIDEWAYS", value_parser = values::shift, default_value = "0,0", allow_hyphen_values = true)]
    pub shift: [f64; 2],
    /// Modes: a open loop, b force control, c force control and adaptation, d as c but the fingers do not adapt
    /// [default: a,b,c; lift c; fingers c,d]
    #[arg(long, value_delimiter = ',', value_parser = str::parse::<Mode>)]
    pub modes: Vec<Mode>,
    /// Try every cell with the seeds 1 to N, or FROM to TO; a seed is an arm
    #[arg(long, value_name = "N|FROM:TO", value_parser = values::numbers, conflicts_with = "seed")]
    pub seeds: Option<RangeInclusive<u64>>,
    /// Try every cell with this seed only
    #[arg(long)]
    pub seed: Option<u64>,
    /// Teach N times, each time by another person, and try every demonstration on every arm; FROM:TO names the persons
    #[arg(long, value_name = "N|FROM:TO", value_parser = values::numbers, conflicts_with = "primitive")]
    pub demonstrations: Option<RangeInclusive<u64>>,
    /// Repeat with a factor of `--vary` over a range, until less than half is held: `joint-friction=1:0`,
    /// `bias=0:2:4` (steps)
    #[arg(long, value_name = "NAME=FROM:TO[:STEPS]")]
    pub sweep: Option<Sweep>,
    /// The primitive, TOML; without it one is taught, learned and rehearsed first
    #[arg(long, value_name = "FILE")]
    pub primitive: Option<PathBuf>,
    /// Learn the movement this many times as fast as it is shown; the fingers keep their time
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = values::faster, conflicts_with = "primitive")]
    pub learn_speed: f64,
    /// Difference between the simulated arm and the controller's model
    #[arg(long, value_enum, default_value = "perturbed")]
    pub plant: PlantKind,
    /// Factors that differ from that arm: mass, table-friction, finger-friction, joint-friction, link-mass, noise
    /// (factors), delay (cycles), bias (N, comes up after the run's tare), speed (of the run, of the taught one)
    #[arg(long, value_name = "NAME=VALUE,...", default_value = "")]
    pub vary: Variation,
    /// Weigh every arm first, as `calibrate gravity` does, and give its device the result; what was found is kept in
    /// the folder
    #[arg(long, conflicts_with_all = ["demonstrations", "sweep"])]
    pub calibrated: bool,
    /// Object on the table instead of the usual one: small-torch, flashlight, cup, bottle, weight, paper-cup, or a file
    /// of your own such as `mug.toml`
    #[arg(long, value_name = "NAME|FILE")]
    pub object: Option<PathBuf>,
    /// Simulations at a time [default: one for each processor]
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=512))]
    pub jobs: Option<u16>,
    /// Folder of the results [default: the experiment's name]
    #[arg(long, short, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Go on with the results in the folder
    #[arg(long)]
    pub resume: bool,
    /// Make figures and tables of the results in the folder, without trials: of all modes and seeds that are there,
    /// unless some are named
    #[arg(long, conflicts_with = "resume")]
    pub figures_only: bool,
    /// Render frames of one trial in each mode
    #[arg(long)]
    pub render: bool,
    /// Write the telemetry of every trial into the folder `recordings`
    #[arg(long)]
    pub keep_recordings: bool,
}

/// Data of `tactus --json experiment`, of one experiment.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Tried {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Statistics of each mode.
    pub modes: Vec<Summary>,
    /// Open loop against adaptation; `null` where there is nothing to compare.
    pub comparison: Option<Comparison>,
}

/// Data of `tactus --json experiment lift`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Lifted {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Figures of each case in each mode.
    pub cases: Vec<experiment::carried::Carried>,
}

/// Data of `tactus --json experiment` with `--demonstrations` or `--sweep`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Studied {
    /// Which experiment.
    pub experiment: Scenario,
    /// The folder of its results.
    pub folder: String,
    /// Demonstrations of each point.
    pub demonstrations: usize,
    /// Name of the factor that is swept; `null` without a sweep.
    pub sweep: Option<String>,
    /// Cells that were held, value by value.
    pub points: Vec<Point>,
}

/// Carries an experiment through.
///
/// # Errors
/// An object cannot be reached, results of another configuration are there, or a trial could not be carried through.
#[cfg(feature = "mujoco")]
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    work::run(command, global)
}

/// Says what is missing.
///
/// # Errors
/// Always: experiments need the MuJoCo world.
#[cfg(not(feature = "mujoco"))]
pub fn run(_command: &Cmd, _global: &Global) -> Result<(), Failure> {
    Err(Failure::new(ErrorCode::WithoutMujoco, "experiment", lab::simulation::SimulationError::WithoutMujoco)
        .help("`cargo xtask build`"))
}

#[cfg(feature = "mujoco")]
mod work {
    use std::collections::BTreeMap;
    use std::path::Path;
    use std::time::Instant;

    use super::{Cmd, ErrorCode, Failure, Global, Lifted, Studied, Tried};
    use crate::cmd::{Output, connection, files, upload};
    use control::model::WeightCorrection;
    use experiment::calibrated::{Calibrated, CalibrationError};
    use experiment::lift::{self, Case};
    use experiment::preparation::{self, PreparationError, Teaching};
    use experiment::results::Log;
    use experiment::sweep::{self, Point};
    use experiment::trial::TrialError;
    use experiment::{Comparison, Config, Experiment, ExperimentError, Progress, Scenario, figures, map};
    use lab::client::Interrupt;
    use lab::output_file;
    use lab::primitive_file::PrimitiveFile;
    use lab::simulation::{Engine, SimulationOptions};
    use lab::transport::Address;
    use sim::world::ObjectKind;

    const DOING: &str = "experiment";
    /// Where the device is simulated unless said otherwise.
    const DEVICE: &str = "sil:";

    pub(super) fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
        let output = global.output();
        let interrupt = connection::interrupt();
        let out = command.out.clone().unwrap_or_else(|| command.scenario.name().into());
        if command.demonstrations.is_some() || command.sweep.is_some() {
            return study(command, global, &out, &interrupt, output);
        }
        let mut config = configuration(command, global, &out, 1, &interrupt, output)?;
        if command.calibrated {
            config.weights = calibrate(&config, &out, &interrupt, output)?;
        }
        if config.scenario == Scenario::Lift {
            return lift(&config, command.render, &interrupt, output);
        }
        let (experiment, wall) = carry(&config, &interrupt, output)?;
        let (data, text) = report(&config, &experiment, &out, command.render, output, wall)?;
        output.result(&data, text)
    }

    /// The experiment as asked for, with the primitive of the demonstration `number`; results go into `out`.
    fn configuration(
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
            return Err(Failure::new(ErrorCode::NoResults, "experiment refused", cause));
        }
        std::fs::create_dir_all(out).map_err(|cause| unwritable(out, cause))?;
        let primitive = primitive(command, out, number, interrupt, output)?;
        let usual = Config::new(command.scenario, primitive);
        let grid = command.grid.clone().unwrap_or_else(|| usual.grid.clone());
        Ok(Config {
            object: object.unwrap_or(usual.object),
            grid: grid.moved(command.rotate, command.shift.map(|value| value * 0.01)),
            // Figures are of everything that is there, unless a part of it is named.
            modes: modes(command).unwrap_or(if command.figures_only { Vec::new() } else { usual.modes }),
            seeds: seeds(command),
            engine,
            plant: command.plant,
            variation: command.vary,
            jobs: command.jobs.map_or(usual.jobs, usize::from),
            out: Some(out.to_owned()),
            resume: command.resume,
            as_it_is: command.figures_only,
            keep_traces: true,
            keep_recordings: command.keep_recordings,
            ..usual
        })
    }

    /// Weighs the arms that were not weighed here before; their weights by seed.
    fn calibrate(
        config: &Config,
        out: &Path,
        interrupt: &Interrupt,
        output: Output,
    ) -> Result<BTreeMap<u64, WeightCorrection>, Failure> {
        let file = out.join("calibrated.json");
        let mut calibrated = Calibrated::read(&file, config);
        let spinner = output.spinner("weighing the arms");
        let completed = calibrated.complete(config, interrupt);
        spinner.finish_and_clear();
        // The arms that were weighed are worth keeping, whatever became of the others.
        let data = serde_json::to_value(&calibrated)
            .map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, DOING, cause))?;
        save(&file, &data)?;
        completed.map_err(|error| match error {
            CalibrationError::Tour { cause, .. } => trial_failure(cause),
            CalibrationError::Regression { .. } => Failure::new(ErrorCode::WeightNotAccepted, DOING, error),
        })?;
        output.say(calibrated.table().to_string());
        calibrated.weights().map_err(|error| Failure::new(ErrorCode::WeightNotAccepted, DOING, error))
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
        let text = lab::input_file::read_text(given)
            .map_err(|cause| Failure::of_file(ErrorCode::FileFailed, format!("{DOING}: {}", given.display()), cause))?;
        ObjectKind::from_toml(&text).map_err(|cause| {
            Failure::new(ErrorCode::ObjectInvalid, format!("{DOING} refused {}", given.display()), cause)
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

    /// Several demonstrations, or several plants, or both: one experiment for each, and what they say together.
    fn study(command: &Cmd, global: &Global, out: &Path, interrupt: &Interrupt, output: Output) -> Result<(), Failure> {
        if command.scenario == Scenario::Lift {
            let cause = "the experiment with a weight has three cases of its own";
            return Err(Failure::new(ErrorCode::NoStudyOfWeights, DOING, cause));
        }
        let numbers = command.demonstrations.clone().unwrap_or(1..=1);
        let demonstrations = numbers.clone().count();
        let mut configs = Vec::new();
        for number in numbers {
            let folder = if demonstrations > 1 || number > 1 {
                out.join(format!("demonstration-{number}"))
            } else {
                out.to_owned()
            };
            configs.push(configuration(command, global, &folder, number, interrupt, output)?);
        }
        let name = command.sweep.as_ref().map(|sweep| sweep.name.as_str());
        let values =
            command.sweep.as_ref().map_or_else(|| vec![None], |s| s.values.iter().copied().map(Some).collect());
        let mut points: Vec<Point> = Vec::new();
        for value in values {
            let mut point = Point::new(value);
            for config in &configs {
                let mut config = config.clone();
                if let (Some(sweep), Some(value)) = (&command.sweep, value) {
                    config.variation = sweep.variation(config.variation, value);
                    config.out = config.out.map(|out| out.join(format!("{}-{value}", sweep.name)));
                }
                let (experiment, wall) = carry(&config, interrupt, output)?;
                let folder = config.out.clone().unwrap_or_default();
                report(&config, &experiment, &folder, command.render, output, wall)?;
                point.add(&experiment.summaries(&config), &experiment.results.seeds());
            }
            points.push(point);
            output.say(sweep::table(&points, name));
            if sweep::has_failed(&points) {
                output.say("less than half of what was held at first: the boundary is found");
                break;
            }
        }
        let (folder, sweep) = (files::text(out), name.map(str::to_owned));
        let data = Studied { experiment: command.scenario, folder, demonstrations, sweep, points };
        let points = &data.points;
        let file = out.join("study.json");
        save(&file, &data)?;
        if let (Some(name), Some(config)) = (name, configs.first()) {
            let title = format!("{}: held along {name}", config.object.row().title);
            figures::curve::draw(points, name, &title).write(out, "sweep").map_err(|cause| {
                Failure::new(ErrorCode::ExperimentFigure, "experiment: a figure cannot be made", cause)
            })?;
            output.say(format!("wrote {}", out.join("sweep.png").display()));
        }
        output.result(&data, sweep::table(points, name))
    }

    /// Carries all trials through with a progress bar; gives the time it took as well, s.
    fn carry(config: &Config, interrupt: &Interrupt, output: Output) -> Result<(Experiment, f64), Failure> {
        let started = Instant::now();
        let bar = output.bar(config.keys().len() as u64, "trials", "trials");
        let carried = experiment::run(config, interrupt, &mut |progress| match progress {
            Progress::Begin { all, done } => {
                bar.set_length(all as u64);
                bar.set_position(done as u64);
                bar.reset_eta();
            }
            Progress::Unfinished { all, done, counted } => output.warn(format!(
                "{done} of {all} trials are there: the figures are of the {counted} whose arms or cells are through"
            )),
            Progress::Done(report) => {
                bar.inc(1);
                let key = &report.key;
                bar.set_message(format!("{} ({}) {}", key.cell, key.mode, report.outcome.name()));
            }
        });
        bar.finish_and_clear();
        let out = config.out.clone().unwrap_or_default();
        let experiment = carried.map_err(|error| failure(error, &out))?;
        Ok((experiment, started.elapsed().as_secs_f64()))
    }

    /// The three cases of the experiment with a weight.
    fn lift(config: &Config, render: bool, interrupt: &Interrupt, output: Output) -> Result<(), Failure> {
        let out = config.out.clone().unwrap_or_default();
        let mut rows = Vec::new();
        let mut texts = Vec::new();
        let usual = config.variation.mass;
        for case in Case::ALL {
            let shared = out.join(format!("{}-{}.toml", config.scenario, case.rehearsed_as().name()));
            let primitive = if shared.is_file() {
                upload::read(&shared, DOING)?
            } else {
                let spinner = output.spinner("rehearsing with the weight");
                let rehearsed = case.rehearsed(config, interrupt);
                spinner.finish_and_clear();
                let primitive = rehearsed.map_err(preparation_failure)?;
                primitive.write(&shared).map_err(|error| preparation_failure(error.into()))?;
                primitive
            };
            let config = case.config(config, primitive);
            let folder = config.out.clone().unwrap_or_default();
            std::fs::create_dir_all(&folder).map_err(|cause| unwritable(&folder, cause))?;
            let (experiment, wall) = carry(&config, interrupt, output)?;
            rows.extend(lift::carried(case, &experiment.results, usual));
            let (_, text) = report(&config, &experiment, &folder, render, output, wall)?;
            texts.push(text);
        }
        let file = out.join("figures");
        let trials = rows.iter().map(|row| row.trials).max().unwrap_or(0);
        figures::write_lift(&rows, trials, &file)
            .map_err(|cause| Failure::new(ErrorCode::ExperimentFigure, "experiment: a figure cannot be made", cause))?;
        output.say(format!("wrote {}", file.join("sag.png").display()));
        let text = lift::table(&rows);
        let data = Lifted { experiment: config.scenario, folder: files::text(&out), cases: rows };
        let file = out.join("results.json");
        save(&file, &data)?;
        output.result(&data, text)
    }

    /// The modes that are asked for, if any are.
    fn modes(command: &Cmd) -> Option<Vec<experiment::Mode>> {
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
        let options = SimulationOptions::from_address(kind, &options)
            .map_err(|error| connection::simulation_failure(error, DOING))?;
        Ok(options.engine)
    }

    /// The primitive that is given, the one that was made here before, or a new one.
    fn primitive(
        command: &Cmd,
        out: &Path,
        number: u64,
        interrupt: &Interrupt,
        output: Output,
    ) -> Result<PrimitiveFile, Failure> {
        let file = out.join(format!("{}.toml", command.scenario));
        if let Some(given) = &command.primitive {
            let primitive = upload::read(given, DOING)?;
            if !file.exists() {
                // The folder tells by itself what was tried in it.
                primitive.write(&file).map_err(|error| preparation_failure(error.into()))?;
            }
            return Ok(primitive);
        }
        if file.is_file() {
            output.say(format!("the primitive is {}", file.display()));
            let primitive = upload::read(&file, DOING)?;
            if primitive.statistics.is_some() || command.figures_only || Log::is_begun(out) {
                return Ok(primitive);
            }
            // Somebody broke off while they were gathered. Without them nothing watches the trials, and none is told.
            let spinner = output.spinner("recording successful runs");
            let watched = with_statistics(command, primitive, &file, interrupt, output);
            spinner.finish_and_clear();
            return watched.map_err(preparation_failure);
        }
        if command.figures_only {
            let cause = format!("{} is not there", file.display());
            return Err(Failure::new(ErrorCode::NoResults, "experiment refused", cause)
                .help("name the primitive that was tried with `--primitive`, or the folder with `--out`"));
        }
        let spinner = output.spinner("teaching");
        let jobs =
            command.jobs.map_or_else(|| std::thread::available_parallelism().map_or(1, usize::from), usize::from);
        let teaching =
            Teaching { scenario: command.scenario, plant: command.plant, speed: command.learn_speed, number };
        let made = preparation::make(teaching, &file, jobs, interrupt, &mut |doing| {
            spinner.set_message(doing.to_owned());
        })
        .and_then(|primitive| {
            // Whatever becomes of the statistics, the primitive is worth keeping.
            primitive.write(&file)?;
            spinner.set_message("recording successful runs");
            with_statistics(command, primitive, &file, interrupt, output)
        });
        spinner.finish_and_clear();
        let primitive = made.map_err(preparation_failure)?;
        output.say(format!("taught, learned and rehearsed: {}", file.display()));
        Ok(primitive)
    }

    /// The primitive with the statistics of successful runs, written into its file.
    fn with_statistics(
        command: &Cmd,
        mut primitive: PrimitiveFile,
        file: &Path,
        interrupt: &Interrupt,
        output: Output,
    ) -> Result<PrimitiveFile, PreparationError> {
        let usual = Config::new(command.scenario, primitive.clone());
        let jobs = command.jobs.map_or(usual.jobs, usize::from);
        let config = Config { plant: command.plant, jobs, ..usual };
        let (held, of) = preparation::statistics(&config, interrupt, &mut primitive)?;
        output.say(match primitive.statistics {
            Some(_) => format!("{held} of {of} runs succeeded; what is usual was learned from them"),
            None => format!("{held} of {of} runs succeeded: too few to learn what is usual, and nothing is watched"),
        });
        primitive.write(file)?;
        Ok(primitive)
    }

    /// Writes what came out; gives it for the terminal, as data and as text.
    fn report(
        config: &Config,
        experiment: &Experiment,
        out: &Path,
        render: bool,
        output: Output,
        wall: f64,
    ) -> Result<(Tried, String), Failure> {
        let summaries = experiment.summaries(config);
        let results = experiment.results.without_wall_times();
        let comparison = Comparison::of(&results, config.scenario);
        let data = serde_json::json!({
            "experiment": config.scenario, "configuration": config.header(), "tipping_force_n": config.tipping_force(),
            "modes": summaries, "comparison": comparison, "trials": results.reports,
        });
        let file = out.join("results.json");
        save(&file, &data)?;
        let file = out.join("results.csv");
        results.write_csv(&file).map_err(|cause| unwritable(&file, cause))?;
        let figures = figures::write(config, experiment, &out.join("figures"), render)
            .map_err(|cause| Failure::new(ErrorCode::ExperimentFigure, "experiment: a figure cannot be made", cause))?;
        for figure in figures.iter().filter(|file| file.extension().is_some_and(|kind| kind == "png")) {
            output.say(format!("wrote {}", figure.display()));
        }
        output.say(format!(
            "{} trials; {wall:.0} s, {:.1} s of computing a trial",
            results.reports.len(),
            mean(experiment.results.reports.iter().filter_map(|report| report.wall_s))
        ));
        let mut text = format!("{}\n{}", map::draw(&results, &config.grid), map::table(&summaries));
        if let Some(comparison) = &comparison {
            text.push_str(&format!("\n{comparison}"));
        }
        let folder = files::text(out);
        Ok((Tried { experiment: config.scenario, folder, modes: summaries, comparison }, text))
    }

    fn mean(values: impl Iterator<Item = f64>) -> f64 {
        let (sum, count) = values.fold((0.0, 0), |(sum, count), value| (sum + value, count + 1));
        sum / f64::from(count.max(1))
    }

    /// Writes data as JSON: what was there before is whole until the new file is.
    fn save(file: &Path, data: &impl serde::Serialize) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(data)
            .map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, DOING, cause))?;
        output_file::replace(file, text.as_bytes()).map_err(|cause| unwritable(file, cause))
    }

    fn unwritable(file: &Path, cause: impl Into<Box<dyn std::error::Error + Send + Sync>>) -> Failure {
        Failure::new(ErrorCode::ResultsNotWritten, format!("experiment: {} cannot be written", file.display()), cause)
    }

    fn failure(error: ExperimentError, out: &Path) -> Failure {
        use experiment::results::ResultsError;
        let refused = "experiment refused";
        match error {
            ExperimentError::OutOfReach(_) => Failure::new(ErrorCode::OutOfReach, refused, error),
            ExperimentError::Results(ResultsError::Exists { .. }) => {
                Failure::new(ErrorCode::ResultsExist, refused, error)
            }
            ExperimentError::Results(ResultsError::OtherConfiguration { .. }) => {
                Failure::new(ErrorCode::OtherExperiment, refused, error)
                    .help(format!("choose another folder with `--out`, or remove {}", out.display()))
            }
            ExperimentError::Results(ResultsError::None { .. }) => Failure::new(ErrorCode::NoResults, refused, error),
            ExperimentError::Results(ResultsError::Line { .. }) => {
                Failure::new(ErrorCode::ResultsDamaged, refused, error)
            }
            ExperimentError::Interrupted { .. } => {
                Failure::new(ErrorCode::Interrupted, DOING, error).help("`--resume` goes on from here")
            }
            ExperimentError::Primitive(cause) => trial_failure(cause),
            ExperimentError::Trial { .. } => Failure::new(ErrorCode::TrialFailed, DOING, error),
            ExperimentError::Results(ResultsError::File { .. }) | ExperimentError::File { .. } => {
                Failure::new(ErrorCode::ResultsNotWritten, DOING, error)
            }
        }
    }

    fn trial_failure(error: TrialError) -> Failure {
        match error {
            TrialError::Simulation(error) => connection::simulation_failure(error, DOING),
            TrialError::Procedure(error) => connection::failure(error, DOING),
            error @ (TrialError::Primitive(_) | TrialError::Movement(_)) => {
                Failure::new(ErrorCode::CheckFailed, "experiment refused", error)
                    .help("`tactus check` tells what is wrong with a primitive")
            }
        }
    }

    fn preparation_failure(error: PreparationError) -> Failure {
        match error {
            PreparationError::Trial(error) => match trial_failure(error) {
                failure if failure.code != ErrorCode::Interrupted => failure,
                interrupted => interrupted.help("the same command goes on with what was taught, if it was"),
            },
            error => Failure::new(ErrorCode::NotTaught, "experiment: no primitive was made", error),
        }
    }
}
