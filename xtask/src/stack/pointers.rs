//! Functions that are called through pointers: which can be, and by whom.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail, ensure};

use super::memory::Memory;
use super::step::{self, Source};
use crate::code::{Code, Function};

/// Functions that are called through pointers of one kind, by names.
pub(super) struct Kind {
    /// Name for people.
    pub(super) name: &'static str,
    /// A function is of this kind if its name contains one of these.
    functions: &'static [&'static str],
    /// A function calls only this kind, and others that list it too, through pointers, if its name contains one of
    /// these.
    callers: &'static [&'static str],
    /// Most nested calls of this kind; `None` if they never nest. Checked in both cases.
    pub(super) nested: Option<usize>,
    /// Why that is so.
    pub(super) why: &'static str,
}

/// Kinds of functions behind pointers. A call by a function that no row lists may lead to any function whose address
/// has been made, of whatever kind.
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
        why: "values within values, as the image has them: checked",
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

/// Whose addresses the functions of an image make.
pub(super) struct Pointers {
    /// The functions whose address a function makes, itself or as part of the data whose address it makes.
    made: BTreeMap<u32, BTreeSet<u32>>,
    /// The kind of each of them.
    kinds: BTreeMap<u32, usize>,
}

impl Pointers {
    /// Finds every address that code makes, and follows it through the data. Constants that only happen to be equal to
    /// the address of a function count as well.
    pub(super) fn of(code: &Code, memory: &Memory) -> Self {
        let values: BTreeMap<u32, BTreeSet<u32>> = code
            .functions()
            .filter(|(_, function)| !function.is_bridge())
            .map(|(address, function)| (address, values(function, memory)))
            .collect();
        let data = Data::of(code, memory, values.values().flatten().copied());
        let made: BTreeMap<u32, BTreeSet<u32>> = values
            .into_iter()
            .map(|(function, values)| {
                let behind = data.behind(values).into_iter();
                let functions = behind.filter(|word| word & 1 == 1 && code.at(word & !1).is_some());
                (function, functions.map(|word| word & !1).collect())
            })
            .collect();
        let kinds = made.values().flatten().map(|function| (*function, kind(code, *function))).collect();
        Self { made, kinds }
    }

    /// Number of each kind; last those of none.
    pub(super) fn counts(&self) -> Vec<usize> {
        (0..=KINDS.len()).map(|kind| self.kinds.values().filter(|known| **known == kind).count()).collect()
    }

    /// Fails if calls of a kind may be deeper inside one another than its row says: by what such functions hand out
    /// themselves, and one more, which only passes on what it was given (`&dyn Debug`).
    pub(super) fn check_nesting(&self, called: impl Fn(u32) -> Vec<u32>, name: &dyn Fn(u32) -> String) -> Result<()> {
        for (number, kind) in KINDS.iter().enumerate() {
            let Some(nested) = kind.nested else { continue };
            let of_kind = || self.kinds.iter().filter(|(_, known)| **known == number).map(|(function, _)| *function);
            let handed = of_kind().map(|function| (function, self.handed(function, number, &called))).collect();
            let mut chain = Chain { handed, open: Vec::new(), name };
            for function in of_kind() {
                let longest = chain.longest(function)?;
                ensure!(
                    longest < nested,
                    "{} of {} may be {longest} inside one another, and one that passes them on; {nested} are listed",
                    name(function),
                    kind.name
                );
            }
        }
        Ok(())
    }

    /// Functions of a kind whose address is made by a function or by what it calls, but not through pointers.
    fn handed(&self, function: u32, kind: usize, called: impl Fn(u32) -> Vec<u32>) -> BTreeSet<u32> {
        let (mut found, mut handed) = (BTreeSet::new(), BTreeSet::new());
        let mut open = vec![function];
        while let Some(next) = open.pop() {
            if found.insert(next) {
                open.extend(called(next));
                let made = self.made.get(&next).into_iter().flatten();
                handed.extend(made.copied().filter(|made| self.kinds.get(made) == Some(&kind)));
            }
        }
        handed
    }

    /// The functions that may be behind a pointer while these run: whatever they call may have made it, and so may what
    /// they call through pointers; but not what is called only to end everything.
    pub(super) fn within(&self, roots: &[u32], called: impl Fn(u32) -> Vec<u32>, ends: impl Fn(u32) -> bool) -> Behind {
        let mut found: BTreeSet<u32> = BTreeSet::new();
        let mut behind = BTreeSet::new();
        let mut open = roots.to_vec();
        while let Some(function) = open.pop() {
            if (!ends(function) || roots.contains(&function)) && found.insert(function) {
                open.extend(called(function));
                let made = self.made.get(&function).into_iter().flatten();
                open.extend(made.clone());
                behind.extend(made);
            }
        }
        let of_kind =
            |kind| behind.iter().copied().filter(|function| self.kinds.get(function) == Some(&kind)).collect();
        Behind((0..=KINDS.len()).map(of_kind).collect())
    }
}

