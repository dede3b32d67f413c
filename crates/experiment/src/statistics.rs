//! Statistics of the trials of one mode.

use serde::Serialize;

use super::interval::Interval;
use super::outcome::Outcome;
use super::quantile::quantile;
use super::results::{Report, Results};
use lab::procedure::Mode;

/// A finger presses as it was asked to up to this many times the force that it was asked for.
const GRIP_BAR: f64 = 1.5;

/// A quantity over trials.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Spread {
    /// Median.
    pub median: f64,
    /// 95 % lie below.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

impl Spread {
    /// `None` of nothing: a quantity that nobody measured is not zero.
    fn of(values: &[f64]) -> Option<Spread> {
        let at = |share| quantile(values, share);
        Some(Spread { median: at(0.5)?, p95: at(0.95)?, max: at(1.0)? })
    }
}

/// Failures of one kind, and how many of them the device told before the lift.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, schemars::JsonSchema)]
pub struct FailureCounts {
    /// Trials that failed in this way.
    pub failures: usize,
    /// Of these, how many were reported before the lift.
    pub before_lift: usize,
}

/// Performance of the device's watch in reporting failures.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Detection {
    /// Trials that succeeded.
    pub successes: usize,
    /// Of these, how many were reported as surprising, at any time.
    pub false_alarms: usize,
    /// Trials that failed, but for those that a fault of the arm stopped, or in which it shook or did not lift.
    pub failures: usize,
    /// Of these, how many were reported before the lift.
    pub flagged_before_lift: usize,
    /// Those in which the object was knocked over.
    pub knocked_over: FailureCounts,
    /// Those in which the fingers closed beside it.
    pub missed: FailureCounts,
    /// Those in which it was pushed away.
    pub pushed_away: FailureCounts,
    /// Those in which it was raised and lost; what slips only then cannot be told before.
    pub dropped: FailureCounts,
    /// Those in which it was crushed.
    pub crushed: FailureCounts,
    /// Median time from the beginning of the failure in the world
    /// ([`failure_s`](super::outcome::Measures::failure_s)) to the report, s; negative: reported before. A failure
    /// that was not reported before the lift counts as reported at the lift, so that silence does not pass for speed.
    /// Dropped objects are left out.
    pub median_delay_s: Option<f64>,
}

impl Detection {
    /// Share of successes that were reported.
    pub fn false_alarm_rate(&self) -> f64 {
        self.false_alarms as f64 / self.successes.max(1) as f64
    }

    /// Share of failures that were reported before the lift.
    pub fn detection_rate(&self) -> f64 {
        self.flagged_before_lift as f64 / self.failures.max(1) as f64
    }

    /// From the reports of trials.
    pub fn of<'a>(reports: impl Iterator<Item = &'a Report>) -> Detection {
        let mut detection = Detection::default();
        let mut delays = Vec::new();
        for report in reports {
            let alarm = report.surprise.map(|surprise| surprise.time_s);
            let told = match report.outcome {
                Outcome::Held => {
                    detection.successes += 1;
                    detection.false_alarms += usize::from(alarm.is_some());
                    continue;
                }
                // A fault of the arm reports itself; an arm that shakes or does not lift is none of the watch's.
                Outcome::Stopped(_) | Outcome::NotLifted | Outcome::Unstable => continue,
                Outcome::KnockedOver => &mut detection.knocked_over,
                Outcome::Missed => &mut detection.missed,
                Outcome::PushedAway => &mut detection.pushed_away,
                Outcome::Dropped => &mut detection.dropped,
                Outcome::Crushed => &mut detection.crushed,
            };
            let lift = report.measures.lift_s;
            let in_time = alarm.filter(|alarm| *alarm < lift);
            told.failures += 1;
            told.before_lift += usize::from(in_time.is_some());
            detection.failures += 1;
            detection.flagged_before_lift += usize::from(in_time.is_some());
            if report.outcome != Outcome::Dropped {
                delays.extend(report.measures.failure_s.map(|failure| in_time.unwrap_or(lift) - failure));
            }
        }
        detection.median_delay_s = quantile(&delays, 0.5);
        detection
    }
}

