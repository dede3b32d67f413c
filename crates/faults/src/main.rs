//! `faults [--json] [--all] [--folder FOLDER] [ID...]`: runs the fault catalogue, or some of it.

use std::path::Path;
use std::process::ExitCode;
use std::sync::Mutex;
use std::sync::atomic::{AtomicUsize, Ordering};

use faults::entry::{Entry, Scenario};
use faults::run::{self, Verdict};
use faults::{catalogue, report};

/// Scripts, relative to the root of the repository.
const FOLDER: &str = "tests/faults";

/// The catalogue, relative to the root of the repository.
const CATALOGUE: &str = "docs/faults.md";

fn main() -> ExitCode {
    let (mut json, mut all, mut ids) = (false, false, Vec::new());
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--json" => json = true,
            "--all" => all = true,
            id => ids.push(id.to_uppercase()),
        }
    }
    match go(&ids, json, all) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("faults: {error}");
            ExitCode::FAILURE
        }
    }
}

fn go(ids: &[String], json: bool, all: bool) -> Result<bool, Box<dyn std::error::Error>> {
    let entries = Entry::all(Path::new(FOLDER))?;
    let mut is_good = true;
    for difference in catalogue::differences(&entries, &std::fs::read_to_string(CATALOGUE)?) {
        eprintln!("{difference}");
        is_good = false;
    }
    if let Some(id) = ids.iter().find(|id| entries.iter().all(|entry| entry.id != **id)) {
        return Err(format!("there is no entry {id}").into());
    }
    let wanted: Vec<&Entry> = entries.iter().filter(|entry| ids.is_empty() || ids.contains(&entry.id)).collect();
    if !json {
        wanted
            .iter()
            .filter(|entry| entry.scenario.is_empty())
            .for_each(|entry| print!("{}", report::elsewhere(entry)));
    }
    let scenarios: Vec<(&Entry, &Scenario)> =
        wanted.iter().flat_map(|entry| entry.scenario.iter().map(move |scenario| (*entry, scenario))).collect();
    let verdicts = run_all(&scenarios, |verdict| {
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
        wanted.len(),
        verdicts.len(),
        verdicts.iter().filter(|verdict| verdict.holds()).count(),
    );
    Ok(is_good && failed == 0)
}

/// Runs the scenarios on every processor; the verdicts in the order of the scenarios.
fn run_all(scenarios: &[(&Entry, &Scenario)], tell: impl Fn(&Verdict) + Sync) -> Vec<Verdict> {
    let next = AtomicUsize::new(0);
    let done = Mutex::new(Vec::new());
    std::thread::scope(|scope| {
        for _ in 0..std::thread::available_parallelism().map_or(1, usize::from) {
            scope.spawn(|| {
                while let Some((entry, scenario)) = scenarios.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let verdict = run::run(entry, scenario);
                    tell(&verdict);
                    if let Ok(mut done) = done.lock() {
                        done.push(verdict);
                    }
                }
            });
        }
    });
    let mut verdicts = done.into_inner().unwrap_or_default();
    let place = |verdict: &Verdict| {
        scenarios.iter().position(|(entry, scenario)| entry.id == verdict.id && scenario.name == verdict.scenario)
    };
    verdicts.sort_by_key(place);
    verdicts
}
