//! Puts the linker scripts where the linker looks, and the git revision into the image.

use std::env;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use std::process::Command;

/// Interrupts of the board, by the role they have: a handler that nobody defines is the default handler.
const INTERRUPTS: [&str; 6] =
    ["SLOT_TIMER", "BUS_WIRE", "CAN_RECEIVE", "CAN_TRANSMIT", "DISPATCH_SESSION", "DISPATCH_LOG"];

fn main() -> Result<(), Box<dyn Error>> {
    let out = PathBuf::from(env::var("OUT_DIR")?);
    let root = PathBuf::from(env::var("CARGO_MANIFEST_DIR")?).join("..");
    fs::copy(root.join("memory.x"), out.join("memory.x"))?;
    let device: String = INTERRUPTS.iter().map(|name| format!("PROVIDE({name} = DefaultHandler);\n")).collect();
    fs::write(out.join("device.x"), device)?;
    println!("cargo::rustc-link-search={}", out.display());
    println!("cargo::rustc-env=TACTUS_REVISION={}", revision());
    println!("cargo::rerun-if-changed=build.rs");
    println!("cargo::rerun-if-changed={}", root.join("memory.x").display());
    println!("cargo::rerun-if-changed={}", root.join(".git/HEAD").display());
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
