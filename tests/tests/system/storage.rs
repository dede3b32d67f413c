//! The library under the firmware's own flash: an upload in the middle of a run, a restart, and a power failure.

use std::time::Duration;

use control::model::{ArmModel, Frames};
use control::units::JointPositions;
use control::{Payload, State};
use device::Stage;
use flash::{Flash, FlashChip, FlashTimes};
use lab::client::{Client, Incoming};
use lab::device::Device;
use lab::simulation::FlashSource;
use link::image::{
    FeedbackClamps, Hemisphere, IMAGE_BYTES_LIMIT, ImageContent, KERNEL_LIMIT, OrientationError, Waypoint,
    WaypointVelocity,
};
use link::message::RunOptions;
use link::{Name, Telemetry};
use system_tests::bus::{arm_torques, torque_jitter};
use system_tests::{Arm, command, expect, simulation};

/// A straight movement of the forearm that takes `duration` seconds, in as many kernels as a device takes.
fn image(name: &str, duration: f32) -> Vec<u8> {
    let weights = vec![0.0; 17 * KERNEL_LIMIT];
    let start = [0.0, 0.5, 0.0, 1.5, 0.0, 0.5, 0.0];
    let mut content: ImageContent<&[f32]> = ImageContent {
        model_hash: control::MODEL_HASH,
        duration,
        alpha: 4.605,
        activation: 0.7,
        stiffness: [200.0; 4],
        damping: [28.28, 20.0, 28.28, 28.28],
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Demonstrated,
        start: waypoint(start),
        start_velocity: WaypointVelocity::default(),
        goal: waypoint([0.2, 0.5, 0.0, 1.4, 0.0, 0.5, 0.0]),
        clamps: FeedbackClamps { position: 0.2, orientation: 0.5, hand: 0.5 },
        marks: Default::default(),
        kernels: KERNEL_LIMIT,
        k1: &[],
        k2: &[],
        weights: &weights,
        expected_mean: &[],
        statistics_trials: 0,
        statistics_mean: &[],
        statistics_spread: &[],
    };
    // The same rotation has two signs; a demonstration would have kept the one of its start.
    let dot: f32 = content.start.orientation.iter().zip(content.goal.orientation).map(|(a, b)| a * b).sum();
    content.goal.orientation = content.goal.orientation.map(|part| part * dot.signum());
    let mut bytes = vec![0; IMAGE_BYTES_LIMIT];
    let length = expect(content.encode(&name_of(name), &mut bytes));
    bytes.truncate(length);
    bytes
}

fn waypoint(posture: [f32; 7]) -> Waypoint {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let [x, y, z, w, i, j, k] = Frames::new(&model, &JointPositions::from_array(posture)).tool_pose().to_f32();
    Waypoint { position: [x, y, z], orientation: [w, i, j, k], posture, hand: [0.0; 4] }
}

fn name_of(name: &str) -> Name {
    name.parse().expect("a name of the link")
}

/// An arm at this address whose device has this flash.
fn connect(address: &str, flash: &FlashChip) -> Arm {
    let mut device =
        expect(Device::open(&expect(address.parse()), |options| options.flash = FlashSource::Chip(flash.clone())));
    simulation(&mut device).plant().record_bus();
    expect(Client::connect(device, "system test"))
}

fn upload(arm: &mut Arm, image: &[u8]) {
    expect(arm.upload(image, |_, _, _| {}));
}

fn names(arm: &mut Arm) -> Vec<String> {
    expect(arm.list()).into_iter().map(|listing| listing.name.as_str().to_owned()).collect()
}

/// Content of a flash that holds `images` and a "filler" and has been written all around, so that the next upload must
/// copy images and erase a sector before it can be durable.
fn crowded(images: &[Vec<u8>]) -> Vec<u8> {
    let chip = FlashChip::new(Flash::blank(FlashTimes::NONE));
    let mut arm = connect("sil:world=simple", &chip);
    images.iter().for_each(|image| upload(&mut arm, image));
    loop {
        let before = chip.lock().content().to_vec();
        // Another image every time: the same one again would not be sent.
        let number = chip.lock().operations();
        upload(&mut arm, &self::image("filler", 1.0 + (number % 1000) as f32 * 0.01));
        if chip.lock().erases().iter().sum::<u32>() > 0 {
            return before;
        }
    }
}

/// Lets time pass until `end`, and keeps the control cycles the device tells of.
fn watch_until(arm: &mut Arm, end: Duration) -> Vec<Telemetry> {
    let mut cycles = Vec::new();
    while arm.now() < end {
        if let Some(Incoming::Telemetry(cycle)) = expect(arm.next(Duration::from_millis(50))) {
            cycles.push(cycle);
        }
    }
    cycles
}

