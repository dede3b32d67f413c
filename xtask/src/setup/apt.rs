//! Debian packages: installs them as root or through sudo, or says what to type.

use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::shell;

/// True if this machine has apt at all.
pub(super) fn is_present() -> bool {
    shell::succeeds(Command::new("apt-get").arg("--version"))
}

/// True if a package is installed.
pub(super) fn is_installed(package: &str) -> bool {
    Command::new("dpkg-query")
        .args(["--show", "--showformat=${db:Status-Status}", package])
        .output()
        .is_ok_and(|output| output.status.success() && output.stdout == b"installed")
}

/// Version that `install` would bring, by the package lists of this machine.
pub(super) fn candidate(package: &str) -> Option<String> {
    let output = Command::new("apt-cache").args(["policy", package]).env("LC_ALL", "C").output().ok()?;
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let version = text.lines().find_map(|line| line.trim().strip_prefix("Candidate:"))?.trim();
    (version != "(none)").then(|| version.to_owned())
}

/// Installs packages from the machine's own sources; `reason` tells the user what they are for.
///
/// # Errors
/// If there is no apt, no right to install, or apt fails: the message holds the command to type.
pub(super) fn install(packages: &[&str], reason: &str) -> Result<()> {
    if !is_present() {
        bail!("{reason}: this machine has no apt; install by hand what Debian calls {}", packages.join(" "));
    }
    require_right(packages)?;
    shell::note(&format!("installing {} ({reason})", packages.join(" ")));
    let mut arguments = vec!["install", "-y", "--no-install-recommends"];
    arguments.extend(packages);
    // Package lists are often absent (fresh containers) or stale: refresh them only if they turn out useless.
    if run(&arguments).is_err() {
        update()?;
        run(&arguments)?;
    }
    Ok(())
}

/// Refreshes the package lists of the machine's own sources.
pub(super) fn update() -> Result<()> {
    run(&["update"])
}

/// Installs a package from the backports of this Debian release, without changing the machine's list of sources.
///
/// # Errors
/// If the release has no backports, they cannot be reached, or there is no right to install.
pub(super) fn install_from_backports(package: &str) -> Result<()> {
    require_right(&[package])?;
    let (site, codename) = mirror()?;
    let release = format!("{codename}-backports");
    shell::note(&format!("installing {package} from {release}"));
    let folder = shell::target_dir().join("setup");
    fs::create_dir_all(&folder)?;
    let list = folder.join("backports.list");
    // The option replaces /etc/apt/sources.list, so what stands there must stand here too.
    let own = fs::read_to_string("/etc/apt/sources.list").unwrap_or_default();
    fs::write(&list, format!("{own}\ndeb {site} {release} main\n"))
        .with_context(|| format!("cannot write {}", list.display()))?;
    let source = format!("Dir::Etc::SourceList={}", list.display());
    run(&["-o", &source, "update"])?;
    run(&["-o", &source, "install", "-y", "--no-install-recommends", "-t", &release, package])
}

/// Mirror and code name of this Debian release, as the machine's own sources give them.
fn mirror() -> Result<(String, String)> {
    let release = fs::read_to_string("/etc/os-release").context("cannot read /etc/os-release")?;
    let codename = release
        .lines()
        .find_map(|line| line.strip_prefix("VERSION_CODENAME="))
        .context("/etc/os-release names no release")?
        .trim_matches('"')
        .to_owned();
    let targets = shell::capture(Command::new("apt-get").args(["indextargets", "--format", "$(SITE) $(RELEASE)"]))?;
    targets
        .lines()
        .filter_map(|line| line.split_once(' '))
        .find(|(_, suite)| *suite == codename || *suite == "stable")
        .map(|(site, _)| (site.to_owned(), codename))
        .context("apt's sources name no mirror of this release")
}

fn run(arguments: &[&str]) -> Result<()> {
    let mut command = if is_root() {
        Command::new("apt-get")
    } else {
        let mut sudo = Command::new("sudo");
        sudo.args(["env", "DEBIAN_FRONTEND=noninteractive", "apt-get"]);
        sudo
    };
    command.env("DEBIAN_FRONTEND", "noninteractive").args(["-q", "-o", "DPkg::Lock::Timeout=300"]).args(arguments);
    // apt's stdout is chatter to us: data go to stdout, words to stderr.
    command.stdout(std::io::stderr());
    shell::run(&mut command)
}

/// Fails, with the command to type, where we may not install these packages.
pub(super) fn require_right(packages: &[&str]) -> Result<()> {
    if is_root() || shell::succeeds(Command::new("sudo").args(["-n", "true"])) || has_terminal_sudo() {
        return Ok(());
    }
    bail!(
        "neither root nor sudo; please run as root\n    apt-get update && apt-get install -y --no-install-recommends \
         {}\n  and start again",
        packages.join(" ")
    );
}

fn is_root() -> bool {
    use std::os::unix::fs::MetadataExt;
    fs::metadata("/proc/self").is_ok_and(|meta| meta.uid() == 0)
}

/// sudo may ask for a password where a person sits; elsewhere a question would hang a script for ever.
fn has_terminal_sudo() -> bool {
    use std::io::IsTerminal;
    std::io::stdin().is_terminal() && Path::new("/usr/bin/sudo").exists()
}
