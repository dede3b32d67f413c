//! The debug probe: every command that is run with it, as a line a person can paste, and what can go wrong.
//!
//! The work is done by probe-rs, a program of its own: it knows the probes and the chips, and needs access to USB
//! that this tool should not have.

use std::ffi::OsString;
use std::fmt;
use std::io;
use std::path::Path;
use std::process::{Command, ExitStatus, Stdio};

/// Name of the program.
pub const PROBE_RS: &str = "probe-rs";

/// A program and its arguments.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Line {
    program: &'static str,
    arguments: Vec<OsString>,
}

/// Why a command did not do what it should.
#[derive(Debug, thiserror::Error)]
pub enum ProbeError {
    /// The program is not installed.
    #[error("'{program}' is not installed")]
    Missing {
        /// Which program.
        program: &'static str,
    },
    /// The program could not be started.
    #[error("cannot start '{program}'")]
    NotStarted {
        /// Which program.
        program: &'static str,
        /// Why.
        source: io::Error,
    },
    /// The program ended with a failure, and has said why.
    #[error("'{line}' ended with {status}")]
    Failed {
        /// The command.
        line: Line,
        /// Its exit status.
        status: ExitStatus,
    },
}

impl Line {
    /// A command.
    pub fn new<A: Into<OsString>>(program: &'static str, arguments: impl IntoIterator<Item = A>) -> Self {
        Self { program, arguments: arguments.into_iter().map(Into::into).collect() }
    }

    /// Writes an image to a chip and reads it back. Only the sectors the image lies in are erased.
    #[must_use]
    pub fn download(chip: &str, probe: Option<&str>, image: &Path) -> Self {
        let mut line = Self::probe_rs("download", chip, probe);
        line.arguments.push("--verify".into());
        line.arguments.push(image.into());
        line
    }

    /// Starts what is on a chip.
    #[must_use]
    pub fn reset(chip: &str, probe: Option<&str>) -> Self {
        Self::probe_rs("reset", chip, probe)
    }

    /// Shows the log of a running image. Once attached the processor is not halted, whatever happens to it: a halted
    /// processor sends no torques, and the pucks would hold the last ones. Attaching itself halts it for a moment,
    /// which no option of probe-rs prevents (its issue 3135).
    #[must_use]
    pub fn attach(chip: &str, probe: Option<&str>, image: &Path) -> Self {
        let mut line = Self::probe_rs("attach", chip, probe);
        line.arguments.extend(["--no-catch-hardfault".into(), "--no-catch-reset".into(), image.into()]);
        line
    }

    /// Shows a log that was kept in a file.
    #[must_use]
    pub fn print(image: &Path) -> Self {
        Self::new("defmt-print", [OsString::from("-e"), image.into()])
    }

    fn probe_rs(verb: &str, chip: &str, probe: Option<&str>) -> Self {
        let mut line = Self::new(PROBE_RS, [verb, "--chip", chip]);
        if let Some(probe) = probe {
            line.arguments.extend(["--probe".into(), probe.into()]);
        }
        line
    }

    /// Runs it on this terminal, with standard input from a file or from nowhere.
    ///
    /// # Errors
    /// It is not installed, cannot be started, or fails.
    pub fn run(&self, input: Option<std::fs::File>) -> Result<(), ProbeError> {
        let input = input.map_or_else(Stdio::null, Stdio::from);
        let program = self.program;
        match Command::new(program).args(&self.arguments).stdin(input).status() {
            Ok(status) if status.success() => Ok(()),
            Ok(status) => Err(ProbeError::Failed { line: self.clone(), status }),
            Err(error) if error.kind() == io::ErrorKind::NotFound => Err(ProbeError::Missing { program }),
            Err(source) => Err(ProbeError::NotStarted { program, source }),
        }
    }
}

impl fmt::Display for Line {
    /// As it can be pasted into a shell.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.program)?;
        for argument in &self.arguments {
            let word = argument.to_string_lossy();
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_./=:,+@%".contains(c);
            if !word.is_empty() && word.chars().all(plain) {
                write!(f, " {word}")?;
            } else {
                write!(f, " '{}'", word.replace('\'', r"'\''"))?;
            }
        }
        Ok(())
    }
}
