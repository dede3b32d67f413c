//! The co-controller without its hardware: bus start-up, bus rounds, link session, primitive store.
#![no_std]
#![forbid(unsafe_code)]
