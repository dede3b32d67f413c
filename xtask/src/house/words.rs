//! No old word where a better one was agreed on, and no doc line that opens with a question word.
//!
//! An identifier is found as a whole word in Rust and in code spans of Markdown; a phrase in every text file, whatever
//! its case. Words that are right elsewhere are old only in the places given with them.

use super::Finding;

/// Files that are not read: this list and its tests, and what records the past in the words of its time.
const NOT_READ: [&str; 6] =
    ["xtask/src/house/", "docs/decisions/", "CHANGELOG.md", "LICENSE-", "_typos.toml", "deny.toml"];

/// Where an old word is looked for.
#[derive(Clone, Copy)]
enum Kind {
    /// A name in code.
    Name,
    /// Words of prose.
    Phrase,
}
use Kind::{Name, Phrase};

/// An old word, the word to use instead, and the folders where it is old; none: everywhere.
type Old = (Kind, &'static str, &'static str, &'static [&'static str]);

/// The device's crates and what talks to it.
const DEVICE: &[&str] = &["crates/device", "crates/hand", "firmware", "host", "crates/lab", "tests"];
/// The host's tools.
const HOST: &[&str] = &["host", "crates/experiment", "crates/canlog", "crates/lab", "tests"];
/// The primitive and what runs it.
const PRIMITIVE: &[&str] = &["crates/dmp", "crates/control", "crates/hand", "crates/device", "crates/lab", "host"];
/// The simulator and what uses it.
const SIMULATOR: &[&str] = &["crates/sim", "host", "crates/experiment", "crates/lab", "tests"];

/// All old words.
const OLD: &[Old] = &[
    // The hand alone.
    (Phrase, "crates/joint", "crates/hand", &[]),
    (Phrase, "joint board", "hand's board", &[]),
    (Phrase, "joint image", "hand's image", &[]),
    (Phrase, "image joint", "image hand", &[]),
    (Phrase, "bin/joint", "bin/hand", &[]),
    // The device.
    (Name, "Core", "Controller", DEVICE),
    (Name, "Edge", "Board", &["firmware"]),
    (Name, "Fit", "a word for what was checked", &["crates/control", "crates/device"]),
    (Name, "FitPrimitive", "CheckedPrimitive", &[]),
    (Name, "Ends", "SlotQueues", &["firmware"]),
    (Phrase, "ends::", "EndCondition", &[]),
    (Name, "Room", "Scratch", DEVICE),
    (Name, "WeightRoom", "WeightBuffer", &[]),
    (Name, "Desk", "LibraryAccess", &[]),
    (Name, "desk", "library", &[]),
    (Name, "Shelf", "PrimitiveLibrary", &[]),
    (Name, "Dialogue", "HostSession", &[]),
    (Name, "SoundFlash", "JournaledFlash", &[]),
    (Name, "Account", "a word for what is summed or kept", &[]),
    (Name, "Told", "a name that says what was told", &[]),
    (Name, "Taken", "bool", DEVICE),
    (Name, "SlowPoll", "BackgroundPoll", &[]),
    (Name, "Asker", "Requester", &[]),
    (Name, "Stranger", "OtherHost", &[]),
    (Name, "Turn", "OrientationState or RequestOrder", PRIMITIVE),
    (Name, "Pace", "TimeScale", PRIMITIVE),
    (Name, "last_words", "panic_stop", &[]),
    (Name, "Hush", "ZeroTorques", &[]),
    (Name, "Either", "a name that says which ones", &[]),
    // Constants that do not say of what they are the largest.
    (Name, "AFTERGLOW", "POST_ROLL", &[]),
    (Name, "LONGEST", "a name that says what it bounds", &[]),
    (Name, "PATIENCE", "TIMEOUT", &[]),
    // The host's tools.
    (Name, "Honest", "Perturbed", HOST),
    (Phrase, "honest plant", "perturbed plant", &[]),
    (Phrase, "honest arm", "perturbed arm", &[]),
    (Name, "made_up", "fixtures", &[]),
    (Name, "Path2", "PlanarPath", &[]),
    (Name, "telling", "representative", HOST),
    (Name, "dress", "wrap", HOST),
    (Name, "Handling", "GraspTuning", HOST),
    (Name, "halves", "a name that says of what", HOST),
    (Name, "seat", "a name that says what is shared", HOST),
    (Phrase, "trouble", "failure, defect or fault", &[]),
    (Name, "HandTrouble", "HandFailure", &[]),
    (Name, "StartupTrouble", "StartupFailure", &[]),
    (Name, "PrimitiveTrouble", "PrimitiveDefect", &[]),
    // The primitive.
    (Name, "Experience", "SensorStatistics", PRIMITIVE),
    (Name, "ExperienceTable", "StatisticsTable", &[]),
    (Phrase, "an experience", "statistics", &[]),
    (Phrase, "the experience", "the statistics", &[]),
    (Phrase, "tactus experience", "tactus statistics", &[]),
    (Name, "Chart", "log-map coordinates", PRIMITIVE),
    (Name, "Row", "Group", PRIMITIVE),
    (Name, "Marks", "Metadata", &[]),
    (Phrase, "fn word", "fn name", &["crates", "host", "firmware", "emulator", "tests"]),
    (Name, "square_root", "sqrt", &[]),
    (Name, "whole_below", "floor", &[]),
    (Phrase, "felt", "expected or measured", &[]),
    // The simulator.
    (Name, "Lesson", "TaughtMovement", SIMULATOR),
    (Phrase, "lesson", "demonstration", &[]),
    (Phrase, "lessons", "demonstrations", &[]),
    (Name, "Person", "Teacher", &["crates/sim"]),
    (Phrase, "sim::person", "sim::teacher", &[]),
    (Phrase, "simulated person", "simulated teacher", &[]),
    (Phrase, "person who teaches", "simulated teacher", SIMULATOR),
    // Idioms.
    (Phrase, "before the story begins", "before time 0", &[]),
    (Phrase, "tarry", "wait", &[]),
    (Phrase, "mid-sentence", "in the middle of a transfer", &[]),
    (Phrase, "are nobody's", "belong to no crate", &[]),
    (Phrase, "wakes nobody", "wakes no task", &[]),
    (Phrase, "so long after", "this long after", &[]),
    (Phrase, "by and by", "slowly", &[]),
    (Phrase, "the word of", "the value of", DEVICE),
    (Phrase, "its own word", "its own value", &[]),
];

