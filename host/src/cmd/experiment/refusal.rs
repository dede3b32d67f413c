//! Results that an experiment cannot go on with.

use std::io::ErrorKind;

use experiment::log::ResultsError;

use super::{Cmd, ErrorCode, Failure};

/// The command, in front of what it failed with.
pub(super) const DOING: &str = "experiment";
/// The same where it did not begin.
pub(super) const REFUSED: &str = "experiment refused";

/// The failure of the results in the folder that this command named.
pub(super) fn of(error: ResultsError, _command: &Cmd) -> Failure {
    match &error {
        ResultsError::Exists { .. } => Failure::new(ErrorCode::ResultsExist, REFUSED, error),
        ResultsError::OtherConfiguration { .. } => Failure::new(ErrorCode::OtherExperiment, REFUSED, error),
        ResultsError::None { .. } => Failure::new(ErrorCode::NoResults, REFUSED, error),
        ResultsError::Line { .. } => Failure::new(ErrorCode::ResultsDamaged, REFUSED, error),
        ResultsError::Place(place) => {
            Failure::new(place.code(), REFUSED, error).help("choose another folder with `--out`")
        }
        ResultsError::File { cause, .. } => match cause.kind() {
            ErrorKind::ResourceBusy => Failure::new(ErrorCode::FileFailed, REFUSED, error)
                .help("wait for the other experiment in this folder, or choose another one with `--out`"),
            ErrorKind::AlreadyExists | ErrorKind::NotADirectory => {
                Failure::new(ErrorCode::OutputNotAFile, REFUSED, error).help("name a folder with `--out`")
            }
            _ => Failure::of_file(ErrorCode::ResultsNotWritten, DOING, error),
        },
    }
}

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;

    #[derive(Debug, Parser)]
    struct Line {
        #[command(flatten)]
        command: Cmd,
    }

    fn command(line: &str) -> Cmd {
        Line::try_parse_from(["experiment"].into_iter().chain(line.split_whitespace())).unwrap().command
    }

    /// The change that makes it fail: one code for all, E124, which is that of a defect.
    #[test]
    fn what_the_user_can_mend_is_no_internal_error() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let refused = |folder: &std::path::Path| {
            let header = experiment::header::Header {
                experiment: "cup".to_owned(),
                configuration: String::new(),
                described: std::collections::BTreeMap::new(),
            };
            let opened = experiment::log::Log::open(folder, &header, true);
            opened.map_err(|error| of(error, &command("cup --resume")))
        };
        std::fs::write(at("file"), "").unwrap();
        std::fs::create_dir_all(at("nest/results.jsonl")).unwrap();
        std::fs::create_dir(at("other")).unwrap();
        std::fs::write(at("other/results.jsonl"), b"\xff\n").unwrap();
        let (log, _) = refused(&at("used")).unwrap();
        for (name, code, exit, help) in [
            ("file", "E231", 2, "name a folder"),
            ("file/below", "E231", 2, "name a folder"),
            ("nest", "E231", 2, "another folder"),
            ("other", "E661", 6, "another folder"),
            ("used", "E236", 2, "wait for the other experiment"),
        ] {
            let failure = refused(&at(name)).err().unwrap();
            assert_eq!((failure.code.to_string(), failure.code.exit() as u8), (code.to_owned(), exit), "{failure}");
            assert!(failure.help.as_ref().is_some_and(|advice| advice.contains(help)), "{failure}");
        }
        drop(log);
        let cause = ErrorKind::PermissionDenied.into();
        let failure = of(ResultsError::File { file: at("locked"), cause }, &command("cup"));
        assert_eq!(failure.code.to_string(), "E234");
    }
}
