//! The hand: found, woken, initialised by a person alone, read and driven in every cycle, and lost without the arm.

use control::{Command as Control, Fault, RunOptions, State, flags};
use device::{Command, Controller, EventKind, HandFailure, Refusal, Slot, Stage};
use link::HandStage;
use puck::hand::angles;
use puck::{
    Action, CanFrame, Counts, Destination, Group, MotorMode, Node, Property, PropertyId, PropertyTable, PuckTorque,
    Request,
};

use crate::double::{
    Bus, HOME, STOPS_US, floating, holding_with_hand, holding_with_ready_hand, silent_device, started,
};

/// Slots of a control cycle.
const CYCLE: usize = 3;

const HAND: Destination = Destination::Group(Group::HAND);

fn id(property: Property) -> PropertyId {
    PropertyTable::motor(200).expect("known").id(property).expect("a property of the hand")
}

fn is_for_hand(to: Destination) -> bool {
    to == HAND || matches!(to, Destination::Node(node) if node.hand_index().is_some())
}

/// Everything that was sent to the hand since the frame with this index of the log, with its time.
fn to_hand(bus: &Bus, begin: usize) -> Vec<(u64, Destination, Action)> {
    let requests = bus.log[begin..].iter().map(|(time, frame)| (*time, Request::decode(frame).expect("a request")));
    requests
        .filter(|(_, request)| is_for_hand(request.to))
        .map(|(time, request)| (time, request.to, request.action))
        .collect()
}

fn sets(bus: &Bus, begin: usize) -> Vec<(Destination, PropertyId, i32)> {
    let set = |(_, to, action)| match action {
        Action::Set { property, value } => Some((to, property, value)),
        _ => None,
    };
    to_hand(bus, begin).into_iter().filter_map(set).collect()
}

fn news(bus: &Bus) -> Vec<(HandStage, Option<(Node, HandFailure)>)> {
    let hand = |event: &EventKind| match event {
        EventKind::Hand { stage, cause } => Some((*stage, *cause)),
        _ => None,
    };
    bus.events.iter().filter_map(hand).collect()
}

fn set_mode(to: impl Into<Destination>, mode: MotorMode) -> (Destination, PropertyId, i32) {
    (to.into(), PropertyId::MODE, mode.value())
}

fn hand_torques(bus: &Bus, begin: usize) -> Vec<[PuckTorque; 4]> {
    let torque = |(_, to, action)| match action {
        Action::PackedTorques { torques, .. } => (to == HAND).then_some(torques),
        _ => None,
    };
    to_hand(bus, begin).into_iter().filter_map(torque).collect()
}

/// The hand was asked for its modes and temperatures since then, and told nothing.
fn only_questions(bus: &Bus, begin: usize) -> bool {
    let asked = [PropertyId::MODE, id(Property::Temp)];
    let is_question = |action| matches!(action, Action::Get { property } if asked.contains(&property));
    to_hand(bus, begin).into_iter().all(|(_, _, action)| is_question(action))
}

fn move_hand(bus: &mut Bus) {
    bus.commands.push_back(Control::MoveHand { q: [0.2, 0.6, 0.6, 0.6], duration: 1.0 }.into());
}

#[test]
fn an_arm_without_a_hand_hears_nothing_of_one() {
    let (mut core, mut bus) = floating();
    assert_eq!((core.health().hand, news(&bus)), (HandStage::Absent, vec![]));
    let sent = to_hand(&bus, 0);
    let is_stop = |action: &Action| *action == Action::Set { property: PropertyId::MODE, value: 0 };
    assert!(sent.first().is_some_and(|(_, _, first)| is_stop(first)), "it may be driven from an earlier life");
    let is_asked = |action: &Action| matches!(action, Action::Get { property: PropertyId::STAT });
    assert!(
        sent.iter().all(|(time, _, action)| is_asked(action) || (is_stop(action) && *time <= STOPS_US)),
        "{sent:?}"
    );
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.1);
    assert!(bus.events.contains(&EventKind::Refused(Refusal::NoHand)));
    assert_eq!(core.health().state, State::Gravity);
}

