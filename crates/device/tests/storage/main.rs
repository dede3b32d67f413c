//! The library on a simulated flash: what survives a power failure at every single operation, and what is refused.

mod bench;
mod cuts;
mod flipped;
mod lost;
mod refusals;
mod without_journal;
