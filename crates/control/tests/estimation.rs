//! Joint estimation: wrap, loss, implausible replies, noise of quantisation; and the wrench filter.

use control::sense::JointEstimator;
use control::sense::filter::{Butterworth, LowPass};
use control::sense::joints::COAST_CYCLES;
use control::time::periods;
use control::units::{JointPositions, Vector7};
use control::{Calibration, Payload, RATE, Real, model};
use nalgebra::SVector;
use puck::Counts;

type Replies = [Option<Counts>; 7];

fn replies(calibration: &Calibration<f64>, q: [f64; 7]) -> Replies {
    let motor = calibration.transmission().motor_from_joint(&q);
    calibration.drives().counts(&motor).expect("finite").map(|counts| Some(counts.wrapped()))
}

fn nominal<R: Real>() -> Calibration<R> {
    Calibration::nominal(Payload::SensorAndHand)
}

#[test]
fn the_transmission_of_the_bus_is_that_of_the_arm_model() {
    let calibration = nominal::<f64>();
    for joint in 0..7 {
        let mut unit = [0.0; 7];
        unit[joint] = 1.0;
        let motors = calibration.transmission().motor_from_joint(&unit);
        for (motor, row) in model::JOINT_TO_MOTOR.iter().enumerate() {
            let expected = row[joint];
            // The model file rounds N3/n3 to six digits.
            assert!(
                (motors[motor] - expected).abs() < 1e-4,
                "M{} J{}: {} {expected}",
                motor + 1,
                joint + 1,
                motors[motor]
            );
        }
    }
}

#[test]
fn a8_a_motor_that_turned_fast_and_stands_still_to_the_count_is_missing() {
    let calibration = nominal::<f64>();
    let at =
        |cycle: i32| replies(&calibration, [0.0, 0.0, 0.0, 1.2, 0.0, 0.0, 0.0].map(|dq| dq * f64::from(cycle) / RATE));
    let mut estimator = JointEstimator::new(&calibration);
    for cycle in 0..100 {
        let state = estimator.update(&at(cycle), true).expect("whole");
        assert!(!state.stuck && state.missing == 0, "{cycle}");
    }
    let mut frozen = at(100);
    frozen[3] = at(99)[3];
    let state = estimator.update(&frozen, true).expect("known");
    assert!(state.stuck && state.missing == 1, "{state:?}");
    let state = estimator.update(&frozen, false).expect("known");
    assert!(!state.stuck, "without torque nothing is concluded");
}

/// Largest change of the speed of a motor that is believed at once (counts a cycle).
fn gate(motor: usize) -> i32 {
    let limits = model::JOINT_TO_MOTOR[motor].iter().zip(model::VELOCITY_MAX);
    let fastest: f64 = limits.map(|(ratio, limit)| ratio.abs() * limit).sum();
    (1.5 * fastest * 4096.0 / std::f64::consts::TAU / RATE) as i32 + 1
}

/// An estimator of an arm of which one motor turns by so many counts a cycle, and its last replies.
fn turning(motor: usize, step: i32) -> (JointEstimator<f64>, Replies) {
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    let mut sample: Replies = [Some(Counts(0)); 7];
    let mut counts = 0;
    for cycle in 0..50 {
        counts += step.min(cycle * gate(motor) / 2);
        sample[motor] = Some(Counts(counts).wrapped());
        let state = estimator.update(&sample, true).expect("known");
        assert!(!state.stuck && state.missing == 0, "M{}: {step} counts, cycle {cycle}", motor + 1);
    }
    (estimator, sample)
}

#[test]
fn a8_a_motor_of_the_arm_between_an_eighth_and_the_whole_of_its_gate_does_not_stop_dead_and_one_of_the_wrist_may() {
    // A sixteenth where a plan turns it.
    for (motor, planned) in (0..7).flat_map(|motor| [(motor, false), (motor, true)]) {
        let gate = gate(motor);
        let slow = gate / if planned { 16 } else { 8 };
        for (step, is_fast) in [(slow, false), (slow + 1, true), (gate, true), (gate + 1, false)] {
            let (mut estimator, sample) = turning(motor, step);
            estimator.expect_plan(planned);
            let state = estimator.update(&sample, true).expect("known");
            let stuck = is_fast && motor < 4;
            assert_eq!((state.stuck, state.missing), (stuck, u8::from(stuck)), "M{}: {step} of {gate}", motor + 1);
        }
    }
}

