//! Requests for the control half, and what it tells.

use control::{CycleRecord, Fault, State};
use device::{Command, Counters, EventKind, HandFailure, Refusal as ControlRefusal, Stage, TimedRecord};
use link::frame::FRAME_BYTES;
use link::message::AccelerationSource;
use link::{Event, EventKind as LinkKind, Goal, HandStage, Name, Refusal, Reply, Request, RunOptions, Telemetry};
use proptest::prelude::*;
use puck::SafetyMode;

use crate::rig::{Rig, hello, image};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn telemetry(rig: &mut Rig) -> Vec<Telemetry> {
    rig.sent()
        .into_iter()
        .filter_map(|frame| match frame.message {
            Reply::Telemetry(telemetry) => Some(telemetry),
            _ => None,
        })
        .collect()
}

fn events(rig: &mut Rig) -> Vec<Event> {
    rig.sent()
        .into_iter()
        .filter_map(|frame| match frame.message {
            Reply::Event(event) => Some(event),
            _ => None,
        })
        .collect()
}

#[test]
fn each_request_becomes_its_command() {
    use control::Command as Control;
    let mut rig = Rig::greeted();
    let q = [0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
    let goal = Goal { position: Some([0.1, 0.2, 0.3]), orientation: Some([1.0, 0.0, 0.0, 0.0]) };
    let control_goal = control::Goal { position: goal.position, orientation: goal.orientation };
    let pairs = [
        (Request::Zero { home: q }, Command::Zero { home: q }),
        (Request::Gravity, Control::Gravity.into()),
        (Request::Hold, Control::Hold.into()),
        (Request::Approach { q, duration: 2.0 }, Control::Approach { q, duration: 2.0 }.into()),
        (Request::Stop, Control::Stop.into()),
        (Request::ClearFault, Control::ClearFault.into()),
        (Request::SetGoal(goal), Control::SetGoal(control_goal).into()),
        (Request::SetSpeed { factor: 0.5 }, Control::SetSpeed { factor: 0.5 }.into()),
        (Request::Release, Control::Release.into()),
        (Request::Tare, Control::Tare.into()),
        (Request::InitialiseHand, Command::InitialiseHand),
        (
            Request::MoveHand { q: [0.1, 0.2, 0.3, 0.4], duration: 1.5 },
            Control::MoveHand { q: [0.1, 0.2, 0.3, 0.4], duration: 1.5 }.into(),
        ),
    ];
    for (request, command) in pairs {
        rig.commanded(request);
        assert_eq!(rig.bench.commands.pop(), Some(command));
    }
}

#[test]
fn run_loads_the_primitive_once_and_passes_every_option() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    let options = RunOptions {
        goal: Goal { position: None, orientation: Some([0.0, 1.0, 0.0, 0.0]) },
        speed: 0.5,
        feedback: true,
        force_control: true,
        acceleration: AccelerationSource::Differentiated,
        finger_feedback: false,
        compliant: true,
    };
    rig.commanded(Request::Run { name: name("reach"), options });
    rig.commanded(Request::Run { name: name("reach"), options });
    assert_eq!(rig.bench.loaded, [3.0]);
    let expected = control::RunOptions {
        goal: control::Goal { position: None, orientation: Some([0.0, 1.0, 0.0, 0.0]) },
        speed: 0.5,
        feedback: true,
        force_control: true,
        acceleration: control::AccelerationSource::Differentiated,
        finger_feedback: false,
        compliant: true,
    };
    assert_eq!(rig.bench.commands[0], Command::Control(control::Command::Run(expected)));
}

#[test]
fn a_new_image_of_the_same_name_is_loaded_before_the_next_run() {
    let mut rig = Rig::greeted();
    let run = Request::Run { name: name("reach"), options: RunOptions::default() };
    rig.store("reach", &image("reach", 3.0, 10));
    rig.commanded(run.clone());
    rig.store("reach", &image("reach", 4.0, 10));
    rig.commanded(run);
    assert_eq!(rig.bench.loaded, [3.0, 4.0]);
}

#[test]
fn no_primitive_is_loaded_under_a_run_or_under_a_command_that_may_start_one() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.store("grasp", &image("grasp", 4.0, 10));
    let run = |text| Request::Run { name: name(text), options: RunOptions::default() };
    rig.commanded(run("reach"));
    rig.bench.state = State::Run;
    assert_eq!(rig.refused(run("grasp")), (Refusal::State, [State::Run.code().into(), 0]));
    rig.store("other", &image("other", 5.0, 10));
    rig.bench.state = State::Hold;
    assert_eq!(rig.ask(Request::Gravity), None);
    assert_eq!(rig.refused(run("grasp")).0, Refusal::CommandQueueFull);
    assert_eq!(rig.bench.loaded, [3.0, 4.0, 3.0], "each upload at rest, and the first run");
}

