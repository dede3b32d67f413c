//! Tests of the link in one binary, because they share their samples.

mod codes;
mod framing;
mod golden;
mod image;
mod metadata;
mod names;
mod samples;
mod segments;
