//! A sensor that misses the questions of the start-up (fault G4): what hangs on the arm is not "nothing".

use control::model::WeightCorrection;
use control::{Command as Control, Fault, Payload, State};
use device::{Controller, EventKind, Stage, StartupError, StoredWeight};
use puck::{Node, PropertyId, get};

use crate::double::{Bus, silent_device};

#[test]
fn g4_a_sensor_that_answers_late_is_found_before_torque_or_stops_it_softly() {
    for torque in [false, true] {
        let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
        bus.sensor_present = false;
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!(core.health().payload, Payload::None);
        if torque {
            bus.press_activate();
            bus.run_until(&mut core, Stage::Ready);
            bus.commands.push_back(Control::Gravity.into());
            bus.run(&mut core, 0.2);
            assert_eq!(core.health().state, State::Gravity, "{:?}", bus.events);
        }
        bus.sensor_present = true;
        bus.run(&mut core, 0.3);
        let reason = EventKind::Blocked(StartupError::AnswersLate(Node::FORCE_TORQUE));
        if torque {
            let health = core.health();
            assert_eq!((health.state, health.fault), (State::SoftStop, Fault::OtherPayload), "{:?}", bus.events);
            bus.commands.push_back(Control::ClearFault.into());
            bus.run(&mut core, 0.1);
            assert_eq!(core.health().fault, Fault::OtherPayload, "not while it carries what it does not know");
            bus.press_idle();
            bus.run(&mut core, 0.1);
        }
        assert!(bus.events.contains(&reason), "{:?}", bus.events);
        // What comes after: started anew with what is there, cleared, armed.
        bus.run_until(&mut core, Stage::WaitingForActive);
        assert_eq!(core.health().payload, Payload::SensorAndHand);
        bus.press_activate();
        bus.run_until(&mut core, Stage::Ready);
        bus.run(&mut core, 0.1);
        bus.commands.push_back(Control::ClearFault.into());
        bus.run(&mut core, 0.1);
        bus.commands.push_back(Control::Hold.into());
        bus.run(&mut core, 0.3);
        assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None), "{:?}", bus.events);
    }
}

/// A sensor that has restarted sleeps, and a start-up alone wakes it. The change that makes it fail: only a sensor that
/// the start-up missed is looked for, or one that is woken is believed to have kept its tare.
#[test]
fn g8_a_sensor_that_restarts_is_woken_and_gets_another_zero_once_the_arm_is_idle() {
    for torque in [false, true] {
        let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
        bus.run_until(&mut core, Stage::WaitingForActive);
        bus.run(&mut core, 1.0);
        assert_eq!((core.stage(), core.health().wrench_zeroed), (Stage::WaitingForActive, Some(true)));
        if torque {
            bus.press_activate();
            bus.run_until(&mut core, Stage::Ready);
            bus.commands.push_back(Control::Hold.into());
            bus.run(&mut core, 0.5);
        }
        let tares = |bus: &Bus| bus.sets().filter(|(_, _, property, _)| *property == PropertyId::FORCE_TORQUE).count();
        let before = tares(&bus);
        bus.sensor_awake_at = None;
        bus.run(&mut core, 1.0);
        if torque {
            assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None), "a hold goes on");
            bus.commands.push_back(Control::Release.into());
            bus.run(&mut core, 3.0);
            bus.press_idle();
            bus.run(&mut core, 1.0);
        }
        bus.run_until(&mut core, Stage::WaitingForActive);
        bus.run(&mut core, 1.0);
        assert!(bus.sensor_awake_at.is_some(), "{:?}", bus.events);
        assert_eq!(tares(&bus), before + 1, "it has forgotten its tare");
        let health = core.health();
        assert_eq!((health.fault, health.zeroed, health.wrench_zeroed), (Fault::None, true, Some(true)));
        bus.press_activate();
        bus.run_until(&mut core, Stage::Ready);
        bus.commands.push_back(Control::Hold.into());
        bus.run(&mut core, 0.5);
        assert_eq!((core.health().state, core.health().fault), (State::Hold, Fault::None), "{:?}", bus.events);
        let last = bus.records.last().expect("cycles");
        assert_eq!(last.flags & control::flags::CONTACT_UNSEEN, 0);
    }
}

