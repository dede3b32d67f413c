//! `tactus doctor`: looks at everything that a command needs, and says what to do where something is missing.

use std::fs::Metadata;
use std::os::unix::fs::MetadataExt as _;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use clap::Args;
use control::{Fault, State};
use device::Stage;
use lab::client::Client;
use lab::device::Device;
use lab::transport::{Address, SimulatorKind};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, connection, files};
use crate::config::Origin;
use crate::probe::PROBE_RS;

/// Options of `doctor`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Write all of it into a file too, JSON: for a report of a defect
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

/// Judgement of one thing.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum Verdict {
    /// It is as it should be.
    Ok,
    /// Some commands cannot be used.
    Warn,
    /// The device that is named cannot be used.
    Fail,
}

/// One thing that was looked at.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Finding {
    /// Its name.
    pub subject: String,
    /// The judgement.
    pub verdict: Verdict,
    /// Its state.
    pub found: String,
    /// The remedy; `null`: nothing is to be done.
    pub help: Option<String>,
}

/// Everything that was looked at.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Examined {
    /// In the order in which a connection needs it.
    pub findings: Vec<Finding>,
}

const DOING: &str = "doctor";

/// Looks at tool, settings, ports, programs and device.
///
/// # Errors
/// The device that is named cannot be used, or the report cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let report = command.report.as_deref().map(|path| files::create(path, global, &[], DOING)).transpose()?;
    let mut examined = Examined { findings: vec![tool()] };
    examined.findings.extend(settings(global));
    examined.findings.extend(serial_ports(Path::new("/dev")));
    let address = global.address(DOING);
    let kind = match &address {
        Ok(Some(Address::Simulated(kind, _))) => Some(*kind),
        _ => None,
    };
    examined.findings.extend(programs(kind));
    let failure = match address {
        Ok(Some(_)) => examine_device(global, &mut examined.findings).err(),
        Ok(None) => None,
        Err(failure) => Some(failure),
    };
    if let Some(failure) = &failure {
        let found = format!("{}: {}", failure.code, failure.cause);
        examined.findings.push(finding("device", Verdict::Fail, found, failure.help.clone()));
    }
    let data =
        serde_json::to_value(&examined).map_err(|cause| Failure::new(ErrorCode::ResultNotWritten, DOING, cause))?;
    if let (Some(file), Some(path)) = (report, &command.report) {
        files::fill(file, format!("{data:#}\n").as_bytes(), DOING)?;
        global.output().say(format!("wrote {}", path.display()));
    }
    match failure {
        // Its object has the findings as well.
        Some(failure) if global.json => Err(failure.data(data)),
        failure => {
            global.output().result(&examined, text(&examined))?;
            failure.map_or(Ok(()), Err)
        }
    }
}

fn text(examined: &Examined) -> String {
    let width = examined.findings.iter().map(|finding| finding.subject.chars().count()).max().unwrap_or(0);
    let mut text = String::new();
    for Finding { subject, verdict, found, help } in &examined.findings {
        let verdict = match verdict {
            Verdict::Ok => "ok  ",
            Verdict::Warn => "warn",
            Verdict::Fail => "FAIL",
        };
        text += &format!("{verdict}  {subject:width$}  {found}\n");
        if let Some(help) = help {
            text += &format!("      {:width$}  help: {help}\n", "");
        }
    }
    text
}

fn finding(subject: &str, verdict: Verdict, found: impl Into<String>, help: Option<String>) -> Finding {
    Finding { subject: subject.to_owned(), verdict, found: found.into(), help }
}

fn tool() -> Finding {
    let found = format!(
        "{} (link {}, schema 0x{:08x}, robot model 0x{:08x}) on {} {}",
        env!("CARGO_PKG_VERSION"),
        link::LINK_VERSION,
        link::SCHEMA_HASH,
        control::MODEL_HASH,
        std::env::consts::OS,
        std::env::consts::ARCH
    );
    finding("tactus", Verdict::Ok, found, None)
}

