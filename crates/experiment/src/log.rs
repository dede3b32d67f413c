//! The file of results: a header and one report a line, written as it comes, read back when an experiment is resumed.

use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Read, Write};
use std::path::{Path, PathBuf};

use lab::output_file::{self, OutputError};
use serde::Serialize;
use serde::de::{DeserializeOwned, Error as _};

use super::header::{Difference, Header, in_words};
use super::results::Report;

/// File of the reports, one a line, in the order in which the trials ended.
pub const LINES: &str = "results.jsonl";

/// Longest line, bytes: the report of a movement of an hour has about 1 MB.
const LONGEST_LINE: u64 = 16 << 20;

/// Every file of results begins with its header, and that with this.
const BEGIN: &[u8] = b"{\"experiment\":";

/// Why results cannot be kept.
#[derive(Debug, thiserror::Error)]
pub enum ResultsError {
    /// There are results already, and nobody said to go on with them.
    #[error("{} holds {trials} trials already", file.display())]
    Exists {
        /// The file.
        file: PathBuf,
        /// Their number.
        trials: usize,
    },
    /// The results that are there belong to another configuration.
    #[error("{} belongs to another configuration: {}", file.display(), in_words(differences))]
    OtherConfiguration {
        /// The file.
        file: PathBuf,
        /// The parts that differ.
        differences: Vec<Difference>,
    },
    /// Figures are asked for, and there are no results to draw.
    #[error("there are no results in {}", folder.display())]
    None {
        /// The folder.
        folder: PathBuf,
    },
    /// A line is no report.
    #[error("{}: line {line} is no report: {cause}", file.display())]
    Line {
        /// The file.
        file: PathBuf,
        /// Its number.
        line: usize,
        /// The reader's reason.
        cause: serde_json::Error,
    },
    /// The place of the file is taken by something else.
    #[error(transparent)]
    Place(#[from] OutputError),
    /// The file cannot be read or written.
    #[error("{}: {cause}", file.display())]
    File {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        #[source]
        cause: io::Error,
    },
}

/// The file of reports, open for more.
pub struct Log {
    path: PathBuf,
    file: File,
}

impl Log {
    /// Checks that there is a file in `folder`.
    ///
    /// # Errors
    /// [`ResultsError::None`].
    pub fn must_exist(folder: &Path) -> Result<(), ResultsError> {
        if folder.join(LINES).is_file() { Ok(()) } else { Err(ResultsError::None { folder: folder.to_owned() }) }
    }

    /// True if trials were played into `folder`, or into one within it: of a study or a case.
    #[must_use]
    pub fn is_begun(folder: &Path) -> bool {
        let within = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        within.chain([folder.to_owned()]).any(|folder| folder.join(LINES).is_file())
    }

    /// The header of the results in `folder`, or of those in the first one within it; `None` where there are none.
    ///
    /// # Errors
    /// [`ResultsError`]
    pub fn header(folder: &Path) -> Result<Option<Header>, ResultsError> {
        let within = std::fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
        let mut within: Vec<PathBuf> = within.collect();
        within.sort();
        let files = [folder.to_owned()].into_iter().chain(within).map(|folder| folder.join(LINES));
        let Some(path) = files.into_iter().find(|file| file.is_file()) else { return Ok(None) };
        let file = File::open(&path).map_err(|cause| ResultsError::File { file: path.clone(), cause })?;
        Lines::new(&path, &file).line()
    }

    /// Opens the file in `folder`; gives what it holds if `resume` allows that.
    ///
    /// A last line that broke off when the program was ended is cut away: that trial is tried again.
    ///
    /// # Errors
    /// [`ResultsError`], also while another program writes the file: what is cut away might be its line.
    pub fn open(folder: &Path, header: &Header, resume: bool) -> Result<(Log, Vec<Report>), ResultsError> {
        let path = folder.join(LINES);
        let failed = |cause| ResultsError::File { file: path.clone(), cause };
        std::fs::create_dir_all(folder).map_err(failed)?;
        output_file::refuse(&path, true, &[])?;
        let file = OpenOptions::new().create(true).read(true).append(true).open(&path).map_err(failed)?;
        output_file::lock(&file).map_err(failed)?;
        let (reports, length) = read(&path, &file, header)?;
        if !resume && !reports.is_empty() {
            return Err(ResultsError::Exists { file: path, trials: reports.len() });
        }
        file.set_len(length).map_err(failed)?;
        let mut log = Log { path: path.clone(), file };
        if length == 0 {
            log.line(header)?;
        }
        Ok((log, reports))
    }

