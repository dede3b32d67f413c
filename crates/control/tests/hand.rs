//! The hand's estimator, Eq (14) and limits, each alone.

use control::act::HandLimiter;
use control::act::hand::TORQUE_LIMIT;
use control::law::{Gains, HandController, HandGains};
use control::plan::HandMotion;
use control::plan::HandReference;
use control::sense::hand::LOST_CYCLES;
use control::sense::{HandEstimator, HandState};
use control::{HandSample, PERIOD};
use pinned_init::InPlaceWrite;
use proptest::prelude::*;
use puck::{Counts, gauge};

/// Replies of a hand with its inner links, outer links (relative, before the bend) and spread at these angles (rad).
fn sample(inner: [f64; 3], outer: [f64; 3], spread: f64, gauges: [u16; 3]) -> HandSample {
    let counts =
        |angle: f64, ratio: f64| Some(Counts((angle * ratio * 4096.0 / core::f64::consts::TAU).floor() as i32));
    let motor = |finger: usize| counts(inner[finger] + outer[finger], 93.75);
    HandSample {
        primary: [motor(0), motor(1), motor(2), counts(spread, 17.5)],
        secondary: inner.map(|angle| counts(angle, 50.0)),
        gauges: gauges.map(Some),
    }
}

#[test]
fn inner_links_are_read_from_the_worm_encoders_also_after_breakaway() {
    let mut hand = HandEstimator::<f64>::new();
    // F2 has broken away: its outer link is 0.5 rad further than a third of the inner one.
    let (inner, outer) = ([0.3, 0.9, 1.5], [0.1, 0.8, 0.5]);
    let state = hand.update(Some(&sample(inner, outer, 1.2, [2000; 3]))).expect("all digits answered");
    assert!((state.q[0] - 1.2).abs() < 1e-3, "the spread comes first: {:?}", state.q);
    for finger in 0..3 {
        assert!((state.q[1 + finger] - inner[finger]).abs() < 1e-3, "{:?}", state.q);
        assert!((state.outer[finger] - outer[finger]).abs() < 1e-3, "{:?}", state.outer);
    }
    // A puck without a worm encoder tells the inner link from its motor, which holds before breakaway.
    let mut hand = HandEstimator::<f64>::new();
    let plain = HandSample { secondary: [None; 3], ..sample([0.9; 3], [0.3; 3], 0.0, [2000; 3]) };
    let state = hand.update(Some(&plain)).expect("all digits answered");
    assert!((state.q[2] - 0.9).abs() < 1e-3, "{:?}", state.q);
}

#[test]
fn velocities_are_those_of_the_motion_and_lost_replies_do_not_show_in_them() {
    for lost in [false, true] {
        let mut hand = HandEstimator::<f64>::new();
        let mut state = None;
        for cycle in 0..300 {
            let angle = 0.2 + 1.1 * f64::from(cycle) * PERIOD;
            let mut replies = sample([angle; 3], [angle / 3.0; 3], angle, [2000; 3]);
            if lost && cycle % 7 == 3 {
                replies.primary[1] = None;
                replies.secondary[1] = None;
            }
            state = hand.update(Some(&replies));
            if cycle > 100 {
                let state = state.expect("known");
                for digit in 0..4 {
                    assert!((state.dq[digit] - 1.1).abs() < 0.03, "digit {digit} in cycle {cycle}: {:?}", state.dq);
                }
            }
        }
        let state = state.expect("known");
        assert!((state.q[2] - (0.2 + 1.1 * 299.0 * PERIOD)).abs() < 1e-3);
    }
}

#[test]
fn a_digit_that_is_silent_ages_and_the_hand_is_lost_after_ten_cycles() {
    let mut hand = HandEstimator::<f64>::new();
    hand.update(Some(&sample([0.5; 3], [0.2; 3], 0.3, [2000; 3])));
    let mut silent = sample([0.502; 3], [0.2; 3], 0.3, [2000; 3]);
    silent.primary[0] = None;
    silent.secondary[0] = None;
    silent.gauges = [None; 3];
    for cycle in 1..=LOST_CYCLES + 1 {
        let state = hand.update(Some(&silent)).expect("known");
        assert_eq!((state.age[1], state.age[2], state.gauge_age), (cycle, 0, cycle), "F1 is the second digit");
        assert!((state.q[1] - 0.5).abs() < 1e-3, "the last known angle stays");
        assert_eq!(state.is_lost(), cycle > LOST_CYCLES);
        assert_eq!(state.feels(), cycle <= LOST_CYCLES);
    }
    // Without a hand everything is forgotten, for it may be zeroed again before it comes back.
    assert_eq!(hand.update(None), None);
    let mut incomplete = sample([0.0; 3], [0.0; 3], 0.0, [2000; 3]);
    incomplete.primary[3] = None;
    assert_eq!(hand.update(Some(&incomplete)), None, "not before all four have answered");
    assert!(hand.update(Some(&sample([0.0; 3], [0.0; 3], 0.0, [2000; 3]))).is_some());
}

