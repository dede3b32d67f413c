//! The demonstration: a movement taught by hand to the simulated arm becomes a primitive that the image plays back.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::{build, setup, shell};

/// One step: what it does, in a sentence, and the words given to `tactus`.
struct Step {
    sentence: &'static str,
    words: &'static [&'static str],
}

/// From a person's hand to a recording.
const TEACH: Step = Step {
    sentence: "teach: a person guides the weightless arm to a side grasp",
    words: &["--force", "--device", "sim:", "teach", "--output", "grasp.csv"],
};

/// From the recording to a primitive; its report is shown in the summary.
const LEARN: Step = Step {
    sentence: "learn: the recording becomes a movement primitive",
    words: &["--force", "--json", "learn", "grasp.csv", "--output", "grasp.toml"],
};

/// On the host first.
const CHECK: Step =
    Step { sentence: "check: the primitive against the limits of the arm", words: &["check", "grasp.toml"] };

/// On the arm; its report is shown in the summary.
const RUN: Step = Step {
    sentence: "upload and run: the image under QEMU takes the primitive and plays it on the simulated arm",
    words: &["--force", "--json", "--device", "sim:", "run", "grasp.toml", "--record", "run.csv"],
};

/// The pictures for readers.
const PLOT: Step = Step {
    sentence: "plot: demonstration, plan and execution; and a picture of the arm",
    words: &[
        "--quiet",
        "--force",
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
        "--picture",
        "arm.png",
    ],
};

/// The primitive that [`largest`] leaves.
pub(crate) const LARGEST: &str = "largest.toml";

/// The same movement with the most kernels a device holds, for the budget.
const LEARN_LARGEST: Step = Step {
    sentence: "learn: the same movement with 100 kernels",
    words: &["--force", "learn", "grasp.csv", "--kernels", "100", "--output", LARGEST],
};

/// Records expected sensor values, so that a run may use all its sensors.
const REHEARSE_LARGEST: Step = Step {
    sentence: "rehearse: what that movement feels like",
    words: &["--force", "--device", "sil:", "rehearse", LARGEST, "--trials", "3", "--record-dir", "rehearsals"],
};

/// Records the spread of successful runs, so that the device watches the run.
const REMEMBER_LARGEST: Step = Step {
    sentence: "statistics: by what the device watches its runs",
    words: &["statistics", LARGEST, "rehearsals/largest-1.csv", "rehearsals/largest-2.csv", "rehearsals/largest-3.csv"],
};

/// Prepares the machine, builds, and runs every step; takes no further words.
pub(crate) fn run(rest: &[&str]) -> Result<()> {
    anyhow::ensure!(rest.is_empty(), "the demonstration takes no arguments");
    let machine = setup::all()?;
    build::image(&machine)?;
    let tactus = build::host()?;
    play(&tactus, &[TEACH])?;
    let fit = report(&tactus, &LEARN)?;
    play(&tactus, &[CHECK])?;
    let run = report(&tactus, &RUN)?;
    let folder = play(&tactus, &[PLOT])?;
    shell::step("what came of it");
    print!("{}", summary(&fit, &run));
    println!("figure                     {}", folder.join("run.png").display());
    println!("picture of the arm         {}", folder.join("arm.png").display());
    Ok(())
}

/// The table at the end of the demonstration.
fn summary(fit: &Value, run: &Value) -> String {
    let number = |value: &Value, pointer: &str| value.pointer(pointer).and_then(Value::as_f64).unwrap_or(f64::NAN);
    let of_fit = |name: &str| number(fit, &format!("/fit/{name}"));
    let of_run = |name: &str| number(run, &format!("/{name}"));
    let pose = |metres: f64, radians: f64| format!("{:.2} mm  {:.2} deg", metres * 1e3, radians.to_degrees());
    let rows = [
        ("fit error, RMS", pose(of_fit("position_rms_m"), of_fit("orientation_rms_rad"))),
        ("tracking error, RMS", pose(of_run("tracking/position_rms_m"), of_run("tracking/orientation_rms_rad"))),
        ("error at the goal", pose(of_run("tracking/position_end_m"), of_run("tracking/orientation_end_rad"))),
        ("control cycles", format!("{}", of_run("cycles"))),
        ("missed deadlines", format!("{}", of_run("missed_deadlines"))),
        ("control cycle, worst", format!("{} instructions", of_run("worst_instructions"))),
        ("bus load", format!("{:.1} %", of_run("bus/load") * 100.0)),
        ("frames on the bus, invalid", format!("{}, {}", of_run("bus/frames"), of_run("bus/invalid_frames"))),
    ];
    rows.iter().map(|(name, value)| format!("{name:<26} {value}\n")).collect()
}

/// Runs one step and gives what it reports as JSON.
fn report(tactus: &Path, step: &Step) -> Result<Value> {
    shell::step(step.sentence);
    let text = shell::capture(Command::new(tactus).args(step.words).current_dir(folder()?))?;
    serde_json::from_str(&text).with_context(|| format!("no report came from tactus {}", step.words.join(" ")))
}

/// Teaches, learns and rehearses the primitive [`LARGEST`]; returns the folder in which it lies.
pub(crate) fn largest(tactus: &Path) -> Result<PathBuf> {
    play(tactus, &[TEACH, LEARN_LARGEST, REHEARSE_LARGEST, REMEMBER_LARGEST])
}

/// Runs steps inside `target/demo`, where their files stay for a look afterwards; returns that folder.
fn play(tactus: &Path, steps: &[Step]) -> Result<PathBuf> {
    let folder = folder()?;
    for step in steps {
        shell::step(step.sentence);
        shell::run(Command::new(tactus).args(step.words).current_dir(&folder))?;
    }
    Ok(folder)
}

/// `target/demo`.
fn folder() -> Result<PathBuf> {
    let folder = shell::target_dir().join("demo");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    Ok(folder)
}
