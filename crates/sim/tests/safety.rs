//! The safety module: who may raise the mode, and what brings it down.

use puck::safety::Health;
use puck::{
    CanFrame, Group, Node, PendantState, Property, PropertyId, PuckTorque, SafetyMode, get, packed_torques, set,
};
use sim::{OperatorConfig, PendantAction, PlantConfig, TICKS_PER_MILLISECOND};

use crate::common::{Master, home_counts, motor_id, safety_id};

fn active() -> Master {
    let mut master = Master::new(PlantConfig::default());
    master.activate();
    master
}

fn torques(largest: i16) -> CanFrame {
    let torque = |units| PuckTorque::new(units).unwrap();
    packed_torques(Group::WRIST_TORQUES, PropertyId::TORQUE, [torque(0), torque(largest), torque(0), torque(0)])
}

fn pendant(master: &mut Master) -> PendantState {
    PendantState::from_value(master.safety_value(Property::Pen)).expect("a valid pendant word")
}

/// Payloads of the frames heard from node 10 to group 0.
fn broadcasts(master: &Master) -> Vec<Vec<u8>> {
    let from_module = master.heard.iter().filter(|(_, frame)| frame.can_id().raw() == 0x540);
    from_module.map(|(_, frame)| frame.payload().to_vec()).collect()
}

#[test]
fn activation_is_announced_and_sets_the_mode_of_the_pucks() {
    let mut master = Master::new(PlantConfig::default());
    master.wake();
    master.zero();
    assert_eq!(master.motor_value(Node::ARM[3], Property::Mode), Some(0));
    master.heard.clear();
    master.poll(400);
    assert_eq!(broadcasts(&master), [[0x88, 0, 2, 0]]);
    assert_eq!(master.motor_value(Node::ARM[3], Property::Mode), Some(2));
    master.heard.clear();
    master.plant.press(PendantAction::ShiftIdle);
    master.poll(10);
    assert_eq!(broadcasts(&master), [[0x88, 0, 0, 0]]);
    assert_eq!(master.motor_value(Node::ARM[3], Property::Mode), Some(0));
}

#[test]
fn the_operator_waits_for_a_zeroed_arm_and_flowing_positions() {
    let mut master = Master::new(PlantConfig::default());
    master.wake();
    master.poll(500);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle, "positions flow, but the arm is not zeroed");
    master.zero();
    master.wait_ms(500);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle, "zeroed, but no positions");
    master.set(Node::SAFETY_MODULE, safety_id(Property::Ifault), 5);
    master.poll(280);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    master.poll(40);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
}

#[test]
fn software_can_only_lower_the_mode() {
    let mut master = active();
    let mode = PropertyId::MODE;
    master.send(set(Node::SAFETY_MODULE, mode, 1));
    master.poll(10);
    assert_eq!(master.safety_value(Property::Mode), 1);
    master.send(set(Node::SAFETY_MODULE, mode, 2));
    master.poll(10);
    assert_eq!(master.safety_value(Property::Mode), 1, "ACTIVE is for the person to give");
    master.send(set(Node::SAFETY_MODULE, mode, 0));
    master.wait_ms(10);
    assert_eq!(master.safety_value(Property::Mode), 0);
    master.send(set(Node::SAFETY_MODULE, mode, 1));
    master.wait_ms(10);
    assert_eq!(master.safety_value(Property::Mode), 0);
}

#[test]
fn limits_are_those_of_the_documents_and_revert_on_load() {
    let mut master = Master::new(PlantConfig::default());
    let limits = [(Property::Vl1, 2048), (Property::Vl2, 4096), (Property::Tl1, 4731), (Property::Tl2, 5204)];
    for (property, default) in limits {
        assert_eq!(master.safety_value(property), default);
        master.set(Node::SAFETY_MODULE, safety_id(property), 100);
        assert_eq!(master.safety_value(property), 100);
        let named = safety_id(property).number().into();
        master.set(Node::SAFETY_MODULE, safety_id(Property::Def), named);
        master.set(Node::SAFETY_MODULE, safety_id(Property::Load), named);
        assert_eq!(master.safety_value(property), default);
    }
}

#[test]
fn settings_that_come_too_fast_are_lost() {
    let mut master = Master::new(PlantConfig::default());
    for value in 1..=10 {
        master.send(set(Node::SAFETY_MODULE, safety_id(Property::Tl1), value));
    }
    master.wait_ms(50);
    assert_ne!(master.safety_value(Property::Tl1), 10);
}

