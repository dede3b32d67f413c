//! An arm whose home is not the model's: wrong by that in every angle until it is calibrated, right for ever
//! afterwards.

use control::State;
use device::Stage;
use flash::{Flash, FlashChip, FlashTimes};
use lab::client::Client;
use lab::device::Device;
use lab::error::HostError;
use lab::procedure;
use lab::settings::{KeptWeight, Settings, WriteError};
use lab::simulation::FlashSource;
use link::{HomeSource, Refusal};
use system_tests::{Arm, command, expect, simulation};

/// Distance of this arm's home from the model's, rad: two to six degrees.
const BESIDE: [f64; 7] = [0.06, 0.09, -0.05, -0.08, 0.1, 0.04, -0.07];

/// Largest error of zeroing, rad: a motor's count is at most 0.11 mrad of a joint, J5 and J6 hang on two motors, and
/// two zeroings are compared.
const COUNTS: f64 = 3e-4;

/// An arm that stands at its own home, whose device has this flash; zeroed, torque off.
fn zeroed(address: &str, flash: &FlashChip) -> (Arm, procedure::Readiness) {
    let device = expect(Device::open(&expect(address.parse()), |options| {
        for (angle, beside) in options.posture.iter_mut().zip(BESIDE) {
            *angle += beside;
        }
        options.flash = FlashSource::Chip(flash.clone());
    }));
    let mut arm = expect(Client::connect(device, "system test"));
    let readiness = expect(procedure::start_up(&mut arm, false, Stage::WaitingForActive, |_| {}));
    (arm, readiness)
}

fn truth(arm: &mut Arm) -> [f64; 7] {
    simulation(arm.transport()).world().joint_positions()
}

/// Reported minus true joint angles, and the sag while they are measured, rad: brakes hold it, but not quite.
fn errors(arm: &mut Arm) -> ([f64; 7], [f64; 7]) {
    let before = truth(arm);
    let read = expect(procedure::correct_home(arm, before)).read;
    let after = truth(arm);
    let errors = std::array::from_fn(|joint| read[joint] - 0.5 * (before[joint] + after[joint]));
    (errors, std::array::from_fn(|joint| after[joint] - before[joint]))
}

#[test]
fn an_arm_calibrated_where_it_truly_stands_is_right_after_the_next_start() {
    for address in ["sil:world=simple", "sim:world=simple"] {
        let flash = FlashChip::new(Flash::blank(FlashTimes::TYPICAL));
        let (mut arm, readiness) = zeroed(address, &flash);
        assert_eq!(readiness.zeroed_at, Some(HomeSource::Model));
        // Without a calibration every joint is wrong by what its home is beside the model's.
        let (before, sinking) = errors(&mut arm);
        for (joint, (error, beside)) in before.iter().zip(BESIDE).enumerate() {
            assert!((error + beside).abs() < COUNTS, "J{}: {error} rad, not {}", joint + 1, -beside);
        }
        // Where it will be in the middle of the measurement.
        let mut posture = truth(&mut arm);
        posture.iter_mut().zip(sinking).for_each(|(angle, sinking)| *angle += 0.5 * sinking);
        let correction = expect(procedure::correct_home(&mut arm, posture));
        expect(arm.calibrate(correction.home));
        let calibration = expect(arm.calibration());
        assert_eq!((calibration.source, calibration.home), (HomeSource::Stored, correction.home));
        assert_eq!(calibration.zeroed_at, Some(control::model::HOME.map(|angle| angle as f32)));
        // The same measurement once more is no second correction.
        let again = expect(procedure::correct_home(&mut arm, posture));
        let twice = again.home.iter().zip(correction.home).map(|(again, home)| f64::from(again - home).abs());
        assert!(twice.fold(0.0, f64::max) < 5.0 * COUNTS, "{again:?} after {correction:?}");
        drop(arm);

        let (mut arm, readiness) = zeroed(address, &flash);
        assert_eq!(readiness.zeroed_at, Some(HomeSource::Stored));
        let (after, _) = errors(&mut arm);
        let worst = |errors: [f64; 7]| errors.into_iter().fold(0.0, |worst: f64, error| worst.max(error.abs()));
        println!("{address}: wrong by up to {:.4} rad before, {:.5} rad after", worst(before), worst(after));
        assert!(worst(after) < COUNTS, "{after:?}");

        expect(arm.forget_calibration());
        drop(arm);
        let (mut arm, readiness) = zeroed(address, &flash);
        assert_eq!(readiness.zeroed_at, Some(HomeSource::Model));
        assert!(worst(errors(&mut arm).0) > 0.09, "a forgotten home still counts");
    }
}

