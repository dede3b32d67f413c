//! The set-up of a run, and its result.

use std::path::PathBuf;

use fdcan_model::Cancellation;

use crate::can::HostLine;
use crate::fault::Fault;
use crate::report::Measured;

/// The set-up of a run.
#[derive(Clone, Debug)]
pub struct Setup {
    /// The line the host is on.
    pub host: HostLine,
    /// Effect of a cancelled place in the transmit queue of the CAN controller.
    pub cancellation: Cancellation,
    /// Revision of the silicon, REV_ID.
    pub revision: u16,
    /// Content of bank 2 before and after.
    pub bank2: Option<PathBuf>,
    /// Where the log goes.
    pub log: Option<PathBuf>,
    /// End of the run, ns; without it the run ends when the world does.
    pub until: Option<u64>,
    /// Million instructions a second of virtual time.
    pub mips: u32,
    /// Something that is not modelled ends the run.
    pub strict: bool,
    /// Faults that are put in from outside.
    pub faults: Vec<Fault>,
    /// Findings are told on standard error while it runs.
    pub tells: bool,
}

impl Default for Setup {
    fn default() -> Self {
        Self {
            host: HostLine::Serial,
            cancellation: Cancellation::Skipped,
            revision: REVISION_V,
            bank2: None,
            log: None,
            until: None,
            mips: MIPS,
            strict: true,
            faults: Vec::new(),
            tells: false,
        }
    }
}

/// An instruction takes 4 ns unless somebody says otherwise: the crate's own choice for a core of some hundred
/// megahertz.
pub const MIPS: u32 = 250;

/// Silicon of revision V, which present boards have.
pub const REVISION_V: u16 = 0x2003;

/// The result of a run.
#[derive(Debug)]
pub struct Outcome {
    /// Measurements and findings.
    pub measured: Measured,
    /// The log.
    pub log: Vec<u8>,
    /// Bank 2.
    pub bank2: Vec<u8>,
    /// Why the run ended before the world and the time did.
    pub cut_short: Option<String>,
    /// The operation of bank 2 in which power failed, which ended the run.
    pub power_cut: Option<String>,
}
