//! Programs in Python as other people write them, run beside the command.

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::command::program;

/// The folder of the repository.
#[must_use]
pub fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().expect("the tests lie in the repository")
}

/// Runs a script of `tests/python` in the environment that `cargo xtask setup` makes, and gives what it printed.
///
/// # Panics
/// There is no such environment, or the script fails.
#[track_caller]
pub fn run(script: &str, arguments: &[&OsStr]) -> String {
    let build = program().parent().and_then(Path::parent).map(Path::to_path_buf).expect("target/<profile>/tactus");
    let python: PathBuf = build.join("python").join("bin").join("python");
    assert!(python.is_file(), "there is no {}; `cargo xtask setup` makes it", python.display());
    let path = root().join("tests").join("python").join(script);
    let mut command = Command::new(python);
    // Nothing of the reader is built or installed: the folder is the package.
    command.env("PYTHONPATH", root().join("python").join("tactus_reader")).env("PYTHONDONTWRITEBYTECODE", "1");
    let output = command.arg(path).args(arguments).output().expect("python can be started");
    let printed = String::from_utf8_lossy(&output.stdout).into_owned();
    assert!(output.status.success(), "{script}: {printed}{}", String::from_utf8_lossy(&output.stderr));
    printed
}