/// Brings the arm of the simple world to the start of the movements here.
fn to_the_start(arm: &mut Arm) {
    let deadline = arm.now() + Duration::from_secs(30);
    let mut zeroed = false;
    while Stage::from_code(expect(arm.status()).startup_stage) != Some(Stage::Ready) {
        assert!(arm.now() < deadline, "the start-up hangs");
        if !zeroed && Stage::from_code(expect(arm.status()).startup_stage) == Some(Stage::WaitingForZero) {
            expect(arm.zero(control::model::HOME.map(|angle| angle as f32)));
            zeroed = true;
        }
        expect(arm.next(Duration::from_millis(50)));
    }
    // The operator lets go of the arm, whose wrist sinks onto its stop.
    let rest = arm.now() + Duration::from_secs(8);
    watch_until(arm, rest);
    expect(arm.hold());
    expect(arm.approach([0.0, 0.5, 0.0, 1.5, 0.0, 0.5, 0.0], 4.0));
    let deadline = arm.now() + Duration::from_secs(30);
    while expect(arm.status()).state != State::Hold.code() {
        assert!(arm.now() < deadline, "the arm does not arrive");
        expect(arm.next(Duration::from_millis(50)));
    }
}

#[test]
fn an_upload_with_an_erase_during_a_run_delays_no_control_cycle() {
    let kept = [image("long", 30.0), image("other", 4.0)];
    // Every sector takes 4 s here, the longest the data sheet knows.
    let chip = FlashChip::new(Flash::with_content(crowded(&kept), FlashTimes::SLOW));
    let mut arm = connect("sim:world=simple", &chip);
    to_the_start(&mut arm);
    // Every third cycle, which the line carries beside the upload. With every cycle (about 66 of its 92 kB/s) it is
    // full while the image is read back, and telemetry gives way to answers, erase or no erase: the second upload below
    // tells how often.
    expect(arm.set_telemetry(3));
    expect(arm.run(&name_of("long"), RunOptions { feedback: false, ..RunOptions::default() }));
    let quiet_from = simulation(arm.transport()).ticks();
    let quiet_end = arm.now() + Duration::from_secs(5);
    let quiet = watch_until(&mut arm, quiet_end);
    let before = expect(arm.statistics());
    let busy_from = simulation(arm.transport()).ticks();
    let started = arm.now();
    upload(&mut arm, &image("new", 6.0));
    let took = arm.now() - started;
    let busy_until = simulation(arm.transport()).ticks();
    let busy = watch_until(&mut arm, started + took + Duration::from_millis(20));
    let after = expect(arm.statistics());
    assert_eq!(arm.gaps().telemetry, 0, "cycles are missing in the telemetry");
    let erases: u32 = chip.lock().erases().iter().sum();
    expect(arm.set_telemetry(1));
    upload(&mut arm, &image("new", 7.0));
    let crowded_line = expect(arm.statistics());
    let status = expect(arm.status());
    let more_erases = chip.lock().erases().iter().sum::<u32>() - erases;
    let (quiet_jitter, busy_jitter) = (
        torque_jitter(&arm_torques(&mut arm, quiet_from, busy_from)),
        torque_jitter(&arm_torques(&mut arm, busy_from, busy_until)),
    );
    let micro = |ticks: u64| ticks as f64 / 25.0;
    println!("upload took {:.3} s of virtual time, with {erases} erases of 4 s", took.as_secs_f64());
    println!(
        "interrupt latency, worst: {:.2} us before, {:.2} us with the upload",
        micro(before.latency_worst_ticks.into()),
        micro(after.latency_worst_ticks.into())
    );
    println!(
        "control slot, worst: {:.1} us before, {:.1} us with the upload",
        micro(before.cost_worst_ticks.into()),
        micro(after.cost_worst_ticks.into())
    );
    println!("torque frames wander by {:.1} us before, {:.1} us during it", micro(quiet_jitter), micro(busy_jitter));
    println!(
        "stack: {} of {} B used; telemetry: {} cycles before, {} heard during it",
        after.stack_size - after.stack_free,
        after.stack_size,
        quiet.len(),
        busy.len()
    );
    println!(
        "with telemetry of every cycle and {more_erases} erases an upload costs {} cycles of it",
        crowded_line.telemetry_dropped - after.telemetry_dropped
    );

    assert!(erases >= 1, "no sector was erased: the test shows nothing");
    assert!(took > Duration::from_secs(4), "the upload was accepted before its sector was erased");
    assert_eq!((status.state, status.fault), (State::Run.code(), 0), "the run went on");
    assert_eq!(crowded_line.missed_deadlines, 0);
    assert_eq!(crowded_line.lost_replies, before.lost_replies);
    assert_eq!(after.telemetry_dropped, before.telemetry_dropped, "telemetry was dropped");
    // The primitive of the run was taken over before it, under the lock of the control half: a copy of 23 kB, 53 us.
    // Checking it there took 20 us more, and building the first one beside its place 270.
    assert!(
        before.latency_worst_ticks <= 75 * 25,
        "loading a primitive is more than a copy: {}",
        before.latency_worst_ticks
    );
    // One microsecond is five instructions of a critical section; a flash that stalls the processor costs milliseconds.
    assert!(after.latency_worst_ticks <= before.latency_worst_ticks + 100, "the control slot began late");
    assert!(busy_jitter <= quiet_jitter + 150, "torques left late: {busy_jitter} ticks, {quiet_jitter} without");
    assert_eq!(names(&mut arm), ["long", "other", "filler", "new"]);
}

