//! The experiments themselves: a primitive, its trials, and what they say together.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use super::failures::{failure, preparation_failure, trial_failure, unwritable};
use super::refusal::{self, DOING, REFUSED};
use super::setup::{chosen, configuration};
use super::{Cmd, ErrorCode, Failure, Global, Lifted, Studied, Tried};
use crate::cmd::{Output, connection, files, upload};
use control::Payload;
use control::model::WeightCorrection;
use experiment::calibrated::{Calibrated, CalibrationError};
use experiment::lift::{self, Case};
use experiment::sweep::{self, Point};
use experiment::{Comparison, Config, Experiment, Progress, Scenario, figures, map};
use lab::client::Interrupt;
use lab::output_file;

pub(super) fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let interrupt = connection::interrupt();
    let out = command.out.clone().unwrap_or_else(|| command.scenario.name().into());
    if command.demonstrations.is_some() || command.sweep.is_some() {
        return study(command, global, &out, &interrupt, output);
    }
    let mut config = configuration(command, global, &out, 1, &interrupt, output)?;
    if command.calibrated || chosen(command, &out)?.weighed {
        config.weights = calibrate(command, &config, &out, &interrupt, output)?;
    }
    if config.scenario == Scenario::Lift {
        return lift(command, &config, &interrupt, output);
    }
    let (experiment, wall) = carry(command, &config, &interrupt, output)?;
    let (data, text) = report(&config, &experiment, &out, command.render, output, wall)?;
    output.result(&data, text)
}

/// Weighs the arms that were not weighed here before; their weights by seed. For figures none is weighed.
fn calibrate(
    command: &Cmd,
    config: &Config,
    out: &Path,
    interrupt: &Interrupt,
    output: Output,
) -> Result<BTreeMap<u64, WeightCorrection>, Failure> {
    let file = out.join("calibrated.json");
    // What is refused is refused before minutes of weighing, and before their result takes the place of another.
    let seeds = seeds_there(command, config)?;
    let mut calibrated = Calibrated::read(&file, config);
    let found = if command.figures_only {
        calibrated.must_have(&seeds)
    } else {
        let spinner = output.spinner("weighing the arms");
        let completed = calibrated.complete(config, interrupt);
        spinner.finish_and_clear();
        // The arms that were weighed are worth keeping, whatever became of the others. Where none was, the file may
        // hold those of another plant.
        if !calibrated.arms.is_empty() {
            let data = serde_json::to_value(&calibrated)
                .map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, DOING, cause))?;
            save(&file, &data)?;
        }
        completed
    };
    found.map_err(|error| match error {
        CalibrationError::Tour { cause, .. } => trial_failure(cause),
        CalibrationError::Regression { .. } => Failure::new(ErrorCode::WeightNotAccepted, DOING, error),
        CalibrationError::Lost { .. } => {
            let cause = format!("{}: {error}", file.display());
            Failure::new(ErrorCode::ResultsDamaged, REFUSED, cause)
                .help("the experiment with `--calibrated --resume` weighs its arms anew; its trials are kept")
        }
    })?;
    output.say(calibrated.table().to_string());
    calibrated.weights().map_err(|error| Failure::new(ErrorCode::WeightNotAccepted, DOING, error))
}

/// The seeds of the results that are there and asked for. Results that could not be gone on with are refused.
fn seeds_there(command: &Cmd, config: &Config) -> Result<Vec<u64>, Failure> {
    // Which weights it will be counts for nothing: the results tell only that their arms were weighed.
    let none = WeightCorrection::none(Payload::SensorAndHand);
    let mut parts = vec![Config { weights: BTreeMap::from([(0, none)]), ..config.clone() }];
    if config.scenario == Scenario::Lift {
        let weighed = parts.remove(0);
        for case in Case::ALL {
            let shared = rehearsed_file(config, case);
            if shared.is_file() {
                parts.push(case.config(&weighed, upload::read(&shared, DOING)?));
            }
        }
    }
    let mut seeds = Vec::new();
    for part in &parts {
        let there = experiment::there(part).map_err(|error| refusal::of(error, command))?;
        seeds.extend(there.seeds());
    }
    seeds.retain(|seed| config.seeds.is_empty() || config.seeds.contains(seed));
    Ok(seeds)
}

/// File of the primitive that is rehearsed for a case of the experiment with a weight.
fn rehearsed_file(config: &Config, case: Case) -> PathBuf {
    let out = config.out.clone().unwrap_or_default();
    out.join(format!("{}-{}.toml", config.scenario, case.rehearsed_as().name()))
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
        let folder =
            if demonstrations > 1 || number > 1 { out.join(format!("demonstration-{number}")) } else { out.to_owned() };
        configs.push(configuration(command, global, &folder, number, interrupt, output)?);
    }
    let name = command.sweep.as_ref().map(|sweep| sweep.name.as_str());
    let values = command.sweep.as_ref().map_or_else(|| vec![None], |s| s.values.iter().copied().map(Some).collect());
    let mut points: Vec<Point> = Vec::new();
    for value in values {
        let mut point = Point::new(value);
        for config in &configs {
            let mut config = config.clone();
            if let (Some(sweep), Some(value)) = (&command.sweep, value) {
                config.variation = sweep.variation(config.variation, value);
                config.out = config.out.map(|out| out.join(format!("{}-{value}", sweep.name)));
            }
            let (experiment, wall) = carry(command, &config, interrupt, output)?;
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
        figures::curve::draw(points, name, &title)
            .write(out, "sweep")
            .map_err(|cause| Failure::new(ErrorCode::ExperimentFigure, "experiment: a figure cannot be made", cause))?;
        output.say(format!("wrote {}", out.join("sweep.png").display()));
    }
    output.result(&data, sweep::table(points, name))
}

