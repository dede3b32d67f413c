//! The first line of results: the configuration that their trials belong to, in words that can be read back.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};
use sim::world::ObjectKind;

use super::grid::{Cell, Grid};
use super::scenario::PlantKind;
use super::variation::Variation;

/// Name of the hash of the code among the words of a header ([`Header::described`]).
pub const CODE: &str = "code";
/// Name of the cells among them.
pub const CELLS: &str = "cells";
/// Words for no variation.
pub const NO_VARIATION: &str = "none";

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

/// A part of a configuration that is not the same.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Difference {
    /// Its name among the words of a header.
    pub name: String,
    /// The words of the results that are there.
    pub was: String,
    /// The words of the configuration that is asked for.
    pub is: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{} was {}, is {}", self.name, self.was, self.is)
    }
}

/// The differences one after the other.
pub fn in_words(differences: &[Difference]) -> String {
    differences.iter().map(Difference::to_string).collect::<Vec<_>>().join(", ")
}

/// The parts of a configuration that options of the command decide, read back from a header.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Chosen {
    /// The object; `None` of one that is not compiled in.
    pub object: Option<ObjectKind>,
    /// The cells, turned and shifted as they were tried.
    pub grid: Option<Grid>,
    /// The difference between plant and model.
    pub plant: Option<PlantKind>,
    /// Factors that differ from that plant.
    pub variation: Option<Variation>,
    /// The arms were weighed before.
    pub weighed: bool,
}

impl Header {
    /// The parts by which the trials below this header are not those of `is`; nothing where they are.
    pub fn differences(&self, is: &Header) -> Vec<Difference> {
        let word = |of: &Header, name: &str| of.described.get(name).cloned().unwrap_or_else(|| "-".to_owned());
        let difference = |name: &str, was: &str, is: &str| Difference {
            name: name.to_owned(),
            was: was.to_owned(),
            is: is.to_owned(),
        };
        let mut names: Vec<&String> = self.described.keys().chain(is.described.keys()).collect();
        names.sort();
        names.dedup();
        let counts = |name: &str| name != CODE || is.described.contains_key(CODE);
        let mut found: Vec<Difference> = names
            .into_iter()
            .filter(|name| counts(name.as_str()) && !self.is_same(is, name.as_str()))
            .map(|name| difference(name, &word(self, name), &word(is, name)))
            .collect();
        if self.experiment != is.experiment {
            found.insert(0, difference("the experiment", &self.experiment, &is.experiment));
        }
        // The hash is one of the words, and of cells as they are written.
        let is_rewritten = self.described.get(CELLS) != is.described.get(CELLS);
        if found.is_empty() && !is_rewritten && self.configuration != is.configuration {
            found.push(difference("the hash", &self.configuration, &is.configuration));
        }
        found
    }

    /// True if a part is the same, cells by what they mean: versions before wrote `-2.9000000000000004` for -2.9 cm.
    fn is_same(&self, is: &Header, name: &str) -> bool {
        let (was, is) = (self.described.get(name), is.described.get(name));
        was == is
            || (name == CELLS
                && was.zip(is).is_some_and(|(was, is)| cells(was).is_some_and(|was| cells(is) == Some(was))))
    }

    /// The parts that options decide.
    pub fn chosen(&self) -> Chosen {
        let word = |name: &str| self.described.get(name).map(String::as_str);
        let plants = [PlantKind::Perturbed, PlantKind::Ideal];
        Chosen {
            object: word("object").and_then(|name| name.parse().ok()),
            grid: word(CELLS).and_then(cells).map(|cells| Grid { cells }),
            plant: word("plant").and_then(|name| plants.into_iter().find(|plant| plant.name() == name)),
            variation: word("variation").and_then(|text| match text {
                NO_VARIATION => Some(Variation::default()),
                text => text.parse().ok(),
            }),
            weighed: word("arms").is_some(),
        }
    }
}

/// The cells that a header lists.
fn cells(text: &str) -> Option<Vec<Cell>> {
    text.split(' ').map(|cell| cell.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header(words: &[(&str, &str)]) -> Header {
        let described = words.iter().map(|(name, word)| ((*name).to_owned(), (*word).to_owned())).collect();
        Header { experiment: "flashlight".to_owned(), configuration: format!("{words:?}"), described }
    }

    /// The change that makes it fail: options of the command that the words do not give back, so that whoever wants
    /// figures has to repeat them.
    #[test]
    fn what_was_chosen_is_read_back_from_the_words() {
        let chosen = header(&[
            ("object", "cup"),
            ("cells", "-24:8 0.1:-2.9"),
            ("plant", "ideal"),
            ("variation", "mass=1.3,delay=1"),
            ("arms", "weighed"),
        ])
        .chosen();
        assert_eq!((chosen.object, chosen.plant), (Some(ObjectKind::Cup), Some(PlantKind::Ideal)));
        assert_eq!(chosen.grid, Some("-24:8,0.1:-2.9".parse().unwrap()));
        assert_eq!(chosen.variation, Some("mass=1.3,delay=1".parse().unwrap()));
        assert!(chosen.weighed);
        let usual = header(&[("object", "mug 0x12345678"), ("variation", "none")]).chosen();
        assert_eq!((usual.object, usual.variation, usual.weighed), (None, Some(Variation::default()), false));
    }

    /// The change that makes it fail: the hash alone, which is of the words as they were written.
    #[test]
    fn cells_that_are_written_otherwise_are_the_same_and_others_are_not() {
        let old = header(&[("cells", "-2.9000000000000004:13.700000000000001 0:0"), ("code", "0x1")]);
        assert_eq!(old.differences(&header(&[("cells", "-2.9:13.7 0:0")])), []);
        let other = old.differences(&header(&[("cells", "-2.9:13.6 0:0"), ("code", "0x2")]));
        assert_eq!(other.iter().map(|difference| difference.name.as_str()).collect::<Vec<_>>(), ["cells", "code"]);
        let mut forged = old.clone();
        forged.configuration = "other".to_owned();
        assert_eq!(in_words(&old.differences(&forged)), format!("the hash was {}, is other", old.configuration));
    }
}
