//! The chip as a process in lock step.

mod common;

use std::fs;

use common::Process;
use serde_json::Value;

#[test]
fn it_asks_at_least_every_millisecond_and_power_off_leaves_report_and_bank() {
    let folder = std::env::temp_dir().join(format!("emulated-board-serve-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let (bank, report) = (folder.join("bank2"), folder.join("report.json"));
    let mut process = Process::start(&["--bank2", bank.to_str().unwrap(), "--report", report.to_str().unwrap()]);
    let mut last = 0;
    while process.plant.now() < 25_000_000 {
        process.lockstep.serve_one(&mut process.plant).unwrap();
        assert!(process.plant.now() - last <= 30_000, "from {last} to {}", process.plant.now());
        last = process.plant.now();
    }
    assert_eq!(process.power_off(), 0);
    assert!(fs::read(&bank).unwrap().len() == 1 << 20);
    let report: Value = serde_json::from_slice(&fs::read(&report).unwrap()).unwrap();
    assert_eq!(report["board"], "nucleo-h743zi2");
    assert_eq!(report["can_bit_rate"], 1_000_000);
    assert_eq!(report["unmodelled"]["count"], 0);
    fs::remove_dir_all(&folder).unwrap();
}
