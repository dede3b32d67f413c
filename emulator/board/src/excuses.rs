//! Accesses that no model answers and that do no harm, each with the reason.

/// An excused register: instance, register (empty: all of them), whether writes are excused too, reason.
const REGISTERS: [(&str, &str, bool, &str); 1] = [(
    "AXI",
    "AXI_TARG7_FN_MOD",
    true,
    "one read at a time from the AXI memory, which the maker asks for before revision V; contention is not modelled",
)];

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

/// Why a write that the chip ignores, made by `function`, is no failure.
#[must_use]
pub fn told(register: &str, function: &str) -> Option<&'static str> {
    // Where the compiler puts that start, in line or not.
    let places = ["embassy_stm32", "__rtic_init_resources", "SelectedBoard as firmware::board::Board>::start"];
    let is_start = places.iter().any(|place| function.contains(place));
    (register == "RCC.PLLCKSELR" && is_start).then_some(
        "embassy-stm32 0.6.0 clears the divider of each loop that the configuration leaves out; the fields of \
         the loop that runs are protected meanwhile, and keep what it wrote before",
    )
}
