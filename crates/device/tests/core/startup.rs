//! From power-up to a cyclic loop, and all the reasons not to get there.

use device::{Command, Controller, EventKind, Refusal, Stage, StartupError};
use puck::{
    Action, CanFrame, Counts, Destination, Group, MotorMode, Node, Property, PropertyId, PropertyTable, PuckTorque,
    Request, SafetyMode, set, zero_torques,
};

use crate::double::{ARM, Bus, HOME, STOPS_US, silent_device, started};

const SAFETY: Destination = Destination::Node(Node::SAFETY_MODULE);

fn safety_property(property: Property) -> PropertyId {
    PropertyTable::safety(197).expect("known").id(property).expect("a property of the module")
}

/// The stages that were told, in order.
fn stages(bus: &Bus) -> Vec<Stage> {
    bus.events
        .iter()
        .filter_map(|event| match event {
            EventKind::Startup(stage) => Some(*stage),
            _ => None,
        })
        .collect()
}

/// The pauses that Barrett's devices need, checked on everything that was sent before the cyclic loop.
fn assert_pauses(bus: &Bus) {
    let loop_begins = bus.loop_begins().map_or(bus.log.len(), |begin| begin + 1);
    let frames = &bus.log[..loop_begins];
    assert!(frames.len() > 60, "only {} frames before the loop", frames.len());
    for pair in frames.windows(2) {
        let gap = pair[1].0 - pair[0].0;
        assert!(gap >= 1_000, "{gap} us between {:?} and {:?}", pair[0].1, pair[1].1);
    }
    let sets = |wanted: &dyn Fn(Destination, PropertyId) -> bool| {
        bus.sets().filter(|(_, to, property, _)| wanted(*to, *property)).map(|(time, ..)| time).collect::<Vec<_>>()
    };
    let safety = sets(&|to, _| to == SAFETY);
    assert!(safety.len() >= 8, "{} SETs to the safety module", safety.len());
    assert!(safety.windows(2).all(|pair| pair[1] - pair[0] >= 10_000), "SETs to the safety module: {safety:?}");
    let wakes = sets(&|_, property| property == PropertyId::STAT);
    assert!(wakes.windows(2).all(|pair| pair[1] - pair[0] >= 10_000), "wakes: {wakes:?}");
    if let Some(last) = wakes.last() {
        let next = frames.iter().map(|(time, _)| *time).find(|time| time > last).expect("a frame after the wakes");
        assert!(next - last >= 1_000_000, "only {} us of silence after waking", next - last);
    }
}

#[test]
fn from_emergency_stop_to_ready_in_the_documented_order() {
    let (mut core, mut bus) = (silent_device(), Bus::in_emergency_stop());
    bus.run(&mut core, 2.0);
    assert_eq!(core.stage(), Stage::WaitingForIdle);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.run(&mut core, 1.0);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.5);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    assert_eq!(
        stages(&bus),
        [
            Stage::LoadingLimits,
            Stage::WaitingForIdle,
            Stage::Enumerating,
            Stage::Waking,
            Stage::Verifying,
            Stage::Reading,
            Stage::WaitingForZero,
            Stage::Zeroing,
            Stage::Preparing,
            Stage::WaitingForActive,
            Stage::Ready,
        ]
    );
    assert!(bus.events.contains(&EventKind::Accepted));
    assert_pauses(&bus);
    assert!(bus.torques_since(0).all(|torque| torque == PuckTorque::ZERO));
    let health = core.health();
    assert!(health.zeroed && health.blocked.is_none() && health.safety_mode == Some(SafetyMode::Active));
    assert_eq!(health.zeroed_at, Some(HOME));
    assert_eq!((health.counters.malformed_frames, health.counters.foreign_frames), (0, 0), "{health:?}");
    assert!(health.counters.broadcasts >= 2, "the broadcasts of the safety module were seen and ignored");
}

