//! Open loop against adaptation, trial by trial: the same cell, the same arm, the same noise.

use std::fmt;

use serde::Serialize;

use super::outcome::Measures;
use super::quantile::quantile;
use super::results::{Report, Results};
use super::scenario::Scenario;
use lab::procedure::Mode;

/// Something that should be smaller with adaptation.
#[derive(Debug, Clone, Copy)]
pub struct Quantity {
    /// Name of the quantity.
    pub name: &'static str,
    /// Its unit in tables and figures.
    pub unit: &'static str,
    /// Factor from the measure to that unit.
    pub scale: f64,
    /// Share of open loop below which adaptation should stay.
    pub bar: f64,
    /// Its value in a trial, SI.
    pub value: fn(&Measures) -> f64,
}

const PUSH: Quantity = Quantity {
    name: "pushed before the fingers close",
    unit: "cm",
    scale: 100.0,
    bar: 1.0 / 3.0,
    value: |measures| measures.push_m,
};
const CONTACT: Quantity = Quantity {
    name: "mean force on the object from touch until the fingers close",
    unit: "N",
    scale: 1.0,
    bar: 0.5,
    // Where nothing is touched no force acts.
    value: |measures| measures.contact_mean_n.unwrap_or(0.0),
};
const TABLE: Quantity = Quantity {
    name: "force of the hand on the table",
    unit: "N",
    scale: 1.0,
    bar: 0.25,
    value: |measures| measures.table_peak_n,
};

/// The quantities that an experiment compares; the first ones decide.
pub fn quantities(scenario: Scenario) -> &'static [Quantity] {
    match scenario {
        Scenario::Flashlight | Scenario::Cup => &[PUSH, CONTACT],
        Scenario::Bottle => &[TABLE],
        Scenario::Lift | Scenario::Fingers => &[],
    }
}

/// One quantity, adaptation relative to open loop.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Ratio {
    /// Name of the quantity.
    pub name: &'static str,
    /// Share of open loop below which adaptation should stay.
    pub bar: f64,
    /// Share of the trials in which it does.
    pub below: f64,
    /// Median of the ratio; `None` where every arm stopped, and there is none.
    pub median: Option<f64>,
    /// Its largest value.
    pub max: Option<f64>,
    /// Median in open loop and with adaptation, SI.
    pub medians: [Option<f64>; 2],
    /// Pairs of which only the one with adaptation has any of the quantity: they count as above the bar, and have no
    /// ratio.
    pub without_ratio: usize,
    /// Ratio of each trial that has one: cell, seed, ratio.
    pub trials: Vec<(String, u64, f64)>,
}

/// Open loop against adaptation.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Comparison {
    /// Pairs of trials that are compared.
    pub pairs: usize,
    /// Of these, those whose arm stopped by itself with adaptation: they count as above every bar, and have no ratio.
    pub stopped: usize,
    /// Pairs that are left out because nothing is met in open loop.
    pub left_out: usize,
    /// Each quantity.
    pub ratios: Vec<Ratio>,
    /// Share of the pairs in which all quantities stay below their bars.
    pub all_below: f64,
}

