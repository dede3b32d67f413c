//! The deepest way through the calls of an image.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use anyhow::{Context, Result, bail};

use super::frame::{self, Call, Frame, Target};
use super::memory::Memory;
use super::pointers::{Behind, KINDS, Pointers};
use crate::code::{Code, Function};
use crate::thumb::Flow;

/// Part of the name of the function in which every panic ends: it masks interrupts first and never returns.
const END: &str = "rust_begin_unwind";

/// Which part of a function counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub(super) enum Part {
    /// All of it.
    Whole,
    /// Code that runs before interrupts are unmasked.
    Masked,
    /// Code that runs after interrupts have been unmasked.
    Unmasked,
}

/// One function on a way.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Stop {
    /// Its name.
    pub(super) function: String,
    /// Bytes it has in use where the way goes on, or the most it ever has if the way ends here.
    pub(super) bytes: u32,
}

/// A way and how deep it goes.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Way {
    /// Bytes.
    pub(super) bytes: u32,
    /// The functions, the caller first.
    pub(super) stops: Vec<Stop>,
}

/// Calls of each kind of pointer that may still follow.
type Left = [usize; KINDS.len() + 1];

/// A function as it is called on a way.
type Key = (u32, Part, Left);

/// The functions of an image with their frames.
pub(super) struct Calls {
    code: Code,
    frames: BTreeMap<u32, Frame>,
    names: BTreeMap<u32, Vec<String>>,
    pointers: Pointers,
    unmasks: BTreeSet<u32>,
}

impl Calls {
    /// Follows every function of an image.
    ///
    /// # Errors
    /// If there are functions whose stack pointer cannot be followed: all are named.
    pub(super) fn of(code: Code, memory: &Memory) -> Result<Self> {
        let unmasks = unmasking(&code);
        let (mut frames, mut names, mut strange) = (BTreeMap::new(), BTreeMap::new(), Vec::new());
        for (address, function) in code.functions() {
            match Frame::of(address, function, memory, &unmasks) {
                Ok(frame) => drop(frames.insert(address, frame)),
                Err(error) => strange.push(format!("{} ({address:#010x}): {error}", function.name())),
            }
            names.insert(address, function.names().collect());
        }
        if !strange.is_empty() {
            bail!("the stack of these functions cannot be followed:\n  {}", strange.join("\n  "));
        }
        let pointers = Pointers::of(&code, memory);
        Ok(Self { code, frames, names, pointers, unmasks })
    }

    /// Every function with the most bytes it has in use itself, the largest first.
    pub(super) fn largest(&self) -> Vec<Stop> {
        let mut all: Vec<Stop> = self
            .frames
            .iter()
            .map(|(address, frame)| Stop { function: self.name(*address), bytes: frame.bytes })
            .collect();
        all.sort_by_key(|stop| std::cmp::Reverse(stop.bytes));
        all
    }

    /// Fails if calls through pointers may be deeper inside one another than is listed.
    ///
    /// # Errors
    /// With the functions.
    pub(super) fn check_nesting(&self) -> Result<()> {
        let end = self.end()?;
        // The end of a panic is counted apart.
        let called = |function| if function == end { Vec::new() } else { self.called(function) };
        self.pointers.check_nesting(called, &|function| self.name(function))
    }

    /// Number of functions of each kind that a pointer may lead to.
    pub(super) fn behind_pointers(&self) -> Vec<usize> {
        self.pointers.counts()
    }

    /// The functions that unmask interrupts, directly or by calling another.
    pub(super) fn unmasks(&self, address: u32) -> bool {
        self.unmasks.contains(&address)
    }

    /// The frame of a function.
    pub(super) fn frame(&self, address: u32) -> Option<&Frame> {
        self.frames.get(&address)
    }

    /// Where the function of this name begins; the name as the compiler encodes it.
    ///
    /// # Errors
    /// If there is none.
    pub(super) fn address(&self, name: &str) -> Result<u32> {
        self.code.address(name).with_context(|| format!("the image has no function '{name}'"))
    }

