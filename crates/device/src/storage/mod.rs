//! The library of primitives, the home of the arm, the weight of its links and a secret on a NOR flash: what survives
//! when the power goes.
//!
//! ```text
//! Session ── Store ──> Library <── LibraryAccess ── keep() ──> MapStorage ──> JournaledFlash ──> NorFlash
//!  link requests        memory     lowest priority     log of values   erases done over    words and sectors
//! ```
//!
//! The session works with the [`Library`] in memory. What it changes there is a job for [`keep`], the one task that
//! touches the flash: it runs when nothing else does, waits as long as the flash likes, and tells the library when the
//! change is durable; only then the host is answered. The flash holds a log of `sequential-storage`: the newest value
//! of a key counts, an older one goes only when its sector is needed and all that still counts has been copied. Layout,
//! guarantees and measurements: `docs/storage.md`.

mod header;
mod journal;
mod journaled;
mod keeper;
mod library;
mod loss;
mod pause;
mod survey;

pub use keeper::{LibraryAccess, Scratch, keep, value_bytes};
pub use library::{Library, Work};
pub use loss::Loss;

use core::fmt;

use link::{HomeSource, SecretState};

use crate::calibration::StoredHome;

/// The key of the arm's home in the log; those below it are the places of images.
pub const HOME_KEY: u8 = 0xC0;

/// The key of the weight of the arm's links.
pub const WEIGHT_KEY: u8 = 0xC1;

/// The key of the secret.
pub const SECRET_KEY: u8 = 0xC2;

/// Content of the flash at start-up.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Opening {
    /// Images found, sound or not.
    pub found: u8,
    /// The flash was not one of ours, or its log could not be read: it was erased, and holds nothing now.
    pub formatted: bool,
    /// An erase that power had failed in was done again.
    pub resumed: bool,
    /// Sectors that looked as if they were in use, because bits of their first word had fallen over; they were erased.
    pub cleaned: u8,
    /// The flash does not work: what is stored from now on is refused.
    pub failed: bool,
    /// The sector that cannot be erased: what can be read is there, what is stored from now on is refused.
    pub bad_sector: Option<u8>,
    /// Settings of which the newest value is lost: 1 the home, 2 the weight, 4 the secret.
    pub settings_lost: u8,
    /// Damaged values, maybe old ones, that do not tell whose they are.
    pub unread: u8,
    /// The home of the arm.
    pub home: StoredHome,
    /// Whose weight the arm's links are taken to have. The keeper leaves it to the library.
    pub weight: HomeSource,
    /// The secret, without its bytes. The keeper leaves it to the library, too.
    pub secret: SecretState,
}

impl Opening {
    /// A sound flash with nothing on it.
    pub(crate) const NOTHING: Self = Self {
        found: 0,
        formatted: false,
        resumed: false,
        cleaned: 0,
        failed: false,
        bad_sector: None,
        settings_lost: 0,
        unread: 0,
        home: StoredHome::Nothing,
        weight: HomeSource::Model,
        secret: SecretState::Nothing,
    };
}

impl fmt::Display for Opening {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self { failed: true, .. } => f.write_str("the storage does not work: nothing is kept over a restart"),
            Self { formatted: true, .. } => f.write_str("the storage was blank or foreign; it is empty now"),
            Self { found, resumed, cleaned, home, weight, secret, bad_sector, .. } => {
                write!(f, "{found} images in the storage")?;
                match home {
                    StoredHome::Nothing => {}
                    StoredHome::Kept(_) => f.write_str(", and this arm's home")?,
                    StoredHome::Damaged => f.write_str("; the home of the arm is damaged, the model's counts")?,
                    StoredHome::Foreign => {
                        f.write_str("; the home of the arm is for another robot model or layout, this model's counts")?;
                    }
                }
                match weight {
                    HomeSource::Model => {}
                    HomeSource::Stored => f.write_str(", and its links' weight")?,
                    HomeSource::Damaged => f.write_str("; the weight of the links is damaged, the model's counts")?,
                    HomeSource::Foreign => {
                        f.write_str("; the weight of the links is for another model or layout, this model's counts")?;
                    }
                }
                match secret {
                    SecretState::Nothing | SecretState::NotOffered => {}
                    SecretState::Kept => f.write_str(", and a secret")?,
                    SecretState::Unreadable => {
                        f.write_str("; the secret cannot be read, nothing moves until another or none is kept")?;
                    }
                }
                if *resumed {
                    f.write_str("; an interrupted erase was finished")?;
                }
                if *cleaned > 0 {
                    write!(f, "; {cleaned} damaged sectors were erased")?;
                }
                match bad_sector {
                    Some(sector) => write!(f, "; sector {sector} cannot be erased, so nothing more is kept"),
                    None => Ok(()),
                }
            }
        }
    }
}