impl Comparison {
    /// Compares; `None` if there is nothing to compare.
    pub fn of(results: &Results, scenario: Scenario) -> Option<Comparison> {
        let quantities = quantities(scenario);
        let pairs: Vec<(&Report, &Report)> = results
            .of(Mode::OpenLoop)
            .filter_map(|open| {
                let same = |report: &&Report| (report.key.index, report.key.seed) == (open.key.index, open.key.seed);
                results.of(Mode::Adaptive).find(same).map(|adapted| (open, adapted))
            })
            .collect();
        let all = pairs.len();
        let pairs: Vec<_> = pairs.into_iter().filter(|(open, _)| meets(open, scenario)).collect();
        if pairs.is_empty() || quantities.is_empty() {
            return None;
        }
        let compared = pairs.len();
        let share = |count: usize| count as f64 / compared as f64;
        let pairs: Vec<_> = pairs.into_iter().filter(|(_, adapted)| !adapted.is_stopped()).collect();
        let ratios = quantities.iter().map(|quantity| {
            let found: Vec<Option<f64>> = pairs.iter().map(|pair| ratio(quantity, pair)).collect();
            let values: Vec<f64> = found.iter().copied().flatten().collect();
            let median = |values: &[f64]| quantile(values, 0.5);
            let of = |pick: fn(&(&Report, &Report)) -> Measures| {
                median(&pairs.iter().map(|pair| (quantity.value)(&pick(pair))).collect::<Vec<_>>())
            };
            Ratio {
                name: quantity.name,
                bar: quantity.bar,
                below: share(values.iter().filter(|value| **value < quantity.bar).count()),
                median: median(&values),
                max: quantile(&values, 1.0),
                medians: [of(|(open, _)| open.measures), of(|(_, adapted)| adapted.measures)],
                without_ratio: found.len() - values.len(),
                trials: pairs
                    .iter()
                    .zip(&found)
                    .filter_map(|((open, _), value)| Some((open.key.cell.to_string(), open.key.seed, (*value)?)))
                    .collect(),
            }
        });
        let below = |pair: &&(&Report, &Report)| {
            quantities.iter().all(|quantity| ratio(quantity, pair).is_some_and(|ratio| ratio < quantity.bar))
        };
        Some(Comparison {
            pairs: compared,
            stopped: compared - pairs.len(),
            left_out: all - compared,
            ratios: ratios.collect(),
            all_below: share(pairs.iter().filter(below).count()),
        })
    }
}

/// Adaptation relative to open loop; `None` where open loop has nothing of the quantity, and adaptation has: there is
/// no number for that, in JSON least of all.
fn ratio(quantity: &Quantity, (open, adapted): &(&Report, &Report)) -> Option<f64> {
    let [open, adapted] = [open, adapted].map(|report| (quantity.value)(&report.measures));
    let ratio = if adapted > 0.0 { adapted / open } else { 0.0 };
    Some(ratio).filter(|ratio| ratio.is_finite())
}

