//! The ways in which compiled Rust gives up, by the function it calls then.

use std::fmt;

/// Why a program panics.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Kind {
    /// An index or a range outside a slice or a string.
    Index,
    /// Two slices of different lengths where equal ones are needed.
    Length,
    /// `unwrap` or `expect` of nothing.
    Unwrap,
    /// A `RefCell` that is in use.
    Borrow,
    /// Division by zero.
    Division,
    /// An integer that does not fit.
    Overflow,
    /// A finished `async` function is asked again.
    Resumed,
    /// An assertion, `panic!` or `unreachable!`.
    Message,
    /// The instruction nobody may execute.
    Abort,
}

impl Kind {
    /// Why one calls the function of this name; `None` if it is no function for giving up.
    pub(crate) fn of(function: &str) -> Option<Self> {
        if function.starts_with("defmt::export::panic") || function.contains("defmt_panic") {
            return Some(Self::Message);
        }
        let function = plain(function);
        let last = function.rsplit("::").next().unwrap_or_default();
        if !function.starts_with("core::") && !function.starts_with("<core::") {
            // The panic handler itself, called without the functions of `core`.
            return (last == "rust_begin_unwind").then_some(Self::Message);
        }
        if function.starts_with("core::cell::panic_") {
            return Some(Self::Borrow);
        }
        if last.contains("len_mismatch_fail") {
            return Some(Self::Length);
        }
        if matches!(last, "unwrap_failed" | "expect_failed") {
            return Some(Self::Unwrap);
        }
        if last == "panic_bounds_check" || last.starts_with("slice_") && last.contains("_fail") {
            return Some(Self::Index);
        }
        if !function.starts_with("core::panicking::") {
            return last.ends_with("_fail").then_some(Self::Message);
        }
        Some(match last {
            _ if last.ends_with("by_zero") => Self::Division,
            _ if last.ends_with("overflow") => Self::Overflow,
            _ if last.contains("_resumed") => Self::Resumed,
            _ => Self::Message,
        })
    }
}

/// A path without the type parameters at its end, and of what panic functions of `core` have inside only the outside.
fn plain(function: &str) -> &str {
    let function = function.split("::do_panic").next().unwrap_or_default();
    function.split("::<").next().unwrap_or_default()
}

impl fmt::Display for Kind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Index => "index",
            Self::Length => "length",
            Self::Unwrap => "unwrap",
            Self::Borrow => "borrow",
            Self::Division => "division",
            Self::Overflow => "overflow",
            Self::Resumed => "resumed",
            Self::Message => "message",
            Self::Abort => "abort",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::Kind;

    #[test]
    fn the_functions_of_core_that_give_up_are_known() {
        for (function, kind) in [
            ("core::panicking::panic_bounds_check", Kind::Index),
            ("core::slice::index::slice_index_fail", Kind::Index),
            ("core::slice::index::slice_end_index_len_fail", Kind::Index),
            ("core::slice::index::slice_index_fail::do_panic::runtime", Kind::Index),
            ("core::str::slice_error_fail", Kind::Index),
            ("core::slice::copy_from_slice_impl::len_mismatch_fail::do_panic::runtime", Kind::Length),
            ("core::slice::copy_from_slice_impl::len_mismatch_fail", Kind::Length),
            ("core::option::unwrap_failed", Kind::Unwrap),
            ("core::option::expect_failed", Kind::Unwrap),
            ("core::result::unwrap_failed", Kind::Unwrap),
            ("core::cell::panic_already_borrowed", Kind::Borrow),
            ("core::panicking::panic_const::panic_const_rem_by_zero", Kind::Division),
            ("core::panicking::panic_const::panic_const_neg_overflow", Kind::Overflow),
            ("core::panicking::panic_const::panic_const_async_fn_resumed", Kind::Resumed),
            ("core::panicking::panic_fmt", Kind::Message),
            ("core::panicking::assert_failed::<u64, u64>", Kind::Message),
            ("defmt::export::panic", Kind::Message),
        ] {
            assert_eq!(Kind::of(function), Some(kind), "{function}");
        }
    }

    #[test]
    fn other_functions_do_not_give_up() {
        for function in [
            "core::fmt::write",
            "<core::panicking::AssertKind as core::fmt::Debug>::fmt",
            "core::option::Option<T>::map",
            "link::frame::Decoder<_>::next",
            "device::startup::fail",
            "memcpy",
        ] {
            assert_eq!(Kind::of(function), None, "{function}");
        }
    }
}
