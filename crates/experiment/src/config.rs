//! The parts of an experiment, and the hash by which its results are known.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use sim::world::mujoco::{ObjectKind, ObjectSpec, TABLE_TOP};

use super::grid::{ApproachFrame, Cell, Grid};
use super::header::{CELLS, CODE, Header, NO_VARIATION};
use super::outcome::Rule;
use super::results::{Key, Results};
use super::scenario::{PlantKind, Scenario};
use super::seed;
use super::variation::Variation;
use control::model::WeightCorrection;
use lab::demonstration::recording::checksum;
use lab::plan;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::Mode;
use lab::simulation::Engine;
use lab::transport::ChipOptions;

/// Version of what a trial is: results of another one can neither be continued nor drawn.
const VERSION: u32 = 3;

/// An experiment.
#[derive(Debug, Clone)]
pub struct Config {
    /// The scenario.
    pub scenario: Scenario,
    /// The object on the table.
    pub object: ObjectKind,
    /// Where.
    pub grid: Grid,
    /// The modes in which the primitive is played. None, and no seed: those of the results that are there, for their
    /// figures ([`Config::as_it_is`]).
    pub modes: Vec<Mode>,
    /// With which seeds.
    pub seeds: Vec<u64>,
    /// The engine that executes the co-controller's application.
    pub engine: Engine,
    /// The difference between plant and model.
    pub plant: PlantKind,
    /// Factors that differ from that plant.
    pub variation: Variation,
    /// The primitive.
    pub primitive: PrimitiveFile,
    /// Simulations at a time.
    pub jobs: usize,
    /// Folder of the results; `None` keeps them in memory.
    pub out: Option<PathBuf>,
    /// Go on with the results that are there.
    pub resume: bool,
    /// Take the results that are there for all: no trials.
    pub as_it_is: bool,
    /// The weight that the devices of these arms were given, by seed; others compute with the model's.
    pub weights: BTreeMap<u64, WeightCorrection>,
    /// Keep what pictures and time series need of the first seed's trials.
    pub keep_traces: bool,
    /// Write every trial's telemetry into the folder.
    pub keep_recordings: bool,
}

impl Config {
    /// The scenario as it is meant: all modes, seed 1, in this process, the perturbed plant, all processors, nothing on
    /// disk.
    pub fn new(scenario: Scenario, primitive: PrimitiveFile) -> Config {
        Config {
            scenario,
            object: scenario.object(),
            grid: scenario.grid(),
            modes: scenario.modes(),
            seeds: vec![1],
            engine: Engine::InProcess,
            plant: PlantKind::Perturbed,
            variation: Variation::default(),
            primitive,
            jobs: std::thread::available_parallelism().map_or(1, usize::from),
            out: None,
            resume: false,
            as_it_is: false,
            weights: BTreeMap::new(),
            keep_traces: false,
            keep_recordings: false,
        }
    }

    /// All trials, in the order in which they are tried: cell by cell, so that a broken off experiment has complete
    /// cells.
    pub fn keys(&self) -> Vec<Key> {
        let cells = || self.grid.cells.iter().copied().enumerate();
        let trial = |seed: u64| {
            cells().flat_map(move |(index, cell)| self.modes.iter().map(move |&mode| Key { index, cell, mode, seed }))
        };
        self.seeds.iter().flat_map(|&seed| trial(seed)).collect()
    }

    /// The same with the modes and seeds of these results where it names none.
    #[must_use]
    pub fn of_what_is_there(&self, results: &Results) -> Config {
        let mut config = self.clone();
        if config.modes.is_empty() {
            config.modes = results.modes();
        }
        if config.seeds.is_empty() {
            config.seeds = results.seeds();
        }
        config
    }

    /// The frame of the approach: its goal is where the primitive ends (where its fingers close, for one that lifts),
    /// its direction that of the hand's z axis there; of a grasp from above, where the hand comes from.
    ///
    /// `None` for a primitive that cannot be played.
    pub fn frame(&self) -> Option<ApproachFrame> {
        let goal = &self.primitive.goal;
        frame(self.scenario, self.primitive.start.position, goal.position, goal.orientation)
    }

    /// The object in a cell.
    pub fn object_at(&self, frame: &ApproachFrame, cell: Cell) -> ObjectSpec {
        let usual = ObjectSpec::new(self.object);
        ObjectSpec {
            mass: usual.mass * self.variation.mass,
            table_friction: usual.table_friction * self.variation.table_friction,
            finger_friction: usual.finger_friction * self.variation.finger_friction,
            ..usual.at(frame.world(cell))
        }
    }

    /// By what a trial is judged.
    pub fn rule(&self) -> Rule {
        Rule { upright: !self.object.row().lies }
    }

    /// Horizontal force at the height of the grasp that tips the object over, N; `None` for what lies, or slides
    /// before it tips.
    pub fn tipping_force(&self) -> Option<f64> {
        let object = self.object_at(&self.frame()?, Cell::default());
        let tips = object.toppling_force(self.grasp_height());
        (self.rule().upright && tips < object.table_friction * object.mass * 9.81).then_some(tips)
    }

    /// Height over the table at which the hand meets the object, m.
    fn grasp_height(&self) -> f64 {
        (self.closing_position()[2] - TABLE_TOP).max(0.01)
    }

    /// Where the plan is when the fingers begin to close, m: the goal, but for a movement that goes on from there.
    fn closing_position(&self) -> [f64; 3] {
        let goal = self.primitive.goal;
        let start = self.primitive.start.hand;
        let references = self.primitive.to_primitive().ok().and_then(|primitive| plan::roll_out(&primitive).ok());
        let closing = references
            .unwrap_or_default()
            .into_iter()
            .find(|reference| (1..4).any(|finger| (reference.points.x[7 + finger] - start[finger]).abs() > 0.05));
        closing.map_or(goal.position, |reference| reference.poses[0].position.x)
    }

