//! Figures: pages of panels, free drawings, and demonstration, plan and execution of a movement on one page.

pub mod canvas;
pub mod drawing;
pub mod movement;

use std::path::{Path, PathBuf};

use thiserror::Error;

pub use canvas::Page;
pub use movement::Movement;

/// Why a figure was not made.
#[derive(Debug, Error)]
pub enum PlotError {
    /// Nothing to draw was given.
    #[error("nothing to draw: give a demonstration, a primitive or a run")]
    Nothing,
    /// The name of the file to write does not end in `.svg` or `.png`.
    #[error("{file}: a figure is written as .svg or .png", file = file.display())]
    Format {
        /// The file.
        file: PathBuf,
    },
    /// The picture could not be encoded.
    #[error("{file}: {reason}", file = file.display())]
    Encode {
        /// The file.
        file: PathBuf,
        /// The encoder's error.
        reason: String,
    },
    /// The file could not be written.
    #[error("{file}: cannot be written: {cause}", file = file.display())]
    Write {
        /// The file.
        file: PathBuf,
        /// The operating system's reason.
        #[source]
        cause: std::io::Error,
    },
}

/// Writes a page; the end of the file's name chooses SVG or PNG.
///
/// # Errors
/// [`PlotError`] other than [`PlotError::Nothing`].
pub fn write(page: &Page, file: &Path) -> Result<(), PlotError> {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    let bytes = match extension.as_deref() {
        Some("svg") => page.draw().to_svg().into_bytes(),
        Some("png") => page.draw().to_png(1.0).map_err(|reason| PlotError::Encode { file: file.to_owned(), reason })?,
        _ => {
            return Err(PlotError::Format { file: file.to_owned() });
        }
    };
    std::fs::write(file, bytes).map_err(|cause| PlotError::Write { file: file.to_owned(), cause })
}
