//! Why a simulated device cannot be had, or came to its end.

use std::io;
use std::path::PathBuf;

use crate::image_file::ImageFileError;
use crate::output_file::OutputError;

/// Why a simulated device cannot be had, or came to its end.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// No such world.
    #[error("there is no world '{0}'; there are world=mujoco and world=simple")]
    UnknownWorld(String),
    /// No hand can hold it.
    #[error(transparent)]
    NotHeld(#[from] sim::NotHeld),
    /// This program was built without the feature `mujoco`.
    #[error("this tactus was built without the MuJoCo world; `cargo xtask build` makes one that has it")]
    WithoutMujoco,
    /// MuJoCo cannot load the model.
    #[cfg(feature = "mujoco")]
    #[error("the MuJoCo world cannot be made: {0}")]
    World(#[from] sim::world::mujoco::WorldError),
    /// The firmware image is not there.
    #[error("no firmware image at {0}; `cargo xtask build` makes it")]
    NoImage(PathBuf),
    /// QEMU is not installed.
    #[error("qemu-system-arm cannot be started ({0}); `cargo xtask setup` installs it")]
    NoQemu(#[source] io::Error),
    /// The image for the emulated board is not there.
    #[error("no image for the emulated board at {0}; `cargo xtask board --build` makes it")]
    NoBoardImage(PathBuf),
    /// The emulator of the board is not there.
    #[error("no emulator of the board at {0}; `cargo xtask board --build` makes it")]
    NoEmulator(PathBuf),
    /// The emulator of the board cannot be started.
    #[error("the emulator {0} cannot be started: {1}")]
    Emulator(PathBuf, #[source] io::Error),
    /// The file for the emulated board is not an image that says what it is.
    #[error("no image for the emulated board: {0}")]
    BoardImage(#[source] Box<ImageFileError>),
    /// The image is for another board than the emulated one.
    #[error("{} is for board '{board}', not for the emulated '{expected}'", image.display())]
    OtherBoard {
        /// The image.
        image: PathBuf,
        /// Its board.
        board: String,
        /// The emulated board.
        expected: &'static str,
    },
    /// The emulator refused the image or an option.
    #[error("the emulated board cannot be set up: {0}")]
    BoardRefused(String),
    /// A flash of this program was to be put into the emulated board.
    #[error("the emulated board has its flash inside; it can only be kept in a file")]
    FlashOfItsOwn,
    /// The emulator of the board ended by itself.
    #[error("the emulated board ended{status}; it said: {words}")]
    BoardEnded {
        /// Exit status, if it is known.
        status: String,
        /// Its last output.
        words: String,
    },
    /// The file for the firmware's log cannot be written.
    #[error("cannot write the firmware's log: {0}")]
    Log(#[source] io::Error),
    /// The file for the log of the buses cannot be written.
    #[error("the log of the buses: {0}")]
    BusLog(#[from] OutputError),
    /// The file for the report of the emulated board cannot be written.
    #[error("the report of the emulated board: {0}")]
    BoardReport(#[source] OutputError),
    /// The file that is the device's flash cannot be used.
    #[error("cannot use {0} as the device's flash: {1}")]
    Flash(PathBuf, #[source] io::Error),
    /// The script of faults cannot be used.
    #[error("cannot use {0} as a script of faults: {1}")]
    Faults(PathBuf, String),
    /// The simulated flash lost power, as it was told to, and the device with it.
    #[error("the power of the simulated device failed while it wrote its flash")]
    PowerFailed,
    /// The exchange with the firmware broke.
    #[error("the simulated device failed: {0}")]
    Lockstep(#[from] sim::LockstepError),
    /// The firmware ended by itself: a panic, or QEMU was killed.
    #[error("the firmware under QEMU ended{status}; its last words: {words}")]
    Ended {
        /// Exit status, if it is known.
        status: String,
        /// Its last output, as far as it is text.
        words: String,
    },
}
