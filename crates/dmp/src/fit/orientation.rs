//! Orientation demonstrations: sign continuity, body-frame angular velocity, angle to the goal.

use std::vec::Vec;

use crate::Quaternion;

/// Gives every quaternion the sign nearest to the one before: `q` and `-q` are the same orientation, but a jump between
/// them would look like a full turn.
pub fn make_sign_continuous(orientation: &mut [Quaternion<f64>]) {
    let mut previous: Option<Quaternion<f64>> = None;
    for q in orientation {
        if let Some(previous) = previous {
            *q = q.aligned_with(&previous);
        }
        previous = Some(*q);
    }
}

/// Body-frame angular velocity, rad/s, of sign-continuous samples `period` seconds apart.
///
/// Inside: `(8 log(conj(q_-1) q_1) - log(conj(q_-2) q_2)) / (12 dt)` with `log` the rotation vector (fourth order; both
/// terms are odd in dt). Next to the ends `log(conj(q_-1) q_1)/(2 dt)`, at the ends extrapolated.
pub fn angular_velocity(orientation: &[Quaternion<f64>], period: f64) -> Vec<[f64; 3]> {
    let n = orientation.len();
    let mut omega = std::vec![[0.0; 3]; n];
    if n < 5 {
        return omega;
    }
    let between = |a: usize, b: usize| orientation[a].conjugate().product(&orientation[b]).rotation_vector();
    for (k, omega) in omega.iter_mut().enumerate().take(n - 1).skip(1) {
        let near = between(k - 1, k + 1);
        *omega = if k >= 2 && k + 2 < n {
            let far = between(k - 2, k + 2);
            core::array::from_fn(|i| (8.0 * near[i] - far[i]) / (12.0 * period))
        } else {
            near.map(|r| r / (2.0 * period))
        };
    }
    let extrapolate = |a: [f64; 3], b: [f64; 3], c: [f64; 3]| -> [f64; 3] {
        core::array::from_fn(|i| 3.0 * a[i] - 3.0 * b[i] + c[i])
    };
    omega[0] = extrapolate(omega[1], omega[2], omega[3]);
    omega[n - 1] = extrapolate(omega[n - 2], omega[n - 3], omega[n - 4]);
    omega
}

/// Largest angle (rad) between a sign-continuous path and its end.
///
/// Followed continuously from the end backwards, so that it goes on counting beyond a full turn, where the angle read
/// from a single quaternion would come down again.
pub fn largest_angle_to_goal(orientation: &[Quaternion<f64>]) -> f64 {
    let Some(goal) = orientation.last() else {
        return 0.0;
    };
    let turn = 2.0 * core::f64::consts::PI;
    let (mut largest, mut previous, mut axis) = (0.0_f64, 0.0_f64, [0.0; 3]);
    for q in orientation.iter().rev() {
        let r = goal.conjugate().product(q).rotation_vector();
        let angle = libm::sqrt(r.iter().map(|r| r * r).sum());
        // Passing through a full turn flips the axis and folds the angle: 2 pi + d is read as 2 pi - d.
        let folded = axis.iter().zip(&r).map(|(a, r)| a * r).sum::<f64>() < 0.0 && previous > 0.75 * turn;
        let continued = if folded { 2.0 * turn - angle } else { angle };
        if !folded {
            axis = r;
        }
        previous = continued;
        largest = largest.max(continued);
    }
    largest
}
