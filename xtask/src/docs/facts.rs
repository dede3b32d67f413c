//! Targets that a word can point at: files, folders, headings, functions, decisions, fault identifiers.

use std::collections::{BTreeMap, BTreeSet};

use super::catalogue::Catalogue;
use super::{CATALOGUE, scan};

/// Everything that exists.
pub(super) struct Facts {
    files: BTreeSet<String>,
    folders: BTreeSet<String>,
    /// Folders with a `Cargo.toml`.
    packages: BTreeSet<String>,
    /// Anchors of each Markdown file.
    anchors: BTreeMap<String, BTreeSet<String>>,
    pub(super) functions: BTreeSet<String>,
    /// Four digits each.
    pub(super) decisions: BTreeSet<String>,
    /// Entries of the catalogue.
    pub(super) faults: Catalogue,
}

impl Facts {
    /// From paths and texts.
    pub(super) fn of(files: &[(String, String)]) -> Self {
        let mut facts = Facts {
            files: files.iter().map(|(path, _)| path.clone()).collect(),
            folders: BTreeSet::new(),
            packages: BTreeSet::new(),
            anchors: BTreeMap::new(),
            functions: BTreeSet::new(),
            decisions: BTreeSet::new(),
            faults: Catalogue::default(),
        };
        for (path, text) in files {
            for (at, _) in path.match_indices('/') {
                facts.folders.insert(path[..at].to_owned());
            }
            if let Some(folder) = path.strip_suffix("Cargo.toml") {
                facts.packages.insert(folder.trim_end_matches('/').to_owned());
            }
            if let Some(number) = path.strip_prefix("docs/decisions/").and_then(|name| name.get(..4)) {
                facts.decisions.insert(number.to_owned());
            }
            if path.ends_with(".rs") {
                facts.functions.extend(text.lines().filter_map(scan::name).map(str::to_owned));
            } else if path.ends_with(".md") {
                facts.anchors.insert(path.clone(), anchors(text));
            }
            if path == CATALOGUE {
                facts.faults = Catalogue::of(text);
            }
        }
        facts
    }

    /// True if a link of this file leads somewhere.
    ///
    /// # Errors
    /// Why it does not.
    pub(super) fn link(&self, from: &str, target: &str) -> Result<(), String> {
        // Other machines, and items of Rust's documentation, are not ours to check.
        if target.contains("://") || target.starts_with("mailto:") || target.contains("::") {
            return Ok(());
        }
        let (path, anchor) = target.split_once('#').unwrap_or((target, ""));
        let file = if path.is_empty() { Some(from.to_owned()) } else { joined(folder_of(from), path) };
        let file = file.filter(|file| self.exists(file)).ok_or_else(|| format!("dead link '{target}'"))?;
        match self.anchors.get(&file) {
            Some(anchors) if !anchor.is_empty() && !anchors.contains(anchor) => {
                Err(format!("no heading '#{anchor}' in {file}"))
            }
            _ => Ok(()),
        }
    }

    /// False for a path below a folder of the root that is not there. What is no such path is none of our business.
    ///
    /// A path may be relative to the root, to the file that names it, or to its package.
    pub(super) fn names_something(&self, from: &str, word: &str) -> bool {
        // An anchor is looked at where it is a link; a path into Rust code ends at its file.
        let word = word.split('#').next().and_then(|word| word.split("::").next()).unwrap_or(word);
        let numbered = word.rsplit_once(':').filter(|(_, line)| line.bytes().all(|byte| byte.is_ascii_digit()));
        let word = numbered.map_or(word, |(path, _)| path);
        let begins_here = word.split_once('/').is_some_and(|(first, _)| self.folders.contains(first));
        let is_filled_in = word.contains('{') && !word.contains(',');
        if !begins_here || is_filled_in || ["...", "…", "NNNN", "NAME", "$"].iter().any(|mark| word.contains(mark)) {
            return true;
        }
        let mut places = vec!["", folder_of(from)];
        places.extend(self.package_of(from));
        alternatives(word).iter().all(|path| {
            places.iter().filter_map(|place| joined(place, path)).any(|path| self.exists(&path) || self.matches(&path))
        })
    }

    fn exists(&self, path: &str) -> bool {
        path.is_empty() || self.files.contains(path) || self.folders.contains(path)
    }

    /// A pattern with stars, or a decision by its number alone.
    fn matches(&self, path: &str) -> bool {
        let is_number = path.strip_prefix("docs/decisions/").is_some_and(|name| self.decisions.contains(name));
        let all = self.files.iter().chain(&self.folders);
        is_number || (path.contains('*') && all.into_iter().any(|file| fits(path, file)))
    }

    fn package_of<'a>(&self, path: &'a str) -> Option<&'a str> {
        // From the innermost folder outwards.
        let mut folders = path.rmatch_indices('/').map(|(at, _)| &path[..at]);
        folders.find(|folder| self.packages.contains(*folder))
    }
}

/// Anchors of the headings, as GitHub makes them.
fn anchors(text: &str) -> BTreeSet<String> {
    let headings = text.lines().filter(|line| line.starts_with('#'));
    headings
        .map(|line| {
            let words = line.trim_start_matches('#').trim().to_lowercase();
            let kept = words.chars().filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'));
            kept.map(|c| if c == ' ' { '-' } else { c }).collect()
        })
        .collect()
}

fn folder_of(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// `path` from `folder` on, without `.` and `..`; none if it leaves the repository.
fn joined(folder: &str, path: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in path.split('/') {
        match part {
            "" | "." => {}
            ".." => drop(parts.pop()?),
            part => parts.push(part),
        }
    }
    Some(parts.join("/"))
}

/// The paths that braces stand for: `a/{b,c}` for `a/b` and `a/c`.
fn alternatives(path: &str) -> Vec<String> {
    let Some((before, rest)) = path.split_once('{') else { return vec![path.to_owned()] };
    let Some((choices, after)) = rest.split_once('}') else { return vec![before.to_owned()] };
    choices.split(',').flat_map(|choice| alternatives(&format!("{before}{choice}{after}"))).collect()
}

/// True if a path fits a pattern whose stars stand for anything but a slash.
fn fits(pattern: &str, path: &str) -> bool {
    let Some((before, after)) = pattern.split_once('*') else { return pattern == path };
    let Some(rest) = path.strip_prefix(before) else { return false };
    let longest = rest.find('/').unwrap_or(rest.len());
    (0..=longest).any(|end| rest.is_char_boundary(end) && fits(after, &rest[end..]))
}