#[test]
fn one_corrupt_reply_is_not_believed_and_two_that_agree_are() {
    let mut hand = HandEstimator::<f64>::new();
    let good = sample([0.5; 3], [0.2; 3], 0.3, [2000; 3]);
    let wild = sample([1.9; 3], [0.2; 3], 2.8, [4000; 3]);
    hand.update(Some(&good));
    let state = hand.update(Some(&wild)).expect("known");
    assert!((state.q[1] - 0.5).abs() < 1e-3 && (state.q[0] - 0.3).abs() < 1e-3 && state.gauges[0].abs() < 1e-3);
    let state = hand.update(Some(&good)).expect("known");
    assert!((state.q[1] - 0.5).abs() < 1e-3 && state.age == [0; 4]);
    hand.update(Some(&wild));
    let state = hand.update(Some(&wild)).expect("known");
    assert!((state.q[1] - 1.9).abs() < 1e-3 && (state.q[0] - 2.8).abs() < 1e-3, "{:?}", state.q);
    assert!(state.dq[1].abs() < 1.0, "and it is no velocity: {:?}", state.dq);
}

/// The change that makes it fail: gauges that were measured once are good for a zero for ever.
#[test]
fn gauges_that_fell_silent_are_no_zero() {
    let mut hand = HandEstimator::<f64>::new();
    let mut settle = |counts: Option<u16>, cycles: u32, tare: bool| {
        let replies = HandSample { gauges: [counts; 3], ..sample([0.5; 3], [0.1; 3], 0.0, [2000; 3]) };
        for _ in 0..cycles {
            hand.update(Some(&replies));
        }
        if tare {
            hand.tare();
        }
        hand.state().expect("known").gauges[0]
    };
    assert!(settle(Some(2000), 300, true).abs() < 1e-9);
    // It is pressed on, and then the gauges fall silent: what presses is no zero.
    let pressed = settle(Some(2300), 300, false);
    assert!(pressed.abs() > 0.05, "{pressed}");
    assert!((settle(None, 300, true) - pressed).abs() < 0.01);
    assert!(settle(Some(2000), 300, false).abs() < 0.01, "the zero of before");
}

#[test]
fn a_gauge_is_the_torque_of_the_environment_on_the_finger_from_its_tared_zero() {
    // The curve at 1950 and 2500 counts: 0.0342 and 0.1885 N m with which the finger presses.
    let pressing = gauge::torque(2500.0) - gauge::torque(1950.0);
    let mut hand = HandEstimator::<f64>::new();
    let settle = |hand: &mut HandEstimator<f64>, counts: u16| {
        let mut state = None;
        for _ in 0..100 {
            state = hand.update(Some(&sample([0.5; 3], [0.2; 3], 0.0, [counts, 1950, 1950])));
        }
        state.expect("known").gauges
    };
    settle(&mut hand, 1950);
    hand.tare();
    let gauges = settle(&mut hand, 2500);
    assert!((gauges[0] + pressing).abs() < 1e-6 && gauges[1].abs() < 1e-9, "{gauges:?}");
    // A grip is not drift: the automatic tare leaves it, and takes away what is less.
    hand.tare_drift();
    assert!((settle(&mut hand, 2500)[0] + pressing).abs() < 1e-6);
    assert!(settle(&mut hand, 2010)[0].abs() > 5e-3);
    hand.tare_drift();
    assert!(settle(&mut hand, 2010)[0].abs() < 1e-6);
}

fn state_of(q: [f64; 4], gauges: [f64; 3]) -> HandState<f64> {
    HandState { q, dq: [0.0; 4], outer: [0.0; 3], gauges, age: [0; 4], gauge_age: 0 }
}

/// A controller of the digits without history.
fn controller(gains: &HandGains<f64>) -> Box<HandController<f64>> {
    let Ok(controller) = Box::new_uninit().write_init(HandController::init(gains));
    controller
}

