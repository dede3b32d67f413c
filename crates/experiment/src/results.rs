//! Results: one report a trial, written as it comes, and read back when an experiment is resumed.

use std::collections::{BTreeMap, BTreeSet};
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use lab::output_file;
use serde::{Deserialize, Serialize};

use super::grid::Cell;
use super::outcome::{Measures, Outcome};
use lab::procedure::Mode;

/// File of the reports, one a line, in the order in which the trials ended.
pub const LINES: &str = "results.jsonl";

/// Name of the hash of the code among the words of a header ([`Header::described`]).
pub const CODE: &str = "code";

/// Which trial.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Key {
    /// Number of the cell in the grid, from 0.
    pub index: usize,
    /// Where the object stands.
    #[serde(flatten)]
    pub cell: Cell,
    /// The mode in which the primitive is played.
    pub mode: Mode,
    /// Seed of the experiment.
    pub seed: u64,
}

/// A surprise that the device reported.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Surprise {
    /// Phase of the movement.
    pub phase: f64,
    /// Sensor channel: force 0 to 2, torque 3 to 5, gauges 6 to 8, fingers 9 to 11.
    pub channel: u8,
    /// Time after the start of the movement, s.
    pub time_s: f64,
}

/// The way of the hand and of its plan, seen from above, every 0.1 s.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct PlanarPath {
    /// Measured grasp point, world x and y, m.
    pub measured: Vec<[f64; 2]>,
    /// Planned grasp point, world x and y, m.
    pub planned: Vec<[f64; 2]>,
}

/// One trial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// Which trial.
    #[serde(flatten)]
    pub key: Key,
    /// Seed of its plant and noise.
    pub trial_seed: u64,
    /// Where the object stood, world x and y, m.
    pub object: [f64; 2],
    /// The outcome.
    #[serde(flatten)]
    pub outcome: Outcome,
    /// The measures.
    #[serde(flatten)]
    pub measures: Measures,
    /// Largest displacement of the plan from the taught one, m.
    pub adaptation_m: f64,
    /// Largest turn of the plan from the taught one, degrees.
    pub adaptation_deg: f64,
    /// Distance of the hand below its plan when it has lifted, mean over 1 s, m; `None` where the arm stopped before.
    pub sag_m: Option<f64>,
    /// Distance of the free hand below its plan, mean over the last second before it touches anything, m; `None` where
    /// it was not free for so long.
    #[serde(default)]
    pub free_sag_m: Option<f64>,
    /// First surprise that the device reported.
    pub surprise: Option<Surprise>,
    /// Paths.
    #[serde(default)]
    pub path: PlanarPath,
    /// Virtual time of the trial, s.
    pub virtual_s: f64,
    /// Time it took on this machine, s; only in `results.jsonl`, because it differs from run to run.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub wall_s: Option<f64>,
}

impl Report {
    /// True if the arm stopped by itself, for its shaking or another fault: what it did not do any more is no merit.
    #[must_use]
    pub fn is_stopped(&self) -> bool {
        self.outcome.is_stopped() || self.measures.stopped
    }
}

/// First line of the file of reports: what the trials belong to.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    /// Name of the experiment.
    pub experiment: String,
    /// Hash of everything that decides how a trial ends: only equal ones may share a file.
    pub configuration: String,
    /// The configuration in words, for the message when it differs. With [`CODE`] the code that plays the trials counts
    /// as well, without it results of any code will do.
    pub described: BTreeMap<String, String>,
}

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
    #[error("{} belongs to another configuration: {}", file.display(), differences.join(", "))]
    OtherConfiguration {
        /// The file.
        file: PathBuf,
        /// The difference, `was -> is`.
        differences: Vec<String>,
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
        self.file.write_all(line.as_bytes()).and_then(|()| self.file.flush()).map_err(failed)
    }
}

/// The reports of a file, and the length of the sound part of it.
fn read(path: &Path, file: &File, header: &Header) -> Result<(Vec<Report>, u64), ResultsError> {
    let mut reader = BufReader::new(file);
    let mut reports = Vec::new();
    let (mut text, mut number, mut length) = (String::new(), 0, 0);
    loop {
        text.clear();
        number += 1;
        let read = reader.read_line(&mut text).map_err(|cause| ResultsError::File { file: path.to_owned(), cause })?;
        if !text.ends_with('\n') {
            return Ok((reports, length));
        }
        let broken = |cause| ResultsError::Line { file: path.to_owned(), line: number, cause };
        if number == 1 {
            let found: Header = serde_json::from_str(&text).map_err(broken)?;
            let is_of_other_code =
                header.described.get(CODE).is_some_and(|code| found.described.get(CODE) != Some(code));
            if found.configuration != header.configuration || found.experiment != header.experiment || is_of_other_code
            {
                return Err(ResultsError::OtherConfiguration {
                    file: path.to_owned(),
                    differences: differences(&found, header),
                });
            }
        } else {
            reports.push(serde_json::from_str(&text).map_err(broken)?);
        }
        length += read as u64;
    }
}