#[test]
fn a_hand_is_woken_braked_and_then_left_alone_until_a_person_asks() {
    let (core, bus) = holding_with_hand();
    assert_eq!((core.health().hand, news(&bus)), (HandStage::NotInitialised, vec![(HandStage::NotInitialised, None)]));
    let mut expected = vec![set_mode(Group::HAND, MotorMode::Idle)];
    expected.extend(Node::HAND.into_iter().map(|node| (Destination::Node(node), PropertyId::STAT, 2)));
    expected.push(set_mode(Group::HAND, MotorMode::Idle));
    let mut sets = sets(&bus, 0);
    sets.dedup();
    assert_eq!(sets, expected);
    let asked = |property| {
        let question = Action::Get { property };
        to_hand(&bus, 0).iter().any(|(_, _, action)| *action == question)
    };
    assert!(!asked(PropertyId::POSITION) && !asked(id(Property::Sg)), "positions mean nothing yet");
    assert!(asked(PropertyId::MODE), "somebody else may set modes");
    let degrees = core.health().hand_temperatures;
    assert_eq!(degrees, [Some(41), Some(42), Some(43), Some(44)]);
}

#[test]
fn the_initialisation_is_that_of_the_reference() {
    let (mut core, mut bus) = holding_with_hand();
    let begin = bus.log.len();
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 7.0);
    assert_eq!(bus.events.iter().filter(|event| **event == EventKind::Accepted).count(), 3, "zero, hold, initialise");
    assert_eq!(
        news(&bus)[1..],
        [(HandStage::Initialising, None), (HandStage::Ready, None)],
        "{:?}",
        bus.digits.each_ref().map(|digit| digit.mode)
    );
    assert!(bus.digits.iter().all(|digit| digit.initialised && digit.stall_ms == 0));
    let command = |node| (Destination::Node(node), id(Property::Cmd), 13);
    let stall = |node| (Destination::Node(node), id(Property::Tstop), 0);
    let [f1, f2, f3, spread] = Node::HAND;
    let expected =
        [command(f1), command(f2), command(f3), command(spread), stall(f1), stall(f2), stall(f3), stall(spread)];
    assert_eq!(sets(&bus, begin), expected);
    // From the first command until they rest nothing but GET MODE, ten times a second; the double watches that too.
    let sent = to_hand(&bus, begin);
    let place = |wanted: (Destination, PropertyId, i32)| {
        let action = Action::Set { property: wanted.1, value: wanted.2 };
        sent.iter().position(|(_, to, sent)| (*to, *sent) == (wanted.0, action)).expect("sent")
    };
    let question = Action::Get { property: PropertyId::POSITION };
    let measured = sent.iter().position(|(_, _, action)| *action == question).expect("they are checked");
    assert!(measured < place(stall(f1)));
    let polls: Vec<u64> = sent[place(command(f1))..measured]
        .iter()
        .filter(|(_, _, action)| !matches!(action, Action::Set { .. }))
        .map(|(time, to, action)| {
            assert_eq!((*to, *action), (HAND, Action::Get { property: PropertyId::MODE }));
            *time
        })
        .collect();
    assert!(polls.windows(2).all(|pair| pair[1] - pair[0] >= 99_000), "{polls:?}");
    assert!(polls.len() >= 30, "{} polls in 3.7 s", polls.len());
    assert_eq!(core.health().state, State::Hold, "the arm holds all the while");
}

#[test]
fn a_lost_command_is_given_again() {
    let (mut core, mut bus) = holding_with_hand();
    bus.digits[1].lose_commands = 1;
    bus.digits[3].lose_commands = 1;
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 12.0);
    assert_eq!(core.health().hand, HandStage::Ready);
    assert!(bus.digits.iter().all(|digit| digit.initialised));
}

