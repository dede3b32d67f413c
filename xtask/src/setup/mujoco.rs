//! The MuJoCo library, taken hash-checked from its Python wheel into `target/mujoco`.
//!
//! Only the shared library, its headers and its licence are kept; nothing is installed into Python. The hash is
//! checked by pip, and again by the stamp: a changed hash below fetches anew.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result};

use super::apt;
use crate::shell;

const VERSION: &str = "3.17.0";

/// SHA-256 of `mujoco-3.17.0-cp311-cp311-manylinux_2_27_x86_64.manylinux_2_28_x86_64.whl`.
const WHEEL_HASH: &str = "d66928d86a2d1b601bbaa4dc11db50214d17d5301bb8afd84721313b67ff0874";

/// Unpacks the wheel `argv[1]` into the folder `argv[2]`: library with its short name, headers, licences.
const UNPACK: &str = r#"
import pathlib, sys, zipfile
wheel, out = zipfile.ZipFile(sys.argv[1]), pathlib.Path(sys.argv[2])
for name in wheel.namelist():
    path = pathlib.PurePosixPath(name)
    if name.endswith("/") or ".." in path.parts:
        continue
    if path.parts[0] == "mujoco" and path.name.startswith("libmujoco.so."):
        place = out / "lib" / path.name
    elif name.startswith("mujoco/include/"):
        place = out / "include" / path.relative_to("mujoco/include")
    elif "licen" in name.lower() or "notice" in name.lower():
        place = out / "licences" / path.name
    else:
        continue
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(wheel.read(name))
"#;

/// Makes sure that `target/mujoco/lib/libmujoco.so` is there.
pub(super) fn ensure() -> Result<()> {
    // `.cargo/config.toml` names this place for the linker, so it does not follow CARGO_TARGET_DIR.
    let folder = shell::root().join("target").join("mujoco");
    unpacked(&folder)?;
    // Executables look for the library beside the folder they are in, so another build folder needs a way there.
    let beside = shell::target_dir().join("mujoco");
    if !beside.exists() {
        fs::create_dir_all(shell::target_dir())?;
        std::os::unix::fs::symlink(&folder, &beside)
            .with_context(|| format!("cannot make the link {}", beside.display()))?;
    }
    Ok(())
}

/// Fetches and unpacks the library into `folder`, unless it is there.
fn unpacked(folder: &Path) -> Result<()> {
    let stamp = folder.join("wheel.sha256");
    let library = folder.join("lib").join("libmujoco.so");
    if library.exists() && fs::read_to_string(&stamp).is_ok_and(|hash| hash == WHEEL_HASH) {
        return Ok(());
    }
    anyhow::ensure!(
        cfg!(all(target_os = "linux", target_arch = "x86_64")),
        "the MuJoCo library is fetched for x86-64 Linux only; elsewhere put libmujoco {VERSION} into {}",
        folder.join("lib").display()
    );
    shell::note(&format!("fetching MuJoCo {VERSION} (26 MB, hash-checked)"));
    let download = folder.join("download");
    let _ = fs::remove_dir_all(folder);
    fs::create_dir_all(&download).with_context(|| format!("cannot create {}", download.display()))?;
    fetch(&download).context("cannot fetch the MuJoCo wheel")?;
    let wheel = fs::read_dir(&download)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .find(|path| path.extension().is_some_and(|extension| extension == "whl"))
        .context("pip downloaded no wheel")?;
    shell::run(Command::new("python3").args(["-c", UNPACK]).arg(&wheel).arg(folder))
        .context("cannot unpack the MuJoCo wheel")?;
    std::os::unix::fs::symlink(format!("libmujoco.so.{VERSION}"), &library)
        .with_context(|| format!("cannot make the link {}", library.display()))?;
    fs::remove_dir_all(&download)?;
    // Last, so that an interrupted run starts over.
    fs::write(&stamp, WHEEL_HASH)?;
    Ok(())
}

/// Lets pip fetch the one wheel with the one hash.
fn fetch(download: &Path) -> Result<()> {
    let requirements = download.join("requirements.txt");
    fs::write(&requirements, format!("mujoco=={VERSION} --hash=sha256:{WHEEL_HASH}\n"))?;
    let mut pip = pip()?;
    pip.args(["download", "--quiet", "--disable-pip-version-check", "--no-deps"])
        .args(["--only-binary=:all:", "--platform", "manylinux_2_28_x86_64"])
        .args(["--python-version", "3.11", "--implementation", "cp", "--require-hashes"])
        .arg("--requirement")
        .arg(&requirements)
        .arg("--dest")
        .arg(download);
    shell::run(&mut pip)
}

/// A working pip: that of python3, or one installed for the purpose.
fn pip() -> Result<Command> {
    let of = |python: &str| {
        let mut command = Command::new(python);
        command.args(["-m", "pip"]);
        command
    };
    if shell::succeeds(of("python3").arg("--version")) {
        return Ok(of("python3"));
    }
    apt::install(&["python3-pip"], "fetches the MuJoCo library")?;
    // The python3 found first may be another one than Debian's, which now has pip.
    Ok(of("/usr/bin/python3"))
}
