//! Golden vectors of Eqs. (1)-(9): f64 within 1e-10 of the Euler reference, f32 within 5e-6 m and 1e-5, fixed point
//! within 5e-4, and all of them within the stated integrator error of the continuous solution.

use crate::arm::{Coupling, Reference, coupling};
use crate::common::{ALPHA, DT, K, N, Plan, Table, largest_difference, run, theta, ticks};
use dmp::{
    Basis, CanonicalSystem, FixedPoint, ForcingTerm, Phase, PointInput, PointState, Quaternion, Scalar,
    TransformationSystem,
};

const F64: f64 = 1e-10;
const F32_POSITION: f64 = 5e-6;
const F32_ORIENTATION: f64 = 1e-5;
const FIXED: f64 = 5e-4;

fn basis<T: Scalar>() -> Basis<T, N> {
    let canonical = CanonicalSystem::new(T::from_f64(ALPHA)).unwrap();
    Basis::new(&canonical, N, T::from_f64(0.7)).unwrap()
}

fn forcing<T: Scalar, const R: usize>(set: &str) -> ForcingTerm<T, R, N> {
    let weights = theta(set).into_iter().flatten().map(|weight| T::from_f64(weight).to_weight());
    let weights = weights.collect::<Option<Vec<T::Weight>>>().unwrap();
    ForcingTerm::new(basis(), &weights).unwrap()
}

fn d3<T: Scalar>(values: [T; 3]) -> [f64; 3] {
    values.map(Scalar::to_f64)
}

fn quaternion<T: Scalar>(row: &Reference<T>) -> [f64; 4] {
    row.poses[0].orientation.quaternion.to_array().map(Scalar::to_f64)
}

#[test]
fn centres_and_widths_are_the_tabulated_ones() {
    let table = Table::load("dmp_basis");
    let basis = basis::<f64>();
    for (i, [c, h]) in table.columns(["c", "h"]).into_iter().enumerate() {
        assert!((basis.centre(i).unwrap() - c).abs() < 1e-14);
        assert!((basis.width(i).unwrap() / h - 1.0).abs() < 1e-12);
    }
    assert_eq!(basis.centre(N), None);
}

/// Largest error of f(s) over the whole grid, and over the six rows beyond the last centre, relative to the peak.
fn forcing_error<T: Scalar>() -> f64 {
    let table = Table::load("dmp_forcing");
    let s = table.column("s");
    assert_eq!(*s.last().unwrap(), 0.0);
    let pairs = [
        ("pos3", table.columns(["f_pos0", "f_pos1", "f_pos2"])),
        ("ori", table.columns(["f_ori0", "f_ori1", "f_ori2"])),
    ];
    let mut largest = 0.0_f64;
    for (set, expected) in pairs {
        let forcing = forcing::<T, 3>(set);
        for (&s, expected) in s.iter().zip(expected) {
            let f = d3(forcing.evaluate(T::from_f64(s)));
            for (f, e) in f.iter().zip(expected) {
                assert!(f.is_finite(), "s = {s}");
                largest = largest.max((f - e).abs());
            }
        }
    }
    largest
}

#[test]
fn forcing_term_is_exact_even_beyond_the_last_centre() {
    let (f64_error, f32_error, fixed_error) =
        (forcing_error::<f64>(), forcing_error::<f32>(), forcing_error::<FixedPoint>());
    println!("f(s): f64 {f64_error:.1e}, f32 {f32_error:.1e}, fixed {fixed_error:.1e}");
    assert!(f64_error < 1e-13);
    assert!(f32_error < 1e-6);
    assert!(fixed_error < 1e-5);
}

