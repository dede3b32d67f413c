//! Errors of a recording, always with the file and, where there is one, the line and the column.

use std::path::PathBuf;

use control::plan::load::{LONGEST_MOVEMENT, SHORTEST_MOVEMENT};
use thiserror::Error;

/// A place in a recording: file, line and column, all as a person counts them (from 1).
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Place {
    /// The file as it was named on the command line.
    pub file: PathBuf,
    /// Line in the file, counted from 1, notes and header included.
    pub line: u64,
    /// Field in the line, counted from 1.
    pub column: usize,
    /// Name of the column in the header; empty when the line has more fields than the header.
    pub name: String,
}

impl std::fmt::Display for Place {
    fn fmt(&self, formatter: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(formatter, "{}: line {}, column {}", self.file.display(), self.line, self.column)?;
        if self.name.is_empty() { Ok(()) } else { write!(formatter, " ({})", self.name) }
    }
}

/// Why a file is not a recording that Tactus can use.
#[derive(Debug, Error)]
pub enum RecordingError {
    /// The file cannot be opened or read.
    #[error("{file}: cannot be read: {cause}", file = file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        #[source]
        cause: std::io::Error,
    },
    /// The file has no header line.
    #[error("{file}: line 1, column 1: the file is empty, a header with names and units is expected", file = file.display())]
    Empty {
        /// The file.
        file: PathBuf,
    },
    /// The file has bytes of zero: it is packed, or in UTF-16, or no text at all.
    #[error("{file}: line {line}: this is no text in UTF-8, but a packed or binary file, or UTF-16", file = file.display())]
    NotText {
        /// The file.
        file: PathBuf,
        /// Line of the first such byte.
        line: u64,
    },
    /// The last line has no end: nobody knows whether its last number is whole.
    #[error(
        "{file}: line {line}: the last line has no end: the file was cut, maybe within a number; \
         `sed -i '$d'` takes the line from a file, `echo >>` ends it where it is whole",
        file = file.display()
    )]
    Unfinished {
        /// The file.
        file: PathBuf,
        /// The last line.
        line: u64,
    },
    /// The header names nothing that a recording is read by.
    #[error("{file}: line {line}: this is no recording: none of the names in its first line is that of a column", file = file.display())]
    NoColumns {
        /// The file.
        file: PathBuf,
        /// Line of what should be the header.
        line: u64,
    },
    /// The columns are separated by something else than commas.
    #[error(
        "{file}: line {line}: the columns are separated by {found}, commas are expected, and points in the numbers",
        file = file.display()
    )]
    Separator {
        /// The file.
        file: PathBuf,
        /// Line of the header.
        line: u64,
        /// The separator, in words.
        found: &'static str,
    },
    /// The header names the same column twice.
    #[error("{place}: the column appears a second time")]
    DuplicateColumn {
        /// Where the second one stands.
        place: Place,
    },
    /// A known quantity with another unit than the layout's.
    #[error("{place}: the unit is not understood, expected `{expected}`")]
    WrongUnit {
        /// Where.
        place: Place,
        /// The column name the layout uses.
        expected: String,
    },
    /// A column that the layout needs is not in the header.
    #[error("{file}: line {line}, column {column}: missing column{plural} {missing}", file = file.display(), plural = if missing.contains(',') { "s" } else { "" })]
    MissingColumns {
        /// The file.
        file: PathBuf,
        /// Line of the header.
        line: u64,
        /// The first column behind the header's last one: where they could be added.
        column: usize,
        /// Names of the missing columns.
        missing: String,
    },
    /// A line has more or fewer fields than the header.
    #[error("{place}: the line has {found} fields, the header has {expected}")]
    Ragged {
        /// The first field that is missing or too many.
        place: Place,
        /// Fields in the line.
        found: usize,
        /// Fields in the header.
        expected: usize,
    },
    /// A field that must be a number is not one.
    #[error("{place}: `{text}` is not a number")]
    NotANumber {
        /// Where.
        place: Place,
        /// The text found there.
        text: String,
    },
    /// A word that names no state of the supervisor: what was played could not be told from what was not.
    #[error("{place}: `{text}` is no state, expected {}", states())]
    UnknownState {
        /// Where.
        place: Place,
        /// The word found there.
        text: String,
    },
    /// A field is NaN or infinite.
    #[error("{place}: the value {value} is not finite")]
    NotFinite {
        /// Where.
        place: Place,
        /// The value found there.
        value: f64,
    },
    /// A field is larger than any that a device writes: drawn, it would flatten everything else.
    #[error("{place}: {value:.0e} is larger than any value of a recording")]
    TooLarge {
        /// Where.
        place: Place,
        /// The value found there.
        value: f64,
    },
    /// Time does not increase from one line to the next.
    #[error("{place}: time does not go on: {time} s after {before} s")]
    TimeRunsBackwards {
        /// Where.
        place: Place,
        /// Time of this line, s.
        time: f64,
        /// Time of the line before, s.
        before: f64,
    },
    /// A quaternion whose norm is too far from one.
    #[error("{place}: the quaternion has norm {norm:.4}, a unit quaternion is expected")]
    NotAUnitQuaternion {
        /// First component of the quaternion.
        place: Place,
        /// Its norm.
        norm: f64,
    },
    /// The file has too few lines of data.
    #[error("{file}: line {line}, column 1: the file ends after {found} samples, at least {needed} are needed", file = file.display())]
    TooFewSamples {
        /// The file.
        file: PathBuf,
        /// Last line of the file.
        line: u64,
        /// Samples found.
        found: usize,
        /// Samples needed.
        needed: usize,
    },
    /// Two neighbouring samples are so far apart that interpolation would invent the movement between them.
    #[error("{place}: {gap:.3} s are missing before this line, at most {longest:.3} s can be bridged")]
    GapTooLong {
        /// The line behind the gap.
        place: Place,
        /// Length of the gap, s.
        gap: f64,
        /// The longest gap that is bridged, s.
        longest: f64,
    },
    /// Samples so far apart that the times are in another unit.
    #[error("{place}: the samples are {step:.1} s apart: are these milliseconds? Seconds are expected")]
    NoSeconds {
        /// Where.
        place: Place,
        /// Mean time from one to the next, s.
        step: f64,
    },
    /// A joint angle of several turns.
    #[error("{place}: no joint turns as far as {} rad: are these degrees? Radians are expected", short(*.angle))]
    NoRadians {
        /// Where.
        place: Place,
        /// The angle that is given.
        angle: f64,
    },
    /// A value that no arm reaches in the time since the line before.
    #[error("{place}: a leap by {leap:.2} {unit} within {seconds:.3} s, which no arm makes: {guess}")]
    Leap {
        /// The first line behind it.
        place: Place,
        /// Distance of the leap.
        leap: f64,
        /// Its unit.
        unit: &'static str,
        /// Time since the line before, s.
        seconds: f64,
        /// Its probable nature.
        guess: &'static str,
    },
}