/// Depth of nested calls of one kind, from what they hand out themselves: a function hands out those whose
/// address it makes, or a function it calls makes.
struct Chain<'a> {
    handed: BTreeMap<u32, BTreeSet<u32>>,
    open: Vec<u32>,
    name: &'a dyn Fn(u32) -> String,
}

impl Chain<'_> {
    fn longest(&mut self, function: u32) -> Result<usize> {
        if let Some(begin) = self.open.iter().position(|open| *open == function) {
            let circle: Vec<String> = self.open[begin..].iter().map(|open| (self.name)(*open)).collect();
            bail!("these functions hand out pointers to each other in a circle: {}", circle.join(" -> "));
        }
        self.open.push(function);
        let mut longest = 0;
        for next in self.handed.get(&function).cloned().unwrap_or_default() {
            longest = longest.max(self.longest(next)?);
        }
        self.open.pop();
        Ok(longest + 1)
    }
}

/// Functions that may be behind a pointer, by the kinds' order; last those of no kind.
pub(super) struct Behind(Vec<Vec<u32>>);

impl Behind {
    /// Calls through a pointer: the number of the kind, and the function.
    pub(super) fn called_by(&self, caller: &[String]) -> Vec<(usize, u32)> {
        let listed: Vec<usize> = (0..KINDS.len()).filter(|kind| contains(caller, KINDS[*kind].callers)).collect();
        let kinds = if listed.is_empty() { (0..=KINDS.len()).collect() } else { listed };
        kinds.into_iter().flat_map(|kind| self.0[kind].iter().map(move |function| (kind, *function))).collect()
    }
}

/// The numbers a function makes that may be addresses: in two halves, or from a constant near its code.
fn values(function: &Function, memory: &Memory) -> BTreeSet<u32> {
    let mut values = BTreeSet::new();
    let mut lower = [None; 16];
    for instruction in &function.instructions {
        match step::source(instruction) {
            Some((register, Source::Constant(number))) => lower[register as usize & 15] = Some(number),
            Some((register, Source::Upper(upper))) => {
                values.extend(lower[register as usize & 15].map(|number| upper << 16 | number & 0xFFFF));
            }
            Some((_, Source::Word(address))) => values.extend(memory.word(address)),
            _ => {}
        }
    }
    values
}

/// The data of an image. Where a piece of it ends is not known: at the next place whose address is made somewhere.
struct Data<'a> {
    memory: &'a Memory,
    begins: BTreeSet<u32>,
}

impl<'a> Data<'a> {
    fn of(code: &Code, memory: &'a Memory, made: impl Iterator<Item = u32>) -> Self {
        let is_data = |address: &u32| memory.word(*address & !3).is_some() && !code.is_inside(*address);
        // Instructions may look like an address: `ldrb.w r0, [r9, r5]` is 0x5f819. A piece that ended there would hide
        // what follows.
        let words = memory.words().filter(|(address, _)| !code.is_inside(*address)).map(|(_, word)| word);
        Self { memory, begins: made.chain(words).filter(is_data).collect() }
    }

    /// These numbers, and every word of the data they lead to.
    fn behind(&self, values: BTreeSet<u32>) -> BTreeSet<u32> {
        let mut found = BTreeSet::new();
        let mut open: Vec<u32> = values.into_iter().collect();
        while let Some(value) = open.pop() {
            if !found.insert(value) || !self.begins.contains(&value) {
                continue;
            }
            let end = self.begins.range(value + 1..).next().copied().unwrap_or(u32::MAX);
            let words = (value.next_multiple_of(4)..end).step_by(4).map_while(|address| self.memory.word(address));
            open.extend(words);
        }
        found
    }
}

fn kind(code: &Code, address: u32) -> usize {
    let names: Vec<String> = code.at(address).map(|function| function.names().collect()).unwrap_or_default();
    KINDS.iter().position(|kind| contains(&names, kind.functions)).unwrap_or(KINDS.len())
}

fn contains(names: &[String], parts: &[&str]) -> bool {
    names.iter().any(|name| parts.iter().any(|part| name.contains(part)))
}
