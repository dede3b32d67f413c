//! The catalogue of faults: an entry is its row, `| [A8](#a8) | ...`, and its section, `### A8`, to the next heading.

use std::collections::{BTreeMap, BTreeSet};

use super::scan;

/// Entries by their identifiers.
#[derive(Default)]
pub(super) struct Catalogue {
    entries: BTreeMap<String, Entry>,
    /// Line, and why it is no part of an entry.
    pub(super) wrong: Vec<(usize, String)>,
}

/// One entry.
#[derive(Default)]
struct Entry {
    /// Lines of row and section, counted from 1.
    row: Option<usize>,
    section: Option<usize>,
    /// Code spans of row and section.
    spans: BTreeSet<String>,
}

impl Catalogue {
    /// From the text of the document.
    pub(super) fn of(text: &str) -> Self {
        let mut catalogue = Self::default();
        let (mut fenced, mut section) = (false, None);
        for (index, line) in text.lines().enumerate() {
            if line.trim_start().starts_with("```") {
                fenced = !fenced;
            } else if fenced {
                continue;
            } else if line.starts_with('#') {
                section = line.strip_prefix("### ").filter(|title| scan::is_identifier(title));
                catalogue.begin(section, "section", index + 1, |entry| &mut entry.section);
            } else if let Some((row, anchor)) = identifier_of_row(line) {
                let expected = format!("#{}", row.to_ascii_lowercase());
                if anchor != expected {
                    catalogue.wrong.push((index + 1, format!("the row {row} does not lead to '{expected}'")));
                }
                catalogue.begin(Some(row), "row", index + 1, |entry| &mut entry.row);
                catalogue.add(row, line);
            }
            if let Some(identifier) = section {
                catalogue.add(identifier, line);
            }
        }
        catalogue.halves();
        catalogue
    }

    /// True if the catalogue has this entry.
    pub(super) fn has(&self, identifier: &str) -> bool {
        self.entries.get(identifier).is_some_and(|entry| entry.row.is_some())
    }

    /// True if it has none at all.
    pub(super) fn is_empty(&self) -> bool {
        self.entries.is_empty()
    }

    /// True if row or section of the entry name this test.
    pub(super) fn names(&self, identifier: &str, test: &str) -> bool {
        self.entries.get(identifier).is_some_and(|entry| entry.spans.contains(test))
    }

    /// Notes where a row or section begins, and that it is the only one.
    fn begin(&mut self, which: Option<&str>, what: &str, line: usize, of: fn(&mut Entry) -> &mut Option<usize>) {
        let Some(identifier) = which else { return };
        if of(self.entries.entry(identifier.to_owned()).or_default()).replace(line).is_some() {
            self.wrong.push((line, format!("the {what} {identifier} stands there twice")));
        }
    }

    fn add(&mut self, identifier: &str, line: &str) {
        let (_, spans) = scan::code_spans(line);
        let entry = self.entries.entry(identifier.to_owned()).or_default();
        entry.spans.extend(spans.into_iter().map(str::to_owned));
    }

    /// Rows without a section, sections without a row.
    fn halves(&mut self) {
        for (identifier, entry) in &self.entries {
            match (entry.row, entry.section) {
                (Some(line), None) => self.wrong.push((line, format!("the row {identifier} has no section"))),
                (None, Some(line)) => self.wrong.push((line, format!("the section {identifier} has no row"))),
                _ => {}
            }
        }
    }
}

/// Identifier and link of a row of the catalogue; the link is empty if there is none.
fn identifier_of_row(line: &str) -> Option<(&str, &str)> {
    let (cell, _) = line.strip_prefix("| ")?.split_once(" |")?;
    let link = cell.strip_prefix('[').and_then(|cell| cell.strip_suffix(')')?.split_once("]("));
    let (identifier, anchor) = link.unwrap_or((cell, ""));
    scan::is_identifier(identifier).then_some((identifier, anchor))
}
