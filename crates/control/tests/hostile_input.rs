//! B1, E4: whatever comes in, every emitted torque is finite and within limits, and nothing panics.

use control::act::hand::TORQUE_LIMIT as HAND_LIMIT;
use control::act::limit::STEP_LIMIT;
use control::command::{AccelerationSource, Command, Goal, RunOptions};
use control::law::Gains;
use control::model::ArmModel;
use control::plan::load;
use control::plan::load::{End, LoadError};
use control::plan::primitive::{
    COUPLED_ROWS, Configuration, ExpectedWrench, Feedback, GainSchedule, MovementTables, ROWS, SENSORS, Velocity,
    configuration as rows, gains, limits,
};
use control::{BusSample, Calibration, Cycle, CycleInput, Event, Fault, HandSample, Payload, Refusal, State, flags};
use dmp::{Hemisphere, OrientationError};
use std::sync::LazyLock;

use pinned_init::InPlaceWrite;
use proptest::prelude::*;
use puck::{Action, CanFrame, Counts, GaugeStatus, RawWrench, Request, SafetyMode};

const KERNELS: usize = 10;
const POSTURE: [f64; 7] = [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75];

fn counts(q: [f64; 7]) -> [Option<Counts>; 7] {
    let calibration = Calibration::<f64>::nominal(Payload::SensorAndHand);
    let motor = calibration.transmission().motor_from_joint(&q);
    calibration.drives().counts(&motor).expect("finite").map(Some)
}

fn configuration(q: [f64; 7]) -> Configuration<f32> {
    let model = ArmModel::<f64>::new(Payload::SensorAndHand);
    let pose = control::model::Frames::new(&model, &control::units::JointPositions::from_array(q)).tool_pose();
    let position = [0, 1, 2].map(|axis| pose.position[axis] as f32);
    rows(position, pose.orientation.0.map(|value| value as f32), q.map(|q| q as f32), [0.0; 4])
}

const WEIGHTS: [f32; ROWS * KERNELS] = [0.0; ROWS * KERNELS];

static FEEDBACK: LazyLock<Feedback<f32>> = LazyLock::new(|| {
    let sensitivity = GainSchedule::constant([20.0; COUPLED_ROWS]).expect("gains");
    let weights = GainSchedule::constant([1.0; SENSORS]).expect("weights");
    Feedback::new(sensitivity, weights, limits(0.25, 0.4, 0.5)).expect("limits")
});

static EXPECTED: LazyLock<ExpectedWrench<f32>> =
    LazyLock::new(|| ExpectedWrench::new(&[[0.0; SENSORS]; 2], 4.0).expect("an expectation"));

fn tables() -> MovementTables<'static, f32> {
    MovementTables {
        control_period: control::PERIOD as f32,
        duration: 4.0,
        alpha: 4.6052,
        activation: 0.7,
        kernel_count: KERNELS,
        weights: &WEIGHTS,
        gains: gains([200.0; 4], [28.28, 20.0, 28.28, 28.28]),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: configuration(POSTURE),
        goal: configuration([-0.3, 1.4, 1.3, 2.0, -0.2, -0.5, 1.6]),
        start_velocity: Velocity::ZERO,
    }
}

fn sample(positions: [Option<Counts>; 7]) -> CycleInput {
    CycleInput {
        sample: BusSample {
            positions,
            wrench: Some(RawWrench::default()),
            safety: Some(SafetyMode::Active),
            hand: None,
        },
        ..CycleInput::default()
    }
}

/// A cycle of a nominal arm with this payload.
fn cycle(payload: Payload) -> Box<Cycle<f32, KERNELS>> {
    let Ok(cycle) = Box::new_uninit().write_init(Cycle::init(Calibration::nominal(payload), Gains::tuned()));
    cycle
}

