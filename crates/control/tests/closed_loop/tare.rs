//! The zero of the force sensor: when it is taken, and what is too much for one.

use control::command::Command;
use control::time::periods;
use control::{Event, Refusal, flags};
use nalgebra::Vector3;

use crate::adaptation::{FEELING, staying};
use crate::primitives::{START, primitive};
use crate::rig::Rig;

#[test]
fn b5_an_offset_at_rest_is_tared_if_small_and_refused_if_large() {
    let start = |offset: f64, tared: bool| {
        let mut rig = Rig::<f32>::new(START, 1);
        rig.plant.glitch = if tared { 0.0 } else { offset };
        // A sensor that says nothing while the arm is armed is not tared then.
        rig.plant.deaf = !tared;
        rig.command(Command::Hold);
        rig.plant.deaf = false;
        rig.run_for(2.0);
        if tared {
            rig.command(Command::Tare);
            rig.plant.glitch = offset;
            rig.run_for(1.0);
        }
        rig.load(&primitive(&staying(START))).expect("loads");
        let event = rig.tick(Some(Command::Run(FEELING))).event;
        rig.run_for(0.1);
        let [x, y, z, ..] = rig.last.expect("ran").record.wrench.map(f64::from);
        (event, Vector3::new(x, y, z).norm())
    };
    let refused = Some(Event::Refused(Refusal::ForceAtRest));
    // Never tared: whatever the sensor shows, up to the limit, is its bias.
    let (event, left) = start(4.0, false);
    assert_eq!(event, Some(Event::Accepted));
    assert!(left < 0.05, "{left}");
    assert_eq!(start(6.0, false).0, refused);
    // Tared: a drift is taken away, a load is not, and much is refused.
    let (event, left) = start(0.8, true);
    assert_eq!(event, Some(Event::Accepted));
    assert!(left < 0.05, "{left}");
    let (event, left) = start(3.0, true);
    assert_eq!(event, Some(Event::Accepted));
    assert!((left - 3.0).abs() < 0.05, "{left}");
    assert_eq!(start(20.0, true).0, refused);
}

/// The change that makes it fail: a sensor that was silent while the arm was turned is tared by what it told before.
#[test]
fn b5_a_sensor_that_is_silent_is_not_tared() {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig.command(Command::Gravity);
    rig.plant.deaf = true;
    for _ in 0..periods(3.0) {
        rig.plant.q[5] += 1.0 / f64::from(periods(3.0));
        rig.tick(None);
    }
    rig.run_for(0.5);
    let refused = rig.tick(Some(Command::Tare)).event;
    rig.plant.deaf = false;
    rig.run_for(0.5);
    let left = rig.last.expect("ran").record.wrench;
    assert_eq!(refused, Some(Event::Refused(Refusal::WrenchMissing)));
    assert!(left[..3].iter().all(|force| force.abs() < 0.1), "{left:?}");
    rig.command(Command::Tare);
}

/// An arm that was armed before it had rested for 0.3 s had no zero of its sensor: the approach that followed was off
/// by the weight of the hand, which the sensor's own tare had taken away in another posture (wide storm 65281).
///
/// The change that makes it fail: arming or an approach takes no zero.
#[test]
fn b5_an_arm_that_is_armed_or_approaches_before_it_has_rested_takes_its_zero_then() {
    for arming in [Command::Hold, Command::Gravity] {
        for deaf in [false, true] {
            let mut rig = Rig::<f32>::new(START, 1);
            rig.plant.glitch = 12.0;
            rig.plant.deaf = deaf;
            rig.tick(None);
            rig.command(arming);
            rig.command(Command::Hold);
            rig.plant.deaf = false;
            rig.run_for(1.0);
            rig.command(Command::Approach { q: START.map(|q| q as f32 + 0.1), duration: 0.0 });
            rig.run_for(0.3);
            let record = rig.last.expect("ran").record;
            let [x, y, z, ..] = record.wrench.map(f64::from);
            assert!(record.flags & flags::TARED != 0, "{arming:?}, {deaf}");
            assert!(Vector3::new(x, y, z).norm() < 0.5, "{arming:?}, {deaf}: {x} {y} {z}");
        }
    }
}

/// The change that makes it fail: every Hold takes a zero that is missing.
#[test]
fn b5_what_presses_on_a_hand_that_is_led_is_no_zero() {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.plant.deaf = true;
    rig.tick(None);
    rig.command(Command::Gravity);
    rig.run_for(0.5);
    rig.plant.deaf = false;
    rig.plant.push[2] = 8.0;
    rig.run_for(0.1);
    rig.command(Command::Hold);
    let record = rig.tick(None).record;
    assert_eq!(record.flags & flags::TARED, 0);
    assert!((f64::from(record.wrench[2]) - 8.0).abs() < 0.5, "{:?}", record.wrench);
}

#[test]
fn the_first_rest_after_start_up_is_the_zero_of_the_sensor() {
    let mut rig = Rig::<f32>::new(START, 1);
    rig.plant.glitch = 12.0;
    // The pucks brake.
    rig.plant.coulomb *= 100.0;
    rig.run_for(0.1);
    assert_eq!(rig.last.expect("ran").record.flags & flags::TARED, 0);
    rig.run_for(0.3);
    let record = rig.last.expect("ran").record;
    assert!(record.flags & flags::TARED != 0);
    assert!(record.wrench[..3].iter().all(|force| force.abs() < 0.05), "{:?}", record.wrench);
}
