//! The bus is started anew after a loss: whatever torque the pucks still have ends, and no zero that is doubted is
//! believed.

use device::{Command, Controller, DeviceController, EventKind, Stage, StartupError};
use puck::{MotorMode, Node, PuckTorque, SafetyMode};

use crate::double::{Bus, HOME, floating, silent_device};

/// True if a motor of the arm applies torque.
fn pulls(bus: &Bus) -> bool {
    bus.pucks.iter().any(|puck| puck.mode == MotorMode::Torque && puck.torque != PuckTorque::ZERO)
}

/// Time for which a motor applies torque once its bus is whole again, ms.
fn torque_after_outage(milliseconds: u64) -> u64 {
    let (mut core, mut bus) = floating();
    bus.deaf = true;
    bus.run(&mut core, milliseconds as f64 / 1000.0);
    assert!(pulls(&bus), "nobody told the pucks anything");
    bus.deaf = false;
    torque_lasts(&mut core, &mut bus)
}

/// Time for which a motor applies torque from now on, ms; looked at for 5 s.
fn torque_lasts(core: &mut DeviceController, bus: &mut Bus) -> u64 {
    let begin = bus.now_us;
    while pulls(bus) && bus.now_us < begin + 5_000_000 {
        bus.run_slots(core, 1);
    }
    (bus.now_us - begin) / 1000
}

/// A10: pucks keep the torque that they were sent last. A start-up that has not found the safety module rests for a
/// second, and the pucks are heard again meanwhile. The change that makes it fail: no stop frames while it rests, or
/// none once it has rested.
#[test]
fn a10_torque_ends_as_soon_as_the_bus_is_whole_again_however_long_it_was_not() {
    for milliseconds in (150..2500).step_by(50).chain([5000, 20_000]) {
        let lasts = torque_after_outage(milliseconds);
        assert!(lasts <= 100, "{lasts} ms after an outage of {milliseconds} ms");
    }
}

/// G3: a board that has restarted is not heard for a while. The change that makes it fail: only a start-up after the
/// cyclic loop repeats its stop frames.
#[test]
fn g3_a_device_that_restarts_on_a_bus_that_is_deaf_at_first_ends_the_torque_all_the_same() {
    for milliseconds in (5..300).step_by(5).chain([1000, 2500, 20_000]) {
        let (_, mut bus) = floating();
        let mut core = silent_device();
        bus.deaf = true;
        bus.run(&mut core, f64::from(milliseconds) / 1000.0);
        assert!(pulls(&bus), "nobody told the pucks anything");
        bus.deaf = false;
        let lasts = torque_lasts(&mut core, &mut bus);
        assert!(lasts <= 100, "{lasts} ms after an outage of {milliseconds} ms");
    }
}

/// Each command has one answer; that to the next one would be taken for it. The change that makes it fail: a bus
/// that is started anew forgets the answer of the same slot.
#[test]
fn a_refusal_in_the_very_cycle_in_which_the_bus_is_started_anew_is_told() {
    let answers = |bus: &Bus| {
        let is_answer = |event: &&EventKind| matches!(event, EventKind::Accepted | EventKind::Refused(_));
        bus.events.iter().filter(is_answer).count()
    };
    let mut restarts = 0;
    for slots in 0..150 {
        let (mut core, mut bus) = (silent_device(), Bus::idle());
        bus.sensor_present = false;
        bus.run_until(&mut core, Stage::WaitingForZero);
        bus.commands.push_back(Command::Zero { home: HOME });
        bus.run_until(&mut core, Stage::WaitingForActive);
        // The sensor answers late: everything is asked anew.
        (bus.sensor_present, bus.sensor_awake_at) = (true, Some(0));
        bus.run_slots(&mut core, slots);
        let before = answers(&bus);
        bus.commands.push_back(Command::Zero { home: [9.0; 7] });
        bus.run_slots(&mut core, 6);
        assert_eq!(answers(&bus) - before, 1, "after {slots} slots");
        restarts += core.health().counters.restarts;
    }
    assert!((10..140).contains(&restarts), "it comes before and after: {restarts}");
}