#[test]
fn the_frames_of_the_start_up_are_those_of_the_reference() {
    let (mut core, mut bus) = started();
    bus.run(&mut core, 0.1);
    let is_stop = |time, property| time <= STOPS_US && property == PropertyId::MODE;
    let sets = bus.sets().filter(|(time, _, property, _)| !is_stop(*time, *property));
    let sets: Vec<_> = sets.map(|(_, to, property, value)| (to, property, value)).collect();
    let limit = |property| i32::from(safety_property(property).number());
    let mut expected = Vec::new();
    for property in [Property::Vl1, Property::Vl2, Property::Tl1, Property::Tl2] {
        expected.push((SAFETY, safety_property(Property::Def), limit(property)));
        expected.push((SAFETY, safety_property(Property::Load), limit(property)));
    }
    for node in Node::ARM.into_iter().chain([Node::FORCE_TORQUE]) {
        expected.push((node.into(), PropertyId::STAT, 2));
    }
    expected.push((ARM, PropertyId::MODE, 0));
    expected.push((SAFETY, safety_property(Property::Ifault), 8));
    // Counts of home by hand: floor makes -36833 of the second and +36832 of the third.
    for (node, counts) in Node::ARM.into_iter().zip([0, -36833, 36832, -36728, 0, 0, 0]) {
        expected.push((node.into(), PropertyId::POSITION, counts));
    }
    expected.push((SAFETY, safety_property(Property::Zero), 1));
    expected.push((Node::FORCE_TORQUE.into(), PropertyId::FORCE_TORQUE, 0));
    expected.push((SAFETY, safety_property(Property::Ifault), 5));
    assert_eq!(sets, expected);
    assert_pauses(&bus);
    assert!(bus.safety_zero);
    // Every frame goes to nodes or to group 4; group 0 would reach the hand.
    assert!(bus.log.iter().all(|(_, frame)| frame.can_id().destination() != Destination::Group(Group::ALL_MOTORS)));
    for (puck, counts) in bus.pucks.iter().zip([0, -36833, 36832, -36728, 0, 0, 0]) {
        assert_eq!(puck.position, Counts(counts));
    }
}

#[test]
fn an_emergency_stop_is_waited_for_without_end() {
    let (mut core, mut bus) = (silent_device(), Bus::in_emergency_stop());
    bus.run(&mut core, 20.0);
    assert_eq!(core.stage(), Stage::WaitingForIdle);
    assert_eq!(core.health().blocked, None);
    assert!(bus.records.is_empty(), "no control cycle without pucks");
    let late = bus.log.iter().filter(|(time, _)| *time > 2_000_000);
    let polls: Vec<_> = late.collect();
    assert!(polls.iter().all(|(_, frame)| frame.payload() == [8] && frame.can_id().raw() == 10), "only MODE polls");
    assert!(polls.windows(2).all(|pair| pair[1].0 - pair[0].0 >= 250_000), "at most four polls a second");
}

#[test]
fn an_active_arm_is_not_started_until_a_person_makes_it_idle() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.press_activate();
    bus.run(&mut core, 3.0);
    assert_eq!(core.stage(), Stage::WaitingForIdle);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForActive);
}

#[test]
fn g3_a_device_that_restarts_takes_off_the_torque_before_it_asks_anything() {
    // The board was reset while the arm was ACTIVE: the pucks still apply what the old life commanded.
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.press_activate();
    bus.run(&mut core, 0.02);
    let [arm, wrist] = zero_torques();
    let idle = |group| set(group, PropertyId::MODE, MotorMode::Idle.value());
    let first: Vec<CanFrame> = bus.log.iter().take(4).map(|(_, frame)| *frame).collect();
    assert_eq!(first, [arm, wrist, idle(Group::ARM), idle(Group::HAND)]);
    let begun = bus.log.first().map(|(time, _)| *time).expect("a frame");
    let zeroed = bus.log.get(1).map(|(time, _)| *time).expect("a second frame");
    assert!(zeroed - begun <= 2_000, "both torque frames leave within two slots, not {} us", zeroed - begun);
}

#[test]
fn a_zeroed_arm_keeps_its_counts() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert!(core.health().zeroed);
    assert_eq!(core.health().zeroed_at, None, "nobody told this device where the arm stood then");
    assert!(bus.sets().all(|(_, _, property, _)| property != PropertyId::POSITION && property != PropertyId::STAT));
    for (joint, puck) in bus.pucks.iter().enumerate() {
        assert_eq!(puck.position, Counts(100 + joint as i32));
    }
}

