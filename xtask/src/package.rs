//! Packages for strangers: packed, unpacked outside the repository, and tested there.

use std::fs;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell;

/// Packs and tests every package that may be published.
///
/// # Errors
/// If a package does not build or fails its tests without the repository around it.
pub(crate) fn run() -> Result<()> {
    let mut metadata = shell::cargo();
    metadata.args(["metadata", "--no-deps", "--format-version", "1"]);
    let metadata: Value = serde_json::from_str(&shell::capture(&mut metadata)?)?;
    let packages = metadata["packages"].as_array().context("cargo metadata lists no packages")?;
    let packages: Vec<_> = packages.iter().filter(|package| package["publish"].is_null()).collect();
    ensure!(!packages.is_empty(), "no package may be published");
    let folder = std::env::temp_dir().join(format!("tactus-packages-{}", std::process::id()));
    fs::create_dir_all(&folder)?;
    for package in packages {
        let name = package["name"].as_str().context("a package without a name")?;
        let version = package["version"].as_str().context("a package without a version")?;
        shell::step(&format!("package {name}: packed, unpacked elsewhere, tested there"));
        shell::run(shell::cargo().args(["package", "--quiet", "--allow-dirty", "--no-verify", "--package", name]))?;
        let file = shell::target_dir().join("package").join(format!("{name}-{version}.crate"));
        shell::run(std::process::Command::new("tar").arg("-xzf").arg(&file).arg("-C").arg(&folder))?;
        let mut test = shell::cargo();
        test.current_dir(folder.join(format!("{name}-{version}")));
        // In the folder that is removed: a build that is kept names its sources where they were unpacked the last time.
        test.env("CARGO_TARGET_DIR", folder.join("target"));
        shell::run(test.args(["test", "--quiet", "--all-features"]))?;
    }
    fs::remove_dir_all(&folder)?;
    Ok(())
}