#[test]
fn a_step_of_the_gauge_ramps_through_the_window_and_then_stays() {
    // Eq (14) with the sign of Eq (12): u_0 = -(P + K_i dt) e, then linear, then flat -(P + K_i Dt) e from tick N-1 on.
    let gains = Gains::<f64>::tuned().hand;
    let mut controller = controller(&gains);
    let at = [0.4, 0.7, 0.8, 0.9];
    let reference = HandReference::at_rest(at);
    let gauges = [-0.5, 0.0, 0.3];
    for tick in 0..2 * gains.force_window {
        let torque = controller.torque(&gains, &state_of(at, gauges), &reference, Some(&[-0.1, 0.0, 0.0]), false);
        let filled = (tick + 1).min(gains.force_window) as f64;
        let factor = gains.force_proportional + gains.force_integral * filled * PERIOD;
        assert_eq!((torque[0], torque[2]), (0.0, 0.0), "the spread knows no force, F2 no error");
        // F1 presses 0.4 N m harder than expected: it is driven open. F3 is pushed shut by 0.3: it gives way.
        assert!((torque[1] + 0.4 * factor).abs() < 1e-12, "tick {tick}: {torque:?}");
        assert!((torque[3] - 0.3 * factor).abs() < 1e-12, "tick {tick}: {torque:?}");
    }
    // Frozen, the window keeps what it has; without an expectation the position alone counts.
    let before = controller.torque(&gains, &state_of(at, gauges), &reference, Some(&[-0.1, 0.0, 0.0]), true);
    for _ in 0..100 {
        let now = controller.torque(&gains, &state_of(at, gauges), &reference, Some(&[-0.1, 0.0, 0.0]), true);
        assert_eq!(now, before);
    }
    assert_eq!(controller.torque(&gains, &state_of(at, gauges), &reference, None, false), [0.0; 4]);
}

#[test]
fn the_position_part_pulls_towards_the_reference_and_waits_where_a_reply_is_missing() {
    let gains = Gains::<f64>::tuned().hand;
    let mut controller = controller(&gains);
    let reference = HandReference::at_rest([0.1, 0.6, 0.4, 0.5]);
    let torque = controller.torque(&gains, &state_of([0.0, 0.5, 0.5, 0.5], [0.0; 3]), &reference, None, false);
    assert!(torque[0] > 0.0 && torque[1] > 0.0 && torque[2] < 0.0 && torque[3] == 0.0, "{torque:?}");
    assert!((torque[1] - 0.1 * gains.stiffness[1]).abs() < 1e-12);
    let silent = HandState { age: [0, 3, 0, 0], ..state_of([0.0, 0.9, 0.5, 0.5], [0.0; 3]) };
    assert_eq!(controller.torque(&gains, &silent, &reference, None, false)[1], torque[1]);
}

#[test]
fn a_move_is_minimum_jerk_and_ends_where_it_should() {
    let mut motion = HandMotion::<f64>::new(&[0.0, 0.2, 0.4, 0.6], &[1.0, 1.2, 1.4, 0.0], 2.0);
    let mut last = motion.now();
    let mut peak = 0.0f64;
    while !motion.is_finished() {
        let now = motion.step();
        for digit in 0..4 {
            let difference = (now.q[digit] - last.q[digit]) / PERIOD;
            assert!((difference - 0.5 * (now.dq[digit] + last.dq[digit])).abs() < 1e-2);
        }
        peak = peak.max(now.dq[1]);
        last = now;
    }
    assert!((peak - 1.875 * 0.5).abs() < 0.01, "{peak}");
    let end = motion.step();
    assert_eq!(end.dq, [0.0; 4]);
    assert!((end.q[0] - 1.0).abs() < 1e-9 && end.q[3].abs() < 1e-9);
}

proptest! {
    #[test]
    fn whatever_is_wanted_of_the_hand_stays_within_magnitude_and_rate(
        wanted in prop::collection::vec(prop::array::uniform4(prop::num::f32::ANY), 1..60),
    ) {
        let mut limiter = HandLimiter::<f32>::new();
        let mut last = [0.0f32; 4];
        for wanted in wanted {
            let torques = *limiter.limit(&wanted).torques();
            for digit in 0..4 {
                let limit = TORQUE_LIMIT[digit] as f32;
                prop_assert!(torques[digit].is_finite() && torques[digit].abs() <= limit);
                prop_assert!((torques[digit] - last[digit]).abs() <= limit / 15.0 * 1.0001);
            }
            last = torques;
        }
    }
}