/// A cycle in the given state, at rest at [`POSTURE`].
fn cycle_in(state: State) -> Box<Cycle<f32, KERNELS>> {
    let mut cycle = cycle(Payload::SensorAndHand);
    let model = ArmModel::new(Payload::SensorAndHand);
    let mut primitive = load::primitive(&model, &tables()).expect("a good primitive");
    primitive.set_feedback(Some(&FEEDBACK));
    primitive.set_expected(Some(&EXPECTED));
    cycle.load(&load::check(&model, &primitive).expect("fits")).expect("loads");
    let mut feed = |command: Option<Command>, cycles: usize| {
        for index in 0..cycles {
            let command = command.filter(|_| index == 0);
            cycle.step(&CycleInput { command, ..sample(counts(POSTURE)) });
        }
    };
    feed(None, 3);
    match state {
        State::Idle => {}
        State::Gravity => feed(Some(Command::Gravity), 50),
        _ => feed(Some(Command::Hold), 50),
    }
    // The wrench of these cycles is zero counts: without a tare that is a hand without weight.
    feed(Some(Command::Tare), 1);
    match state {
        State::Approach => feed(Some(Command::Approach { q: [0.0, 1.0, 1.0, 1.5, 0.0, 0.0, 0.0], duration: 3.0 }), 20),
        State::Run => feed(
            Some(Command::Run(RunOptions {
                feedback: true,
                force_control: true,
                compliant: true,
                ..RunOptions::default()
            })),
            20,
        ),
        State::SoftStop => feed(Some(Command::Stop), 5),
        _ => {}
    }
    assert_eq!(cycle.state(), state);
    cycle
}

fn any_counts() -> impl Strategy<Value = Option<Counts>> {
    prop_oneof![
        Just(None),
        any::<i32>().prop_map(|raw| Some(Counts(raw))),
        (-2_000_000i32..2_000_000).prop_map(|raw| Some(Counts(raw))),
    ]
}

/// Replies of a cycle: each motor either near the truth, or anything.
fn any_positions() -> impl Strategy<Value = [Option<Counts>; 7]> {
    let truth = counts(POSTURE);
    prop::array::uniform7((0..4u8, -150i32..150, any_counts())).prop_map(move |motors| {
        core::array::from_fn(|motor| {
            let (kind, jitter, wild) = motors[motor];
            if kind > 0 { truth[motor].map(|counts| Counts(counts.0 + jitter)) } else { wild }
        })
    })
}

fn any_wrench() -> impl Strategy<Value = Option<RawWrench>> {
    prop::option::of(
        (prop::array::uniform3(any::<i16>()), prop::array::uniform3(any::<i16>()), prop::option::of(any::<u8>()))
            .prop_map(|(force, torque, status)| RawWrench { force, torque, status: status.map(GaugeStatus) }),
    )
}

/// Replies of the hand: each near an opened hand, or anything.
fn any_hand() -> impl Strategy<Value = Option<HandSample>> {
    let digit = || (0..4u8, -150i32..150, any_counts());
    let near = |(kind, jitter, wild): (u8, i32, Option<Counts>), truth: i32| {
        if kind > 0 { Some(Counts(truth + jitter)) } else { wild }
    };
    let replies = (
        prop::array::uniform4(digit()),
        prop::array::uniform3(digit()),
        prop::array::uniform3(prop::option::of(any::<u16>())),
    );
    prop::option::weighted(
        0.9,
        replies.prop_map(move |(primary, secondary, gauges)| HandSample {
            primary: primary.map(|digit| near(digit, 1000)),
            secondary: secondary.map(|digit| near(digit, 400)),
            gauges,
        }),
    )
}

fn any_goal() -> impl Strategy<Value = Goal> {
    (
        prop::option::of(prop::array::uniform3(prop::num::f32::ANY)),
        prop::option::of(prop::array::uniform4(prop::num::f32::ANY)),
    )
        .prop_map(|(position, orientation)| Goal { position, orientation })
}

fn any_command() -> impl Strategy<Value = Command> {
    prop_oneof![
        Just(Command::Gravity),
        Just(Command::Hold),
        (prop::array::uniform7(prop::num::f32::ANY), prop::num::f32::ANY)
            .prop_map(|(q, duration)| Command::Approach { q, duration }),
        (prop::array::uniform7(-0.5f32..2.0), 0.0f32..5.0).prop_map(|(q, duration)| Command::Approach { q, duration }),
        (any_goal(), prop::num::f32::ANY, any::<[bool; 6]>()).prop_map(|(goal, speed, [a, b, c, d, e, f])| {
            Command::Run(RunOptions {
                goal: if d { goal } else { Goal::STORED },
                speed: if d { speed } else { 1.0 },
                feedback: a,
                force_control: b,
                finger_feedback: e,
                compliant: f,
                acceleration: if c { AccelerationSource::Analytic } else { AccelerationSource::Differentiated },
            })
        }),
        Just(Command::Stop),
        Just(Command::Release),
        Just(Command::ClearFault),
        any_goal().prop_map(Command::SetGoal),
        prop::num::f32::ANY.prop_map(|factor| Command::SetSpeed { factor }),
        Just(Command::Tare),
        (prop::array::uniform4(prop::num::f32::ANY), prop::num::f32::ANY)
            .prop_map(|(q, duration)| Command::MoveHand { q, duration }),
        (prop::array::uniform4(0.0f32..2.4), 0.0f32..2.0).prop_map(|(q, duration)| Command::MoveHand { q, duration }),
    ]
}

