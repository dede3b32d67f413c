//! The hand while the bus is started anew: what is told of it meanwhile, and what brings it back.

use control::{Command as Control, Fault, State};
use device::{Command, Controller, DeviceController, EventKind, HandFailure, Refusal, Stage, StartupError};
use link::HandStage;
use puck::Node;

use crate::digit::Digit;
use crate::double::{Bus, HOME, holding_with_hand, holding_with_ready_hand, silent_device};

/// An arm at rest, IDLE, whose hand is ready.
fn resting_with_ready_hand() -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.press_idle();
    bus.run(&mut core, 0.2);
    (core, bus)
}

/// The change that makes it fail: only a loss that ends the loop suspends the hand.
#[test]
fn a_hand_that_nobody_asks_is_not_told_to_be_ready_while_a_failed_zeroing_keeps_the_arm_from_its_loop() {
    for estop in [false, true] {
        let (mut core, mut bus) = resting_with_ready_hand();
        bus.pucks[3].ignores_position_writes = true;
        bus.commands.push_back(Command::Zero { home: HOME });
        bus.run_slots(&mut core, 2);
        if estop {
            bus.press_emergency_stop();
        } else {
            bus.run_until(&mut core, Stage::Blocked);
        }
        bus.run(&mut core, 0.3);
        assert_eq!(core.health().hand, HandStage::Absent, "{:?}", core.stage());
        assert_eq!(core.health().hand_temperatures, [None; 4]);
        let told = bus.events.iter().rev().find(|event| matches!(event, EventKind::Hand { .. }));
        assert_eq!(told, Some(&EventKind::Hand { stage: HandStage::Absent, cause: None }));
        bus.commands.push_back(Command::InitialiseHand);
        bus.run_slots(&mut core, 2);
        assert_eq!(bus.events.last(), Some(&EventKind::Refused(Refusal::NotReady(core.stage()))));
    }
}

/// A zeroing that is refused changes nothing. The change that makes it fail: an arm without a zero waits for the next
/// zeroing outside its loop, with a hand that nobody asks any more.
#[test]
fn a_refused_zeroing_of_an_arm_that_has_lost_its_zero_leaves_the_hand_in_the_loop() {
    let (mut core, mut bus) = resting_with_ready_hand();
    bus.pucks[3].position.0 += 8_000;
    bus.run(&mut core, 0.3);
    assert_eq!((core.stage(), core.health().zeroed), (Stage::WaitingForZero, false));
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_slots(&mut core, 8);
    bus.press_activate();
    bus.run(&mut core, 1.0);
    assert!(bus.events.contains(&EventKind::Refused(Refusal::ZeroNeedsIdle)), "{:?}", bus.events);
    assert_eq!((core.stage(), core.health().zeroed), (Stage::WaitingForZero, false));
    let cycles = core.health().cycle;
    bus.run(&mut core, 0.1);
    assert!(core.health().cycle > cycles, "its loop goes on");
    bus.digits[1].lose_power();
    bus.run(&mut core, 0.5);
    assert_eq!(core.health().hand, HandStage::Failed, "somebody asks it");
    // And a person gets on, once the lost puck has been woken.
    bus.press_idle();
    bus.run(&mut core, 0.5);
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(&mut core, 0.05);
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert!(core.health().zeroed);
}

/// An arm that was zeroed and stands, IDLE, whose hand lacks this digit since the start-up.
fn without_digit(digit: usize) -> (Box<DeviceController>, Bus) {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    bus.digits[digit].present = false;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    let missing = EventKind::Hand { stage: HandStage::Absent, cause: Some((Node::HAND[digit], HandFailure::Missing)) };
    assert!(bus.events.contains(&missing), "{:?}", bus.events);
    bus.run(&mut core, 1.0);
    assert_eq!((core.stage(), core.health().hand), (Stage::WaitingForActive, HandStage::Absent), "it does not answer");
    (core, bus)
}

/// The change that makes it fail: only a hand of which no puck answered is looked for.
#[test]
fn g4_a_digit_that_was_missing_at_the_start_up_brings_the_hand_back_once_it_answers() {
    for digit in 0..4 {
        let (mut core, mut bus) = without_digit(digit);
        bus.digits[digit].present = true;
        bus.run(&mut core, 0.3);
        let reason = StartupError::AnswersLate(Node::HAND[digit]);
        assert!(bus.events.contains(&EventKind::Blocked(reason)), "{:?}", bus.events);
        bus.run_until(&mut core, Stage::WaitingForActive);
        let health = core.health();
        assert_eq!((health.hand, health.fault, health.zeroed), (HandStage::NotInitialised, Fault::None, true));
        let faults =
            bus.events.iter().filter(|event| matches!(event, EventKind::Entered(_, fault) if *fault != Fault::None));
        assert_eq!(faults.count(), 0, "{:?}", bus.events);
        holds_with_a_ready_hand_again(&mut core, &mut bus);
    }
}

