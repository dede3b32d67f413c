//! A hash of the sources that decide how a trial ends, for the header of its results: those of other code are not
//! continued. And the place of the MuJoCo library, as for `tactus` (`host/build.rs`).

use std::fs;
use std::path::{Path, PathBuf};

/// The sources that play a trial: the laws, the device around them, the bus and the world, the host's part, and the
/// trial itself.
const SOURCES: &[&str] = &[
    "../control/src",
    "../control/model",
    "../device/src",
    "../dmp/src",
    "../link/src",
    "../puck/src",
    "../sim/src",
    "../sim/model",
    "../sim/objects",
    "../lab/src/client",
    "../lab/src/procedure",
    "../lab/src/simulation",
    "src",
];

/// Drawings of results that are there.
const DRAWINGS: &str = "src/figures";

fn main() {
    println!("cargo::rustc-link-arg=-Wl,-rpath,$ORIGIN/../mujoco/lib:$ORIGIN/../../mujoco/lib");
    let mut files = Vec::new();
    for source in SOURCES {
        println!("cargo::rerun-if-changed={source}");
        collect(Path::new(source), &mut files);
    }
    files.sort();
    let mut hash = 0xcbf2_9ce4_8422_2325;
    for file in files.iter().filter(|file| !file.starts_with(DRAWINGS)) {
        println!("cargo::rerun-if-changed={}", file.display());
        hash = add(hash, file.to_string_lossy().as_bytes());
        hash = add(hash, &fs::read(file).unwrap_or_default());
    }
    println!("cargo::rustc-env=TACTUS_TRIAL_CODE=0x{hash:016x}");
}

/// The files in a folder and below it.
fn collect(folder: &Path, files: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
        let path = entry.path();
        if path.is_dir() { collect(&path, files) } else { files.push(path) }
    }
}

/// FNV-1a, 64 bits.
fn add(hash: u64, bytes: &[u8]) -> u64 {
    bytes.iter().fold(hash, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(0x0000_0100_0000_01b3))
}
