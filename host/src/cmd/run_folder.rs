//! `RunFolder`: a folder with all about one run, whatever its end: primitive, recording, result, report.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use link::DeviceHello;
use serde_json::json;

use super::run_report::Report;
use super::{Failure, files};
use lab::demonstration::Origin;
use lab::output_file::{self, OutputError};
use lab::primitive_file::PrimitiveFile;
use lab::report::{ReportedRun, page};

const DOING: &str = "run";

/// Names the layout of `run.json`.
const SCHEMA: &str = "tactus-run/1";

/// Most folders of runs of one name within one second.
const MOST_A_SECOND: u32 = 99;

/// The folder of one run: `DATE-NAME` with `primitive.toml`, `run.csv`, `run.json` and `report.html`.
#[derive(Debug)]
pub(super) struct RunFolder {
    path: PathBuf,
    primitive: PrimitiveFile,
}

impl RunFolder {
    /// Makes it, with the primitive in it, before anything moves.
    ///
    /// # Errors
    /// The system refuses.
    pub(super) fn create(base: &Path, primitive: &PrimitiveFile) -> Result<Self, Failure> {
        let failed =
            |path: &Path, cause| files::failure(OutputError::System { file: path.to_owned(), cause }, "run refused");
        files::create_folder(base, "run refused")?;
        let path = unused(base, &Origin::now(), &primitive.name).map_err(|cause| failed(base, cause))?;
        let file = path.join("primitive.toml");
        primitive.write(&file).map_err(|cause| super::check::failure(cause, &file, "run"))?;
        Ok(Self { path, primitive: primitive.clone() })
    }

    /// Takes away the folder of a run that did not begin.
    pub(super) fn discard(&self) {
        let _ = fs::remove_file(self.path.join("primitive.toml"));
        // What somebody else has put there stays.
        let _ = fs::remove_dir(&self.path);
    }

    /// Where it is.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Where the recording goes.
    pub(super) fn recording(&self) -> PathBuf {
        self.path.join("run.csv")
    }

    /// Writes the result of the run and the page about it. What was recorded before a failure becomes the recording.
    ///
    /// # Errors
    /// The system refuses; of a run that has failed, its failure counts instead.
    pub(super) fn finish(&self, ended: &mut Result<Report, Failure>, hello: &DeviceHello) -> Result<(), Failure> {
        let DeviceHello { board, firmware, serial, .. } = hello;
        let mut data = json!({
            "schema": SCHEMA, "tactus": env!("CARGO_PKG_VERSION"),
            "device": { "board": board.as_str(), "firmware": firmware.as_str(), "serial": serial.as_str() },
            "command": std::env::args_os().map(|word| word.to_string_lossy().into_owned()).collect::<Vec<_>>(),
        });
        let recording = self.recording();
        match ended {
            Ok(report) => data["result"] = json!(report),
            Err(failure) => {
                if let Some(part) = failure.kept.take() {
                    // It is all that will ever be there.
                    let is_named = fs::rename(&part, &recording).is_ok();
                    failure.kept = Some(if is_named { recording.clone() } else { part });
                }
                let told = failure.to_json();
                data["error"] = told["error"].clone();
                data["result"] = told["result"].clone();
            }
        }
        self.write("run.json", &format!("{data:#}\n"))?;
        // A recording of nothing, or none, has no page.
        if let Ok(run) = ReportedRun::read(&recording, Some(&self.primitive)) {
            self.write("report.html", &page(&self.primitive.name, &[run], Some(&self.primitive)))?;
        }
        Ok(())
    }

    fn write(&self, name: &str, text: &str) -> Result<(), Failure> {
        output_file::replace(&self.path.join(name), text.as_bytes()).map_err(|error| files::failure(error, DOING))
    }
}

/// Makes a folder that was not there: named by moment and primitive, with a number if need be.
fn unused(base: &Path, date: &str, name: &str) -> io::Result<PathBuf> {
    // Colons are no letters of a file name everywhere.
    let stem = format!("{}-{name}", date.trim_end_matches('Z').replace(':', "-"));
    let mut taken = io::ErrorKind::AlreadyExists.into();
    for number in 1..=MOST_A_SECOND {
        let path = base.join(if number == 1 { stem.clone() } else { format!("{stem}-{number}") });
        match fs::create_dir(&path) {
            Ok(()) => return Ok(path),
            Err(cause) if cause.kind() == io::ErrorKind::AlreadyExists => taken = cause,
            Err(cause) => return Err(cause),
        }
    }
    Err(taken)
}

#[cfg(test)]
mod tests {
    use super::unused;

    #[test]
    fn folders_of_the_same_moment_are_told_apart_and_none_is_used_twice() {
        let base = tempfile::tempdir().unwrap();
        let made = |_| unused(base.path(), "2026-01-02T03:04:05Z", "reach").unwrap();
        let names: Vec<_> = (0..3).map(made).map(|path| path.file_name().unwrap().to_owned()).collect();
        assert_eq!(names, ["2026-01-02T03-04-05-reach", "2026-01-02T03-04-05-reach-2", "2026-01-02T03-04-05-reach-3"]);
    }
}
