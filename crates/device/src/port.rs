//! Primitives on their way from the session to the control half.

use control::CheckedPrimitive;
use control::plan::primitive::Primitive;

/// A primitive as the control half holds it.
pub type StoredPrimitive = Primitive<f32, { control::MAX_KERNELS }>;

/// One that has been checked against an arm.
pub type FitPrimitive<'a> = CheckedPrimitive<'a, f32, { control::MAX_KERNELS }>;