#[test]
fn forcing_term_in_fixed_point_matches_f64_for_all_kernels() {
    for (count, alpha, activation) in
        [(100, 4.605, 0.7), (50, 2.3, 0.95), (7, 13.82, 0.5), (100, 6.9, 0.05), (4, 4.605, 0.7), (2, 4.605, 0.7)]
    {
        let canonical = CanonicalSystem::new(alpha).unwrap();
        let fixed_canonical = CanonicalSystem::new(FixedPoint::from_f64(alpha)).unwrap();
        let exact_basis = Basis::<f64, 100>::new(&canonical, count, activation).unwrap();
        let basis = Basis::<_, 100>::new(&fixed_canonical, count, FixedPoint::from_f64(activation)).unwrap();
        // The second set is as large as fixed point keeps, of one sign: what wraps shows.
        for amplitude in [1.0, 127.99] {
            let sign = |i: usize| if amplitude > 1.0 { -1.0 } else { (0.9 * i as f64).sin() };
            let weights: Vec<f64> = (0..4 * count).map(|i| amplitude * sign(i)).collect();
            let exact = ForcingTerm::<f64, 4, 100>::new(exact_basis.clone(), &weights).unwrap();
            let fixed = weights.iter().map(|weight| FixedPoint::from_f64(*weight).to_weight());
            let fixed = fixed.collect::<Option<Vec<i32>>>().unwrap();
            let fixed = ForcingTerm::<FixedPoint, 4, 100>::new(basis.clone(), &fixed).unwrap();
            let mut worst = 0.0_f64;
            for step in 0..1500 {
                let s = canonical.phase_at(f64::from(step) / 1000.0);
                let (wanted, found) = (exact.evaluate(s), fixed.evaluate(FixedPoint::from_f64(s)));
                let errors = wanted.iter().zip(found).map(|(wanted, found)| (found.to_f64() - wanted).abs());
                worst = errors.fold(worst, f64::max);
            }
            println!("f(s), {count} kernels, alpha {alpha}, activation {activation}: {worst:.1e}");
            assert!(worst < 1e-6, "{worst:e}");
        }
    }
    assert!(FixedPoint::from_f64(128.0).to_weight().is_none(), "it would be cut");
}

#[test]
fn forcing_term_has_no_gap_where_f32_would_underflow() {
    // N = 200, s(T) = 0.001: a plain sum is 0/0 in f32 at the end.
    let canonical = CanonicalSystem::new(6.907_755_f32).unwrap();
    let basis = Basis::<f32, 200>::new(&canonical, 200, 0.7).unwrap();
    let forcing = ForcingTerm::<f32, 1, 200>::new(basis, &[1.0; 200]).unwrap();
    for i in 0..=4000 {
        let s = (-6.907_755 * f64::from(i) / 2000.0).exp() as f32;
        let [f] = forcing.evaluate(s);
        assert!((f / s - 1.0).abs() < 1e-5, "s = {s}: f = {f}");
    }
    assert_eq!(forcing.evaluate(0.0), [0.0]);
}

/// One row built from the parts, as a stranger with one joint would do it.
fn single_row<T: Scalar>(
    ticks: usize,
    per_tick: usize,
    mut event: impl FnMut(usize, &mut T, &mut f64),
) -> Vec<[f64; 3]> {
    let canonical = CanonicalSystem::new(T::from_f64(ALPHA)).unwrap();
    let forcing = forcing::<T, 1>("pos1");
    let system = TransformationSystem::critically_damped(T::from_f64(K)).unwrap();
    let mut phase = Phase::START;
    let mut state = PointState::new(T::ZERO, T::ZERO);
    let (mut goal, mut tau) = (T::ONE, 5.0);
    let mut rows = Vec::new();
    for i in 0..ticks * per_tick {
        if i % per_tick == 0 {
            event(i / per_tick, &mut goal, &mut tau);
        }
        let h = T::from_f64(DT / per_tick as f64 / tau);
        let rate = T::from_f64(1.0 / tau);
        let [f] = forcing.evaluate(phase.s());
        let rhs = system.right_hand_side(&state, &PointInput { start: T::ZERO, goal, s: phase.s(), f, zeta: T::ZERO });
        if i % per_tick == 0 {
            rows.push([state.x(), state.v() * rate, rhs * rate * rate].map(Scalar::to_f64));
        }
        state.step(rhs, h);
        phase.step(&canonical, h);
    }
    rows
}

