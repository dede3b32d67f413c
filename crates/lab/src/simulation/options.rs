//! The parts of a simulated device: engine, seed, world, teacher.

use std::path::{Path, PathBuf};
use std::time::Duration;

use flash::{Flash, FlashChip, FlashTimes};
use sim::teacher::TaughtMovement;
use sim::world::HOME;
#[cfg(feature = "mujoco")]
use sim::world::mujoco::{Imperfections, MujocoWorld, Scene};
use sim::{FingerObstacle, FreeJoints, Held, PlantConfig, World};

use super::{SimulationError, fault_script};
use crate::transport::{ChipOptions, LineKind, SimulatorKind, SimulatorOptions};

/// Environment variable that names the firmware image for QEMU.
pub const IMAGE_VARIABLE: &str = "TACTUS_IMAGE";

/// Environment variable that names the hand image for QEMU.
pub const HAND_IMAGE_VARIABLE: &str = "TACTUS_HAND_IMAGE";

/// Environment variable that names the emulator of the board.
pub const BOARD_EMULATOR_VARIABLE: &str = "TACTUS_BOARD_EMULATOR";

/// Environment variable that names the image for the emulated board.
pub const BOARD_IMAGE_VARIABLE: &str = "TACTUS_BOARD_IMAGE";

/// The object between the fingers of a hand alone: a spring that its outer links meet at 0.45 rad, with inner links at
/// 1.35 rad.
pub const GRIPPED: FingerObstacle = FingerObstacle { inner: f64::INFINITY, outer: 0.45, stiffness: 2.0 };

/// Seed of a simulation that was given none.
pub const DEFAULT_SEED: u64 = 1;

/// The emulator, the image, and what befalls the chip.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct BoardEngine {
    /// The emulator, a program.
    pub emulator: PathBuf,
    /// The image, an ELF file.
    pub image: PathBuf,
    /// Variant and faults of the chip.
    pub chip: ChipOptions,
}

/// The engine that executes the co-controller's application.
#[derive(Debug, Clone, PartialEq, Eq)]
pub enum Engine {
    /// The application in this process.
    InProcess,
    /// The image for the real board on the emulated one.
    Board(BoardEngine),
    /// The firmware image under QEMU.
    Qemu {
        /// The image, an ELF file.
        image: PathBuf,
    },
    /// The hand image under QEMU, on a smaller machine.
    Hand {
        /// The image, an ELF file.
        image: PathBuf,
    },
    /// No co-controller: the bus is left to foreign programs.
    Absent,
}

/// Which physics.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorldKind {
    /// The arm as rigid bodies in pure Rust, with nothing around it.
    Simple,
    /// MuJoCo with the whole arm, a table and a flashlight.
    Mujoco,
}

/// The flash in the device, which keeps its primitives.
#[derive(Debug, Clone, Default)]
pub enum FlashSource {
    /// A new one, gone when the simulation is.
    #[default]
    New,
    /// This one: whoever else holds it can look at it, cut its power, and put it into the next device. Not for the
    /// emulated board, whose flash is inside its chip.
    Chip(FlashChip),
    /// One that is kept in a file.
    File(PathBuf),
}

impl FlashSource {
    /// The chip to put into a device.
    pub(super) fn chip(&self) -> Result<FlashChip, SimulationError> {
        match self {
            Self::New => Ok(FlashChip::default()),
            Self::Chip(chip) => Ok(chip.clone()),
            Self::File(path) => {
                let opened = Flash::in_file(path, FlashTimes::TYPICAL);
                opened.map(FlashChip::new).map_err(|cause| SimulationError::Flash(path.clone(), cause))
            }
        }
    }
}

