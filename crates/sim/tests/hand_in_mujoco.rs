//! The hand's drives and the links of the MuJoCo world work together: no chatter, the worm locks, the gauge feels the
//! object.
#![cfg(feature = "mujoco")]

use puck::{Group, MotorMode, Node, Property, PropertyId, PuckTorque, packed_torques, set};
use sim::world::mujoco::{MujocoOptions, MujocoWorld};
use sim::{HandState, OperatorConfig, PlantConfig};

use crate::common;
use crate::common::{Master, motor_id};

/// A started arm in the default scene, its hand in torque mode.
fn torque_mode() -> Master {
    let world = MujocoWorld::new(&MujocoOptions::default()).expect("the default scene loads");
    let config = PlantConfig { started: true, operator: OperatorConfig::prompt(), ..PlantConfig::default() };
    let mut master = Master::with_any_world(config, Box::new(world));
    for node in Node::HAND {
        master.set(node, motor_id(Property::Tstop), 0);
    }
    master.send(set(Group::HAND, PropertyId::MODE, MotorMode::Torque.value()));
    master.wait_ms(2);
    master
}

/// Streams a torque to the three fingers and gives the state of the hand every cycle.
fn squeeze(master: &mut Master, units: i16, milliseconds: u64) -> Vec<HandState> {
    let torque = PuckTorque::new(units).expect("a torque that fits");
    let frame = packed_torques(Group::HAND, PropertyId::TORQUE, [torque, torque, torque, PuckTorque::ZERO]);
    (0..milliseconds * 3 / 10)
        .map(|_| {
            master.send(frame);
            master.wait(common::CYCLE_TICKS);
            master.plant.world().hand()
        })
        .collect()
}

#[test]
fn free_fingers_close_smoothly_to_their_stops() {
    let mut master = torque_mode();
    let states = squeeze(&mut master, 1600, 600);
    for pair in states[30..].windows(2) {
        for finger in 0..3 {
            assert!(pair[1].inner[finger] > pair[0].inner[finger] - 1e-3, "no going back: {pair:?}");
            assert!(pair[1].inner_load[finger].abs() < 0.6, "nothing but weight and friction: {:?}", pair[1]);
        }
    }
    let last = states.last().expect("states");
    for finger in 0..3 {
        assert!((last.outer[finger] - last.inner[finger] / 3.0).abs() < 0.05, "{last:?}");
        assert!(last.inner[finger] > 0.7, "{last:?}");
    }
}

#[test]
fn fingers_that_press_on_each_other_stay_where_the_worms_hold_them() {
    let mut master = torque_mode();
    squeeze(&mut master, 2080, 2500);
    master.send(set(Group::HAND, PropertyId::MODE, 0));
    master.wait_ms(300);
    let before = master.plant.world().hand();
    master.wait_ms(1000);
    let after = master.plant.world().hand();
    for finger in 0..3 {
        assert!((after.inner[finger] - before.inner[finger]).abs() < 2e-3, "{before:?} {after:?}");
        assert!((after.inner_load[finger] - before.inner_load[finger]).abs() < 0.15, "{before:?} {after:?}");
    }
    master.send(set(Group::HAND, PropertyId::MODE, MotorMode::Torque.value()));
    let opened = squeeze(&mut master, -2080, 2000);
    let last = opened.last().expect("states");
    assert!(
        last.inner.iter().chain(&last.outer).all(|angle| *angle < 0.06),
        "the open stop mends the clutch: {last:?}"
    );
}

#[test]
fn the_default_targets_are_where_the_hand_is() {
    let mut master = torque_mode();
    let before = master.plant.world().hand();
    master.wait_ms(200);
    let after = master.plant.world().hand();
    for finger in 0..3 {
        assert!((after.inner[finger] - before.inner[finger]).abs() < 0.01, "{before:?} {after:?}");
    }
}
