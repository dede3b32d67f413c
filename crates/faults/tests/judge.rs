//! The judge of the faults is judged: what it must see, whatever else a scenario looks like.

use std::path::Path;

use control::{Fault, State};
use faults::bench;
use faults::bus;
use faults::entry::{Entry, Scenario};
use faults::figure::Figure;
use faults::measure;
use faults::watch::{self, Moment, Watched};
use lab::transport::SimulatorKind;
use link::Statistics;
use puck::{Group, Node, PropertyId, PuckTorque, SafetyMode, packed_torques};
use sim::{Passage, TICKS_PER_MILLISECOND};

fn scenario(text: &str) -> Scenario {
    let text = format!("title = \"t\"\nbar = \"b\"\ntoday = \"part\"\n\n[[scenario]]\nname = \"s\"\n{text}\n");
    let entry = Entry::parse(Path::new("tests/faults/a1.toml"), &text).expect("sound");
    entry.scenario[0].clone()
}

/// A second of an arm that is stopped after 0.1 s and then moves by `speed` (rad/s), its hand by as much in m/s.
fn stopped(speed: f64) -> Watched {
    let moment = |cycle: u32| {
        let time = f64::from(cycle) / 300.0;
        let way = if time < 0.1 { 0.0 } else { speed * (time - 0.1) };
        Moment {
            time,
            ticks: u64::from(cycle) * 10 * TICKS_PER_MILLISECOND / 3,
            state: if time < 0.1 { State::Hold } else { State::SoftStop },
            fault: Fault::None,
            told: None,
            is_limited: false,
            q: [way; 7],
            dq: [if time < 0.1 { 0.0 } else { speed }; 7],
            hand: [way, 0.0, 0.0],
            safety: SafetyMode::Active,
            is_free: false,
        }
    };
    let (before, after) = (Statistics::default(), Statistics::default());
    let moments = (0..300).map(moment).collect();
    Watched { moments, bus: Vec::new(), before, after, surprises: Vec::new(), clears: Vec::new() }
}

/// The change that makes it fail: anything is asked of the device between the order of the faults and the watch.
#[test]
fn faults_and_figures_count_from_the_same_moment() {
    let text = "from = \"hold\"\nwatch = 0.3\ninject = [{ at = 0.1, what.pendant = \"press-estop\" }]";
    let scenario = scenario(text);
    let mut arm = bench::arm(&scenario, true, SimulatorKind::InProcess).expect("it holds");
    let watched = watch::watch(&mut arm, &scenario, true).expect("it answers");
    let seen = watched.moments.iter().find(|moment| moment.safety != SafetyMode::Active).expect("pressed");
    assert!((0.1..0.104).contains(&seen.time), "pressed at 0.1 s, seen at {} s", seen.time);
}

/// The change that makes it fail: the largest of some values is sought with `f64::max`, which passes over what is none.
#[test]
fn what_is_not_a_number_is_within_no_bar() {
    let scenario = scenario("from = \"hold\"\nwatch = 1");
    let figures = measure::all(&scenario, &stopped(f64::NAN), None);
    for figure in
        [Figure::HandSpeed, Figure::LateSpeed, Figure::StoppedSpeed, Figure::Travel, Figure::Rest, Figure::Still]
    {
        let is_within = figures.get(&figure).is_some_and(|value| *value <= 1e9);
        assert!(!is_within, "{figure:?}: {:?}", figures.get(&figure));
    }
}

/// The change that makes it fail: the distance from the plan is taken without that of the arm without the faults.
#[test]
fn an_arm_is_astray_by_what_it_is_farther_from_its_plan_than_without_the_faults() {
    let following = |off: f64| {
        let mut watched = stopped(0.2);
        for moment in &mut watched.moments {
            let [x, y, z] = moment.hand;
            moment.told = Some(([0.0; 7], [x, y + if moment.time > 0.5 { off } else { 0.0 }, z]));
        }
        watched
    };
    let astray = |watched: &Watched, nominal: &Watched| {
        let scenario = scenario("from = \"hold\"\nwatch = 1");
        measure::all(&scenario, watched, Some(nominal))[&Figure::Astray]
    };
    assert!((astray(&following(5e-3), &following(2e-3)) - 3.0).abs() < 1e-6);
    assert_eq!(astray(&following(2e-3), &following(5e-3)), 0.0);
    assert!(astray(&stopped(0.2), &following(2e-3)).is_nan(), "no plan was told");
}

