//! Verdicts as lines for people.

use std::collections::BTreeMap;

use serde::Serialize;

use crate::endurance::Process;
use crate::entry::{Entry, Scenario};
use crate::run::{Judged, Verdict};
use crate::storm::Outcome;

/// The lines of one scenario.
#[must_use]
pub fn lines(verdict: &Verdict, all: bool) -> String {
    let word = match (verdict.is_as_told(), verdict.holds()) {
        (true, true) => "ok",
        (true, false) => "known",
        (false, false) => "FAIL",
        (false, true) => "FAIL: a known defect is gone",
    };
    let Verdict { id, scenario, state, fault, .. } = verdict;
    let mut text = format!("{id:4} {scenario}: {state}, {fault}: {word}\n");
    for judged in verdict.figures.iter().filter(|judged| all || !judged.is_within) {
        text += &format!("       {}\n", line(judged));
    }
    for failure in &verdict.failures {
        text += &format!("       {failure}\n");
    }
    if let Some(time) = verdict.failed_at {
        text += &format!("       with the last fault at {time:.4} s\n");
    }
    if let Some(known) = &verdict.known {
        text += &format!("       known: {}\n", known.defect);
    }
    text
}

fn line(judged: &Judged) -> String {
    let Judged { figure, bar, unit, .. } = judged;
    let value = judged.value.map_or("none".to_owned(), |value| format!("{value:.3}"));
    let sign = if judged.is_least { ">=" } else { "<=" };
    let word = if judged.is_within { "ok" } else { "FAIL" };
    format!("{figure:26} {value:>9} {sign} {bar} {unit} {word}")
}

/// The line of an entry without scenarios.
#[must_use]
pub fn elsewhere(entry: &Entry) -> String {
    let tests = if entry.test.is_empty() { String::new() } else { format!("{} tests", entry.test.len()) };
    let hardware = entry.hardware.as_ref().map_or(String::new(), |words| format!("hardware: {words}"));
    let parts: Vec<&str> = [tests.as_str(), hardware.as_str()].into_iter().filter(|part| !part.is_empty()).collect();
    let parts = if parts.is_empty() { "nothing shows it yet".to_owned() } else { parts.join("; ") };
    format!("{:4} {}: {parts}\n", entry.id, entry.title)
}

/// A storm: its faults and orders, what came of it, and with `whole` its scenario for a file of `tests/faults`.
#[must_use]
pub fn storm(outcome: &Outcome, whole: bool) -> String {
    let mut text = lines(&outcome.verdict, whole);
    if whole {
        #[derive(Serialize)]
        struct File<'a> {
            scenario: [&'a Scenario; 1],
        }
        text += &toml::to_string(&File { scenario: [&outcome.scenario] }).unwrap_or_default();
    } else {
        text += &format!("       {:?}\n", outcome.scenario.from);
        let faults = outcome
            .scenario
            .inject
            .iter()
            .map(|fault| format!("{:.3} s, {:.3} s: {:?}", fault.at, fault.lasts, fault.what));
        let orders = outcome.scenario.order.iter().map(|order| format!("{:.3} s: {:?}", order.at, order.give));
        faults.chain(orders).for_each(|line| text += &format!("       {line}\n"));
    }
    text
}

/// A course of endurance so far: hours, rounds, failures, the process.
#[must_use]
pub fn endurance(hours: f64, rounds: u64, failed: usize, process: Process) -> String {
    let Process { memory, descriptors } = process;
    format!("{hours:6.2} h, {rounds} rounds, {failed} failed; {memory} kiB, {descriptors} descriptors")
}

/// Sums over storms: how many, how they ended, how many failed, the worst of each figure that has a bar.
#[must_use]
pub fn storms(outcomes: &[Outcome]) -> String {
    let mut ends: BTreeMap<String, usize> = BTreeMap::new();
    let mut worst: BTreeMap<&str, (f64, u64)> = BTreeMap::new();
    for Outcome { seed, verdict, .. } in outcomes {
        *ends.entry(format!("{} ({})", verdict.state, verdict.fault)).or_default() += 1;
        for judged in verdict.figures.iter().filter(|judged| judged.bar.is_finite()) {
            let value = judged.value.unwrap_or(f64::INFINITY);
            let most = worst.entry(judged.figure).or_insert((value, *seed));
            if value > most.0 {
                *most = (value, *seed);
            }
        }
    }
    let failed = outcomes.iter().filter(|outcome| !outcome.verdict.holds()).count();
    let mut text = format!("{} storms, {failed} failed\n", outcomes.len());
    ends.iter().for_each(|(end, count)| text += &format!("{count:6} end in {end}\n"));
    worst.iter().for_each(|(figure, (value, seed))| text += &format!("{value:9.3} worst {figure} (seed {seed})\n"));
    text
}
