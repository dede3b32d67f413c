//! Costs of the image, measured by itself while it runs a movement under QEMU, and the bounds that a change must not
//! cross.
//!
//! Under `-icount shift=3` the emulated core executes 125 million instructions per virtual second and the image's clock
//! counts 25 million ticks, so one tick is five instructions: exact to +-5, and the same in every run. These are
//! instructions, not cycles: QEMU has no model of pipeline, cache or wait states. The movement has the most kernels a
//! device holds, and everything is on: hand, force control, adaptation, watch.

use std::process::Command;

use anyhow::{Context, Result};
use serde_json::Value;

use crate::setup::Machine;
use crate::{build, demo, elf, shell};

/// A control cycle of more instructions fails. 30 000 are 0.24 ms of the 1.11 ms between the slots here, and leave a
/// 480 MHz part with three cycles per instruction a sixth of that slot.
const CYCLE_BOUND: f64 = 30_000.0;

/// Deepest use of the stack. 29.4 kB today: the halves of the application are built in their place, piece by piece.
/// Stack that a run uses; the most that the image may use is computed when it is built (`cargo xtask stack`).
const STACK_BOUND: f64 = 36.0 * 1024.0;

/// Prints the table and fails if a bound is crossed.
pub(crate) fn run(machine: &Machine) -> Result<()> {
    let image = build::image(machine)?;
    let tactus = build::host()?;
    let folder = demo::largest(&tactus)?;
    shell::step("budget: 100 kernels, hand, force control, adaptation and watch, measured by the image itself");
    let json = shell::capture(
        Command::new(&tactus)
            .args(["--json", "--device", "sim:", "run", demo::LARGEST, "--mode", "adapt"])
            .current_dir(folder),
    )?;
    let report = report(&json).context("the run reported no costs")?;
    let number = |name: &str| -> Result<f64> {
        let value = report.get(name).and_then(Value::as_f64);
        value.with_context(|| format!("the report of the run has no '{name}'"))
    };
    let worst = number("worst_instructions")?;
    let missed = number("missed_deadlines")?;
    let sizes = elf::Sizes::of(&image)?;
    println!("control cycle, worst     {worst:>8} instructions  (bound {CYCLE_BOUND})");
    println!("control cycle, mean      {:>8} instructions", number("mean_instructions")?);
    println!("control cycles           {:>8}", number("cycles")?);
    println!("missed deadlines         {missed:>8}");
    println!("interrupt latency, worst {:>8} us", number("worst_latency_us")?);
    let stack = number("stack_used")?;
    println!("stack, deepest use       {stack:>8} B  (bound {STACK_BOUND})");
    println!("flash                    {:>8} B", sizes.flash());
    println!("RAM without stack        {:>8} B", sizes.ram());
    anyhow::ensure!(worst > 0.0, "the image did not measure its control cycle");
    anyhow::ensure!(stack <= STACK_BOUND, "the stack goes {stack} B deep, more than {STACK_BOUND}");
    anyhow::ensure!(missed == 0.0, "{missed} control cycles missed their deadline");
    anyhow::ensure!(worst <= CYCLE_BOUND, "the control cycle takes {worst} instructions, more than {CYCLE_BOUND}");
    Ok(())
}

/// The object with the costs of the run, wherever the last line that has one holds it.
fn report(json: &str) -> Option<Value> {
    let lines = json.lines().filter_map(|line| serde_json::from_str(line).ok());
    let whole = serde_json::from_str(json).ok();
    lines.chain(whole).filter_map(|value| holder(value, "worst_instructions")).next_back()
}

/// The innermost object that has a member of this name.
fn holder(value: Value, name: &str) -> Option<Value> {
    match value {
        Value::Object(members) if members.contains_key(name) => Some(Value::Object(members)),
        Value::Object(members) => members.into_iter().find_map(|(_, value)| holder(value, name)),
        Value::Array(items) => items.into_iter().find_map(|value| holder(value, name)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::report;

    #[test]
    fn the_report_is_found_in_an_object_and_in_lines() {
        let whole = "{\n\"run\": {\"worst_instructions\": 7}\n}";
        let lines = "{\"progress\": 1}\n{\"worst_instructions\": 7}\nnot json\n";
        for json in [whole, lines] {
            let found = report(json).and_then(|value| value["worst_instructions"].as_u64());
            assert_eq!(found, Some(7), "{json}");
        }
        assert!(report("{\"cycles\": 3}").is_none());
    }
}
