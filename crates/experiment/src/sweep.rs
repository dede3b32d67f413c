//! `Sweep`: one factor of the plant over a range, and what is held along it.

use std::str::FromStr;

use serde::Serialize;

use super::interval::Interval;
use super::statistics::Summary;
use super::variation::Variation;
use lab::procedure::Mode;
use lab::table::Table;

/// Steps unless said otherwise.
const STEPS: usize = 5;
/// Most steps.
const MOST_STEPS: usize = 50;
/// Share of what was held at the beginning, below which a sweep has found its boundary.
const FAILED: f64 = 0.5;

/// A factor of the plant and the values it takes, in order.
#[derive(Debug, Clone, PartialEq)]
pub struct Sweep {
    /// Name of the factor, as in [`Variation`].
    pub name: String,
    /// Its values.
    pub values: Vec<f64>,
    /// Its number among the parts of a variation.
    part: usize,
}

impl Sweep {
    /// The plant at one of the values: `usual` with this factor replaced.
    pub fn variation(&self, mut usual: Variation, value: f64) -> Variation {
        usual.set(self.part, value);
        usual
    }
}

/// `NAME=FROM:TO` or `NAME=FROM:TO:STEPS`.
impl FromStr for Sweep {
    type Err = String;

    fn from_str(text: &str) -> Result<Sweep, String> {
        let usage = || format!("'{text}' is no sweep; joint-friction=1:0 or delay=0:3:3 is (NAME=FROM:TO[:STEPS])");
        let (name, range) = text.split_once('=').ok_or_else(usage)?;
        let mut parts = range.split(':').map(str::trim);
        let mut number = || parts.next().and_then(|part| part.parse::<f64>().ok()).ok_or_else(usage);
        let (from, to) = (number()?, number()?);
        let steps = match parts.next() {
            None if name.trim() == "delay" => (to - from).abs() as usize,
            None => STEPS,
            Some(steps) => steps.parse().map_err(|_| usage())?,
        };
        if parts.next().is_some() || !(1..=MOST_STEPS).contains(&steps) || from == to {
            return Err(usage());
        }
        // Rounded, so that a tenth is written as one.
        let value = |step: usize| {
            let value = from + (to - from) * step as f64 / steps as f64;
            (value * 1e6).round() / 1e6
        };
        let (name, values) = (name.trim().to_owned(), (0..=steps).map(value).collect::<Vec<_>>());
        if let Some(pair) = values.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(format!("'{text}' has the value {} twice, rounded to a millionth; take fewer steps", pair[0]));
        }
        for value in &values {
            format!("{name}={value}").parse::<Variation>()?;
        }
        let part = Variation::part(&name).ok_or_else(usage)?;
        Ok(Sweep { name, values, part })
    }
}

/// Cells that were held, for one plant: mode by mode, demonstration by demonstration, arm by arm.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Point {
    /// Value of the factor that is swept; `None` of a study without a sweep.
    pub value: Option<f64>,
    /// Cells that were tried with each arm.
    pub cells: usize,
    /// The arms, by their seeds, of which every demonstration has a count.
    #[serde(skip)]
    arms: Vec<u64>,
    /// The modes with their counts, `[demonstration][arm]`.
    pub held: Vec<(Mode, Vec<Vec<usize>>)>,
}

impl Point {
    /// Before any demonstration.
    #[must_use]
    pub fn new(value: Option<f64>) -> Self {
        Point { value, cells: 0, arms: Vec::new(), held: Vec::new() }
    }

    /// The same with these counts of the arms 1, 2, and so on.
    #[cfg(test)]
    pub(crate) fn with(value: f64, held: Vec<(Mode, Vec<Vec<usize>>)>) -> Self {
        let arms = held.iter().flat_map(|(_, counts)| counts).map(Vec::len).max().unwrap_or(0) as u64;
        Point { cells: 48, arms: (1..=arms).collect(), held, ..Point::new(Some(value)) }
    }

    /// Adds a demonstration: the statistics of its modes, of these arms. An arm that a demonstration lacks is left out
    /// of all, else the counts of different arms would stand for one.
    pub fn add(&mut self, modes: &[Summary], arms: &[u64]) {
        let before = std::mem::take(&mut self.arms);
        let is_first = self.held.is_empty();
        self.arms = arms.iter().copied().filter(|arm| is_first || before.contains(arm)).collect();
        let of_all = |counts: &[usize], arms: &[u64]| -> Vec<usize> {
            let counted = counts.iter().zip(arms).filter(|(_, arm)| self.arms.contains(arm));
            counted.map(|(count, _)| *count).collect()
        };
        for counts in self.held.iter_mut().flat_map(|(_, counts)| counts) {
            *counts = of_all(counts, &before);
        }
        for summary in modes {
            self.cells = summary.cells;
            let place = self.held.iter().position(|(mode, _)| *mode == summary.mode);
            let place = place.unwrap_or_else(|| {
                self.held.push((summary.mode, Vec::new()));
                self.held.len() - 1
            });
            self.held[place].1.push(of_all(&summary.success_by_seed, arms));
        }
    }

    /// Mean of a mode with its interval; of one arm and one demonstration the count alone.
    pub fn interval(&self, mode: Mode) -> Option<Interval> {
        let (_, counts) = self.held.iter().find(|(held, _)| *held == mode)?;
        Interval::of(counts).or_else(|| {
            let mean = *counts.first()?.first()? as f64;
            Some(Interval { mean, low: mean, high: mean })
        })
    }

