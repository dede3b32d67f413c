//! Mesa's EGL, for pictures of the simulated arm without a display.

use anyhow::Result;

use super::apt;

/// Debian packages that the off-screen renderer loads at run time.
const PACKAGES: [&str; 3] = ["libegl1", "libegl-mesa0", "libgl1-mesa-dri"];

/// Makes sure that pictures can be rendered.
pub(super) fn ensure() -> Result<()> {
    // Without apt nothing is known about the packages; the renderer itself says so if EGL is missing.
    if !apt::is_present() {
        return Ok(());
    }
    let missing: Vec<&str> = PACKAGES.into_iter().filter(|package| !apt::is_installed(package)).collect();
    if missing.is_empty() {
        return Ok(());
    }
    apt::install(&missing, "pictures without a display")
}
