//! Functions that are called through pointers: which can be, and by whom.

use std::collections::BTreeSet;

use super::memory::Memory;
use super::step::{self, Source};
use crate::code::Code;

/// Functions that are called through pointers of one kind, by names.
pub(super) struct Kind {
    /// Name for people.
    pub(super) name: &'static str,
    /// A function is of this kind if its name contains one of these.
    functions: &'static [&'static str],
    /// A function calls only this kind, and others that list it too, through pointers, if its name contains one of these.
    callers: &'static [&'static str],
    /// How many calls of this kind may be inside one another; `None` if they never are: that is checked.
    pub(super) nested: Option<usize>,
    /// Why that is so.
    pub(super) why: &'static str,
}

/// Kinds of functions behind pointers. A call by a function that no row lists may lead to any function whose address is
/// taken, of whatever kind.
pub(super) const KINDS: [Kind; 5] = [
    Kind {
        name: "a value's text",
        functions: &[" as core::fmt::Debug>::fmt", " as core::fmt::Display>::fmt", " as core::fmt::LowerHex>::fmt"],
        callers: &[
            "core::fmt::write",
            "core::fmt::builders::Debug",
            "<core::fmt::Formatter>::debug_",
            "<&T as core::fmt::D",
            "<&dyn core::fmt::Debug as core::fmt::Debug>::fmt",
            "core::panic::panic_info",
        ],
        nested: Some(6),
        why: "the last words hold the panic's information, that its message, that an argument, that a value, that its field",
    },
    Kind {
        name: "a text's receiver",
        functions: &["core::fmt::Write>::write_str", "core::fmt::Write>::write_char", "core::fmt::Write::write_char"],
        callers: &["core::fmt::", "core::panic::panic_info"],
        nested: Some(2),
        why: "one that writes to another is the one for many lines (`{:#?}`), which nothing asks for",
    },
    Kind {
        name: "a text's receiver, whole formats",
        functions: &["core::fmt::Write>::write_fmt", "core::fmt::Write::write_fmt"],
        callers: &[],
        nested: None,
        why: "in the tables of the receivers, but a formatter calls `core::fmt::write` itself",
    },
    Kind {
        name: "a class of the USB device",
        functions: &["usb_device::class::UsbClass"],
        callers: &["usb_device::"],
        nested: None,
        why: "the device polls its classes, they call nobody back through a pointer",
    },
    Kind {
        name: "the meter of the stack",
        functions: &["app::stack_use"],
        callers: &["device::session", "firmware::application::session"],
        nested: None,
        why: "the session asks it once",
    },
];

/// The functions that may be behind a pointer.
pub(super) struct Pointers {
    /// By the kinds' order; last those of no kind.
    of_kind: [Vec<u32>; KINDS.len() + 1],
}

impl Pointers {
    /// Finds every function whose address is in the data of the image or made by its code. Bridges to functions and
    /// constants that only happen to be equal count as well.
    pub(super) fn of(code: &Code, memory: &Memory) -> Self {
        let mut taken = BTreeSet::new();
        let mut note = |word: u32| {
            if word & 1 == 1 && code.at(word & !1).is_some() {
                taken.insert(word & !1);
            }
        };
        memory.words().for_each(|(_, word)| note(word));
        for (_, function) in code.functions().filter(|(_, function)| !function.is_bridge()) {
            let mut lower = [None; 16];
            for instruction in &function.instructions {
                match step::source(instruction) {
                    Some((register, Source::Constant(number))) => lower[register as usize & 15] = Some(number),
                    Some((register, Source::Upper(upper))) => {
                        if let Some(number) = lower[register as usize & 15] {
                            note(upper << 16 | number & 0xFFFF);
                        }
                    }
                    _ => {}
                }
            }
        }
        let mut of_kind: [Vec<u32>; KINDS.len() + 1] = Default::default();
        for address in taken {
            of_kind[kind(code, address)].push(address);
        }
        Self { of_kind }
    }

    /// How many there are of each kind; last those of none.
    pub(super) fn counts(&self) -> Vec<usize> {
        self.of_kind.iter().map(Vec::len).collect()
    }

    /// What a function may call through a pointer: the number of the kind, and the function.
    pub(super) fn called_by(&self, caller: &[String]) -> Vec<(usize, u32)> {
        let mut listed = KINDS.iter().enumerate().filter(|(_, kind)| contains(caller, kind.callers)).peekable();
        let kinds: Vec<usize> = if listed.peek().is_some() {
            listed.map(|(index, _)| index).collect()
        } else {
            (0..=KINDS.len()).collect()
        };
        kinds.into_iter().flat_map(|kind| self.of_kind[kind].iter().map(move |function| (kind, *function))).collect()
    }
}

fn kind(code: &Code, address: u32) -> usize {
    let names: Vec<String> = code.at(address).map(|function| function.names().collect()).unwrap_or_default();
    KINDS.iter().position(|kind| contains(&names, kind.functions)).unwrap_or(KINDS.len())
}

fn contains(names: &[String], parts: &[&str]) -> bool {
    names.iter().any(|name| parts.iter().any(|part| name.contains(part)))
}
