//! Host side of Tactus.
