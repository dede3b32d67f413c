//! Set-up and chores of Tactus: `cargo xtask <verb>`. Says what it does, asks nothing.

mod board;
mod book;
mod budget;
mod build;
mod ci;
mod code;
mod demo;
mod docs;
mod elf;
mod emulated;
mod files;
mod fuzz;
mod hand;
mod hot;
mod house;
mod lane;
mod miri;
mod mutants;
mod origin;
mod package;
mod panics;
mod qemu;
mod runner;
mod setup;
mod shell;
mod stack;
mod test;
mod thumb;

use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use crate::board::Board;

const HELP: &str = "\
cargo xtask <verb>

  setup    install what is missing: QEMU, Cortex-M target, MuJoCo library, EGL, Python packages
  build    build everything: host tools with the MuJoCo world, the image for the emulated board
           --board stm32h743 | mps2: the image for one board alone, with what it takes of each memory
           --image hand: the hand image (Cortex-M3, fixed point), with its sizes
  hand    build, run and measure the hand image: instructions per cycle, accuracy, sizes
           --check IMAGE: sizes and control path of an image that is there
  board    run the unmodified image for the STM32H743 on an emulated one: start, clocks, stack, a taught movement, a restart
           --build: only make what `--device board:` needs; --image FILE: run that image
  demo     teach, learn, check, upload and run a movement on the simulated arm
  test     every test, whole-system tests under QEMU included
  ci       what a change must pass: format, lints, builds, tests, budgets; a part of it alone: ci images, ci beside, ci board
  budget   instructions per control cycle, interrupt latency, stack, flash and RAM of the image
  stack    how deep the stack of every image that is there goes, function by function
           --image FILE: of one image
  panics   where the images that are there can panic, and why they do not
  size     flash and RAM of the image by section
  qemu     run an image by itself: cargo xtask qemu [IMAGE]
  run-image IMAGE   run an image where it belongs: QEMU, or a board through probe-rs (cargo's runner)
  book     the documents as a book, read without a network: target/book/html (mdBook, installed if it is not there)
  doc      documentation of all crates
  docs     dead links, paths, test names and fault identifiers in any file
  package  packages for strangers: packed, unpacked outside the repository, tested there, their examples run
  mutants  wrong changes of the code that named tests must catch; cargo xtask mutants WORDS: those whose name has WORDS
  faults [--all] [--json] [--shift SEED] [ID...]   the fault catalogue: every script of tests/faults against the
           simulated arm; shifted: each scenario up to 0.12 s later, its pushes up to 7 % harder or weaker
           --device sim: | board: the scenarios marked for it, with the image under QEMU or on the emulated board
  faults storm [--wide] [--runs N] [--seed S]   random faults and orders; one run prints itself as a scenario
  faults endurance [--hours H] [--seed S]   such storms on one arm in one process, H hours of simulated time, 0.25 unless given
  fuzz [COUNT]   COUNT random link frames and as many CAN frames, a tenth of it random sessions; 1000000 unless given
  miri     unit tests of the device's crates in an interpreter that finds undefined behaviour; needs the nightly toolchain
  margins  every control law on an arm without friction, kicked: what is left, worst pose, frequency
  house    module circles, sizes, old words, arrows between crates; cargo xtask house RULE: one of the rules

Every verb does the set-up it needs. Environment:
  TACTUS_TOOLCHAIN=rustup|debian   force one of the two ways to compile for Cortex-M";

fn main() -> ExitCode {
    shell::start_clock();
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    match dispatch(&words) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            shell::step(&format!("failed: {error:#}"));
            shell::note(&format!("to repeat all: cargo xtask {}", words.join(" ")));
            ExitCode::FAILURE
        }
    }
}

/// Runs the fault catalogue, or the entries named.
fn faults(words: &[&str]) -> Result<()> {
    shell::step("fault catalogue: what the simulated arm does, and the way back");
    // As the plain `cargo build` at the root builds it, with the overflow checks of the development profile.
    shell::run(shell::cargo().args(["build", "--quiet", "--bin", "faults"]))?;
    shell::run(Command::new(shell::target_dir().join("debug/faults")).args(words).current_dir(shell::root()))
}

/// Prints the margins of the control laws; `cargo xtask test` holds them, too.
fn margins() -> Result<()> {
    shell::step("margins of the control laws, without friction");
    shell::run(shell::cargo().args([
        "test",
        "--release",
        "--package",
        "control",
        "--test",
        "margins",
        "--",
        "--nocapture",
    ]))
}

fn dispatch(words: &[&str]) -> Result<()> {
    match words {
        ["setup"] => setup::all().map(drop)?,
        ["build"] => {
            let machine = setup::all()?;
            build::host()?;
            build::image(&machine)?;
        }
        ["build", "--board", word] => {
            let board = Board::from_name(word)
                .with_context(|| format!("no board '{word}'; there are: {}", Board::ALL.map(Board::name).join(", ")))?;
            if board == Board::Mps2 {
                build::image(&setup::all()?)?;
            } else {
                build::real_board(setup::compiler()?, board)?;
            }
        }
        ["build", "--image", "hand"] => drop(hand::image(&setup::all()?)?),
        ["hand"] => hand::run(&setup::all()?)?,
        ["hand", "--check", image] => hand::check(image.as_ref())?,
        ["board"] => emulated::run(None)?,
        ["board", "--build"] => drop(emulated::build(setup::compiler()?)?),
        ["board", "--image", image] => emulated::run(Some(image.as_ref()))?,
        ["panics"] => build::panics()?,
        ["stack"] => build::stacks()?,
        ["stack", "--image", image] => stack::run(image.as_ref())?,
        ["run-image", image, rest @ ..] => return runner::run(image, rest),
        ["demo", rest @ ..] => demo::run(rest)?,
        ["test"] => test::run(&setup::all()?)?,
        ["ci"] => ci::run()?,
        ["ci", "images"] => ci::images()?,
        ["ci", "beside"] => ci::beside()?,
        ["ci", "board"] => ci::board()?,
        ["budget"] => budget::run(&setup::all()?)?,
        ["size"] => {
            let image = build::image(&setup::all()?)?;
            print!("{}", elf::Sizes::of(&image)?);
        }
        ["qemu", rest @ ..] => qemu::run(rest)?,
        ["doc"] => build::documentation()?,
        ["docs"] => docs::run()?,
        ["book"] => book::run()?,
        ["faults", rest @ ..] => faults(rest)?,
        ["fuzz"] => fuzz::run(fuzz::USUAL)?,
        ["fuzz", count] => fuzz::run(count.parse().with_context(|| format!("no number: {count}"))?)?,
        ["miri"] => miri::run()?,
        ["margins"] => margins()?,
        ["package"] => package::run()?,
        ["mutants"] => mutants::run("")?,
        ["mutants", part] => mutants::run(part)?,
        ["house"] => house::run(None)?,
        ["house", rule] => house::run(Some(rule))?,
        [] | ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            return Ok(());
        }
        other => bail!("unknown: '{}'\n{HELP}", other.join(" ")),
    }
    shell::step("done");
    Ok(())
}
