//! `faults [--json] [--all] [--shift SEED] [--device sim:|board:] [ID...]`: runs the fault catalogue, or some of it.
//! `faults storm [--wide] [--runs N] [--seed S]`: runs storms of random faults, the seeds in a row from S on.
//! `faults endurance [--hours H] [--seed S]`: the same on one arm in one process, for hours of simulated time.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use faults::entry::{Entry, Scenario};
use faults::run::{self, Verdict};
use faults::{catalogue, endurance, report, storm};
use lab::transport::SimulatorKind;

/// Scripts, relative to the root of the repository.
const FOLDER: &str = "tests/faults";

/// The catalogue, relative to the root of the repository.
const CATALOGUE: &str = "docs/faults.md";

fn main() -> ExitCode {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let is_good = match words.split_first() {
        Some((first, rest)) if first == "storm" => storms(rest),
        Some((first, rest)) if first == "endurance" => endures(rest),
        _ => Wanted::parse(&words).and_then(|wanted| go(&wanted)),
    };
    match is_good {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("faults: {error}");
            ExitCode::FAILURE
        }
    }
}

/// Runs storms; one that fails, or that is alone, is told with its seed and as a scenario.
fn storms(words: &[String]) -> Result<bool, Box<dyn std::error::Error>> {
    let (mut runs, mut first) = (300_u64, 1_u64);
    let wide = words.iter().any(|word| word == "--wide");
    let words: Vec<&String> = words.iter().filter(|word| *word != "--wide").collect();
    for pair in words.chunks(2) {
        match pair {
            [flag, number] if *flag == "--runs" => runs = number.parse()?,
            [flag, number] if *flag == "--seed" => first = number.parse()?,
            _ => return Err(format!("unknown: {pair:?}").into()),
        }
    }
    let seeds: Vec<u64> = (first..first.saturating_add(runs)).collect();
    let mut outcomes = on_every_processor(&seeds, |seed| {
        let outcome = storm::run(*seed, wide);
        if runs == 1 || !outcome.verdict.holds() {
            print!("{}", report::storm(&outcome, runs == 1));
        }
        outcome
    });
    outcomes.sort_by_key(|outcome| outcome.seed);
    let failed: Vec<u64> =
        outcomes.iter().filter(|outcome| !outcome.verdict.holds()).map(|outcome| outcome.seed).collect();
    eprintln!("{}", report::storms(&outcomes));
    if !failed.is_empty() {
        eprintln!(
            "failed: {failed:?}; again: cargo xtask faults storm{} --runs 1 --seed {}",
            if wide { " --wide" } else { "" },
            failed[0]
        );
    }
    Ok(failed.is_empty())
}

/// Runs a course of endurance; tells how it goes about every tenth of it.
fn endures(words: &[String]) -> Result<bool, Box<dyn std::error::Error>> {
    let (mut hours, mut first) = (0.25, 1_u64);
    for pair in words.chunks(2) {
        match pair {
            [flag, number] if flag == "--hours" => hours = number.parse()?,
            [flag, number] if flag == "--seed" => first = number.parse()?,
            _ => return Err(format!("unknown: {}", pair.join(" ")).into()),
        }
    }
    let mut next = 0.0;
    let course = endurance::run(hours, first, |now, rounds, failed, process| {
        if now >= next {
            next += hours / 10.0;
            eprintln!("{}", report::endurance(now, rounds, failed, process));
        }
    });
    let course = course.map_err(|error| error.to_string())?;
    course.failed.iter().for_each(|verdict| print!("{}", report::lines(verdict, false)));
    eprintln!("{}", report::endurance(course.hours, course.rounds, course.failed.len(), course.process[1]));
    if !course.is_constant() {
        eprintln!("memory or descriptors have grown: {:?}", course.process);
    }
    Ok(course.holds())
}

/// The words of the command line.
struct Wanted {
    /// Entries; none: all.
    ids: Vec<String>,
    json: bool,
    all: bool,
    /// Every scenario is shifted by what this seed draws.
    shift: Option<u64>,
    /// The engine of the co-controller's application.
    kind: SimulatorKind,
}