#[test]
fn a_primitive_the_control_half_does_not_take_is_not_run() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.store("grasp", &image("grasp", 4.0, 10));
    let run = |text| Request::Run { name: name(text), options: RunOptions::default() };
    rig.commanded(run("reach"));
    rig.bench.load = Err(control::LoadRefusal::OtherTool);
    assert_eq!(rig.refused(run("grasp")).0, Refusal::OtherTool);
    assert_eq!(rig.bench.commands.len(), 1, "the old one would have run under the new name");
    rig.bench.load = Ok(());
    rig.commanded(run("grasp"));
    assert_eq!(rig.bench.loaded, [3.0, 4.0, 3.0, 4.0]);
}

#[test]
fn a_primitive_is_checked_for_the_arm_that_the_start_up_found() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    let run = Request::Run { name: name("reach"), options: RunOptions::default() };
    rig.commanded(run.clone());
    assert_eq!(rig.bench.loaded, [3.0]);
    // The hand is taken off and the bus started anew: the taught pose is not that of the taught posture any more.
    rig.bench.payload = control::Payload::None;
    assert_eq!(rig.refused(run.clone()).0, Refusal::PrimitiveInvalid);
    rig.send_parts("other", &image("other", 4.0, 10));
    assert_eq!(rig.refused(Request::UploadCommit).0, Refusal::PrimitiveInvalid);
    // And put on again: the control half has forgotten the primitive, so it is given it once more.
    rig.bench.payload = control::Payload::SensorAndHand;
    rig.commanded(run);
    assert_eq!(rig.bench.loaded, [3.0, 3.0]);
}

#[test]
fn a_primitive_that_the_control_half_has_forgotten_unseen_is_given_again() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    let run = Request::Run { name: name("reach"), options: RunOptions::default() };
    rig.commanded(run.clone());
    // The start-up missed the sensor, began anew and found it: nobody asked in between.
    rig.bench.primitive = None;
    rig.commanded(run);
    assert_eq!(rig.bench.loaded, [3.0, 3.0]);
}

