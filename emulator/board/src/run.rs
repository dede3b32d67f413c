//! A run: the image on the board, until the world ends, the time is up or something is not modelled.

use std::fs::File;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

use fdcan_model::Options;
use rigless::emulator::{self, Start, Watch};
use rigless::image::Image as Placed;
use rigless::session::Session;
use rigless::time::VirtualNanos;

use crate::bank_file::{self, FileError, file};
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
    #[error(transparent)]
    File(#[from] FileError),
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
    core.lock().kept = image.kept_words;
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
        images.push(Placed::new(path, bank_file::content(path)?, Some(BANK.start.into()))?);
        core.lock().damaged = bank_file::damaged_words(path)?;
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
        bank_file::keep(path, &outcome.bank2)?;
        bank_file::keep_damaged(path, &core.lock().damaged)?;
    }
    Ok(outcome)
}
