//! The hand image on its Cortex-M3 under QEMU: a hand alone on its bus, from power-up to a grip with the expected
//! force, and what it costs.

use std::time::Duration;

use control::{RATE_HZ, State};
use lab::error::{Capability, HostError};
use lab::image_file::ImageFile;
use lab::procedure;
use lab::simulation::{HAND_IMAGE_VARIABLE, built_image};
use link::image::{
    ExpectationMarks, FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity,
};
use link::{EventKind, HandStage, Name, Refusal, Request, RunOptions, Statistics, Telemetry};
use sim::BusTrace;
use system_tests::command::{one_object, stderr, stdout, tactus};
use system_tests::{Arm, boot, connect, expect, simulation, taught};

/// Name of the movement.
const GRIP: &str = "grip";

/// Kernels of the movement: the most there can be.
const KERNELS: usize = 100;

/// Expected gauge torque at the end, N m: the fingers press.
const EXPECTED: [f32; 3] = [-0.25, -0.28, -0.22];

/// Instructions of a control cycle, all three slots, that must not be exceeded: half a cycle of 72 MHz at one per
/// clock.
const BOUND: u32 = 120_000;

/// Instructions per tick of the image's clock: 125 million a second over 25 MHz.
const PER_TICK: u32 = 5;

/// A hand that closes in 4 s on more than there is room for, with feedback from its gauges.
fn image() -> Vec<u8> {
    let mut weights = vec![0.0; 13 * KERNELS];
    for digit in 0..4 {
        weights.extend((0..KERNELS).map(|i| 0.1 * (0.2 * i as f32 + digit as f32).sin()));
    }
    let columns = |count: usize, values: [f32; 3]| -> Vec<f32> {
        let mut row = vec![0.0; count - 3];
        row.extend(values);
        row
    };
    let (k1, k2) = (columns(10, [1000.0; 3]).repeat(32), columns(9, [1.0; 3]).repeat(32));
    let expected: Vec<f32> = (0..128)
        .flat_map(|i| {
            // Full from three quarters of the way on: the plan that gives way to it needs time as well.
            let pressed = (4.0 * (i as f32 / 127.0 - 0.5)).clamp(0.0, 1.0);
            columns(9, EXPECTED.map(|torque| pressed * torque))
        })
        .collect();
    let waypoint = |hand: [f32; 4]| Waypoint {
        position: [0.4, 0.0, 0.2],
        orientation: [1.0, 0.0, 0.0, 0.0],
        posture: [0.1; 7],
        hand,
    };
    let content = ImageContent {
        model_hash: control::MODEL_HASH,
        duration: 4.0,
        alpha: 4.605_170_2,
        activation: 0.7,
        stiffness: [200.0; 4],
        damping: [28.284_271; 4],
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: waypoint([0.0; 4]),
        start_velocity: WaypointVelocity::default(),
        goal: waypoint([0.3, 1.6, 1.6, 1.6]),
        clamps: FeedbackClamps { position: 0.2, orientation: 0.5, hand: 0.8 },
        marks: ExpectationMarks {
            recorded_duration: 4.0,
            filter_cutoff: 15.0,
            trials: 5.0,
            ..ExpectationMarks::default()
        },
        statistics_trials: 0,
        kernels: KERNELS,
        k1: &k1[..],
        k2: &k2[..],
        weights: &weights[..],
        expected_mean: &expected[..],
        statistics_mean: &[][..],
        statistics_spread: &[][..],
    };
    let mut bytes = vec![0; 30_000];
    let length = expect(content.encode(&name(), &mut bytes));
    bytes.truncate(length);
    bytes
}

fn name() -> Name {
    expect(Name::new(GRIP))
}

/// A run with the options of a mode, from power-up to a second behind its end.
struct Grip {
    telemetry: Vec<Telemetry>,
    statistics: Statistics,
    trace: BusTrace,
    ticks: u64,
    stages: Vec<HandStage>,
}

fn begin(address: &str) -> (Arm, Vec<HandStage>) {
    let mut hand = connect(address);
    assert_eq!(hand.hello().board.as_str(), "mps2-an385");
    let mut stages = vec![expect(hand.status()).hand_stage];
    expect(procedure::make_ready(&mut hand, false, |_| {}));
    stages.push(expect(hand.status()).hand_stage);
    expect(hand.upload(&image(), |_, _, _| {}));
    (hand, stages)
}

fn take_grip(address: &str, options: RunOptions) -> Grip {
    let (mut hand, stages) = begin(address);
    expect(hand.run(&name(), options));
    let mut telemetry = Vec::new();
    for cycle in expect(hand.telemetry(1)).take(5 * RATE_HZ as usize) {
        telemetry.push(expect(cycle));
    }
    let statistics = expect(hand.statistics());
    let simulation = simulation(hand.transport());
    let (trace, ticks) = (simulation.plant().trace(), simulation.ticks());
    Grip { telemetry, statistics, trace, ticks, stages }
}