#[test]
fn a_puck_that_never_wakes_is_named_and_tried_again() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks[4].never_wakes = true;
    bus.run(&mut core, 8.0);
    let error = StartupError::DidNotWake(Node::ARM[4]);
    assert_eq!(core.health().blocked, Some(error));
    let told = bus.events.iter().filter(|event| **event == EventKind::Blocked(error)).count();
    assert_eq!(told, 1, "one reason is told once, however often it is tried again");
    bus.pucks[4].never_wakes = false;
    bus.run_until(&mut core, Stage::WaitingForZero);
    assert_eq!(core.health().blocked, None);
}

/// The error of the start-up on a bus with one thing wrong.
fn refusal(break_something: impl FnOnce(&mut Bus)) -> Option<StartupError> {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    break_something(&mut bus);
    bus.run_until(&mut core, Stage::Blocked);
    assert!(bus.records.is_empty());
    assert!(bus.sets().all(|(_, _, property, _)| property != PropertyId::POSITION));
    core.health().blocked
}

#[test]
fn whatever_is_wrong_with_a_device_is_named() {
    let third = Node::ARM[2];
    assert_eq!(refusal(|bus| bus.pucks[2].present = false), Some(StartupError::MissingPuck(third)));
    assert_eq!(refusal(|bus| bus.safety_present = false), Some(StartupError::NoSafetyModule));
    for version in [0, 60, 256, 1000] {
        let expected = StartupError::UnknownFirmware { node: third, version };
        assert_eq!(refusal(|bus| bus.pucks[2].version = version), Some(expected), "VERS {version}");
    }
    let expected = StartupError::UnknownFirmware { node: Node::SAFETY_MODULE, version: 300 };
    assert_eq!(refusal(|bus| bus.safety_version = 300), Some(expected));
    assert_eq!(refusal(|bus| bus.pucks[2].groups = [0, 2, 4]), Some(StartupError::WrongGroups(third)));
    let expected = StartupError::WrongPlace { node: third, place: 2 };
    assert_eq!(refusal(|bus| bus.pucks[2].place = 2), Some(expected));
    let expected = StartupError::WrongTorqueLimit { node: third, limit: 0 };
    assert_eq!(refusal(|bus| bus.pucks[2].torque_limit = 0), Some(expected));
    assert_eq!(refusal(|bus| bus.pucks[6].poles = 8), Some(StartupError::NotAWrist { poles: 8 }));
    let expected = StartupError::Calibration(control::CalibrationError::TorqueCounts(2));
    assert_eq!(refusal(|bus| bus.pucks[2].torque_counts = 0), Some(expected));
}

/// A puck of a motor whose node number is that of the safety module would be told to load limits, and its MODE would be
/// believed. The change that makes it fail: the safety module is not asked for its ROLE.
#[test]
fn a_safety_module_that_says_it_is_something_else_is_named() {
    for role in [0_u16, 1, 3, 256] {
        let expected = StartupError::WrongRole { node: Node::SAFETY_MODULE, role };
        assert_eq!(refusal(|bus| bus.safety_role = role.into()), Some(expected));
    }
}

/// The module is slow, and its words have no acknowledge. The change that makes it fail: the limit is asked for at
/// once.
#[test]
fn behind_each_limit_that_is_reloaded_the_safety_module_is_asked_if_it_listens() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    let requests = bus.log.iter().filter_map(|(_, frame)| Request::decode(frame).ok());
    let to_safety: Vec<_> = requests.filter(|request| request.to == SAFETY).map(|request| request.action).collect();
    let load = safety_property(Property::Load);
    let behind = |pair: &[Action]| match pair {
        [Action::Set { property, value }, next] if *property == load => Some((*value, *next)),
        _ => None,
    };
    let found: Vec<_> = to_safety.windows(2).filter_map(behind).collect();
    let limits =
        [Property::Vl1, Property::Vl2, Property::Tl1, Property::Tl2].map(|limit| safety_property(limit).number());
    let expected = limits.map(|limit| (i32::from(limit), Action::Get { property: PropertyId::STAT }));
    assert_eq!(found, expected);
}