/// Set-up of a simulated device.
#[derive(Debug, Clone)]
pub struct SimulationOptions {
    /// The engine that executes the application.
    pub engine: Engine,
    /// Seed of everything random: sensor noise, wake delays, the teacher's tremor.
    pub seed: u64,
    /// Which physics.
    pub world: WorldKind,
    /// Joint posture in which the arm stands at the beginning, rad.
    pub posture: [f64; 7],
    /// Seed of the simulated teacher; `None`: nobody stands beside the arm.
    pub teacher: Option<u64>,
    /// The movement that the teacher shows.
    pub movement: TaughtMovement,
    /// Bus, pucks, sensor, hand and operator; its seed is not used, [`seed`](Self::seed) is.
    pub plant: PlantConfig,
    /// Table and object.
    #[cfg(feature = "mujoco")]
    pub scene: Scene,
    /// Number of an arm whose masses and friction are not the model's ([`FreeJoints::drawn`]); `None` is the model's.
    /// [`WorldKind::Simple`] only, MuJoCo has imperfections.
    pub arm: Option<u64>,
    /// A weight in its hand, of which the device knows nothing.
    pub held: Option<Held>,
    /// Deviations of the arm from the controller's model.
    #[cfg(feature = "mujoco")]
    pub imperfections: Imperfections,
    /// Puts the MuJoCo world, where nobody stands beside the arm, into another one around it, such as one that watches.
    #[cfg(feature = "mujoco")]
    pub wrap_world: Option<fn(MujocoWorld) -> Box<dyn World>>,
    /// Where the firmware's log goes, raw defmt frames; `None` drops it.
    pub firmware_log: Option<PathBuf>,
    /// The line of the host link.
    pub line: LineKind,
    /// Where a log of the buses goes, in the format of `candump -L`; `None` keeps none.
    pub bus_log: Option<PathBuf>,
    /// Logs may replace files that exist.
    pub replace_logs: bool,
    /// Files that no log replaces: what the caller reads.
    pub reads: Vec<PathBuf>,
    /// Where the emulated board writes its report when its power is switched off, JSON; other engines have none.
    pub board_report: Option<PathBuf>,
    /// Time for which the clock of the device has run already. [`Engine::InProcess`] only.
    pub uptime: Duration,
    /// The flash in the device.
    pub flash: FlashSource,
    /// The script of faults that befall the device: a file, or a file and the number of its scenario.
    pub faults: Option<String>,
    /// Obstacles in the way of the fingers of a hand alone; `None`: there is an arm, and a world around it.
    pub grip: Option<[FingerObstacle; 3]>,
}

impl SimulationOptions {
    /// Reads the options of an address such as `sim:seed=7,world=simple`.
    ///
    /// # Errors
    /// [`SimulationError`] for a world that is unknown or was not built in, a weight that cannot be held, and a missing
    /// image.
    pub fn from_address(kind: SimulatorKind, options: &SimulatorOptions) -> Result<Self, SimulationError> {
        let engine = match kind {
            SimulatorKind::InProcess => Engine::InProcess,
            SimulatorKind::Qemu => {
                Engine::Qemu { image: find(IMAGE_VARIABLE, "arm.elf").map_err(SimulationError::NoImage)? }
            }
            SimulatorKind::Board => Engine::Board(BoardEngine {
                emulator: find(BOARD_EMULATOR_VARIABLE, "emulated-board").map_err(SimulationError::NoEmulator)?,
                image: find(BOARD_IMAGE_VARIABLE, "arm-stm32h743.elf").map_err(SimulationError::NoBoardImage)?,
                chip: options.board.chip.clone(),
            }),
            SimulatorKind::Hand => return Self::hand(options),
        };
        let world = match options.world.as_deref() {
            Some("simple") => WorldKind::Simple,
            Some("mujoco") => WorldKind::Mujoco,
            Some(other) => return Err(SimulationError::UnknownWorld(other.to_owned())),
            None if cfg!(feature = "mujoco") => WorldKind::Mujoco,
            None => WorldKind::Simple,
        };
        if world == WorldKind::Mujoco && !cfg!(feature = "mujoco") {
            return Err(SimulationError::WithoutMujoco);
        }
        Ok(Self {
            line: options.line,
            bus_log: options.bus.clone(),
            board_report: options.board.report.clone(),
            uptime: Duration::ZERO,
            flash: options.flash.clone().map_or(FlashSource::New, FlashSource::File),
            faults: options.faults.clone(),
            arm: options.arm,
            held: options.held.as_deref().map(str::parse).transpose()?,
            #[cfg(feature = "mujoco")]
            imperfections: options.arm.map_or(Imperfections::NONE, Imperfections::drawn),
            ..Self::new(engine, options.seed.unwrap_or(DEFAULT_SEED), world)
        })
    }