fn check_single_row(name: &str, event: impl Fn(usize, f64) -> (Option<f64>, f64)) {
    let table = Table::load(name);
    let times = table.column("t");
    let e = table.columns(["x_e", "xd_e", "xdd_e"]);
    let x_c: Vec<[f64; 1]> = table.columns(["x_c"]);
    let n = ticks(times);
    fn at<T: Scalar>(n: usize, per_tick: usize, event: &impl Fn(usize, f64) -> (Option<f64>, f64)) -> Vec<[f64; 3]> {
        single_row::<T>(n, per_tick, |tick, goal, tau| {
            let (new_goal, new_tau) = event(tick, *tau);
            if let Some(new) = new_goal {
                *goal = T::from_f64(new);
            }
            *tau = new_tau;
        })
    }
    let rows = at::<f64>(n, 1, &event);
    let halved = at::<f64>(n, 2, &event);
    let single = at::<f32>(n, 1, &event);
    let fixed = at::<FixedPoint>(n, 1, &event);
    let f64_error = largest_difference(times, &e, |k| rows[k]);
    let f32_error = largest_difference(times, &e, |k| single[k]);
    let fixed_error = largest_difference(times, &e, |k| fixed[k]);
    let euler = largest_difference(times, &x_c, |k| [rows[k][0]]);
    let half = largest_difference(times, &x_c, |k| [halved[k][0]]);
    println!(
        "{name}: f64 {f64_error:.1e}, f32 {f32_error:.1e}, fixed {fixed_error:.1e}, \
         integrator {euler:.2e}, halved {half:.2e}"
    );
    assert!(f64_error < F64);
    // The acceleration is as large as K x, so its f32 rounding is larger than that of x.
    let f32_x = largest_difference(times, &table.columns(["x_e"]), |k| [single[k][0]]);
    assert!(f32_x < F32_POSITION, "f32 {f32_x:.1e}");
    assert!(f32_error < 5e-5);
    assert!(fixed_error < FIXED);
    assert!(euler < 1.1e-3);
    assert!((0.45..0.55).contains(&(half / euler)));
}

#[test]
fn one_row_follows_the_nominal_vectors() {
    check_single_row("dmp_pos1_nominal", |_, tau| (None, tau));
}

#[test]
fn one_row_follows_a_goal_change() {
    check_single_row("dmp_pos1_goal", |tick, tau| ((tick == 750).then_some(1.5), tau));
}

#[test]
fn one_row_follows_a_change_of_tau() {
    check_single_row("dmp_pos1_tau", |tick, tau| (None, if tick == 600 { 7.5 } else { tau }));
}

fn position_run<T: Scalar>(ticks: usize, per_tick: usize) -> Vec<[[f64; 3]; 3]> {
    let mut plan = Plan::golden();
    plan.goal.poses[0].orientation = plan.start.poses[0].orientation;
    let primitive = plan.build::<T>();
    let rows = run(&primitive, ticks * per_tick, DT / per_tick as f64, |i, rollout| {
        if i == 750 * per_tick {
            rollout.set_goal_position(0, [0.6, 0.12, 0.09].map(T::from_f64)).unwrap();
        }
        if i == 900 * per_tick {
            rollout.set_duration(&primitive, T::from_f64(6.0)).unwrap();
        }
        Coupling::NONE
    });
    rows.iter()
        .step_by(per_tick)
        .map(|row| [d3(row.poses[0].position.x), d3(row.poses[0].position.v), d3(row.poses[0].position.a)])
        .collect()
}

#[test]
fn position_follows_goal_and_tau_changes_in_every_number_type() {
    let table = Table::load("dmp_pos3");
    let times = table.column("t");
    let x = table.columns(["px_e", "py_e", "pz_e"]);
    let v = table.columns(["vx_e", "vy_e", "vz_e"]);
    let a = table.columns(["ax_e", "ay_e", "az_e"]);
    let c = table.columns(["px_c", "py_c", "pz_c"]);
    let n = ticks(times);
    let errors = |rows: &[[[f64; 3]; 3]]| {
        [
            largest_difference(times, &x, |k| rows[k][0]),
            largest_difference(times, &v, |k| rows[k][1]),
            largest_difference(times, &a, |k| rows[k][2]),
        ]
    };
    let rows = position_run::<f64>(n, 1);
    let (double, single, fixed) =
        (errors(&rows), errors(&position_run::<f32>(n, 1)), errors(&position_run::<FixedPoint>(n, 1)));
    let euler = largest_difference(times, &c, |k| rows[k][0]);
    let halved = position_run::<f64>(n, 2);
    let half = largest_difference(times, &c, |k| halved[k][0]);
    for (name, [x, v, a]) in [("f64", double), ("f32", single), ("fixed", fixed)] {
        println!("dmp_pos3 {name}: x {x:.1e}, v {v:.1e}, a {a:.1e}");
    }
    println!("dmp_pos3: integrator {euler:.2e}, halved {half:.2e}");
    assert!(double.iter().all(|&e| e < F64));
    assert!(single[0] < F32_POSITION && single[1] < 1e-5 && single[2] < 5e-5);
    assert!(fixed.iter().all(|&e| e < FIXED));
    assert!(euler < 3.5e-4);
    assert!((0.45..0.55).contains(&(half / euler)));
}

struct OrientationErrors {
    quaternion: f64,
    omega: f64,
    domega: f64,
    continuous: f64,
}

