//! Carries an experiment through: trials in parallel, results written as they come.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};

use super::config::Config;
use super::grid::Cell;
use super::header::CODE;
use super::log::{LINES, Log, ResultsError};
use super::reach;
use super::results::{Key, Report, Results};
use super::statistics::Summary;
use super::trial::{self, Prepared, Trial, TrialError};
use lab::client::Interrupt;
use lab::procedure::Mode;
use lab::procedure::recording_text;

/// Why an experiment ended early.
#[derive(Debug, thiserror::Error)]
pub enum ExperimentError {
    /// Objects would stand where they cannot, or out of the arm's reach.
    #[error("{}", explain(.0))]
    OutOfReach(Vec<(Cell, reach::Unreachable)>),
    /// The primitive cannot be played.
    #[error(transparent)]
    Primitive(TrialError),
    /// A trial could not be carried through.
    #[error("trial {mode} in cell {cell}, seed {seed}: {cause}", mode = key.mode, cell = key.cell, seed = key.seed)]
    Trial {
        /// The trial.
        key: Key,
        /// Why.
        cause: TrialError,
    },
    /// Results cannot be kept.
    #[error(transparent)]
    Results(#[from] ResultsError),
    /// A file cannot be written.
    #[error("{}: {cause}", file.display())]
    File {
        /// The file.
        file: std::path::PathBuf,
        /// The operating system's reason.
        #[source]
        cause: std::io::Error,
    },
    /// The user interrupted.
    #[error("interrupted; {done} of {all} trials are kept")]
    Interrupted {
        /// Trials done.
        done: usize,
        /// Trials wanted.
        all: usize,
    },
}

fn explain(cells: &[(Cell, reach::Unreachable)]) -> String {
    let cells: Vec<String> = cells.iter().map(|(cell, reason)| format!("{cell} ({reason})")).collect();
    format!("{} of the objects cannot be reached or do not stand on the table: {}", cells.len(), cells.join(", "))
}

/// An event while an experiment runs.
#[derive(Debug)]
pub enum Progress<'a> {
    /// So many trials are wanted, and so many are there from before.
    Begin {
        /// Trials wanted.
        all: usize,
        /// Trials there from before.
        done: usize,
    },
    /// Figures are asked for of an experiment that is not through.
    Unfinished {
        /// Trials wanted.
        all: usize,
        /// Trials that are there.
        done: usize,
        /// Trials that count ([`Results::whole`]).
        counted: usize,
    },
    /// A trial ended.
    Done(&'a Report),
}

/// An experiment that was carried through.
#[derive(Debug, Clone)]
pub struct Experiment {
    /// All reports.
    pub results: Results,
    /// Trials of the first seed with everything that was seen, if the configuration asks for it; those that were
    /// there from before are missing.
    pub trials: Vec<Trial>,
    /// The configuration that all trials shared.
    pub prepared: Prepared,
}

impl Experiment {
    /// Cells in which a mode succeeded, in the mean over the seeds.
    pub fn success_count(&self, mode: Mode) -> f64 {
        self.results.success_count(mode)
    }