#[test]
fn a_primitive_that_is_not_there_is_not_run() {
    let mut rig = Rig::greeted();
    let run = Request::Run { name: name("reach"), options: RunOptions::default() };
    assert_eq!(rig.refused(run).0, Refusal::NoSuchPrimitive);
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn numbers_that_are_none_never_reach_the_control_half() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    let mut q = [0.0; 7];
    q[4] = f32::NAN;
    assert_eq!(rig.refused(Request::Approach { q, duration: 1.0 }), (Refusal::BadValue, [4, 0]));
    assert_eq!(rig.refused(Request::Zero { home: q }), (Refusal::BadValue, [4, 0]));
    let bad = [
        Request::Approach { q: [0.0; 7], duration: f32::INFINITY },
        Request::SetSpeed { factor: f32::NAN },
        Request::SetGoal(Goal { position: Some([0.0, f32::NAN, 0.0]), orientation: None }),
        Request::SetGoal(Goal { position: None, orientation: Some([f32::NAN; 4]) }),
        Request::Run { name: name("reach"), options: RunOptions { speed: f32::NAN, ..RunOptions::default() } },
    ];
    for request in bad {
        assert_eq!(rig.refused(request).0, Refusal::BadValue);
    }
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn every_refusal_of_the_control_half_reaches_the_host() {
    let control = |reason| ControlRefusal::Control(reason);
    let pairs = [
        (control(control::Refusal::WrongState), Refusal::State, [State::Hold.code().into(), 0]),
        (control(control::Refusal::FaultLatched), Refusal::Faulted, [Fault::JointSpeed.code().into(), 0]),
        (control(control::Refusal::SafetyNotActive), Refusal::SafetyMode, [2, 0]),
        (control(control::Refusal::StartTooFar), Refusal::FarFromStart, [0, 0]),
        (control(control::Refusal::OutsideWorkspace), Refusal::OutsideWorkspace, [0, 0]),
        (ControlRefusal::NotReady(Stage::Waking), Refusal::NotReady, [Stage::Waking.code().into(), 0]),
        (ControlRefusal::NotReady(Stage::WaitingForZero), Refusal::NotZeroed, [0, 0]),
        (ControlRefusal::ZeroNeedsIdle, Refusal::ZeroNeedsIdle, [0, 0]),
        (ControlRefusal::HomeOutOfRange { joint: 3 }, Refusal::BadValue, [3, 0]),
        (control(control::Refusal::NoExpectation), Refusal::NoExpectation, [0, 0]),
        (control(control::Refusal::HandTooFar), Refusal::HandFarFromStart, [0, 0]),
        (control(control::Refusal::ForceAtRest), Refusal::ForceAtRest, [0, 0]),
        (control(control::Refusal::ZeroLost), Refusal::NotZeroed, [0, 0]),
        (control(control::Refusal::NoHand), Refusal::HandNotReady, [HandStage::NotInitialised.code().into(), 0]),
        (ControlRefusal::NoHand, Refusal::HandNotReady, [HandStage::NotInitialised.code().into(), 0]),
        (ControlRefusal::HandBusy, Refusal::HandBusy, [0, 0]),
    ];
    let mut rig = Rig::greeted();
    rig.cycle(1, Fault::JointSpeed);
    for (core, reason, detail) in pairs {
        assert_eq!(rig.ask(Request::Gravity), None);
        rig.event(EventKind::Refused(core));
        let answer = rig.answer();
        assert_eq!(answer, Some(Reply::Refused { of: rig.sequence, reason, detail }), "{core:?}");
    }
}

#[test]
fn a_surprise_and_the_stages_of_the_hand_are_told() {
    let mut rig = Rig::greeted();
    rig.event(control::Event::Surprised { phase: 0.6254, channel: 7 }.into());
    let cause = Some((puck::Node::FINGERS[1], HandFailure::Silent));
    rig.event(EventKind::Hand { stage: HandStage::Failed, cause });
    let told: Vec<_> = events(&mut rig).iter().map(|event| (event.kind, event.code, event.detail)).collect();
    let failed = (LinkKind::Hand, u16::from(HandStage::Failed.code()), 11 << 8 | 12);
    assert_eq!(told, [(LinkKind::Surprise, 7, 625), failed]);
    assert_eq!(HandFailure::from_number(told[1].2), cause, "a host can say it in words");
}

#[test]
fn answers_find_their_requests_in_order() {
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Gravity), None);
    let first = rig.sequence;
    assert_eq!(rig.ask(Request::Hold), None);
    let second = rig.sequence;
    rig.event(EventKind::Refused(ControlRefusal::Control(control::Refusal::Moving)));
    rig.event(EventKind::Accepted);
    let answers: Vec<Reply> = rig.sent().into_iter().map(|frame| frame.message).collect();
    let refused = Reply::Refused { of: first, reason: Refusal::Moving, detail: [0, 0] };
    assert_eq!(answers, [refused, Reply::Accepted { of: second }]);
}

#[test]
fn a_control_half_that_does_not_answer_is_reported() {
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Gravity), None);
    rig.wait(199);
    assert_eq!(rig.answer(), None);
    rig.wait(1);
    let answer = rig.answer();
    assert!(matches!(answer, Some(Reply::Refused { reason: Refusal::NoAnswer, detail: [200, 0], .. })), "{answer:?}");
}

#[test]
fn an_answer_to_a_host_that_is_gone_is_not_given_to_the_next_one() {
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Hold), None);
    rig.done(Request::Goodbye);
    (rig.number, rig.sequence) = (88, 0);
    assert_eq!(rig.ask(Request::Hello(hello())), None, "it waits for what becomes of the order");
    rig.event(EventKind::Refused(ControlRefusal::Control(control::Refusal::Moving)));
    let said: Vec<_> = rig.sent().into_iter().map(|frame| frame.message).collect();
    assert!(matches!(said[..], [Reply::Hello { .. }]), "numbers of two hosts may be equal: {said:?}");
    assert_eq!(rig.ask(Request::Gravity), None);
    rig.event(EventKind::Accepted);
    assert_eq!(rig.answer(), Some(Reply::Accepted { of: rig.sequence }));
}