    /// The identity of the results. Modes and seeds do not count: more of them may be added later.
    pub fn header(&self) -> Header {
        let frame = self.frame().unwrap_or(ApproachFrame { goal: [0.0; 2], direction: [1.0, 0.0] });
        let cells: Vec<String> = self.grid.cells.iter().map(Cell::to_string).collect();
        let engine = match &self.engine {
            Engine::InProcess => "in this process".to_owned(),
            Engine::Absent => "nowhere".to_owned(),
            Engine::Qemu { image } | Engine::Hand { image } => format!("{} under QEMU", firmware(image)),
            Engine::Board(board) => {
                let given =
                    if board.chip == ChipOptions::default() { String::new() } else { format!(", {:?}", board.chip) };
                format!("{} on the emulated board{given}", firmware(&board.image))
            }
        };
        let variation = self.variation.to_string();
        let mut described: BTreeMap<String, String> = [
            ("object", described(self.object)),
            (CELLS, cells.join(" ")),
            ("engine", engine),
            ("plant", self.plant.name().to_owned()),
            ("variation", if variation.is_empty() { NO_VARIATION.to_owned() } else { variation }),
            ("primitive", format!("{} 0x{:08x}", self.primitive.name, self.primitive.checksum())),
            ("goal", format!("{:.4} {:.4}", frame.goal[0], frame.goal[1])),
            ("model", format!("0x{:08x}", control::MODEL_HASH)),
            ("program", format!("{} trial {VERSION}", env!("CARGO_PKG_VERSION"))),
        ]
        .into_iter()
        .map(|(name, value)| (name.to_owned(), value))
        .collect();
        if !self.weights.is_empty() {
            // An arm's weight follows from the arm: more seeds may be added later.
            described.insert("arms".to_owned(), "weighed".to_owned());
        }
        let text = described.iter().map(|(name, value)| format!("{name}={value}\n")).collect::<String>();
        let configuration = format!("{:08x}", checksum(text.as_bytes()));
        described.insert(CODE.to_owned(), env!("TACTUS_TRIAL_CODE").to_owned());
        Header { experiment: self.scenario.name().to_owned(), configuration, described }
    }

    /// Seed of a trial.
    pub fn trial_seed(&self, key: &Key) -> u64 {
        seed::of_trial(key.seed, key.cell)
    }
}

/// The frame of an approach from `start` to `goal` with the hand turned as `orientation` says ([`Config::frame`]).
pub(super) fn frame(
    scenario: Scenario,
    start: [f64; 3],
    [x, y, _]: [f64; 3],
    [w, a, b, c]: [f64; 4],
) -> Option<ApproachFrame> {
    // The third column of the rotation matrix.
    let axis = [2.0 * (a * c + w * b), 2.0 * (b * c - w * a)];
    let direction = if axis[0].hypot(axis[1]) > 0.5 { axis } else { [x - start[0], y - start[1]] };
    // The object's place in the demonstration: the grasp point need not end in its axis.
    let short = scenario.taught_movement().short_of_object() / direction[0].hypot(direction[1]);
    ApproachFrame::new([x + short * direction[0], y + short * direction[1]], direction)
}

/// The object by its name; that of a user's file by its figures too, which may change under one name.
fn described(object: ObjectKind) -> String {
    match object {
        ObjectKind::Own(row) => format!("{} 0x{:08x}", row.name, checksum(format!("{row:?}").as_bytes())),
        compiled => compiled.name().to_owned(),
    }
}

/// The image by its checksum.
fn firmware(image: &Path) -> String {
    format!("firmware 0x{:08x}", checksum(&std::fs::read(image).unwrap_or_default()))
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    use lab::demonstration::Recording;
    use lab::learn::{LearnOptions, learn};

    use super::{Config, Mode, ObjectKind, Scenario, described};
    use crate::fixtures;

    /// The change that makes it fail: an empty list means nothing, and not everything.
    #[test]
    fn figures_are_of_every_mode_and_arm_that_is_there_unless_some_are_named() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/examples/reach.csv");
        let recording = Recording::read(&file).unwrap();
        let primitive = learn(&recording, Path::new("reach.toml"), &LearnOptions::named("reach")).unwrap().primitive;
        let results = fixtures::results(&[3, 5]);
        let named = Config { seeds: vec![5], modes: Vec::new(), ..Config::new(Scenario::Flashlight, primitive) };
        let config = named.of_what_is_there(&results);
        assert_eq!((config.modes, config.seeds), (Mode::PAPER.to_vec(), vec![5]));
        let all = Config { seeds: Vec::new(), ..named }.of_what_is_there(&results);
        assert_eq!(all.seeds, [3, 5]);
    }

    /// The change that makes it fail: the name alone, by which `--resume` would mix two objects.
    #[test]
    fn an_object_of_a_file_is_another_one_once_its_figures_change() {
        let cup = include_str!("../../sim/objects/cup.toml").replacen("\"cup\"", "\"mug\"", 1);
        let of = |mass: &str| described(ObjectKind::from_toml(&cup.replacen("mass = 0.2", mass, 1)).unwrap());
        assert!(of("mass = 0.2").starts_with("mug 0x"), "{}", of("mass = 0.2"));
        assert_eq!(of("mass = 0.2"), of("mass = 0.20"));
        assert_ne!(of("mass = 0.2"), of("mass = 0.3"));
        assert_eq!(described(ObjectKind::Cup), "cup");
    }
}
