//! Motor pucks and force/torque sensor as the master sees them.

use puck::{
    CanFrame, CanId, Counts, Destination, Group, Node, Property, PropertyId, PuckTorque, Reply, SafetyMode,
    force_torque, get, packed_torques, set, set_short,
};
use sim::{
    FreeJoints, HOME, OperatorConfig, PendantAction, PlantConfig, SafetyConfig, TICKS_PER_MICROSECOND,
    TICKS_PER_MILLISECOND,
};

use crate::common::{Master, counts_at, home_counts, motor_id, safety_id};

fn awake() -> Master {
    let mut master = Master::new(PlantConfig::default());
    master.wake();
    master
}

/// An arm that floats straight up at q = 0, watched by a module without heartbeat.
fn weightless() -> Master {
    let safety = SafetyConfig { heartbeat: None, ..SafetyConfig::default() };
    let operator = OperatorConfig { holds_until_active_for: None, ..OperatorConfig::default() };
    Master::with_world(PlantConfig { safety, operator, ..PlantConfig::default() }, FreeJoints::weightless([0.0; 7]))
}

fn torques(first: i16) -> CanFrame {
    let zero = PuckTorque::ZERO;
    packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [PuckTorque::new(first).unwrap(), zero, zero, zero])
}

#[test]
fn only_the_safety_module_answers_before_the_operator_comes() {
    let mut master = Master::new(PlantConfig::default());
    let answering: Vec<u8> =
        (1..=31).filter(|number| master.value(Node::new(*number).unwrap(), PropertyId::STAT).is_some()).collect();
    // 31 x 2 ms: the operator releases the E-stop at 50 ms, the pucks need 20 ms more.
    assert_eq!(answering, [10]);
}

#[test]
fn a_puck_in_its_monitor_answers_the_common_properties_alone() {
    let mut master = Master::new(PlantConfig::default());
    master.wait_ms(100);
    assert_eq!(master.value(Node::ARM[2], PropertyId::STAT), Some(0));
    assert_eq!(master.value(Node::ARM[2], PropertyId::VERS), Some(16));
    assert_eq!(master.value(Node::ARM[2], PropertyId::MODE), None);
    assert_eq!(master.motor_value(Node::ARM[2], Property::Cts), None);
    assert_eq!(master.positions(), [None; 7]);
}

#[test]
fn a_waking_puck_lingers_then_falls_silent_then_runs_another_version() {
    let mut master = Master::new(PlantConfig::default());
    master.wait_ms(100);
    let node = Node::ARM[4];
    master.send(set(node, PropertyId::STAT, 2));
    master.wait_ms(5);
    assert_eq!(master.value(node, PropertyId::STAT), Some(0), "it leaves the bus only after 10 ms");
    master.wait_ms(10);
    for _ in 0..28 {
        assert_eq!(master.value(node, PropertyId::STAT), None, "no puck wakes within 0.3 s");
        master.wait_ms(8);
    }
    master.wait_ms(720);
    assert_eq!(master.value(node, PropertyId::STAT), Some(2));
    assert_eq!(master.value(node, PropertyId::VERS), Some(200));
    assert_eq!(master.value(Node::ARM[5], PropertyId::STAT), Some(0), "its neighbour was not asked to wake");
}

#[test]
fn properties_of_the_drive_are_those_of_the_configuration() {
    let mut master = awake();
    for (index, node) in Node::ARM.into_iter().enumerate() {
        let config = PlantConfig::default().pucks;
        assert_eq!(master.motor_value(node, Property::Cts), Some(4096));
        assert_eq!(master.motor_value(node, Property::Ipnm), Some(config.units_per_newton_metre[index].into()));
        assert_eq!(master.motor_value(node, Property::Mt), Some(config.torque_limit[index].into()));
        assert_eq!(master.motor_value(node, Property::Grpc), Some(4));
        assert_eq!(master.motor_value(node, Property::Ecmax), Some(0));
    }
    assert_eq!(master.motor_value(Node::ARM[6], Property::Poles), Some(6), "a wrist, no gimbals");
    assert_eq!(master.motor_value(Node::ARM[6], Property::Pidx), Some(3));
}

