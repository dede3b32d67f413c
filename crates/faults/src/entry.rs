//! One entry of the catalogue as a file: what happens to the arm, and what it has to do.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use control::{Fault, State};
use lab::procedure::Mode;
use serde::{Deserialize, Serialize};
use sim::Noise;
use sim::fault::{FaultKind, Injection};

use crate::figure::Figure;

/// Stream of noise that shifts scenarios.
const SHIFT_STREAM: u64 = 0x5704;

/// Longest time by which a scenario is shifted, s.
const LATEST: f64 = 0.12;

/// Largest share by which a push of a shifted scenario differs from what is written.
const HARDER: f64 = 0.07;

/// An entry: the file `tests/faults/NAME.toml`.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Entry {
    /// Identifier, from the file name.
    #[serde(skip)]
    pub id: String,
    /// The fault, in a few words.
    pub title: String,
    /// The bar of the catalogue, in its words.
    pub bar: String,
    /// The mark that `docs/faults.md` gives the entry.
    pub today: String,
    /// The part that only a board or an arm can show.
    #[serde(default)]
    pub hardware: Option<String>,
    /// Tests of other packages that hold the entry, or a part of it.
    #[serde(default)]
    pub test: Vec<String>,
    /// Scenarios on the simulated arm.
    #[serde(default)]
    pub scenario: Vec<Scenario>,
}

/// An arm in some state, what befalls it, and what must come of it.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Scenario {
    /// Name, unique in its entry.
    pub name: String,
    /// The state in which the arm is at time 0.
    pub from: From,
    /// Mode of the run: `t` track, `a` open loop, `b` force control, `c` adaptive.
    #[serde(default)]
    pub mode: Mode,
    /// Seed of everything random.
    #[serde(default = "one")]
    pub seed: u64,
    /// Time watched from time 0 on, s.
    pub watch: f64,
    /// The images of the co-controller go through it too: with `--device sim:` and `--device board:`.
    #[serde(default)]
    pub firmware: bool,
    /// A defect that is known: the scenario must fail, by the figures in `misses` and nothing else.
    #[serde(default)]
    pub known: Option<Known>,
    /// Faults; their times count from time 0.
    #[serde(default)]
    pub inject: Vec<Injection>,
    /// The scenario is gone through so many times, each time with its faults later.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sweep: Option<Sweep>,
    /// Orders of the host.
    #[serde(default)]
    pub order: Vec<Order>,
    /// Bars for the outcome.
    #[serde(default)]
    pub expect: Expect,
    /// The way back, and whether zeroing must be demanded on it.
    #[serde(default)]
    pub recover: Recover,
    /// Faults on the way back, whose times count from its beginning. It may fail by them; once they are over it is gone
    /// again, and has to lead to its end.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub late: Vec<Injection>,
}

impl Scenario {
    /// True if a fault of it lies in the co-controller's own bus controller, which images have from their emulator.
    #[must_use]
    pub fn is_of_the_port(&self) -> bool {
        self.inject.iter().any(|injection| injection.what.is_of_the_port())
    }

    /// The scenario up to 0.12 s later, its pushes up to 7 % harder or weaker: a bar that holds at the written
    /// millisecond alone does not hold. One that begins with the power-up stays as it is: its start-up has times of its
    /// own.
    #[must_use]
    pub fn shifted(&self, seed: u64) -> Self {
        let mut shifted = self.clone();
        if self.from == From::PowerUp {
            return shifted;
        }
        let mut dice = Noise::new(
            seed,
            self.name.bytes().fold(SHIFT_STREAM, |all, byte| all.wrapping_mul(31).wrapping_add(u64::from(byte))),
        );
        let (later, share) = (dice.uniform(0.0, LATEST), dice.uniform(1.0 - HARDER, 1.0 + HARDER));
        shifted.watch += later;
        shifted.order.iter_mut().for_each(|order| order.at += later);
        for injection in &mut shifted.inject {
            injection.at += later;
            if let FaultKind::Push { force } = &mut injection.what {
                *force = force.map(|value| value * share);
            }
        }
        shifted
    }

