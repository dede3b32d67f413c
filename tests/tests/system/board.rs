//! The image for the real board, executed on the emulated STM32H743: the same arm as under QEMU.

use std::fs;
use std::path::Path;

use lab::device::Device;
use lab::simulation::{FlashSource, SimulationError, built_image};
use link::image::stored_crc;
use system_tests::command::{one_object, program, stderr, tactus};
use system_tests::execution::{beyond_torque_limits, distance, grasp_point, play};
use system_tests::{Arm, PRIMITIVE, expect, ready, taught};

/// Content of a device's library: names, and checksums of the images.
fn stored(arm: &mut Arm) -> Vec<(String, u32)> {
    expect(arm.list()).into_iter().map(|listing| (listing.name.as_str().to_owned(), listing.crc)).collect()
}

// That a second run with the same seed is the same is for `cargo xtask board` to show.
#[test]
fn the_board_plays_the_movement_that_qemu_plays_and_keeps_it() {
    let folder = expect(tempfile::tempdir());
    let (bank, report) = (folder.path().join("bank2"), folder.path().join("report.json"));
    let run = |address: &str| play(&mut ready(address), taught());
    let board = run(&format!("board:seed=42,flash={},report={}", bank.display(), report.display()));
    let tracking = &board.tracking;
    println!("{tracking:?}");
    assert!(tracking.position_rms_m <= 5e-3 && tracking.orientation_rms_rad.to_degrees() <= 1.5, "{tracking:?}");
    assert!(tracking.position_end_m <= 3e-3 && tracking.orientation_end_rad.to_degrees() <= 1.0, "{tracking:?}");
    let statistics = &board.statistics;
    assert_eq!((statistics.missed_deadlines, statistics.lost_replies, statistics.torque_mismatches), (0, 0, 0));
    assert_eq!((board.gaps, board.recording.missing_samples), (0, 0));
    assert_eq!(board.trace.invalid, 0, "invalid frames: {:?}", board.trace.invalid_examples);
    assert_eq!(beyond_torque_limits(&board.telemetry), None);

    let report: serde_json::Value = expect(serde_json::from_slice(&expect(fs::read(report))));
    assert_eq!(report["unmodelled"]["count"], 0, "{report:#}");
    assert_eq!(report["resets"].as_array().map(Vec::len), Some(0), "{report:#}");
    assert_eq!(report["bank2"]["stale_reads"], 0, "{report:#}");

    // Power off and on: bank 2 is all that is left.
    assert_eq!(expect(fs::metadata(&bank)).len(), 1 << 20);
    let mut arm = system_tests::connect(&format!("board:world=simple,flash={}", bank.display()));
    let image = expect(taught().to_image());
    assert_eq!(stored(&mut arm), [(PRIMITIVE.to_owned(), stored_crc(&image))]);
    drop(arm);
    let mut blank = system_tests::connect("board:world=simple");
    assert_eq!(stored(&mut blank), []);

    let qemu = run("sim:seed=42");
    let (one, other) = (board.running(), qemu.running());
    assert!(one.len().abs_diff(other.len()) <= 1, "{} and {} cycles", one.len(), other.len());
    let apart = one.iter().zip(&other).map(|(one, other)| distance(&grasp_point(one), &grasp_point(other)));
    let farthest = apart.fold(0.0, f64::max);
    let end = distance(&board.grasp_point, &qemu.grasp_point);
    println!("apart: {:.3} mm at the most, {:.3} mm at the end", farthest * 1e3, end * 1e3);
    assert!(farthest <= 3e-3, "the movements are {:.2} mm apart", farthest * 1e3);
    assert!(end <= 1e-3, "the ends are {:.2} mm apart", end * 1e3);
    let phases = one.iter().zip(&other).map(|(one, other)| (one.phase - other.phase).abs()).fold(0.0, f32::max);
    assert!(phases < 1e-6, "phases {phases:e} apart");
}

#[test]
fn the_second_can_carries_the_link() {
    let mut arm = ready("board:seed=43,line=can");
    let execution = play(&mut arm, taught());
    assert_eq!((execution.statistics.missed_deadlines, execution.statistics.lost_replies), (0, 0));
    assert_eq!(execution.gaps, 0, "telemetry was lost on the way");
    assert!(execution.tracking.position_rms_m <= 5e-3, "{:?}", execution.tracking);
}

#[test]
fn the_command_takes_the_board_for_a_simulated_arm() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    let recorded =
        tactus(folder, &["--device", "board:world=simple", "--json", "record", "--duration", "0.5", "-o", "r.csv"]);
    let recorded = one_object(&recorded.success().get_output().stdout);
    assert_eq!((recorded["samples"].as_u64(), recorded["gaps"].as_u64()), (Some(150), Some(0)), "{recorded}");
    let served = tactus(
        folder,
        &["--device", "board:world=simple", "--json", "sim", "--duration", "0.3", "--fast", "--listen", "unix:a"],
    );
    let served = one_object(&served.success().get_output().stdout);
    assert!(served["simulated_s"].as_f64().is_some_and(|seconds| (0.3..0.4).contains(&seconds)), "{served}");
}

#[test]
fn what_the_board_cannot_take_is_refused_with_a_reason() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    let image = |variable: &str, path: &Path, device: &str| {
        let mut command = assert_cmd::Command::new(program());
        command.current_dir(folder).env(variable, path);
        command.args(["--device", device, "list"]).assert()
    };
    let qemu = built_image("arm.elf").expect("`cargo xtask build` leaves the image");
    let refused = stderr(&image("TACTUS_BOARD_IMAGE", &qemu, "board:").code(4));
    assert!(refused.contains("'mps2-an500'") && refused.contains("'nucleo-h743zi2'"), "{refused}");
    let nowhere = Path::new("nowhere");
    for variable in ["TACTUS_BOARD_IMAGE", "TACTUS_BOARD_EMULATOR"] {
        let missing = stderr(&image(variable, nowhere, "board:").code(3));
        assert!(missing.contains("nowhere") && missing.contains("cargo xtask board --build"), "{missing}");
    }
    // The first is not known here, the second not to the emulator.
    for device in ["board:speed=2", "board:fault=flood@5"] {
        let unknown = stderr(&tactus(folder, &["--device", device, "list"]).code(2));
        assert!(unknown.contains("speed=2") || unknown.contains("flood"), "{unknown}");
    }
    let chip = Device::open(&expect("board:".parse()), |options| options.flash = FlashSource::Chip(Default::default()));
    let error = chip.err().expect("its flash is inside").to_string();
    assert_eq!(error, SimulationError::FlashOfItsOwn.to_string());
}
