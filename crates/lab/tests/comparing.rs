//! Differences of two executions: what is found, where it is found, and what lost samples do not hide.

use std::path::Path;

use lab::demonstration::{RATE, Recording};
use lab::difference::Difference;
use lab::tracking::Lack;

/// A run of 200 cycles along x, with a force from cycle 100 on; `change` alters a row before it is written.
fn recording(change: impl Fn(usize, &mut Sample) -> bool) -> Recording {
    let joints = |name: &str, unit: &str| (1..=7).map(|i| format!("{name}{i}_{unit}")).collect::<Vec<_>>().join(",");
    let mut text =
        format!("t_s,state,{},x_m,y_m,z_m,qw,qx,qy,qz,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm\n", joints("q", "rad"));
    for cycle in 0..200 {
        let force = if cycle < 100 { 0.1 } else { 2.0 };
        let mut row = Sample { q: [0.1; 7], x: 0.001 * cycle as f64, force };
        if change(cycle, &mut row) {
            let q = row.q.map(|q| q.to_string()).join(",");
            let (time, x, force) = (cycle as f64 / RATE, row.x, row.force);
            text += &format!("{time},run,{q},{x},0.2,0.3,1,0,0,0,{force},0,0,0,0,0\n");
        }
    }
    Recording::parse(Path::new("run.csv"), text.as_bytes()).expect("a recording")
}

struct Sample {
    q: [f64; 7],
    x: f64,
    force: f64,
}

#[test]
fn a_run_does_not_differ_from_itself() {
    let run = recording(|_, _| true);
    let difference = Difference::between(&run, &run, 1.0).expect("comparable");
    assert_eq!(difference.whole.joint_rad, 0.0);
    assert_eq!((difference.before_contact.samples, difference.whole.samples), (100, 200));
    assert!((difference.contact_s.expect("a contact") - 100.0 / RATE).abs() < 1e-9);
}

#[test]
fn what_differs_is_told_apart_by_before_and_after_the_contact() {
    let one = recording(|_, _| true);
    let other = recording(|cycle, row| {
        row.q[4] += if cycle == 50 { -2e-3 } else { 0.0 };
        row.x += if cycle == 150 { 0.03 } else { 0.0 };
        row.force += if cycle == 20 { 0.4 } else { 0.0 };
        true
    });
    let difference = Difference::between(&one, &other, 1.0).expect("comparable");
    let (before, whole) = (difference.before_contact, difference.whole);
    assert!((before.joint_rad - 2e-3).abs() < 1e-12 && (before.force_n - 0.4).abs() < 1e-12, "{before:?}");
    assert!(before.position_m < 1e-12 && (whole.position_m - 0.03).abs() < 1e-12, "{whole:?}");
    assert_eq!(difference.start.joint_rad, 0.0);
    let table = difference.to_string();
    let contact = format!("before contact ({:.2} s)", 100.0 / RATE);
    assert!(table.contains(&contact) && table.contains("30.000"), "{table}");
}

#[test]
fn cycles_that_one_recording_lost_are_left_out_and_shift_nothing() {
    let one = recording(|_, _| true);
    let other = recording(|cycle, _| !(30..33).contains(&cycle));
    let difference = Difference::between(&one, &other, 1.0).expect("comparable");
    assert_eq!(difference.whole.samples, 197);
    assert_eq!(difference.whole.position_m, 0.0);
}

/// The change that makes it fail: cycles are counted from the first one of a run that was recorded, which need not be
/// its first one.
#[test]
fn a_recording_that_begins_in_the_middle_of_a_run_is_compared_with_that_middle() {
    let parsed = |from: usize| {
        let joints = (1..=7).map(|i| format!("q{i}_rad")).collect::<Vec<_>>().join(",");
        let mut text = format!("t_s,state,phase,{joints},x_m,y_m,z_m,qw,qx,qy,qz,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm\n");
        for cycle in from..900 {
            // As a device tells it: single precision, from the second step of the phase on.
            let phase = (-4.6 * (cycle + 1) as f64 / 900.0).exp() as f32;
            let (time, x) = ((cycle - from) as f64 / RATE, 0.001 * cycle as f64);
            text += &format!("{time},run,{phase},0,0,0,0,0,0,{x},{x},0.2,0.3,1,0,0,0,0,0,0,0,0,0\n");
        }
        Recording::parse(Path::new("run.csv"), text.as_bytes()).expect("a recording")
    };
    let whole = parsed(0);
    for lost in [1, 2, 40, 700] {
        for (one, other) in [(&whole, &parsed(lost)), (&parsed(lost), &whole)] {
            let difference = Difference::between(one, other, 1.0).expect("comparable");
            assert_eq!(difference.whole.samples, 900 - lost, "{lost} lost");
            assert_eq!(difference.whole.position_m, 0.0, "{lost} lost");
        }
    }
}

#[test]
fn a_demonstration_without_forces_is_refused_by_name() {
    let text = (0..100).map(|i| format!("{},0.1,0.2,0.3,1,0,0,0\n", f64::from(i) / 300.0)).collect::<String>();
    let pose = Recording::parse(Path::new("pose.csv"), format!("t_s,x_m,y_m,z_m,qw,qx,qy,qz\n{text}").as_bytes());
    let pose = pose.expect("a recording");
    let refused = Difference::between(&pose, &pose, 1.0);
    assert!(
        matches!(&refused, Err(error) if error.lack == Lack::Columns && error.file.ends_with("pose.csv")),
        "{refused:?}"
    );
}

#[test]
fn columns_that_a_run_lacks_are_null_and_named_and_not_a_difference_of_0() {
    let run = recording(|_, _| true);
    let difference = Difference::between(&run, &run, 1.0).expect("comparable");
    let json = serde_json::to_value(difference.clone()).expect("a value");
    for part in ["start", "before_contact", "whole"] {
        assert!(json[part]["plan_m"].is_null() && json[part]["torque_nm"].is_null(), "{json}");
    }
    let table = difference.to_string();
    let line = |name: &str| table.lines().find(|line| line.starts_with(name)).expect("a line").to_owned();
    assert_eq!(line("joint torque").matches("not recorded").count(), 3, "{table}");
    assert_eq!(line("planned position").matches("not recorded").count(), 3, "{table}");
}