#[test]
fn after_a_silence_a_motor_may_be_as_far_as_it_can_have_turned_while_it_was_bridged_and_one_cycle_more() {
    for motor in 0..7 {
        for (silent, cycles) in [(0, 1), (1, 2), (COAST_CYCLES, COAST_CYCLES + 1), (COAST_CYCLES + 9, COAST_CYCLES + 1)]
        {
            for sign in [1, -1] {
                let believed = |counts: i32| {
                    let (mut estimator, mut sample) = turning(motor, 0);
                    sample[motor] = None;
                    for _ in 0..silent {
                        estimator.update(&sample, true);
                    }
                    sample[motor] = Some(Counts(sign * counts).wrapped());
                    estimator.update(&sample, true).expect("known").missing == 0
                };
                let farthest = gate(motor) * i32::from(cycles);
                assert!(believed(farthest) && !believed(farthest + 1), "M{} after {silent} cycles", motor + 1);
            }
        }
    }
}

#[test]
fn a_reply_after_a_lost_one_tells_the_speed_per_cycle_and_a_single_count_is_a_motion() {
    for motor in 0..4 {
        let step = gate(motor) / 8;
        let (mut estimator, mut sample) = turning(motor, step);
        let counts = sample[motor].expect("whole").0;
        sample[motor] = None;
        estimator.update(&sample, true);
        sample[motor] = Some(Counts(counts + 2 * step).wrapped());
        assert_eq!(estimator.update(&sample, true).expect("known").missing, 0);
        assert!(!estimator.update(&sample, true).expect("known").stuck, "too slow to be called stuck");
        sample[motor] = None;
        estimator.update(&sample, true);
        sample[motor] = Some(Counts(counts + 2 * step + 1).wrapped());
        assert_eq!(estimator.update(&sample, true).expect("known").still, 0x7F & !(1 << motor));
    }
}

#[test]
fn g1_a_blow_goes_on_as_it_began_and_is_four_gates_hard_at_most_and_everything_else_is_a_jump_or_unknown() {
    for motor in 0..7 {
        let gate = gate(motor);
        for (first, then, known, jumped) in [
            (4 * gate, 4 * gate, true, false),
            (3 * gate, 4 * gate, true, false),
            (3 * gate, 4 * gate + 1, false, false),
            (4 * gate + 1, 4 * gate + 1, false, false),
            (3 * gate, 0, true, true),
        ] {
            let (mut estimator, mut sample) = turning(motor, 0);
            let mut counts = 0;
            let mut state = None;
            for step in [first, then] {
                counts += step;
                sample[motor] = Some(Counts(counts).wrapped());
                state = estimator.update(&sample, true);
            }
            let state = state.expect("known");
            let what = format!("M{}: {first}, then {then}, gate {gate}: {state:?}", motor + 1);
            assert_eq!((state.missing == 0, state.displaced), (known, jumped), "{what}");
            if known && !jumped {
                assert_eq!((state.age, state.implausible), (0, false), "{what}");
                sample[motor] = Some(Counts(counts + then).wrapped());
                let after = estimator.update(&sample, true).expect("known");
                assert_eq!((after.age, after.implausible, after.displaced), (0, false, false), "{what}");
            }
        }
    }
}

#[test]
fn g1_a_motor_may_be_thrown_back_at_half_its_speed_or_go_on_each_changed_by_one_gate_and_no_more() {
    for motor in 0..7 {
        let gate = gate(motor);
        for sign in [1, -1] {
            for (moved, expected) in
                [(2 * gate, true), (2 * gate + 1, false), (-(gate / 2) - gate, true), (-(gate / 2) - gate - 1, false)]
            {
                let (mut estimator, mut sample) = turning(motor, sign * gate);
                sample[motor] = sample[motor].map(|counts| Counts(counts.0 + sign * moved).wrapped());
                let believed = estimator.update(&sample, true).expect("known").missing == 0;
                assert_eq!(believed, expected, "M{}: {sign} times {gate}, then {moved}", motor + 1);
            }
        }
    }
}

