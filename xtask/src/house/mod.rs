//! The house rules that no compiler checks: module circles, sizes, old words, arrows between crates, files of tests.
//!
//! Each rule has a file. `cargo xtask house` prints all findings by rule and file.

mod arrows;
mod circles;
mod modules;
mod programs;
mod sizes;
#[cfg(test)]
mod tests;
mod words;

use anyhow::{Result, bail};

use crate::{files, shell};

/// A violation of a rule.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Finding {
    /// File, with a line where there is one.
    place: String,
    /// The violation, and the remedy where it is not obvious.
    text: String,
}

impl Finding {
    fn new(place: impl Into<String>, text: impl Into<String>) -> Self {
        Self { place: place.into(), text: text.into() }
    }

    fn at(path: &str, line: usize, text: impl Into<String>) -> Self {
        Self::new(format!("{path}:{line}"), text)
    }
}

/// A rule: its name, and the function that finds its violations.
type Rule = (&'static str, fn(&[(String, String)]) -> Result<Vec<Finding>>);

/// All rules.
const RULES: [Rule; 5] = [
    ("circles", |files| Ok(circles::check(files))),
    ("sizes", |files| Ok(sizes::check(files))),
    ("words", |files| Ok(words::check(files))),
    ("arrows", arrows::check),
    ("programs", |files| Ok(programs::check(files))),
];

/// Checks one rule, or all of them without a name.
///
/// # Errors
/// If a rule is violated, after all violations were printed; if there is no such rule.
pub(crate) fn run(only: Option<&str>) -> Result<()> {
    if let Some(name) = only.filter(|name| RULES.iter().all(|(known, _)| known != name)) {
        bail!("no rule '{name}'; there are: {}", RULES.map(|(known, _)| known).join(", "));
    }
    shell::step("house rules: module circles, sizes, old words, arrows between crates, files of tests");
    let files = files::all(|path| !path.ends_with(".csv") && !path.ends_with(".lock"))?;
    let mut count = 0;
    for (name, check) in RULES.iter().filter(|(name, _)| only.is_none_or(|only| only == *name)) {
        let mut found = check(&files)?;
        found.sort();
        count += found.len();
        for finding in &found {
            shell::note(&format!("{name}: {}: {}", finding.place, finding.text));
        }
    }
    if count > 0 {
        bail!("{count} violations of the house rules");
    }
    Ok(())
}