/// Seen: a command was answered in the cycle in which the device heard of the emergency stop, and the bus was started
/// anew before the next one: that the arm had lost its torque was told when somebody had released the stop, minutes
/// later, or never. The change that makes it fail: the bus is started anew with news that has not been told.
#[test]
fn an_emergency_stop_that_meets_a_command_is_told_at_once() {
    for slots in 0..12 {
        let (mut core, mut bus) = floating();
        bus.run_slots(&mut core, slots);
        bus.press_emergency_stop();
        let before = bus.events.len();
        // One in every cycle, more than there are until the bus is started anew.
        bus.commands.extend([Command::from(control::Command::Gravity); 8]);
        bus.run(&mut core, 0.1);
        let told = &bus.events[before..];
        let place = |event| told.iter().position(|told| *told == event);
        let dropped = place(EventKind::Entered(control::State::Idle, control::Fault::SafetyDropped));
        let begun = place(EventKind::Startup(Stage::Enumerating));
        assert!(dropped.is_some() && begun.is_some() && dropped < begun, "after {slots} slots: {told:?}");
    }
}

/// The same where a start-up that has failed begins anew. The change that makes it fail: it forgets the answer.
#[test]
fn a_refusal_in_the_very_slot_in_which_a_start_up_begins_anew_is_told() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.pucks[3].present = false;
    bus.run_until(&mut core, Stage::Blocked);
    // Longer than its rest, one in each slot.
    for _ in 0..1000 {
        bus.commands.push_back(Command::Zero { home: HOME });
        let before = bus.events.len();
        bus.run_slots(&mut core, 1);
        let told = bus.events[before..].iter().filter(|event| matches!(event, EventKind::Refused(_))).count();
        assert_eq!(told, 1, "{:?}", core.stage());
    }
    assert_ne!(core.stage(), Stage::Blocked, "it has begun anew");
}

/// G2: a safety module that is misheard once, as if the emergency stop were pressed, is no reason to believe counts
/// that began anew. The words that its zero is none were lost. The change that makes it fail: a loss of power ends the
/// doubt.
#[test]
fn g2_a_doubt_outlives_an_emergency_stop_that_was_none() {
    for tries_to_zero in [false, true] {
        let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
        bus.pucks[3].awake_at = None;
        bus.run_until(&mut core, Stage::Waking);
        // Before the puck is woken, and behind that.
        bus.lose_safety_writes = 6;
        bus.run_until(&mut core, Stage::WaitingForZero);
        bus.run(&mut core, 0.1);
        assert_eq!((bus.lose_safety_writes, bus.safety_zero), (0, true));
        bus.wrong_safety_mode = Some(SafetyMode::EStop);
        if tries_to_zero {
            bus.commands.push_back(Command::Zero { home: HOME });
        }
        bus.run(&mut core, 4.0);
        let health = core.health();
        assert_eq!((core.stage(), health.zeroed), (Stage::WaitingForZero, false), "{:?}", bus.events);
        assert_eq!(health.blocked, Some(StartupError::CountsAnew(Node::ARM[3])));
    }
}

/// The change that makes it fail: nobody looks at the pucks while a person is awaited, and the zeroing is the first to
/// find that one sleeps.
#[test]
fn g2_a_puck_that_restarts_while_zeroing_is_awaited_is_woken_before_it_and_costs_no_second_zeroing() {
    for joint in 0..7 {
        let (mut core, mut bus) = (silent_device(), Bus::idle());
        bus.run_until(&mut core, Stage::WaitingForZero);
        bus.run(&mut core, 5.0);
        assert!(!bus.events.iter().any(|event| matches!(event, EventKind::Blocked(_))), "{:?}", bus.events);
        bus.pucks[joint].awake_at = None;
        bus.run(&mut core, 2.0);
        let reason = EventKind::Blocked(StartupError::CountsAnew(Node::ARM[joint]));
        assert!(bus.events.contains(&reason), "{:?}", bus.events);
        bus.run_until(&mut core, Stage::WaitingForZero);
        bus.commands.push_back(Command::Zero { home: HOME });
        bus.run(&mut core, 0.2);
        assert_eq!(bus.events.iter().filter(|event| **event == EventKind::Accepted).count(), 1, "{:?}", bus.events);
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!((core.health().zeroed, core.health().blocked), (true, None));
    }
}

/// A puck whose answers are lost is told by who needs them, not by who looks.
#[test]
fn a_puck_that_does_not_tell_its_state_while_zeroing_is_awaited_changes_nothing() {
    let (mut core, mut bus) = (silent_device(), Bus::idle());
    bus.run_until(&mut core, Stage::WaitingForZero);
    bus.pucks[3].lose_properties = u32::MAX;
    bus.run(&mut core, 5.0);
    assert_eq!((core.stage(), core.health().blocked), (Stage::WaitingForZero, None), "{:?}", bus.events);
    // And an emergency stop is noticed all the same.
    bus.press_emergency_stop();
    bus.run(&mut core, 1.0);
    assert_ne!(core.stage(), Stage::WaitingForZero);
}
