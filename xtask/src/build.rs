//! Builds the host tools and the images for the boards.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};
use link::ImageMetadata;

use crate::board::{self, Board};
use crate::elf::Sizes;
use crate::setup::{ARM, Machine, Toolchain};
use crate::{hot, panics, shell, stack};

/// Features of the host packages with the MuJoCo world and its pictures.
pub(crate) const WORLD: &str = "tactus/mujoco,lab/mujoco,experiment/mujoco,sim/mujoco,sim/render,system-tests/mujoco";

/// File name of the hand's image beside the tools.
pub(crate) const HAND: &str = "hand.elf";

/// `cargo build` or `cargo test` of all host packages with the MuJoCo world.
///
/// In the development profile, as `cargo build` at the root: what lies below the world is then built once for both, and
/// what is used has the overflow checks that its tests had. Every such build selects the same packages and features,
/// whatever it then needs of them: the features of a dependency follow from the selection, so another selection would
/// build half of the house once more.
pub(crate) fn with_the_world(verb: &str) -> Command {
    let mut cargo = shell::cargo();
    cargo.args([verb, "--workspace", "--exclude", "firmware", "--features", WORLD]);
    cargo
}

/// Builds the `tactus` command with the MuJoCo world; returns its path.
///
/// It is put into a folder of its own, from which a `cargo build` or `cargo test` without the world does not take it.
pub(crate) fn host() -> Result<PathBuf> {
    shell::step("building the tactus command");
    shell::run(with_the_world("build").args(["--bin", "tactus"]))?;
    let folder = shell::target_dir().join("tools");
    fs::create_dir_all(&folder)?;
    let tactus = folder.join("tactus");
    place(&shell::target_dir().join("debug").join("tactus"), &tactus)?;
    shell::note(&format!("command: {}", tactus.display()));
    Ok(tactus)
}

/// Fails if the `tactus` command, which has just been built, would be built once more: a build script that names a file
/// which is not there makes cargo do so in every call.
pub(crate) fn nothing_twice() -> Result<()> {
    shell::step("nothing is built twice");
    let messages =
        shell::capture(with_the_world("build").args(["--quiet", "--bin", "tactus", "--message-format", "json"]))?;
    match messages.lines().find(|message| message.contains("\"fresh\":false")) {
        None => Ok(()),
        Some(message) => bail!("built once more though nothing has changed: {message}"),
    }
}

/// Builds the arm image for the emulated board; returns the path under which the host tools look for it.
pub(crate) fn image(machine: &Machine) -> Result<PathBuf> {
    board_image(machine.toolchain, Board::Mps2, machine.qemu.may_sleep())
}

/// Builds the arm image for a real board, says what it takes of every memory, and fails where that is too much.
pub(crate) fn real_board(toolchain: Toolchain, board: Board) -> Result<PathBuf> {
    let image = board_image(toolchain, board, true)?;
    board::print_sizes(&image)?;
    hot::check(&image)?;
    Ok(image)
}

/// Builds the arm image for a board and puts it beside the tools.
fn board_image(toolchain: Toolchain, board: Board, may_sleep: bool) -> Result<PathBuf> {
    shell::step(&format!("building the arm image for {board}"));
    let mut cargo = toolchain.cargo("build", ARM)?;
    cargo.args(["--package", "firmware", "--bin", "arm", "--profile", "firmware", "--config", board.level()]).args([
        "--no-default-features",
        "--features",
        board.features(may_sleep),
    ]);
    shell::run(&mut cargo)?;
    let built = toolchain.output(ARM, "firmware").join("arm");
    let sizes = Sizes::of(&built)?;
    let described =
        ImageMetadata::decode(sizes.description().context("the image does not say which board it is for")?)?;
    // Cargo leaves the images of all boards at one place.
    ensure!(
        described.simulated == (board == Board::Mps2),
        "an image for {} was built meanwhile: try again",
        described.board
    );
    // One place whatever the toolchain, beside the tools that load it.
    let folder = shell::target_dir().join("images");
    fs::create_dir_all(&folder)?;
    let image = folder.join(board.file());
    place(&built, &image)?;
    shell::note(&format!("image: {}", image.display()));
    nothing_forbidden(&image, board)?;
    Ok(image)
}

/// Copies a file to where the tools look for it, in one step: somebody may be loading the one that is there.
pub(crate) fn place(built: &Path, there: &Path) -> Result<()> {
    let fresh = there.with_extension("new");
    fs::copy(built, &fresh).with_context(|| format!("cannot copy {}", built.display()))?;
    fs::rename(&fresh, there).with_context(|| format!("cannot write {}", there.display()))
}

/// Fails if an image contains what none may: an allocator, unknown panics, a path deeper than its stack.
pub(crate) fn nothing_forbidden(image: &Path, board: Board) -> Result<()> {
    ensure!(!Sizes::of(image)?.allocates(), "the image allocates memory, which nothing on a device may");
    panics::check(image, board)?;
    stack::check(image)
}

/// Says where the images that were built can panic.
pub(crate) fn panics() -> Result<()> {
    panics::table(&images()?)
}

/// Says how deep the stacks of the images that were built go, and fails if one is too deep.
pub(crate) fn stacks() -> Result<()> {
    let images: Vec<PathBuf> = images()?.into_iter().map(|(image, _)| image).collect();
    stack::table(&images)
}

/// Every image, with the board whose code is in it.
fn images() -> Result<Vec<(PathBuf, Board)>> {
    let folder = shell::target_dir().join("images");
    let mut images: Vec<_> = Board::ALL.map(|board| (folder.join(board.file()), board)).into();
    images.push((folder.join(HAND), Board::Mps2));
    for (image, _) in &images {
        ensure!(image.exists(), "{} is not built: cargo xtask build, --board stm32h743, --image hand", image.display());
    }
    Ok(images)
}

/// Builds the documentation of every crate of the workspace.
pub(crate) fn documentation() -> Result<()> {
    shell::step("building the documentation");
    shell::run(
        shell::cargo()
            .args(["doc", "--no-deps", "--workspace", "--exclude", "firmware"])
            .env("RUSTDOCFLAGS", "-D warnings"),
    )
}