/// Statistics of the trials of one mode.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Summary {
    /// The mode.
    pub mode: Mode,
    /// Cells.
    pub cells: usize,
    /// Seeds.
    pub seeds: usize,
    /// Cells in which it succeeded, mean over the seeds.
    pub success: f64,
    /// The same with its interval over the arms; `None` of one arm.
    pub success_interval: Option<Interval>,
    /// Cells in which it succeeded, seed by seed.
    pub success_by_seed: Vec<usize>,
    /// Objects that were knocked over, mean over the seeds; and so on.
    pub knocked_over: f64,
    /// Missed.
    pub missed: f64,
    /// Pushed away.
    pub pushed_away: f64,
    /// Dropped.
    pub dropped: f64,
    /// Crushed.
    pub crushed: f64,
    /// Grasped, but not raised.
    pub not_lifted: f64,
    /// Shaken by the arm.
    pub unstable: f64,
    /// Stopped by a fault.
    pub stopped: f64,
    /// Largest displacement with success in at least half of the seeds, m; `None` without a success. This and what
    /// follows are `None` where nobody could measure them: without a trial that succeeded, or that went on to its end.
    pub farthest_success_m: Option<f64>,
    /// Largest adaptation of a trial that succeeded, m.
    pub adaptation_m: Option<f64>,
    /// Largest adaptation of a trial that succeeded, degrees.
    pub adaptation_deg: Option<f64>,
    /// Horizontal speed of the hand just before its first touch, m/s, of those that touch before the fingers close.
    pub touch_speed_m_s: Option<Spread>,
    /// Peak force on the object before the fingers close, N.
    pub contact_peak_n: Option<Spread>,
    /// Share of the trials in which that peak, averaged over 100 ms, stays below the tipping force, and the arm does
    /// not stop by itself; `None` where nothing can tip.
    pub below_tipping: Option<f64>,
    /// Way the object was pushed before the fingers close, m.
    pub push_m: Option<Spread>,
    /// Peak force of one finger on the object, N.
    pub finger_peak_n: Option<Spread>,
    /// Largest force of one finger on the object over 50 ms, N.
    pub finger_grip_n: Option<Spread>,
    /// Force that a finger is asked for, N.
    pub finger_asked_n: Option<Spread>,
    /// Share of the trials in which no finger presses with more than 1.5 times that, and the arm does not stop by
    /// itself.
    pub grip_as_asked: f64,
    /// Content of the wrist's force above 3 Hz from closing to lift, RMS, N.
    pub chatter_n: Option<Spread>,
    /// Peak force of hand on table, N.
    pub table_peak_n: Option<Spread>,
    /// Distance of the hand below its plan when it has lifted, m.
    pub sag_m: Option<Spread>,
    /// Distance of the free hand below or above its plan, just before it touches anything, m.
    pub free_sag_m: Option<Spread>,
    /// Amplitude of the fast part of the joint speeds, rad/s.
    pub shaking_rad_s: Option<Spread>,
    /// Failure detection.
    pub detection: Detection,
}

