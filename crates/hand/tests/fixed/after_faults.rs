//! Rungs of the ladder that are reached after something went wrong: a jammed bus, gauges that are silent, heat, and
//! pucks that restart while nobody drives them.

use control::{Fault, RATE, State};
use device::HandFailure;
use device::time::SLOT_HZ;
use dmp::Scalar;
use hand::number::real;
use link::{EventKind, HandStage, Refusal, Request, RunOptions};
use puck::device::reply32;
use puck::hand::INNER_LINK_RATIO;
use puck::{CanFrame, Group, MotorMode, Node, PropertyId, Reply, Status};
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

/// A torque that pressed on a finger when its gauge fell silent became its zero.
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

/// A hand that was closed on something right after its initialisation measured nothing in the run that followed.
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
    let measured = rig.now().gauges.map(real);
    assert!(
        measured.iter().zip(pressed).all(|(now, pressed)| (now - pressed).abs() < 0.05),
        "{pressed:?} {measured:?}"
    );
}

/// True for a frame that comes from this puck.
fn is_from(frame: &CanFrame, node: Node) -> bool {
    frame.can_id().raw() >> 5 & 0x1F == u16::from(node.number())
}

/// A puck that slept in its boot loader was told only when an initialisation had failed for it, and a hand without
/// power stayed "not initialised" for ever.
///
/// The change that makes it fail: a hand alone that is not initialised is asked for MODE and TEMP alone.
#[test]
fn g2_a_puck_of_a_hand_alone_that_restarts_or_goes_before_the_initialisation_is_told_within_a_second() {
    for (restarts, failure) in [(true, HandFailure::Reset), (false, HandFailure::Silent)] {
        let mut rig = Rig::new(FingerObstacle::NOTHING);
        rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
        rig.run(2.0);
        assert_eq!(rig.health().hand, HandStage::NotInitialised, "a hand that answers is left alone");
        let lost = Node::FINGERS[1];
        rig.lose = Box::new(move |frame, _| is_from(frame, lost));
        for _ in 0..SLOT_HZ {
            if restarts {
                rig.hear(reply32(lost, PropertyId::STAT, Status::Reset.value()));
            }
            rig.step();
        }
        assert_eq!(rig.health().hand, HandStage::Failed);
        let told = |reply: &link::Reply| {
            matches!(reply, link::Reply::Event(event)
            if event.kind == EventKind::Hand && event.detail == failure.number(lost))
        };
        assert!(rig.heard.iter().any(told), "{failure:?}");
        rig.lose = Box::new(|_, _| false);
        rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
        rig.accept(Request::InitialiseHand);
        rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    }
}

/// The change that makes it fail: an initialisation forgets a word to brake that has not left.
#[test]
fn g11_a_hand_alone_that_is_initialised_right_after_a_stop_is_braked_first() {
    let mut rig = Rig::new(FingerObstacle::NOTHING);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.accept(Request::InitialiseHand);
    rig.run(0.5);
    rig.jam(true);
    rig.accept(Request::Stop);
    rig.accept(Request::InitialiseHand);
    rig.jam(false);
    rig.sent.clear();
    rig.run(0.05);
    let idle = puck::set(Group::HAND, PropertyId::MODE, MotorMode::Idle.value());
    assert_eq!(rig.sent.first(), Some(&idle));
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
}

/// Two digits that are lost in turn: no cycle is complete, and none is silent for six.
///
/// The change that makes it fail: a host is watched by the state of the hand, and not by the law that acts.
#[test]
fn g5_a_run_of_a_hand_alone_without_its_host_is_stopped_also_while_replies_are_bridged() {
    let mut rig = gripping(RunOptions::default());
    rig.run(0.5);
    let turn = std::cell::Cell::new(0);
    rig.lose = Box::new(move |frame, _| {
        let [first, second, ..] = Node::FINGERS;
        if !matches!(Reply::decode(frame), Ok(Reply::Position { .. })) {
            return false;
        }
        // The spread answers last: its reply ends the cycle.
        let odd = turn.get() % 2 == 1;
        turn.set(turn.get() + u32::from(is_from(frame, Node::SPREAD)));
        is_from(frame, if odd { first } else { second })
    });
    rig.run(0.1);
    assert_eq!(rig.health().state, State::Coast);
    rig.alive = false;
    rig.run(0.7);
    assert_eq!(rig.health().state, State::SoftStop);
}

