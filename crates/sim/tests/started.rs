//! An arm that was up before the co-controller was switched on, and torques that come late.

use puck::hand::angles;
use puck::{Counts, Group, Node, Property, PropertyId, PuckTorque, Reply, SafetyMode, get, packed_torques};
use sim::{FreeJoints, HOME, HandTargets, OperatorConfig, PendantAction, PlantConfig, SafetyConfig, Ticks, World};

use crate::common;
use crate::common::{CYCLE_TICKS, Master};

fn started() -> PlantConfig {
    PlantConfig { started: true, operator: OperatorConfig::prompt(), ..PlantConfig::default() }
}

#[test]
fn a_started_arm_answers_at_once_with_the_true_positions() {
    let hand = HandTargets { inner: [0.5, 0.6, 0.7], outer: [0.5 / 3.0, 0.2, 0.7 / 3.0], spread: 1.2 };
    let mut master = Master::with_world(started(), FreeJoints::new(HOME).with_hand(hand));
    for node in Node::ARM.into_iter().chain(Node::HAND).chain([Node::FORCE_TORQUE]) {
        assert_eq!(master.value(node, PropertyId::STAT), Some(2), "{node:?}");
        assert_eq!(master.value(node, PropertyId::VERS), Some(200), "{node:?}");
    }
    assert_eq!(master.safety_value(Property::Mode), SafetyMode::Idle.value());
    assert_eq!(master.safety_value(Property::Zero), 1);
    // The operator takes the weight at this moment: a tenth of a degree of sag is the arm's, not the encoders'.
    let reported = master.positions();
    for (position, there) in reported.into_iter().zip(common::counts_at(&master.plant.world().motor_positions())) {
        assert!((position.expect("awake").0 - there.0).abs() <= 2, "{position:?} and {there:?}");
    }
    let (mut primary, mut secondary) = ([Counts(0); 4], [None; 3]);
    for reply in master.ask(get(Group::HAND, PropertyId::POSITION)) {
        let Reply::Position { node, primary: motor, secondary: worm } = reply else { panic!("{reply:?}") };
        let digit = node.hand_index().expect("a digit");
        primary[digit] = motor;
        if let Some(place) = secondary.get_mut(digit) {
            *place = worm;
        }
    }
    let told = angles::<f64>(&primary, &secondary);
    for finger in 0..3 {
        assert!((told.inner[finger] - hand.inner[finger]).abs() < 1e-4, "{told:?}");
        assert!((told.outer[finger] - hand.outer[finger]).abs() < 1e-4, "{told:?}");
    }
    assert!((told.spread - hand.spread).abs() < 1e-3, "{told:?}");
}

#[test]
fn the_operator_of_a_started_arm_activates_it_when_positions_flow_and_not_before() {
    let mut master = Master::new(started());
    master.wait_ms(500);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Idle, "nobody has asked for positions");
    master.poll(40);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
    master.poll(500);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active, "and stays so: no late press of Shift-Idle");
}

#[test]
fn a_started_arm_loses_everything_in_an_emergency_stop_like_any_other() {
    let mut master = Master::new(started());
    master.plant.press(PendantAction::PressEStop);
    assert_eq!(master.positions(), [None; 7]);
    master.plant.press(PendantAction::ReleaseEStop);
    master.plant.press(PendantAction::ShiftIdle);
    master.wait_ms(50);
    assert_eq!(master.value(Node::ARM[0], PropertyId::STAT), Some(0));
    assert_eq!(master.safety_value(Property::Zero), 0);
}

/// When joint 1 first moves after a packed torque was handed over, in ticks.
fn response_time(cycles: u8) -> Ticks {
    let config = PlantConfig {
        torque_delay: Ticks::from(cycles) * CYCLE_TICKS,
        safety: SafetyConfig { heartbeat: None, ..SafetyConfig::default() },
        operator: OperatorConfig { holds_until_active_for: None, ..OperatorConfig::prompt() },
        ..started()
    };
    let mut master = Master::with_world(config, FreeJoints::weightless([0.0; 7]));
    master.poll(40);
    assert_eq!(master.plant.safety_mode(), SafetyMode::Active);
    let zero = PuckTorque::ZERO;
    let torques = [PuckTorque::new(-1000).unwrap(), zero, zero, zero];
    let begun = master.now;
    master.send(packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, torques));
    loop {
        master.wait(1);
        if master.plant.world().joint_velocities()[0] != 0.0 {
            return master.now - begun;
        }
        assert!(master.now - begun < 10 * CYCLE_TICKS, "it never moves");
    }
}

#[test]
fn extra_delay_is_exactly_so_many_control_cycles() {
    let at_once = response_time(0);
    for cycles in 1..=3 {
        // Physics steps divide the cycle, so that the response shows in the same step of a later cycle.
        assert_eq!(response_time(cycles) - at_once, Ticks::from(cycles) * CYCLE_TICKS);
    }
}

/// A world whose cables stretch: the motors stand elsewhere than the joints.
struct Stretched(FreeJoints);

impl World for Stretched {
    fn joint_positions(&self) -> [f64; 7] {
        self.0.joint_positions()
    }
    fn joint_velocities(&self) -> [f64; 7] {
        self.0.joint_velocities()
    }
    fn motor_positions(&self) -> [f64; 7] {
        self.0.joint_positions().map(|angle| angle + 0.01)
    }
    fn step(&mut self, torques: &[f64; 7]) {
        self.0.step(torques);
    }
    fn wrist_wrench(&self) -> [f64; 6] {
        self.0.wrist_wrench()
    }
    fn grasp_pose(&self) -> sim::Pose {
        self.0.grasp_pose()
    }
    fn push(&mut self, force: [f64; 3], torque: [f64; 3]) {
        self.0.push(force, torque);
    }
    fn hand(&self) -> sim::HandState {
        self.0.hand()
    }
    fn drive_hand(&mut self, targets: &HandTargets) {
        self.0.drive_hand(targets);
    }
}

#[test]
fn encoders_see_the_motor_side_of_the_cables() {
    let position = |world: Box<dyn World>| {
        let mut plant = sim::Plant::new(started(), world);
        plant.submit(0, get(Node::ARM[0], PropertyId::POSITION));
        loop {
            let next = plant.next_event().expect("the puck answers");
            if let Some(frame) = plant.event(next).received {
                let Ok(Reply::Position { primary, .. }) = Reply::decode(&frame) else { panic!("{frame:?}") };
                return primary.0;
            }
        }
    };
    let straight = position(Box::new(FreeJoints::weightless([0.0; 7])));
    let stretched = position(Box::new(Stretched(FreeJoints::weightless([0.0; 7]))));
    // M1 = -42 J1: 10 mrad are 273.8 counts.
    assert!((stretched - straight + 274).abs() <= 1, "{straight} and {stretched}");
}