    /// The figures of each mode.
    pub fn summaries(&self, config: &Config) -> Vec<Summary> {
        let tipping = config.tipping_force();
        self.results.modes().into_iter().map(|mode| Summary::of(&self.results, mode, tipping)).collect()
    }
}

/// Makes what all trials share, and checks that every object can be reached; nothing is written.
///
/// # Errors
/// [`ExperimentError::Primitive`] and [`ExperimentError::OutOfReach`]
pub fn check(config: &Config) -> Result<Prepared, ExperimentError> {
    let prepared = Prepared::of(config).map_err(ExperimentError::Primitive)?;
    let cells = reach::check(config, &prepared.frame);
    if cells.is_empty() { Ok(prepared) } else { Err(ExperimentError::OutOfReach(cells)) }
}

/// Carries an experiment through. The results do not depend on the number of jobs nor on the order in which trials end.
///
/// # Errors
/// [`ExperimentError`]. What was done until then is in the folder, and [`Config::resume`] goes on from there.
pub fn run(
    config: &Config,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Experiment, ExperimentError> {
    let prepared = check(config)?;
    if config.as_it_is {
        return of_what_is_there(config, prepared, interrupt, progress);
    }
    let (mut log, mut reports) = opened(config)?;
    let keys = config.keys();
    let all = keys.len();
    let is_there = |key: &Key| reports.iter().any(|report| report.key == *key);
    let wanted: Vec<Key> = keys.iter().copied().filter(|key| !is_there(key)).collect();
    // Results of modes and seeds that are not asked for this time stay in the file, but are not counted.
    reports.retain(|report| keys.contains(&report.key));
    progress(Progress::Begin { all, done: reports.len() });
    let mut trials = Vec::new();
    let first_seed = config.seeds.first().copied();
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let failure: Mutex<Option<ExperimentError>> = Mutex::new(None);
    let fail = |error| {
        stop.store(true, Ordering::SeqCst);
        failure.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    };
    std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::sync_channel::<Trial>(config.jobs.max(1));
        for _ in 0..config.jobs.clamp(1, wanted.len().max(1)) {
            let (sender, prepared, wanted, next, stop, fail) =
                (sender.clone(), &prepared, &wanted, &next, &stop, &fail);
            scope.spawn(move || {
                while let Some(&key) = wanted.get(next.fetch_add(1, Ordering::SeqCst)) {
                    if stop.load(Ordering::SeqCst) || interrupt.is_raised() {
                        return;
                    }
                    let sent = match trial::run(config, prepared, key, interrupt) {
                        Ok(trial) => sender.send(trial).is_ok(),
                        // An interrupted trial is no failed one.
                        Err(_) if interrupt.is_raised() => false,
                        Err(cause) => return fail(ExperimentError::Trial { key, cause }),
                    };
                    if !sent {
                        return;
                    }
                }
            });
        }
        drop(sender);
        for mut trial in receiver {
            if let Err(error) = keep(config, log.as_mut(), &trial) {
                fail(error);
            }
            progress(Progress::Done(&trial.report));
            reports.push(trial.report.clone());
            if config.keep_traces && Some(trial.report.key.seed) == first_seed {
                // The telemetry is in the trace already.
                trial.telemetry = Vec::new();
                trials.push(trial);
            }
        }
    });
    if let Some(error) = failure.into_inner().unwrap_or_else(PoisonError::into_inner) {
        return Err(error);
    }
    if interrupt.is_raised() {
        return Err(ExperimentError::Interrupted { done: reports.len(), all });
    }
    let results = Results::new(reports);
    if config.keep_traces {
        repeat_representative(config, &prepared, &results, &mut trials, interrupt, [results.reports.len(), all])?;
    }
    trials.sort_by_key(|trial| trial.report.key);
    Ok(Experiment { results, trials, prepared })
}

/// The results that are in the folder of an experiment, for whoever has to prepare something that takes long before
/// [`run`]; nothing is written.
///
/// # Errors
/// [`ResultsError`] with which [`run`] would refuse them.
pub fn there(config: &Config) -> Result<Results, ResultsError> {
    let Some(folder) = config.out.as_deref().filter(|folder| Log::must_exist(folder).is_ok()) else {
        return Ok(Results::default());
    };
    let mut header = config.header();
    if config.as_it_is {
        header.described.remove(CODE);
    }
    let reports = Log::read(folder, &header)?;
    if !reports.is_empty() && !config.resume && !config.as_it_is {
        return Err(ResultsError::Exists { file: folder.join(LINES), trials: reports.len() });
    }
    Ok(Results::new(reports))
}

/// The log of results in the folder of an experiment, and what it holds; none without a folder.
fn opened(config: &Config) -> Result<(Option<Log>, Vec<Report>), ExperimentError> {
    let Some(folder) = config.out.as_deref() else { return Ok((None, Vec::new())) };
    let (log, reports) = Log::open(folder, &config.header(), config.resume)?;
    Ok((Some(log), reports))
}