/// A puck needs time to boot once the arm has power. The change that makes it fail: one that does not answer the first
/// search is told as missing, and a person looks at its cable for nothing.
#[test]
fn a_puck_that_boots_late_is_waited_for_and_one_that_never_answers_is_named_within_a_second() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks[2].present = false;
    bus.run_until(&mut core, Stage::Enumerating);
    bus.run(&mut core, 0.3);
    bus.pucks[2].present = true;
    bus.run_until(&mut core, Stage::WaitingForZero);
    assert!(!bus.events.iter().any(|event| matches!(event, EventKind::Blocked(_))), "{:?}", bus.events);

    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks[2].present = false;
    bus.run_until(&mut core, Stage::Enumerating);
    bus.run(&mut core, 1.0);
    assert!(bus.events.contains(&EventKind::Blocked(StartupError::MissingPuck(Node::ARM[2]))), "{:?}", bus.events);
}

/// The change that makes it fail: `check_limit` accepts whatever it reads, or looks at another limit.
#[test]
fn e3_a_safety_module_that_would_not_stop_the_arm_is_named_and_nothing_is_armed() {
    for limit in [0, -1, 4097, 32_767] {
        let expected = StartupError::SafetyVelocity { limit };
        assert_eq!(refusal(|bus| bus.safety_limits[1] = limit), Some(expected), "VL2 {limit}");
    }
    // A torque that the device may send must not end in IDLE; one that no frame carries never does.
    for limit in [0, 4600, 8192, 32_767] {
        let expected = StartupError::SafetyTorque { limit };
        assert_eq!(refusal(|bus| bus.safety_limits[3] = limit), Some(expected), "TL2 {limit}");
    }
    // Slower, or warned of at another value, is for the lab to decide.
    for limits in [[0, 1, 0, 4601], [4096, 4096, 8191, 8191]] {
        let (mut core, mut bus) = (silent_device(), Bus::idle());
        bus.safety_limits = limits;
        bus.run_until(&mut core, Stage::WaitingForZero);
        assert_eq!(core.health().blocked, None, "{limits:?}");
    }
}

/// The module is mended while the device tries again: a person loads the right limits.
#[test]
fn e3_the_start_up_goes_on_once_the_safety_module_has_its_limits() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.safety_limits[1] = 0;
    bus.run_until(&mut core, Stage::Blocked);
    bus.safety_limits[1] = 4096;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().blocked, None);
}

#[test]
fn a_position_that_was_not_taken_is_noticed_before_the_safety_module_is_told() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks[3].ignores_position_writes = true;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::Blocked);
    assert_eq!(core.health().blocked, Some(StartupError::ZeroNotTaken(Node::ARM[3])));
    assert!(!bus.safety_zero && !core.health().zeroed);
}

#[test]
fn lost_answers_are_asked_for_again() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::Reading);
    bus.pucks[0].lose_properties = 1;
    bus.pucks[5].lose_properties = 2;
    bus.run_until(&mut core, Stage::WaitingForZero);
    assert!(!bus.events.iter().any(|event| matches!(event, EventKind::Blocked(_))));
}

#[test]
fn an_arm_without_a_sensor_starts_too() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.sensor_present = false;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.5);
    let asked = bus.log.iter().filter(|(_, frame)| frame.can_id().raw() == 8 && frame.payload() == [54]).count();
    assert_eq!(asked, 0);
    assert_eq!(core.health().counters.lost_replies, 0);
    let health = core.health();
    assert_eq!((health.wrench_zeroed, health.payload), (None, control::Payload::None));
}

#[test]
fn the_wrench_has_its_zero_after_the_first_rest_and_none_after_a_new_start() {
    let (mut core, mut bus) = started();
    assert_eq!(core.health().payload, control::Payload::SensorAndHand);
    // The rest is 0.3 s long.
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().wrench_zeroed, Some(false));
    bus.run(&mut core, 0.5);
    assert_eq!(core.health().wrench_zeroed, Some(true));
    bus.press_emergency_stop();
    bus.run(&mut core, 0.5);
    assert_ne!(core.health().wrench_zeroed, Some(true), "the pucks were off");
    assert_eq!(core.health().zeroed_at, None, "and so were the encoders");
}