/// A person activates the arm, has it hold and initialises its hand.
fn holds_with_a_ready_hand_again(core: &mut DeviceController, bus: &mut Bus) {
    bus.press_activate();
    bus.run_until(core, Stage::Ready);
    bus.commands.extend([Control::Hold.into(), Command::InitialiseHand]);
    bus.run(core, 8.0);
    assert_eq!((core.health().state, core.health().hand), (State::Hold, HandStage::Ready), "{:?}", bus.events);
}

/// A hand of three digits does not stop the arm, and neither does the fourth: it weighs what it weighed. The change
/// that makes it fail: it is looked for under an ACTIVE safety module too.
#[test]
fn a_missing_digit_that_answers_while_the_arm_is_active_waits_until_it_is_idle() {
    let (mut core, mut bus) = without_digit(2);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    bus.digits[2].present = true;
    bus.run(&mut core, 1.0);
    assert_eq!(core.stage(), Stage::Ready, "{:?}", bus.events);
    bus.commands.push_back(Control::Hold.into());
    bus.run(&mut core, 1.0);
    assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None), "{:?}", bus.events);
    bus.commands.push_back(Control::Release.into());
    bus.run(&mut core, 3.0);
    bus.press_idle();
    bus.run(&mut core, 0.4);
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::NotInitialised);
}

/// A puck that has restarted sleeps, and nobody wakes it but a start-up: every initialisation failed,
/// until an emergency stop. The change that makes it fail: only pucks that the start-up missed are looked for.
#[test]
fn g2_a_hand_that_lost_a_puck_in_the_loop_is_woken_and_initialised_once_the_arm_is_idle() {
    for digit in 0..4 {
        let (mut core, mut bus) = holding_with_ready_hand();
        bus.digits[digit].lose_power();
        bus.run(&mut core, 1.0);
        assert_eq!((core.health().hand, core.health().state), (HandStage::Failed, State::Hold));
        bus.commands.push_back(Control::Release.into());
        bus.run(&mut core, 3.0);
        bus.press_idle();
        bus.run(&mut core, 0.5);
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!((core.health().hand, core.health().zeroed), (HandStage::NotInitialised, true), "{:?}", bus.events);
        holds_with_a_ready_hand_again(&mut core, &mut bus);
    }
}

/// A start-up of which a puck of the hand lost the answers, or that it slept through, is begun anew once the arm is
/// idle. The change that makes it fail: only pucks that did not answer at all are looked for.
#[test]
fn g4_a_hand_whose_answers_were_lost_in_the_start_up_comes_back_once_the_arm_is_idle() {
    for (digit, sleeps) in [(0, false), (2, true), (3, false), (3, true)] {
        let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
        if sleeps {
            bus.digits[digit].never_wakes = true;
        } else {
            bus.digits[digit].lose_groups = 3;
        }
        bus.run_until(&mut core, Stage::WaitingForZero);
        bus.digits[digit].never_wakes = false;
        bus.commands.push_back(Command::Zero { home: HOME });
        bus.run_until(&mut core, Stage::WaitingForActive);
        let failure = if sleeps { HandFailure::DidNotWake } else { HandFailure::NoAnswer };
        let lost = EventKind::Hand { stage: HandStage::Absent, cause: Some((Node::HAND[digit], failure)) };
        assert!(bus.events.contains(&lost), "{:?}", bus.events);
        bus.run(&mut core, 0.5);
        bus.run_until(&mut core, Stage::WaitingForActive);
        let health = core.health();
        assert_eq!((health.hand, health.zeroed), (HandStage::NotInitialised, true), "{:?}", bus.events);
    }
}

/// The change that makes it fail: a start-up is begun anew as often as it fails.
#[test]
fn a_hand_that_never_wakes_keeps_the_arm_from_its_loop_for_three_more_start_ups_and_no_longer() {
    let (mut core, mut bus) = (silent_device(), Bus::idle().with_hand());
    bus.digits[1].never_wakes = true;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 20.0);
    let late = EventKind::Blocked(StartupError::AnswersLate(Node::HAND[1]));
    assert_eq!(bus.events.iter().filter(|event| **event == late).count(), 3, "{:?}", bus.events);
    assert_eq!((core.stage(), core.health().hand), (Stage::WaitingForActive, HandStage::Absent));
    // With a new start of the pucks it is looked for anew.
    bus.press_emergency_stop();
    bus.run(&mut core, 1.0);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.digits[1].never_wakes = false;
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.5);
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::NotInitialised, "{:?}", bus.events);
}