    /// The function in which every panic ends.
    ///
    /// # Errors
    /// If there is none.
    pub(super) fn end(&self) -> Result<u32> {
        let found = self.code.functions().find(|(_, function)| function.names().any(|name| name.ends_with(END)));
        found.map(|(address, _)| address).with_context(|| format!("the image has no function '{END}'"))
    }

    /// Bytes in use until a function has masked interrupts, itself or in what it calls first.
    ///
    /// # Errors
    /// If it calls anybody who does not.
    pub(super) fn until_masked(&self, function: u32) -> Result<u32> {
        let (Some(code), Some(frame)) = (self.code.at(function), self.frame(function)) else {
            bail!("no function begins at {function:#010x}");
        };
        if masks_first(code) {
            return Ok(frame.bytes);
        }
        let mut deepest = frame.bytes;
        for call in &frame.calls {
            match call.target {
                Target::Function(to) if self.code.at(to).is_some_and(masks_first) => {
                    deepest = deepest.max(call.depth + self.until_masked(to)?);
                }
                _ => bail!("{} does not mask interrupts before it calls anybody", code.name()),
            }
        }
        Ok(deepest)
    }

    /// Direct calls of a function.
    fn called(&self, function: u32) -> Vec<u32> {
        let calls = self.frame(function).map(|frame| frame.calls.as_slice()).unwrap_or_default();
        let called = calls.iter().filter_map(|call| match call.target {
            Target::Function(to) => Some(to),
            Target::Pointer => None,
        });
        called.collect()
    }

    /// Readable name of the function at an address.
    pub(super) fn name(&self, address: u32) -> String {
        self.code.at(address).map(Function::name).unwrap_or_default()
    }

    /// All readable names of the function at an address.
    pub(super) fn names(&self, address: u32) -> &[String] {
        self.names.get(&address).map(Vec::as_slice).unwrap_or_default()
    }
}

/// True if a function masks interrupts before it calls another.
fn masks_first(function: &Function) -> bool {
    let position = |wanted: &dyn Fn(&crate::thumb::Instruction) -> bool| function.instructions.iter().position(wanted);
    let masks = position(&|instruction| instruction.halves.0 == frame::MASK);
    let calls = position(&|instruction| {
        matches!(instruction.flow, Flow::Call(_))
            || matches!(super::step::way(instruction), super::step::Way::CallBy(_))
    });
    masks.is_some_and(|masks| calls.is_none_or(|calls| masks < calls))
}

/// The functions that unmask interrupts, and those that call them.
fn unmasking(code: &Code) -> BTreeSet<u32> {
    let direct = |function: &Function| function.instructions.iter().any(|read| read.halves.0 == frame::UNMASK);
    let mut found: BTreeSet<u32> =
        code.functions().filter(|(_, function)| direct(function)).map(|(address, _)| address).collect();
    loop {
        let calls = |function: &Function| {
            function.instructions.iter().any(
                |read| matches!(read.flow, Flow::Call(to) | Flow::Jump(to) | Flow::Branch(to) if found.contains(&to)),
            )
        };
        let more: Vec<u32> = code
            .functions()
            .filter(|(address, function)| !found.contains(address) && calls(function))
            .map(|(address, _)| address)
            .collect();
        if more.is_empty() {
            return found;
        }
        found.extend(more);
    }
}

/// A search for the deepest ways that begin at some functions.
pub(super) struct Search<'a> {
    calls: &'a Calls,
    /// Functions that a pointer may lead to.
    behind: Behind,
    /// Functions that count as so deep, whatever they call.
    ends: BTreeMap<u32, u32>,
    known: HashMap<Key, (u32, Option<(u32, Key)>)>,
    open: Vec<Key>,
}

impl<'a> Search<'a> {
    /// A search for ways from a function, in which some functions are so deep, whatever they call. Pointers may have
    /// been made by the functions it reaches, or kept somewhere by others that ran before.
    pub(super) fn new(calls: &'a Calls, function: u32, before: &[u32], ends: BTreeMap<u32, u32>) -> Self {
        let roots: Vec<u32> = before.iter().copied().chain([function]).collect();
        let behind =
            calls.pointers.within(&roots, |function| calls.called(function), |function| ends.contains_key(&function));
        Self { calls, behind, ends, known: HashMap::new(), open: Vec::new() }
    }

