//! The spine: shown by hand, recorded, learned, checked, uploaded, played; the firmware under QEMU at both ends.

use std::path::Path;

use control::act::limit::MOTOR_COUNTS_LIMIT;
use lab::demonstration::Recording;
use lab::primitive_file::PrimitiveFile;
use system_tests::bus::torques;
use system_tests::command::{one_object, tactus};
use system_tests::execution::{beyond_torque_limits, play};
use system_tests::{expect, ready, simulation};

/// Largest lean of the flashlight after the run: it still stands.
const UPRIGHT: f64 = 2.0;

/// Every sample came over the link, one a cycle, while the arm was weightless.
fn assert_is_whole(demonstration: &Recording) {
    assert_eq!((demonstration.gaps, demonstration.missing_samples), (0, 0));
    let cycles = demonstration.cycle.as_ref().expect("a recording has cycles");
    assert!(cycles.windows(2).all(|pair| pair[1] == pair[0] + 1), "a cycle is missing");
    let states = demonstration.state.as_ref().expect("a recording has states");
    assert!(states.iter().all(|state| state == "gravity"), "not weightless all the time");
    // Single precision on the wire: what the world knows has more digits.
    let q = demonstration.q.as_ref().expect("a recording has joint angles");
    let is_single = |angle: &f64| (*angle as f32).to_string() == angle.to_string();
    assert!(q.iter().flatten().all(is_single), "angles with more digits than telemetry carries");
}

#[test]
fn what_a_person_shows_the_arm_does() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    let run = |arguments: &[&str]| one_object(&tactus(folder, arguments).success().get_output().stdout);

    let taught = run(&["--device", "sim:seed=3", "--json", "teach", "--teacher", "5", "-o", "demo.csv"]);
    assert_eq!(taught["gaps"], 0);
    let demonstration = expect(Recording::read(&folder.join("demo.csv")));
    assert_eq!(taught["samples"], demonstration.len());
    assert_is_whole(&demonstration);

    let learned = run(&["--json", "learn", "demo.csv", "--name", "shown", "-o", "shown.toml"]);
    let checked = run(&["--json", "check", "shown.toml"]);
    assert_eq!(checked["violations"].as_array().map(Vec::len), Some(0), "{checked}");
    assert_eq!(learned["checksum"], checked["checksum"]);
    let file = expect(PrimitiveFile::read(&folder.join("shown.toml")));
    assert_eq!(
        file.provenance.as_ref().map(|from| from.demonstration_checksum),
        Some(demonstration.checksum),
        "the primitive must name the recording it was learned from"
    );

    let mut arm = ready("sim:seed=4");
    let execution = play(&mut arm, &file);
    let tracking = &execution.tracking;
    let (mm, degrees) = (|metres: f64| metres * 1e3, |angle: f64| angle.to_degrees());
    println!(
        "tracking {:.2} mm {:.2} deg RMS, {:.2} mm {:.2} deg worst, {:.2} mm {:.2} deg at the goal, bus hash {:016x}",
        mm(tracking.position_rms_m),
        degrees(tracking.orientation_rms_rad),
        mm(tracking.position_max_m),
        degrees(tracking.orientation_max_rad),
        mm(tracking.position_end_m),
        degrees(tracking.orientation_end_rad),
        execution.trace.hash,
    );
    assert!(mm(tracking.position_rms_m) <= 5.0 && degrees(tracking.orientation_rms_rad) <= 1.5, "{tracking:?}");
    assert!(mm(tracking.position_end_m) <= 3.0 && degrees(tracking.orientation_end_rad) <= 1.0, "{tracking:?}");
    assert!(
        tracking.samples as f64 >= file.movement.duration * control::RATE,
        "only {} samples of the run",
        tracking.samples
    );

    assert_eq!((execution.gaps, execution.recording.missing_samples), (0, 0));
    assert_eq!(execution.statistics.missed_deadlines, 0);
    assert_eq!((execution.statistics.lost_replies, execution.statistics.torque_mismatches), (0, 0));
    assert_eq!(beyond_torque_limits(&execution.telemetry), None);
    assert_eq!(execution.trace.invalid, 0, "invalid frames: {:?}", execution.trace.invalid_examples);

    let simulation = simulation(arm.transport());
    let sent = torques(simulation.plant().recorded());
    assert!(
        sent.len() as f64 > 2.0 * file.movement.duration * control::RATE,
        "two torque frames a cycle: {}",
        sent.len()
    );
    let largest = sent.iter().flat_map(|(_, units)| units).map(|units| units.unsigned_abs()).max();
    println!("largest torque on the bus: {largest:?} counts");
    assert!(largest.is_some_and(|largest| largest > 0 && f64::from(largest) <= MOTOR_COUNTS_LIMIT));
    let tilt = simulation.flashlight_tilt().expect("the MuJoCo world has a flashlight; `cargo xtask test` builds it");
    println!("flashlight tilt: {:.3} deg", tilt.to_degrees());
    assert!(tilt.to_degrees() < UPRIGHT, "the flashlight leans {:.1} degrees", tilt.to_degrees());

    // The hand went where it was shown: the plan is no other movement.
    let shown = demonstration.position.as_ref().and_then(|path| path.last()).expect("a path");
    let error = system_tests::execution::distance(shown, &execution.grasp_point);
    println!("beside the shown end: {:.2} mm ({})", error * 1e3, Path::new("demo.csv").display());
    assert!(error < 8e-3, "the hand ended {:.1} mm beside where it was shown", error * 1e3);
}