/// Why a valid recording is no demonstration of a movement.
#[derive(Debug, Error)]
pub enum DemonstrationError {
    /// The file itself is at fault.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// Neither joint angles nor a pose were recorded.
    #[error("{file}: line {line}, column {column}: the header names neither joint angles (q1_rad..q7_rad) nor a pose (x_m..qz)", file = file.display())]
    NoPose {
        /// The file.
        file: PathBuf,
        /// Line of the header.
        line: u64,
        /// The first column behind the header's last one.
        column: usize,
    },
    /// Nothing is left once the still head and tail are cut off.
    #[error("{file}: lines {first_line} to {last_line}: the arm moves for only {moving:.3} s (threshold {threshold} m/s), at least {needed:.3} s are needed", file = file.display())]
    Still {
        /// The file.
        file: PathBuf,
        /// First line of data.
        first_line: u64,
        /// Last line of data.
        last_line: u64,
        /// Time during which the arm moved, s.
        moving: f64,
        /// Time that is needed, s.
        needed: f64,
        /// Speed below which the arm counts as still, m/s.
        threshold: f64,
        /// Extent of all that was recorded, m.
        extent: f64,
        /// Duration of all that was recorded, s.
        duration: f64,
    },
    /// The movement is over too soon or too late.
    #[error(
        "{file}: the movement takes {duration:.3} s, an arm plays {SHORTEST_MOVEMENT} to {LONGEST_MOVEMENT} s",
        file = file.display()
    )]
    Duration {
        /// The file.
        file: PathBuf,
        /// Time that it takes, with what is kept before and behind it, s.
        duration: f64,
    },
}

/// The words for the states, for a message.
fn states() -> String {
    control::State::ALL.map(|state| format!("`{}`", state.name())).join(", ")
}

/// An angle on a line of a terminal: what is absurd has no three hundred digits.
fn short(angle: f64) -> String {
    if angle.abs() < 1e6 { format!("{angle:.1}") } else { format!("{angle:.1e}") }
}