#[test]
fn a_single_wild_reply_is_implausible_once() {
    let (mut estimator, sample) = turning(0, 3);
    let mut wild = sample;
    wild[0] = Some(Counts(50_000));
    assert!(estimator.update(&wild, true).expect("known").implausible);
    let state = estimator.update(&sample, true).expect("known");
    assert_eq!((state.implausible, state.missing, state.displaced), (false, 0, false));
}

#[test]
fn d8_a_clock_that_is_off_by_one_percent_scales_velocities_by_one_percent() {
    let calibration = nominal::<f64>();
    let speed = [0.8, -0.6, 0.9, -1.2, 1.5, -1.1, 2.0];
    for slow in [-0.01, 0.0, 0.01] {
        let mut estimator = JointEstimator::new(&calibration);
        let mut sum = Vector7::zeros();
        for cycle in 0..400 {
            let time = f64::from(cycle) * (1.0 + slow) / RATE;
            let state = estimator.update(&replies(&calibration, speed.map(|speed| speed * time)), true);
            if cycle >= 100 {
                sum += state.expect("whole").dq.0;
            }
        }
        for joint in 0..7 {
            let scale = sum[joint] / 300.0 / speed[joint] - 1.0;
            assert!((scale - slow).abs() < 0.003, "J{}: {scale} for {slow}", joint + 1);
        }
    }
}

#[test]
fn a_calibration_with_garbage_scales_is_refused() {
    let good = ([4096; 7], [2472; 7]);
    assert!(Calibration::<f32>::new(good.0, good.1, Payload::None).is_ok());
    for bad in [0, -4096, 255, i32::MAX] {
        let mut counts = good.0;
        counts[4] = bad;
        let error = Calibration::<f32>::new(counts, good.1, Payload::None).expect_err("refused");
        assert_eq!(error, control::CalibrationError::CountsPerRevolution(4));
        let mut torques = good.1;
        torques[2] = if bad == i32::MAX { bad } else { bad.min(499) };
        assert!(Calibration::<f32>::new(good.0, torques, Payload::None).is_err());
    }
}

#[test]
fn positions_are_those_of_the_counts() {
    let q = [0.3, -1.2, 0.7, 2.1, -3.0, 0.4, -2.2];
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let state = estimator.update(&replies(&calibration, q), false).expect("complete");
    for (estimate, true_angle) in state.q.0.iter().zip(q) {
        assert!((f64::from(*estimate) - true_angle).abs() < 2e-4, "{state:?}");
    }
    assert_eq!(state.dq.0, Vector7::zeros());
}

#[test]
fn nothing_is_known_before_all_seven_answer_together() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let mut partial = replies(&calibration, [0.1; 7]);
    partial[6] = None;
    assert!(estimator.update(&partial, false).is_none());
    assert!(estimator.update(&[None; 7], false).is_none());
    assert!(estimator.update(&replies(&calibration, [0.1; 7]), false).is_some());
}

#[test]
fn a9_the_22_bit_counter_wraps_without_a_step() {
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    // J1 turns so far (on paper) that the counter of M1 passes 2^21.
    let start = (1 << 21) - 50;
    let mut last: Option<f64> = None;
    for step in 0..100 {
        let mut counts = [Some(Counts(0)); 7];
        counts[0] = Some(Counts(start + step).wrapped());
        let state = estimator.update(&counts, true).expect("complete");
        assert_eq!((state.missing, state.implausible), (0, false));
        if let Some(last) = last {
            let expected = -std::f64::consts::TAU / 4096.0 / 42.0;
            assert!((state.q.0[0] - last - expected).abs() < 1e-9);
        }
        last = Some(state.q.0[0]);
    }
}

#[test]
fn constant_speed_is_estimated_without_bias_and_with_little_noise() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f32>::new(&nominal());
    let speed = [0.5, -0.4, 0.6, -0.5, 1.0, -0.8, 1.2];
    let (mut sum, mut square, mut count) = ([0.0f64; 7], [0.0f64; 7], 0.0);
    for cycle in 0..400 {
        let q = speed.map(|speed| 0.2 + speed * cycle as f64 / RATE);
        let state = estimator.update(&replies(&calibration, q), true).expect("complete");
        if cycle > 60 {
            for joint in 0..7 {
                let error = f64::from(state.dq.0[joint]) - speed[joint];
                sum[joint] += error;
                square[joint] += error * error;
            }
            count += 1.0;
        }
    }
    for joint in 0..7 {
        let (mean, rms) = (sum[joint] / count, (square[joint] / count).sqrt());
        assert!(mean.abs() < 2e-3 && rms < 6e-3, "J{}: mean {mean}, rms {rms} rad/s", joint + 1);
    }
}

