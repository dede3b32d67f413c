//! The scripts against `docs/faults.md`: the same entries, in the same words, with the same marks.
//!
//! An entry of the catalogue is its row, `| [A8](#a8) | ...`, and its section, `### A8`, up to the next heading.

use std::collections::BTreeMap;

use crate::entry::Entry;

/// Most words behind the mark of a row. Its section has room for more.
const MOST_WORDS: usize = 25;

/// A row of the catalogue.
struct Row<'a> {
    title: &'a str,
    bar: &'a str,
    today: &'a str,
}

/// Differences between the scripts and the text of the catalogue, one sentence each. `cargo xtask docs` checks that
/// the tests which the text names exist, so a test of a script has only to stand in its row or section.
#[must_use]
pub fn differences(entries: &[Entry], catalogue: &str) -> Vec<String> {
    let rows = rows(catalogue);
    let mut found = Vec::new();
    for entry in entries {
        let Some(row) = rows.get(entry.id.as_str()) else {
            found.push(format!("{}: docs/faults.md has no such entry", entry.id));
            continue;
        };
        let (mark, missing) = marked(row.today);
        let words =
            [("title", entry.title.as_str(), row.title), ("bar", &entry.bar, row.bar), ("mark", &entry.today, mark)];
        for (what, script, text) in words.into_iter().filter(|(_, script, text)| script != text) {
            found.push(format!("{}: {what} '{script}' in the script, '{text}' in docs/faults.md", entry.id));
        }
        let words = missing.split_whitespace().filter(|word| word.contains(char::is_alphanumeric)).count();
        if words > MOST_WORDS {
            found.push(format!("{}: {words} words behind the mark in docs/faults.md, at most {MOST_WORDS}", entry.id));
        }
        let section = section(catalogue, &entry.id);
        let is_unnamed = |span: &str| !row.today.contains(span) && section.iter().all(|line| !line.contains(span));
        let unnamed = entry.test.iter().filter(|test| is_unnamed(&format!("`{test}`")));
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
        [cell, title, .., bar, today] => Some((identifier(cell), Row { title, bar, today })),
        _ => None,
    });
    rows.filter(|(id, _)| is_identifier(id)).collect()
}

/// A last cell as its mark, between stars, and what stands behind it.
fn marked(today: &str) -> (&str, &str) {
    today.strip_prefix("**").and_then(|rest| rest.split_once("**")).unwrap_or_default()
}

/// Text of the first cell of a row, which may be a link to its section.
fn identifier(cell: &str) -> &str {
    cell.strip_prefix('[').and_then(|cell| cell.split_once("](#")).map_or(cell, |(id, _)| id)
}

/// Lines of the section of an entry; none if it has no section.
fn section<'a>(catalogue: &'a str, id: &str) -> Vec<&'a str> {
    let behind = catalogue.lines().skip_while(|line| line.strip_prefix("### ") != Some(id)).skip(1);
    behind.take_while(|line| !line.starts_with('#')).collect()
}

/// A letter and a number.
fn is_identifier(id: &str) -> bool {
    let digits = id.strip_prefix(|letter: char| letter.is_ascii_uppercase()).unwrap_or_default();
    !digits.is_empty() && digits.bytes().all(|digit| digit.is_ascii_digit())
}
