//! Faults that are ordered: each does what its line in the table says, when it says, and no longer.

use puck::{Counts, Node, Property, PropertyId};
use sim::fault::{FaultKind, FrameKind, Frames, Injection};
use sim::{OperatorConfig, PendantAction, PlantConfig};

use crate::common::Master;

/// An arm that is up, with these faults from now on; the operator leaves it alone.
fn befallen(what: FaultKind, at: f64, lasts: f64) -> Master {
    let operator = OperatorConfig { activate_after: None, ..OperatorConfig::prompt() };
    let mut master = Master::new(PlantConfig { started: true, operator, ..PlantConfig::default() });
    master.plant.inject(&[Injection { at, lasts, every: 0.0, times: 1, what }]);
    master
}

fn positions_of(node: u8) -> Frames {
    Frames { kind: FrameKind::Position, from: vec![node], ..Frames::default() }
}

fn missing(positions: &[Option<Counts>; 7]) -> Vec<usize> {
    (0..7).filter(|motor| positions[*motor].is_none()).collect()
}

#[test]
fn frames_are_dropped_from_their_sender_in_their_time_and_no_more_than_ordered() {
    let mut master = befallen(FaultKind::Drop(positions_of(4)), 0.01, 0.01);
    assert_eq!(missing(&master.positions()), []);
    master.wait_ms(10);
    assert_eq!(missing(&master.positions()), [3]);
    master.wait_ms(10);
    assert_eq!(missing(&master.positions()), []);
    let mut master = befallen(FaultKind::Drop(Frames { most: 1, ..positions_of(2) }), 0.0, f64::INFINITY);
    assert_eq!(missing(&master.positions()), [1]);
    assert_eq!(missing(&master.positions()), []);
}

#[test]
fn a_late_frame_comes_late_and_a_repeated_one_twice() {
    let late = FaultKind::Delay { frames: Frames { most: 1, ..positions_of(4) }, by: 0.003 };
    let mut master = befallen(late, 0.0, f64::INFINITY);
    assert_eq!(missing(&master.positions()), [3], "not within the two milliseconds that this waits");
    master.wait_ms(2);
    assert_eq!(master.heard.len(), 7, "and then it comes");
    let mut master = befallen(FaultKind::Repeat(positions_of(4)), 0.0, f64::INFINITY);
    master.positions();
    assert_eq!(master.heard.len(), 8);
}

#[test]
fn a11_a_flood_wins_every_arbitration_and_ends() {
    let mut master = befallen(FaultKind::Flood { rate: 20_000.0, bytes: 8 }, 0.01, 0.01);
    master.wait_ms(11);
    master.heard.clear();
    master.send(puck::get(puck::Group::ARM, PropertyId::POSITION));
    master.wait_ms(5);
    assert!(master.heard.len() > 35, "{}", master.heard.len());
    let others = master.heard.iter().filter(|(_, frame)| frame.can_id().raw() != 0);
    assert_eq!(others.count(), 0, "nobody gets a word in");
    master.wait_ms(10);
    assert_eq!(missing(&master.positions()), []);
}

#[test]
fn counts_jump_and_come_back_and_begin_anew_where_a_puck_restarts() {
    let mut master = befallen(FaultKind::CountJump { node: 4, by: 5000 }, 0.01, 0.01);
    let counts = |master: &mut Master| master.positions()[3].map(|counts| counts.0);
    let before = counts(&mut master).expect("awake");
    master.wait_ms(10);
    // The arm sags in the operator's hand meanwhile.
    assert!((counts(&mut master).expect("awake") - before - 5000).abs() < 200);
    master.wait_ms(10);
    assert!((counts(&mut master).expect("awake") - before).abs() < 200);
    let mut master = befallen(FaultKind::Restart { node: 4 }, 0.01, f64::INFINITY);
    master.wait_ms(40);
    assert_eq!(missing(&master.positions()), [3]);
    assert_eq!(master.value(Node::ARM[3], PropertyId::STAT), Some(0), "its boot loader answers");
}

#[test]
fn a_frozen_position_stays_while_the_others_move() {
    let mut master = befallen(FaultKind::Freeze(positions_of(4)), 0.0, f64::INFINITY);
    let before = master.positions();
    // The operator takes the arm's weight, and it gives way a little: every motor but one is seen to move.
    master.plant.press(PendantAction::ShiftActivate);
    master.plant.inject(&[Injection {
        at: 0.0,
        lasts: 0.5,
        every: 0.0,
        times: 1,
        what: FaultKind::Push { force: [30.0, 30.0, 30.0] },
    }]);
    master.poll(400);
    let after = master.positions();
    assert_eq!(after[3], before[3]);
    assert!((0..7).any(|motor| motor != 3 && after[motor] != before[motor]));
}