impl Summary {
    /// The trials of `mode`; `tipping` is the horizontal force that tips the object over, N.
    pub fn of(results: &Results, mode: Mode, tipping: Option<f64>) -> Summary {
        let reports: Vec<&Report> = results.of(mode).collect();
        let seeds = results.seeds();
        let count = |test: &dyn Fn(&Report) -> bool| reports.iter().filter(|report| test(report)).count();
        let mean = |word: &str| count(&|report| report.outcome.name() == word) as f64 / seeds.len().max(1) as f64;
        // What an arm that stopped did not do any more is neither gentle nor firm.
        let went_on = || reports.iter().filter(|report| !report.is_stopped());
        let measured = |value: fn(&Report) -> Option<f64>| {
            Spread::of(&went_on().filter_map(|report| value(report)).collect::<Vec<_>>())
        };
        let spread = |value: fn(&Report) -> f64| Spread::of(&went_on().map(|report| value(report)).collect::<Vec<_>>());
        let successes = || reports.iter().filter(|report| report.outcome.is_success());
        let farthest = reports
            .iter()
            .filter(|report| results.success_share(mode, report.key.index).is_some_and(|share| share >= 0.5))
            .map(|report| report.key.cell.distance());
        let success_by_seed: Vec<usize> =
            seeds.iter().map(|seed| count(&|report| report.key.seed == *seed && report.outcome.is_success())).collect();
        Summary {
            mode,
            cells: results.cells(Some(mode)),
            seeds: seeds.len(),
            success: results.success_count(mode),
            success_interval: Interval::of(std::slice::from_ref(&success_by_seed)),
            success_by_seed,
            knocked_over: mean("knocked over"),
            missed: mean("missed"),
            pushed_away: mean("pushed away"),
            dropped: mean("dropped"),
            crushed: mean("crushed"),
            not_lifted: mean("not lifted"),
            unstable: mean("unstable"),
            stopped: mean("stopped"),
            farthest_success_m: farthest.reduce(f64::max),
            adaptation_m: successes().map(|report| report.adaptation_m).reduce(f64::max),
            adaptation_deg: successes().map(|report| report.adaptation_deg).reduce(f64::max),
            touch_speed_m_s: measured(|report| report.measures.touch_speed_m_s),
            contact_peak_n: spread(|report| report.measures.contact_peak_n),
            below_tipping: tipping.map(|limit| {
                let gentle = went_on().filter(|report| report.measures.contact_sustained_n < limit);
                gentle.count() as f64 / reports.len().max(1) as f64
            }),
            push_m: spread(|report| report.measures.push_m),
            finger_peak_n: spread(|report| report.measures.finger_peak_n),
            finger_grip_n: spread(|report| report.measures.hardest_finger()),
            finger_asked_n: spread(|report| report.measures.finger_asked_n),
            grip_as_asked: went_on()
                .filter(|report| report.measures.hardest_finger() <= GRIP_BAR * report.measures.finger_asked_n)
                .count() as f64
                / reports.len().max(1) as f64,
            chatter_n: measured(|report| report.measures.chatter_n),
            table_peak_n: spread(|report| report.measures.table_peak_n),
            sag_m: measured(|report| report.sag_m.map(f64::abs)),
            free_sag_m: measured(|report| report.free_sag_m.map(f64::abs)),
            // What an arm shook that its shaking stopped is the largest of all.
            shaking_rad_s: Spread::of(
                &reports
                    .iter()
                    .filter(|report| !report.outcome.is_stopped())
                    .map(|report| report.measures.shaking_rad_s)
                    .collect::<Vec<_>>(),
            ),
            detection: Detection::of(reports.iter().copied()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Measures;
    use crate::results::Surprise;

    #[test]
    fn quantiles_are_interpolated_and_ignore_what_is_no_number() {
        assert_eq!(quantile(&[4.0, 1.0, f64::NAN, 3.0, 2.0], 0.5), Some(2.5));
        assert_eq!(quantile(&[7.0], 0.95), Some(7.0));
        assert_eq!(quantile(&[], 0.5), None);
    }

    #[test]
    fn successes_are_counted_per_seed() {
        let results = fixtures::results(&[1, 2, 3]);
        let summary = Summary::of(&results, Mode::Adaptive, Some(2.0));
        assert_eq!((summary.cells, summary.seeds), (48, 3));
        let by_seed: f64 = summary.success_by_seed.iter().map(|count| *count as f64).sum();
        assert!((summary.success - by_seed / 3.0).abs() < 1e-12 && summary.success > 40.0);
        let all = summary.success
            + summary.knocked_over
            + summary.missed
            + summary.pushed_away
            + summary.dropped
            + summary.stopped;
        assert!((all - 48.0).abs() < 1e-9);
        assert!((summary.farthest_success_m.unwrap() - 0.268).abs() < 1e-3);
    }

    /// The change that makes it fail: what an arm that stopped did not do any more counts as done as it should be.
    #[test]
    fn a_trial_that_stopped_shows_no_gentleness_and_no_grip() {
        let mut results = fixtures::results(&[1]);
        for report in results.reports.iter_mut().filter(|report| report.key.mode == Mode::Adaptive) {
            let measures = &mut report.measures;
            (measures.contact_sustained_n, measures.finger_grip_n) = (9.0, [30.0; 3]);
            report.sag_m = Some(0.01);
            if report.key.index % 2 == 0 {
                report.outcome = Outcome::Stopped("JointSpeed".to_owned());
                (report.measures, report.sag_m) = (Measures::default(), None);
            }
        }
        let summary = Summary::of(&results, Mode::Adaptive, Some(2.0));
        assert_eq!((summary.stopped, summary.below_tipping, summary.grip_as_asked), (24.0, Some(0.0), 0.0));
        assert_eq!((summary.sag_m.unwrap().median, summary.contact_peak_n.unwrap().median > 0.0), (0.01, true));
    }

    /// The change that makes it fail: only an outcome `stopped` is one, and an arm that its shaking stopped has the
    /// outcome `unstable`.
    #[test]
    fn an_arm_that_its_shaking_stopped_is_not_gentle_either() {
        let mut results = fixtures::results(&[1]);
        for report in results.reports.iter_mut().filter(|report| report.key.mode == Mode::Adaptive) {
            report.measures.contact_sustained_n = 9.0;
            report.measures.finger_grip_n = [30.0; 3];
            if report.key.index % 2 == 0 {
                report.outcome = Outcome::Unstable;
                report.measures = Measures { stopped: true, shaking_rad_s: 0.7, ..Measures::default() };
            }
        }
        let summary = Summary::of(&results, Mode::Adaptive, Some(2.0));
        assert_eq!((summary.unstable, summary.below_tipping, summary.grip_as_asked), (24.0, Some(0.0), 0.0));
        assert!(summary.contact_peak_n.unwrap().median > 0.0 && summary.finger_grip_n.unwrap().median == 30.0);
        assert_eq!(summary.shaking_rad_s.unwrap().max, 0.7, "it did shake");
    }

    #[test]
    fn a_mode_whose_arms_all_stopped_has_no_figures_instead_of_zeros() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            report.outcome = Outcome::Stopped("JointSpeed".to_owned());
        }
        let summary = Summary::of(&results, Mode::Adaptive, Some(2.0));
        let figures = [summary.contact_peak_n, summary.sag_m, summary.free_sag_m, summary.chatter_n];
        assert_eq!(figures, [None; 4]);
        assert_eq!((summary.farthest_success_m, summary.adaptation_m, summary.adaptation_deg), (None, None, None));
        let table = crate::map::table(&[summary]);
        assert!(!table.contains(" 0.0 "), "{table}");
    }

    #[test]
    fn an_alarm_after_the_lift_began_comes_too_late() {
        let mut reports = fixtures::results(&[1]).reports;
        reports.iter_mut().for_each(|report| report.surprise = None);
        let held = reports.iter().position(|report| report.outcome == Outcome::Held).unwrap();
        let fallen: Vec<usize> =
            (0..reports.len()).filter(|index| reports[*index].outcome == Outcome::KnockedOver).collect();
        let at = |time_s| Some(Surprise { phase: 0.5, channel: 0, time_s });
        reports[held].surprise = at(3.0);
        let three: Vec<Report> = [(fallen[0], 0.4), (fallen[1], 1.0), (fallen[2], 99.0)]
            .map(|(index, time)| {
                reports[index].surprise = at(reports[index].measures.failure_s.unwrap() + time);
                reports[index].clone()
            })
            .to_vec();
        let detection = Detection::of(reports.iter());
        assert_eq!((detection.false_alarms, detection.flagged_before_lift), (1, 2));
        assert_eq!((detection.knocked_over.before_lift, detection.knocked_over.failures), (2, fallen.len()));
        assert!(detection.detection_rate() < 0.1 && detection.false_alarm_rate() > 0.0);
        // Those that were told late or never count as told at the lift.
        let alone = Detection::of(three.iter());
        assert!((alone.median_delay_s.unwrap() - 1.0).abs() < 1e-12);
        let silent = detection.median_delay_s.unwrap();
        assert!(silent > 1.0, "{silent}");
    }

    #[test]
    fn what_was_dropped_is_a_failure_and_what_the_arm_stopped_is_none_of_the_watch() {
        let mut reports = fixtures::results(&[1]).reports;
        reports.truncate(2);
        (reports[0].outcome, reports[1].outcome) = (Outcome::Dropped, Outcome::Stopped("torque limit".into()));
        let detection = Detection::of(reports.iter());
        assert_eq!((detection.failures, detection.dropped.failures, detection.median_delay_s), (1, 1, None));
    }
}
