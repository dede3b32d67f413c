//! The compiler for Cortex-M: rustup's target where it can be fetched, else Debian's compiler with its library source.
//!
//! `TACTUS_TOOLCHAIN=rustup|debian` forces one of the two.

use std::path::PathBuf;
use std::process::Command;
use std::time::Duration;

use anyhow::{Context, Result, bail};

use super::apt;
use crate::shell;

/// Target of the arm image: Cortex-M4F and M7, hardware floating point.
pub(crate) const ARM: &str = "thumbv7em-none-eabihf";

/// Target of a hand board: Cortex-M3, no floating point.
pub(crate) const HAND: &str = "thumbv7m-none-eabi";

/// Patience with rustup; a machine that cannot reach its server often hangs instead of failing.
const RUSTUP_LIMIT: Duration = Duration::from_secs(120);

/// Debian's current compiler and the source of its library.
const DEBIAN_PACKAGES: [&str; 2] = ["rustc-web", "rust-web-src"];

/// Oldest compiler that builds this workspace.
const OLDEST_RUSTC: &str = env!("CARGO_PKG_RUST_VERSION");

/// Where Debian's compiler stands, whatever else is on the PATH.
const DEBIAN_RUSTC: &str = "/usr/bin/rustc";

/// Way of compiling Cortex-M code on this machine.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(crate) enum Toolchain {
    /// The active toolchain has the targets.
    Rustup,
    /// Debian's compiler builds `core` from source.
    Debian,
}

impl Toolchain {
    /// `cargo <verb> --target <target>` in this toolchain; more arguments may follow.
    pub(crate) fn cargo(self, verb: &str, target: &str) -> Result<Command> {
        let mut command = shell::cargo();
        command.args([verb, "--target", target]);
        command.env("CARGO_TARGET_DIR", self.folder());
        if self == Self::Debian {
            command.args(["-Z", "build-std=core"]).env("RUSTC", DEBIAN_RUSTC).env("RUSTC_BOOTSTRAP", "1");
            let linker = linker()?;
            let mut path = linker.into_os_string();
            path.push(":");
            path.push(std::env::var_os("PATH").unwrap_or_default());
            command.env("PATH", path);
        }
        Ok(command)
    }

    /// Where [`Self::cargo`] leaves what it built for a target and a profile.
    pub(crate) fn output(self, target: &str, profile: &str) -> PathBuf {
        self.folder().join(target).join(profile)
    }

    /// Two compilers must not share a build folder: each would throw away what the other built.
    fn folder(self) -> PathBuf {
        shell::target_dir().join(match self {
            Self::Rustup => "cross",
            Self::Debian => "cross-debian",
        })
    }

    /// True if clippy can check Cortex-M code: its driver must match the compiler of the library.
    pub(crate) fn has_clippy(self) -> bool {
        self == Self::Rustup
    }
}

/// Finds or installs a compiler for both targets.
pub(super) fn ensure() -> Result<Toolchain> {
    let choice = std::env::var("TACTUS_TOOLCHAIN").ok();
    let toolchain = match choice.as_deref() {
        None if has_targets() || add_targets() => Toolchain::Rustup,
        None => {
            shell::note("rustup cannot fetch the Cortex-M targets: using Debian's compiler");
            debian()?
        }
        Some("rustup") if has_targets() || add_targets() => Toolchain::Rustup,
        Some("rustup") => {
            bail!("rustup cannot fetch them; to repeat: rustup target add {ARM} {HAND}")
        }
        Some("debian") => debian()?,
        Some(other) => bail!("TACTUS_TOOLCHAIN is '{other}'; it may be 'rustup' or 'debian'"),
    };
    shell::note(match toolchain {
        Toolchain::Rustup => "Cortex-M: targets of the active Rust toolchain",
        Toolchain::Debian => "Cortex-M: Debian's compiler, core built from source",
    });
    Ok(toolchain)
}

/// Makes sure that rustfmt and clippy exist.
pub(super) fn ensure_lints() -> Result<()> {
    let has = |tool: &str| shell::succeeds(shell::cargo().args([tool, "--version"]));
    if has("fmt") && has("clippy") {
        return Ok(());
    }
    shell::note("adding rustfmt and clippy to the Rust toolchain");
    shell::run(Command::new("rustup").args(["component", "add", "rustfmt", "clippy"]))
        .context("rustfmt or clippy is missing and rustup cannot add it")
}

fn sysroot() -> Result<PathBuf> {
    let mut rustc = Command::new("rustc");
    let path = shell::capture(rustc.args(["--print", "sysroot"]).current_dir(shell::root()))?;
    Ok(PathBuf::from(path.trim()))
}

fn has_targets() -> bool {
    let Ok(sysroot) = sysroot() else { return false };
    let library = sysroot.join("lib").join("rustlib");
    [ARM, HAND].iter().all(|target| library.join(target).join("lib").is_dir())
}

fn add_targets() -> bool {
    shell::note(&format!("rustup target add {ARM} {HAND}"));
    let mut command = Command::new("rustup");
    command.args(["target", "add", ARM, HAND]).current_dir(shell::root());
    shell::succeeds_within(&mut command, RUSTUP_LIMIT) && has_targets()
}

fn debian() -> Result<Toolchain> {
    let missing: Vec<&str> = DEBIAN_PACKAGES.into_iter().filter(|package| !apt::is_installed(package)).collect();
    if !missing.is_empty() {
        apt::install(&missing, "compiler for Cortex-M")?;
    }
    let version = shell::capture(Command::new(DEBIAN_RUSTC).arg("--version"))?;
    anyhow::ensure!(
        is_recent(&version),
        "Debian's compiler is too old ({}; {OLDEST_RUSTC} is needed): apt's sources must hold the security updates of \
         this release",
        version.trim()
    );
    linker()?;
    Ok(Toolchain::Debian)
}

/// True if `rustc 1.96.0 (...)` is at least [`OLDEST_RUSTC`].
fn is_recent(version: &str) -> bool {
    let numbers = |text: &str| -> Option<(u32, u32)> {
        let mut parts = text.split('.');
        Some((parts.next()?.parse().ok()?, parts.next()?.parse().ok()?))
    };
    let found = version.split_whitespace().nth(1).and_then(numbers);
    found.is_some() && found >= numbers(OLDEST_RUSTC)
}

/// Folder of `rust-lld`, which Debian's compiler does not bring along.
fn linker() -> Result<PathBuf> {
    let folder =
        sysroot()?.join("lib/rustlib").join(format!("{}-unknown-linux-gnu", std::env::consts::ARCH)).join("bin");
    anyhow::ensure!(
        folder.join("rust-lld").exists(),
        "the active Rust toolchain has no rust-lld in {}",
        folder.display()
    );
    Ok(folder)
}

#[cfg(test)]
mod tests {
    use super::is_recent;

    #[test]
    fn an_old_or_unreadable_compiler_is_not_recent() {
        assert!(is_recent("rustc 1.96.0 (ac68faa20 2026-05-25) (built from a source tarball)"));
        assert!(is_recent("rustc 2.0.0"));
        assert!(!is_recent("rustc 1.85.0"));
        assert!(!is_recent("something else"));
    }
}
