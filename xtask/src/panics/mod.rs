//! Where an image can panic, held against the list of places that may.
//!
//! Panics are told apart by the source they come from, through all inlining, and by kind; how often the
//! compiler repeats it does not, so that the same list serves other compilers and optimisation levels.

mod allowed;
mod kind;
mod site;
#[cfg(test)]
mod tests;

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, bail, ensure};

use crate::board::Board;
use crate::elf::Elf;
use crate::shell;
use allowed::{Allowed, LIBRARIES};
use kind::Kind;
use site::{Origin, Site};

/// Fails if the image can panic anywhere but where the list allows it; says in a line what there is.
pub(crate) fn check(image: &Path, board: Board) -> Result<()> {
    let sites = sites(image)?;
    let unknown: Vec<String> = sites.iter().filter_map(|site| unknown(site, board)).collect();
    if !unknown.is_empty() {
        bail!(
            "the image can panic where it must not:\n  {}\n\
             What comes from outside must end in an error: `get` for an index, `checked_` for arithmetic, `ok_or` for \
             `unwrap`.\nWhat cannot happen is listed with its reason in xtask/src/panics/allowed.rs.",
            unknown.join("\n  ")
        );
    }
    shell::note(&summary(&sites));
    Ok(())
}

/// Prints what each place of the list allows in the images that are there, and fails if one allows nothing any more.
pub(crate) fn table(images: &[(PathBuf, Board)]) -> Result<()> {
    let mut counts: BTreeMap<usize, BTreeMap<&Path, usize>> = BTreeMap::new();
    for (image, board) in images {
        check(image, *board)?;
        for site in sites(image)? {
            for Origin { function, kind, .. } in &site.origins {
                if let Some(row) = allowed::all().position(|row| row.covers(function, *kind, *board)) {
                    *counts.entry(row).or_default().entry(image).or_default() += 1;
                }
            }
        }
    }
    let mut idle = Vec::new();
    for (index, Allowed { who, kinds, why, .. }) in allowed::all().enumerate() {
        let kinds = kinds.iter().map(Kind::to_string).collect::<Vec<_>>().join(", ");
        let found: Vec<String> = images
            .iter()
            .map(|(image, _)| counts.get(&index).and_then(|row| row.get(image.as_path())).unwrap_or(&0).to_string())
            .collect();
        println!("{who} ({kinds}): {}\n    {why}", found.join(" + "));
        if !counts.contains_key(&index) {
            idle.push(format!("{who} ({kinds})"));
        }
    }
    ensure!(
        idle.is_empty(),
        "these rows of xtask/src/panics/allowed.rs allow nothing that is there: {}",
        idle.join("; ")
    );
    Ok(())
}

fn sites(image: &Path) -> Result<Vec<Site>> {
    let file = fs::read(image).with_context(|| format!("cannot read {}", image.display()))?;
    let sites = Elf::parse(&*file).map_err(anyhow::Error::from).and_then(|file| site::find(&file));
    let sites = sites.with_context(|| format!("the functions of {} cannot be read", image.display()))?;
    // Division by zero of the queues, numbers in the last words: a search that finds nothing is broken.
    ensure!(!sites.is_empty(), "the search for panics finds nothing at all in {}", image.display());
    Ok(sites)
}

/// Message for a site that is not allowed.
fn unknown(site: &Site, board: Board) -> Option<String> {
    let is_known = |origin: &&Origin| allowed::all().any(|row| row.covers(&origin.function, origin.kind, board));
    let unknown = site.origins.iter().filter(|origin| !is_known(origin));
    let named: Vec<String> =
        unknown.map(|Origin { function, line, kind }| format!("{function} ({kind}, {line})")).collect();
    let Site { function, target, .. } = site;
    (!named.is_empty()).then(|| format!("{} calls {target}, in {function}", named.join(" and ")))
}

/// The one line about an image without faults.
fn summary(sites: &[Site]) -> String {
    let mut ours: BTreeMap<&str, BTreeSet<String>> = BTreeMap::new();
    let mut counts: BTreeMap<&str, usize> = BTreeMap::new();
    for site in sites {
        for library in LIBRARIES {
            let mut kinds = site.origins.iter().filter(|origin| site::crate_of(&origin.function) == library).peekable();
            if kinds.peek().is_some() {
                *counts.entry(library).or_default() += 1;
                ours.entry(library).or_default().extend(kinds.map(|origin| origin.kind.to_string()));
            }
        }
    }
    let some = LIBRARIES.into_iter().filter_map(|library| {
        let kinds: Vec<&str> = ours.get(library)?.iter().map(String::as_str).collect();
        Some(format!("{library} {} ({})", counts.get(library)?, kinds.join(", ")))
    });
    let some: Vec<String> = some.collect();
    let none: Vec<&str> = LIBRARIES.into_iter().filter(|library| !ours.contains_key(library)).collect();
    let mut text = format!("panic sites: {}, all known", sites.len());
    if !some.is_empty() {
        text += &format!("; of them in {}", some.join(", "));
    }
    if !none.is_empty() {
        text += &format!("; none in {}", none.join(", "));
    }
    text
}
