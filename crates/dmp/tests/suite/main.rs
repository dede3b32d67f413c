//! Tests of the library from outside, as one program: golden vectors, sign-catching checks, learning, robustness.

mod common;
mod fit;
mod golden;
mod robustness;
mod signs;
