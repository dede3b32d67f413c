//! Time: whoever looks when, the same things happen; and what was decided stays decided.

use proptest::prelude::*;
use puck::{CanFrame, Group, Node, PropertyId, PuckTorque, get, packed_torques, set};
use sim::{BusTrace, FreeJoints, HOME, Plant, PlantConfig, Ticks, World};
use std::any::Any;

use crate::common::{Master, SLOT_TICKS};

/// Torques that change from cycle to cycle.
fn torques(slot: u32) -> CanFrame {
    let torque = |phase: u32| PuckTorque::new((slot * 37 + phase * 91) as i16 % 400).unwrap();
    packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [torque(0), torque(1), torque(2), torque(3)])
}

/// Two seconds of start-up and polling during which somebody looks at the given moments in each slot.
fn run(looks: &[Ticks]) -> (BusTrace, [f64; 7]) {
    let mut plant = Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(HOME)));
    let mut t = 0;
    for slot in 0..1800_u32 {
        for look in looks {
            plant.advance(t + look % SLOT_TICKS);
        }
        let frame = match slot {
            90..97 => Some(set(Node::ARM[slot as usize - 90], PropertyId::STAT, 2)),
            // Without the safety module: the pucks take the mode from anybody.
            1100 => Some(set(Group::ARM, PropertyId::MODE, 2)),
            _ if slot % 3 == 1 => Some(torques(slot)),
            _ if slot % 3 == 0 => Some(get(Group::ARM, PropertyId::POSITION)),
            _ if slot % 90 == 1 => Some(get(Node::SAFETY_MODULE, PropertyId::MODE)),
            _ => None,
        };
        t += SLOT_TICKS;
        if let Some(frame) = frame {
            plant.submit(t, frame);
        }
    }
    plant.advance(t);
    (plant.trace(), plant.world().joint_positions())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(16))]

    #[test]
    fn how_often_somebody_looks_changes_nothing(mut looks in proptest::collection::vec(0..SLOT_TICKS, 0..8)) {
        looks.sort_unstable();
        prop_assert_eq!(run(&looks), run(&[]));
    }
}

#[test]
fn next_event_never_announces_a_frame_too_late() {
    // Every frame is delivered at the very tick at which its end was announced.
    let mut master = Master::new(PlantConfig::default());
    master.plant.record_bus();
    master.wake();
    master.heard.clear();
    master.poll(100);
    let ends: Vec<Ticks> = master.plant.recorded().iter().map(|passage| passage.end).collect();
    assert!(master.heard.len() > 200);
    for (at, frame) in &master.heard {
        assert!(ends.contains(at), "{frame:?} came at {at}, which is no frame's end");
    }
}

#[test]
fn a_frame_submitted_while_the_bus_waits_for_a_puck_goes_first() {
    let mut master = Master::new(PlantConfig::default());
    master.wake();
    master.plant.record_bus();
    master.send(get(Node::ARM[0], PropertyId::STAT));
    let end = master.plant.next_event().expect("the end of the frame");
    master.wait(end + 1000 - master.now);
    // The puck's answer wants the bus 75 us after the request; the host is there before it.
    master.send(get(Node::ARM[1], PropertyId::STAT));
    master.wait_ms(2);
    let ids: Vec<u16> = master.plant.recorded().iter().map(|passage| passage.frame.can_id().raw()).collect();
    assert_eq!(ids, [0x001, 0x002, 0x426, 0x446]);
}

#[test]
fn the_owner_gets_its_own_world_back() {
    let mut plant = Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(HOME)));
    let any: &mut dyn Any = plant.world();
    let world = any.downcast_mut::<FreeJoints>().expect("the world that was put in");
    assert_eq!(world.joint_positions(), HOME);
}

#[test]
fn a_configuration_that_describes_no_arm_is_refused() {
    let plant = |config| Plant::try_new(config, Box::new(FreeJoints::new(HOME))).map(|_| ());
    let mut config = PlantConfig::default();
    config.ratios.coefficients[3] = 0.0;
    assert!(plant(config).unwrap_err().to_string().contains("gear ratio"));
    let mut config = PlantConfig::default();
    config.pucks.units_per_newton_metre[6] = 0;
    assert!(plant(config).unwrap_err().to_string().contains("motor 7"));
    let mut config = PlantConfig::default();
    config.pucks.version = 0;
    assert!(plant(config).unwrap_err().to_string().contains("firmware version 0"));
}