#[test]
fn an_initialisation_that_was_broken_off_is_noticed() {
    let (mut core, mut bus) = holding_with_hand();
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 1.0);
    // As the safety module's broadcast of MODE may do: the puck is at rest, but not where it counts from.
    bus.digits[1].break_off();
    bus.run(&mut core, 6.0);
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, Some((Node::FINGERS[1], HandFailure::NotZeroed)))));
    let (mut core, mut bus) = holding_with_hand();
    bus.digits[3].lose_commands = 2;
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 7.0);
    let cause = Some((Node::SPREAD, HandFailure::NotZeroed));
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, cause)), "both commands were lost");
}

#[test]
fn an_initialisation_that_does_not_end_fails_and_is_braked() {
    let (mut core, mut bus) = holding_with_hand();
    bus.digits[2].work_us = 60_000_000;
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 12.0);
    let cause = Some((Node::FINGERS[2], HandFailure::TimedOut));
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, cause)));
    assert_eq!(bus.digits[2].mode, MotorMode::Idle, "a finger that still drives is stopped");
    let begin = bus.log.len();
    bus.run(&mut core, 1.0);
    assert!(only_questions(&bus, begin), "and left alone");
    assert_eq!(core.health().state, State::Hold);
    // A person may try again.
    bus.digits[2].work_us = 1_000_000;
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 7.0);
    assert_eq!(core.health().hand, HandStage::Ready);
}

#[test]
fn g11_the_hand_moves_in_its_initialisation_and_in_a_move_and_a_stop_ends_both() {
    let (mut core, mut bus) = holding_with_hand();
    assert!(!core.health().hand_moves);
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.5);
    assert!(core.health().hand_moves, "it is being initialised");
    bus.commands.push_back(Control::Stop.into());
    bus.run(&mut core, 0.1);
    assert!(!core.health().hand_moves);

    let (mut core, mut bus) = holding_with_ready_hand();
    assert!(!core.health().hand_moves);
    move_hand(&mut bus);
    bus.run(&mut core, 0.5);
    assert!(core.health().hand_moves, "it moves for a second");
    bus.run(&mut core, 1.0);
    assert!(!core.health().hand_moves, "it has arrived");
    move_hand(&mut bus);
    bus.run(&mut core, 0.1);
    bus.commands.push_back(Control::Stop.into());
    bus.run(&mut core, 0.1);
    assert!(!core.health().hand_moves);
}

#[test]
fn a_stop_ends_the_initialisation() {
    let (mut core, mut bus) = holding_with_hand();
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.5);
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.1);
    assert!(bus.events.contains(&EventKind::Refused(Refusal::HandBusy)), "one at a time");
    bus.commands.push_back(Control::Stop.into());
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().hand, HandStage::NotInitialised);
    assert!(bus.digits.iter().all(|digit| digit.mode == MotorMode::Idle && !digit.initialised));
}

/// G11: a stop and a new order in one breath. The double fails if a digit under way hears anything but the word to
/// brake.
#[test]
fn g11_a_hand_that_is_initialised_right_after_a_stop_is_braked_first() {
    for slots in 0..12 {
        let (mut core, mut bus) = holding_with_hand();
        bus.commands.push_back(Command::InitialiseHand);
        bus.run(&mut core, 0.5);
        bus.run_slots(&mut core, slots);
        bus.commands.extend([Control::Stop.into(), Command::InitialiseHand]);
        bus.run(&mut core, 0.1);
        assert_eq!(core.health().hand, HandStage::Initialising, "{:?}", bus.events);
    }
}

#[test]
fn a_digit_that_falls_silent_in_the_initialisation_is_named() {
    let (mut core, mut bus) = holding_with_hand();
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 1.0);
    bus.digits[0].lose_power();
    bus.run(&mut core, 1.0);
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, Some((Node::FINGERS[0], HandFailure::Silent)))));
}

