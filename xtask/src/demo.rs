//! The demonstration: a movement taught by hand to the simulated arm becomes a primitive that the image plays back.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};

use crate::{build, setup, shell};

/// One step: what it does, in a sentence, and the words given to `tactus`.
struct Step {
    sentence: &'static str,
    words: &'static [&'static str],
}

/// From a person's hand to a recording.
const TEACH: Step = Step {
    sentence: "teach: a person guides the weightless arm to a side grasp",
    words: &["--device", "sim:", "teach", "--output", "grasp.csv"],
};

/// From the recording to a movement and its figure.
const PLAY: &[Step] = &[
    Step {
        sentence: "learn: the recording becomes a movement primitive",
        words: &["learn", "grasp.csv", "--output", "grasp.toml"],
    },
    Step { sentence: "check: the primitive against the limits of the arm", words: &["check", "grasp.toml"] },
    Step {
        sentence: "run: the image under QEMU takes the primitive and plays it on the simulated arm",
        words: &["--device", "sim:", "run", "grasp.toml", "--record", "run.csv"],
    },
    Step {
        sentence: "plot: demonstration, plan and execution",
        words: &[
            "plot",
            "--demonstration",
            "grasp.csv",
            "--primitive",
            "grasp.toml",
            "--run",
            "run.csv",
            "--output",
            "run.svg",
            "--output",
            "run.png",
        ],
    },
];

/// The primitive that [`largest`] leaves.
pub(crate) const LARGEST: &str = "largest.toml";

/// The same movement with the most kernels a device holds, for the budget.
const LEARN_LARGEST: Step = Step {
    sentence: "learn: the same movement with 100 kernels",
    words: &["learn", "grasp.csv", "--kernels", "100", "--output", LARGEST],
};

/// Prepares the machine, builds, and runs every step; takes no further words.
pub(crate) fn run(rest: &[&str]) -> Result<()> {
    anyhow::ensure!(rest.is_empty(), "the demonstration takes no arguments");
    let machine = setup::all()?;
    build::image(&machine)?;
    let tactus = build::host()?;
    play(&tactus, &[TEACH])?;
    let folder = play(&tactus, PLAY)?;
    shell::note(&format!("files: {}", folder.display()));
    Ok(())
}

/// Teaches and learns the primitive [`LARGEST`]; returns the folder in which it lies.
pub(crate) fn largest(tactus: &Path) -> Result<PathBuf> {
    play(tactus, &[TEACH, LEARN_LARGEST])
}

/// Runs steps inside `target/demo`, where their files stay for a look afterwards; returns that folder.
fn play(tactus: &Path, steps: &[Step]) -> Result<PathBuf> {
    let folder = shell::target_dir().join("demo");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    for step in steps {
        shell::step(step.sentence);
        shell::run(Command::new(tactus).args(step.words).current_dir(&folder))?;
    }
    Ok(folder)
}
