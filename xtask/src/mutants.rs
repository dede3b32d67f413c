//! Negative controls: wrong changes of the code (`tests/mutants.toml`), each of which named tests must catch.
//!
//! The changes are made in a copy of the tracked files below the build folder, never in the work tree.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use serde::Deserialize;

use crate::{files, shell};

/// The list, below the root.
const LIST: &str = "tests/mutants.toml";

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct List {
    mutant: Vec<Mutant>,
}

/// One wrong change and the tests that must catch it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Mutant {
    /// The defect that the change makes.
    name: String,
    /// Changed file, below the root.
    file: String,
    /// Text that occurs once in the file.
    find: String,
    /// Text in its place.
    replace: String,
    /// Package of the tests.
    #[serde(default)]
    package: String,
    /// Test target of the package.
    #[serde(default)]
    target: String,
    /// Tests that must fail, by path or by the end of it.
    #[serde(default)]
    caught_by: Vec<String>,
    /// Entries of the fault catalogue of which a scenario each must fail.
    #[serde(default)]
    entries: Vec<String>,
}

/// Checks that every change can still be made and every test that is to catch one exists.
///
/// # Errors
/// If the list cannot be read, or an entry names what is not there.
pub(crate) fn check() -> Result<()> {
    let tests: String =
        files::all(|path| path.ends_with(".rs"))?.into_iter().map(|(_, text)| text).collect::<Vec<_>>().join("\n");
    for mutant in list()? {
        mutant.changed(&fs::read_to_string(shell::root().join(&mutant.file))?)?;
        for test in &mutant.caught_by {
            let function = format!("fn {}(", test.rsplit("::").next().unwrap_or(test));
            ensure!(tests.contains(&function), "{LIST}: '{}': no test '{test}'", mutant.name);
        }
    }
    Ok(())
}

/// Makes each change whose name contains `part`, one at a time, and runs the tests that must catch it.
///
/// # Errors
/// If a test that must fail passes, one fails without the change, or a change does not compile.
pub(crate) fn run(part: &str) -> Result<()> {
    check()?;
    let tree = copy_of_the_tree()?;
    let mutants: Vec<Mutant> = list()?.into_iter().filter(|mutant| mutant.name.contains(part)).collect();
    ensure!(!mutants.is_empty(), "no mutant's name contains '{part}'");
    for mutant in &mutants {
        let before = mutant.failures(&tree)?;
        ensure!(before.is_empty(), "'{}': {} fail without the change", mutant.name, before.join(", "));
    }
    let mut lived = Vec::new();
    for (n, mutant) in mutants.iter().enumerate() {
        let file = tree.join(&mutant.file);
        let sound = fs::read_to_string(&file)?;
        fs::write(&file, mutant.changed(&sound)?)?;
        let failed = mutant.failures(&tree);
        fs::write(&file, sound)?;
        let failed = failed.with_context(|| format!("with the change '{}'", mutant.name))?;
        let mut killers = mutant.caught_by.iter().chain(&mutant.entries);
        ensure!(killers.clone().count() > 0, "'{}': neither a test nor an entry is to catch it", mutant.name);
        let missed: Vec<_> =
            killers.by_ref().filter(|test| !failed.iter().any(|failed| failed.ends_with(*test))).collect();
        let outcome = if missed.is_empty() { "caught".to_owned() } else { format!("LIVES: {missed:?} passed") };
        shell::step(&format!("{:3} of {}  {outcome}  {}", n + 1, mutants.len(), mutant.name));
        if !missed.is_empty() {
            lived.push(mutant.name.as_str());
        }
    }
    ensure!(lived.is_empty(), "{} of {} live: {}", lived.len(), mutants.len(), lived.join("; "));
    shell::note(&format!("{} of {0} caught", mutants.len()));
    Ok(())
}

fn list() -> Result<Vec<Mutant>> {
    let text = fs::read_to_string(shell::root().join(LIST)).context(LIST)?;
    Ok(toml::from_str::<List>(&text).context(LIST)?.mutant)
}

impl Mutant {
    /// The text of the file with the change made.
    fn changed(&self, text: &str) -> Result<String> {
        let places = text.matches(&self.find).count();
        ensure!(places == 1, "{LIST}: '{}': its text occurs {places} times in {}, not once", self.name, self.file);
        Ok(text.replacen(&self.find, &self.replace, 1))
    }

    /// Runs what must catch the change; paths of the tests, and the entries, that failed.
    fn failures(&self, tree: &Path) -> Result<Vec<String>> {
        let mut failed = failed_entries(tree, &self.entries)?;
        if !self.caught_by.is_empty() {
            failed.extend(self.failed_tests(tree)?);
        }
        Ok(failed)
    }

    fn failed_tests(&self, tree: &Path) -> Result<Vec<String>> {
        let mut test = shell::cargo();
        test.current_dir(tree).env("CARGO_TARGET_DIR", shell::target_dir().join("mutants/target"));
        test.args(["test", "--package", &self.package, "--test", &self.target, "--"]).args(&self.caught_by);
        let output = test.output().with_context(|| format!("cannot start: {}", shell::line(&test)))?;
        let text = String::from_utf8_lossy(&output.stdout);
        if !text.contains("test result: ") {
            bail!("does not build or run:\n{}", String::from_utf8_lossy(&output.stderr));
        }
        for name in &self.caught_by {
            ensure!(
                text.lines().any(|line| line.starts_with("test ") && line.contains(name.as_str())),
                "no test {name}"
            );
        }
        let failed = |line: &str| Some(line.strip_prefix("test ")?.strip_suffix(" ... FAILED")?.to_owned());
        Ok(text.lines().filter_map(failed).collect())
    }
}

/// Runs entries of the fault catalogue; the identifiers of those of which a scenario failed.
fn failed_entries(tree: &Path, entries: &[String]) -> Result<Vec<String>> {
    if entries.is_empty() {
        return Ok(Vec::new());
    }
    let mut run = shell::cargo();
    run.current_dir(tree).env("CARGO_TARGET_DIR", shell::target_dir().join("mutants/target"));
    run.args(["run", "--quiet", "--package", "faults", "--"]).args(entries);
    let output = run.output().with_context(|| format!("cannot start: {}", shell::line(&run)))?;
    let text = String::from_utf8_lossy(&output.stdout);
    let of = |entry: &str, line: &str| line.split_whitespace().next() == Some(entry);
    if let Some(entry) = entries.iter().find(|entry| !text.lines().any(|line| of(entry, line))) {
        bail!("{entry} does not build or run:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    let has_failed = |entry: &&String| text.lines().any(|line| of(entry, line) && line.ends_with(": FAIL"));
    Ok(entries.iter().filter(has_failed).cloned().collect())
}

/// Copies the files of the repository; those that are equal already keep their times, so that they are not built anew.
fn copy_of_the_tree() -> Result<PathBuf> {
    let tree = shell::target_dir().join("mutants/tree");
    let mut list = Command::new("git");
    list.current_dir(shell::root()).args(["ls-files", "--cached", "--others", "--exclude-standard"]);
    let listed = shell::capture(&mut list)?;
    for path in listed.lines() {
        let (from, to) = (shell::root().join(path), tree.join(path));
        if !from.is_file() {
            continue;
        }
        let bytes = fs::read(&from)?;
        if fs::read(&to).is_ok_and(|there| there == bytes) {
            continue;
        }
        fs::create_dir_all(to.parent().unwrap_or(&tree))?;
        fs::write(&to, bytes)?;
    }
    Ok(tree)
}
