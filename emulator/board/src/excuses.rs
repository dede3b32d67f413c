//! Accesses that no model answers and that do no harm, each with the reason.

/// An excused register: instance, register (empty: all of them), whether writes are excused too, reason.
const REGISTERS: [(&str, &str, bool, &str); 0] = [];

/// Why an access to a register without a model is no failure.
#[must_use]
pub fn register(instance: &str, register: &str, written: bool) -> Option<&'static str> {
    REGISTERS
        .iter()
        .find(|(name, part, writes, _)| {
            *name == instance && (part.is_empty() || *part == register) && (*writes || !written)
        })
        .map(|(_, _, _, reason)| *reason)
}

/// Why an access to an address without a register is no failure.
#[must_use]
pub fn address(_address: u64) -> Option<&'static str> {
    None
}

/// Why something the chip's models told is no failure.
#[must_use]
pub fn told(_instance: &str, _reason: &str) -> Option<&'static str> {
    None
}