    /// The reports in the file in `folder`, which stays as it is: another program may be writing it.
    ///
    /// # Errors
    /// [`ResultsError`]
    pub fn read(folder: &Path, header: &Header) -> Result<Vec<Report>, ResultsError> {
        Log::must_exist(folder)?;
        let path = folder.join(LINES);
        let file = File::open(&path).map_err(|cause| ResultsError::File { file: path.clone(), cause })?;
        Ok(read(&path, &file, header)?.0)
    }

    /// Adds a report. It is on the disk's way when this returns: an ended program loses at most the trials it was in.
    ///
    /// # Errors
    /// [`ResultsError::File`]
    pub fn add(&mut self, report: &Report) -> Result<(), ResultsError> {
        self.line(report)
    }

    fn line(&mut self, content: &impl Serialize) -> Result<(), ResultsError> {
        let failed = |cause| ResultsError::File { file: self.path.clone(), cause };
        let mut line = serde_json::to_string(content).map_err(|error| failed(error.into()))?;
        line.push('\n');
        let length = self.file.metadata().map_err(failed)?.len();
        let written = self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush());
        if written.is_err() {
            // Other trials end meanwhile, and the disk may have room again: their lines must not go on behind half a
            // one. Where it cannot be cut off, the failure of the line is the one to tell.
            let _ = self.file.set_len(length);
        }
        written.map_err(failed)
    }
}

/// The lines of a file, one after the other.
struct Lines<'a> {
    path: &'a Path,
    reader: BufReader<&'a File>,
    text: Vec<u8>,
    number: usize,
}

impl<'a> Lines<'a> {
    fn new(path: &'a Path, file: &'a File) -> Self {
        Lines { path, reader: BufReader::new(file), text: Vec::new(), number: 0 }
    }

    /// Reads the next line; `None` where the file ends, or breaks off within one.
    fn line<Content: DeserializeOwned>(&mut self) -> Result<Option<Content>, ResultsError> {
        self.text.clear();
        self.number += 1;
        let mut line = (&mut self.reader).take(LONGEST_LINE);
        let read = line.read_until(b'\n', &mut self.text);
        read.map_err(|cause| ResultsError::File { file: self.path.to_owned(), cause })?;
        let other = |words: &str| Err(serde_json::Error::custom(words));
        let known = self.text.len().min(BEGIN.len());
        let parsed = match self.text.strip_suffix(b"\n") {
            Some(line) => serde_json::from_slice(line).map(Some),
            None if self.text.len() as u64 == LONGEST_LINE => other("it is longer than any"),
            // What does not begin as a header is a file of somebody else, and no header that broke off.
            None if self.number == 1 && self.text[..known] != BEGIN[..known] => {
                other("it does not begin as results do")
            }
            None => Ok(None),
        };
        parsed.map_err(|cause| ResultsError::Line { file: self.path.to_owned(), line: self.number, cause })
    }
}