/// The configuration file, and the settings with the place each comes from.
fn settings(global: &Global) -> [Finding; 3] {
    let origins = &global.origins;
    let place =
        origins.file.as_deref().map_or_else(|| "neither XDG_CONFIG_HOME nor HOME is set".to_owned(), files::text);
    let file = match &origins.problem {
        Some(problem) => {
            let help = ErrorCode::Configuration.remedy().to_owned();
            finding("configuration file", Verdict::Warn, format!("it is ignored: {problem}"), Some(help))
        }
        None if origins.file.as_ref().is_some_and(|file| file.exists()) => {
            finding("configuration file", Verdict::Ok, place, None)
        }
        None => {
            finding("configuration file", Verdict::Ok, format!("{place} (does not exist: defaults are used)"), None)
        }
    };
    let named = match &global.device {
        Some(device) => {
            finding("device setting", Verdict::Ok, format!("{device}, from {}", from(origins.device)), None)
        }
        None => {
            let help = ErrorCode::NoDeviceNamed.remedy().to_owned();
            finding("device setting", Verdict::Warn, "no device is named, so none was asked", Some(help))
        }
    };
    let timeout = format!("{} s, from {}", global.timeout.as_secs_f64(), from(origins.timeout));
    [file, named, finding("timeout setting", Verdict::Ok, timeout, None)]
}

fn from(origin: Origin) -> &'static str {
    match origin {
        Origin::CommandLine => "the command line",
        Origin::Environment => "the environment",
        Origin::File => "the configuration file",
        Origin::Default => "the tool",
    }
}

/// The serial ports of boards and USB adapters in the folder of devices. None is opened: that can restart a board.
fn serial_ports(folder: &Path) -> Vec<Finding> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let is_port = |path: &PathBuf| {
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        name.starts_with("ttyACM") || name.starts_with("ttyUSB")
    };
    let mut ports: Vec<PathBuf> = entries.map(|entry| entry.path()).filter(is_port).collect();
    ports.sort();
    let identity = Identity::read();
    let judge = |path: &PathBuf| {
        let subject = files::text(path);
        match path.metadata() {
            Ok(found) if identity.as_ref().is_none_or(|identity| identity.may_use(&found)) => {
                finding(&subject, Verdict::Ok, "this user may use it", None)
            }
            Ok(found) => {
                let found = format!(
                    "this user may not use it: it is for group {}, mode {:o}",
                    found.gid(),
                    found.mode() & 0o777
                );
                let help = "`sudo usermod -aG dialout $USER` (the group `ls -l` shows), then log in anew".to_owned();
                finding(&subject, Verdict::Warn, found, Some(help))
            }
            Err(cause) => finding(&subject, Verdict::Warn, cause.to_string(), None),
        }
    };
    if ports.is_empty() {
        return vec![finding("serial ports", Verdict::Ok, "none: no board and no adapter is plugged in", None)];
    }
    ports.iter().map(judge).collect()
}

/// User and groups of this process.
struct Identity {
    user: u32,
    groups: Vec<u32>,
}

impl Identity {
    /// From the system; `None` where it does not tell.
    fn read() -> Option<Self> {
        Self::parse(&std::fs::read_to_string("/proc/self/status").ok()?)
    }

    fn parse(status: &str) -> Option<Self> {
        let numbers = |name: &str| {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            Some(line.split_whitespace().filter_map(|word| word.parse().ok()).collect::<Vec<u32>>())
        };
        // The second number is the one that counts for files.
        let user = *numbers("Uid:")?.get(1)?;
        let mut groups = numbers("Groups:")?;
        groups.push(*numbers("Gid:")?.get(1)?);
        Some(Self { user, groups })
    }

    /// True if it may read and write a file.
    fn may_use(&self, file: &Metadata) -> bool {
        self.may(file.uid(), file.gid(), file.mode())
    }

    fn may(&self, owner: u32, group: u32, mode: u32) -> bool {
        let bits = if self.user == owner {
            mode >> 6
        } else if self.groups.contains(&group) {
            mode >> 3
        } else {
            mode
        };
        self.user == 0 || bits & 0o6 == 0o6
    }
}

