//! The part by which an experiment can be counted that was broken off: a trial that is missing is no failure.

use std::collections::{BTreeMap, BTreeSet};

use super::results::{Key, Results};

impl Results {
    /// The trials that count, of an experiment that wants these: those of the seeds that are through. While none is,
    /// those of the seed that is farthest, in the cells that are through.
    #[must_use]
    pub fn whole(self, wanted: &[Key]) -> Results {
        let there: BTreeSet<Key> = self.reports.iter().map(|report| report.key).collect();
        let missing =
            |test: &dyn Fn(&Key) -> bool| wanted.iter().filter(|key| test(key) && !there.contains(key)).count();
        let seeds: BTreeSet<u64> = wanted.iter().map(|key| key.seed).collect();
        let lacks: BTreeMap<u64, usize> = seeds.iter().map(|&seed| (seed, missing(&|key| key.seed == seed))).collect();
        let least = lacks.iter().min_by_key(|(_, lacks)| **lacks).map(|(seed, lacks)| (*seed, *lacks));
        let counts = |key: &Key| match least {
            None => false,
            Some((_, 0)) => lacks.get(&key.seed) == Some(&0),
            Some((seed, _)) => {
                key.seed == seed && missing(&|other| (other.seed, other.index) == (seed, key.index)) == 0
            }
        };
        Results { reports: self.reports.into_iter().filter(|report| counts(&report.key)).collect() }
    }
}

#[cfg(test)]
mod tests {
    use crate::fixtures;
    use crate::{Grid, Mode, Results, Summary, map};

    /// The reports of an experiment with two seeds as they come, seed by seed and cell by cell.
    fn in_order() -> Results {
        let mut results = fixtures::results(&[1, 2]);
        results.reports.sort_by_key(|report| (report.key.seed, report.key.index, report.key.mode));
        results
    }

    /// The change that makes it fail: trials that are not there yet are counted as cells in which nothing was held.
    #[test]
    fn a_seed_that_was_broken_off_counts_neither_as_success_nor_as_failure() {
        let all = in_order();
        let keys: Vec<_> = all.reports.iter().map(|report| report.key).collect();
        let cut = |count: usize| Results::new(all.reports[..count].to_vec()).whole(&keys);
        let of = |results: &Results| Summary::of(results, Mode::Adaptive, None);
        let first = of(&fixtures::results(&[1]));
        let (broken, whole) = (of(&cut(48 * 3 + 40)), of(&cut(48 * 3 * 2)));
        assert_eq!((broken.success, broken.seeds, broken.success_interval), (first.success, 1, None));
        assert_eq!((whole.success_by_seed, whole.seeds), (of(&all).success_by_seed, 2));
    }

    #[test]
    fn of_a_first_seed_the_cells_in_which_every_mode_was_tried_count() {
        let all = in_order();
        let keys: Vec<_> = all.reports.iter().map(|report| report.key).collect();
        // Ten cells, and one mode of the next; another job has begun with the second seed.
        let mut reports = all.reports[..31].to_vec();
        reports.push(all.reports[48 * 3].clone());
        let results = Results::new(reports).whole(&keys);
        assert_eq!((results.reports.len(), results.seeds()), (30, vec![1]));
        let summary = Summary::of(&results, Mode::OpenLoop, None);
        assert_eq!(summary.cells, 10);
        let text = map::draw(&results, &Grid::paper());
        assert!(text.contains(&format!("(a) {}/10", summary.success)), "{text}");
        assert!(Results::default().whole(&keys).reports.is_empty());
    }
}