#[test]
fn a1_a_lost_reply_changes_position_and_velocity_by_little() {
    let calibration = nominal::<f64>();
    let run = |lost: std::ops::Range<i32>| {
        let mut estimator = JointEstimator::<f64>::new(&nominal());
        let mut states = Vec::new();
        for cycle in 0..140 {
            // One rad/s with some acceleration.
            let t = f64::from(cycle) / RATE;
            let q = [0.8 * t + 0.5 * t * t; 7];
            let mut sample = replies(&calibration, q);
            if lost.contains(&cycle) {
                sample[0] = None;
                sample[4] = None;
            }
            states.push(estimator.update(&sample, true).expect("complete"));
        }
        states
    };
    let nominal_states = run(0..0);
    for length in 1..=5 {
        for (cycle, (a, b)) in run(100..100 + length).iter().zip(&nominal_states).enumerate() {
            let dq = (a.q.0 - b.q.0).amax();
            let ddq = (a.dq.0 - b.dq.0).amax();
            assert!(dq < 5e-4 && ddq < 0.03, "{length} lost, cycle {cycle}: {dq} rad, {ddq} rad/s");
            let lost = cycle >= 100 && cycle < 100 + length as usize;
            assert_eq!(a.missing, if lost { 2 } else { 0 });
        }
    }
}

/// The estimator after a second at this speed (rad/s), and the replies of its last cycle.
fn moving(calibration: &Calibration<f64>, speed: f64) -> (JointEstimator<f64>, impl Fn(i32) -> [f64; 7]) {
    let at = move |cycle: i32| [0.2 + speed * f64::from(cycle) / RATE; 7];
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    for cycle in -300..=0 {
        estimator.update(&replies(calibration, at(cycle)), true).expect("complete");
    }
    (estimator, at)
}

#[test]
fn a7_a_jump_of_counts_moves_no_position_and_hides_no_speed_and_is_told_for_good() {
    let calibration = nominal::<f64>();
    for speed in [0.0, 0.6, -0.6] {
        for jump in [2_000, -5_000, 100_000, 1 << 20] {
            let (mut estimator, at) = moving(&calibration, speed);
            for cycle in 1..=60 {
                let mut sample = replies(&calibration, at(cycle));
                sample[1] = sample[1].map(|counts| Counts(counts.0 + jump).wrapped());
                let state = estimator.update(&sample, true).expect("known");
                assert_eq!(state.implausible, cycle <= 2, "{speed} rad/s, {jump}, cycle {cycle}");
                assert_eq!((state.missing, state.displaced), (u8::from(cycle == 1), cycle > 1));
                for joint in 0..7 {
                    assert!((state.q.0[joint] - at(cycle)[joint]).abs() < 2e-3, "{jump}, cycle {cycle}: {state:?}");
                    assert!((state.dq.0[joint] - speed).abs() < 0.05, "{jump}, cycle {cycle}: {state:?}");
                }
            }
        }
    }
}

#[test]
fn the_last_counts_are_those_the_pucks_told_even_after_a_jump_and_as_old_as_the_last_reply() {
    let calibration = nominal::<f64>();
    assert_eq!(JointEstimator::<f64>::new(&nominal()).last_counts(), None);
    let (mut estimator, at) = moving(&calibration, 0.0);
    let mut sample = replies(&calibration, at(0));
    sample[1] = sample[1].map(|counts| Counts(counts.0 + 100_000).wrapped());
    let told = sample.map(|counts| counts.expect("whole"));
    for silent in 0..4 {
        assert_eq!(estimator.update(&sample, true).expect("known").displaced, silent > 0);
        let last = estimator.last_counts().expect("known");
        if silent > 0 {
            assert_eq!(last.map(|(counts, _)| counts), told);
        }
        assert_eq!(last.map(|(_, age)| age), [0, u8::from(silent == 0), 0, 0, silent, 0, 0]);
        sample[4] = None;
    }
}