    /// The scenario for each arm of the sweep; itself where there is none.
    pub(crate) fn each(&self) -> impl Iterator<Item = Self> {
        let Sweep { count, by, keep } = self.sweep.unwrap_or(Sweep { count: 1, by: 0.0, keep: 0 });
        (0..count).map(move |number| {
            let mut shifted = self.clone();
            shifted.inject.iter_mut().skip(keep).for_each(|injection| injection.at += f64::from(number) * by);
            shifted
        })
    }
}

/// A defect that is known.
#[derive(Debug, Clone, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Known {
    /// A sentence that says what happens instead.
    pub defect: String,
    /// The figures that are out of their bars by it, and how far they may be; every other bar holds nevertheless.
    pub misses: BTreeMap<Figure, f64>,
}

/// One fault at each of many moments, each on an arm of its own.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Sweep {
    /// Number of arms.
    pub count: u32,
    /// Time from the faults of one arm to those of the next, s.
    pub by: f64,
    /// So many faults, the first ones, befall every arm at the same time.
    #[serde(default)]
    pub keep: usize,
}

/// States in which a scenario begins.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum From {
    /// Power-up of the device; arm and pucks run already, the safety module is in IDLE. Time 0 is the power-up.
    PowerUp,
    /// Weightless in a person's hand.
    Gravity,
    /// Holding a posture.
    Hold,
    /// On the way to another posture.
    Approach,
    /// In the taught movement, from its first cycle on.
    Run,
    /// Sinking after a release.
    Lowering,
}

/// An order of the host.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Order {
    /// Time, s.
    pub at: f64,
    /// The order.
    pub give: Given,
    /// Its answer, if it matters.
    #[serde(default)]
    pub answer: Option<Answer>,
}

/// Orders a host can give.
#[derive(Debug, Clone, Copy, PartialEq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Given {
    /// Stop.
    Stop,
    /// Clear the fault.
    Clear,
    /// Hold the posture.
    Hold,
    /// Float.
    Gravity,
    /// Give up torque.
    Release,
    /// End the movement so far from the taught place, m, world axes.
    Goal([f64; 3]),
    /// Move by this factor faster.
    Speed(f64),
    /// The host says nothing for so many seconds.
    Silence(f64),
    /// Approach the end of the movement.
    Approach,
    /// The movement, in the mode of the scenario.
    Run,
    /// Spread and fingers F1 to F3 go there, rad.
    Hand([f64; 4]),
    /// Initialise the hand.
    InitialiseHand,
    /// Take the present wrench for zero.
    Tare,
    /// The movement is uploaded.
    Upload,
}

/// Answers of the device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Answer {
    /// Done.
    Accepted,
    /// Not done, with a reason.
    Refused,
}

/// Bars for the outcome of a scenario.
#[derive(Debug, Clone, Default, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Expect {
    /// State at the end of the watch, one of these.
    #[serde(default)]
    pub state: Vec<String>,
    /// Latched fault at the end of the watch, one of these.
    #[serde(default)]
    pub fault: Vec<String>,
    /// Largest values of figures, beside those that hold for every scenario.
    #[serde(default)]
    pub most: BTreeMap<Figure, f64>,
    /// Smallest values of figures.
    #[serde(default)]
    pub least: BTreeMap<Figure, f64>,
}

/// The way back.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Recover {
    /// Rest, activate if need be, clear, hold, back to the start, the whole movement. Nobody may ask for zeroing.
    #[default]
    Run,
    /// The same, and the device must demand zeroing before it lets the arm hold.
    Zero,
    /// The same, zeroing if the device demands it.
    ZeroIfAsked,
    /// There is no way back in this scenario.
    None,
}