fn any_input() -> impl Strategy<Value = CycleInput> {
    let safety = prop_oneof![
        6 => Just(Some(SafetyMode::Active)),
        2 => Just(None),
        1 => Just(Some(SafetyMode::Idle)),
        1 => Just(Some(SafetyMode::EStop)),
    ];
    let fault = prop_oneof![30 => Just(None), 1 => Just(Some(Fault::BusFault)), 1 => Just(Some(Fault::Overrun))];
    (any_positions(), any_wrench(), any_hand(), safety, prop::option::weighted(0.2, any_command()), fault, any::<u64>())
        .prop_map(|(positions, wrench, hand, safety, command, external_fault, cycle)| CycleInput {
            cycle,
            sample: BusSample { positions, wrench, safety, hand },
            command,
            external_fault,
        })
}

/// Torques of the drives for a frame of the hand, by the nominal model (N m, spread, F1, F2, F3).
fn hand_torques(frame: Option<CanFrame>) -> [f64; 4] {
    let Some(frame) = frame else { return [0.0; 4] };
    let Action::PackedTorques { torques, .. } = Request::decode(&frame).expect("a valid frame").action else {
        panic!("{frame:?}")
    };
    let [f1, f2, f3, spread] = torques.map(|torque| f64::from(torque.units()) / 20_000.0);
    [spread * 17.5, f1 * 12.5, f2 * 12.5, f3 * 12.5]
}

fn any_state() -> impl Strategy<Value = State> {
    prop::sample::select(vec![State::Idle, State::Gravity, State::Hold, State::Approach, State::Run, State::SoftStop])
}

/// Cases of up to 60 cycles: 4 000, or as many as `TACTUS_FUZZ_CYCLES` says.
fn cases() -> u32 {
    std::env::var("TACTUS_FUZZ_CYCLES").ok().and_then(|number| number.parse().ok()).unwrap_or(4_000)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: cases(), failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn b1_any_input_in_any_state_gives_finite_torques_within_limits(
        state in any_state(),
        inputs in prop::collection::vec(any_input(), 1..60),
    ) {
        let mut cycle = cycle_in(state);
        let mut last = [f32::NAN; 7];
        let mut last_hand = [0.0; 4];
        for input in inputs {
            let active = input.sample.safety;
            let output = cycle.step(&input);
            let record = output.record;
            for joint in 0..7 {
                prop_assert!(record.tau[joint].is_finite() && record.tau[joint].abs() <= 61.6);
                prop_assert!(record.q[joint].is_finite() && record.dq[joint].is_finite() && record.q_d[joint].is_finite());
                if last[joint].is_finite() && record.state.has_torque() {
                    prop_assert!((record.tau[joint] - last[joint]).abs() <= STEP_LIMIT[joint] as f32 * 1.0001);
                }
            }
            prop_assert!(record.pose_d.iter().chain(&record.pose).chain(&record.wrench).all(|value| value.is_finite()));
            prop_assert_eq!(record.flags & flags::NOT_FINITE, 0);
            if matches!(active, Some(SafetyMode::Idle | SafetyMode::EStop)) {
                prop_assert!(!record.state.has_torque());
            }
            if !record.state.has_torque() {
                prop_assert_eq!(record.tau, [0.0; 7]);
            }
            last = record.tau;
            prop_assert!(record.hand.iter().chain(&record.hand_d).chain(&record.gauges).all(|value| value.is_finite()));
            let hand = hand_torques(output.actuation.hand_frame());
            // Full scale in 15 cycles, and a unit of rounding; a hand that is let go is let go at once.
            if output.actuation.hand_frame().is_some() {
                for ((now, before), limit) in hand.iter().zip(last_hand).zip(HAND_LIMIT) {
                    prop_assert!(now.abs() <= limit + 1e-3 && (now - before).abs() <= limit / 15.0 + 1e-3);
                }
            }
            if !record.state.has_torque() || record.state == State::SoftStop || input.sample.hand.is_none() {
                prop_assert_eq!(output.actuation.hand_frame(), None);
            }
            // After that it starts anew from nothing.
            last_hand = hand;
        }
    }
}