#[test]
fn who_knows_that_the_zero_is_lost_says_so_and_it_counts_until_everything_is_forgotten() {
    let calibration = nominal::<f64>();
    let (mut estimator, at) = moving(&calibration, 0.0);
    assert!(!estimator.is_displaced());
    estimator.displace();
    assert!(estimator.is_displaced());
    assert!(estimator.update(&replies(&calibration, at(0)), true).expect("known").displaced);
    estimator.reset();
    assert!(!estimator.is_displaced());
}

#[test]
fn the_motors_that_did_not_turn_by_a_count_are_told_one_by_one() {
    let calibration = nominal::<f64>();
    for turning in 0..=0x7F_u8 {
        for step in [1, -1] {
            let (mut estimator, at) = moving(&calibration, 0.0);
            let mut sample = replies(&calibration, at(0));
            for motor in (0..7).filter(|motor| turning >> motor & 1 != 0) {
                sample[motor] = sample[motor].map(|counts| Counts(counts.0 + step).wrapped());
            }
            assert_eq!(estimator.update(&sample, true).expect("known").still, !turning & 0x7F);
            let lost = usize::from(turning % 7);
            sample[lost] = None;
            let state = estimator.update(&sample, true).expect("known");
            assert_eq!(state.still, 0x7F & !(1 << lost), "who is not heard is not known to stand");
        }
    }
}

#[test]
fn the_joints_that_a_silent_motor_turns_are_told_as_extrapolated() {
    let calibration = nominal::<f64>();
    for lost in 0..=0x7F_u8 {
        let (mut estimator, at) = moving(&calibration, 0.0);
        let mut sample = replies(&calibration, at(0));
        let mut joints = 0;
        for motor in (0..7).filter(|motor| lost >> motor & 1 != 0) {
            sample[motor] = None;
            for joint in (0..7).filter(|joint| model::JOINT_TO_MOTOR[motor][*joint] != 0.0) {
                joints |= 1 << joint;
            }
        }
        let state = estimator.update(&sample, true).expect("known");
        assert_eq!((state.extrapolated, u32::from(state.missing)), (joints, lost.count_ones()), "{lost:07b}");
    }
}

#[test]
fn a7_without_torque_two_replies_that_agree_are_the_new_truth_and_the_zero_is_lost_all_the_same() {
    let calibration = nominal::<f64>();
    let (mut estimator, at) = moving(&calibration, 0.0);
    let jumped = replies(&calibration, [0.7; 7]);
    // All but M3, whose differential cancels equal turns of J2 and J3.
    assert_eq!(estimator.update(&jumped, false).expect("known").missing, 6);
    let state = estimator.update(&jumped, false).expect("known");
    assert_eq!((state.missing, state.displaced), (0, true));
    assert!((state.q.0[3] - 0.7).abs() < 1e-3, "{state:?}");
    // Back where it was: the positions are right again by chance, and nobody can know it.
    for _ in 0..3 {
        estimator.update(&replies(&calibration, at(0)), false);
    }
    assert!(estimator.update(&replies(&calibration, at(0)), false).expect("known").displaced);
    estimator.reset();
    assert!(!estimator.update(&replies(&calibration, at(0)), false).expect("known").displaced);
}

#[test]
fn a7_replies_that_jump_about_are_not_believed() {
    let calibration = nominal::<f64>();
    let (mut estimator, at) = moving(&calibration, 0.0);
    for cycle in 1..=20 {
        let mut sample = replies(&calibration, at(0));
        sample[4] = sample[4].map(|counts| Counts(counts.0 + cycle * cycle * 3_000).wrapped());
        let state = estimator.update(&sample, true).expect("known");
        assert!(state.implausible && i32::from(state.age) == cycle, "cycle {cycle}: {state:?}");
    }
}

#[test]
fn g1_an_arm_that_is_thrown_is_believed_at_any_speed() {
    // 150 rad/s^2 for 0.1 s: 15 rad/s, far beyond every limit.
    let calibration = nominal::<f64>();
    for joint in 0..7 {
        let mut estimator = JointEstimator::<f64>::new(&nominal());
        for cycle in 0..90 {
            let t = f64::from(cycle) / RATE;
            let (thrown, speed) = if t < 0.1 { (75.0 * t * t, 150.0 * t) } else { (0.75 + 15.0 * (t - 0.1), 15.0) };
            let mut q = [0.1; 7];
            q[joint] += thrown;
            let state = estimator.update(&replies(&calibration, q), true).expect("complete");
            assert_eq!((state.missing, state.implausible, state.displaced), (0, false, false), "J{}, {t} s", joint + 1);
            if t > 0.15 {
                assert!((state.dq.0[joint] - speed).abs() < 0.1, "J{}, {t} s: {state:?}", joint + 1);
            }
        }
    }
}