/// The programs of others, and what was built in. QEMU is a failure only for a device that needs it.
fn programs(kind: Option<SimulatorKind>) -> [Finding; 3] {
    let program = |subject: &str, name: &str, missing: Verdict, needed: &str, code: ErrorCode| match version(name) {
        Some(version) => finding(subject, Verdict::Ok, version, None),
        None => {
            finding(subject, missing, format!("`{name}` cannot be started; {needed}"), Some(code.remedy().to_owned()))
        }
    };
    let probe =
        program("debug probe", PROBE_RS, Verdict::Warn, "`tactus flash` and `logs` need it", ErrorCode::ProbeRsMissing);
    let needs_qemu = matches!(kind, Some(SimulatorKind::Qemu | SimulatorKind::Hand));
    let missing = if needs_qemu { Verdict::Fail } else { Verdict::Warn };
    let needed = "devices `sim:` and `hand:` need it";
    let qemu = program("QEMU", "qemu-system-arm", missing, needed, ErrorCode::NoQemu);
    let mujoco = if cfg!(feature = "mujoco") {
        finding("MuJoCo", Verdict::Ok, "built in", None)
    } else {
        let help = ErrorCode::WithoutMujoco.remedy().to_owned();
        finding("MuJoCo", Verdict::Warn, "not built in: simulated arms have the simple world only", Some(help))
    };
    [probe, qemu, mujoco]
}

/// The first line a program says of its version.
fn version(program: &str) -> Option<String> {
    let output = Command::new(program).arg("--version").stdin(Stdio::null()).output().ok()?;
    let said = String::from_utf8_lossy(&output.stdout).lines().next().unwrap_or_default().trim().to_owned();
    output.status.success().then_some(said)
}

/// The device, as an observer: whoever has its arm keeps it.
fn examine_device(global: &Global, findings: &mut Vec<Finding>) -> Result<(), Failure> {
    let mut client: Client<Device> = connection::observe(global, DOING)?;
    let hello = client.hello();
    let found = format!(
        "{}, firmware {}, serial number {}",
        hello.board.as_str(),
        hello.firmware.as_str(),
        hello.serial.as_str()
    );
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    let stage = Stage::from_code(status.startup_stage).map_or("unknown", Stage::explanation);
    let state = State::from_code(status.state).map_or("unknown", State::name);
    findings.push(finding("device", Verdict::Ok, found, None));
    findings.push(finding("arm", Verdict::Ok, format!("{state}; {stage}"), None));
    findings.push(match Fault::from_code(status.fault).filter(|fault| *fault != Fault::None) {
        Some(fault) => finding("fault", Verdict::Warn, fault.to_string(), Some("`tactus faults`".to_owned())),
        None => finding("fault", Verdict::Ok, "none", None),
    });
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_right_to_use_a_port_is_that_of_owner_group_or_others_whichever_comes_first() {
        let status = "Uid:\t1000\t1000\t1000\t1000\nGid:\t1000\t1001\t0\t0\nGroups:\t4 20 \n";
        let person = Identity::parse(status).unwrap();
        assert!(person.may(0, 20, 0o660) && person.may(0, 1001, 0o660) && person.may(1000, 5, 0o600));
        assert!(!person.may(0, 5, 0o660) && !person.may(0, 20, 0o640) && person.may(0, 5, 0o666));
        assert!(!person.may(1000, 20, 0o060), "the owner's own right counts before the group's");
        assert!(Identity { user: 0, groups: Vec::new() }.may(1, 1, 0));
        assert!(Identity::parse("Uid:\n").is_none());
    }

    #[test]
    fn a_port_is_listed_by_its_name_and_a_folder_without_any_says_so() {
        let folder = tempfile::tempdir().unwrap();
        assert_eq!(serial_ports(folder.path())[0].subject, "serial ports");
        for name in ["ttyUSB1", "ttyACM0", "tty0"] {
            std::fs::write(folder.path().join(name), "").unwrap();
        }
        let names: Vec<String> = serial_ports(folder.path()).into_iter().map(|finding| finding.subject).collect();
        assert!(names.len() == 2 && names[0].ends_with("ttyACM0") && names[1].ends_with("ttyUSB1"), "{names:?}");
    }
}
