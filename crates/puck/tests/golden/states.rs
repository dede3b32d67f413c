//! Values and bits that have no golden vector, pinned one by one: states, modes, roles, gauge status, and the frames
//! that every way out sends.

use puck::device::{force_frame, safety_broadcast};
use puck::force_torque::{get_acceleration, get_wrench, tare};
use puck::safety::{PendantState, SafetyMode, velocity_limits};
use puck::tactile::TactileFormat;
use puck::{
    CanFrame, GaugeStatus, Group, MotorMode, Node, PropertyId, PropertyTable, PuckTorque, Role, Status, packed_torques,
    set, set_short, zero_torques,
};

fn raw(frame: &CanFrame) -> (u16, Vec<u8>) {
    (frame.can_id().raw(), frame.payload().to_vec())
}

#[test]
fn zero_torques_reach_all_seven_motors_once() {
    let [arm, wrist] = zero_torques();
    // From the host (0) to the groups 1 and 2; SET of property 42, four fields of 14 bits, all 0.
    assert_eq!(raw(&arm), (0x401, vec![0xAA, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!(raw(&wrist), (0x402, vec![0xAA, 0, 0, 0, 0, 0, 0, 0]));
    // Negative control: any torque would be seen.
    let one = PuckTorque::new(1).expect("small");
    let zero = PuckTorque::ZERO;
    for place in 0..4 {
        let torques = core::array::from_fn(|i| if i == place { one } else { zero });
        assert_ne!(packed_torques(Group::ARM_TORQUES, PropertyId::TORQUE, torques), arm);
    }
}

#[test]
fn a_hand_alone_is_stopped_by_zero_torque_to_its_four_pucks_and_then_by_idle() {
    let [zero, idle] = puck::hand_stop_frames().map(|frame| raw(&frame));
    // Group 5; T is property 42 (0x2A), MODE is 8, and 0 is IDLE; 0x80 says SET.
    assert_eq!(zero, (0x405, vec![0xAA, 0, 0, 0, 0, 0, 0, 0]));
    assert_eq!((idle.0, &idle.1[..2], idle.1[2]), (0x405, &[0x88, 0][..], 0));
}

#[test]
fn the_force_sensor_is_asked_and_tared_by_its_own_properties() {
    assert_eq!(raw(&get_wrench()), (0x008, vec![54]));
    assert_eq!(raw(&get_acceleration()), (0x008, vec![64]));
    assert_eq!(raw(&tare()), (0x008, vec![0x80 | 54, 0, 0, 0, 0, 0]));
}

#[test]
fn every_bit_of_the_gauge_status_means_one_thing() {
    for byte in 0..=u8::MAX {
        let status = GaugeStatus(byte);
        assert_eq!(status.suggests_tare(), byte >= 0x80, "{byte:#04x}");
        assert_eq!(status.is_bad(), byte / 0x40 % 2 == 1, "{byte:#04x}");
        assert_eq!(status.saturated_gauges(), byte % 0x40, "{byte:#04x}");
    }
}

#[test]
fn every_value_of_a_state_or_mode_is_the_documented_one() {
    let statuses = [Status::Reset, Status::Error, Status::Ready];
    let modes = [
        MotorMode::Idle,
        MotorMode::Duty,
        MotorMode::Torque,
        MotorMode::Position,
        MotorMode::Velocity,
        MotorMode::Trapezoidal,
    ];
    let safety = [SafetyMode::EStop, SafetyMode::Idle, SafetyMode::Active];
    for value in -3..300 {
        let place = usize::try_from(value).unwrap_or(usize::MAX);
        assert_eq!(Status::from_value(value), statuses.get(place).copied(), "STAT {value}");
        assert_eq!(MotorMode::from_value(value), modes.get(place).copied(), "MODE {value}");
        assert_eq!(SafetyMode::from_value(value), safety.get(place).copied(), "MODE {value} of the safety module");
    }
    for (value, status) in (0..).zip(statuses) {
        assert_eq!(status.value(), value);
    }
    for (value, mode) in (0..).zip(modes) {
        assert_eq!(mode.value(), value);
        assert_eq!(raw(&safety_broadcast(mode)), (0x540, vec![0x88, 0, value as u8, 0]));
    }
    for (value, mode) in (0..).zip(safety) {
        assert_eq!(mode.value(), value);
    }
    let formats = [TactileFormat::Off, TactileFormat::TopTen, TactileFormat::Full, TactileFormat::Tare];
    assert_eq!(formats.map(TactileFormat::value), [0, 1, 2, 3]);
}

#[test]
fn every_bit_of_a_role_means_one_thing() {
    assert_eq!([Role::MOTOR, Role::SAFETY, Role::HAND, Role::FORCE_TORQUE], [0, 2, 5, 6]);
    for bit in 0..32 {
        let role = Role::from_value(1_i32 << bit);
        let expected = if bit < 16 { 1_u16 << bit } else { 0 };
        assert_eq!(role, Role(expected));
        assert_eq!(role.kind(), if bit < 5 { 1 << bit } else { 0 }, "bit {bit}");
        assert_eq!(role.has_magnetic_encoder(), (8..11).contains(&bit), "bit {bit}");
        assert_eq!(role.has_absolute_angle(), bit == 8, "bit {bit}");
        assert_eq!(role.has_strain_gauge(), bit == 11, "bit {bit}");
        assert_eq!(role.has_tactile_array(), bit == 12, "bit {bit}");
        assert_eq!(role.has_joint_encoder(), bit == 14, "bit {bit}");
    }
    // Kinds are numbers, not bits: 7 is none of the four.
    assert_eq!(Role(0x0A05).kind(), Role::HAND);
    assert_eq!(Role(0xFFE7).kind(), 7);
}

#[test]
fn nodes_and_groups_have_the_numbers_of_the_manufacturer() {
    assert_eq!(Node::ARM.map(Node::number), [1, 2, 3, 4, 5, 6, 7]);
    assert_eq!(Node::HAND.map(Node::number), [11, 12, 13, 14]);
    assert_eq!(Node::FINGERS.map(Node::number), [11, 12, 13]);
    assert_eq!([Node::HOST, Node::FORCE_TORQUE, Node::SAFETY_MODULE, Node::SPREAD].map(Node::number), [0, 8, 10, 14]);
    let groups = [
        Group::ALL_MOTORS,
        Group::ARM_TORQUES,
        Group::WRIST_TORQUES,
        Group::POSITION_REPLIES,
        Group::ARM,
        Group::HAND,
        Group::PROPERTY_REPLIES,
        Group::SECONDARY_POSITION_REPLIES,
        Group::TACTILE_TOP_REPLIES,
        Group::TACTILE_FULL_REPLIES,
        Group::FORCE_REPLIES,
        Group::TORQUE_REPLIES,
        Group::ACCELERATION_REPLIES,
    ];
    for (number, group) in (0..).zip(groups) {
        assert_eq!(group.number(), number);
        assert_eq!(group.carries_only_replies(), [3, 6, 7, 8, 9, 10, 11, 12].contains(&number), "group {number}");
    }
    for number in 0..32 {
        let node = Node::new(number).expect("a node");
        assert_eq!(node.arm_index(), (1..=7).contains(&number).then(|| usize::from(number) - 1));
        assert_eq!(node.hand_index(), (11..=14).contains(&number).then(|| usize::from(number) - 11));
    }
}

#[test]
fn a_set_is_two_bytes_of_head_and_a_little_endian_value() {
    let node = Node::ARM[2];
    assert_eq!(raw(&set(node, PropertyId::MODE, -2)), (0x003, vec![0x88, 0, 0xFE, 0xFF, 0xFF, 0xFF]));
    assert_eq!(raw(&set_short(node, PropertyId::MODE, 0x0102)), (0x003, vec![0x88, 0, 0x02, 0x01]));
    // The sensor's own frames: from node 8 to group 10.
    assert_eq!(raw(&force_frame([1, -2, 0x0304])), (0x50A, vec![1, 0, 0xFE, 0xFF, 4, 3]));
}

#[test]
fn every_pattern_of_the_pendant_s_display_that_a_document_names_has_its_character() {
    let all_safe = 0o11111;
    let shown: String = (0..=255_i32)
        .filter_map(|segments| PendantState::from_value(segments << 16 | all_safe).expect("one-hot").display())
        .collect();
    // In the order of the patterns: 0x06, 0x07, 0x38, 0x3F, 0x4F, 0x5B, 0x66, 0x6D, 0x76, 0x77, 0x79, 0x7D.
    assert_eq!(shown, "17L03245HAE6");
    let words = PendantState::from_value(0).map_err(|error| error.to_string());
    assert_eq!(words, Err("pendant word with a field that is not one-hot".to_owned()));
}

#[test]
fn a_warning_may_be_at_its_fault_and_a_fault_at_the_last_number_of_16_bits() {
    let table = PropertyTable::safety(200).expect("known");
    let last = f64::from(i16::MAX) / 4096.0;
    for (fault, is_sent) in [(0.5, true), (last, true), (last + 1.0 / 4096.0, false)] {
        assert_eq!(velocity_limits(&table, fault, fault).is_ok(), is_sent, "{fault} m/s");
    }
    let words = velocity_limits(&table, 8.0, 0.5).map_err(|error| error.to_string());
    assert_eq!(words, Err("limit does not fit into 16 bits".to_owned()));
}
