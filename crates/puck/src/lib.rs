//! Barrett's CAN protocol for the WAM arm: codecs over embedded_can::Frame, no I/O.
#![no_std]
#![forbid(unsafe_code)]