/// One that is awake and whose measurements are lost is no reason to begin anew. The change that makes it fail: any
/// answer of a silent sensor is.
#[test]
fn a_sensor_whose_measurements_are_lost_and_that_is_awake_does_not_have_the_start_up_begun_anew() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.lose_wrenches = true;
    bus.run(&mut core, 5.0);
    assert_eq!((core.stage(), core.health().counters.restarts), (Stage::WaitingForActive, 0), "{:?}", bus.events);
}

#[test]
fn g4_one_lost_question_to_the_sensor_does_not_decide_what_the_arm_carries() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    let question = get(Node::FORCE_TORQUE, PropertyId::STAT);
    while core.stage() != Stage::WaitingForActive {
        // The question of the search before the arm has power, and the first one after it.
        bus.sensor_present = bus.log.iter().filter(|(_, frame)| *frame == question).count() >= 2;
        bus.run_slots(&mut core, 1);
        assert!(bus.now_us < 10_000_000, "stuck in {:?}", core.stage());
    }
    assert_eq!(core.health().payload, Payload::SensorAndHand, "{:?}", bus.events);
}

/// Declares what the arm carries, as a weight that the device keeps.
fn declared(payload: Payload) -> StoredWeight {
    StoredWeight::Kept(WeightCorrection::none(payload))
}

#[test]
fn g4_a_declared_payload_that_who_answers_contradicts_blocks_until_one_of_them_changes() {
    for (hand, payload, other) in
        [(true, Payload::SensorAndHand, Payload::None), (false, Payload::None, Payload::SensorAndHand)]
    {
        for mends_cable in [true, false] {
            let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
            assert!(core.weigh(&declared(payload)));
            bus.sensor_present = !hand;
            bus.run_until(&mut core, Stage::Blocked);
            assert_eq!(core.health().blocked, Some(StartupError::PayloadContradicted { hand }));
            // It is tried again each second, and the reason stays.
            bus.run(&mut core, 2.5);
            assert_eq!(core.health().blocked, Some(StartupError::PayloadContradicted { hand }));
            assert_eq!(core.health().state, State::Idle);
            if mends_cable {
                bus.sensor_present = hand;
            } else {
                assert!(core.weigh(&declared(other)));
            }
            bus.run_until(&mut core, Stage::WaitingForActive);
            assert_eq!(core.health().payload, if mends_cable { payload } else { other });
            assert_eq!(core.health().blocked, None);
        }
    }
}

#[test]
fn g4_a_declaration_in_the_loop_is_compared_at_once_and_the_arm_is_not_armed_with_what_it_contradicts() {
    let (mut core, mut bus) = (silent_device(), Bus::already_zeroed());
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert_eq!(core.health().payload, Payload::SensorAndHand);
    assert!(core.weigh(&declared(Payload::SensorAndHand)));
    bus.run(&mut core, 0.2);
    assert_eq!((core.stage(), core.health().blocked), (Stage::WaitingForActive, None));
    assert!(core.weigh(&declared(Payload::None)));
    bus.run_until(&mut core, Stage::Blocked);
    assert_eq!(core.health().blocked, Some(StartupError::PayloadContradicted { hand: false }));
    // Nothing is declared any more: the start-up believes who answers.
    assert!(core.weigh(&StoredWeight::Nothing));
    bus.run_until(&mut core, Stage::WaitingForActive);
    bus.press_activate();
    bus.run_until(&mut core, Stage::Ready);
    bus.commands.push_back(Control::Hold.into());
    bus.run(&mut core, 0.3);
    assert_eq!(core.health().state, State::Hold, "{:?}", bus.events);
    // With torque it is not taken; the session gives it again later.
    assert!(!core.weigh(&declared(Payload::None)));
    bus.run(&mut core, 0.5);
    assert_eq!(core.health().state, State::Hold, "{:?}", bus.events);
}