#[test]
fn e4_commands_out_of_range_are_refused_with_a_reason_and_change_nothing() {
    let refused = |state: State, command: Command| {
        let mut cycle = cycle_in(state);
        let output = cycle.step(&CycleInput { command: Some(command), ..sample(counts(POSTURE)) });
        assert_eq!(cycle.state(), state, "{command:?}");
        match output.event {
            Some(Event::Refused(reason)) => reason,
            other => panic!("{command:?}: {other:?}"),
        }
    };
    let far = [0.0, 0.0, 0.0, 0.0, 0.0, 1.9, 0.0];
    assert_eq!(refused(State::Hold, Command::Approach { q: far, duration: 1.0 }), Refusal::OutsideJointLimits);
    for duration in [-1.0, f32::NAN, f32::INFINITY, 1e6] {
        assert_eq!(refused(State::Hold, Command::Approach { q: [0.0; 7], duration }), Refusal::OutOfRange);
    }
    let mut q = [0.0; 7];
    q[2] = f32::NAN;
    assert_eq!(refused(State::Hold, Command::Approach { q, duration: 1.0 }), Refusal::OutOfRange);
    for factor in [0.0, -1.0, 10.0, f32::NAN] {
        assert_eq!(refused(State::Run, Command::SetSpeed { factor }), Refusal::OutOfRange);
    }
    let goal = |position, orientation| Command::SetGoal(Goal { position, orientation });
    assert_eq!(refused(State::Run, goal(Some([f32::NAN, 0.0, 0.0]), None)), Refusal::OutOfRange);
    assert_eq!(refused(State::Run, goal(Some([1.0, 1.0, 0.0]), None)), Refusal::OutsideWorkspace);
    assert_eq!(refused(State::Run, goal(None, Some([0.5, 0.0, 0.0, 0.0]))), Refusal::OutOfRange);
    assert_eq!(refused(State::Hold, goal(None, None)), Refusal::WrongState);
    assert_eq!(refused(State::Run, Command::Tare), Refusal::WrongState);
}

#[test]
fn e4_a_primitive_that_this_arm_cannot_run_is_refused_at_load() {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let reason = |change: &dyn Fn(&mut MovementTables<'static, f32>)| {
        let mut tables = tables();
        change(&mut tables);
        load::primitive::<f32, KERNELS>(&model, &tables).expect_err("refused")
    };
    assert!(load::primitive::<f32, KERNELS>(&model, &tables()).is_ok());
    assert_eq!(reason(&|tables| tables.duration = 0.3), LoadError::Duration);
    assert_eq!(reason(&|tables| tables.duration = 500.0), LoadError::Duration);
    assert!(matches!(reason(&|tables| tables.duration = 0.0), LoadError::Primitive(_)));
    assert!(matches!(reason(&|tables| tables.duration = f32::NAN), LoadError::Primitive(_)));
    assert!(matches!(reason(&|tables| tables.kernel_count = 0), LoadError::Primitive(_)));
    assert!(matches!(reason(&|tables| tables.goal.points[1] = f32::NAN), LoadError::Primitive(_)));
    assert!(matches!(reason(&|tables| tables.start.poses[0].orientation.w = 2.0), LoadError::Primitive(_)));
    assert_eq!(reason(&|tables| tables.goal.points[5] = 1.55), LoadError::Posture(End::Goal, 5));
    assert_eq!(reason(&|tables| tables.start.points[0] = -2.6), LoadError::Posture(End::Start, 0));
    assert_eq!(reason(&|tables| tables.goal.poses[0].position = [1.2, 0.0, 0.0]), LoadError::OutOfReach(End::Goal));
    assert_eq!(reason(&|tables| tables.goal.poses[0].position[2] += 0.1), LoadError::Inconsistent(End::Goal));
    assert_eq!(reason(&|tables| tables.start.points[6] += 0.4), LoadError::Inconsistent(End::Start));
}