#[test]
fn every_cycle_asks_the_hand_once_behind_the_torques_of_the_arm() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.run_to(&mut core, Slot::Control);
    let begin = bus.log.len();
    let lost = core.health().counters.hand_lost_replies;
    for _ in 0..300 {
        let control = bus.log.len();
        bus.run_slots(&mut core, 1);
        let ids: Vec<u16> = bus.log[control..].iter().map(|(_, frame)| frame.can_id().raw()).collect();
        assert_eq!(ids, [0x401, 0x402, 0x405, 0x405]);
        bus.run_slots(&mut core, 2);
    }
    let asked = |property| {
        let question = Action::Get { property };
        to_hand(&bus, begin).iter().filter(|(_, to, action)| (*to, *action) == (HAND, question)).count()
    };
    assert_eq!([asked(PropertyId::POSITION), asked(id(Property::Sg))], [300; 2]);
    assert_eq!(core.health().counters.hand_lost_replies, lost);
    assert!(bus.records.iter().rev().take(300).all(|record| record.flags & flags::HAND_READY != 0));
}

#[test]
fn what_the_hand_tells_reaches_the_next_cycle() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.run_to(&mut core, Slot::Request);
    for (digit, counts) in [(0, 400), (1, 300), (2, 200), (3, 50)] {
        bus.digits[digit].position = Counts(counts);
        bus.digits[digit].secondary = bus.digits[digit].secondary.map(|_| Counts(counts * 2 / 5));
    }
    bus.run_slots(&mut core, CYCLE);
    let before = bus.records.last().expect("a record").hand;
    assert!(before.iter().all(|angle| angle.abs() < 1e-6), "asked in this cycle, known in the next: {before:?}");
    bus.run_slots(&mut core, CYCLE);
    let angles = angles::<f32>(
        &[Counts(400), Counts(300), Counts(200), Counts(50)],
        &[Some(Counts(160)), Some(Counts(120)), Some(Counts(80))],
    );
    let [f1, f2, f3] = angles.inner;
    let measured = bus.records.last().expect("a record").hand;
    for (measured, expected) in measured.into_iter().zip([angles.spread, f1, f2, f3]) {
        assert!((measured - expected).abs() < 1e-4, "{measured} is not {expected}");
    }
}

#[test]
fn lost_replies_of_the_hand_are_counted_and_leave_the_arm_alone() {
    let (mut core, mut bus) = holding_with_ready_hand();
    let before = core.health().counters;
    bus.digits[1].lose = 4;
    bus.run_slots(&mut core, 5 * CYCLE);
    let after = core.health().counters;
    assert_eq!(after.hand_lost_replies - before.hand_lost_replies, 4, "two cycles of position and gauge");
    assert_eq!(after.lost_replies, before.lost_replies);
    assert_eq!((core.health().hand, core.health().state), (HandStage::Ready, State::Hold));
}

#[test]
fn torque_mode_comes_before_torque_and_goes_after_it() {
    let (mut core, mut bus) = holding_with_ready_hand();
    let begin = bus.log.len();
    bus.run(&mut core, 0.5);
    assert!(hand_torques(&bus, begin).is_empty(), "nobody has moved the hand");
    let begin = bus.log.len();
    move_hand(&mut bus);
    bus.run(&mut core, 0.2);
    assert_eq!(sets(&bus, begin), [set_mode(Group::HAND, MotorMode::Torque)]);
    let sent = to_hand(&bus, begin);
    let mode = sent.iter().position(|(_, _, action)| matches!(action, Action::Set { .. })).expect("the mode");
    let torque =
        sent.iter().position(|(_, _, action)| matches!(action, Action::PackedTorques { .. })).expect("a torque");
    assert!(mode < torque, "torque in the wrong mode");
    assert!(hand_torques(&bus, begin).iter().any(|torques| torques.iter().any(|torque| *torque != PuckTorque::ZERO)));
    // Without a law the worm drives hold: zeros at once, then IDLE, then nothing.
    let begin = bus.log.len();
    bus.commands.push_back(Control::Release.into());
    bus.run(&mut core, 2.5);
    assert_eq!(core.health().state, State::Idle);
    let torques = hand_torques(&bus, begin);
    let driven = torques.iter().rposition(|torques| *torques != [PuckTorque::ZERO; 4]).map_or(0, |last| last + 1);
    assert_eq!(torques.len() - driven, 3, "three cycles of zeros");
    assert_eq!(sets(&bus, begin), [set_mode(Group::HAND, MotorMode::Idle)]);
    assert!(bus.digits.iter().all(|digit| digit.mode == MotorMode::Idle));
}