/// The change that makes it fail: an arm that still moves as the watch ends counts as resting from then on.
#[test]
fn an_arm_that_still_moves_when_nobody_looks_any_more_does_not_rest() {
    let scenario = scenario("from = \"hold\"\nwatch = 1");
    let figures = measure::all(&scenario, &stopped(0.2), None);
    assert_eq!(figures[&Figure::Rest], f64::INFINITY);
    assert_eq!(figures[&Figure::Still], f64::INFINITY);
    assert!((figures[&Figure::StoppedSpeed] - 0.2).abs() < 0.01, "{figures:?}");
}

/// The change that makes it fail: the largest of no speeds is 0.
#[test]
fn a_speed_that_nobody_looked_for_is_no_speed() {
    let scenario = scenario("from = \"hold\"\nwatch = 1\ninject = [{ at = 0, lasts = 0.8, what.payload = 1.0 }]");
    let figures = measure::all(&scenario, &stopped(0.2), None);
    assert_eq!(figures.get(&Figure::LateSpeed), None, "the watch ends 0.2 s behind the payload");
    assert!(figures.contains_key(&Figure::StoppedSpeed));
}

/// The change that makes it fail: only pairs are looked at.
#[test]
fn torque_frames_without_a_partner_are_measured() {
    let frame = |cycle: u64, group, units: i16| {
        let torques = [PuckTorque::new(units).expect("in range"); 4];
        let start = cycle * 10 * TICKS_PER_MILLISECOND / 3;
        Passage { start, end: start + 1, sender: Node::HOST, frame: packed_torques(group, PropertyId::TORQUE, torques) }
    };
    let frames = [
        frame(1, Group::ARM_TORQUES, 10),
        frame(1, Group::WRIST_TORQUES, 10),
        frame(2, Group::ARM_TORQUES, 4000),
        frame(3, Group::ARM_TORQUES, 10),
        frame(3, Group::WRIST_TORQUES, 10),
        frame(4, Group::WRIST_TORQUES, 4000),
    ];
    for end in [5, 6] {
        let sent = bus::sent(&frames[..end]);
        assert!(bus::largest(&sent) > 1.0 && bus::largest_step(&sent) > 1.0, "{end}: {sent:?}");
    }
    let lone_wrist = bus::sent(&frames[3..]);
    assert!(bus::largest_step(&lone_wrist) > 1.0, "{lone_wrist:?}");
    // One group may go to zero by itself.
    let ends = [frames[0], frames[1], frame(2, Group::ARM_TORQUES, 0), frame(3, Group::ARM_TORQUES, 0)];
    assert!(bus::largest_step(&bus::sent(&ends)) < 0.1);
}

/// An E-STOP costs the zero, which is asked for on the second way back and nowhere else.
#[test]
fn faults_on_the_way_back_befall_the_arm_and_the_way_is_gone_once_more() {
    let verdict = |recover: &str, late: &str| {
        let text = format!("from = \"hold\"\nwatch = 0.1\nrecover = \"{recover}\"\nlate = [{late}]");
        let entry = Entry::parse(
            Path::new("tests/faults/a1.toml"),
            &format!("title = \"t\"\nbar = \"b\"\ntoday = \"part\"\n\n[[scenario]]\nname = \"s\"\n{text}\n"),
        );
        let entry = entry.expect("sound");
        faults::run::run(&entry, &entry.scenario[0], SimulatorKind::InProcess)
    };
    let pressed = "{ at = 30.0, what.pendant = \"press-estop\" }";
    assert_eq!(verdict("zero", pressed).failures, [""; 0]);
    assert_eq!(verdict("run", "").failures, [""; 0]);
    assert!(!verdict("run", pressed).holds() && !verdict("zero", "").holds());
}