    /// Cells that the best mode held, in the mean.
    fn best(&self) -> f64 {
        self.held.iter().filter_map(|(mode, _)| self.interval(*mode)).map(|held| held.mean).fold(0.0, f64::max)
    }
}

/// True once no mode holds half of what the best one held at first: farther out there is nothing to learn.
pub fn has_failed(points: &[Point]) -> bool {
    matches!(points, [first, .., last] if last.best() < FAILED * first.best())
}

/// Value by value and mode by mode, as a table; `name` is what is swept.
pub fn table(points: &[Point], name: Option<&str>) -> String {
    let modes: Vec<Mode> =
        points.first().map(|point| point.held.iter().map(|(mode, _)| *mode).collect()).unwrap_or_default();
    let mut heading = vec![name.unwrap_or("held").to_owned()];
    heading.extend(modes.iter().map(|mode| format!("({mode}) {}", mode.title())));
    let mut table = Table::new(heading);
    for point in points {
        let mut row = vec![point.value.map_or_else(|| format!("of {}", point.cells), |value| value.to_string())];
        row.extend(modes.iter().map(|mode| {
            point.interval(*mode).map_or_else(
                || "-".to_owned(),
                |held| {
                    let ends = if held.low < held.high { format!(" ({})", held.bounds()) } else { String::new() };
                    format!("{:.1}{ends}", held.mean)
                },
            )
        }));
        table.row(row);
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;

    fn point(value: f64, held: usize) -> Point {
        Point::with(value, vec![(Mode::Adaptive, vec![vec![held, held + 2]])])
    }

    #[test]
    fn a_sweep_goes_through_its_range_and_refuses_what_the_plant_cannot_be() {
        let sweep: Sweep = "joint-friction=1:0".parse().unwrap();
        assert_eq!(sweep.values, [1.0, 0.8, 0.6, 0.4, 0.2, 0.0]);
        assert_eq!("delay=0:3".parse::<Sweep>().unwrap().values, [0.0, 1.0, 2.0, 3.0]);
        assert_eq!("bias=0:1:2".parse::<Sweep>().unwrap().values, [0.0, 0.5, 1.0]);
        let usual: Variation = "mass=1.3,joint-friction=0.7".parse().unwrap();
        assert_eq!(sweep.variation(usual, 0.2).to_string(), "mass=1.3,joint-friction=0.2");
        for (wrong, words) in [
            ("bias=0:9", "between 0 and 2"),
            ("colour=0:1", "cannot be varied"),
            ("delay=0:1:2", "whole number"),
            ("bias=1:1", "is no sweep"),
            ("bias=0:1:0", "is no sweep"),
            ("bias=0:1:2:3", "is no sweep"),
            ("bias", "is no sweep"),
            ("bias=nan:1", "between"),
        ] {
            let refused = wrong.parse::<Sweep>().unwrap_err();
            assert!(refused.contains(words), "{wrong}: {refused}");
        }
    }

    /// The change that makes it fail: `Sweep::from_str` does not compare neighbours, and two values have one folder.
    #[test]
    fn values_that_are_one_when_rounded_are_refused_before_any_trial() {
        let refused = "joint-friction=1:1.0000001:2".parse::<Sweep>().unwrap_err();
        assert!(refused.contains("the value 1 twice") && refused.contains("fewer steps"), "{refused}");
        assert_eq!("joint-friction=1:1.000002:2".parse::<Sweep>().unwrap().values, [1.0, 1.000_001, 1.000_002]);
    }

    #[test]
    fn a_sweep_has_failed_when_less_than_half_is_held() {
        assert!(!has_failed(&[point(1.0, 40)]));
        assert!(!has_failed(&[point(1.0, 40), point(0.5, 20)]));
        assert!(has_failed(&[point(1.0, 40), point(0.5, 20), point(0.0, 19)]));
    }

    /// The change that makes it fail: the counts of demonstrations that lack an arm are paired by their places.
    #[test]
    fn an_arm_that_a_demonstration_lacks_is_left_out_of_all() {
        let mut point = Point::new(Some(0.0));
        let mut of = |seeds: &[u64], at: fn(u64) -> usize| {
            let mut results = fixtures::results(seeds);
            for report in &mut results.reports {
                let held = report.key.mode == Mode::Adaptive && report.key.index < at(report.key.seed);
                report.outcome = if held { Outcome::Held } else { Outcome::Missed };
            }
            let summary = Summary::of(&results, Mode::Adaptive, None);
            point.add(&[summary], &results.seeds());
        };
        // Of the arms 1, 2 and 3 the second demonstration lacks the first.
        of(&[1, 2, 3], |seed| [0, 10, 20, 30][seed as usize]);
        of(&[2, 3], |seed| [0, 10, 20, 30][seed as usize]);
        assert_eq!(point.held, [(Mode::Adaptive, vec![vec![20, 30]; 2])]);
        assert_eq!((point.arms.as_slice(), point.interval(Mode::Adaptive).unwrap().mean), (&[2, 3][..], 25.0));
    }

    #[test]
    fn the_table_gives_mean_and_interval() {
        let text = table(&[point(1.0, 44), point(0.5, 40)], Some("joint-friction"));
        assert!(text.contains("45.0 (44.0 to 46.0)") && text.contains("joint-friction"), "{text}");
    }
}
