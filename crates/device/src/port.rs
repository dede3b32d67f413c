//! Primitives on their way from the session to the control half.

use control::plan::primitive::Primitive;

/// A primitive as the control half holds it.
pub type StoredPrimitive = Primitive<f32, { control::MAX_KERNELS }>;

/// One that has been checked against an arm.
pub type CheckedPrimitive<'a> = control::CheckedPrimitive<'a, f32, { control::MAX_KERNELS }>;