/// The reports of a file, and the length of the sound part of it.
fn read(path: &Path, file: &File, header: &Header) -> Result<(Vec<Report>, u64), ResultsError> {
    let mut lines = Lines::new(path, file);
    let (mut reports, mut length) = (Vec::new(), 0);
    let Some(found) = lines.line::<Header>()? else { return Ok((reports, length)) };
    let differences = found.differences(header);
    if !differences.is_empty() {
        return Err(ResultsError::OtherConfiguration { file: path.to_owned(), differences });
    }
    length += lines.text.len() as u64;
    while let Some(report) = lines.line()? {
        reports.push(report);
        length += lines.text.len() as u64;
    }
    Ok((reports, length))
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use crate::fixtures;
    use crate::header::CODE;

    fn header(object: &str) -> Header {
        Header {
            experiment: "flashlight".to_owned(),
            configuration: object.to_owned(),
            described: BTreeMap::from([
                ("object".to_owned(), object.to_owned()),
                ("plant".to_owned(), "perturbed".to_owned()),
            ]),
        }
    }

    #[test]
    fn an_experiment_goes_on_where_it_was_ended_even_in_the_middle_of_a_line() {
        let folder = tempfile::tempdir().unwrap();
        let made = fixtures::results(&[1]).reports;
        let (mut log, before) = Log::open(folder.path(), &header("torch"), false).unwrap();
        assert!(before.is_empty());
        made[..5].iter().for_each(|report| log.add(report).unwrap());
        drop(log);
        let file = folder.path().join(LINES);
        let text = std::fs::read(&file).unwrap();
        std::fs::write(&file, &text[..text.len() - 40]).unwrap();
        let (mut log, before) = Log::open(folder.path(), &header("torch"), true).unwrap();
        assert_eq!(before, made[..4]);
        log.add(&made[4]).unwrap();
        drop(log);
        assert_eq!(std::fs::read(&file).unwrap(), text);
    }

    #[test]
    fn an_experiment_is_begun_once_a_trial_is_kept_in_its_folder_or_in_one_of_a_part() {
        let folder = tempfile::tempdir().unwrap();
        assert!(!Log::is_begun(&folder.path().join("missing")) && !Log::is_begun(folder.path()));
        drop(Log::open(&folder.path().join("delay-1"), &header("torch"), false).unwrap());
        assert!(Log::is_begun(folder.path()) && Log::is_begun(&folder.path().join("delay-1")));
    }

    /// The change that makes it fail: `Log::open` without the lock.
    #[test]
    fn results_that_another_program_writes_are_left_to_it() {
        let folder = tempfile::tempdir().unwrap();
        let made = fixtures::results(&[1]).reports;
        let (mut log, _) = Log::open(folder.path(), &header("torch"), false).unwrap();
        for resume in [false, true] {
            let second = Log::open(folder.path(), &header("torch"), resume).err().unwrap().to_string();
            assert!(second.contains("another program writes it"), "{second}");
        }
        made[..2].iter().for_each(|report| log.add(report).unwrap());
        drop(log);
        assert_eq!(Log::open(folder.path(), &header("torch"), true).unwrap().1, made[..2]);
    }

    /// Set in the process of this test that has a limit for files: the folder of its results.
    const FOLDER_WITHOUT_ROOM: &str = "TACTUS_TEST_FOLDER_WITHOUT_ROOM";

    /// A limit for files stands for a full disk; this test is run once more below it, in a process of its own.
    ///
    /// The change that makes it fail: `Log::line` that leaves what the disk took of a line.
    #[test]
    fn a_full_disk_leaves_no_half_line_to_which_the_next_trial_would_be_added() {
        let made = fixtures::results(&[1]).reports;
        if let Some(folder) = std::env::var_os(FOLDER_WITHOUT_ROOM) {
            let (mut log, _) = Log::open(folder.as_ref(), &header("torch"), false).unwrap();
            let kept = made.iter().take_while(|report| log.add(report).is_ok()).count();
            assert!(0 < kept && kept < made.len(), "{kept}");
            let text = std::fs::read_to_string(&log.path).unwrap();
            assert!(text.ends_with('\n') && text.lines().count() == kept + 1, "{kept}: {text}");
            return;
        }
        let folder = tempfile::tempdir().unwrap();
        let line = "trap '' XFSZ; ulimit -f 64; exec \"$0\" --exact --nocapture \"$1\"";
        let name = "log::tests::a_full_disk_leaves_no_half_line_to_which_the_next_trial_would_be_added";
        let mut limited = std::process::Command::new("sh");
        limited.args(["-c", line]).arg(std::env::current_exe().unwrap()).arg(name);
        let ended = limited.env(FOLDER_WITHOUT_ROOM, folder.path()).output().unwrap();
        assert!(ended.status.success(), "{}", String::from_utf8_lossy(&ended.stderr));
        assert!(String::from_utf8_lossy(&ended.stdout).contains("1 passed"), "the test below the limit did not run");
        let there = Log::open(folder.path(), &header("torch"), true).unwrap().1;
        assert_eq!(there, made[..there.len()]);
    }

    /// The change that makes it fail: `Log::open`, which cuts off the line that another program is writing.
    #[test]
    fn results_that_are_only_read_stay_as_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let made = fixtures::results(&[1]).reports;
        let (mut log, _) = Log::open(folder.path(), &header("torch"), false).unwrap();
        made[..5].iter().for_each(|report| log.add(report).unwrap());
        let file = folder.path().join(LINES);
        let text = std::fs::read(&file).unwrap();
        std::fs::write(&file, &text[..text.len() - 40]).unwrap();
        assert_eq!(Log::read(folder.path(), &header("torch")).unwrap(), made[..4]);
        assert_eq!(std::fs::read(&file).unwrap(), text[..text.len() - 40]);
        let nothing = tempfile::tempdir().unwrap();
        assert!(matches!(Log::read(nothing.path(), &header("torch")), Err(ResultsError::None { .. })));
        assert_eq!(std::fs::read_dir(nothing.path()).unwrap().count(), 0);
    }

    #[test]
    fn results_are_not_added_to_unasked_nor_to_those_of_another_configuration() {
        let folder = tempfile::tempdir().unwrap();
        let (mut log, _) = Log::open(folder.path(), &header("torch"), false).unwrap();
        log.add(&fixtures::results(&[1]).reports[0]).unwrap();
        drop(log);
        let again = Log::open(folder.path(), &header("torch"), false).err().unwrap();
        assert!(matches!(again, ResultsError::Exists { trials: 1, .. }), "{again}");
        let other = Log::open(folder.path(), &header("cup"), true).err().unwrap().to_string();
        assert!(other.contains("object was torch, is cup") && !other.contains("plant"), "{other}");
    }

    /// The change that makes it fail: the number of the version alone, which nobody raises with each law.
    #[test]
    fn results_of_other_code_are_not_continued_but_may_be_drawn() {
        let of_code = |code: Option<&str>| {
            let mut header = header("torch");
            header.described.extend(code.map(|code| (CODE.to_owned(), code.to_owned())));
            header
        };
        for (was, words) in [(Some("0x1"), "code was 0x1, is 0x2"), (None, "code was -, is 0x2")] {
            let folder = tempfile::tempdir().unwrap();
            let (mut log, _) = Log::open(folder.path(), &of_code(was), false).unwrap();
            log.add(&fixtures::results(&[1]).reports[0]).unwrap();
            drop(log);
            let other = Log::open(folder.path(), &of_code(Some("0x2")), true).err().unwrap();
            assert!(matches!(other, ResultsError::OtherConfiguration { .. }), "{other}");
            assert!(other.to_string().contains(words), "{other}");
            assert_eq!(Log::open(folder.path(), &of_code(None), true).unwrap().1.len(), 1);
            assert_eq!(Log::open(folder.path(), &of_code(was), true).unwrap().1.len(), 1);
        }
    }

    #[test]
    fn a_line_that_is_no_report_is_named() {
        let folder = tempfile::tempdir().unwrap();
        drop(Log::open(folder.path(), &header("torch"), false).unwrap());
        let file = folder.path().join(LINES);
        let text = std::fs::read_to_string(&file).unwrap();
        std::fs::write(&file, format!("{text}{{\"cell\": 1}}\n")).unwrap();
        let error = Log::open(folder.path(), &header("torch"), true).err().unwrap();
        assert!(matches!(error, ResultsError::Line { line: 2, .. }), "{error}");
    }

    /// The change that makes it fail: `Log::open` without `output_file::refuse`; of a link to `/dev/full` it read the
    /// first line until the memory was full.
    #[test]
    fn results_that_are_no_file_are_refused() {
        for place in [Some("/dev/null"), None] {
            let folder = tempfile::tempdir().unwrap();
            let file = folder.path().join(LINES);
            match place {
                Some(place) => std::os::unix::fs::symlink(place, &file).unwrap(),
                None => std::fs::create_dir(&file).unwrap(),
            }
            let refused = Log::open(folder.path(), &header("torch"), true).err().unwrap();
            assert!(refused.to_string().contains("not a file that can be replaced"), "{place:?}: {refused}");
        }
    }

    /// The changes that make it fail: `read_line`, which has no limit and takes what is not UTF-8 for a failure of the
    /// disk.
    #[test]
    fn a_line_of_another_kind_or_without_an_end_is_named_and_left_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join(LINES);
        let refused = || Log::open(folder.path(), &header("torch"), true).err().unwrap();
        std::fs::write(&file, b"\xff\xfe\n").unwrap();
        assert!(matches!(refused(), ResultsError::Line { line: 1, .. }), "{}", refused());
        let endless = std::fs::File::create(&file).unwrap();
        endless.set_len(64 << 20).unwrap();
        assert!(matches!(refused(), ResultsError::Line { line: 1, .. }), "{}", refused());
        assert_eq!(endless.metadata().unwrap().len(), 64 << 20);
        std::fs::write(&file, "notes of somebody else").unwrap();
        assert!(matches!(refused(), ResultsError::Line { line: 1, .. }), "{}", refused());
        assert_eq!(std::fs::read(&file).unwrap(), b"notes of somebody else");
    }
}
