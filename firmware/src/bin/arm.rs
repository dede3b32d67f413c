//! The arm image.
#![no_std]
#![no_main]
