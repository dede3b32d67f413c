//! One joint at 1 kHz from the parts alone: phase, forcing term, spring and damper. No learning, no allocation.

use dmp::{Basis, CanonicalSystem, ForcingTerm, Phase, PointInput, PointState, TransformationSystem};

/// Control period, s.
const PERIOD: f32 = 1e-3;
/// Duration of the movement, s.
const DURATION: f32 = 1.5;

fn main() -> Result<(), &'static str> {
    let canonical = CanonicalSystem::new(CanonicalSystem::<f32>::DEFAULT_ALPHA as f32).ok_or("alpha")?;
    let basis = Basis::<f32, 10>::new(&canonical, 10, 0.7).ok_or("basis")?;
    // Weights that lift the joint over the straight way, rad.
    let weights = [0.0, 0.3, 0.5, 0.4, 0.2, 0.0, 0.0, 0.0, 0.0, 0.0];
    let forcing = ForcingTerm::<f32, 1, 10>::new(basis, &weights).ok_or("weights")?;
    let system = TransformationSystem::critically_damped(200.0).map_err(|_| "gains")?;
    let h = PERIOD / DURATION;
    assert!(h < system.largest_step(), "the integration would be unstable");

    let (start, goal) = (0.1, 0.9);
    let (mut phase, mut state) = (Phase::START, PointState::new(start, 0.0));
    for tick in 0..2500 {
        let [f] = forcing.evaluate(phase.s());
        let acceleration = system.right_hand_side(&state, &PointInput { start, goal, s: phase.s(), f, zeta: 0.0 });
        if tick % 250 == 0 {
            println!("{:.2} s: {:.3} rad, {:+.3} rad/s", tick as f32 * PERIOD, state.x(), state.v() / DURATION);
        }
        state.step(acceleration, h);
        phase.step(&canonical, h);
    }
    assert!((state.x() - goal).abs() < 2e-3, "the joint ends at {} rad", state.x());
    Ok(())
}
