//! `CalibrationReport`: what a calibration found, in a file, with the arm it belongs to and the time.

use std::path::{Path, PathBuf};

use lab::client::Client;
use lab::device::Device;
use lab::error_code::Exit;
use lab::output_file::OutputFile;
use serde::Serialize;
use serde_json::{Value, json};

use super::{Failure, Global, files};

/// Names the layout of the file.
const SCHEMA: &str = "tactus-calibration/1";

/// A report that was asked for, or none.
pub(super) struct CalibrationReport {
    opened: Option<(OutputFile, PathBuf)>,
    serial: String,
    device: Option<String>,
    firmware: Option<String>,
    date: Option<String>,
}

impl CalibrationReport {
    /// Opens the file, before anything moves. In a folder it is named with serial number and time.
    ///
    /// # Errors
    /// It cannot be written, or is there already, or is one of `inputs`.
    pub(super) fn open(
        path: Option<&Path>,
        inputs: &[&Path],
        client: &Client<Device>,
        global: &Global,
        doing: &str,
    ) -> Result<Self, Failure> {
        let origin = files::origin(client, None);
        let serial = client.hello().serial.as_str().to_owned();
        let path = path
            .map(|path| if path.is_dir() { path.join(name(&serial, origin.date.as_deref())) } else { path.to_owned() });
        let opened = path.map(|path| Ok((files::create(&path, global, inputs, doing)?, path))).transpose()?;
        Ok(Self { opened, serial, device: origin.device, firmware: origin.firmware, date: origin.date })
    }

    /// Writes what was found, whether or not the device keeps it; `is_kept` is none where nobody knows.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn write(
        self,
        action: &str,
        is_kept: Option<bool>,
        found: &Value,
        global: &Global,
    ) -> Result<(), Failure> {
        let Some((file, path)) = self.opened else { return Ok(()) };
        let report = json!({
            "schema": SCHEMA, "action": action, "serial": self.serial, "device": self.device, "firmware": self.firmware,
            "date": self.date, "kept": is_kept, "found": found,
        });
        files::fill(file, format!("{report:#}\n").as_bytes(), "calibrate")?;
        global.output().say(format!("wrote {}", path.display()));
        Ok(())
    }
}

/// True if the device keeps what it was to keep, as it answered; `None` if its answer was lost with the line. That is
/// said, with the command that looks.
pub(super) fn is_kept<T>(told: &Result<T, Failure>, look: &str, global: &Global) -> Option<bool> {
    let Err(failure) = told else { return Some(true) };
    if failure.code.exit() != Exit::LinkLost {
        return Some(false);
    }
    global.output().say(format!("no answer came: whether the device keeps it `{look}` tells"));
    None
}

/// Tells what was found, also where its report could not be written: minutes of measuring are not lost with a disk.
///
/// # Errors
/// The failure of the report, or standard output does not take it.
pub(super) fn tell(
    written: Result<(), Failure>,
    found: &impl Serialize,
    text: impl AsRef<str>,
    global: &Global,
) -> Result<(), Failure> {
    let Err(failure) = written else { return global.output().result(found, text) };
    if !global.json {
        global.output().result(found, text)?;
    }
    Err(match serde_json::to_value(found) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// Name of a report: serial number and time, without what a file name cannot have everywhere.
fn name(serial: &str, date: Option<&str>) -> String {
    let plain = |text: &str| -> String {
        text.chars().map(|letter| if letter.is_ascii_alphanumeric() { letter } else { '-' }).collect()
    };
    match date {
        Some(date) => format!("calibration-{}-{}.json", plain(serial), plain(date)),
        None => format!("calibration-{}.json", plain(serial)),
    }
}

#[cfg(test)]
mod tests {
    use super::name;

    #[test]
    fn a_report_is_named_by_arm_and_time_with_letters_that_every_system_takes() {
        assert_eq!(name("1A/2", Some("2026-01-02T03:04:05Z")), "calibration-1A-2-2026-01-02T03-04-05Z.json");
        assert_eq!(name("simulated", None), "calibration-simulated.json");
    }
}
