//! Rungs of the ladder that are reached after something went wrong: a jammed bus, gauges that are silent, heat, and
//! pucks that restart while nobody drives them.

use control::{RATE, State};
use hand::number::real;
use link::{Refusal, Request, RunOptions};
use puck::hand::INNER_LINK_RATIO;
use puck::{CanFrame, PropertyId, Reply};
use sim::{FingerObstacle, HandConfig};

use crate::common::Movement;
use crate::ladder::{adapt, grip, gripping, run, torques};
use crate::rig::{OBJECT, Rig};

/// True for the reading of a gauge.
fn is_gauge(frame: &CanFrame) -> bool {
    matches!(Reply::decode(frame), Ok(Reply::Property { property, .. }) if Some(property) == PropertyId::new(25))
}

/// Largest rise of a finger's torque from one frame on the bus to the next, in units of the pucks.
fn largest_rise(rig: &Rig) -> i32 {
    let frames: Vec<[i16; 4]> = std::iter::once([0; 4]).chain(torques(rig)).collect();
    let pairs = frames.windows(2).flat_map(|pair| (0..3).map(|finger| (pair[0][finger], pair[1][finger])));
    pairs.map(|(from, to)| i32::from(to) - i32::from(from)).max().unwrap_or(0)
}

/// Behind a bus that was full for four cycles the torque of a finger rose by five steps of the limiter at once.
///
/// The change that makes it fail: the limiter of a hand alone counts torques that did not leave.
#[test]
fn a12_the_torque_of_a_hand_alone_rises_from_the_last_one_that_left() {
    let HandConfig { units_per_newton_metre: [units, ..], finger_efficiency, .. } = HandConfig::default();
    let step = (1.2 / 15.0 * f64::from(units) / (INNER_LINK_RATIO * finger_efficiency)) as i32 + 1;
    let mut rig = Rig::ready(FingerObstacle::NOTHING);
    let movement = Movement { start: [0.0; 4], goal: [0.0, 1.6, 1.6, 1.6], ..Movement::closing(30, 0.6, 0.0) };
    rig.upload("grip", &movement.image("grip"));
    rig.plant.record_bus();
    rig.accept(run(RunOptions { speed: 2.0, ..RunOptions::default() }));
    rig.run(3.0 / RATE);
    rig.jam(true);
    rig.run(4.0 / RATE);
    rig.jam(false);
    rig.run(0.1);
    assert_eq!(rig.health().state, State::Run);
    let rise = largest_rise(&rig);
    assert!(rise > 0 && rise <= step, "{rise} units at once, one step is {step}");
}

/// What pressed on a finger when its gauge fell silent became its zero.
///
/// The change that makes it fail: gauges that have been measured at some time are tared.
#[test]
fn gauges_of_a_hand_alone_that_fell_silent_are_not_tared() {
    let mut rig = gripping(adapt());
    rig.wait(6.0, |rig| rig.health().state == State::Hold);
    rig.lose = Box::new(|frame, _| is_gauge(frame));
    rig.run(0.5);
    assert_eq!(rig.refusal(Request::Tare), Refusal::WrenchMissing);
    rig.lose = Box::new(|_, _| false);
    rig.run(0.1);
    rig.accept(Request::Tare);
}

/// A hand that was closed on something right after its initialisation felt nothing in the run that followed.
///
/// The change that makes it fail: the first zero is taken when a run begins, and not before a move that closes.
#[test]
fn b5_a_hand_alone_does_not_take_a_grip_for_the_zero_of_gauges_that_nobody_has_tared() {
    let mut rig = Rig::ready(OBJECT);
    let closed = [0.0, 1.7, 1.7, 1.7];
    rig.accept(Request::MoveHand { q: closed, duration: 1.0 });
    rig.wait(4.0, |rig| rig.health().state == State::Hold);
    rig.run(0.5);
    let pressed = rig.now().gauges.map(real);
    assert!(pressed.iter().all(|gauge| *gauge < -0.1), "{pressed:?}");
    let movement = Movement { start: closed, goal: closed, ..grip() };
    rig.upload("grip", &movement.image("grip"));
    rig.accept(run(RunOptions::default()));
    rig.run(0.1);
    let felt = rig.now().gauges.map(real);
    assert!(felt.iter().zip(pressed).all(|(felt, pressed)| (felt - pressed).abs() < 0.05), "{pressed:?} {felt:?}");
}