/// A grip that is kept for hours heated its motors, and nobody stopped them.
///
/// The change that makes it fail: the temperatures of a hand alone are shown and nothing else.
#[test]
fn g14_a_motor_of_a_hand_alone_that_is_too_hot_ends_its_torque_until_it_is_cooler() {
    let hot = |rig: &mut Rig, celsius: i32, seconds: f64| {
        for _ in 0..(seconds * f64::from(SLOT_HZ)) as usize {
            for node in Node::HAND {
                rig.hear(reply32(node, PropertyId::new(9).expect("TEMP"), celsius));
            }
            rig.step();
        }
    };
    let mut rig = gripping(adapt());
    rig.wait(6.0, |rig| rig.health().state == State::Hold);
    rig.lose = Box::new(
        |frame, _| matches!(Reply::decode(frame), Ok(Reply::Property { property, .. }) if Some(property) == PropertyId::new(9)),
    );
    hot(&mut rig, 79, 5.0);
    assert_eq!((rig.health().state, rig.health().fault), (State::Hold, Fault::None));
    hot(&mut rig, 80, 3.0);
    assert_eq!((rig.health().state, rig.health().fault), (State::SoftStop, Fault::MotorHot));
    assert_eq!(rig.now().torque, [Scalar::ZERO; 4]);
    assert_eq!(rig.refusal(Request::ClearFault), Refusal::CauseRemains);
    hot(&mut rig, 75, 3.0);
    assert_eq!(rig.refusal(Request::ClearFault), Refusal::CauseRemains);
    hot(&mut rig, 74, 3.0);
    rig.accept(Request::ClearFault);
    // Nobody drives a hand that became hot at rest.
    hot(&mut rig, 80, 3.0);
    assert_eq!((rig.health().state, rig.health().fault), (State::Idle, Fault::None));
    assert_eq!(rig.refusal(Request::MoveHand { q: [0.0; 4], duration: 1.0 }), Refusal::CauseRemains);
    assert_eq!(rig.refusal(run(adapt())), Refusal::CauseRemains);
    // What was measured of a hand that is gone says nothing.
    rig.lose = Box::new(|_, _| true);
    rig.run(0.5);
    assert_eq!((rig.health().hand, rig.health().hand_temperatures), (HandStage::Failed, [None; 4]));
    rig.lose = Box::new(|_, _| false);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    rig.accept(Request::InitialiseHand);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    rig.accept(Request::MoveHand { q: [0.0; 4], duration: 1.0 });
}

/// A gauge whose cable was off read 4095: 2.8 N m, and its finger opened under force control and let go.
///
/// The change that makes it fail: a reading at an end of the range counts as measured.
#[test]
fn a_gauge_at_an_end_of_its_range_tells_nothing_and_position_goes_on() {
    for end in [0, 4095] {
        let mut rig = gripping(adapt());
        rig.wait(6.0, |rig| rig.health().state == State::Hold);
        rig.run(0.5);
        let before = rig.now();
        let broken = Node::FINGERS[0];
        rig.lose = Box::new(move |frame, _| is_gauge(frame) && is_from(frame, broken));
        for _ in 0..SLOT_HZ {
            rig.hear(reply32(broken, PropertyId::new(25).expect("SG"), end));
            rig.step();
        }
        let moved = (rig.now().q[1] - before.q[1]).to_f64();
        println!("{end}: {moved:.3} rad, torque {:?}", rig.now().torque.map(real));
        assert!(moved.abs() < 0.05, "a reading of {end} moves the finger by {moved} rad");
        assert_eq!(rig.health().state, State::Hold);
        assert!(rig.now().flags & control::flags::WRENCH_STALE != 0, "and it is told");
    }
}

/// A hand that was not there, or was being initialised, was "not initialised", and `tactus hand init` was the help.
///
/// The change that makes it fail: the control cycle, which knows no stage of the hand, names the reason.
#[test]
fn what_needs_a_hand_is_refused_with_what_the_hand_lacks() {
    let needing = [Request::MoveHand { q: [0.1; 4], duration: 0.0 }, Request::Tare, run(RunOptions::default())];
    let mut rig = Rig::new(FingerObstacle::NOTHING);
    rig.upload("grip", &grip().image("grip"));
    let refused = |rig: &mut Rig, reason: Refusal| {
        for request in needing.clone() {
            assert_eq!(rig.refusal(request), reason, "{:?}", rig.health().hand);
        }
    };
    assert_eq!(rig.health().hand, HandStage::Absent);
    refused(&mut rig, Refusal::NoHand);
    rig.wait(5.0, |rig| rig.health().hand == HandStage::NotInitialised);
    refused(&mut rig, Refusal::HandNotReady);
    rig.accept(Request::InitialiseHand);
    refused(&mut rig, Refusal::HandBusy);
    rig.wait(20.0, |rig| rig.health().hand == HandStage::Ready);
    rig.run(0.1);
    rig.lose = Box::new(|_, _| true);
    rig.wait(1.0, |rig| rig.health().hand == HandStage::Failed);
    refused(&mut rig, Refusal::NoHand);
}
