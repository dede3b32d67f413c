//! The demonstration's movement on the emulated board: taught, learned, uploaded into bank 2, played twice, found after
//! a restart.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

use anyhow::{Context, Result};
use serde_json::Value;

use super::expected::{findings, number, stack};
use super::report;
use super::table::Table;
use crate::shell;

/// Time from power-up to an arm that can be commanded, s. The operator of the simulated arm takes most of it.
const READY: f64 = 10.0;

/// Bounds of the tracking, as those of the movement under QEMU (`tests/tests/system/journey.rs`): mm, degrees.
const TRACKING: [(&str, &str, &str, f64); 4] = [
    ("tracking, RMS", "/tracking/position_rms_m", "mm", 5.0),
    ("tracking, RMS", "/tracking/orientation_rms_rad", "deg", 1.5),
    ("error at the goal", "/tracking/position_end_m", "mm", 3.0),
    ("error at the goal", "/tracking/orientation_end_rad", "deg", 1.0),
];

/// Events that must not happen in a run.
const NONE: [(&str, &str); 5] = [
    ("missed deadlines", "/missed_deadlines"),
    ("lost replies", "/lost_replies"),
    ("samples lost on the link", "/gaps"),
    ("telemetry left out", "/telemetry_dropped"),
    ("invalid frames", "/bus/invalid_frames"),
];

/// The laboratory: programs, image, and a folder whose files stay for a look afterwards.
struct Bench<'a> {
    emulator: &'a Path,
    image: &'a Path,
    tactus: &'a Path,
    folder: PathBuf,
}

impl Bench<'_> {
    fn command(&self, words: &[&str]) -> Command {
        let mut command = Command::new(self.tactus);
        command.args(words).current_dir(&self.folder);
        command.env("TACTUS_BOARD_EMULATOR", self.emulator).env("TACTUS_BOARD_IMAGE", self.image);
        command
    }

    /// Plays the movement on a board with a blank bank 2; gives what `tactus` and what the emulator report.
    fn play(&self, name: &str) -> Result<(Value, Value)> {
        let [bank, file, recording] = ["bank2", "json", "csv"].map(|kind| format!("{name}.{kind}"));
        for old in [&bank, &file, &recording] {
            let _ = fs::remove_file(self.folder.join(old));
        }
        let device = format!("board:seed=7,flash={bank},report={file}");
        let words = ["--json", "--quiet", "--device", &device, "run", "grasp.toml", "--record", &recording];
        let run = object(&mut self.command(&words))?;
        let text = fs::read_to_string(self.folder.join(&file)).with_context(|| format!("there is no {file}"))?;
        Ok((run, serde_json::from_str(&text)?))
    }
}

/// Adds what the movement comes to.
pub(super) fn play(table: &mut Table, emulator: &Path, image: &Path, tactus: &Path) -> Result<()> {
    let folder = shell::target_dir().join("demo-board");
    fs::create_dir_all(&folder).with_context(|| format!("cannot create {}", folder.display()))?;
    let bench = Bench { emulator, image, tactus, folder };
    shell::step("teach: a person guides the weightless arm; the image for the real board makes it so");
    shell::run(&mut bench.command(&["--force", "--device", "board:", "teach", "--output", "grasp.csv"]))?;
    shell::step("learn: the recording becomes a movement primitive");
    shell::capture(&mut bench.command(&["--force", "--quiet", "learn", "grasp.csv", "--output", "grasp.toml"]))?;
    shell::step("upload into bank 2, and run; twice with one seed");
    let begun = Instant::now();
    let (run, report) = bench.play("first")?;
    let speed = number(&report, "/virtual_seconds").unwrap_or(0.0) / begun.elapsed().as_secs_f64();
    let (again, _) = bench.play("second")?;
    table.part("movement, uploaded into bank 2");
    movement(table, &run);
    table.told("emulation", format!("{speed:.2} x real time"));
    findings(table, &report);
    stack(table, &report);
    let hash = |run: &Value| run.pointer("/bus/hash").and_then(Value::as_str).map(str::to_owned);
    let (one, other) = (hash(&run), hash(&again));
    let same = one.is_some() && one == other;
    let missing = || "missing".to_owned();
    table.checked("bus hash", one.unwrap_or_else(missing), other.unwrap_or_else(missing), same);
    for (what, kind) in [("bank 2 of both runs", "bank2"), ("recordings of both runs", "csv")] {
        let read = |name: &str| fs::read(bench.folder.join(format!("{name}.{kind}")));
        let equal = read("first")? == read("second")?;
        table.checked(what, if equal { "equal" } else { "different" }, "equal", equal);
    }
    restart(table, &bench)
}

/// Adds what a run reports.
fn movement(table: &mut Table, run: &Value) {
    table.at_most("ready after power-up", number(run, "/ready_s"), "s", READY);
    for (name, pointer, unit, limit) in TRACKING {
        let value = number(run, pointer).map(|value| if unit == "mm" { value * 1e3 } else { value.to_degrees() });
        table.at_most(name, value.map(|value| (value * 1e3).round() / 1e3), unit, limit);
    }
    for (name, pointer) in NONE {
        table.at_most(name, number(run, pointer), "", 0.0);
    }
    let figure = |pointer: &str| number(run, pointer).unwrap_or(f64::NAN);
    table.told("control cycles", figure("/cycles").to_string());
    table.told("control cycle, worst", format!("{:.1} us", figure("/worst_computation_us")));
    table.told("timer latency, worst", format!("{:.1} us", figure("/worst_latency_us")));
    table.told("bus load", format!("{:.1} %", figure("/bus/load") * 100.0));
}

/// Switches the board on again and asks for what it keeps.
fn restart(table: &mut Table, bench: &Bench<'_>) -> Result<()> {
    shell::step("restart: the primitive is there");
    let list = object(&mut bench.command(&["--json", "--quiet", "--device", "board:flash=first.bank2", "list"]))?;
    let names = list.get("primitives").and_then(Value::as_array).into_iter().flatten();
    let names: Vec<&str> = names.filter_map(|primitive| primitive.get("name").and_then(Value::as_str)).collect();
    table.checked("primitives after a restart", names.join(", "), "grasp", names == ["grasp"]);
    Ok(())
}

/// Returns the report of a command; one that fails is an error.
fn object(command: &mut Command) -> Result<Value> {
    let (ended_well, value) = report(command)?;
    anyhow::ensure!(ended_well, "to repeat: {}", shell::line(command));
    Ok(value)
}