/// The change that makes it fail: every start forgets the zero of the wrench, and the first rest takes what presses for
/// a new one. The sensor was awake and not tared by its own command, for that very reason.
#[test]
fn b5_what_presses_on_the_sensor_while_the_bus_is_started_anew_is_not_tared_away() {
    let (mut core, mut bus) = started();
    bus.run(&mut core, 1.0);
    let force = |bus: &Bus| {
        let [x, y, z, ..] = bus.records.last().expect("cycles").wrench;
        (x * x + y * y + z * z).sqrt()
    };
    let before = force(&bus);
    bus.sensor.force[0] += 20 * 256;
    bus.run(&mut core, 0.5);
    let pressed = force(&bus);
    core.note_bus_error(true);
    bus.run(&mut core, 0.1);
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 1.0);
    assert!(before < 0.1 && pressed > 10.0, "{before} N, {pressed} N");
    assert_eq!(core.health().wrench_zeroed, Some(true));
    assert!((force(&bus) - pressed).abs() < 0.1, "{before} N, {pressed} N, {} N after the start", force(&bus));
    // A person stands beside an arm that is zeroed, and nothing presses.
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(&mut core, 0.05);
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 1.0);
    assert!(force(&bus) < 0.1, "{} N", force(&bus));
}

#[test]
fn an_impossible_home_is_refused_by_its_joint() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    for (joint, angle) in [(0, f32::NAN), (1, 2.5), (3, f32::INFINITY), (6, -3.2)] {
        let mut home = HOME;
        home[joint] = angle;
        bus.commands.push_back(Command::Zero { home });
        bus.run(&mut core, 0.01);
        let refusal = Refusal::HomeOutOfRange { joint: joint as u8 };
        assert_eq!(bus.events.last(), Some(&EventKind::Refused(refusal)));
    }
    assert_eq!(core.stage(), Stage::WaitingForZero);
    assert!(bus.sets().all(|(_, _, property, _)| property != PropertyId::POSITION));
}

#[test]
fn the_arm_is_not_zeroed_under_torque() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.press_activate();
    bus.run(&mut core, 0.5);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(&mut core, 0.1);
    assert_eq!(bus.events.last(), Some(&EventKind::Refused(Refusal::ZeroNeedsIdle)));
    assert!(bus.sets().all(|(_, _, property, _)| property != PropertyId::POSITION));
}

#[test]
fn a_running_arm_can_be_zeroed_again_at_rest() {
    let (mut core, mut bus) = started();
    bus.run(&mut core, 0.2);
    let home = [0.1, -1.9, 0.0, 3.0, 0.0, 0.0, 0.0];
    bus.commands.push_back(Command::Zero { home });
    bus.run_until(&mut core, Stage::Zeroing);
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.1);
    let record = bus.records.last().expect("cycles run again");
    for (q, home) in record.q.iter().zip(home) {
        assert!((q - home).abs() < 1e-3, "{:?}", record.q);
    }
}

#[test]
fn commands_before_the_end_of_the_start_up_are_refused_with_its_stage() {
    let (mut core, mut bus) = (silent_device(), Bus::in_emergency_stop());
    bus.run(&mut core, 2.0);
    bus.commands.push_back(control::Command::Gravity.into());
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(&mut core, 0.1);
    let refusal = EventKind::Refused(Refusal::NotReady(Stage::WaitingForIdle));
    assert_eq!(bus.events.iter().filter(|event| **event == refusal).count(), 2, "{:?}", bus.events);
}

#[test]
fn an_emergency_stop_while_zero_is_awaited_starts_from_the_beginning() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.press_emergency_stop();
    bus.run_until(&mut core, Stage::WaitingForIdle);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForZero);
    assert!(bus.pucks.iter().all(|puck| puck.awake_at.is_some()), "the pucks were woken again");
}