/// The change that makes it fail: a host is greeted while an order of the one before is on its way. The run would be
/// its own, and nobody would stop it.
#[test]
fn g5_a_host_that_follows_a_goodbye_does_not_inherit_an_order_that_is_still_on_its_way() {
    for (order, state, hand_moves) in [
        (Request::Gravity, State::Gravity, false),
        (Request::Approach { q: [0.0; 7], duration: 1.0 }, State::Approach, false),
        (Request::InitialiseHand, State::Hold, true),
    ] {
        let mut rig = Rig::greeted();
        assert_eq!(rig.ask(order), None);
        rig.done(Request::Goodbye);
        (rig.number, rig.sequence) = (88, 0);
        assert_eq!(rig.ask(Request::Hello(hello())), None);
        rig.wait(5);
        (rig.bench.state, rig.bench.hand_moves) = (state, hand_moves);
        rig.event(EventKind::Accepted);
        assert_eq!(rig.bench.commands.last(), Some(&Command::Control(control::Command::Stop)));
        assert!(matches!(rig.answer(), Some(Reply::Hello { .. })), "greeted behind the stop");
    }
    // A control half that does not answer keeps nobody out.
    let mut rig = Rig::greeted();
    assert_eq!(rig.ask(Request::Gravity), None);
    rig.done(Request::Goodbye);
    (rig.number, rig.sequence) = (88, 0);
    assert_eq!(rig.ask(Request::Hello(hello())), None);
    rig.wait(200);
    assert!(matches!(rig.answer(), Some(Reply::Hello { .. })));
}

/// A zeroing is answered within 170 ms, a second one behind it within twice that: given up after 200, it would be
/// carried out all the same, and its answer be taken for that to the next command. The change that makes it fail: a
/// zeroing is taken while an answer is owed.
#[test]
fn g2_a_zeroing_is_taken_only_when_no_answer_is_owed() {
    let zero = || Request::Zero { home: [0.0; 7] };
    let mut rig = Rig::greeted();
    for first in [zero(), Request::Hold] {
        assert_eq!(rig.ask(first), None);
        let taken = rig.bench.commands.len();
        assert_eq!(rig.refused(zero()), (Refusal::CommandQueueFull, [0, 0]));
        assert_eq!(rig.bench.commands.len(), taken);
        rig.event(EventKind::Accepted);
        rig.commanded(zero());
    }
}

#[test]
fn the_next_host_gets_no_telemetry_that_it_has_not_asked_for() {
    let mut rig = Rig::greeted();
    rig.done(Request::Telemetry { every: 1 });
    rig.done(Request::Goodbye);
    rig.number = 88;
    rig.greet();
    rig.cycle(1, Fault::None);
    assert!(telemetry(&mut rig).is_empty());
}

#[test]
fn a_full_queue_refuses_but_keeps_a_place_for_a_stop() {
    let mut rig = Rig::greeted();
    rig.bench.stuck = true;
    assert_eq!(rig.refused(Request::Gravity).0, Refusal::CommandQueueFull);
    rig.bench.stuck = false;
    for _ in 0..3 {
        assert_eq!(rig.ask(Request::Hold), None);
    }
    assert_eq!(rig.refused(Request::Hold).0, Refusal::CommandQueueFull);
    assert_eq!(rig.ask(Request::Stop), None);
    assert_eq!(rig.bench.commands.last(), Some(&Command::Control(control::Command::Stop)));
}

/// H6: a host that changes the goal as fast as it can, and anybody's stop. The control half takes one command in a
/// cycle of 3.3 ms. The change that makes it fail: more orders may wait before it.
#[test]
fn h6_a_stop_is_at_most_four_cycles_behind_the_orders_of_a_host_that_does_not_wait() {
    let mut rig = Rig::greeted();
    for _ in 0..20 {
        rig.ask(Request::SetSpeed { factor: 1.0 });
    }
    rig.number = 500;
    rig.ask(Request::Stop);
    let place = rig.bench.commands.iter().position(|command| *command == Command::Control(control::Command::Stop));
    assert!(place.is_some_and(|place| place < 4), "{place:?}");
}

#[test]
fn telemetry_comes_every_so_many_cycles_and_only_when_asked_for() {
    let mut rig = Rig::greeted();
    rig.cycle(1, Fault::None);
    assert!(telemetry(&mut rig).is_empty());
    rig.done(Request::Telemetry { every: 3 });
    (2..=12).for_each(|number| rig.cycle(number, Fault::None));
    let cycles: Vec<u32> = telemetry(&mut rig).iter().map(|telemetry| telemetry.cycle).collect();
    assert_eq!(cycles, [3, 6, 9, 12]);
    rig.done(Request::Telemetry { every: 1 });
    rig.cycle(13, Fault::TipSpeed);
    let sent = telemetry(&mut rig);
    assert_eq!((sent[0].cycle, sent[0].fault, sent[0].cost_ticks), (13, Fault::TipSpeed.code(), 99));
    rig.done(Request::Telemetry { every: 0 });
    rig.cycle(14, Fault::None);
    assert!(telemetry(&mut rig).is_empty());
}