fn differences(was: &Header, is: &Header) -> Vec<String> {
    let none = "-".to_owned();
    let mut names: Vec<&String> = was.described.keys().chain(is.described.keys()).collect();
    names.sort();
    names.dedup();
    let mut found: Vec<String> = names
        .into_iter()
        .map(|name| (name, was.described.get(name).unwrap_or(&none), is.described.get(name).unwrap_or(&none)))
        .filter(|(_, was, is)| was != is)
        .map(|(name, was, is)| format!("{name} was {was}, is {is}"))
        .collect();
    if was.experiment != is.experiment {
        found.insert(0, format!("the experiment was {}, is {}", was.experiment, is.experiment));
    }
    found
}

/// All reports of an experiment, in the order of their keys: the same whatever order they came in.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize)]
pub struct Results {
    /// The reports.
    pub reports: Vec<Report>,
}

impl Results {
    /// Sorts reports, and takes the first of each trial: two programs at one folder may both have carried it out.
    pub fn new(mut reports: Vec<Report>) -> Results {
        reports.sort_by_key(|report| report.key);
        reports.dedup_by_key(|report| report.key);
        Results { reports }
    }

    /// The reports of one mode.
    pub fn of(&self, mode: Mode) -> impl Iterator<Item = &Report> + Clone {
        self.reports.iter().filter(move |report| report.key.mode == mode)
    }

    /// The modes that were tried.
    pub fn modes(&self) -> Vec<Mode> {
        Mode::COMPARED.into_iter().filter(|mode| self.of(*mode).next().is_some()).collect()
    }

    /// The seeds that were tried, ascending.
    pub fn seeds(&self) -> Vec<u64> {
        let mut seeds: Vec<u64> = self.reports.iter().map(|report| report.key.seed).collect();
        seeds.sort_unstable();
        seeds.dedup();
        seeds
    }

    /// Number of the cells that were tried, in this mode or in any.
    pub fn cells(&self, mode: Option<Mode>) -> usize {
        let reports = self.reports.iter().filter(|report| mode.is_none_or(|mode| report.key.mode == mode));
        reports.map(|report| report.key.index).collect::<BTreeSet<_>>().len()
    }

    /// Cells in which a mode succeeded, in the mean over the seeds.
    pub fn success_count(&self, mode: Mode) -> f64 {
        let successes = self.of(mode).filter(|report| report.outcome.is_success()).count();
        successes as f64 / self.seeds().len().max(1) as f64
    }

    /// Share of the seeds with which a mode succeeded in a cell; `None` if it was not tried there.
    pub fn success_share(&self, mode: Mode, index: usize) -> Option<f64> {
        let (mut tried, mut held) = (0.0, 0.0);
        for report in self.of(mode).filter(|report| report.key.index == index) {
            tried += 1.0;
            held += f64::from(u8::from(report.outcome.is_success()));
        }
        (tried > 0.0).then(|| held / tried)
    }

    /// The same for a file that shall be equal whenever the experiment is repeated.
    #[must_use]
    pub fn without_wall_times(&self) -> Results {
        let reports = self.reports.iter().map(|report| Report { wall_s: None, ..report.clone() });
        Results { reports: reports.collect() }
    }

    /// Writes `results.csv`: one trial a line, a header of names and units.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn write_csv(&self, file: &Path) -> Result<(), csv::Error> {
        let mut writer = csv::Writer::from_writer(Vec::new());
        writer.write_record(COLUMNS.map(|(name, _)| name))?;
        for report in &self.reports {
            writer.write_record(COLUMNS.map(|(_, value)| value(report)))?;
        }
        let text = writer.into_inner().map_err(|error| csv::Error::from(error.into_error()))?;
        output_file::replace(file, &text).map_err(|error| io::Error::from(error).into())
    }
}

