//! The hand while the bus is started anew: what is told of it meanwhile, and what brings it back.

use device::{Command, Controller, DeviceController, EventKind, Refusal, Stage};
use link::HandStage;

use crate::double::{Bus, HOME, holding_with_ready_hand};

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
    // And a person gets on.
    bus.press_idle();
    bus.run(&mut core, 0.1);
    bus.commands.push_back(Command::Zero { home: HOME });
    bus.run(&mut core, 0.05);
    bus.run_until(&mut core, Stage::WaitingForActive);
    assert!(core.health().zeroed);
}
