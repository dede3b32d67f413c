//! The codecs against the golden vectors: what the manufacturer's library sends and accepts.

mod arm;
mod frames;
mod hand;
mod properties;
mod states;
mod transcripts;
mod vectors;