#[test]
fn a_commanded_torque_above_tl2_idles_the_arm_and_tl2_itself_does_not() {
    let mut master = active();
    master.send(torques(5204));
    master.poll(10);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
    assert_eq!(pendant(&mut master).torque, Health::Warning);
    master.send(torques(0));
    master.poll(10);
    assert_eq!(pendant(&mut master).torque, Health::Safe);
    // MT of puck 6 would clip it to 3900: the module judges what it sees on the bus.
    master.send(torques(5205));
    master.poll(10);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    assert_eq!(pendant(&mut master).torque, Health::Fault);
    assert_eq!(master.motor_value(Node::ARM[5], Property::Mode), Some(0));
}

#[test]
fn negative_torques_count_by_magnitude() {
    let mut master = active();
    master.send(torques(-5205));
    master.poll(10);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
}

#[test]
fn a_latched_fault_blocks_activation_until_the_operator_presses_idle() {
    let mut master = active();
    master.send(torques(8000));
    master.poll(10);
    master.plant.press(PendantAction::ShiftActivate);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    let before = master.positions();
    master.plant.press(PendantAction::ShiftIdle);
    master.poll(400);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle, "nobody activates it unasked");
    master.plant.press(PendantAction::ShiftActivate);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
    assert!((before[1].unwrap().0 - home_counts()[1].0).abs() <= 1, "the counts survived");
}

#[test]
fn an_arm_that_runs_away_is_stopped_by_its_speed() {
    let mut master = active();
    master.poll(900); // until the operator has let go
    // A pull to the side turns joint 1, which nothing holds: torques are zero.
    master.plant.world().push([0.0, 400.0, 0.0], [0.0; 3]);
    master.poll(400);
    assert_ne!(master.plant.safety_mode(), SafetyMode::Active);
    assert_ne!(pendant(&mut master).velocity, Health::Safe);
}

#[test]
fn an_arm_that_stays_too_fast_ends_in_an_emergency_stop() {
    let mut master = active();
    master.set(Node::SAFETY_MODULE, safety_id(Property::Vl2), 20);
    // Idle motors brake, but not against a truck.
    master.plant.world().push([0.0, 0.0, 600.0], [0.0; 3]);
    master.poll(300);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    master.poll(600);
    assert_eq!(master.plant.safety_mode(), SafetyMode::EStop);
}

#[test]
fn velocity_supervision_is_off_with_vl2_zero() {
    let mut master = active();
    master.poll(900); // until the operator has let go
    master.send(set(Node::SAFETY_MODULE, safety_id(Property::Vl2), 0));
    master.poll(20);
    master.plant.world().push([0.0, 400.0, 0.0], [0.0; 3]);
    let mut fastest = 0.0_f64;
    for _ in 0..40 {
        master.poll(10);
        fastest = fastest.max(master.plant.world().joint_velocities()[0].abs());
    }
    assert!(fastest > 2.5, "{fastest} rad/s would have been a fault");
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
}

#[test]
fn positions_that_are_rewritten_without_warning_are_a_velocity_fault() {
    let jump = |ignored: Option<i32>| {
        let mut master = Master::new(PlantConfig::default());
        master.wake();
        master.poll(50);
        if let Some(count) = ignored {
            master.set(Node::SAFETY_MODULE, safety_id(Property::Ifault), count);
        }
        for (node, counts) in Node::ARM.into_iter().zip(home_counts()) {
            master.set(node, PropertyId::POSITION, counts.0);
        }
        master.poll(50);
        pendant(&mut master).velocity
    };
    assert_eq!(jump(None), Health::Fault);
    assert_eq!(jump(Some(1)), Health::Fault, "one is not enough: the history is five sets long");
    assert_eq!(jump(Some(5)), Health::Safe);
}

#[test]
fn silence_of_the_master_ends_active_within_a_tenth_of_a_second() {
    let mut master = active();
    master.wait_ms(90);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
    master.wait_ms(15);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    assert_eq!(pendant(&mut master).heartbeat, Health::Fault);
}

#[test]
fn a_missing_puck_is_no_heartbeat() {
    let mut master = active();
    // Puck 4 leaves group 4 and therefore never answers; the other six keep talking.
    master.send(set(Node::ARM[3], motor_id(Property::Grpc), 0));
    master.poll(150);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
}

#[test]
fn a_script_presses_the_emergency_stop_at_its_time() {
    let at = 70 * TICKS_PER_MILLISECOND;
    let operator = OperatorConfig { script: vec![(at, PendantAction::PressEStop)], ..OperatorConfig::default() };
    let mut master = Master::new(PlantConfig { operator, ..PlantConfig::default() });
    master.wait(at - 1);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle);
    master.wait(1);
    assert_eq!(master.plant.safety_mode(), SafetyMode::EStop);
    master.wait_ms(5);
    assert_eq!(master.plant.pendant().button, puck::safety::Button::EmergencyStop);
    assert!(master.ask(get(Group::ARM, PropertyId::STAT)).is_empty());
}