#[test]
fn the_pendant_warns_as_long_as_it_is_told_to_and_is_pressed_when_it_is_told_to() {
    let mut master = befallen(FaultKind::Warning(sim::fault::Supervised::Torque), 0.01, 0.01);
    let warned = |master: &Master| master.plant.pendant().torque == puck::safety::Health::Warning;
    assert!(!warned(&master));
    master.wait_ms(15);
    assert!(warned(&master));
    master.wait_ms(10);
    assert!(!warned(&master));
    let mut master = befallen(FaultKind::Pendant(PendantAction::PressEStop), 0.01, f64::INFINITY);
    master.wait_ms(15);
    assert_eq!(master.safety_value(Property::Mode), puck::SafetyMode::EStop.value());
}

#[test]
fn equal_seeds_lose_equal_frames() {
    let lost = || {
        let frames = Frames { kind: FrameKind::Position, share: 0.3, ..Frames::default() };
        let mut master = befallen(FaultKind::Drop(frames), 0.0, f64::INFINITY);
        (0..20).map(|_| missing(&master.positions())).collect::<Vec<_>>()
    };
    let (one, other) = (lost(), lost());
    assert_eq!(one, other);
    let count: usize = one.iter().map(Vec::len).sum();
    assert!((20..70).contains(&count), "{count} of 140 at a share of 0.3");
}

/// An arm under torque mode that nobody asks anything of, with these faults from now on.
fn active_and_befallen(injections: &[Injection]) -> Master {
    let mut master =
        Master::new(PlantConfig { started: true, operator: OperatorConfig::prompt(), ..PlantConfig::default() });
    master.poll(100);
    assert_eq!(master.plant.safety_mode(), puck::SafetyMode::Active);
    assert!(master.plant.is_free(), "torque mode, zero torque");
    master.plant.inject(injections);
    master.heard.clear();
    master
}

fn ever(what: FaultKind) -> Injection {
    Injection { at: 0.0, lasts: f64::INFINITY, every: 0.0, times: 1, what }
}

/// The safety module went to IDLE by itself, but its word to the pucks was lost as well: the motors went on pulling, in
/// a state that no arm has.
///
/// The change that makes it fail: a frame of anybody is lost while the co-controller is off the bus.
#[test]
fn a10_the_safety_module_brakes_the_motors_while_the_co_controller_is_off_the_bus() {
    let late = FaultKind::Delay { frames: Frames { most: 1, ..positions_of(4) }, by: 0.01 };
    let mut master = active_and_befallen(&[ever(late), Injection { at: 0.005, ..ever(FaultKind::BusOff) }]);
    master.send(puck::get(puck::Group::ARM, PropertyId::POSITION));
    master.wait_ms(4);
    assert_eq!(master.heard.len(), 6, "one is late, and comes when nobody is there");
    master.wait_ms(120);
    assert_eq!(master.plant.safety_mode(), puck::SafetyMode::Idle);
    assert!(!master.plant.is_free(), "the pucks have heard it");
    master.send(puck::set(puck::Group::ARM, PropertyId::MODE, 2));
    master.wait_ms(10);
    assert!(!master.plant.is_free(), "nobody hears the co-controller");
    assert_eq!(master.heard.len(), 6, "nor does it hear anybody");
}

/// A puck that was restarted behind an emergency stop answered, on an arm whose pucks have no power.
///
/// The change that makes it fail: a restart gives a puck its power whether or not there is any.
#[test]
fn a_puck_restarts_only_where_there_is_power() {
    let mut master = befallen(FaultKind::Restart { node: 4 }, 0.01, f64::INFINITY);
    master.plant.press(PendantAction::PressEStop);
    master.wait_ms(50);
    assert_eq!(master.value(Node::ARM[3], PropertyId::STAT), None);
}

/// The change that makes it fail: the end of one fault puts back what another of its kind still says, or a restart
/// does.
#[test]
fn a_temperature_and_a_warning_end_with_the_last_of_their_kind_and_not_with_a_restart() {
    let at = |at, lasts, what| Injection { at, lasts, ..ever(what) };
    let hot = |celsius| FaultKind::Temperature { node: 4, celsius };
    let warning = || FaultKind::Warning(sim::fault::Supervised::Torque);
    let mut master = befallen(hot(80), 0.0, 0.03);
    master.plant.inject(&[at(0.01, 0.01, hot(90)), at(0.0, 0.03, warning()), at(0.01, 0.01, warning())]);
    let mut told = Vec::new();
    for _ in 0..4 {
        told.push((
            master.motor_value(Node::ARM[3], Property::Temp),
            master.plant.pendant().torque == puck::safety::Health::Warning,
        ));
        master.wait_ms(8);
    }
    assert_eq!(told, [(Some(80), true), (Some(90), true), (Some(80), true), (Some(34), false)]);
    master.plant.inject(&[ever(hot(70)), at(0.01, f64::INFINITY, FaultKind::Restart { node: 4 })]);
    master.wait_ms(50);
    master.set(Node::ARM[3], PropertyId::STAT, 2);
    master.wait_ms(1100);
    assert_eq!(master.motor_value(Node::ARM[3], Property::Therm), Some(70), "it is as hot as before");
}

