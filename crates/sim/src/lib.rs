//! The other side of the WAM's bus, simulated.
