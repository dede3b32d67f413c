//! Why a simulated device cannot be had, or came to its end.

use std::io;
use std::path::PathBuf;

/// Why a simulated device cannot be had, or came to its end.
#[derive(Debug, thiserror::Error)]
pub enum SimulationError {
    /// No such world.
    #[error("there is no world '{0}'; there are world=mujoco and world=simple")]
    UnknownWorld(String),
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
    /// The file for the firmware's log cannot be written.
    #[error("cannot write the firmware's log: {0}")]
    Log(#[source] io::Error),
    /// The file for the log of the buses cannot be written.
    #[error("cannot write the log of the buses to {0}: {1}")]
    BusLog(PathBuf, #[source] io::Error),
    /// The file that is the device's flash cannot be used.
    #[error("cannot use {0} as the device's flash: {1}")]
    Flash(PathBuf, #[source] io::Error),
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
        /// What it printed last, as far as it is text.
        words: String,
    },
}
