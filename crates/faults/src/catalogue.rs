//! The scripts against `docs/faults.md`: the same entries, in the same words, with the same marks.

use std::collections::BTreeMap;

use crate::entry::Entry;

/// A row of the catalogue.
struct Row<'a> {
    title: &'a str,
    bar: &'a str,
    today: &'a str,
}

/// Differences between the scripts and the text of the catalogue, one sentence each. `cargo xtask docs` checks that
/// the tests which the text names exist, so a test of a script has only to stand in its row.
#[must_use]
pub fn differences(entries: &[Entry], catalogue: &str) -> Vec<String> {
    let rows = rows(catalogue);
    let mut found = Vec::new();
    for entry in entries {
        let Some(row) = rows.get(entry.id.as_str()) else {
            found.push(format!("{}: docs/faults.md has no such entry", entry.id));
            continue;
        };
        let mark = row.today.split("**").nth(1).unwrap_or_default();
        let words =
            [("title", entry.title.as_str(), row.title), ("bar", &entry.bar, row.bar), ("mark", &entry.today, mark)];
        for (what, script, text) in words.into_iter().filter(|(_, script, text)| script != text) {
            found.push(format!("{}: {what} '{script}' in the script, '{text}' in docs/faults.md", entry.id));
        }
        let unnamed = entry.test.iter().filter(|test| !row.today.contains(&format!("`{test}`")));
        found.extend(unnamed.map(|test| format!("{}: docs/faults.md does not name the test {test}", entry.id)));
    }
    let missing = rows.keys().filter(|id| entries.iter().all(|entry| entry.id != **id));
    found.extend(missing.map(|id| format!("{id}: tests/faults has no script")));
    found
}

/// Rows of the catalogue by identifier: fault, reaction (which some parts leave out), bar, today.
fn rows(catalogue: &str) -> BTreeMap<&str, Row<'_>> {
    let cells = catalogue.lines().filter_map(|line| line.strip_prefix("| ")?.strip_suffix(" |"));
    let rows = cells.filter_map(|line| match line.split(" | ").collect::<Vec<_>>()[..] {
        [id, title, .., bar, today] => Some((id, Row { title, bar, today })),
        _ => None,
    });
    rows.filter(|(id, _)| is_identifier(id)).collect()
}

/// A letter and a number.
fn is_identifier(id: &str) -> bool {
    let digits = id.strip_prefix(|letter: char| letter.is_ascii_uppercase()).unwrap_or_default();
    !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit())
}