#[test]
fn h1_an_expectation_beyond_what_may_be_pressed_or_measured_is_refused_at_load() {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let with = |sensor: usize, value: f32| {
        let mut primitive = load::primitive::<f32, KERNELS>(&model, &tables()).expect("good");
        let mut late = [0.0; 9];
        late[sensor] = value;
        primitive.set_expected(Some(&ExpectedWrench::new(&[[0.0; 9], late], 4.0).expect("numbers")));
        load::check(&model, &primitive).map(drop)
    };
    for (sensor, largest) in [(0, 50.0), (1, 50.0), (2, 50.0), (3, 4.9), (5, 4.9), (6, 1.0)] {
        for sign in [1.0, -1.0] {
            assert_eq!(with(sensor, sign * 0.3 * largest), Ok(()), "sensor {sensor}");
            assert_eq!(with(sensor, sign * 4.0 * largest), Err(LoadError::Expected(sensor as u8)));
        }
    }
}

/// A person may be in between. The change that makes it fail: the axes of the force are bounded one by one alone, or
/// the square of one is taken off the sum.
#[test]
fn h1_a_force_is_bounded_by_its_length_whichever_axes_it_is_along() {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    let with = |force: [f32; 3]| {
        let mut primitive = load::primitive::<f32, KERNELS>(&model, &tables()).expect("good");
        let mut late = [0.0; 9];
        late[..3].copy_from_slice(&force);
        primitive.set_expected(Some(&ExpectedWrench::new(&[[0.0; 9], late], 4.0).expect("numbers")));
        load::check(&model, &primitive).map(drop)
    };
    for force in [[40.0, 40.0, 0.0], [40.0, 0.0, -40.0], [0.0, -40.0, 40.0], [30.0, 30.0, 30.0]] {
        assert_eq!(with(force), Err(LoadError::Expected(0)), "{force:?}");
    }
    for force in [[30.0, -40.0, 0.0], [0.0, 30.0, 40.0], [-40.0, 0.0, 30.0], [0.0, 50.0, 0.0], [0.0, 0.0, -50.0]] {
        assert_eq!(with(force), Ok(()), "{force:?}: as much as may be pressed");
    }
}

/// The change that makes it fail: the outstretched arm is out of its own reach, or somewhere that it never comes is
/// not.
#[test]
fn reach_is_as_far_as_the_outstretched_arm_comes_in_every_direction() {
    for direction in [[1.0, 0.0, 0.0], [0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, -0.8], [-0.48, 0.64, 0.6]] {
        let direction = nalgebra::Vector3::<f64>::from(direction);
        assert!(load::within_reach(&(direction * 1.04)) && !load::within_reach(&(direction * 1.06)), "{direction}");
    }
    assert!(!load::within_reach(&nalgebra::Vector3::new(0.1, f64::NAN, 0.1)));
}

#[test]
fn a_primitive_is_not_exchanged_while_it_runs() {
    let model = ArmModel::new(Payload::SensorAndHand);
    let primitive = load::primitive(&model, &tables()).expect("good");
    let fit = load::check(&model, &primitive).expect("fits");
    assert_eq!(cycle_in(State::Run).load(&fit), Err(control::LoadRefusal::Running));
    assert_eq!(cycle_in(State::Hold).load(&fit), Ok(()));
}

#[test]
fn a_primitive_checked_for_an_arm_with_a_hand_is_not_taken_by_a_bare_one() {
    let model = ArmModel::new(Payload::SensorAndHand);
    let primitive = load::primitive::<f32, KERNELS>(&model, &tables()).expect("good");
    let fit = load::check(&model, &primitive).expect("fits");
    let mut bare = cycle(Payload::None);
    assert_eq!(bare.load(&fit), Err(control::LoadRefusal::OtherTool));
    assert!(bare.primitive().is_none());
    // The bare arm's own check says why: its tool frame is elsewhere.
    let error = load::check(bare.model(), &primitive).expect_err("the taught pose is the hand's");
    assert!(matches!(error, LoadError::Inconsistent(_)), "{error:?}");
}

#[test]
fn a_primitive_is_forgotten_when_another_payload_is_found() {
    let mut cycle = cycle_in(State::Idle);
    assert!(cycle.primitive().is_some());
    cycle.calibrate(Calibration::nominal(Payload::SensorAndHand)).expect("idle");
    assert!(cycle.primitive().is_some(), "the same arm again");
    cycle.calibrate(Calibration::nominal(Payload::None)).expect("idle");
    assert!(cycle.primitive().is_none());
}