#[test]
fn a_digit_in_another_mode_is_told_again_within_a_fifth_of_a_second() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.digits[3].lose_modes = 1;
    move_hand(&mut bus);
    bus.run(&mut core, 0.3);
    assert!(bus.digits.iter().all(|digit| digit.mode == MotorMode::Torque), "the spread missed the first SET");
    bus.digits[0].mode = MotorMode::Idle;
    let begin = bus.log.len();
    bus.run(&mut core, 0.2);
    assert_eq!(sets(&bus, begin), [set_mode(Node::FINGERS[0], MotorMode::Torque)]);
    assert_eq!(bus.digits[0].mode, MotorMode::Torque);
}

#[test]
fn a_hand_puck_that_resets_costs_the_hand_and_not_the_arm() {
    let (mut core, mut bus) = holding_with_ready_hand();
    move_hand(&mut bus);
    bus.run(&mut core, 0.2);
    bus.digits[2].lose_power();
    let now = bus.now_us;
    while core.health().hand == HandStage::Ready {
        bus.run_slots(&mut core, 1);
        assert!(bus.now_us - now < 30_000, "not found in time");
    }
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, Some((Node::FINGERS[2], HandFailure::Reset)))));
    bus.run(&mut core, 0.02);
    let begin = bus.log.len();
    bus.run(&mut core, 1.0);
    assert!(only_questions(&bus, begin), "the others are stopped and left alone");
    assert_eq!(bus.digits[0].mode, MotorMode::Idle);
    let record = bus.records.last().expect("a record");
    assert_eq!((record.state, record.flags & flags::HAND_READY), (State::Hold, 0));
    assert_eq!(core.health().counters.restarts, 0);
}

#[test]
fn a_hand_that_falls_silent_altogether_is_given_up_after_a_fifth_of_a_second() {
    let (mut core, mut bus) = holding_with_ready_hand();
    for digit in &mut bus.digits {
        digit.present = false;
    }
    bus.run(&mut core, 0.15);
    assert_eq!(core.health().hand, HandStage::Ready);
    bus.run(&mut core, 0.1);
    assert_eq!(news(&bus).last(), Some(&(HandStage::Failed, Some((Node::FINGERS[0], HandFailure::Silent)))));
    assert_eq!(core.health().state, State::Hold);
}

/// The arm starts with this hand; what is told of it.
fn verdict(break_something: impl FnOnce(&mut Bus)) -> (HandStage, Option<(Node, HandFailure)>) {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    break_something(&mut bus);
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: crate::double::HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    let said = *news(&bus).last().expect("something is told");
    assert_eq!(said.0, core.health().hand);
    let begin = bus.log.len();
    bus.run(&mut core, 0.5);
    let asked = Action::Get { property: PropertyId::STAT };
    let looked_for =
        said.1.filter(|(_, failure)| *failure == HandFailure::Missing).map(|(node, _)| (node.into(), asked));
    let left_alone = to_hand(&bus, begin).into_iter().all(|(_, to, action)| Some((to, action)) == looked_for);
    // One that may wake the next time is woken anew: `hand_anew`.
    let may_wake = said.1.is_some_and(|(_, failure)| failure == HandFailure::DidNotWake);
    assert!(said.0 != HandStage::Absent || left_alone || may_wake, "an unfit hand is left alone");
    said
}