/// The experiment of the results that are there. A trial that is missing would count as a failure: what is not through
/// is left out.
fn of_what_is_there(
    config: &Config,
    prepared: Prepared,
    interrupt: &Interrupt,
    progress: &mut dyn FnMut(Progress<'_>),
) -> Result<Experiment, ExperimentError> {
    let folder = config.out.clone().unwrap_or_default();
    let mut header = config.header();
    // Results may be drawn by a later program than the one that played the trials.
    header.described.remove(CODE);
    let mut there = Results::new(Log::read(&folder, &header)?);
    let keys = config.of_what_is_there(&there).keys();
    // Modes and seeds that are not asked for this time stay in the file, but are not counted.
    there.reports.retain(|report| keys.contains(&report.key));
    let (all, done) = (keys.len(), there.reports.len());
    progress(Progress::Begin { all, done });
    let results = there.whole(&keys);
    if results.reports.is_empty() {
        return Err(ResultsError::None { folder }.into());
    }
    if done < all {
        progress(Progress::Unfinished { all, done, counted: results.reports.len() });
    }
    let mut trials = Vec::new();
    if config.keep_traces {
        repeat_representative(config, &prepared, &results, &mut trials, interrupt, [done, all])?;
    }
    Ok(Experiment { results, trials, prepared })
}

/// Writes the telemetry of a trial where recordings are kept, and then the trial into the log of results: what is in
/// the log is not tried again, and would never get its recording.
fn keep(config: &Config, log: Option<&mut Log>, trial: &Trial) -> Result<(), ExperimentError> {
    config.out.as_deref().filter(|_| config.keep_recordings).map_or(Ok(()), |folder| record(folder, trial))?;
    log.map_or(Ok(()), |log| log.add(&trial.report).map_err(ExperimentError::from))
}

/// Repeats the trials of the representative cell that have left no trace because their results were there from before:
/// the same key, the same trial. So many trials of all that are wanted are kept by then.
fn repeat_representative(
    config: &Config,
    prepared: &Prepared,
    results: &Results,
    trials: &mut Vec<Trial>,
    interrupt: &Interrupt,
    [done, all]: [usize; 2],
) -> Result<(), ExperimentError> {
    for key in representative(results) {
        if !trials.iter().any(|trial| trial.report.key == key) {
            let repeated = trial::run(config, prepared, key, interrupt);
            trials.push(repeated.map_err(|cause| match interrupt.is_raised() {
                // An interrupted trial is no failed one.
                true => ExperimentError::Interrupted { done, all },
                false => ExperimentError::Trial { key, cause },
            })?);
        }
    }
    Ok(())
}

/// One trial of each mode, first seed, in the cell that tells most: the adapted one held the object and another mode
/// did not; the middle of all such cells by distance, neither the easiest nor the hardest.
pub(super) fn representative(results: &Results) -> Vec<Key> {
    let seed = results.seeds().first().copied();
    let reports = || results.reports.iter().filter(|report| Some(report.key.seed) == seed);
    let held = |index: usize, mode: Mode| {
        let report = reports().find(|report| report.key.index == index && report.key.mode == mode);
        report.map(|report| report.outcome.is_success())
    };
    let mut cells: Vec<(f64, usize)> = reports().map(|report| (report.key.cell.distance(), report.key.index)).collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
    cells.dedup();
    let tells = |index: usize| {
        let others = [Mode::OpenLoop, Mode::RigidFingers];
        held(index, Mode::Adaptive) == Some(true) && others.iter().any(|mode| held(index, *mode) == Some(false))
    };
    let representative: Vec<usize> = cells.iter().map(|(_, index)| *index).filter(|index| tells(*index)).collect();
    let chosen = representative.get(representative.len() / 2).or(cells.get(cells.len() / 2).map(|(_, index)| index));
    let of_cell = |index: usize| reports().filter(move |report| report.key.index == index).map(|report| report.key);
    chosen.map(|index| of_cell(*index).collect()).unwrap_or_default()
}

/// Writes the telemetry of a trial into the folder `recordings`, in the layout of every recording.
fn record(folder: &Path, trial: &Trial) -> Result<(), ExperimentError> {
    let folder = folder.join("recordings");
    let key = &trial.report.key;
    let file = folder.join(format!("cell{:02}-{}-seed{}.csv", key.index, key.mode, key.seed));
    let failed = |cause| ExperimentError::File { file: file.clone(), cause };
    std::fs::create_dir_all(&folder).map_err(failed)?;
    let notes = format!(
        "Tactus recording of an experiment, cell {}, mode {}, seed {}: {}",
        key.cell, key.mode, key.seed, trial.report.outcome
    );
    let text = recording_text(&trial.telemetry, &notes).map_err(failed)?;
    lab::output_file::replace(&file, text.as_ref()).map_err(|error| failed(error.into()))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;
    use std::path::Path;

    use control::Payload;
    use control::model::WeightCorrection;
    use lab::demonstration::Recording;
    use lab::learn::{LearnOptions, learn};
    use sim::world::mujoco::Scene;

    use super::*;
    use crate::fixtures;
    use crate::observation::Milestones;
    use crate::scenario::Scenario;

    fn config() -> Config {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/reach.csv");
        let recording = Recording::read(&file).unwrap();
        let primitive = learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive;
        Config::new(Scenario::Flashlight, primitive)
    }

    /// The change that makes it fail: what `run` would refuse is not looked at before arms are weighed for it.
    #[test]
    fn results_that_cannot_be_gone_on_with_are_refused_before_anything_is_prepared() {
        let folder = tempfile::tempdir().unwrap();
        let config = Config { out: Some(folder.path().to_owned()), ..config() };
        assert_eq!(there(&config).unwrap(), Results::default());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0, "nothing is written");
        let (mut log, _) = Log::open(folder.path(), &config.header(), false).unwrap();
        assert_eq!(there(&config).unwrap(), Results::default());
        let report = &fixtures::results(&[1]).reports[0];
        log.add(report).unwrap();
        assert!(matches!(there(&config), Err(ResultsError::Exists { trials: 1, .. })));
        for config in [Config { resume: true, ..config.clone() }, Config { as_it_is: true, ..config.clone() }] {
            assert_eq!(there(&config).unwrap().reports, std::slice::from_ref(report));
        }
        let weights = BTreeMap::from([(1, WeightCorrection::none(Payload::SensorAndHand))]);
        let weighed = there(&Config { weights, resume: true, ..config });
        assert!(matches!(weighed, Err(ResultsError::OtherConfiguration { .. })), "{weighed:?}");
    }

    /// A full disk, or a file in the place of the folder: the trial is tried again, and has its recording then.
    ///
    /// The change that makes it fail: the line in the log comes first.
    #[test]
    fn a_trial_whose_recording_cannot_be_kept_is_not_in_the_log() {
        let folder = tempfile::tempdir().unwrap();
        let config = Config { out: Some(folder.path().to_owned()), keep_recordings: true, ..config() };
        std::fs::write(folder.path().join("recordings"), "").unwrap();
        let trial = Trial {
            report: fixtures::results(&[1]).reports[0].clone(),
            trace: Default::default(),
            telemetry: Vec::new(),
            observation: Default::default(),
            snapshots: Vec::new(),
            scene: Scene::EMPTY,
            marks: Milestones { run: 0.0, lift: 0.0, hold: 0.0 },
        };
        let (mut log, _) = Log::open(folder.path(), &config.header(), false).unwrap();
        let kept = keep(&config, Some(&mut log), &trial);
        assert!(matches!(kept, Err(ExperimentError::File { .. })), "{kept:?}");
        drop(log);
        let (_log, reports) = Log::open(folder.path(), &config.header(), true).unwrap();
        assert_eq!(reports, []);
    }

    /// All trials were through, and the experiment ended as if one of them could not be carried through.
    ///
    /// The change that makes it fail: whatever ends a repeated trial is a failure of it.
    #[test]
    fn who_interrupts_the_repetition_for_a_figure_is_told_what_is_kept() {
        let config = config();
        let (prepared, results) = (Prepared::of(&config).unwrap(), fixtures::results(&[1]));
        let interrupt = Interrupt::never();
        interrupt.raise();
        let mut trials = Vec::new();
        let ended = repeat_representative(&config, &prepared, &results, &mut trials, &interrupt, [144, 144]);
        assert!(matches!(ended, Err(ExperimentError::Interrupted { done: 144, all: 144 })), "{ended:?}");
    }
}
