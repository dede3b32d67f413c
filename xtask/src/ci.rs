//! Checks that a change must pass, in the order in which failures are cheapest.

use anyhow::Result;

use crate::board::Board;
use crate::lane::Lane;
use crate::setup::{self, ARM, HAND, Machine};
use crate::{budget, build, docs, emulated, fuzz, hand, house, package, shell, test};

/// Runs every check; the first failure ends it.
pub(crate) fn run() -> Result<()> {
    checks()?;
    if let (Some(taken), Some(free)) = (shell::size_of(&shell::target_dir()), shell::free_space()) {
        shell::step(&format!(
            "the build folder takes {:.1} GB; {:.0} GB are free",
            taken as f64 / 1e9,
            free as f64 / 1e9
        ));
    }
    Ok(())
}

fn checks() -> Result<()> {
    setup::lints()?;
    shell::step("format");
    shell::run(shell::cargo().args(["fmt", "--all", "--check"]))?;
    docs::run()?;
    house::run(None)?;
    setup::all()?;
    let beside = Lane::begin(&["ci", "beside"])?;
    lint_host()?;
    build::documentation()?;
    plain_root()?;
    crate::faults(&[])?;
    crate::faults(&["storm", "--runs", "300"])?;
    package::run()?;
    // While the other part has one processor alone.
    build::host()?;
    beside.end()?;
    let board = Lane::begin(&["ci", "board"])?;
    test::with_the_world()?;
    test::firmware()?;
    board.end()?;
    build::nothing_twice()?;
    build::panics()
}

/// The part that goes on beside the builds of the root: all for other processors, then all that is optimised, and at
/// last a check that keeps one processor busy alone.
pub(crate) fn beside() -> Result<()> {
    images()?;
    fuzz::run(fuzz::USUAL)?;
    crate::faults(&["endurance"])
}

/// Lints and builds of the images and of the board's emulator, and the tests of that emulator: the part of the checks
/// that builds nothing for this machine's folder, so that it can go on beside the others.
pub(crate) fn images() -> Result<()> {
    let machine = setup::all()?;
    lint_firmware(&machine)?;
    emulated::lint()?;
    libraries_without_std(&machine)?;
    build::image(&machine)?;
    hand::image(&machine)?;
    emulated::build(machine.toolchain)?;
    emulated::test()
}

/// Trial of the image on the emulated board, what the images cost, and the fault catalogue under QEMU; the `tactus`
/// command is there already. It ends about when the tests beside it do.
pub(crate) fn board() -> Result<()> {
    let machine = setup::all()?;
    emulated::run(None)?;
    budget::run(&machine)?;
    hand::run(&machine)?;
    crate::faults(&["--device", "sim:"])
}

fn lint_host() -> Result<()> {
    shell::step("lints of the host packages");
    let clippy = |selection: &[&str]| {
        let mut clippy = shell::cargo();
        clippy.args(["clippy", "--workspace", "--exclude", "firmware"]).args(selection);
        shell::run(clippy.args(["--", "-D", "warnings"]))
    };
    // Without the world some code of the packages is another; their tests are then fewer, not others.
    clippy(&[])?;
    clippy(&["--all-targets", "--features", build::WORLD])
}

fn lint_firmware(machine: &Machine) -> Result<()> {
    if !machine.toolchain.has_clippy() {
        shell::note("lints of the image skipped: clippy cannot read Debian's library");
        return Ok(());
    }
    shell::step("lints of the images");
    for (board, may_sleep) in [(Board::Mps2, true), (Board::Mps2, false), (Board::Stm32h743, true)] {
        let mut clippy = machine.toolchain.cargo("clippy", ARM)?;
        // One profile for all boards: nothing is optimised here, and each profile would read all dependencies anew.
        clippy
            .args(["--package", "firmware", "--bin", "arm", "--profile", "firmware"])
            .args(["--no-default-features", "--features", board.features(may_sleep)])
            .args(["--", "-D", "warnings"]);
        shell::run(&mut clippy)?;
    }
    let mut clippy = machine.toolchain.cargo("clippy", HAND)?;
    clippy
        .args(["--package", "firmware", "--bin", "hand", "--profile", "firmware"])
        .args(["--no-default-features", "--features", Board::Mps2.features(true)])
        .args(["--", "-D", "warnings"]);
    shell::run(&mut clippy)
}

/// The movement primitives must stay usable on any Cortex-M, with and without floating point, by strangers.
fn libraries_without_std(machine: &Machine) -> Result<()> {
    shell::step("crates/dmp without std on Cortex-M4F and Cortex-M3");
    for target in [ARM, HAND] {
        for features in [&[][..], &["--features", "fixed"]] {
            let mut check = machine.toolchain.cargo("check", target)?;
            // The profile of the images, whose macros are there already.
            check.args(["--package", "movement-primitives", "--profile", "firmware", "--no-default-features"]);
            check.args(features);
            shell::run(&mut check)?;
        }
    }
    Ok(())
}

/// `cargo build` and `cargo test` at the root, as a newcomer types them: no cross target, no MuJoCo, with the
/// overflow checks of the development profile.
fn plain_root() -> Result<()> {
    shell::step("cargo build and cargo test at the root, without features");
    shell::run(shell::cargo().arg("build"))?;
    shell::run(shell::cargo().args(["test", "--quiet"]))
}