#[test]
fn whatever_is_wrong_with_a_hand_is_named_and_the_arm_starts_without_it() {
    let [f1, f2, f3, spread] = Node::HAND;
    let absent = |node, failure| (HandStage::Absent, Some((node, failure)));
    assert_eq!(verdict(|_| {}), (HandStage::NotInitialised, None));
    assert_eq!(verdict(|bus| bus.digits[2].present = false), absent(f3, HandFailure::Missing));
    assert_eq!(verdict(|bus| bus.digits[1].never_wakes = true), absent(f2, HandFailure::DidNotWake));
    assert_eq!(verdict(|bus| bus.digits[0].role = 0), absent(f1, HandFailure::WrongRole));
    assert_eq!(verdict(|bus| bus.digits[3].version = 115), absent(spread, HandFailure::UnknownFirmware));
    assert_eq!(verdict(|bus| bus.digits[0].groups = [0, 5, 1]), absent(f1, HandFailure::WrongGroups));
    assert_eq!(verdict(|bus| bus.digits[1].place = 3), absent(f2, HandFailure::WrongPlace));
    assert_eq!(verdict(|bus| bus.digits[3].counts = 40_960), absent(spread, HandFailure::WrongScale));
    assert_eq!(verdict(|bus| bus.digits[2].torque_counts = 0), absent(f3, HandFailure::WrongScale));
    assert_eq!(
        verdict(|bus| bus.digits[2].groups = [0, 5, 5]),
        (HandStage::NotInitialised, None),
        "as one driver writes it"
    );
}

/// The change that makes it fail: a hand of which a puck does not answer the first search is dropped, and the arm
/// starts without it.
#[test]
fn a_puck_of_the_hand_that_boots_late_is_waited_for() {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    bus.digits[2].present = false;
    bus.run_until(&mut core, Stage::Enumerating);
    bus.run(&mut core, 0.3);
    bus.digits[2].present = true;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: crate::double::HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(news(&bus).last(), Some(&(HandStage::NotInitialised, None)));
}

#[test]
fn commands_to_the_hand_before_the_end_of_the_start_up_are_refused_with_its_stage() {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.1);
    assert_eq!(bus.events.last(), Some(&EventKind::Refused(Refusal::NotReady(Stage::WaitingForZero))));
    let (mut core, mut bus) = started();
    move_hand(&mut bus);
    bus.run(&mut core, 0.1);
    assert!(matches!(bus.events.last(), Some(EventKind::Refused(_))), "{:?}", bus.events);
}

/// A frame for the hand that is nobody's business.
#[test]
fn foreign_frames_from_the_hand_are_counted_and_change_nothing() {
    let (mut core, mut bus) = holding_with_ready_hand();
    let before = core.health().counters.foreign_frames;
    let frame: CanFrame = puck::device::reply16(Node::SPREAD, PropertyId::STAT, 0);
    bus.inject(frame);
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().counters.foreign_frames - before, 1);
    assert_eq!(core.health().hand, HandStage::Ready, "nobody had asked for its STAT");
}

/// G11: a SET has no acknowledge. A digit that has missed the word to brake tells it by its MODE.
#[test]
fn g11_a_digit_that_misses_the_word_to_brake_of_a_stop_is_told_again() {
    for digit in 0..3 {
        let (mut core, mut bus) = holding_with_hand();
        bus.commands.push_back(Command::InitialiseHand);
        bus.run(&mut core, 0.5);
        bus.digits[digit].lose_brakes = 1;
        bus.commands.push_back(Control::Stop.into());
        bus.run(&mut core, 0.3);
        assert_eq!((core.health().hand, bus.digits[digit].lose_brakes), (HandStage::NotInitialised, 0));
        assert_eq!(bus.digits[digit].mode, MotorMode::Idle, "digit {digit} drives on after a stop");
    }
}

