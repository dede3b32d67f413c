//! Options of a simulated device: the part of its address behind the colon.

use std::fmt;
use std::path::{Path, PathBuf};

use super::AddressError;

/// Options that name a file.
const FILES: [&str; 4] = ["bus", "flash", "faults", "report"];

/// Which simulated device.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum SimulatorKind {
    /// `sim:`, the firmware image under QEMU.
    Qemu,
    /// `sil:`, the application in this process.
    InProcess,
    /// `hand:`, the hand image under QEMU: a hand alone on its bus.
    Hand,
    /// `board:`, the image for the STM32H743 on the emulated board.
    Board,
}

/// The line of the host link of a simulated device.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum LineKind {
    /// The board's UART.
    #[default]
    Serial,
    /// A CAN bus of its own.
    Can,
}

/// Options of a simulated device; the simulator knows which of them it takes.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct SimulatorOptions {
    /// Seed of all noise; `None` lets the simulator take its own, always the same.
    pub seed: Option<u64>,
    /// Number of an arm whose masses and friction are not the model's; `None` is the model's.
    pub arm: Option<u64>,
    /// A weight in the hand, `KG` or `KG@X:Y:Z`.
    pub held: Option<String>,
    /// Name of the world; `None` is the best one that was built in.
    pub world: Option<String>,
    /// The line of the host link.
    pub line: LineKind,
    /// Where a log of the buses goes, in the format of `candump -L`.
    pub bus: Option<PathBuf>,
    /// The file that is the device's flash, so that its library is there again after a restart.
    pub flash: Option<PathBuf>,
    /// The script of faults that befall the device: a file, or a file and the number of its scenario.
    pub faults: Option<String>,
    /// Options of the emulated board only.
    pub board: BoardOptions,
}

/// Options that only the emulated board has.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct BoardOptions {
    /// Where the emulator writes its report when the power is switched off, JSON.
    pub report: Option<PathBuf>,
    /// Variant and faults of the chip.
    pub chip: ChipOptions,
}

/// Variant and faults of the emulated chip.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct ChipOptions {
    /// Treatment of a cancelled frame in the transmit FIFO of the CAN controller; `None` is the emulator's choice.
    pub cancellation: Option<Cancellation>,
    /// Revision of the chip, `REV_ID`; `None` is the emulator's choice.
    pub revision: Option<u16>,
    /// Faults, `KIND@MICROSECONDS[:ARGUMENT]`; the emulator knows which there are.
    pub faults: Vec<String>,
}

/// Readings of the manual on cancelling a frame in the transmit FIFO.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Cancellation {
    /// The FIFO goes on behind the cancelled frame.
    Skipped,
    /// The FIFO stops at the cancelled frame.
    Stuck,
}

impl Cancellation {
    /// Both readings.
    pub const ALL: [Self; 2] = [Self::Skipped, Self::Stuck];

    /// Its name in an address and for the emulator.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Skipped => "skipped",
            Self::Stuck => "stuck",
        }
    }
}

impl SimulatorOptions {
    /// Reads `seed=7,world=simple` for a device of this kind.
    ///
    /// # Errors
    /// [`AddressError`] for an option or a value that there is not, and for an option that is given twice.
    pub(super) fn parse(text: &str, kind: SimulatorKind) -> Result<Self, AddressError> {
        let is_board = kind == SimulatorKind::Board;
        let mut options = Self::default();
        let mut given: Vec<String> = Vec::new();
        for part in &parts(text) {
            let name = part.split_once('=').map_or(part.as_str(), |(name, _)| name);
            // Several faults befall one chip.
            if name != "fault" && given.iter().any(|given| given == name) {
                return Err(AddressError::Twice(name.to_owned()));
            }
            given.push(name.to_owned());
            refuse_of_hand(kind, name, part)?;
            if ["bus=-", "flash=-", "report=-"].contains(&part.as_str()) {
                return Err(AddressError::StandardOutput(part.clone()));
            }
            match part.split_once('=').filter(|(_, value)| !value.is_empty()) {
                Some(("seed", value)) => {
                    options.seed =
                        Some(value.parse().map_err(|_| AddressError::Number(format!("seed={value}"), u64::MAX))?);
                }
                Some(("arm", value)) => {
                    options.arm =
                        Some(value.parse().map_err(|_| AddressError::Number(format!("arm={value}"), u64::MAX))?);
                }
                Some(("held", value)) => options.held = Some(value.to_owned()),
                Some(("world", value)) => options.world = Some(value.to_owned()),
                Some(("line", "serial")) => options.line = LineKind::Serial,
                Some(("line", "can")) => options.line = LineKind::Can,
                Some(("bus", value)) => options.bus = Some(value.into()),
                Some(("flash", value)) => options.flash = Some(value.into()),
                Some(("faults", value)) => options.faults = Some(value.to_owned()),
                Some((name, value)) if is_board => options.board.set(part, name, value)?,
                _ if is_board => return Err(AddressError::BoardOption(part.to_owned())),
                _ => return Err(AddressError::Option(part.to_owned())),
            }
        }
        Ok(options)
    }