fn orientation_errors<T: Scalar>(
    name: &str,
    plan: &Plan,
    per_tick: usize,
    new_goal: Option<(usize, [f64; 4])>,
) -> OrientationErrors {
    let table = Table::load(name);
    let times = table.column("t");
    let primitive = plan.build::<T>();
    let rows = run(&primitive, ticks(times) * per_tick, DT / per_tick as f64, |i, rollout| {
        if let Some((tick, goal)) = new_goal
            && i == tick * per_tick
        {
            let [w, x, y, z] = goal.map(T::from_f64);
            let goal = Quaternion::new(w, x, y, z);
            rollout.set_goal_orientation(&primitive, 0, goal).unwrap();
        }
        Coupling::NONE
    });
    let rows: Vec<_> = rows.into_iter().step_by(per_tick).collect();
    OrientationErrors {
        quaternion: largest_difference(times, &table.columns(["qw_e", "qx_e", "qy_e", "qz_e"]), |k| {
            quaternion(&rows[k])
        }),
        omega: largest_difference(times, &table.columns(["wx_e", "wy_e", "wz_e"]), |k| {
            d3(rows[k].poses[0].orientation.omega)
        }),
        domega: largest_difference(times, &table.columns(["dwx_e", "dwy_e", "dwz_e"]), |k| {
            d3(rows[k].poses[0].orientation.domega)
        }),
        continuous: largest_difference(times, &table.columns(["qw_c", "qx_c", "qy_c", "qz_c"]), |k| {
            quaternion(&rows[k])
        }),
    }
}

fn check_orientation(name: &str, plan: &Plan, new_goal: Option<(usize, [f64; 4])>) {
    let double = orientation_errors::<f64>(name, plan, 1, new_goal);
    let half = orientation_errors::<f64>(name, plan, 2, new_goal);
    let single = orientation_errors::<f32>(name, plan, 1, new_goal);
    let fixed = orientation_errors::<FixedPoint>(name, plan, 1, new_goal);
    println!(
        "{name}: f64 {:.1e}, f32 {:.1e}, fixed {:.1e}, integrator {:.2e}, halved {:.2e}",
        double.quaternion, single.quaternion, fixed.quaternion, double.continuous, half.continuous
    );
    assert!(double.quaternion < F64 && double.omega < F64 && double.domega < F64);
    assert!(single.quaternion < F32_ORIENTATION && single.omega < 2e-5);
    assert!(fixed.quaternion < FIXED);
    assert!(double.continuous < 3.5e-4);
    assert!((0.45..0.55).contains(&(half.continuous / double.continuous)));
}

#[test]
fn orientation_follows_the_printed_equations() {
    check_orientation("dmp_quat_body", &Plan::golden(), None);
}

#[test]
fn orientation_goal_on_the_far_hemisphere_is_flipped() {
    let goal = [-0.606_367_852_664_785_4, -0.301_869_840_623_903, -0.735_469_259_635_399_1, -0.016_661_173_660_779_446];
    check_orientation("dmp_quat_body_goal", &Plan::golden(), Some((750, goal)));
}

#[test]
fn antipodal_goal_is_reached_the_short_way() {
    let mut plan = Plan::empty();
    plan.goal.poses[0].orientation = Quaternion::from_rotation_vector(&[0.0, 0.0, 0.5]).negated();
    check_orientation("dmp_quat_antipodal", &plan, None);
}

#[test]
fn world_frame_variant_is_a_different_system() {
    // Negative control: the authors' world-frame variant must not be what we compute.
    let world = orientation_errors::<f64>("dmp_quat_world", &Plan::golden(), 1, None);
    assert!(world.quaternion > 0.01, "{}", world.quaternion);
}

#[derive(Default)]
struct FullErrors {
    position: f64,
    orientation: f64,
    hand: f64,
    rates: f64,
    continuous: f64,
}

