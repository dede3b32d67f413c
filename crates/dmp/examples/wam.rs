//! A Barrett WAM with its hand at 300 Hz: one pose, seven joints of posture and four digits on one phase. Six wrist
//! values and three finger gauges bend the plan, Eq. (8); a push along +y moves it along +y.

use std::error::Error;

use dmp::fit::{Demonstration, FitOptions, PoseSamples, fit, minimum_jerk};
use dmp::{
    Coupling, CouplingGains, DisplacementLimits, ExpectedSensors, PhaseTable, PoseCoupling, PoseLimits, Primitive,
    Quaternion, Rollout, StartState,
};

/// Posture 7, hand 4.
const ROWS: usize = 11;
/// Control period, s.
const PERIOD: f64 = 1.0 / 300.0;
/// Force 3 (N), torque 3 (N m), finger gauges 3 (N m).
const SENSORS: usize = 9;

fn main() -> Result<(), Box<dyn Error>> {
    // Reach 0.3 m forward in 5 s, turn half a radian, close the hand.
    let n = 1501;
    let position = minimum_jerk([0.4, 0.0, 0.2], [0.7, 0.0, 0.2], n);
    let orientation = minimum_jerk([0.0; 3], [0.0, 0.0, 0.5], n).iter().map(Quaternion::from_rotation_vector).collect();
    let mut rows = minimum_jerk([0.0; ROWS], [0.2, 0.1, -0.1, 0.4, 0.0, 0.1, 0.0, 0.0, 2.1, 2.1, 2.1], n);
    rows.iter_mut().for_each(|row| row[3] += 1.5);
    let demonstration = Demonstration::new(PERIOD, [PoseSamples { position, orientation }], rows)?;
    let primitive: Primitive<f32, ROWS, 1, 50> = fit(&demonstration, &FitOptions::default())?.primitive()?;

    // K1 of position, orientation and hand, K2 = 1; nothing is expected to be measured on the way.
    let k1 = PhaseTable::constant([20.0, 20.0, 20.0, 5.0, 5.0, 5.0, 0.0, 30.0, 30.0, 30.0])?;
    let gains = CouplingGains::<f32, 10, SENSORS, 4>::new(k1, PhaseTable::constant([1.0; SENSORS])?)?;
    let expected = ExpectedSensors::<f32, SENSORS, 4>::new(&[[0.0; SENSORS]], 5.0)?;
    let limits = DisplacementLimits { poses: [PoseLimits { displacement: 0.25, rotation: 0.4 }], points: [0.5; ROWS] };
    limits.check()?;

    let mut rollout = Rollout::start(&primitive, &StartState::demonstrated(&primitive))?;
    let mut plan = rollout.step(&primitive, PERIOD as f32, &Coupling::NONE)?;
    let mut farthest = 0.0_f32;
    while plan.progress < 1.5 {
        let push = if (0.3..0.6).contains(&plan.progress) { 2.0 } else { 0.0 };
        let measured = [0.0, push, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let at = expected.at(rollout.progress());
        let error = std::array::from_fn(|i| measured[i] - at[i]);
        let [px, py, pz, rx, ry, rz, hand @ ..] =
            gains.zeta(rollout.progress(), &error, |&[fx, fy, fz, tx, ty, tz, f1, f2, f3]| {
                [fx, fy, fz, tx, ty, tz, 0.0, f1, f2, f3]
            });
        let mut zeta = Coupling::NONE;
        zeta.poses[0] = PoseCoupling { position: [px, py, pz], orientation: [rx, ry, rz] };
        zeta.points[7..].copy_from_slice(&hand);
        plan = rollout.step(&primitive, PERIOD as f32, &primitive.limited_coupling(&zeta, &limits))?;
        farthest = farthest.max(plan.poses[0].position.x[1]);
    }
    println!("pushed {farthest:.3} m aside, back at {:.3?}", plan.poses[0].position.x);
    assert!(farthest > 0.1 && plan.poses[0].position.x[1].abs() < 5e-3);
    Ok(())
}
