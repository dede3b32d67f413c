//! The arrows between our packages are those of the table in `docs/architecture.md`.
//!
//! The table's last column, "depends on", lists the normal dependencies of a package on other packages of the
//! repository; build and development dependencies are free.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use super::Finding;
use crate::shell;

/// The document with the table.
const DOCUMENT: &str = "docs/architecture.md";
/// Title of the column.
const COLUMN: &str = "depends on";

/// A package by the name of its folder, and the folders of the packages that it depends on.
pub(super) type Arrows = BTreeMap<String, BTreeSet<String>>;

/// Compares the manifests with the table.
pub(super) fn check(files: &[(String, String)]) -> Result<Vec<Finding>> {
    let mut real = Arrows::new();
    for manifest in ["Cargo.toml", "emulator/Cargo.toml"] {
        let mut command = shell::cargo();
        command.args(["metadata", "--no-deps", "--format-version", "1", "--manifest-path", manifest]);
        real.extend(from_metadata(&serde_json::from_str(&shell::capture(without_toolchain(&mut command))?)?)?);
    }
    let text = files.iter().find(|(path, _)| path == DOCUMENT).map_or("", |(_, text)| text);
    Ok(compare(&real, &from_table(text)))
}

/// The emulator's manifest asks for a newer compiler; reading it does not.
fn without_toolchain(command: &mut Command) -> &mut Command {
    command.env_remove("RUSTUP_TOOLCHAIN")
}

/// The arrows that cargo reports.
fn from_metadata(metadata: &Value) -> Result<Arrows> {
    let root = shell::root();
    let root = root.to_string_lossy();
    let short =
        |path: &str| path.trim_start_matches(&*root).trim_start_matches("/crates/").trim_start_matches('/').to_owned();
    let mut arrows = Arrows::new();
    for package in metadata["packages"].as_array().context("cargo metadata lists no packages")? {
        let manifest = package["manifest_path"].as_str().context("a package without a manifest")?;
        let dependencies = package["dependencies"].as_array().into_iter().flatten();
        let ours = dependencies.filter(|one| one["kind"].is_null()).filter_map(|one| one["path"].as_str());
        arrows.insert(short(manifest.trim_end_matches("/Cargo.toml")), ours.map(short).collect());
    }
    Ok(arrows)
}

/// The arrows of the table: first column and the column "depends on", names in code spans.
pub(super) fn from_table(text: &str) -> Arrows {
    let mut arrows = Arrows::new();
    let mut column = None;
    for line in text.lines() {
        let cells: Vec<&str> = line.trim().trim_matches('|').split('|').map(str::trim).collect();
        if !line.starts_with('|') {
            column = None;
        } else if let Some(title) = cells.iter().position(|cell| *cell == COLUMN) {
            column = Some(title);
        } else if let Some(cell) = column.and_then(|column| cells.get(column))
            && let [name] = names(cells[0])[..]
        {
            arrows.insert(name.to_owned(), names(cell).into_iter().map(str::to_owned).collect());
        }
    }
    arrows
}

/// Returns the texts of the code spans.
fn names(cell: &str) -> Vec<&str> {
    cell.split('`').skip(1).step_by(2).collect()
}

/// Every difference between the manifests and the table.
pub(super) fn compare(real: &Arrows, table: &Arrows) -> Vec<Finding> {
    let none = BTreeSet::new();
    let mut found = Vec::new();
    for package in real.keys().chain(table.keys()).collect::<BTreeSet<_>>() {
        let (has, may) = (real.get(package).unwrap_or(&none), table.get(package).unwrap_or(&none));
        if !table.contains_key(package) || !real.contains_key(package) {
            let place = if table.contains_key(package) { "there is no package" } else { "the table lacks" };
            found.push(Finding::new(DOCUMENT, format!("{place} '{package}'")));
            continue;
        }
        found
            .extend(has.difference(may).map(|to| {
                Finding::new(DOCUMENT, format!("'{package}' depends on '{to}'; the table says it does not"))
            }));
        found.extend(may.difference(has).map(|to| {
            Finding::new(DOCUMENT, format!("'{package}' does not depend on '{to}'; the table says it does"))
        }));
    }
    found
}
