//! Dynamic movement primitives that feel: no_std, no allocation, f32, f64 or fixed point.
#![no_std]
#![forbid(unsafe_code)]