#[test]
fn a_restart_under_qemu_finds_the_library_again_and_what_was_deleted_is_gone() {
    let chip = FlashChip::new(Flash::blank(FlashTimes::TYPICAL));
    let mut arm = connect("sim:world=simple", &chip);
    upload(&mut arm, &image("one", 3.0));
    upload(&mut arm, &image("two", 4.0));
    expect(arm.delete(&name_of("one")));
    drop(arm);
    let mut arm = connect("sim:world=simple", &chip);
    assert_eq!(names(&mut arm), ["two"]);
    // The very same bytes: the device says so itself, and nothing is sent.
    let again = expect(arm.upload(&image("two", 4.0), |_, _, _| {}));
    assert!(matches!(again, lab::client::UploadOutcome::AlreadyThere(_)), "{again:?}");
}

#[test]
fn cli_4_power_that_fails_under_qemu_leaves_the_old_primitive_or_the_new_one() {
    let (old, new) = (image("reach", 3.0), image("reach", 5.0));
    let chip = FlashChip::new(Flash::blank(FlashTimes::TYPICAL));
    let mut arm = connect("sim:world=simple", &chip);
    upload(&mut arm, &old);
    drop(arm);
    let content = chip.lock().content().to_vec();
    // The host's tests cut at every operation; here the same happens a few times to the image itself.
    for (operation, expected) in [(0, 3.0), (100, 3.0), (150, 3.0), (u64::MAX, 5.0)] {
        let chip = FlashChip::new(Flash::with_content(content.clone(), FlashTimes::TYPICAL));
        let mut arm = connect("sim:world=simple", &chip);
        if operation < u64::MAX {
            chip.lock().cut_power_at(operation, operation);
        }
        let outcome = arm.upload(&new, |_, _, _| {});
        assert_eq!(outcome.is_err(), operation < u64::MAX, "{outcome:?}");
        drop(arm);
        chip.lock().restart();
        let mut arm = connect("sim:world=simple", &chip);
        let found = expect(arm.list());
        let durations: Vec<f32> = found.iter().map(|listing| listing.duration).collect();
        assert_eq!(durations, [expected], "cut in operation {operation}");
    }
}

#[test]
fn power_that_fails_on_the_emulated_board_leaves_the_old_primitive_or_the_new_one() {
    let (old, new) = (image("reach", 3.0), image("reach", 5.0));
    let folder = expect(tempfile::tempdir());
    let bank = |name: &str| folder.path().join(name);
    let board = |name: &str, fault: &str| {
        system_tests::connect(&format!("board:world=simple,flash={}{fault}", bank(name).display()))
    };
    upload(&mut board("before", ""), &old);
    // The same operations as under QEMU, here of the chip's own flash.
    for (cut, expected) in [(Some(0), 3.0), (Some(100), 3.0), (Some(150), 3.0), (None, 5.0)] {
        expect(std::fs::copy(bank("before"), bank("cut")));
        let fault = cut.map_or(String::new(), |operation: u32| format!(",fault=power-cut@0:{operation}"));
        let outcome = board("cut", &fault).upload(&new, |_, _, _| {});
        assert_eq!(outcome.is_err(), cut.is_some(), "{outcome:?}");
        let durations: Vec<f32> = expect(board("cut", "").list()).iter().map(|listing| listing.duration).collect();
        assert_eq!(durations, [expected], "cut in operation {cut:?}");
    }
}

#[test]
fn a_simulated_arm_with_a_flash_file_keeps_its_primitives() {
    let folder = expect(tempfile::tempdir());
    for engine in ["sil", "sim"] {
        let address = format!("{engine}:world=simple,flash={engine}.flash");
        let mut device = expect(Device::open(&expect(address.parse()), |options| {
            options.flash = FlashSource::File(folder.path().join(format!("{engine}.flash")));
        }));
        simulation(&mut device).plant().record_bus();
        let mut arm = expect(Client::connect(device, "system test"));
        upload(&mut arm, &image("kept", 3.0));
        drop(arm);
        let listed = command::tactus(folder.path(), &["--device", &address, "list"]).success();
        assert!(command::stdout(&listed).contains("kept"), "{}", command::stdout(&listed));
    }
}