    /// Adds the flash and the script of faults that are given beside the address. A comma in a path, which ends an
    /// option in an address, belongs to the path here.
    ///
    /// # Errors
    /// [`AddressError::Twice`] for what the address gives as well, [`AddressError::HandOption`] for a hand alone,
    /// [`AddressError::StandardOutput`] for a flash of that name.
    pub fn add_files(
        &mut self,
        kind: SimulatorKind,
        flash: Option<&Path>,
        faults: Option<&str>,
    ) -> Result<(), AddressError> {
        if let Some(path) = flash {
            refuse_of_hand(kind, "flash", "flash")?;
            if path.as_os_str() == "-" {
                return Err(AddressError::StandardOutput("flash=-".to_owned()));
            }
            if self.flash.replace(path.to_owned()).is_some() {
                return Err(AddressError::Twice("flash".to_owned()));
            }
        }
        if let Some(script) = faults {
            refuse_of_hand(kind, "faults", "faults")?;
            if self.faults.replace(script.to_owned()).is_some() {
                return Err(AddressError::Twice("faults".to_owned()));
            }
        }
        Ok(())
    }
}

/// The options of an address. A comma ends one; two in the name of a file are one of it.
fn parts(text: &str) -> Vec<String> {
    let (mut parts, mut part) = (Vec::new(), String::new());
    let mut letters = text.chars().peekable();
    while let Some(letter) = letters.next() {
        let is_of_file = FILES.iter().any(|name| part.strip_prefix(name).is_some_and(|rest| rest.starts_with('=')));
        if letter == ',' && !(is_of_file && letters.next_if_eq(&',').is_some()) {
            parts.push(std::mem::take(&mut part));
        } else {
            part.push(letter);
        }
    }
    parts.push(part);
    parts.retain(|part| !part.is_empty());
    parts
}

/// A name of a file as [`parts`] reads it.
fn in_address(name: impl fmt::Display) -> String {
    name.to_string().replace(',', ",,")
}

/// Refuses an option, `part` of an address, that a hand alone does not have.
fn refuse_of_hand(kind: SimulatorKind, name: &str, part: &str) -> Result<(), AddressError> {
    let refused = kind == SimulatorKind::Hand && ["arm", "held", "flash", "faults"].contains(&name);
    if refused { Err(AddressError::HandOption(part.to_owned())) } else { Ok(()) }
}

impl BoardOptions {
    fn set(&mut self, part: &str, name: &str, value: &str) -> Result<(), AddressError> {
        let unknown = || AddressError::BoardOption(part.to_owned());
        match name {
            "report" => self.report = Some(value.into()),
            "fault" => self.chip.faults.push(value.to_owned()),
            "revision" => {
                let digits = value.strip_prefix("0x").ok_or_else(unknown)?;
                self.chip.revision = Some(u16::from_str_radix(digits, 16).map_err(|_| unknown())?);
            }
            "cancellation" => {
                let known = Cancellation::ALL.into_iter().find(|reading| reading.name() == value);
                self.chip.cancellation = Some(known.ok_or_else(unknown)?);
            }
            _ => return Err(unknown()),
        }
        Ok(())
    }
}

impl fmt::Display for SimulatorOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let chip = &self.board.chip;
        let seed = self.seed.map(|seed| format!("seed={seed}"));
        let arm = self.arm.map(|arm| format!("arm={arm}"));
        let held = self.held.as_ref().map(|held| format!("held={held}"));
        let world = self.world.as_ref().map(|world| format!("world={world}"));
        let line = (self.line == LineKind::Can).then(|| "line=can".to_owned());
        let bus = self.bus.as_ref().map(|path| format!("bus={}", in_address(path.display())));
        let flash = self.flash.as_ref().map(|path| format!("flash={}", in_address(path.display())));
        let script = self.faults.as_ref().map(|name| format!("faults={}", in_address(name)));
        let report = self.board.report.as_ref().map(|path| format!("report={}", in_address(path.display())));
        let cancellation = chip.cancellation.map(|reading| format!("cancellation={}", reading.name()));
        let revision = chip.revision.map(|revision| format!("revision={revision:#06x}"));
        let faults = chip.faults.iter().map(|fault| format!("fault={fault}"));
        let single = [seed, arm, held, world, line, bus, flash, script, report, cancellation, revision];
        let parts: Vec<String> = single.into_iter().flatten().chain(faults).collect();
        f.write_str(&parts.join(","))
    }
}