#[test]
fn a_group_request_is_answered_in_the_order_of_nodes() {
    let mut master = awake();
    let replies = master.ask(get(Group::ARM, PropertyId::POSITION));
    let nodes: Vec<u8> = replies
        .iter()
        .map(|reply| match reply {
            Reply::Position { node, .. } => node.number(),
            other => panic!("{other:?}"),
        })
        .collect();
    assert_eq!(nodes, [1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn the_first_reply_starts_75_us_after_the_request() {
    let mut master = awake();
    master.plant.record_bus();
    master.positions();
    let passages = master.plant.recorded();
    let (request, first) = (passages[0], passages[1]);
    assert_eq!(first.start - request.received_at(), 75 * TICKS_PER_MICROSECOND);
    assert!(passages.windows(2).skip(1).all(|pair| pair[1].start == pair[0].end), "replies follow without a gap");
}

#[test]
fn all_pucks_latch_at_the_same_instant() {
    // Joint 3 turns M2 and M3 equally, M3's reply leaves 80 us later: sampled at different times they would differ.
    // Joint 2, which is thrown back by joint 3, turns them against each other.
    let mut master = weightless();
    master.activate_unzeroed();
    let torque = PuckTorque::new(-500).unwrap();
    let zero = PuckTorque::ZERO;
    master.send(packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, [zero, torque, torque, zero]));
    master.wait_ms(250);
    let speed = master.plant.world().joint_velocities()[2];
    assert!(speed > 5.0, "the joint must move fast enough to tell: {speed} rad/s");
    let mut largest = 0;
    for _ in 0..20 {
        let apart = |master: &mut Master| {
            let [_, second, third, ..] = counts_at(&master.plant.world().joint_positions());
            second.0 - third.0
        };
        let before = apart(&mut master);
        let [_, Some(second), Some(third), ..] = master.positions() else { panic!("pucks 2 and 3 answer") };
        let (read, after) = (second.0 - third.0, apart(&mut master));
        largest = largest.max(before.min(after) - read).max(read - before.max(after));
        master.wait_ms(1);
    }
    assert!(largest <= 1, "{largest} counts farther apart than at any one moment");
}

#[test]
fn the_encoder_moves_between_two_steps_of_physics() {
    let mut master = weightless();
    master.activate_unzeroed();
    master.send(torques(-1000));
    master.wait_ms(150);
    master.send(torques(0));
    master.wait_ms(1);
    let mut counts = Vec::new();
    for _ in 0..30 {
        master.heard.clear();
        master.send(get(Node::ARM[0], PropertyId::POSITION));
        master.wait(250 * TICKS_PER_MICROSECOND);
        let (_, frame) = master.heard.last().expect("the puck answers within 250 us");
        let Ok(Reply::Position { primary, .. }) = Reply::decode(frame) else { panic!("{frame:?}") };
        counts.push(primary.0);
    }
    // Sampled every 250 us, while physics steps every 556 us: without extrapolation it would stand still, then jump.
    let steps: Vec<i32> = counts.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
    let (least, most) = (steps.iter().min().unwrap(), steps.iter().max().unwrap());
    assert!(*least > 3 && most - least <= 2, "{steps:?}");
}

#[test]
fn the_position_that_is_set_is_read_back_and_moves_with_the_joint() {
    let mut master = Master::new(PlantConfig::default());
    // Time for the hands that hold the arm to come to rest: counts begin where the pucks wake up.
    master.wait_ms(500);
    master.wake();
    assert_near(master.positions(), [Counts(0); 7]);
    master.zero();
    assert_near(master.positions(), home_counts());
}

#[test]
fn positions_wrap_at_22_bits() {
    let mut master = awake();
    master.set(Node::ARM[0], PropertyId::POSITION, 2_097_152);
    assert_eq!(master.positions()[0], Some(Counts(-2_097_152)));
}

#[test]
fn both_lengths_of_a_set_are_accepted() {
    let mut master = awake();
    let id = motor_id(Property::Mt);
    master.send(set(Node::ARM[0], id, 1234));
    master.wait_ms(1);
    assert_eq!(master.value(Node::ARM[0], id), Some(1234));
    master.send(set_short(Node::ARM[0], id, 2345));
    master.wait_ms(1);
    assert_eq!(master.value(Node::ARM[0], id), Some(2345));
}

#[test]
fn a_flood_of_sets_is_lost_in_part_and_a_patient_master_loses_none() {
    let mut master = awake();
    let id = motor_id(Property::Otemp);
    for value in 0..20 {
        master.send(set(Node::ARM[0], id, value));
    }
    master.wait_ms(10);
    let lost = master.plant.lost_requests();
    assert!(lost >= 5, "only {lost} lost");
    assert_ne!(master.value(Node::ARM[0], id), None);
    for value in 20..40 {
        master.set(Node::ARM[0], id, value);
        assert_eq!(master.value(Node::ARM[0], id), Some(value));
    }
    assert_eq!(master.plant.lost_requests(), lost);
}

#[test]
fn an_unknown_property_is_not_answered() {
    let mut master = awake();
    assert_eq!(master.value(Node::ARM[0], PropertyId::new(127).unwrap()), None);
}

#[test]
fn replies_and_foreign_senders_are_no_orders() {
    let mut master = awake();
    let before = master.motor_value(Node::ARM[0], Property::Mt);
    let id = motor_id(Property::Mt).number() | 0x80;
    // A SET that claims to come from puck 3, to puck 1 and to the arm's group; and the reply format on its own.
    for destination in [Destination::Node(Node::ARM[0]), Destination::Group(Group::ARM), Group::PROPERTY_REPLIES.into()]
    {
        master.send(CanFrame::with_payload(CanId::encode(Node::ARM[2], destination), [id, 0, 1, 0]));
        master.wait_ms(2);
    }
    assert_eq!(master.motor_value(Node::ARM[0], Property::Mt), before);
}

#[test]
fn torque_does_nothing_unless_the_mode_is_torque() {
    let mut master = weightless();
    master.wake();
    master.send(torques(2000));
    master.wait_ms(200);
    assert_eq!(master.plant.world().joint_velocities(), [0.0; 7]);
    assert_eq!(master.motor_value(Node::ARM[0], Property::T), Some(0));
}

#[test]
fn torque_has_the_sign_of_the_transmission_and_persists() {
    let mut master = weightless();
    master.activate_unzeroed();
    // -1 N m at M1 is +42 N m at J1: M1 turns against J1. Only one frame is sent.
    master.send(torques(-100));
    master.wait_ms(50);
    let early = master.plant.world().joint_velocities()[0];
    master.wait_ms(50);
    let late = master.plant.world().joint_velocities()[0];
    // 100/2472 N m x 42 = 1.70 N m on about 0.36 kg m^2: the arm stands straight up, and what is beyond J3 does not
    // turn with it.
    assert!((early - 0.224).abs() < 0.01, "{early} rad/s after 0.05 s");
    assert!(late > 1.7 * early, "the torque persists: {early} then {late} rad/s");
    assert_eq!(master.motor_value(Node::ARM[0], Property::T), Some(-100));
}

#[test]
fn torque_is_clipped_to_mt() {
    let speed_with_limit = |limit: Option<i32>| {
        let mut master = weightless();
        master.activate_unzeroed();
        if let Some(limit) = limit {
            master.set(Node::ARM[0], motor_id(Property::Mt), limit);
        }
        master.send(torques(-1000));
        master.wait_ms(50);
        master.plant.world().joint_velocities()[0]
    };
    let ratio = speed_with_limit(None) / speed_with_limit(Some(250));
    assert!((ratio - 4.0).abs() < 0.05, "{ratio}");
}

#[test]
fn an_idle_motor_brakes() {
    let run_out = |idle: bool| {
        let mut master = weightless();
        master.activate_unzeroed();
        master.send(torques(-1000));
        master.wait_ms(50);
        master.send(torques(0));
        if idle {
            master.plant.press(PendantAction::ShiftIdle);
        }
        master.wait_ms(100);
        master.plant.world().joint_velocities()[0]
    };
    assert!(run_out(true) < 0.1 * run_out(false));
}

#[test]
fn the_sensor_answers_force_then_torque_with_the_weight_of_the_hand() {
    let mut master = awake();
    let [Reply::Force { counts: force, status: None, .. }, Reply::Torque { status: None, .. }] =
        master.ask(force_torque::get_wrench())[..]
    else {
        panic!("force, then torque")
    };
    let newtons = force.map(|counts| f64::from(counts) / 256.0);
    let weight = newtons.iter().map(|force| force * force).sum::<f64>().sqrt();
    assert!((weight - 1.2013 * 9.81).abs() < 0.3, "{weight} N");
}

#[test]
fn tare_makes_the_load_of_that_moment_zero() {
    let mut master = awake();
    master.ask(force_torque::tare());
    master.wait_ms(5);
    let [Reply::Force { counts, .. }, _] = master.ask(force_torque::get_wrench())[..] else { panic!() };
    assert!(counts.iter().all(|counts| counts.abs() < 80), "{counts:?}: under 0.3 N");
}

#[test]
fn a_pull_on_the_hand_is_felt_with_the_sign_of_the_environment_on_the_robot() {
    let mut master = awake();
    master.ask(force_torque::tare());
    master.wait_ms(5);
    // At home q = (0, -2, 0, 3.13, ...) the plate's axes follow from the golden kinematics; pull along each world axis
    // and compare the length and, through the grasp pose, the direction.
    for pull in [[6.0, 0.0, 0.0], [0.0, 6.0, 0.0], [0.0, 0.0, 6.0]] {
        master.plant.world().push(pull, [0.0; 3]);
        let [Reply::Force { counts, .. }, _] = master.ask(force_torque::get_wrench())[..] else { panic!() };
        let [x, y, z] = counts.map(|counts| f64::from(counts) / 256.0);
        // The grasp frame is the sensor frame turned by pi about z.
        let measured = rotate(master.plant.world().grasp_pose().quaternion, [-x, -y, z]);
        for (component, expected) in measured.iter().zip(pull) {
            assert!((component - expected).abs() < 0.5, "{measured:?} for {pull:?}");
        }
    }
}

#[test]
fn an_overload_adds_a_status_byte_until_the_next_tare() {
    let mut master = awake();
    let status = |master: &mut Master| match master.ask(force_torque::get_wrench())[..] {
        [_, Reply::Torque { status, .. }] => status,
        ref other => panic!("{other:?}"),
    };
    assert_eq!(status(&mut master), None);
    master.plant.world().push([500.0, 0.0, 0.0], [0.0; 3]);
    assert!(status(&mut master).expect("overloaded").is_bad());
    master.plant.world().push([0.0; 3], [0.0; 3]);
    let after = status(&mut master).expect("latched");
    assert!(!after.is_bad() && after.suggests_tare() && after.saturated_gauges() != 0);
    master.ask(force_torque::tare());
    master.wait_ms(5);
    assert_eq!(status(&mut master), None);
}

#[test]
fn force_saturates_at_16_bits() {
    let mut master = awake();
    master.plant.world().push([4000.0, 4000.0, 4000.0], [0.0; 3]);
    let [Reply::Force { counts, .. }, Reply::Torque { counts: moments, .. }] =
        master.ask(force_torque::get_wrench())[..]
    else {
        panic!()
    };
    assert!(counts.iter().all(|counts| *counts == i16::MAX || *counts == i16::MIN), "{counts:?}");
    assert!(moments.iter().any(|counts| *counts == i16::MAX || *counts == i16::MIN), "{moments:?}");
}

#[test]
fn an_emergency_stop_takes_the_pucks_off_the_bus_and_loses_their_positions() {
    let mut master = awake();
    master.zero();
    master.plant.press(PendantAction::PressEStop);
    assert_eq!(master.positions(), [None; 7]);
    assert!(master.ask(force_torque::get_wrench()).is_empty(), "the sensor has lost its power too");
    assert_eq!(master.safety_value(Property::Mode), SafetyMode::EStop.value());
    master.plant.press(PendantAction::ReleaseEStop);
    master.plant.press(PendantAction::ShiftIdle);
    master.wait_ms(50);
    assert_eq!(master.value(Node::ARM[0], PropertyId::STAT), Some(0), "back in the monitor");
    assert_eq!(master.value(Node::SAFETY_MODULE, safety_id(Property::Zero)), Some(0));
    master.wake();
    let positions = master.positions().map(|counts| counts.expect("awake").0);
    assert!(positions[..4].iter().all(|counts| counts.abs() <= 1), "{positions:?}: counters start anew");
    assert!(home_counts()[1].0 < -36_000, "and that is not where the arm is");
}

#[test]
fn replies_that_were_queued_at_an_emergency_stop_never_come() {
    let mut master = awake();
    master.heard.clear();
    master.send(get(Group::ARM, PropertyId::POSITION));
    master.wait(250 * TICKS_PER_MICROSECOND);
    master.plant.press(PendantAction::PressEStop);
    master.wait(10 * TICKS_PER_MILLISECOND);
    // The frame on the wire at that moment still completes in this model; the rest is gone.
    assert!((1..=3).contains(&master.heard.len()), "{}", master.heard.len());
}

fn rotate([w, x, y, z]: [f64; 4], v: [f64; 3]) -> [f64; 3] {
    let axis = [x, y, z];
    let cross =
        |a: [f64; 3], b: [f64; 3]| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let inner = cross(axis, v);
    let outer = cross(axis, std::array::from_fn(|i| inner[i] + w * v[i]));
    std::array::from_fn(|i| v[i] + 2.0 * outer[i])
}

/// Equal but for the one count by which a held arm trembles.
fn assert_near(positions: [Option<Counts>; 7], expected: [Counts; 7]) {
    for (position, expected) in positions.into_iter().zip(expected) {
        let position = position.expect("every puck answers");
        assert!((position.0 - expected.0).abs() <= 1, "{position:?} instead of {expected:?}");
    }
}

#[test]
fn home_is_where_the_arm_rests() {
    let mut master = awake();
    let q = master.plant.world().joint_positions();
    // The operator holds it; two counts of its motor are 2e-4 rad at joint 7.
    assert!(q.iter().zip(HOME).all(|(q, home)| (q - home).abs() < 2e-4), "{q:?}");
}
