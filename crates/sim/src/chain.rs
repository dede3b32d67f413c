//! The WAM's kinematic chain: standard Denavit-Hartenberg frames, `T(j-1 -> j) = Rz(q) Tz(d) Tx(a) Rx(alpha)`.
//!
//! Numbers: `crates/control/model/wam7.toml` (from Barrett's published configuration). They are written down again here
//! because the simulator may not depend on `control`: a wrong number there must not cancel itself out in a test here.
//! Sines come from `libm`, so that every platform computes the same bits.

use crate::rotation::from_matrix;
use std::f64::consts::{FRAC_PI_2, PI};

/// A vector, m or N or N m.
pub(crate) type Vector = [f64; 3];

/// Twist alpha (rad), length a (m), offset d (m) of each joint.
const PARAMETERS: [[f64; 3]; 7] = [
    [-FRAC_PI_2, 0.0, 0.0],
    [FRAC_PI_2, 0.0, 0.0],
    [-FRAC_PI_2, 0.045, 0.55],
    [FRAC_PI_2, -0.045, 0.0],
    [-FRAC_PI_2, 0.0, 0.3],
    [FRAC_PI_2, 0.0, 0.0],
    [0.0, 0.0, 0.0609],
];

/// Barrett's grasp point: beyond the tool plate (m), turned about z (rad).
const GRASP_OFFSET: f64 = 0.132;
const GRASP_YAW: f64 = PI;

/// A coordinate frame in the world: columns of `axes` are its x, y and z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Frame {
    pub(crate) origin: Vector,
    pub(crate) axes: [Vector; 3],
}

impl Frame {
    const WORLD: Frame = Frame { origin: [0.0; 3], axes: [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]] };

    /// Turns a vector of this frame into world axes.
    pub(crate) fn turn(&self, vector: Vector) -> Vector {
        let [x, y, z] = self.axes;
        std::array::from_fn(|row| x[row] * vector[0] + y[row] * vector[1] + z[row] * vector[2])
    }

    /// A world vector in this frame's axes.
    pub(crate) fn turn_back(&self, vector: Vector) -> Vector {
        self.axes.map(|axis| dot(axis, vector))
    }

    /// A point of this frame in the world.
    pub(crate) fn point(&self, point: Vector) -> Vector {
        add(self.origin, self.turn(point))
    }

    /// The unit quaternion (w, x, y, z) of the turn from this frame to the world.
    pub(crate) fn quaternion(&self) -> [f64; 4] {
        let [x, y, z] = self.axes;
        from_matrix(&[x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]])
    }

    fn next(&self, q: f64, [alpha, a, d]: [f64; 3]) -> Frame {
        let (sin_q, cos_q) = libm::sincos(q);
        let (sin_alpha, cos_alpha) = libm::sincos(alpha);
        Frame {
            origin: self.point([a * cos_q, a * sin_q, d]),
            axes: [
                self.turn([cos_q, sin_q, 0.0]),
                self.turn([-sin_q * cos_alpha, cos_q * cos_alpha, sin_alpha]),
                self.turn([sin_q * sin_alpha, -cos_q * sin_alpha, cos_alpha]),
            ],
        }
    }
}

/// Frames 0 (world) to 7 (tool plate) at joint angles `q`, rad. Joint j turns about z of frame j-1.
pub(crate) fn frames(q: &[f64; 7]) -> [Frame; 8] {
    let mut frames = [Frame::WORLD; 8];
    for (joint, (angle, parameters)) in q.iter().zip(PARAMETERS).enumerate() {
        frames[joint + 1] = frames[joint].next(*angle, parameters);
    }
    frames
}

/// The grasp frame, given the tool plate's.
pub(crate) fn grasp_frame(plate: &Frame) -> Frame {
    plate.next(GRASP_YAW, [0.0, 0.0, GRASP_OFFSET])
}

pub(crate) fn add(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|row| a[row] + b[row])
}

pub(crate) fn subtract(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|row| a[row] - b[row])
}

pub(crate) fn dot(a: Vector, b: Vector) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rotation::norm;

    /// Columns k, q1..7, qd1..7, qdd1..7, px, py, pz, qw, qx, qy, qz of the golden vectors.
    #[test]
    fn grasp_frame_agrees_with_the_golden_kinematics() {
        let text = include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/vectors/dyn_wam7_bh280_ft.csv"));
        let mut rows = 0;
        for line in text.lines().filter(|line| !line.starts_with('#')).skip(1) {
            let values: Vec<f64> = line.split(',').map(|value| value.parse().unwrap()).collect();
            let q: [f64; 7] = values[1..8].try_into().unwrap();
            let grasp = grasp_frame(&frames(&q)[7]);
            assert!(norm(subtract(grasp.origin, values[22..25].try_into().unwrap())) < 1e-10);
            let aligned: f64 = grasp.quaternion().iter().zip(&values[25..29]).map(|(a, b)| a * b).sum();
            assert!((aligned.abs() - 1.0).abs() < 1e-10, "row {}", values[0]);
            rows += 1;
        }
        assert_eq!(rows, 100);
    }
}
