//! The Python packages of the tests in `tests/python`, in an environment of their own under the build folder.

use std::fs;
use std::process::Command;

use anyhow::{Context, Result};

use crate::shell;

/// Makes sure that `target/python/bin/python` has the packages of `tests/python/requirements.txt`.
pub(super) fn ensure() -> Result<()> {
    let folder = shell::target_dir().join("python");
    let list = shell::root().join("tests").join("python").join("requirements.txt");
    let wanted = fs::read_to_string(&list).with_context(|| format!("cannot read {}", list.display()))?;
    let stamp = folder.join("requirements.txt");
    if fs::read_to_string(&stamp).is_ok_and(|installed| installed == wanted) {
        return Ok(());
    }
    shell::note("installing the Python packages of the tests into the build folder");
    shell::run(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder))
        .context("python3 makes no environment; on Debian install python3-venv")?;
    let python = folder.join("bin").join("python");
    shell::run(Command::new(&python).args(["-m", "pip", "install", "--quiet", "--requirement"]).arg(&list))
        .context("pip cannot install the packages; is there a network?")?;
    fs::write(&stamp, wanted).with_context(|| format!("cannot write {}", stamp.display()))
}
