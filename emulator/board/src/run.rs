//! A run: the image on the board, watched while it runs.

use std::fs::File;
use std::io;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use fdcan_model::{Cancellation, Options};
use rigless::emulator::{self, Driver, Host, Settled, Start, Stop};
use rigless::image::Image as Placed;
use rigless::session::Session;
use rigless::soc::Width;
use rigless::time::VirtualNanos;

use crate::board::{Board, BoardError};
use crate::cache::BANK;
use crate::can::{HostLine, SharedCan};
use crate::core::SharedCore;
use crate::findings::{Findings, Grade};
use crate::image::Image;
use crate::log::Log;
use crate::part::Fitting;
use crate::serial::SharedLine;
use crate::watchdog::SharedWatch;
use crate::world::World;

/// How a run is set up.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The line the host is on.
    pub host: HostLine,
    /// How the CAN controller takes cancelled places of its transmit queue.
    pub cancellation: Cancellation,
    /// Revision of the silicon.
    pub revision: u16,
    /// Content of bank 2 before and after.
    pub bank2: Option<PathBuf>,
    /// Where the log goes.
    pub log: Option<PathBuf>,
    /// End of the run, ns; without it the run ends when the world does.
    pub until: Option<u64>,
    /// A finding of the grade [`Grade::Unmodelled`] ends the run.
    pub strict: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            host: HostLine::Serial,
            cancellation: Cancellation::Skipped,
            revision: 0x2003,
            bank2: None,
            log: None,
            until: None,
            strict: true,
        }
    }
}

/// Why a run could not be made.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The board.
    #[error(transparent)]
    Board(#[from] BoardError),
    /// The emulation.
    #[error(transparent)]
    Emulator(#[from] emulator::Error),
    /// What is placed in memory.
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

/// Nanoseconds between two looks at log and stack: 1 ms.
const LOOK: u64 = 1_000_000;

/// What a run leaves.
#[derive(Debug)]
pub struct Outcome {
    /// Virtual time, ns.
    pub now: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Restarts: time in ns, cause.
    pub resets: Vec<(u64, String)>,
    /// What the image did that must be reported.
    pub findings: Findings,
    /// The log.
    pub log: Vec<u8>,
    /// Bank 2.
    pub bank2: Vec<u8>,
}

/// Watches the run.
struct Watcher {
    image: Arc<Image>,
    can: SharedCan,
    findings: Findings,
    told: usize,
    log: Log,
    until: Option<u64>,
    strict: bool,
    interrupt: Arc<AtomicBool>,
    bank2: Vec<u8>,
    over: bool,
    now: u64,
    instructions: u64,
}

impl Watcher {
    /// The end: what must outlive the run is taken out of it.
    fn finish(&mut self, host: &mut dyn Host) {
        if self.over {
            return;
        }
        self.over = true;
        self.log.drain(host);
        self.bank2 = (u64::from(BANK.start)..u64::from(BANK.end))
            .step_by(8)
            .flat_map(|address| host.read(address, Width::W64).unwrap_or(u64::MAX).to_le_bytes())
            .collect();
        self.interrupt.store(true, Ordering::Relaxed);
    }

    fn tell_new(&mut self) {
        for finding in self.findings.all().iter().skip(self.told) {
            if finding.grade < Grade::Excused {
                eprintln!("{}", finding.line());
            }
        }
        self.told = self.findings.all().len();
    }
}

impl Driver<Board> for Watcher {
    fn on_settled(&mut self, session: &mut Session<Board>, host: &mut dyn Host, settled: Settled) {
        let (remarks, gone) = {
            let mut can = self.can.lock();
            (can.take_remarks(), can.is_gone())
        };
        if !remarks.is_empty() {
            self.findings.note_remarks(remarks, &self.image, &settled);
        }
        self.findings.look(session, &self.image, &settled);
        if self.findings.all().len() > self.told {
            self.tell_new();
        }
        let (at, count) = match settled {
            Settled::Access { access, .. } => (access.virtual_time, access.instruction_count),
            Settled::Stop(stop) => (stop.at, stop.instruction_count),
            _ => return,
        };
        (self.now, self.instructions) = (at.0, count);
        let failed = self.strict && self.findings.of(Grade::Unmodelled).next().is_some();
        if gone || failed {
            self.finish(host);
        }
    }

    fn on_stop(&mut self, session: &mut Session<Board>, stop: Stop, host: &mut dyn Host) -> Option<VirtualNanos> {
        let _ = session;
        self.log.drain(host);
        if self.over || self.until.is_some_and(|until| stop.at.0 >= until) {
            self.finish(host);
            return None;
        }
        Some(VirtualNanos(stop.at.0 + LOOK))
    }
}

/// Runs an image until the world ends, the time is up or something is not modelled.
///
/// # Errors
/// [`RunError`]
pub fn run(image: &Arc<Image>, setup: &Setup, world: Box<dyn World>) -> Result<Outcome, RunError> {
    let serial = SharedLine::default();
    let options = Options { cancellation: setup.cancellation, ..Options::default() };
    let can = SharedCan::new(options, world, serial.clone(), setup.host);
    let watch = SharedWatch::default();
    let fitting =
        Fitting { can: can.clone(), serial, watch, revision: setup.revision, has_hse: true };
    let board = Board::new(&fitting, SharedCore::default())?;
    let mut images = vec![Placed::new(&image.path, image.bytes.clone(), None)?];
    if let Some(path) = &setup.bank2 {
        images.push(Placed::new(path, content(path)?, Some(BANK.start.into()))?);
    }
    let interrupt = Arc::new(AtomicBool::new(false));
    let log = setup.log.as_ref().map(|path| file(path, File::create(path))).transpose()?;
    let watcher = Watcher {
        image: image.clone(),
        can,
        findings: Findings::default(),
        told: 0,
        log: Log::new(image.log_control, log),
        until: setup.until,
        strict: setup.strict,
        interrupt: interrupt.clone(),
        bank2: Vec::new(),
        over: false,
        now: 0,
        instructions: 0,
    };
    let session = Session::new(Box::new(board), 0, VirtualNanos(LOOK))?;
    let mut start = Start::new(&images);
    start.interrupt = Some(&interrupt);
    let finished = emulator::run(session, &start, watcher)?;
    let resets = finished.session.resets().iter().map(|reset| (reset.at.0, format!("{:?}", reset.cause))).collect();
    let watcher = finished.driver;
    if let Some(path) = &setup.bank2 {
        file(path, std::fs::write(path, &watcher.bank2))?;
    }
    Ok(Outcome {
        now: watcher.now,
        instructions: watcher.instructions,
        resets,
        findings: watcher.findings,
        log: watcher.log.bytes,
        bank2: watcher.bank2,
    })
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
