//! Verdicts as lines for people.

use crate::entry::Entry;
use crate::run::{Judged, Verdict};

/// The lines of one scenario.
#[must_use]
pub fn lines(verdict: &Verdict, all: bool) -> String {
    let word = match (verdict.holds(), &verdict.known) {
        (true, None) => "ok",
        (false, None) => "FAIL",
        (false, Some(_)) => "known",
        (true, Some(_)) => "FAIL: a known defect is gone",
    };
    let Verdict { id, scenario, state, fault, .. } = verdict;
    let mut text = format!("{id:4} {scenario}: {state}, {fault}: {word}\n");
    for judged in verdict.figures.iter().filter(|judged| all || !judged.is_within) {
        text += &format!("       {}\n", line(judged));
    }
    for failure in &verdict.failures {
        text += &format!("       {failure}\n");
    }
    if let Some(known) = &verdict.known {
        text += &format!("       known: {known}\n");
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
