//! Host and device of Tactus: framing, messages and the primitive image.
#![no_std]
#![forbid(unsafe_code)]
