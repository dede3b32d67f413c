//! The arm image.
#![no_std]
