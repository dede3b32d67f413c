//! Results: one report a trial, and all of them as a table.

use std::collections::BTreeSet;
use std::io;
use std::path::Path;

use lab::output_file;
use serde::{Deserialize, Serialize};

use super::grid::Cell;
use super::outcome::{Measures, Outcome};
use lab::procedure::Mode;

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
const COLUMNS: [Column; 40] = [
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
    ("touch_speed_m_s", |r| optional(r.measures.touch_speed_m_s)),
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