/// Why an entry cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum EntryError {
    /// The file or folder cannot be read.
    #[error("{path}: {1}", path = .0.display())]
    Unreadable(PathBuf, std::io::Error),
    /// It is no entry.
    #[error("{path}: {1}", path = .0.display())]
    Malformed(PathBuf, toml::de::Error),
    /// A value means nothing.
    #[error("{path}: {1}", path = .0.display())]
    Meaningless(PathBuf, String),
}

impl Entry {
    /// Reads an entry; `path` gives its identifier.
    ///
    /// # Errors
    /// [`EntryError`]: unreadable, an unknown key, a state or fault that there is not.
    pub fn read(path: &Path) -> Result<Self, EntryError> {
        let text = std::fs::read_to_string(path).map_err(|cause| EntryError::Unreadable(path.to_owned(), cause))?;
        Self::parse(path, &text)
    }

    /// As [`Entry::read`], from a text.
    ///
    /// # Errors
    /// As [`Entry::read`].
    pub fn parse(path: &Path, text: &str) -> Result<Self, EntryError> {
        let mut entry: Entry = toml::from_str(text).map_err(|cause| EntryError::Malformed(path.to_owned(), cause))?;
        entry.id = path.file_stem().unwrap_or_default().to_string_lossy().to_uppercase();
        entry.sense().map_err(|cause| EntryError::Meaningless(path.to_owned(), cause))?;
        Ok(entry)
    }

    /// Reads every entry of a folder, in the order of the catalogue.
    ///
    /// # Errors
    /// As [`Entry::read`].
    pub fn all(folder: &Path) -> Result<Vec<Self>, EntryError> {
        let unreadable = |cause| EntryError::Unreadable(folder.to_owned(), cause);
        let mut entries = Vec::new();
        for file in std::fs::read_dir(folder).map_err(unreadable)? {
            let path = file.map_err(unreadable)?.path();
            if path.extension().is_some_and(|extension| extension == "toml") {
                entries.push(Self::read(&path)?);
            }
        }
        entries.sort_by_key(Entry::place);
        Ok(entries)
    }

    /// Place in the catalogue: letter, number.
    fn place(&self) -> (char, u32) {
        let (letter, number) = self.id.split_at(self.id.len().min(1));
        (letter.chars().next().unwrap_or(' '), number.parse().unwrap_or(u32::MAX))
    }

    fn sense(&self) -> Result<(), String> {
        if self.scenario.is_empty()
            && self.test.is_empty()
            && self.hardware.is_none()
            && !self.today.starts_with("open")
        {
            return Err("neither scenario, test nor hardware, and not open".to_owned());
        }
        for scenario in &self.scenario {
            let (states, faults) = (&scenario.expect.state, &scenario.expect.fault);
            let unknown_state = states.iter().find(|name| State::ALL.iter().all(|state| state.name() != **name));
            let unknown_fault = faults.iter().find(|name| Fault::ALL.iter().all(|fault| fault_name(*fault) != **name));
            if let Some(name) = unknown_state.or(unknown_fault) {
                return Err(format!("{}: no state or fault '{name}'", scenario.name));
            }
            for (index, injection) in scenario.inject.iter().chain(&scenario.late).enumerate() {
                injection.check().map_err(|cause| format!("{}: fault {}: {cause}", scenario.name, index + 1))?;
            }
            if scenario.sweep.is_some_and(|sweep| sweep.count == 0 || sweep.by.is_nan() || sweep.by <= 0.0) {
                return Err(format!("{}: a sweep of no arms, or of no time", scenario.name));
            }
            if scenario.known.is_some() && self.today == "held" {
                return Err(format!("{}: a known defect in an entry that is held", scenario.name));
            }
            if scenario.known.as_ref().is_some_and(|known| known.misses.is_empty()) {
                return Err(format!("{}: a known defect by which nothing is out of its bar", scenario.name));
            }
        }
        Ok(())
    }
}

/// Name of a fault as `docs/faults.md` has it.
#[must_use]
pub fn fault_name(fault: Fault) -> String {
    format!("{fault:?}")
}

fn one() -> u64 {
    1
}
