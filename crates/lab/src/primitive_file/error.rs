//! Errors of a primitive file.

use std::path::PathBuf;

use thiserror::Error;

/// Why a file is not a primitive.
#[derive(Debug, Error)]
pub enum PrimitiveFileError {
    /// The file cannot be written.
    #[error(transparent)]
    Output(crate::output_file::OutputError),
    /// The file cannot be read.
    #[error("{file}: {cause}", file = file.display())]
    Io {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        #[source]
        cause: std::io::Error,
    },
    /// The text is not the TOML that is expected; the message shows line and column.
    #[error("{file}: {message}", file = file.display())]
    Syntax {
        /// The file.
        file: PathBuf,
        /// The parser's reason, with the line.
        message: String,
    },
    /// The file is written in another version of the layout.
    #[error("{file}: schema `{found}` is not understood, this version of tactus reads `{expected}`", file = file.display())]
    Schema {
        /// The file.
        file: PathBuf,
        /// Schema named in the file.
        found: String,
        /// Schema of this version.
        expected: &'static str,
    },
    /// The values are not those that were written.
    #[error("{file}: the content does not match its check sum: computed 0x{computed:08x}, stored 0x{stored:08x}", file = file.display())]
    Checksum {
        /// The file.
        file: PathBuf,
        /// Check sum of the values in the file.
        computed: u32,
        /// Check sum named in the file.
        stored: u32,
    },
    /// A number is infinite or not a number.
    #[error("{file}: {key}: entry {entry} is not finite", file = file.display())]
    NotFinite {
        /// The file.
        file: PathBuf,
        /// The table it stands in.
        key: String,
        /// Its place in the table, counted from 1.
        entry: usize,
    },
    /// A table does not have the size that it must have.
    #[error("{file}: {key}: {found} entries, expected {expected}", file = file.display())]
    Shape {
        /// The file.
        file: PathBuf,
        /// The table.
        key: String,
        /// Entries found.
        found: usize,
        /// Entries expected.
        expected: usize,
    },
    /// The primitive is outside what a movement primitive can be: the reason comes from `dmp`.
    #[error("{file}: the primitive is refused: {reason}", file = file.display())]
    Invalid {
        /// The file.
        file: PathBuf,
        /// Why.
        reason: String,
    },
    /// The primitive cannot be written as an image for the device.
    #[error("{file}: the primitive does not fit an image: {cause}", file = file.display())]
    Image {
        /// The file.
        file: PathBuf,
        /// Why.
        #[source]
        cause: link::ImageError,
    },
    /// The primitive was learned with another model of the arm.
    #[error("{file}: learned with robot model 0x{found:08x}, this tool has model 0x{expected:08x}", file = file.display())]
    Model {
        /// The file.
        file: PathBuf,
        /// Hash in the file.
        found: u32,
        /// Hash of the model that this tool was built with.
        expected: u32,
    },
    /// The expectation was recorded at a speed that says nothing about this one.
    #[error("{file}: [expectation]: recorded_duration_s = {recorded:.3}, but the movement takes {duration:.3} s: more than 50 % apart", file = file.display())]
    ExpectationDuration {
        /// The file.
        file: PathBuf,
        /// Duration of the recorded runs, s.
        recorded: f64,
        /// Duration of the movement, s.
        duration: f64,
    },
    /// Statistics without the expectation whose filter they were measured through: no device takes them.
    #[error("{file}: [statistics]: they are of use only beside an expectation, and there is none", file = file.display())]
    StatisticsAlone {
        /// The file.
        file: PathBuf,
    },
    /// The expectation was recorded with another model of the arm than the movement was learned with.
    #[error("{file}: [expectation]: recorded with robot model 0x{found:08x}, the movement has model 0x{expected:08x}", file = file.display())]
    ExpectationModel {
        /// The file.
        file: PathBuf,
        /// Hash of the expectation.
        found: u32,
        /// Hash of the movement.
        expected: u32,
    },
    /// The expectation was recorded through another filter than the one that every device of this version has.
    #[error("{file}: [expectation]: recorded through a filter of {found} Hz, that of the device has {expected} Hz", file = file.display())]
    ExpectationFilter {
        /// The file.
        file: PathBuf,
        /// Cut-off in the file, Hz.
        found: f64,
        /// Cut-off of the device, Hz.
        expected: f64,
    },
}
