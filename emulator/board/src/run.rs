//! A run: the image on the board, until the world ends, the time is up or something is not modelled.

use std::collections::BTreeSet;
use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use fdcan_model::Options;
use rigless::emulator::{self, Start, Watch};
use rigless::image::Image as Placed;
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::board::{Board, BoardError};
use crate::cache::BANK;
use crate::can::SharedCan;
use crate::core::SharedCore;
use crate::image::Image;
use crate::log::Log;
use crate::part::Fitting;
use crate::serial::SharedLine;
use crate::setup::{Outcome, Setup};
use crate::watchdog::SharedWatch;
use crate::watcher::{LOOK, Watcher};
use crate::world::World;

/// First revision without the erratum of the message memory (ES0392 2.24.2).
const FIRST_SOUND_REVISION: u16 = 0x2001;

/// Why a run could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The board.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The emulation.
    #[error(transparent)]
    Emulator(#[from] emulator::Error),
    /// The image that is placed in memory.
    #[error(transparent)]
    Image(#[from] rigless::image::Error),
    /// A file.
    #[error("{}: {source}", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// Why.
        source: io::Error,
    },
}

/// Runs an image.
///
/// # Errors
/// [`RunError`]
pub fn run(image: &Arc<Image>, setup: &Setup, world: Box<dyn World>) -> Result<Outcome, RunError> {
    let serial = SharedLine::default();
    let options = Options {
        cancellation: setup.cancellation,
        erratum: setup.revision < FIRST_SOUND_REVISION,
        ..Options::default()
    };
    let can = SharedCan::new(options, world, serial.clone(), setup.host);
    let (watch, core) = (SharedWatch::default(), SharedCore::default());
    let fitting = Fitting {
        can: can.clone(),
        serial,
        watch: watch.clone(),
        core: core.clone(),
        revision: setup.revision,
        mips: setup.mips,
    };
    let board = Board::new(&fitting)?;
    let mut images = vec![Placed::new(&image.path, image.bytes.clone(), None)?];
    if let Some(path) = &setup.bank2 {
        images.push(Placed::new(path, content(path)?, Some(BANK.start.into()))?);
        core.lock().damaged = damaged_words(path)?;
    }
    let interrupt = Arc::new(AtomicBool::new(false));
    let log = setup.log.as_ref().map(|path| file(path, File::create(path))).transpose()?;
    let log = Log::new(image.log_control, log);
    let watcher = Watcher::new(image.clone(), setup, can, core.clone(), watch, log, interrupt.clone());
    let mut session = Session::new(Box::new(board), 0, VirtualNanos(LOOK))?;
    for handler in &image.fault_handlers {
        session.watch(Watch::Instruction(u64::from(*handler)));
    }
    session.watch(Watch::Instruction(u64::from(image.slot_handler)));
    let mut start = Start::new(&images);
    start.interrupt = Some(&interrupt);
    let mut finished = emulator::run(session, &start, watcher)?;
    let outcome = finished.driver.into_outcome(&mut finished.session);
    if let Some(path) = &setup.bank2 {
        file(path, std::fs::write(path, &outcome.bank2))?;
        keep_damaged(path, &core.lock().damaged)?;
    }
    Ok(outcome)
}

fn file<T>(path: &Path, result: io::Result<T>) -> Result<T, RunError> {
    result.map_err(|source| RunError::File { path: path.to_owned(), source })
}

/// Content of bank 2 from its file; a file that is not there is an erased bank.
fn content(path: &Path) -> Result<Vec<u8>, RunError> {
    let size = (BANK.end - BANK.start) as usize;
    if !path.exists() {
        return Ok(vec![0xFF; size]);
    }
    let bytes = file(path, std::fs::read(path))?;
    if bytes.len() != size {
        let message = format!("{} bytes where bank 2 has {size}", bytes.len());
        return file(path, Err(io::Error::new(io::ErrorKind::InvalidData, message)));
    }
    Ok(bytes)
}

/// The file beside bank 2's that names the words whose check bits do not fit, one address a line.
fn damaged_path(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".damaged");
    name.into()
}

fn damaged_words(path: &Path) -> Result<BTreeSet<u32>, RunError> {
    let path = damaged_path(path);
    if !path.exists() {
        return Ok(BTreeSet::new());
    }
    let text = file(&path, std::fs::read_to_string(&path))?;
    Ok(text.lines().filter_map(|line| u32::from_str_radix(line.trim_start_matches("0x"), 16).ok()).collect())
}

fn keep_damaged(path: &Path, damaged: &BTreeSet<u32>) -> Result<(), RunError> {
    let path = damaged_path(path);
    if damaged.is_empty() {
        return if path.exists() { file(&path, std::fs::remove_file(&path)) } else { Ok(()) };
    }
    let text: String = damaged.iter().map(|address| format!("{address:#010x}\n")).collect();
    file(&path, std::fs::write(&path, text))
}
