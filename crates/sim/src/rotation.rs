//! The little rotation algebra that the teacher and the worlds share.
//!
//! Hamilton quaternions `[w, x, y, z]` that turn body vectors into world vectors; rotation vectors in rad.

/// Hamilton product `a b`: first `b`, then `a`, as rotations of a vector.
pub(crate) fn multiply(a: [f64; 4], b: [f64; 4]) -> [f64; 4] {
    [
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    ]
}

/// Inverse of a unit quaternion.
pub(crate) fn conjugate(q: [f64; 4]) -> [f64; 4] {
    [q[0], -q[1], -q[2], -q[3]]
}

/// Quaternion of a rotation vector (angle times axis).
pub(crate) fn exponential(v: [f64; 3]) -> [f64; 4] {
    let angle = norm(v);
    // sin(x/2)/x tends to 1/2; the switch keeps 0/0 out.
    let scale = if angle < 1e-12 { 0.5 } else { (0.5 * angle).sin() / angle };
    [(0.5 * angle).cos(), scale * v[0], scale * v[1], scale * v[2]]
}

/// Rotation vector of a unit quaternion, the short way round: |v| <= pi.
pub(crate) fn logarithm(q: [f64; 4]) -> [f64; 3] {
    let sign = if q[0] < 0.0 { -1.0 } else { 1.0 };
    let vector = [sign * q[1], sign * q[2], sign * q[3]];
    let sine = norm(vector);
    let scale = if sine < 1e-12 { 2.0 } else { 2.0 * sine.atan2(sign * q[0]) / sine };
    [scale * vector[0], scale * vector[1], scale * vector[2]]
}

/// Quaternion of a rotation matrix, rows first (Shepperd's branch on the largest component, so that no root is small).
pub(crate) fn from_matrix(m: &[f64; 9]) -> [f64; 4] {
    let trace = m[0] + m[4] + m[8];
    let squares = [trace, m[0], m[4], m[8]];
    let largest = (1..4).fold(0, |best, i| if squares[i] > squares[best] { i } else { best });
    // 4 w^2 = 1 + trace and 4 x_i^2 = 1 + 2 m_ii - trace.
    let twice = if largest == 0 { 1.0 + trace } else { 1.0 + 2.0 * squares[largest] - trace };
    let twice = twice.max(0.0).sqrt();
    let (half, rest) = (0.5 * twice, 0.5 / twice);
    match largest {
        0 => [half, (m[7] - m[5]) * rest, (m[2] - m[6]) * rest, (m[3] - m[1]) * rest],
        1 => [(m[7] - m[5]) * rest, half, (m[1] + m[3]) * rest, (m[2] + m[6]) * rest],
        2 => [(m[2] - m[6]) * rest, (m[1] + m[3]) * rest, half, (m[5] + m[7]) * rest],
        _ => [(m[3] - m[1]) * rest, (m[2] + m[6]) * rest, (m[5] + m[7]) * rest, half],
    }
}

/// The rotation vector in world axes that turns the orientation `from` into `to`.
pub(crate) fn difference(to: [f64; 4], from: [f64; 4]) -> [f64; 3] {
    logarithm(multiply(to, conjugate(from)))
}

/// Length of a vector.
pub(crate) fn norm(v: [f64; 3]) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

/// The vector, shortened to `limit` if it is longer.
pub(crate) fn shortened(v: [f64; 3], limit: f64) -> [f64; 3] {
    let length = norm(v);
    if length > limit { v.map(|x| x * limit / length) } else { v }
}

/// Element by element: `a + scale b`.
pub(crate) fn add_scaled(a: [f64; 3], scale: f64, b: [f64; 3]) -> [f64; 3] {
    [a[0] + scale * b[0], a[1] + scale * b[1], a[2] + scale * b[2]]
}

/// Vector product.
pub(crate) fn cross(a: [f64; 3], b: [f64; 3]) -> [f64; 3] {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn logarithm_inverts_the_exponential_on_both_hemispheres() {
        for v in [[0.3, -0.7, 1.1], [0.0, 0.0, 0.0], [1e-14, 0.0, 0.0], [0.0, 3.1, 0.1]] {
            let q = exponential(v);
            for sign in [1.0, -1.0] {
                let back = logarithm(q.map(|x| sign * x));
                assert!(norm(add_scaled(back, -1.0, v)) < 1e-12, "{v:?} came back as {back:?}");
            }
        }
    }

    #[test]
    fn difference_is_expressed_in_world_axes() {
        // A hand lying on its side turns about the world's vertical: the vector must show z, not the hand's own axis.
        let from = exponential([std::f64::consts::FRAC_PI_2, 0.0, 0.0]);
        let to = multiply(exponential([0.0, 0.0, 0.4]), from);
        assert!(norm(add_scaled(difference(to, from), -1.0, [0.0, 0.0, 0.4])) < 1e-12);
    }

    #[cfg(feature = "mujoco")]
    #[test]
    fn a_matrix_becomes_its_quaternion_whichever_component_is_largest() {
        for v in [[0.1, 0.2, 0.3], [3.0, 0.2, 0.1], [0.2, 3.0, -0.1], [-0.2, 0.1, 3.0]] {
            let [w, x, y, z] = exponential(v);
            let m = [
                1.0 - 2.0 * (y * y + z * z),
                2.0 * (x * y - w * z),
                2.0 * (x * z + w * y),
                2.0 * (x * y + w * z),
                1.0 - 2.0 * (x * x + z * z),
                2.0 * (y * z - w * x),
                2.0 * (x * z - w * y),
                2.0 * (y * z + w * x),
                1.0 - 2.0 * (x * x + y * y),
            ];
            let q = from_matrix(&m);
            assert!(norm(difference(q, [w, x, y, z])) < 1e-12, "{v:?}");
        }
    }
}