/// A puck that has restarted sleeps. The change that makes it fail: only a hand that is ready is watched.
#[test]
fn g2_a_hand_that_restarts_before_it_is_initialised_is_told_at_once_and_woken_once_the_arm_is_idle() {
    for digit in 0..4 {
        let (mut core, mut bus) = holding_with_hand();
        bus.run(&mut core, 1.0);
        assert_eq!(core.health().hand, HandStage::NotInitialised, "an awake hand is left as it is");
        bus.digits[digit].lose_power();
        bus.run(&mut core, 1.0);
        let reset = EventKind::Hand { stage: HandStage::Failed, cause: Some((Node::HAND[digit], HandFailure::Reset)) };
        assert_eq!(bus.events.last(), Some(&reset), "{:?}", bus.events);
        assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None));
        bus.commands.push_back(Control::Release.into());
        bus.run(&mut core, 3.0);
        bus.press_idle();
        bus.run(&mut core, 0.5);
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!((core.health().hand, core.health().zeroed), (HandStage::NotInitialised, true), "{:?}", bus.events);
        bus.press_activate();
        bus.run_until(&mut core, Stage::Ready);
        bus.commands.extend([Control::Hold.into(), Command::InitialiseHand]);
        bus.run(&mut core, 8.0);
        assert_eq!((core.health().state, core.health().hand), (State::Hold, HandStage::Ready), "{:?}", bus.events);
    }
}

/// G2: a hand that was ready and loses a digit over a new start is not ready when that one comes back, not even if it
/// was awake all the while.
#[test]
fn g2_a_hand_that_was_ready_and_came_back_digit_by_digit_is_initialised_anew() {
    for restarts in [false, true] {
        let (mut core, mut bus) = resting_with_ready_hand();
        bus.digits[1].present = false;
        core.note_bus_error(true);
        bus.run(&mut core, 0.1);
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!(core.health().hand, HandStage::Absent);
        if restarts {
            bus.digits[1].lose_power();
        }
        bus.digits[1].present = true;
        bus.run(&mut core, 0.3);
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!(core.health().hand, HandStage::NotInitialised, "{:?}", bus.events);
    }
}

#[test]
fn a_hand_that_kept_its_power_stays_ready_over_a_new_start() {
    let (mut core, mut bus) = holding_with_ready_hand();
    core.note_bus_error(true);
    bus.run(&mut core, 0.1);
    assert_eq!(core.health().hand, HandStage::Absent, "nothing is known while the bus starts");
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::Ready);

    bus.press_emergency_stop();
    bus.run(&mut core, 1.0);
    bus.press_idle();
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::NotInitialised, "it lost its power, and with it its positions");
}

#[test]
fn a_hand_woken_by_a_start_up_that_failed_is_not_taken_for_one_that_kept_its_power() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.press_emergency_stop();
    bus.run(&mut core, 1.0);
    bus.pucks[3].never_wakes = true;
    bus.press_idle();
    bus.run(&mut core, 4.0);
    assert!(core.health().blocked.is_some() && bus.digits[0].awake_at.is_some());
    bus.pucks[3].never_wakes = false;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::NotInitialised);
}

#[test]
fn a_hand_that_is_ready_stays_so_over_a_zeroing_that_fails() {
    let (mut core, mut bus) = holding_with_ready_hand();
    bus.press_idle();
    bus.run(&mut core, 0.2);
    bus.pucks[3].ignores_position_writes = true;
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::Blocked);
    bus.pucks[3].ignores_position_writes = false;
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.run(&mut core, 0.5);
    assert_eq!(core.health().hand, HandStage::Ready, "it kept its power: its fingers need not open again");

    // One that loses its power meanwhile has lost its positions.
    bus.pucks[3].ignores_position_writes = true;
    bus.commands.push_back(Command::Zero { home: [0.1, 0.5, 0.1, 1.5, 0.1, 0.2, 0.1] });
    bus.run_until(&mut core, Stage::Blocked);
    bus.pucks[3].ignores_position_writes = false;
    bus.digits.iter_mut().for_each(Digit::lose_power);
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().hand, HandStage::NotInitialised);
}