/// A column of `results.csv`: name with unit, and value.
type Column = (&'static str, fn(&Report) -> String);

/// All columns of `results.csv`.
const COLUMNS: [Column; 39] = [
    ("cell", |r| r.key.index.to_string()),
    ("along_m", |r| number(r.key.cell.along())),
    ("sideways_m", |r| number(r.key.cell.sideways())),
    ("mode", |r| r.key.mode.to_string()),
    ("seed", |r| r.key.seed.to_string()),
    ("outcome", |r| r.outcome.name().to_owned()),
    ("fault", |r| if let Outcome::Stopped(fault) = &r.outcome { fault.clone() } else { String::new() }),
    ("object_x_m", |r| number(r.object[0])),
    ("object_y_m", |r| number(r.object[1])),
    ("lift_m", |r| number(r.measures.lift_m)),
    ("tilt_deg", |r| number(r.measures.tilt_deg)),
    ("push_m", |r| number(r.measures.push_m)),
    ("adaptation_m", |r| number(r.adaptation_m)),
    ("adaptation_deg", |r| number(r.adaptation_deg)),
    ("contact_peak_n", |r| number(r.measures.contact_peak_n)),
    ("contact_sustained_n", |r| number(r.measures.contact_sustained_n)),
    ("contact_median_n", |r| optional(r.measures.contact_median_n)),
    ("contact_mean_n", |r| optional(r.measures.contact_mean_n)),
    ("finger1_n", |r| number(r.measures.finger_n[0])),
    ("finger2_n", |r| number(r.measures.finger_n[1])),
    ("finger3_n", |r| number(r.measures.finger_n[2])),
    ("table_peak_n", |r| number(r.measures.table_peak_n)),
    ("finger_peak_n", |r| number(r.measures.finger_peak_n)),
    ("finger1_grip_n", |r| number(r.measures.finger_grip_n[0])),
    ("finger2_grip_n", |r| number(r.measures.finger_grip_n[1])),
    ("finger3_grip_n", |r| number(r.measures.finger_grip_n[2])),
    ("finger_asked_n", |r| number(r.measures.finger_asked_n)),
    ("chatter_n", |r| optional(r.measures.chatter_n)),
    ("sag_m", |r| optional(r.sag_m)),
    ("free_sag_m", |r| optional(r.free_sag_m)),
    ("shaking_rad_s", |r| number(r.measures.shaking_rad_s)),
    ("touch_s", |r| optional(r.measures.touch_s)),
    ("closing_s", |r| optional(r.measures.closing_s)),
    ("lift_s", |r| number(r.measures.lift_s)),
    ("failure_s", |r| optional(r.measures.failure_s)),
    ("surprise_s", |r| optional(r.surprise.map(|surprise| surprise.time_s))),
    ("surprise_phase", |r| optional(r.surprise.map(|surprise| surprise.phase))),
    ("surprise_channel", |r| r.surprise.map(|surprise| surprise.channel.to_string()).unwrap_or_default()),
    ("virtual_s", |r| number(r.virtual_s)),
];

fn optional(value: Option<f64>) -> String {
    value.map(number).unwrap_or_default()
}

/// Six digits are more than any of these quantities is worth.
fn number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    /// The change that makes it fail: every line of the file is a trial of its own.
    #[test]
    fn a_trial_that_two_programs_carried_out_counts_once() {
        let once = fixtures::results(&[1]);
        let twice = Results::new(once.reports.iter().chain(&once.reports).cloned().collect());
        assert_eq!(twice, Results::new(once.reports));
    }

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

    #[test]
    fn results_do_not_depend_on_the_order_in_which_trials_end() {
        let ordered = fixtures::results(&[1, 2]);
        let mut reversed = ordered.reports.clone();
        reversed.reverse();
        assert_eq!(Results::new(reversed), ordered);
    }

    #[test]
    fn a_table_that_existed_is_replaced_whole_never_written_over() {
        let folder = tempfile::tempdir().unwrap();
        let (file, other_name) = (folder.path().join("results.csv"), folder.path().join("old.csv"));
        std::fs::write(&file, "precious").unwrap();
        // A second name of the old file shows whether its bytes were touched.
        std::fs::hard_link(&file, &other_name).unwrap();
        fixtures::results(&[1]).write_csv(&file).unwrap();
        assert_eq!(std::fs::read(&other_name).unwrap(), b"precious");
        assert!(std::fs::read(&file).unwrap().starts_with(b"cell,"));
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 2, "no part is left");
    }

    #[test]
    fn the_table_has_a_line_for_every_trial_and_a_value_in_every_column() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("results.csv");
        let results = fixtures::results(&[1]);
        results.write_csv(&file).unwrap();
        let mut reader = csv::Reader::from_path(&file).unwrap();
        let names = reader.headers().unwrap().clone();
        let lines: Vec<csv::StringRecord> = reader.records().map(Result::unwrap).collect();
        assert_eq!(lines.len(), results.reports.len());
        let column = |name: &str| names.iter().position(|head| head == name).unwrap();
        assert_eq!(&lines[0][column("along_m")], "-0.24");
        assert_eq!(&lines[0][column("outcome")], "knocked over");
        assert_eq!(&lines[0][column("virtual_s")], "20");
    }

    #[test]
    fn wall_times_are_left_out_of_what_shall_be_repeatable() {
        let results = fixtures::results(&[1]).without_wall_times();
        assert!(!serde_json::to_string(&results).unwrap().contains("wall_s"));
    }
}