impl Wanted {
    fn parse(words: &[String]) -> Result<Self, Box<dyn std::error::Error>> {
        let kind = SimulatorKind::InProcess;
        let mut wanted = Self { ids: Vec::new(), json: false, all: false, shift: None, kind };
        let mut words = words.iter().map(String::as_str);
        while let Some(word) = words.next() {
            match word {
                "--json" => wanted.json = true,
                "--all" => wanted.all = true,
                "--shift" => {
                    let seed = words.next().ok_or("--shift needs a seed")?;
                    wanted.shift = Some(seed.parse().map_err(|cause| format!("--shift {seed}: {cause}"))?);
                }
                "--device" => {
                    wanted.kind = match words.next() {
                        Some("sil:") => SimulatorKind::InProcess,
                        Some("sim:") => SimulatorKind::Qemu,
                        Some("board:") => SimulatorKind::Board,
                        other => {
                            let other = other.unwrap_or("nothing");
                            return Err(format!("--device is sil:, sim: or board:, not {other}").into());
                        }
                    };
                }
                flag if flag.starts_with('-') => return Err(format!("unknown: {flag}").into()),
                id => wanted.ids.push(id.to_uppercase()),
            }
        }
        Ok(wanted)
    }

    /// True for a scenario that is to run. With an image: one that is marked for it, or that can run there if its
    /// entry was named.
    fn has(&self, entry: &Entry, scenario: &Scenario) -> bool {
        let is_in_process = self.kind == SimulatorKind::InProcess;
        match self.ids.is_empty() {
            true => is_in_process || scenario.firmware,
            false => self.ids.contains(&entry.id) && (is_in_process || !scenario.is_of_the_port()),
        }
    }
}

fn go(wanted: &Wanted) -> Result<bool, Box<dyn std::error::Error>> {
    let &Wanted { ref ids, json, all, shift, kind } = wanted;
    let mut entries = Entry::all(Path::new(FOLDER))?;
    let differences = catalogue::differences(&entries, &std::fs::read_to_string(CATALOGUE)?);
    if let Some(seed) = shift {
        let scenarios = entries.iter_mut().flat_map(|entry| &mut entry.scenario);
        scenarios.for_each(|scenario| *scenario = scenario.shifted(seed));
    }
    if let Some(id) = ids.iter().find(|id| entries.iter().all(|entry| entry.id != **id)) {
        return Err(format!("there is no entry {id}").into());
    }
    let named: Vec<&Entry> = entries.iter().filter(|entry| ids.is_empty() || ids.contains(&entry.id)).collect();
    if !json && kind == SimulatorKind::InProcess {
        named.iter().filter(|entry| entry.scenario.is_empty()).for_each(|entry| print!("{}", report::elsewhere(entry)));
    }
    let scenarios: Vec<(&Entry, &Scenario)> = named
        .iter()
        .flat_map(|entry| entry.scenario.iter().map(move |scenario| (*entry, scenario)))
        .filter(|(entry, scenario)| wanted.has(entry, scenario))
        .collect();
    let verdicts = run_all(&scenarios, kind, |verdict| {
        if !json {
            print!("{}", report::lines(verdict, all))
        }
    });
    if json {
        println!("{}", serde_json::to_string_pretty(&verdicts)?);
    }
    let failed = verdicts.iter().filter(|verdict| !verdict.is_as_told()).count();
    let known = verdicts.iter().filter(|verdict| verdict.known.is_some()).count();
    eprintln!(
        "{} entries, {} scenarios: {} within their bars, {known} known defects, {failed} failed",
        named.len(),
        verdicts.len(),
        verdicts.iter().filter(|verdict| verdict.holds()).count(),
    );
    // Last, because hundreds of lines are above it.
    differences.iter().for_each(|difference| eprintln!("{CATALOGUE} and the scripts differ: {difference}"));
    Ok(differences.is_empty() && failed == 0)
}

/// Runs the scenarios; the verdicts in the order of the scenarios.
fn run_all(scenarios: &[(&Entry, &Scenario)], kind: SimulatorKind, tell: impl Fn(&Verdict) + Sync) -> Vec<Verdict> {
    let mut verdicts = on_every_processor(scenarios, |(entry, scenario)| {
        let verdict = run::run(entry, scenario, kind);
        tell(&verdict);
        verdict
    });
    let place = |verdict: &Verdict| {
        scenarios.iter().position(|(entry, scenario)| entry.id == verdict.id && scenario.name == verdict.scenario)
    };
    verdicts.sort_by_key(place);
    verdicts
}

/// Does a piece of work for every item, on every processor; the results in the order in which they came.
fn on_every_processor<I: Sync, O: Send>(items: &[I], work: impl Fn(&I) -> O + Sync) -> Vec<O> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some(item) = items.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = work(item);
                    if let Ok(mut done) = done.lock() {
                        done.push(result);
                    }
                }
            });
        }
    });
    done.into_inner().unwrap_or_default()
}