/// True if the hand touches in open loop what the comparison is about.
fn meets(open: &Report, scenario: Scenario) -> bool {
    let measures = &open.measures;
    match scenario {
        Scenario::Bottle => measures.table_peak_n > 0.0,
        _ => measures.touch_s.is_some_and(|touch| measures.closing_s.is_none_or(|closing| touch < closing)),
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        let left_out = match self.left_out {
            0 => String::new(),
            1 => "; 1 is left out because open loop meets nothing there".to_owned(),
            n => format!("; {n} are left out because open loop meets nothing there"),
        };
        let stopped =
            if self.stopped == 0 { String::new() } else { format!(", {} of them stopped in (c)", self.stopped) };
        writeln!(formatter, "(c) relative to (a), {} pairs of trials{stopped}{left_out}", self.pairs)?;
        for ratio in &self.ratios {
            let measured = match (ratio.median, ratio.max) {
                (Some(median), Some(max)) => format!("median {median:.2}, largest {max:.2}"),
                _ => "median not measured".to_owned(),
            };
            let without = match ratio.without_ratio {
                0 => String::new(),
                1 => ", 1 with nothing of it in (a) left out".to_owned(),
                n => format!(", {n} with nothing of it in (a) left out"),
            };
            writeln!(
                formatter,
                "  {}: below {:.2} of (a) in {:.0} % of the pairs; {measured}{without}",
                ratio.name,
                ratio.bar,
                100.0 * ratio.below,
            )?;
        }
        if self.ratios.len() > 1 {
            writeln!(formatter, "  all of these: {:.0} % of the pairs", 100.0 * self.all_below)?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;

    /// The change that makes it fail: only an outcome `stopped` is one.
    #[test]
    fn an_arm_that_its_shaking_stopped_is_above_every_bar() {
        let mut results = fixtures::results(&[1]);
        for report in results.reports.iter_mut().filter(|report| report.key.mode == Mode::Adaptive) {
            report.outcome = Outcome::Unstable;
            report.measures = Measures { stopped: true, ..Measures::default() };
        }
        let comparison = Comparison::of(&results, Scenario::Cup).unwrap();
        assert_eq!((comparison.stopped, comparison.all_below), (comparison.pairs, 0.0));
    }

    #[test]
    fn what_open_loop_does_not_meet_is_left_out_and_said_so() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            let adapted = report.key.mode == Mode::Adaptive;
            report.measures.push_m = if adapted { 0.01 } else { 0.04 };
            report.measures.contact_mean_n = Some(match (adapted, report.key.index) {
                (false, _) => 10.0,
                (true, 1) => 6.0,
                (true, _) => 4.0,
            });
            if report.key.index == 0 && !adapted {
                report.measures.touch_s = None;
            }
        }
        let comparison = Comparison::of(&results, Scenario::Cup).unwrap();
        assert_eq!((comparison.pairs, comparison.left_out), (47, 1));
        assert_eq!(comparison.ratios[0].below, 1.0);
        assert!((comparison.ratios[0].median.unwrap() - 0.25).abs() < 1e-12);
        assert!((comparison.all_below - 46.0 / 47.0).abs() < 1e-12, "one cell is touched too hard");
        let text = comparison.to_string();
        assert!(text.contains("1 is left out") && text.contains("median 0.40, largest 0.60"), "{text}");
    }

    /// The change that makes it fail: what an arm that stopped did not do any more counts as done gently.
    #[test]
    fn an_arm_that_stopped_was_not_gentle() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            report.measures.push_m = 0.04;
            if report.key.mode == Mode::Adaptive {
                report.outcome = Outcome::Stopped("JointSpeed".to_owned());
                report.measures.push_m = 0.0;
            }
        }
        let comparison = Comparison::of(&results, Scenario::Cup).unwrap();
        assert_eq!((comparison.pairs, comparison.all_below), (48, 0.0));
        assert_eq!((comparison.ratios[0].below, comparison.ratios[0].trials.len()), (0.0, 0));
        assert!(comparison.to_string().contains("48 of them stopped"), "{comparison}");
        let ratio = &comparison.ratios[0];
        assert_eq!((ratio.median, ratio.max, ratio.medians), (None, None, [None, None]), "nothing was measured");
        assert!(comparison.to_string().contains("median not measured"), "{comparison}");
    }

    /// The change that makes it fail: the ratio to nothing is infinite, or 1e305, and `null` in JSON.
    #[test]
    fn a_pair_with_nothing_of_a_quantity_in_open_loop_has_no_ratio_and_is_above_the_bar() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            report.measures.push_m = 0.01;
            let adapted = report.key.mode == Mode::Adaptive;
            report.measures.contact_mean_n = match (report.key.index, adapted) {
                (0 | 1, false) => Some(0.0),
                (0, true) => Some(f64::MAX),
                (1, true) => None,
                _ => Some(4.0),
            };
        }
        let comparison = Comparison::of(&results, Scenario::Cup).unwrap();
        let contact = &comparison.ratios[1];
        assert_eq!((contact.without_ratio, contact.trials.len(), contact.max), (1, 47, Some(1.0)));
        assert!((contact.below - 1.0 / 48.0).abs() < 1e-12, "nothing in either is below the bar: {}", contact.below);
        assert!(comparison.to_string().contains("1 with nothing of it in (a) left out"), "{comparison}");
        let json = serde_json::to_value(&comparison).unwrap();
        let ratios = json["ratios"][1]["trials"].as_array().unwrap();
        assert!(ratios.iter().all(|trial| trial[2].is_f64()), "{json}");
    }

    #[test]
    fn one_mode_alone_is_compared_with_nothing() {
        let mut results = fixtures::results(&[1]);
        results.reports.retain(|report| report.key.mode == Mode::Adaptive);
        assert_eq!(Comparison::of(&results, Scenario::Cup), None);
    }
}
