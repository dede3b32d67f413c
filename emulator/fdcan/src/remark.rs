//! A remark: something a program did that the controller ignored, or that deserves a look.

use crate::Nanoseconds;
use crate::unit::Unit;
use std::fmt;

/// The kind of a remark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RemarkKind {
    /// The silicon ignores this write.
    Ignored,
    /// The silicon has this, the model has not.
    Unmodelled,
    /// The manual advises against this, or does not say what follows.
    Suspicious,
    /// A word of the message memory was used that nobody has written since power-up.
    Unwritten,
    /// A read of the message memory returned a wrong word (ES0392 2.24.2).
    Erratum,
    /// A frame went by that the controller could not receive because it had not joined the bus.
    Lost,
}

/// A remark.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Remark {
    /// When.
    pub at: Nanoseconds,
    /// The kind.
    pub kind: RemarkKind,
    /// Which controller; `None` for the message memory.
    pub unit: Option<Unit>,
    /// Name of the register, or `RAM`.
    pub register: &'static str,
    /// Byte offset of the register in its controller, or of the word in the message memory.
    pub offset: u32,
    /// The value written or read.
    pub value: u32,
    /// Description.
    pub text: &'static str,
}

impl fmt::Display for Remark {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self.unit.map_or("FDCANRAM", Unit::name);
        let Self { at, kind, register, offset, value, text, .. } = self;
        write!(f, "{kind:?} at {at} ns: {unit}.{register} (+{offset:#05x}) {value:#010x}: {text}")
    }
}