#[test]
fn telemetry_gives_way_and_is_counted_when_the_line_is_full() {
    let mut rig = Rig::greeted();
    rig.done(Request::Telemetry { every: 1 });
    rig.bench.room = 400;
    (1..=5).for_each(|number| rig.cycle(number, Fault::None));
    assert!(telemetry(&mut rig).is_empty(), "the room is kept for an answer");
    rig.bench.room = 4096;
    let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
    assert_eq!(statistics.telemetry_dropped, 5);
}

#[test]
fn telemetry_keeps_room_for_one_answer_and_no_more() {
    for (room, sent) in [(2 * FRAME_BYTES, 1), (2 * FRAME_BYTES - 1, 0)] {
        let mut rig = Rig::greeted();
        rig.done(Request::Telemetry { every: 1 });
        rig.bench.room = room;
        rig.cycle(1, Fault::None);
        assert_eq!(telemetry(&mut rig).len(), sent, "{room} bytes");
    }
}

#[test]
fn every_cycle_whose_torque_was_cut_is_counted_whatever_cut_it() {
    use control::flags::{CONTACT_UNSEEN, JOINT_LIMITED, MOTOR_LIMITED, RATE_LIMITED};
    for (flags, counted) in [
        (JOINT_LIMITED, 1),
        (MOTOR_LIMITED, 1),
        (RATE_LIMITED, 1),
        (JOINT_LIMITED | RATE_LIMITED, 1),
        (CONTACT_UNSEEN, 0),
        (0, 0),
    ] {
        let mut rig = Rig::greeted();
        let record = CycleRecord { flags, ..CycleRecord::EMPTY };
        rig.bench.records.push_back(TimedRecord { record, cost_ticks: 0 });
        rig.poll();
        let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
        assert_eq!(statistics.limited_cycles, counted, "{flags:#b}");
    }
}

#[test]
fn events_reach_the_host() {
    let mut rig = Rig::greeted();
    let pairs = [
        (EventKind::Entered(State::SoftStop, Fault::TipSpeed), LinkKind::State, State::SoftStop.code(), 5),
        (EventKind::Arrived, LinkKind::Arrived, 0, 0),
        (EventKind::Startup(Stage::Ready), LinkKind::Startup, Stage::Ready.code(), 0),
        (EventKind::Safety { mode: SafetyMode::Idle, is_asked_for: false }, LinkKind::SafetyMode, 1, 0),
        (EventKind::Safety { mode: SafetyMode::Idle, is_asked_for: true }, LinkKind::SafetyMode, 1, 1),
    ];
    for (kind, told, code, detail) in pairs {
        rig.event(kind);
        assert_eq!(events(&mut rig), [Event { cycle: 1234, kind: told, code: code.into(), detail }]);
    }
    let node = puck::Node::new(3).unwrap();
    rig.event(EventKind::Blocked(device::StartupError::MissingPuck(node)));
    let told = events(&mut rig)[0];
    let words = device::StartupFailure([told.code.into(), told.detail]).to_string();
    assert_eq!(words, device::StartupError::MissingPuck(node).to_string());
}

#[test]
fn status_and_statistics_tell_what_the_control_half_knows() {
    let mut rig = Rig::greeted();
    rig.bench.counters =
        Counters { cycles: 900, lost_replies: 4, malformed_frames: 1, foreign_frames: 2, ..Counters::default() };
    rig.cycle(900, Fault::None);
    let Some(Reply::Status { status, .. }) = rig.ask(Request::Status) else { panic!() };
    assert_eq!((status.cycle, status.state, status.startup_stage), (1234, State::Hold.code(), Stage::Ready.code()));
    assert_eq!((status.safety_mode, status.pendant, status.zeroed), (Some(2), Some(0x0F3F_1249), true));
    assert_eq!(status.temperatures[6], Some(35));
    let Some(Reply::Statistics { statistics, .. }) = rig.ask(Request::Statistics) else { panic!() };
    assert_eq!((statistics.cycles, statistics.lost_replies, statistics.rejected_frames), (900, 4, 3));
    assert_eq!(statistics.cost_worst_ticks, 30_000);
}

