//! Figures: pages of panels, free drawings, and demonstration, plan and execution of a movement on one page.

pub mod canvas;
pub mod drawing;
pub mod movement;
mod pixels;

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
    #[error(transparent)]
    Write(#[from] crate::output_file::OutputError),
}

/// A page as it stands in a file; the end of the file's name chooses SVG or PNG.
///
/// # Errors
/// [`PlotError::Format`], [`PlotError::Encode`].
pub fn encode(page: &Page, file: &Path) -> Result<Vec<u8>, PlotError> {
    let extension = file.extension().map(|extension| extension.to_string_lossy().to_lowercase());
    match extension.as_deref() {
        Some("svg") => Ok(page.draw().to_svg().into_bytes()),
        Some("png") => page.draw().to_png(1.0).map_err(|reason| PlotError::Encode { file: file.to_owned(), reason }),
        _ => Err(PlotError::Format { file: file.to_owned() }),
    }
}