    /// The deepest way from a function.
    ///
    /// # Errors
    /// If functions call each other in a circle, or one calls a place where no function begins.
    pub(super) fn deepest(&mut self, function: u32, part: Part) -> Result<Way> {
        let mut left = [0; KINDS.len() + 1];
        for (left, kind) in left.iter_mut().zip(&KINDS) {
            *left = kind.nested.unwrap_or(0);
        }
        let mut key = (function, part, left);
        let bytes = self.depth(key)?;
        let mut way = Way { bytes, stops: Vec::new() };
        while let Some((bytes, next)) = self.known.get(&key) {
            let function = self.calls.name(key.0);
            match next {
                Some((at, next)) => {
                    way.stops.push(Stop { function, bytes: *at });
                    key = *next;
                }
                None => {
                    way.stops.push(Stop { function, bytes: *bytes });
                    break;
                }
            }
        }
        Ok(way)
    }

    fn depth(&mut self, key: Key) -> Result<u32> {
        if let Some((bytes, _)) = self.known.get(&key) {
            return Ok(*bytes);
        }
        let (function, part, _) = key;
        if let Some(begin) = self.open.iter().position(|open| *open == key) {
            let circle: Vec<String> = self.open[begin..].iter().map(|open| self.calls.name(open.0)).collect();
            bail!("these functions call each other in a circle: {}", circle.join(" -> "));
        }
        let frame = self.calls.frame(function).with_context(|| format!("no function begins at {function:#010x}"))?;
        let own = match part {
            Part::Unmasked => frame.unmasked.unwrap_or(0),
            Part::Whole | Part::Masked => frame.bytes,
        };
        if let Some(bytes) = self.ends.get(&function) {
            self.known.insert(key, (*bytes, None));
            return Ok(*bytes);
        }
        self.open.push(key);
        let mut deepest = (own, None);
        for call in &frame.calls {
            for next in self.called(key, call)? {
                if self.calls.frame(next.0).is_none() {
                    bail!("{} calls {:#010x}, where no function begins", self.calls.name(function), next.0);
                }
                let below = self.depth(next)?;
                if call.depth + below > deepest.0 {
                    deepest = (call.depth + below, Some((call.depth, next)));
                }
            }
        }
        self.open.pop();
        self.known.insert(key, deepest);
        Ok(deepest.0)
    }

    /// Target of a call, as far as it belongs to this part of the function.
    fn called(&self, (function, part, left): Key, call: &Call) -> Result<Vec<Key>> {
        let part = match (part, call.target) {
            (Part::Whole, _) => Part::Whole,
            (Part::Masked, _) if call.unmasked => return Ok(Vec::new()),
            (Part::Masked, _) => Part::Masked,
            (Part::Unmasked, _) if call.unmasked => Part::Whole,
            (Part::Unmasked, Target::Function(to)) if self.calls.unmasks(to) => Part::Unmasked,
            (Part::Unmasked, _) => return Ok(Vec::new()),
        };
        match call.target {
            Target::Function(to) => Ok(vec![(to, part, left)]),
            Target::Pointer => {
                let behind = self.behind.called_by(self.calls.names(function));
                if behind.is_empty() {
                    let way: Vec<String> = self.open.iter().map(|open| self.calls.name(open.0)).collect();
                    let (way, address) = (way.join(" -> "), call.address);
                    bail!("{way} calls at {address:#010x} through a pointer that nothing before it can have made");
                }
                let nested = |kind: usize| KINDS.get(kind).and_then(|kind| kind.nested);
                let next = behind.into_iter().filter_map(|(kind, to)| {
                    let mut left = left;
                    if nested(kind).is_some() {
                        left[kind] = left[kind].checked_sub(1)?;
                    }
                    Some((to, part, left))
                });
                Ok(next.collect())
            }
        }
    }
}
