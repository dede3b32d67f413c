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