/// A request with any content.
fn any_request() -> impl Strategy<Value = Request> {
    let name = prop::sample::select(vec!["reach", "grasp", "none"]).prop_map(name);
    let real = prop_oneof![any::<f32>(), -3.0_f32..3.0];
    prop_oneof![
        Just(Request::Ping),
        Just(Request::Status),
        Just(Request::Gravity),
        Just(Request::Hold),
        Just(Request::Stop),
        Just(Request::ClearFault),
        Just(Request::Release),
        Just(Request::UploadCommit),
        Just(Request::UploadAbort),
        Just(Request::Statistics),
        Just(Request::Tare),
        Just(Request::InitialiseHand),
        Just(Request::Calibration),
        Just(Request::FaultRecord),
        any::<(u16, u16)>().prop_map(|(record, index)| Request::FaultCycle { record, index }),
        prop::array::uniform7(real.clone()).prop_map(|home| Request::Zero { home }),
        (prop::array::uniform4(real.clone()), real.clone()).prop_map(|(q, duration)| Request::MoveHand { q, duration }),
        (prop::option::of(prop::array::uniform3(real.clone())), prop::option::of(prop::array::uniform4(real.clone())))
            .prop_map(|(position, orientation)| Request::SetGoal(Goal { position, orientation })),
        Just(Request::Delete { name: self::name("none") }),
        any::<u8>().prop_map(|index| Request::List { index }),
        any::<u8>().prop_map(|every| Request::Telemetry { every }),
        (prop::array::uniform7(real.clone()), real.clone()).prop_map(|(q, duration)| Request::Approach { q, duration }),
        real.clone().prop_map(|factor| Request::SetSpeed { factor }),
        (name.clone(), real).prop_map(|(name, speed)| {
            Request::Run { name, options: RunOptions { speed, ..RunOptions::default() } }
        }),
        (name.clone(), any::<u16>(), any::<u32>())
            .prop_map(|(name, length, crc)| { Request::UploadBegin { name, length: length.into(), crc } }),
        (any::<u32>(), prop::collection::vec(any::<u8>(), 0..192)).prop_map(|(offset, data)| {
            Request::UploadChunk { offset, data: link::message::ChunkData::from_slice(&data).unwrap() }
        }),
        (name, any::<u32>()).prop_map(|(name, offset)| Request::Read { name, offset }),
    ]
}

/// Number of random cases: that of the environment variable, which `cargo xtask fuzz` sets, or `usual`.
fn cases(variable: &str, usual: u32) -> u32 {
    std::env::var(variable).ok().and_then(|number| number.parse().ok()).unwrap_or(usual)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(cases("TACTUS_FUZZ_SESSIONS", 256)))]

    /// C2: any requests in any order; every one is answered or handed on, no number that is none gets through,
    /// and the primitive that was stored is still there, whole.
    #[test]
    fn c2_any_sequence_of_requests_is_harmless(requests in prop::collection::vec(any_request(), 1..40)) {
        let mut rig = Rig::greeted();
        let image = image("reach", 3.0, 10);
        rig.store("reach", &image);
        for request in requests {
            let commands = rig.bench.commands.len();
            let answered = rig.ask(request).is_some();
            let handed_on = rig.bench.commands.len() > commands;
            prop_assert!(answered != handed_on, "answered at once, or later by the control half");
            if handed_on {
                rig.event(EventKind::Accepted);
                let accepted = matches!(rig.answer(), Some(Reply::Accepted { .. }));
                prop_assert!(accepted);
            }
        }
        for command in &rig.bench.commands {
            let finite = match command {
                Command::Control(control::Command::Approach { q, duration }) => {
                    q.iter().all(|q| q.is_finite()) && duration.is_finite()
                }
                Command::Control(control::Command::SetSpeed { factor }) => factor.is_finite(),
                Command::Control(control::Command::Run(options)) => options.speed.is_finite(),
                Command::Control(control::Command::MoveHand { q, duration }) => {
                    q.iter().all(|q| q.is_finite()) && duration.is_finite()
                }
                Command::Control(control::Command::SetGoal(goal)) => {
                    let mut values = goal.position.iter().flatten().chain(goal.orientation.iter().flatten());
                    values.all(|value| value.is_finite())
                }
                Command::Zero { home } => home.iter().all(|q| q.is_finite()),
                _ => true,
            };
            prop_assert!(finite);
        }
        prop_assert_eq!(device::Store::image(rig.session.store(), 0), Some(image.as_slice()));
    }
}