/// Carries all trials through with a progress bar; gives the time it took as well, s.
fn carry(command: &Cmd, config: &Config, interrupt: &Interrupt, output: Output) -> Result<(Experiment, f64), Failure> {
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
    let experiment = carried.map_err(|error| failure(error, command))?;
    Ok((experiment, started.elapsed().as_secs_f64()))
}

/// The three cases of the experiment with a weight.
fn lift(command: &Cmd, config: &Config, interrupt: &Interrupt, output: Output) -> Result<(), Failure> {
    let out = config.out.clone().unwrap_or_default();
    let mut rows = Vec::new();
    let mut texts = Vec::new();
    let usual = config.variation.mass;
    for case in Case::ALL {
        let shared = rehearsed_file(config, case);
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
        files::create_folder(&folder, DOING)?;
        let (experiment, wall) = carry(command, &config, interrupt, output)?;
        rows.extend(lift::carried(case, &experiment.results, usual));
        let (_, text) = report(&config, &experiment, &folder, command.render, output, wall)?;
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
    let text =
        serde_json::to_string_pretty(data).map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, DOING, cause))?;
    output_file::replace(file, text.as_bytes()).map_err(|cause| unwritable(file, cause))
}

#[cfg(test)]
mod tests {
    use clap::Parser;
    use experiment::results::{Key, Report};
    use experiment::{Cell, Mode, Outcome};
    use lab::demonstration::Recording;
    use lab::learn::{LearnOptions, learn};

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        command: Cmd,
    }

    fn config(out: &Path) -> Config {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/reach.csv");
        let recording = Recording::read(&file).unwrap();
        let primitive = learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive;
        Config { out: Some(out.to_owned()), ..Config::new(Scenario::Flashlight, primitive) }
    }

    /// The code with which weights are refused, of results whose arms `are_weighed`; their file stays as it is.
    #[track_caller]
    fn refused(line: &str, are_weighed: bool, trials: Option<&str>) -> String {
        let folder = tempfile::tempdir().unwrap();
        let (out, file) = (folder.path(), folder.path().join("calibrated.json"));
        std::fs::write(&file, "minutes of weighing").unwrap();
        let command = Line::try_parse_from(line.split(' ')).unwrap().command;
        let mut config = config(out);
        if are_weighed {
            config.weights = BTreeMap::from([(7, WeightCorrection::none(Payload::SensorAndHand))]);
        }
        if let Some(trials) = trials {
            let header = serde_json::to_string(&config.header()).unwrap();
            std::fs::write(out.join("results.jsonl"), format!("{header}\n{trials}")).unwrap();
        }
        (config.resume, config.as_it_is, config.weights) = (command.resume, command.figures_only, BTreeMap::new());
        config.seeds = if command.figures_only { vec![] } else { vec![1] };
        let interrupt = Interrupt::never();
        // Should it come to a weighing, that ends at once.
        interrupt.raise();
        let outcome = calibrate(&command, &config, out, &interrupt, Output { quiet: true, ..Output::default() });
        assert_eq!(std::fs::read(&file).unwrap(), b"minutes of weighing", "{outcome:?}");
        outcome.unwrap_err().code.to_string()
    }

    /// The arms were weighed for minutes, their file took the place of the one that was there, and then the experiment
    /// was refused; the figures of a damaged file replaced it by an empty one.
    ///
    /// The changes that make it fail: `calibrate` without `seeds_there`, or figures that weigh.
    #[test]
    fn what_cannot_be_gone_on_with_is_refused_before_arms_are_weighed_and_figures_weigh_none() {
        assert_eq!(refused("experiment flashlight --calibrated --resume", false, Some("")), "E404");
        let report = Report {
            key: Key { index: 0, cell: Cell::default(), mode: Mode::OpenLoop, seed: 1 },
            trial_seed: 1,
            object: [0.0; 2],
            outcome: Outcome::Held,
            measures: Default::default(),
            adaptation_m: 0.0,
            adaptation_deg: 0.0,
            sag_m: None,
            free_sag_m: None,
            surprise: None,
            path: Default::default(),
            virtual_s: 1.0,
            wall_s: None,
        };
        let report = format!("{}\n", serde_json::to_string(&report).unwrap());
        assert_eq!(refused("experiment flashlight --calibrated", true, Some(&report)), "E207");
        assert_eq!(refused("experiment flashlight --figures-only", true, Some(&report)), "E661");
        // Interrupted before the first arm was weighed.
        assert_eq!(refused("experiment flashlight --calibrated", false, None), "E130");
    }
}