#[test]
fn a_home_is_not_changed_under_torque_nor_to_one_the_arm_cannot_have() {
    let flash = FlashChip::new(Flash::blank(FlashTimes::NONE));
    let (mut arm, _) = zeroed("sil:world=simple", &flash);
    let home = control::model::HOME.map(|angle| angle as f32);
    let mut far = home;
    far[5] = 0.4;
    let refused = |result: Result<(), HostError>| match result {
        Err(HostError::Refused { reason, detail, .. }) => (reason, detail),
        other => panic!("{other:?}"),
    };
    assert_eq!(refused(arm.calibrate(far)), (Refusal::HomeImplausible, [5, 2]));
    expect(procedure::start_up(&mut arm, false, Stage::Ready, |_| {}));
    expect(arm.hold());
    assert_eq!(refused(arm.calibrate(home)), (Refusal::HasTorque, [State::Hold.code().into(), 0]));
    assert_eq!(refused(arm.forget_calibration()).0, Refusal::HasTorque);
    assert_eq!(expect(arm.calibration()).source, HomeSource::Model);
    // Of settings that are half refused the other half is not written.
    let weight = Some(KeptWeight { hand: true, links: [[0.01, 0.0, 0.0, 0.0]; 7] });
    let written = Settings { home: Some(home), weight }.write(&mut arm);
    let reason = match written {
        Err(WriteError::Device(HostError::Refused { reason, .. })) => Some(reason),
        _ => None,
    };
    assert_eq!(reason, Some(Refusal::HasTorque), "{written:?}");
    assert_eq!(expect(Settings::of_device(&mut arm)), Settings::default());
}

#[test]
fn cli_15_the_command_calibrates_an_arm_and_the_next_process_finds_its_home() {
    let folder = expect(tempfile::tempdir());
    let run = |arguments: &[&str]| {
        let all = [&["--json", "--device", "sil:world=simple,flash=arm.flash", "calibrate"], arguments].concat();
        command::one_object(&command::tactus(folder.path(), &all).success().get_output().stdout)
    };
    assert_eq!(run(&["show"])["stored"], false);
    let corrected = run(&["home", "--here", "0.02,-1.97,0.01,3.1,0,0.03,-0.05"]);
    let home = |object: &serde_json::Value, joint: usize| object["home_rad"][joint].as_f64().expect("an angle");
    assert!((home(&corrected, 3) - 3.1).abs() < COUNTS && (home(&corrected, 6) + 0.05).abs() < COUNTS);
    let shown = run(&["show"]);
    assert_eq!((&shown["stored"], &shown["home_rad"]), (&serde_json::Value::from(true), &corrected["home_rad"]));
    assert_eq!(run(&["forget"])["stored"], false);
    assert_eq!(run(&["show"])["stored"], false);
    // Degrees instead of radians: refused by the device, with the joint and what to do.
    let all = ["--device", "sil:world=simple", "calibrate", "home", "--set", "0,-114.6,0,179.3,0,0,0"];
    let failed = command::tactus(folder.path(), &all).code(5);
    let words = String::from_utf8_lossy(&failed.get_output().stderr).into_owned();
    assert!(
        words.starts_with("error[E545]: calibrate: ") && words.contains("J2") && words.contains("in rad"),
        "{words}"
    );
}