fn full_errors<T: Scalar>(
    name: &str,
    plan: &Plan,
    hand_columns: Option<&[&str; 4]>,
    zeta: impl Fn(usize) -> [f64; 10],
) -> FullErrors {
    let table = Table::load(name);
    let times = table.column("t");
    let primitive = plan.build::<T>();
    let rows = run(&primitive, ticks(times), DT, |i, _| {
        let [px, py, pz, rx, ry, rz, hand @ ..] = zeta(i).map(T::from_f64);
        coupling([px, py, pz], [rx, ry, rz], hand)
    });
    let mut errors = FullErrors {
        position: largest_difference(times, &table.columns(["px_e", "py_e", "pz_e"]), |k| {
            d3(rows[k].poses[0].position.x)
        }),
        orientation: largest_difference(times, &table.columns(["qw_e", "qx_e", "qy_e", "qz_e"]), |k| {
            quaternion(&rows[k])
        }),
        continuous: largest_difference(times, &table.columns(["px_c", "py_c", "pz_c"]), |k| {
            d3(rows[k].poses[0].position.x)
        }),
        ..FullErrors::default()
    };
    let rates = [
        largest_difference(times, &table.columns(["vx_e", "vy_e", "vz_e"]), |k| d3(rows[k].poses[0].position.v)),
        largest_difference(times, &table.columns(["ax_e", "ay_e", "az_e"]), |k| d3(rows[k].poses[0].position.a)),
        largest_difference(times, &table.columns(["wx_e", "wy_e", "wz_e"]), |k| d3(rows[k].poses[0].orientation.omega)),
        largest_difference(times, &table.columns(["dwx_e", "dwy_e", "dwz_e"]), |k| {
            d3(rows[k].poses[0].orientation.domega)
        }),
    ];
    errors.rates = rates.into_iter().fold(0.0, f64::max);
    if let Some(&[x, y, z, w]) = hand_columns {
        let hand = |k: usize| std::array::from_fn(|i| rows[k].points.x[7 + i].to_f64());
        let fingers = |values: [T; 11]| std::array::from_fn(|i| values[8 + i].to_f64());
        errors.hand = if x.is_empty() {
            largest_difference(times, &table.columns([y, z, w]), |k| fingers(rows[k].points.x))
        } else {
            largest_difference(times, &table.columns([x, y, z, w]), hand)
        };
        let d =
            largest_difference(times, &table.columns(["f1_d_e", "f2_d_e", "f3_d_e"]), |k| fingers(rows[k].points.v));
        let dd =
            largest_difference(times, &table.columns(["f1_dd_e", "f2_dd_e", "f3_dd_e"]), |k| fingers(rows[k].points.a));
        errors.rates = errors.rates.max(d).max(dd);
    }
    errors
}

fn check_full(name: &str, plan: &Plan, hand: Option<&[&str; 4]>, zeta: impl Fn(usize) -> [f64; 10] + Copy) {
    let double = full_errors::<f64>(name, plan, hand, zeta);
    let single = full_errors::<f32>(name, plan, hand, zeta);
    let fixed = full_errors::<FixedPoint>(name, plan, hand, zeta);
    println!(
        "{name} (position, orientation, hand): f64 {:.1e} {:.1e} {:.1e}, f32 {:.1e} {:.1e} {:.1e}, \
         fixed {:.1e} {:.1e} {:.1e}; integrator {:.2e}",
        double.position,
        double.orientation,
        double.hand,
        single.position,
        single.orientation,
        single.hand,
        fixed.position,
        fixed.orientation,
        fixed.hand,
        double.continuous
    );
    assert!(double.position < F64 && double.orientation < F64);
    assert!(double.hand < F64 && double.rates < F64);
    assert!(single.position < F32_POSITION);
    assert!(single.orientation < F32_ORIENTATION && single.hand < F32_ORIENTATION);
    assert!(fixed.position < FIXED && fixed.orientation < FIXED && fixed.hand < FIXED);
    assert!(double.continuous < 3.5e-4);
}

#[test]
fn whole_primitive_follows_the_uncoupled_vectors() {
    let hand = ["spread_e", "f1_e", "f2_e", "f3_e"];
    check_full("dmp_nocoupling", &Plan::golden(), Some(&hand), |_| [0.0; 10]);
}

#[test]
fn whole_primitive_bends_as_the_coupled_vectors() {
    let force = Table::load("dmp_coupling_force");
    let names = ["z0", "z1", "z2", "z3", "z4", "z5", "z6", "z7", "z8", "z9"];
    let zeta = force.columns(names);
    let hand = ["", "f1_e", "f2_e", "f3_e"];
    check_full("dmp_coupling", &Plan::golden(), Some(&hand), |tick| zeta[tick.min(zeta.len() - 1)]);
}

#[test]
fn constant_feedback_follows_its_vectors() {
    let mut plan = Plan::empty();
    plan.start.poses[0].position = [0.4, -0.1, 0.25];
    plan.goal.poses[0].position = [0.55, 0.2, 0.05];
    let zeta = [10.0, -5.0, 2.0, 20.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    check_full("dmp_coupling_const", &plan, None, |_| zeta);
}
