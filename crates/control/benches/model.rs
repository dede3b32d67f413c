//! Cost of the model of the arm: kinematics, inverse dynamics, mass matrix and the observer of motion, in f64 and f32.

use control::model::{ArmModel, Frames, Payload};
use control::real::Real;
use control::sense::{JointState, MotionObserver};
use control::units::{JointAccelerations, JointPositions, JointVelocities};
use divan::{Bencher, black_box};

fn main() {
    divan::main();
}

const POSTURES: usize = 64;

/// Postures all over the workspace: each benchmark goes through all of them, so that none is answered from memory.
fn postures<R: Real>() -> Vec<JointPositions<R>> {
    let wave = |n: usize, joint: usize| R::constant(f64::sin(1.7 * n as f64 + 0.9 * joint as f64));
    (0..POSTURES).map(|n| JointPositions::from_array(core::array::from_fn(|joint| wave(n, joint)))).collect()
}

fn each<R: Real, O>(bencher: Bencher<'_, '_>, run: impl Fn(&ArmModel<R>, &JointPositions<R>, &Frames<R>) -> O) {
    let model = ArmModel::<R>::new(Payload::SensorAndHand);
    let postures: Vec<_> = postures::<R>().into_iter().map(|q| (q, Frames::new(&model, &q))).collect();
    bencher.counter(divan::counter::ItemsCount::new(POSTURES)).bench_local(|| {
        for (q, frames) in &postures {
            black_box(run(black_box(&model), black_box(q), black_box(frames)));
        }
    });
}

#[divan::bench(types = [f64, f32])]
fn forward_kinematics_and_jacobian<R: Real>(bencher: Bencher<'_, '_>) {
    each::<R, _>(bencher, |model, q, _| Frames::new(model, q).jacobian());
}

#[divan::bench(types = [f64, f32])]
fn inverse_dynamics<R: Real>(bencher: Bencher<'_, '_>) {
    each::<R, _>(bencher, |model, q, frames| {
        model.inverse_dynamics(frames, &JointVelocities(q.0), &JointAccelerations(q.0))
    });
}

#[divan::bench(types = [f64, f32])]
fn mass_matrix<R: Real>(bencher: Bencher<'_, '_>) {
    each::<R, _>(bencher, |model, _, frames| model.mass_matrix(frames));
}

/// A cycle of the observer, in the mean: every eighth renews the mass matrix.
#[divan::bench(types = [f64, f32])]
fn observer<R: Real>(bencher: Bencher<'_, '_>) {
    let observer = core::cell::RefCell::new(MotionObserver::<R>::new());
    each::<R, _>(bencher, |model, q, frames| {
        let mut observer = observer.borrow_mut();
        let state = JointState::whole(*q, JointVelocities(q.0));
        observer.update(&state, false);
        let velocity = observer.velocity(&state, control::sense::observer::Trust::Compliant, &state.dq.0);
        observer.send(model, frames, &velocity, &q.0);
        velocity
    });
}
