//! Puts the linker scripts of the board where the linker looks, and the git revision into the image.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Needs of a board from the linker.
struct Board {
    /// Feature of this package that chooses the board, as cargo tells it to build scripts.
    feature: &'static str,
    /// Its memory, below `memory/`.
    memory: &'static str,
    /// Its interrupts by role, where no peripheral crate names them: a handler that nobody defines is the default one.
    interrupts: &'static [&'static str],
}

const BOARDS: [Board; 2] = [
    Board {
        feature: "CARGO_FEATURE_BOARD_MPS2",
        memory: "mps2.x",
        interrupts: &["SLOT_TIMER", "BUS_WIRE", "CAN_RECEIVE", "CAN_TRANSMIT", "DISPATCH_SESSION", "DISPATCH_LOG"],
    },
    Board { feature: "CARGO_FEATURE_BOARD_STM32H743", memory: "stm32h743.x", interrupts: &[] },
];

/// Target of the hand image: a core without floating point, and with the memory of the smallest part the image is for.
const HAND_TARGET: &str = "thumbv7m-none-eabi";
const HAND_MEMORY: &str = "hand.x";

fn main() -> Result<(), Box<dyn Error>> {
    let manifest = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?);
    println!("cargo::rustc-env=TACTUS_REVISION={}", revision());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={}", manifest.join("../.git/HEAD").display());
    println!("cargo::rerun-if-changed={}", manifest.join("memory").display());
    println!("cargo::rerun-if-changed={}", manifest.join("../memory.x").display());
    if env::var("CARGO_CFG_TARGET_OS")? != "none" {
        // On the host the library is built for its tests, without a board.
        return Ok(());
    }
    let chosen: Vec<&Board> = BOARDS.iter().filter(|board| env::var_os(board.feature).is_some()).collect();
    let [board] = chosen[..] else {
        return Err("an image is for exactly one board: choose board-mps2 or board-stm32h743 \
                    (the latter with --no-default-features)"
            .into());
    };
    let out = PathBuf::from(env::var("OUT_DIR")?);
    fs::copy(manifest.join("../memory.x"), out.join("memory.x"))?;
    let script = |name: &str| fs::read_to_string(manifest.join("memory").join(name));
    let memory = if env::var("TARGET")? == HAND_TARGET { HAND_MEMORY } else { board.memory };
    // `memory.x` at the root includes it.
    fs::write(out.join("board.x"), script(memory)? + &script("metadata.x")?)?;
    if !board.interrupts.is_empty() {
        let handlers = board.interrupts.iter().map(|name| format!("PROVIDE({name} = DefaultHandler);\n"));
        fs::write(out.join("device.x"), handlers.collect::<String>())?;
    }
    println!("cargo::rustc-link-search={}", out.display());
    Ok(())
}

/// Short git revision, or a word that says there is none.
fn revision() -> String {
    Command::new("git")
        .args(["rev-parse", "--short", "HEAD"])
        .output()
        .ok()
        .filter(|output| output.status.success())
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .map_or_else(|| "no revision".into(), |text| text.trim().to_owned())
}