fn adapt() -> RunOptions {
    RunOptions { feedback: true, force_control: true, ..RunOptions::default() }
}

/// Largest difference of measured and expected gauge torque over the last half second, N m.
fn force_error(grip: &Grip) -> f32 {
    let last = &grip.telemetry[grip.telemetry.len() - 150..];
    let errors =
        last.iter().flat_map(|cycle| (0..3).map(move |finger| (cycle.gauges[finger] - EXPECTED[finger]).abs()));
    errors.fold(0.0, f32::max)
}

#[test]
fn hand_image_grips_with_the_expected_force_within_half_of_a_72_mhz_cycle() {
    let grip = take_grip("hand:seed=31", adapt());
    assert_eq!(grip.stages, [HandStage::Absent, HandStage::Ready]);
    let last = grip.telemetry.last().expect("telemetry");
    assert_eq!((State::from_code(last.state), last.fault), (Some(State::Hold), 0), "it holds what it gripped");
    assert!(grip.telemetry.windows(2).all(|pair| pair[1].cycle == pair[0].cycle + 1), "a cycle is missing");
    let Statistics { cost_worst_ticks, cost_mean_ticks, missed_deadlines, latency_worst_ticks, .. } = grip.statistics;
    let worst = cost_worst_ticks * PER_TICK;
    let Statistics { stack_free, stack_size, .. } = grip.statistics;
    println!("control cycle, worst      {worst:>8} instructions (bound {BOUND})");
    println!("control cycle, mean       {:>8} instructions", cost_mean_ticks * PER_TICK);
    println!(
        "share of a 72 MHz cycle   {:>8.1} % at 1.0 clocks per instruction, {:.1} % at 1.5",
        share(worst, 1.0),
        share(worst, 1.5)
    );
    println!("control cycles            {:>8}", grip.statistics.cycles);
    println!("missed deadlines          {missed_deadlines:>8}");
    println!("slot latency, worst       {:>8.2} us", f64::from(latency_worst_ticks) / 25.0);
    println!("stack, deepest use        {:>8} B of {stack_size}", stack_size - stack_free);
    println!("bus load                  {:>8.1} %", 100.0 * grip.trace.load(grip.ticks));
    assert!(worst > 1000, "the image did not measure its cycles");
    assert!(worst < BOUND, "a control cycle takes {worst} instructions");
    assert_eq!((missed_deadlines, grip.statistics.hand_lost_replies), (0, 0));
    assert_eq!(grip.trace.invalid, 0, "{:?}", grip.trace.invalid_examples);
    let blind = take_grip("hand:seed=31", RunOptions::default());
    let (adapting, without) = (force_error(&grip), force_error(&blind));
    println!("force error at the end    {adapting:>8.3} N m with feedback and force control, {without:.3} without");
    assert!(adapting < 0.05 && adapting < 0.5 * without, "the force is not tracked: {adapting} N m, {without} without");
}

/// Instructions as a share of a control cycle of a 72 MHz part, percent.
fn share(instructions: u32, clocks: f64) -> f64 {
    100.0 * f64::from(instructions) * clocks / (72e6 / control::RATE)
}

#[test]
fn hand_runs_are_equal_bit_by_bit_for_equal_seeds() {
    let (once, again) = (take_grip("hand:seed=32", adapt()), take_grip("hand:seed=32", adapt()));
    println!("hand: with one seed: {:016x} and {:016x}", once.trace.hash, again.trace.hash);
    assert_eq!(once.trace.hash, again.trace.hash, "other frames, or other times of frames");
    assert!(once.telemetry == again.telemetry, "other telemetry");
    assert_eq!(once.statistics, again.statistics);
    assert_ne!(once.trace.hash, take_grip("hand:seed=33", adapt()).trace.hash, "the seed does nothing");
}

#[test]
fn hand_run_stops_on_command_and_lets_the_worms_hold() {
    let (mut hand, _) = begin("hand:seed=34");
    expect(hand.run(&name(), adapt()));
    let running: Vec<_> = expect(hand.telemetry(1)).take(3 * RATE_HZ as usize).map(expect).collect();
    assert_eq!(running.last().and_then(|cycle| State::from_code(cycle.state)), Some(State::Run));
    expect(hand.stop());
    let stopped: Vec<_> = expect(hand.telemetry(1)).take(RATE_HZ as usize).map(expect).collect();
    let (first, last) = (stopped[RATE_HZ as usize / 10], stopped[RATE_HZ as usize - 1]);
    assert_eq!(State::from_code(last.state), Some(State::SoftStop));
    assert_eq!(last.tau, [0.0; 7]);
    assert!(first.hand.iter().zip(last.hand).all(|(then, now)| (then - now).abs() < 0.01), "the worms hold");
}

