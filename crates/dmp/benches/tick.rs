//! One control tick of a whole primitive: 3 positions, quaternion, 7 posture rows and 4 fingers on one phase.

use divan::{Bencher, black_box};
use dmp::{
    Configuration, Coupling, Gains, Hemisphere, OrientationError, Pose, Primitive, PrimitiveTables, Quaternion,
    Rollout, Scalar, StartState, Stiffness, Velocity,
};

fn main() {
    divan::main();
}

/// One pose and eleven point rows: the arm of seven joints with a hand of four.
type Arm<T, const N: usize> = Primitive<T, 11, 1, N>;

fn primitive<T: Scalar, const N: usize>(kernels: usize) -> Arm<T, N> {
    let f = T::from_f64;
    let weights: Option<Vec<T::Weight>> =
        (0..Arm::<T, N>::ROWS * kernels).map(|i| f(0.3 * (0.37 * i as f64).sin()).to_weight()).collect();
    let weights = weights.expect("small weights");
    let configuration =
        |x: f64, orientation| Configuration { poses: [Pose { position: [f(x); 3], orientation }], points: [f(x); 11] };
    let turned = Quaternion::from_rotation_vector(&[f(0.4), f(-0.8), f(0.3)]);
    Primitive::new(&PrimitiveTables {
        control_period: f(1.0 / 300.0),
        duration: f(5.0),
        alpha: f(4.605),
        activation: f(0.7),
        kernel_count: kernels,
        weights: &weights,
        gains: Gains::critically_damped(&Stiffness::uniform(f(200.0)), OrientationError::Quaternion),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: configuration(0.0, Quaternion::IDENTITY),
        goal: configuration(0.5, turned),
        start_velocity: Velocity::ZERO,
    })
    .unwrap()
}

/// A whole movement of 1500 ticks; the time per tick is a 1500th of it.
fn movement<T: Scalar, const N: usize>(bencher: Bencher<'_, '_>) {
    let primitive = primitive::<T, N>(N);
    let dt = T::from_f64(1.0 / 300.0);
    let start = StartState::at_rest(*primitive.start());
    bencher.counter(divan::counter::ItemsCount::new(1500_usize)).bench_local(|| {
        let mut rollout = Rollout::start(&primitive, &start).unwrap();
        for _ in 0..1500 {
            black_box(rollout.step(black_box(&primitive), dt, &Coupling::NONE).unwrap());
        }
    });
}

#[divan::bench]
fn f64_50_kernels(bencher: Bencher<'_, '_>) {
    movement::<f64, 50>(bencher);
}

#[divan::bench]
fn f32_50_kernels(bencher: Bencher<'_, '_>) {
    movement::<f32, 50>(bencher);
}

#[divan::bench]
fn f32_100_kernels(bencher: Bencher<'_, '_>) {
    movement::<f32, 100>(bencher);
}

#[divan::bench]
fn fixed_50_kernels(bencher: Bencher<'_, '_>) {
    movement::<dmp::FixedPoint, 50>(bencher);
}