/// Words that a doc line must not open with, with what to write instead.
const OPENINGS: [(&str, &str); 4] = [
    ("What ", "name the quantity or begin with a verb"),
    ("Whether ", "\"True if\" or \"True while\""),
    ("How ", "name the quantity or begin with \"Returns\""),
    ("Which.", "say which"),
];

/// Checks every text file.
pub(super) fn check(files: &[(String, String)]) -> Vec<Finding> {
    let mut found = Vec::new();
    for (path, text) in files.iter().filter(|(path, _)| !NOT_READ.iter().any(|start| path.starts_with(start))) {
        let olds: Vec<_> =
            OLD.iter().filter(|old| old.3.is_empty() || old.3.iter().any(|start| is_below(path, start))).collect();
        for (index, line) in text.lines().enumerate() {
            let lower = line.to_lowercase();
            for (kind, old, new, _) in &olds {
                let is_here = match kind {
                    Name => names_in(path, line).any(|code| has_word(code, old)),
                    Phrase => has_word(&lower, old),
                };
                if is_here {
                    found.push(Finding::at(path, index + 1, format!("'{old}'; use {new}")));
                }
            }
            found.extend(opening(path, line).map(|text| Finding::at(path, index + 1, text)));
        }
    }
    found
}

fn is_below(path: &str, folder: &str) -> bool {
    path.strip_prefix(folder).is_some_and(|rest| rest.starts_with('/'))
}

/// The parts of a line that hold names: all of Rust, code spans of Markdown.
fn names_in<'a>(path: &str, line: &'a str) -> impl Iterator<Item = &'a str> {
    let (skip, step) = if path.ends_with(".md") { (1, 2) } else { (0, 1) };
    let is_read = path.ends_with(".rs") || path.ends_with(".md");
    line.split('`').skip(if is_read { skip } else { usize::MAX }).step_by(step)
}

/// True if `word` stands in the text without a letter, digit or underscore beside it.
fn has_word(text: &str, word: &str) -> bool {
    let is_name = |c: char| c.is_alphanumeric() || c == '_';
    text.match_indices(word)
        .any(|(at, _)| !text[..at].ends_with(is_name) && !text[at + word.len()..].starts_with(is_name))
}

/// The complaint about a doc line of Rust that opens with a question word.
fn opening(path: &str, line: &str) -> Option<String> {
    if !path.ends_with(".rs") {
        return None;
    }
    let line = line.trim_start();
    let doc = line.strip_prefix("/// ").or_else(|| line.strip_prefix("//! "))?;
    let (word, instead) = OPENINGS.iter().find(|(word, _)| doc.starts_with(word))?;
    Some(format!("doc line opens with '{}'; {instead}", word.trim_end()))
}