#[test]
fn hand_device_refuses_what_needs_an_arm() {
    let (mut hand, _) = begin("hand:seed=35");
    for request in
        [Request::Gravity, Request::Zero { home: [0.0; 7] }, Request::Approach { q: [0.0; 7], duration: 1.0 }]
    {
        match hand.request(&request) {
            Err(HostError::Refused { reason, .. }) => assert_eq!(reason, Refusal::NoArm),
            other => panic!("{other:?}"),
        }
    }
    let missing = hand.require(Capability::Arm).unwrap_err();
    assert_eq!(missing.to_string(), "the device does not drive an arm");
    assert_eq!((hand.require(Capability::Hand).is_ok(), hand.hello().capabilities.wrench), (true, false));
    let listing = expect(hand.list());
    assert_eq!(listing.len(), 1);
    assert!(listing[0].expectation && listing[0].kernels == KERNELS as u16);
    hand.take_events();
    expect(hand.delete(&name()));
    let told = hand.take_events().iter().any(|event| event.kind == EventKind::Store);
    assert!(told || expect(hand.list()).is_empty());
    assert!(expect(hand.list()).is_empty());
}

#[test]
fn hand_run_reports_its_fingers_and_no_tool() {
    let folder = expect(tempfile::tempdir());
    let folder = folder.path();
    let mut file = taught().clone();
    file.start.hand = [0.0; 4];
    file.goal.hand = [0.3, 0.8, 0.7, 0.6];
    expect(file.write(&folder.join("primitive.toml")));
    let device = ["--device", "hand:seed=37,world=empty"];
    let run = tactus(folder, &[&["--json"], &device[..], &["run", "primitive.toml"]].concat()).success();
    let report = one_object(&run.get_output().stdout);
    assert!(report.get("tracking").is_none(), "{report}");
    let figures = |name: &str| -> Vec<f64> {
        let digits = report["hand_tracking"][name].as_array().expect("four digits");
        digits.iter().map(|digit| digit.as_f64().expect("a number")).collect()
    };
    let (rms, worst) = (figures("rms_rad"), figures("max_rad"));
    println!("fingers against their plan {rms:.4?} rad RMS, {worst:.4?} worst");
    assert!(rms.len() == 4 && rms.iter().all(|error| (1e-6..0.05).contains(error)), "{report}");
    assert!(rms.iter().zip(&worst).all(|(rms, worst)| rms <= worst && *worst < 0.15), "{report}");
    let seconds = report["duration_s"].as_f64().expect("a duration");
    assert!(seconds >= file.movement.duration, "{seconds} s of a movement of {} s", file.movement.duration);
    let run = tactus(folder, &[&device[..], &["run", "primitive.toml"]].concat()).success();
    let text = stdout(&run);
    assert!(text.contains("fingers") && !text.contains(" mm") && !text.contains(" deg"), "{text}");
}

#[test]
fn hand_image_says_in_its_file_what_it_says_when_it_runs_and_is_not_flashed() {
    let path = match std::env::var_os(HAND_IMAGE_VARIABLE) {
        Some(path) => std::path::PathBuf::from(path),
        None => built_image("hand.elf").expect("`cargo xtask build --image hand` leaves the image"),
    };
    let image = ImageFile::read(&path).unwrap_or_else(|error| panic!("{error}"));
    let hand = connect("hand:seed=38");
    let (file, device) = (&image.description, hand.hello());
    assert_eq!((device.board.as_str(), device.firmware.as_str()), (file.board.as_str(), file.firmware.as_str()));
    assert_eq!((device.link_version, device.schema_hash), (file.link_version, file.schema_hash));
    assert_eq!((device.model_hash, device.simulated), (file.model_hash, file.simulated));
    assert!(image.writes.iter().all(|write| file.image.contains(write.start, write.length)), "{image:?}");
    let path = path.display().to_string();
    let refused = tactus(std::path::Path::new("."), &["flash", "--dry-run", "--image", &path]).code(6);
    assert!(stderr(&refused).contains("mps2-an385") && stderr(&refused).contains("E682"), "{}", stderr(&refused));
}

#[test]
fn nothing_moves_on_the_hand_bus_before_a_persons_word() {
    let mut hand = expect(lab::client::Client::connect(boot("hand:seed=36"), "system test"));
    let until = hand.now() + Duration::from_secs(4);
    while hand.now() < until {
        expect(hand.next(Duration::from_millis(100)));
    }
    assert_eq!(expect(hand.status()).hand_stage, HandStage::NotInitialised);
    let plant = simulation(hand.transport()).plant();
    // The zero torques with which every image begins, and nothing after them.
    let torques = system_tests::bus::torques(plant.recorded());
    assert!(torques.len() == 1 && torques.iter().all(|(_, units)| *units == [0; 4]), "{torques:?}");
}