/// Seen: while a puck of the arm was silent, the questions to it took every slot that the hand could have had; a stop
/// was accepted, and the digits drove on until the bus was started anew, up to a second later. The change that makes it
/// fail: a puck that is silent is asked before the hand is told to brake.
#[test]
fn a_stop_reaches_a_hand_that_moves_while_a_puck_of_the_arm_is_silent() {
    for silent_for in [10, 30, 100, 300] {
        let (mut core, mut bus) = holding_with_hand();
        bus.commands.push_back(Command::InitialiseHand);
        bus.run(&mut core, 0.5);
        bus.pucks[3].lose = u32::MAX;
        bus.run_slots(&mut core, silent_for);
        assert!(bus.digits[..3].iter().all(|digit| digit.mode != MotorMode::Idle), "{silent_for} slots");
        bus.commands.push_back(Control::Stop.into());
        bus.run(&mut core, 0.03);
        assert_eq!(core.health().hand, HandStage::NotInitialised, "{silent_for} slots: {:?}", bus.events);
        assert!(bus.digits.iter().all(|digit| digit.mode == MotorMode::Idle), "{silent_for} slots: they drive on");
    }
}

/// The same of a hand that fails under torque: pucks keep the last torque that they were sent.
#[test]
fn a_digit_that_misses_the_word_to_brake_of_a_hand_that_fails_is_told_again() {
    let (mut core, mut bus) = holding_with_ready_hand();
    move_hand(&mut bus);
    bus.run(&mut core, 0.3);
    assert_ne!(bus.digits[0].torque, PuckTorque::ZERO);
    bus.digits[1].lose_power();
    bus.digits[0].lose_brakes = 1;
    bus.run(&mut core, 0.6);
    assert_eq!(core.health().hand, HandStage::Failed);
    assert_eq!(bus.digits[0].mode, MotorMode::Idle, "it keeps a torque of {:?}", bus.digits[0].torque);
}

/// G11: while the arm is being zeroed no frame goes to the hand, and a stop would be accepted and do nothing.
#[test]
fn g11_an_arm_is_not_zeroed_while_its_hand_is_initialised_so_that_a_stop_reaches_it() {
    let (mut core, mut bus) = holding_with_hand();
    bus.press_idle();
    bus.run(&mut core, 0.5);
    bus.commands.push_back(Command::InitialiseHand);
    bus.run(&mut core, 0.5);
    assert_eq!(core.health().hand, HandStage::Initialising);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_slots(&mut core, 3 * CYCLE);
    bus.commands.push_back(Control::Stop.into());
    bus.run(&mut core, 0.7);
    assert_eq!(core.health().hand, HandStage::NotInitialised, "a stop was accepted: {:?}", bus.events);
    assert!(bus.digits.iter().all(|digit| digit.mode == MotorMode::Idle));
    assert!(bus.events.contains(&EventKind::Refused(Refusal::HandBusy)));
}

/// The change that makes it fail: a run is accepted. Its plan goes on without the digits, and they are driven to where
/// it is then as fast as their drives can, once they answer.
#[test]
fn g11_no_run_begins_while_the_hand_is_initialised() {
    let (mut core, mut bus) = holding_with_hand();
    bus.commands.extend([Command::InitialiseHand, Control::Run(RunOptions::default()).into()]);
    bus.run(&mut core, 0.1);
    assert_eq!((core.health().hand, core.health().state), (HandStage::Initialising, State::Hold));
    assert_eq!(bus.events.last(), Some(&EventKind::Refused(Refusal::HandBusy)), "{:?}", bus.events);
    // The arm alone may be moved.
    let up = Control::Approach { q: [0.0, 1.0, 0.0, 1.5, 0.0, 0.0, 0.0], duration: 0.0 };
    bus.commands.push_back(up.into());
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().state, State::Approach);
}

/// G14: a hot puck of the hand that resets is asked for its temperature no longer; what it told last is no reason to
/// keep the arm from being cleared for ever.
#[test]
fn g14_a_hot_hand_that_fails_does_not_keep_the_arm_from_being_cleared() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.digits[2].celsius = 85;
    bus.run(&mut core, 1.5);
    assert_eq!((core.health().state, core.health().fault), (State::SoftStop, Fault::MotorHot));
    bus.digits[2].lose_power();
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().hand, HandStage::Failed);
    bus.run(&mut core, 2.0);
    bus.commands.extend([Control::ClearFault, Control::Hold].map(Command::from));
    bus.run(&mut core, 0.1);
    assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None), "{:?}", bus.events);
}
