//! Common parts of the tests: golden tables, primitives in any number type, rollouts that collect rows.

use std::collections::HashMap;

use crate::arm::{
    Configuration, Coupling, ORIGIN, Primitive, ROWS, Reference, Rollout, StartState, Tables, Velocity, gains,
};
use dmp::{Hemisphere, OrientationError, Quaternion, Scalar};

/// Control period of the golden vectors, s.
pub(crate) const DT: f64 = 1.0 / 300.0;
/// Kernels of the golden vectors.
pub(crate) const N: usize = 50;
/// Stiffness of the golden vectors.
pub(crate) const K: f64 = 200.0;
/// Decay of the golden vectors.
pub(crate) const ALPHA: f64 = 4.605_170_185_988_091;

/// A golden table, column by column.
pub(crate) struct Table {
    columns: HashMap<String, Vec<f64>>,
}

impl Table {
    /// Reads `tests/vectors/<name>.csv`; empty fields become NaN, words too.
    pub(crate) fn load(name: &str) -> Self {
        let path = format!(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vectors/{}.csv"), name);
        let mut reader = csv::ReaderBuilder::new()
            .comment(Some(b'#'))
            .from_path(&path)
            .unwrap_or_else(|error| panic!("{path}: {error}"));
        let header: Vec<String> = reader.headers().unwrap().iter().map(str::to_owned).collect();
        let mut columns: HashMap<String, Vec<f64>> = header.iter().map(|name| (name.clone(), Vec::new())).collect();
        for record in reader.records() {
            for (name, field) in header.iter().zip(&record.unwrap()) {
                let value = field.parse().unwrap_or(f64::NAN);
                columns.get_mut(name).unwrap().push(value);
            }
        }
        Self { columns }
    }

    /// One column.
    pub(crate) fn column(&self, name: &str) -> &[f64] {
        self.columns.get(name).unwrap_or_else(|| panic!("no column {name}"))
    }

    /// Several columns side by side.
    pub(crate) fn columns<const D: usize>(&self, names: [&str; D]) -> Vec<[f64; D]> {
        let columns = names.map(|name| self.column(name));
        (0..columns[0].len()).map(|row| columns.map(|column| column[row])).collect()
    }
}

/// Weights of one set of `dmp_theta.csv`, row by row.
pub(crate) fn theta(set: &str) -> Vec<Vec<f64>> {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/vectors/dmp_theta.csv");
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).unwrap();
    let rows: Vec<Vec<f64>> = reader
        .records()
        .map(Result::unwrap)
        .filter(|record| &record[0] == set)
        .map(|record| record.iter().skip(2).map(|x| x.parse().unwrap()).collect())
        .collect();
    assert!(!rows.is_empty(), "no theta set {set}");
    rows
}

/// Everything about a primitive, in f64, to be built in any number type.
#[derive(Clone)]
pub(crate) struct Plan {
    pub(crate) duration: f64,
    pub(crate) count: usize,
    pub(crate) weights: Vec<f64>,
    pub(crate) orientation_error: OrientationError,
    pub(crate) hemisphere: Hemisphere,
    pub(crate) start: Configuration<f64>,
    pub(crate) goal: Configuration<f64>,
    pub(crate) start_velocity: Velocity<f64>,
    pub(crate) stiffness: f64,
}

impl Plan {
    /// Unforced, from the origin to the origin in 5 s.
    pub(crate) fn empty() -> Self {
        Self {
            duration: 5.0,
            count: N,
            weights: vec![0.0; ROWS * N],
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Nearest,
            start: ORIGIN,
            goal: ORIGIN,
            start_velocity: Velocity::ZERO,
            stiffness: K,
        }
    }

    /// The movement of `dmp_nocoupling.csv` and its relatives.
    pub(crate) fn golden() -> Self {
        let mut plan = Self::empty();
        plan.start.poses[0].position = [0.4, -0.1, 0.25];
        plan.goal.poses[0].position = [0.55, 0.2, 0.05];
        plan.goal.points[7..].copy_from_slice(&[0.3, 2.1, 2.1, 2.1]);
        plan.start.poses[0].orientation = Quaternion::new(
            0.952_874_852_886_029_6,
            0.147_636_255_766_526_28,
            -0.098_424_170_511_017_53,
            0.246_060_426_277_543_8,
        );
        plan.goal.poses[0].orientation = Quaternion::new(
            0.735_556_974_165_655_5,
            0.398_362_610_102_983_3,
            0.547_780_779_185_993_2,
            -0.014_120_431_388_242_913,
        );
        plan.set_rows(0, &theta("pos3"));
        plan.set_rows(3, &theta("ori"));
        plan.set_rows(13, &theta("fing"));
        plan
    }

    /// Puts weights into the rows from `first` on.
    pub(crate) fn set_rows(&mut self, first: usize, rows: &[Vec<f64>]) {
        for (i, row) in rows.iter().enumerate() {
            let at = (first + i) * self.count;
            self.weights[at..at + self.count].copy_from_slice(row);
        }
    }

    /// The primitive in the number type `T` with critically damped rows.
    pub(crate) fn build<T: Scalar>(&self) -> Primitive<T, 100> {
        let weights =
            self.weights.iter().map(|&w| T::from_f64(w).to_weight()).collect::<Option<Vec<T::Weight>>>().unwrap();
        let damping = 2.0 * self.stiffness.sqrt();
        let damping_o = self.orientation_error.critical_damping(self.stiffness);
        Primitive::new(&Tables {
            control_period: T::from_f64(DT),
            duration: T::from_f64(self.duration),
            alpha: T::from_f64(ALPHA),
            activation: T::from_f64(0.7),
            kernel_count: self.count,
            weights: &weights,
            gains: gains([self.stiffness; 4], [damping, damping_o, damping, damping]).cast(),
            orientation_error: self.orientation_error,
            hemisphere: self.hemisphere,
            start: self.start.cast(),
            goal: self.goal.cast(),
            start_velocity: self.start_velocity.cast(),
        })
        .unwrap()
    }
}

/// Runs `ticks` ticks from the demonstrated start; `before` may change the run before a tick and gives the feedback.
pub(crate) fn run<T: Scalar>(
    primitive: &Primitive<T, 100>,
    ticks: usize,
    dt: f64,
    mut before: impl FnMut(usize, &mut Rollout<T, 100>) -> Coupling<T>,
) -> Vec<Reference<T>> {
    let mut rollout = Rollout::start(primitive, &StartState::demonstrated(primitive)).unwrap();
    rollout.set_speed_slew(None).unwrap();
    (0..ticks)
        .map(|tick| {
            let coupling = before(tick, &mut rollout);
            rollout.step(primitive, T::from_f64(dt), &coupling).unwrap()
        })
        .collect()
}

/// Largest difference between rows of a run and the rows of a (thinned) table.
pub(crate) fn largest_difference<const D: usize>(
    times: &[f64],
    expected: &[[f64; D]],
    actual: impl Fn(usize) -> [f64; D],
) -> f64 {
    assert_eq!(times.len(), expected.len());
    let mut largest = 0.0_f64;
    for (t, expected) in times.iter().zip(expected) {
        let tick = (t * 300.0).round() as usize;
        for (a, e) in actual(tick).iter().zip(expected) {
            let difference = (a - e).abs();
            assert!(difference.is_finite(), "t = {t}: {a} against {e}");
            largest = largest.max(difference);
        }
    }
    largest
}

/// Number of ticks a table spans.
pub(crate) fn ticks(times: &[f64]) -> usize {
    (times.last().unwrap() * 300.0).round() as usize + 1
}
