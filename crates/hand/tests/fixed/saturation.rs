//! A million random inputs, extreme ones among them: nothing wraps, nothing panics. Wrapping is looked for with a
//! wide-integer oracle.

use control::HandSample;
use dmp::Scalar;
use hand::controller::{HandController, HandReference};
use hand::estimate::{HandEstimator, HandState};
use hand::filter::{GAUGE, LowPass};
use hand::limit::{HandLimiter, Scales};
use hand::motion::HandMotion;
use hand::number::{Number, share, within};
use puck::Counts;

use crate::common::{Movement, Random, demonstrated};

/// Cases of each test.
const CASES: usize = 1_000_000;

/// A number of any magnitude; one in eight is an extreme.
fn any(random: &mut Random) -> Number {
    let bits = random.bits();
    match bits % 8 {
        0 => [Number::MAX, -Number::MAX, Number::from_bits(i64::MIN), Number::ZERO, Number::ONE]
            [(bits >> 8) as usize % 5],
        _ => Number::from_bits(random.bits().cast_signed() >> ((bits >> 3) % 64)),
    }
}

fn saturated(wide: i128) -> i64 {
    wide.clamp(i64::MIN.into(), i64::MAX.into()) as i64
}

#[test]
fn a_million_random_operations_equal_wide_integers_that_are_saturated() {
    let mut random = Random(1);
    for _ in 0..CASES {
        let (a, b) = (any(&mut random), any(&mut random));
        let (x, y) = (i128::from(a.to_bits()), i128::from(b.to_bits()));
        assert_eq!((a + b).to_bits(), saturated(x + y), "{a:?} + {b:?}");
        assert_eq!((a - b).to_bits(), saturated(x - y), "{a:?} - {b:?}");
        assert_eq!((a * b).to_bits(), saturated((x * y) >> 32), "{a:?} x {b:?}");
        assert_eq!((-a).to_bits(), saturated(-x));
        if y > 0 && x.abs() < y {
            let exact = (x << 32) as f64 / y as f64;
            let found = share(a, b).to_bits() as f64;
            assert!((found - exact).abs() <= 8.0, "{a:?} of {b:?}: {found} and {exact}");
        }
    }
}

fn any_sample(random: &mut Random) -> HandSample {
    let mut counts = || {
        let bits = random.bits();
        (!bits.is_multiple_of(5)).then_some(Counts((random.bits() >> (bits % 40)) as i32))
    };
    let primary = [counts(), counts(), counts(), counts()];
    let secondary = [counts(), counts(), counts()];
    let mut gauge = || (!random.bits().is_multiple_of(5)).then_some(random.bits() as u16);
    HandSample { primary, secondary, gauges: [gauge(), gauge(), gauge()] }
}

#[test]
fn a_million_random_samples_and_references_leave_every_torque_within_its_limit() {
    let mut random = Random(2);
    let (mut estimator, mut controller, mut limiter) =
        (HandEstimator::new(), HandController::new(), HandLimiter::new());
    let scales = Scales::new([50_000; 4]);
    let mut last = [0.0; 4];
    for _ in 0..CASES {
        let sample = any_sample(&mut random);
        let reference = HandReference {
            q: core::array::from_fn(|_| any(&mut random)),
            dq: core::array::from_fn(|_| any(&mut random)),
        };
        let expected = [any(&mut random), any(&mut random), any(&mut random)];
        let Some(state) = estimator.update(Some(&sample)) else { continue };
        let wanted = controller.torque(&state, &reference, Some(&expected), random.bits().is_multiple_of(3));
        let (limited, _) = limiter.limit(&wanted);
        let now = limited.torques().map(Scalar::to_f64);
        for digit in 0..4 {
            let limit = control::act::hand::TORQUE_LIMIT[digit];
            assert!(now[digit].abs() <= limit, "{now:?}");
            assert!((now[digit] - last[digit]).abs() <= limit / 15.0 + 1e-9, "{last:?} to {now:?}");
        }
        last = now;
        assert_eq!(limited.frame(&scales).payload().len(), 8);
    }
}

#[test]
fn a_torque_points_where_wide_arithmetic_says_whatever_the_error() {
    // The law of a digit without force, in f64, cut to the range of the numbers: where it saturates, the sign must
    // hold.
    let mut random = Random(3);
    for _ in 0..CASES {
        let (q, q_d) = (any(&mut random), any(&mut random));
        let zero = Number::ZERO;
        let state = HandState { q: [q; 4], dq: [zero; 4], gauges: [zero; 3], age: [0; 4], gauge_age: u8::MAX };
        let torque = HandController::new().torque(&state, &HandReference::at_rest([q_d; 4]), None, false);
        let exact = 6.0 * (q_d.to_f64() - q.to_f64());
        let limit = Number::MAX.to_f64();
        let error = (torque[1].to_f64() - exact.clamp(-limit, limit)).abs();
        // The difference itself saturates before it is multiplied.
        let saturates = exact.abs() >= limit;
        assert!(error <= 1e-6 * exact.abs().max(1.0) || saturates, "{q:?} {q_d:?}: {} and {exact}", torque[1].to_f64());
        assert!(!saturates || torque[1].to_f64() * exact >= 0.0, "the torque turned round: {torque:?}, {exact}");
    }
}

#[test]
fn a_rollout_under_random_feedback_never_turns_its_torque_round() {
    let mut random = Random(5);
    let movement = Movement::closing(50, 2.0, 0.4).feeling();
    let primitive = movement.fixed();
    let bound = movement.limit * movement.stiffness;
    let mut rollout = demonstrated(primitive.movement());
    for case in 0..CASES {
        if case % 5000 == 0 {
            let start = core::array::from_fn(|_| within(any(&mut random), Number::ONE));
            rollout = primitive.run(&start, Number::ONE).expect("a start");
        }
        let gauges = [any(&mut random), any(&mut random), any(&mut random)];
        let zeta = primitive.coupling(&rollout, &gauges, Number::ONE);
        assert!(zeta.points.iter().all(|zeta| zeta.to_f64().abs() <= f64::from(bound) + 1e-6), "{zeta:?}");
        let period = Number::constant(control::PERIOD);
        let plan = rollout.step(primitive.movement(), period, &zeta).expect("its own").points;
        // Feedback at its limit displaces by half a radian at rest, transients by a little more.
        assert!(plan.x.iter().all(|q| q.to_f64().abs() < 6.0), "{plan:?}");
    }
}

#[test]
fn filters_and_moves_survive_a_million_extremes() {
    let mut random = Random(6);
    let mut filter = LowPass::<3>::new(GAUGE);
    for _ in 0..CASES {
        // Bounded input, bounded output; extremes saturate and do not come out with the other sign at once.
        filter.step(&core::array::from_fn(|_| any(&mut random)));
        let motion = HandMotion::new(
            &core::array::from_fn(|_| any(&mut random)),
            &core::array::from_fn(|_| any(&mut random)),
            any(&mut random),
        );
        motion.now();
    }
    let mut settled = LowPass::<3>::new(GAUGE);
    settled.settle(&[Number::from_f64(1.0e6); 3]);
    assert!(settled.step(&[Number::from_f64(1.0e6); 3]).iter().all(|value| value.to_f64() > 9.99e5));
}
