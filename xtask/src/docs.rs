//! The words of the repository: no dead link, path, decision number, test name or fault identifier.
//!
//! Checked in every tracked or new file. Markdown: links with their anchors, paths and test names in code spans. All
//! text: paths below `docs/`, numbers of decisions, identifiers of `docs/faults.md`. Rust comments: paths below any
//! folder of the root. Every document is in the index of the documents, and every test that begins with a fault
//! identifier is in the entry of that fault: its row, or the section that the row leads to.

mod catalogue;
mod facts;
mod scan;
#[cfg(test)]
mod tests;

use std::collections::BTreeSet;

use anyhow::{Result, bail};

use crate::{files, mutants, shell};
use facts::Facts;

/// Files whose text is not ours or not prose: licences, lock files, and the made-up files of the tests of this check.
const NOT_READ: [&str; 5] =
    ["LICENSE-", "Cargo.lock", "emulator/Cargo.lock", "docs/images/", "xtask/src/docs/tests.rs"];
/// The catalogue of faults, whose rows define the identifiers.
const CATALOGUE: &str = "docs/faults.md";
/// The index of the documents.
const INDEX: &str = "docs/README.md";

/// A word that points to nothing.
#[derive(Debug, PartialEq, Eq)]
struct Dead {
    /// File, line and what is wrong.
    text: String,
}

/// Checks all files; the error lists every dead word with its place.
pub(crate) fn run() -> Result<()> {
    shell::step("documents: links, paths, decisions, test names, fault identifiers, the list of mutants");
    mutants::check()?;
    let is_prose = |path: &str| !NOT_READ.iter().any(|start| path.starts_with(start)) && !path.ends_with(".csv");
    let files = files::all(is_prose)?;
    let dead = check(&files);
    if dead.is_empty() {
        return Ok(());
    }
    dead.iter().for_each(|dead| shell::note(&dead.text));
    bail!("{} words point to nothing", dead.len());
}

/// Checks these files against each other.
fn check(files: &[(String, String)]) -> Vec<Dead> {
    let facts = Facts::of(files);
    let mut dead = unlisted(files);
    if facts.faults.is_empty() {
        dead.push(Dead { text: format!("{CATALOGUE} defines no fault identifier") });
    }
    dead.extend(facts.faults.wrong.iter().map(|(line, why)| Dead { text: format!("{CATALOGUE}:{line}: {why}") }));
    for (path, text) in files {
        let mut fenced = false;
        for (index, line) in text.lines().enumerate() {
            let is_markdown = path.ends_with(".md");
            if is_markdown && line.trim_start().starts_with("```") {
                fenced = !fenced;
                continue;
            }
            let mut causes = BTreeSet::new();
            if is_markdown && !fenced {
                markdown(&facts, path, line, &mut causes);
            }
            anywhere(&facts, path, line, &mut causes);
            let place = format!("{path}:{}", index + 1);
            dead.extend(causes.into_iter().map(|cause| Dead { text: format!("{place}: {cause}") }));
        }
    }
    dead
}

/// Targets of the links of a Markdown text, without those in blocks and code spans.
pub(crate) fn link_targets(text: &str) -> Vec<String> {
    let mut fenced = false;
    let mut targets = Vec::new();
    for line in text.lines() {
        if line.trim_start().starts_with("```") {
            fenced = !fenced;
        } else if !fenced {
            let (prose, _) = scan::code_spans(line);
            targets.extend(scan::links(&prose).into_iter().map(str::to_owned));
        }
    }
    targets
}

/// Documents that the index does not link to.
fn unlisted(files: &[(String, String)]) -> Vec<Dead> {
    let index = files.iter().find(|(path, _)| path == INDEX).map_or("", |(_, text)| text);
    let documents = files.iter().filter(|(path, _)| path.ends_with(".md") && path != INDEX);
    documents
        .filter_map(|(path, _)| path.strip_prefix("docs/"))
        .filter(|name| !index.contains(&format!("]({name})")))
        .map(|name| Dead { text: format!("{INDEX} does not list {name}") })
        .collect()
}

/// Links, and what stands in code spans.
fn markdown(facts: &Facts, path: &str, line: &str, causes: &mut BTreeSet<String>) {
    let (prose, spans) = scan::code_spans(line);
    for target in scan::links(&prose) {
        if let Err(cause) = facts.link(path, target) {
            causes.insert(cause);
        }
    }
    for span in spans {
        if scan::is_test_name(span) && !facts.functions.contains(span) {
            causes.insert(format!("no function '{span}'"));
        } else if !span.contains(char::is_whitespace) && !facts.names_something(path, span) {
            causes.insert(format!("no file or folder '{span}'"));
        }
    }
}

/// Paths, decisions and fault identifiers in any kind of file; tests of a fault that its entry does not name.
fn anywhere(facts: &Facts, path: &str, line: &str, causes: &mut BTreeSet<String>) {
    let comment = if path.ends_with(".rs") { scan::comment(line) } else { None };
    let in_comment = comment.into_iter().flat_map(scan::words);
    let documents = scan::words(line).filter(|word| word.starts_with("docs/"));
    for word in in_comment.chain(documents) {
        if !facts.names_something(path, word) {
            causes.insert(format!("no file or folder '{word}'"));
        }
    }
    for number in scan::decisions(line).filter(|number| !facts.decisions.contains(*number)) {
        causes.insert(format!("no decision {number}"));
    }
    let no_fault = |identifier: &str| format!("{CATALOGUE} has no fault {identifier}");
    if path.ends_with(".md") || comment.is_some() {
        let named = scan::identifiers(comment.unwrap_or(line));
        causes.extend(named.iter().filter(|name| !facts.faults.has(name)).map(|name| no_fault(name)));
    }
    // A catalogue that does not know its tests says "open" of what is held.
    let function = scan::name(line).filter(|_| path.ends_with(".rs")).unwrap_or_default();
    for identifier in scan::identifiers_of_name(function) {
        if !facts.faults.has(&identifier) {
            causes.insert(no_fault(&identifier));
        } else if !facts.faults.names(&identifier, function) {
            causes.insert(format!("{CATALOGUE} does not name {function} under {identifier}"));
        }
    }
}