    /// A hand alone, with power, and something springy between its fingers.
    fn hand(options: &SimulatorOptions) -> Result<Self, SimulationError> {
        let grip = match options.world.as_deref() {
            None => [GRIPPED; 3],
            Some("empty") => [FingerObstacle::NOTHING; 3],
            Some(other) => return Err(SimulationError::UnknownWorld(other.to_owned())),
        };
        let engine = Engine::Hand { image: find(HAND_IMAGE_VARIABLE, "hand.elf").map_err(SimulationError::NoImage)? };
        Ok(Self {
            bus_log: options.bus.clone(),
            line: options.line,
            plant: PlantConfig { hand_alone: true, ..PlantConfig::default() },
            grip: Some(grip),
            ..Self::new(engine, options.seed.unwrap_or(DEFAULT_SEED), WorldKind::Simple)
        })
    }

    /// The usual arm at home, switched off, with the usual things around it and nobody beside it.
    #[must_use]
    pub fn new(engine: Engine, seed: u64, world: WorldKind) -> Self {
        Self {
            engine,
            seed,
            world,
            posture: HOME,
            teacher: None,
            movement: TaughtMovement::SmallTorch,
            plant: PlantConfig::default(),
            #[cfg(feature = "mujoco")]
            scene: Scene::default(),
            arm: None,
            held: None,
            #[cfg(feature = "mujoco")]
            imperfections: Imperfections::NONE,
            #[cfg(feature = "mujoco")]
            wrap_world: None,
            firmware_log: None,
            line: LineKind::Serial,
            bus_log: None,
            replace_logs: false,
            reads: Vec::new(),
            board_report: None,
            uptime: Duration::ZERO,
            flash: FlashSource::New,
            faults: None,
            grip: None,
        }
    }

    /// Files that no log replaces.
    pub(super) fn inputs(&self) -> Vec<&Path> {
        let flash = if let FlashSource::File(path) = &self.flash { Some(path.as_path()) } else { None };
        let script = self.faults.as_deref().map(|name| fault_script::scenario(name).0);
        self.reads.iter().map(PathBuf::as_path).chain(flash).chain(script).collect()
    }

    /// The world at its start.
    pub(super) fn build_world(&self) -> Result<Box<dyn World>, SimulationError> {
        if let Some(grip) = self.grip {
            let mut world = FreeJoints::weightless(self.posture);
            for (finger, obstacle) in grip.into_iter().enumerate() {
                world.obstruct(finger, obstacle);
            }
            return Ok(Box::new(world));
        }
        match self.world {
            WorldKind::Simple => {
                let nominal = FreeJoints::new(self.posture).with_held(self.held);
                Ok(Box::new(match self.arm {
                    Some(number) => nominal.drawn(number),
                    None => nominal,
                }))
            }
            #[cfg(feature = "mujoco")]
            WorldKind::Mujoco => {
                use sim::teacher::{GuidedWorld, Teacher, TeacherConfig};
                use sim::world::mujoco::MujocoOptions;
                let world = MujocoWorld::new(&MujocoOptions {
                    posture: self.posture,
                    scene: self.scene,
                    imperfections: self.imperfections,
                    held: self.held,
                    ..MujocoOptions::default()
                })?;
                Ok(match (self.teacher, self.wrap_world) {
                    (Some(seed), _) => {
                        let teacher =
                            Teacher::new(TeacherConfig { seed, ..TeacherConfig::default() }, self.movement.path());
                        Box::new(GuidedWorld::new(world, teacher))
                    }
                    (None, Some(wrap_world)) => wrap_world(world),
                    (None, None) => Box::new(world),
                })
            }
            #[cfg(not(feature = "mujoco"))]
            WorldKind::Mujoco => Err(SimulationError::WithoutMujoco),
        }
    }
}

/// An image or a program: named by the environment, or where `cargo xtask` leaves it; an error is where it should be.
///
/// The build folder is found from the place of this program (`target/tools/tactus`, `target/debug/deps/...`), so
/// that it does not matter where it is called from.
fn find(variable: &str, file: &str) -> Result<PathBuf, PathBuf> {
    if let Some(path) = std::env::var_os(variable) {
        let path = PathBuf::from(path);
        return if path.is_file() { Ok(path) } else { Err(path) };
    }
    built_image(file).ok_or_else(|| Path::new("target/images").join(file))
}

/// An image that was built, by its file name, if there is one beside this program.
#[must_use]
pub fn built_image(file: &str) -> Option<PathBuf> {
    let program = std::env::current_exe().unwrap_or_default();
    let mut candidates = program.ancestors().skip(1).take(4).map(|folder| folder.join("images").join(file));
    candidates.find(|path| path.is_file())
}
