//! The BarrettHand: what its pucks tell, Eq (14), the limits of its drives, and where it is to go.
//!
//! Digits are in the order of a primitive's hand rows, **spread, F1, F2, F3**, angles are those of the inner links
//! (rad); the pucks count F1, F2, F3, spread. Gauges are the torque of the **environment on the finger** about its
//! outer joint (N m): negative when the finger closes on an object. The worms of the fingers cannot be driven back,
//! friction holds the spread: without torque the hand keeps its posture, and so the answer to every doubt is no torque.

/// Digits of the hand: spread, F1, F2, F3.
pub const DIGITS: usize = 4;

/// Fingers, each with a strain gauge.
pub const FINGERS: usize = 3;

/// Torque at the spread or at an inner link over what its motor would give through the gears without loss, nominal:
/// spur gears at the spread, worms in the fingers.
pub const EFFICIENCY: [f64; DIGITS] = [1.0, 0.1, 0.1, 0.1];

/// From the pucks' order (F1, F2, F3, spread) to that of the primitives (spread, F1, F2, F3).
pub(crate) fn from_pucks<T>([f1, f2, f3, spread]: [T; DIGITS]) -> [T; DIGITS] {
    [spread, f1, f2, f3]
}

/// From the primitives' order to that of the pucks.
pub(crate) fn to_pucks<T>([spread, f1, f2, f3]: [T; DIGITS]) -> [T; DIGITS] {
    [f1, f2, f3, spread]
}

/// True if every digit lies within its range. False for a NaN.
pub(crate) fn within_range(q: &[f32; DIGITS]) -> bool {
    q.iter().zip(ranges()).all(|(q, [min, max])| f64::from(*q) >= min && f64::from(*q) <= max)
}

/// Ranges of the digits (rad).
pub(crate) fn ranges() -> [[f64; 2]; DIGITS] {
    use crate::model::wam7::{FINGER_RANGE, SPREAD_RANGE};
    [SPREAD_RANGE, FINGER_RANGE, FINGER_RANGE, FINGER_RANGE]
}
