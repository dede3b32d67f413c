//! QEMU for Cortex-M, version 10 or newer where it can be had.
//!
//! Older versions run virtual time at the wrong rate when a sleeping core meets `-icount sleep=off`, so on those the
//! image is built with an idle loop that spins (3 to 12 times slower).

use std::process::Command;

use anyhow::{Context, Result};

use super::apt;
use crate::shell;

/// First major version on which the image may sleep in its idle loop.
const SLEEPING_VERSION: u32 = 10;

/// First major version known to run the image at all.
const OLDEST_VERSION: u32 = 7;

const PROGRAM: &str = "qemu-system-arm";

/// The emulator of this machine.
pub(crate) struct Qemu {
    /// Major version.
    pub(crate) major: u32,
}

impl Qemu {
    /// True if the image may sleep while idle.
    pub(crate) fn may_sleep(&self) -> bool {
        self.major >= SLEEPING_VERSION
    }
}

/// Finds or installs the emulator.
pub(super) fn ensure() -> Result<Qemu> {
    if version().is_none_or(|major| major < SLEEPING_VERSION) && apt::is_present() {
        install()?;
    }
    let major = version().with_context(|| {
        format!("{PROGRAM} is missing: install QEMU {SLEEPING_VERSION} or newer with its ARM system emulator")
    })?;
    anyhow::ensure!(major >= OLDEST_VERSION, "{PROGRAM} {major} is too old: {SLEEPING_VERSION} or newer is needed");
    let qemu = Qemu { major };
    let idle = if qemu.may_sleep() { "sleeps" } else { "spins: slower" };
    shell::note(&format!("{PROGRAM} {major} (idle loop {idle})"));
    Ok(qemu)
}

fn install() -> Result<()> {
    let have_one = version().is_some();
    if !have_one {
        apt::require_right(&[PROGRAM])?;
    }
    // A machine that has an old emulator and cannot take a new one is still a machine that works.
    let attempt = || -> Result<()> {
        if apt::candidate(PROGRAM).is_none() {
            apt::update()?;
        }
        if major_of(apt::candidate(PROGRAM).as_deref()) >= Some(SLEEPING_VERSION) {
            return apt::install(&[PROGRAM], "emulator of the board");
        }
        apt::install_from_backports(PROGRAM)
    };
    match attempt() {
        Ok(()) => Ok(()),
        Err(error) if have_one => {
            shell::note(&format!("no newer {PROGRAM}: {error}"));
            Ok(())
        }
        Err(error) => {
            shell::note(&format!("none of version {SLEEPING_VERSION}: {error}"));
            apt::install(&[PROGRAM], "emulator of the board")
        }
    }
}

/// Major version of the installed program.
fn version() -> Option<u32> {
    let output = Command::new(PROGRAM).arg("--version").output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let number = text.split("version ").nth(1)?;
    number.split('.').next()?.parse().ok()
}

/// Major version in a Debian version such as `1:7.2+dfsg-7`.
fn major_of(package_version: Option<&str>) -> Option<u32> {
    let version = package_version?;
    let upstream = version.split_once(':').map_or(version, |(_, rest)| rest);
    let digits: String = upstream.chars().take_while(char::is_ascii_digit).collect();
    digits.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::major_of;

    #[test]
    fn debian_versions_lose_their_epoch() {
        assert_eq!(major_of(Some("1:7.2+dfsg-7+deb12u18")), Some(7));
        assert_eq!(major_of(Some("10.0.2")), Some(10));
        assert_eq!(major_of(Some("weird")), None);
        assert_eq!(major_of(None), None);
    }
}
