//! Tests of the library from outside, as one program: golden vectors, sign-catching checks, learning, robustness.

mod arm;
mod bounds;
mod common;
mod fit;
mod golden;
mod groups;
mod hostile;
mod kernels;
mod memory;
mod mistakes;
mod robustness;
mod signs;
#[cfg(feature = "serde")]
mod stored;
mod whole;