#[test]
fn after_the_bridge_the_estimate_stands_still() {
    let calibration = nominal::<f64>();
    let mut estimator = JointEstimator::<f64>::new(&nominal());
    for cycle in 0..100 {
        estimator.update(&replies(&calibration, [0.5 * f64::from(cycle) / RATE; 7]), true);
    }
    let mut last = JointPositions::<f64>::zero();
    for cycle in 0..60u8 {
        let state = estimator.update(&[None; 7], true).expect("known");
        if cycle > COAST_CYCLES {
            assert!((state.q.0 - last.0).amax() < 1e-12);
        }
        if cycle > 40 {
            assert!(state.dq.0.amax() < 1e-3, "{state:?}");
        }
        last = state.q;
    }
}

#[test]
fn g1_a_joint_that_runs_into_its_stop_at_any_speed_is_believed() {
    let calibration = nominal::<f64>();
    for joint in 0..7 {
        for (speed, thrown_back) in [(20.0, 0.0), (-20.0, 0.4), (30.0, 0.3)] {
            let mut estimator = JointEstimator::<f64>::new(&nominal());
            let mut q = 0.0;
            for cycle in 0..60 {
                // Up to the speed in 0.1 s, then at a stop.
                let now = if cycle < 30 { speed * f64::from(cycle) / 30.0 } else { -speed * thrown_back };
                q += now / RATE;
                let mut angles = [0.1; 7];
                angles[joint] += q;
                let state = estimator.update(&replies(&calibration, angles), true).expect("complete");
                assert_eq!((state.missing, state.displaced), (0, false), "J{}, cycle {cycle}", joint + 1);
            }
        }
    }
}

#[test]
fn g1_a_wrist_that_a_blow_sets_turning_within_a_cycle_is_believed_by_its_second_reply() {
    // J5 hits its stop, and J7, whose axis is nearly the same, turns by 10 rad/s faster from one cycle to the next.
    // Its speed has come through the velocity filter a thirtieth of a second later.
    let believed = 30 + periods(1.0 / 30.0);
    let calibration = nominal::<f64>();
    for speed in [10.0, -10.0] {
        let mut estimator = JointEstimator::<f64>::new(&nominal());
        let mut q = [0.1; 7];
        for cycle in 0..60 {
            q[6] += if cycle < 30 { 0.0 } else { speed / RATE };
            let state = estimator.update(&replies(&calibration, q), true).expect("known");
            assert_eq!((state.missing, state.displaced), (u8::from(cycle == 30), false), "cycle {cycle}");
            assert!((state.q.0[6] - q[6]).abs() < 2e-3 || cycle == 30, "cycle {cycle}: {state:?}");
            assert!((state.dq.0[6] - speed).abs() < 0.1 || cycle < believed, "cycle {cycle}: {state:?}");
        }
    }
}

#[test]
fn the_filter_has_unit_gain_at_rest_and_half_power_at_its_cut_off() {
    let gain = |frequency: f64| {
        let mut filter = LowPass::<f64, 1>::new(Butterworth::new(50.0, 300.0));
        let (mut inputs, mut outputs) = (0.0, 0.0);
        for k in 0..3000 {
            let x = (std::f64::consts::TAU * frequency * f64::from(k) / 300.0).sin();
            let y = filter.step(&SVector::from([x]))[0];
            if k >= 1500 {
                inputs += x * x;
                outputs += y * y;
            }
        }
        (outputs / inputs).sqrt()
    };
    assert!((gain(0.2) - 1.0).abs() < 1e-3);
    assert!((gain(50.0) - 0.5f64.sqrt()).abs() < 1e-3);
    assert!(gain(120.0) < 0.05);
    let mut filter = LowPass::<f64, 1>::new(Butterworth::new(15.0, 300.0));
    filter.settle(&SVector::from([3.0]));
    for _ in 0..10 {
        assert!((filter.step(&SVector::from([3.0]))[0] - 3.0).abs() < 1e-12);
    }
}
