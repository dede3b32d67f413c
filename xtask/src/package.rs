//! Packages for strangers: packed with their licences, unpacked outside the repository, tested and tried there.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result, ensure};
use serde_json::Value;

use crate::shell;

/// Packs and tests every package that may be published.
///
/// # Errors
/// If a package lacks the text of a licence, or does not build, fails its tests or has an example that fails, without
/// the repository around it.
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
        let package = folder.join(format!("{name}-{version}"));
        depend_on(&package, &folder.join(format!("user-of-{name}")))?;
        for licence in ["LICENSE-APACHE", "LICENSE-MIT"] {
            ensure!(package.join(licence).is_file(), "the package {name} lacks {licence}");
        }
        let there = || {
            let mut cargo = shell::cargo();
            // In the folder that is removed: a build that is kept names its sources where they were unpacked last time.
            cargo.current_dir(&package).env("CARGO_TARGET_DIR", folder.join("target"));
            // As in the workspace: without it the tests of the arithmetic take minutes.
            cargo.env("CARGO_PROFILE_DEV_OPT_LEVEL", "1").env("CARGO_PROFILE_DEV_DEBUG", "line-tables-only");
            cargo.env("CARGO_PROFILE_DEV_LTO", "off").env("CARGO_PROFILE_DEV_CODEGEN_UNITS", "16");
            cargo
        };
        shell::run(there().args(["test", "--quiet", "--all-features"]))?;
        for example in examples(&package)? {
            shell::run(there().args(["run", "--quiet", "--all-features", "--example", &example]))?;
        }
    }
    fs::remove_dir_all(&folder)?;
    Ok(())
}

/// Checks a package of somebody who copied the dependency out of this one's README, beside a clone of the repository.
fn depend_on(package: &Path, user: &Path) -> Result<()> {
    let readme = fs::read_to_string(package.join("README.md")).context("a package without a README")?;
    let block = readme.split("```toml\n").nth(1).and_then(|rest| rest.split("```").next());
    let block = block.context("a README that does not say how to depend on its package")?;
    fs::create_dir_all(user.join("src"))?;
    std::os::unix::fs::symlink(shell::root(), user.join("tactus"))?;
    fs::write(user.join("Cargo.toml"), format!("[package]\nname = \"user\"\nedition = \"2024\"\n\n{block}"))?;
    fs::write(user.join("src/lib.rs"), "#![no_std]\n")?;
    shell::run(shell::cargo().current_dir(user).env("CARGO_TARGET_DIR", user.join("target")).args(["check", "--quiet"]))
}

/// Names of a package's examples.
fn examples(package: &Path) -> Result<Vec<String>> {
    let folder = package.join("examples");
    if !folder.is_dir() {
        return Ok(Vec::new());
    }
    let name = |path: &Path| Some(path.file_name()?.to_str()?.strip_suffix(".rs")?.to_owned());
    let paths: Vec<_> = fs::read_dir(folder)?.map(|entry| entry.map(|entry| entry.path())).collect::<Result<_, _>>()?;
    let mut names: Vec<String> = paths.iter().filter_map(|path| name(path)).collect();
    names.sort();
    Ok(names)
}