/// The change that makes it fail: the end of a jump takes from counts that have begun anew, or were set, since.
#[test]
fn a_jump_of_counts_that_begin_anew_has_no_end() {
    let mut master = befallen(FaultKind::CountJump { node: 4, by: 5000 }, 0.01, 0.02);
    master.wait_ms(15);
    master.set(Node::ARM[3], PropertyId::POSITION, 100);
    let counts = |master: &mut Master| master.positions()[3].expect("awake").0;
    assert!((counts(&mut master) - 100).abs() < 50);
    master.wait_ms(20);
    assert!((counts(&mut master) - 100).abs() < 200, "right before, right now");
}

/// The change that makes it fail: `most` is not for a freeze.
#[test]
fn a_freeze_holds_for_no_more_frames_than_ordered() {
    let mut master = befallen(FaultKind::Freeze(Frames { most: 2, ..positions_of(4) }), 0.0, f64::INFINITY);
    let counts = |master: &mut Master| master.positions()[3].expect("awake").0;
    let first = counts(&mut master);
    master.set(Node::ARM[3], PropertyId::POSITION, first + 5000);
    assert_eq!(counts(&mut master), first);
    assert!((counts(&mut master) - first - 5000).abs() < 200, "the third one is true");
}

/// The change that makes it fail: of several faults of a kind only the first is there, or their sum turns time back.
#[test]
fn faults_of_one_kind_at_the_same_time_are_all_there() {
    let mut master = befallen(FaultKind::Refuse(FrameKind::ArmTorques), 0.0, f64::INFINITY);
    master.plant.inject(&[ever(FaultKind::Refuse(FrameKind::WristTorques))]);
    master.wait_ms(1);
    let refused = master.plant.refused();
    assert_eq!(refused, [FrameKind::ArmTorques, FrameKind::WristTorques]);
    master.plant.inject(&[ever(FaultKind::Clock(-0.6)), ever(FaultKind::Clock(-0.6))]);
    master.wait_ms(1);
    assert_eq!(master.plant.clock_error(), -0.9, "a clock that stands still ends no slot");
}

/// The change that makes it fail: a frame that is late comes as it was before another fault changed it.
#[test]
fn a_frame_that_is_changed_and_late_is_late_and_changed() {
    let mut master = befallen(FaultKind::Freeze(positions_of(4)), 0.0, f64::INFINITY);
    let first = master.positions()[3].expect("awake").0;
    master.set(Node::ARM[3], PropertyId::POSITION, first + 5000);
    master.plant.inject(&[ever(FaultKind::Delay { frames: positions_of(4), by: 0.003 })]);
    assert_eq!(missing(&master.positions()), [3]);
    master.wait_ms(3);
    let (_, late) = master.heard.last().expect("it comes");
    let frozen = puck::device::position_frame(Node::ARM[3], Counts(first), None);
    assert_eq!(*late, frozen);
}

/// The change that makes it fail: a torque that is sent when the delay is over overtakes those that are under way.
#[test]
fn torques_stay_in_order_when_their_delay_ends() {
    let mut master = active_and_befallen(&[Injection { lasts: 0.01, ..ever(FaultKind::TorqueDelay(0.02)) }]);
    let torque = |units| puck::PuckTorque::new(units).expect("14 bits");
    let all = |units| puck::packed_torques(puck::Group::ARM_TORQUES, PropertyId::TORQUE, [torque(units); 4]);
    master.wait_ms(8);
    master.send(all(50));
    master.wait_ms(4);
    master.send(all(0));
    master.wait_ms(30);
    assert!(master.plant.is_free(), "the last word is zero");
}

/// The change that makes it fail: of two floods only the first is there.
#[test]
fn a11_two_floods_are_two() {
    let mut master = befallen(FaultKind::Flood { rate: 1000.0, bytes: 1 }, 0.0, 0.01);
    master.plant.inject(&[Injection { lasts: 0.01, ..ever(FaultKind::Flood { rate: 700.0, bytes: 8 }) }]);
    master.wait_ms(20);
    let of_length = |length| master.heard.iter().filter(|(_, frame)| frame.payload().len() == length).count();
    assert!((9..=11).contains(&of_length(1)) && (6..=8).contains(&of_length(8)), "{} {}", of_length(1), of_length(8));
}

/// The sensor was taken for the arm's last puck, and so was a finger's.
///
/// The change that makes it fail: only a puck of the arm restarts.
#[test]
fn b4_the_sensor_and_a_digit_of_the_hand_restart_like_a_puck_of_the_arm() {
    for node in [Node::FORCE_TORQUE, Node::HAND[1]] {
        let mut master = befallen(FaultKind::Restart { node: node.number() }, 0.01, f64::INFINITY);
        assert_eq!(master.value(node, PropertyId::STAT), Some(2));
        master.wait_ms(50);
        assert_eq!(master.value(node, PropertyId::STAT), Some(0), "its boot loader answers");
        assert_eq!(master.value(Node::ARM[6], PropertyId::STAT), Some(2));
        master.set(node, PropertyId::STAT, 2);
        master.wait_ms(1100);
        assert_eq!(master.value(node, PropertyId::STAT), Some(2), "and it wakes");
    }
}
