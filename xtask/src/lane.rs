//! `Lane`: a part of the checks that goes on beside the others, because most builds end with one busy processor.

use std::fs::{self, File};
use std::path::PathBuf;
use std::process::{Child, Command};

use anyhow::{Context, Result, ensure};

use crate::shell;

/// A verb of this program at work. What it says goes to a file, and is shown when it has ended.
pub(crate) struct Lane {
    words: Vec<&'static str>,
    child: Child,
    told: PathBuf,
}

impl Lane {
    /// Begins `cargo xtask WORDS` beside this.
    ///
    /// # Errors
    /// It cannot be started, or its file cannot be made.
    pub(crate) fn begin(words: &[&'static str]) -> Result<Self> {
        let name = words.join(" ");
        shell::step(&format!("beside what follows: {name}"));
        fs::create_dir_all(shell::target_dir())?;
        let told = shell::target_dir().join(format!("{}.log", words.join("-")));
        let file = File::create(&told).with_context(|| format!("cannot write {}", told.display()))?;
        let child = Command::new(own_program()?)
            .args(words)
            .current_dir(shell::root())
            .stdout(file.try_clone()?)
            .stderr(file)
            .spawn()
            .with_context(|| format!("cannot start {name}"))?;
        Ok(Self { words: words.to_vec(), child, told })
    }

    /// Waits for its end, and shows what it said.
    ///
    /// # Errors
    /// It failed.
    pub(crate) fn end(mut self) -> Result<()> {
        let name = self.words.join(" ");
        shell::step(&format!("waiting for {name}"));
        let status = self.child.wait().with_context(|| format!("cannot wait for {name}"))?;
        eprint!("{}", fs::read_to_string(&self.told).unwrap_or_default());
        ensure!(status.success(), "{name}: {status}\n  to repeat: cargo xtask {name}");
        Ok(())
    }
}

/// This program. A build of the root, which it has itself ordered, puts another file in its place: Linux then still
/// has the one that runs.
fn own_program() -> Result<PathBuf> {
    let program = std::env::current_exe().context("nobody knows where this program is")?;
    Ok(if program.exists() { program } else { PathBuf::from("/proc/self/exe") })
}

/// Where the others have failed, it has nobody left to work for.
impl Drop for Lane {
    fn drop(&mut self) {
        // One that has ended cannot be ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
