//! Stack depth of a function by itself, and at each of its calls.
//!
//! The stack pointer is followed along every way through the function. A function is refused, by name, where two ways
//! meet with different stack pointers, where it returns with another one than it began with, where the stack pointer
//! changes in a way that is not read, and where code is never reached although it is none.

use std::collections::{BTreeMap, BTreeSet};

use anyhow::{Result, bail, ensure};

use super::condition::{conditions, is_it, opposite};
use super::memory::Memory;
use super::step::{self, Effect, Source, Way};
use crate::code::Function;
use crate::thumb::{Flow, Instruction};

/// Number of the register that points to the frame where there is a frame pointer.
const FRAME_POINTER: u32 = 7;
/// Number of the program counter.
const PC: u32 = 15;
/// Number of the link register.
const LINK: u32 = 14;
/// The stack pointer always is a multiple of this.
const WORD: i32 = 4;
/// Masks interrupts by priority: CPSID i.
pub(super) const MASK: u16 = 0xB672;
/// Unmasks interrupts: CPSIE i.
pub(super) const UNMASK: u16 = 0xB662;

/// Target of a call.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Target {
    /// The function at an address.
    Function(u32),
    /// Whatever a register points to.
    Pointer,
}

/// A call, a jump into another function included.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Call {
    /// Where it is.
    pub(super) address: u32,
    /// Bytes of stack in use there.
    pub(super) depth: u32,
    /// True if interrupts may have been unmasked on the way there.
    pub(super) unmasked: bool,
    /// Function that is called.
    pub(super) target: Target,
}

/// A function on the stack.
#[derive(Debug, Default, PartialEq, Eq)]
pub(super) struct Frame {
    /// The most bytes it has in use itself.
    pub(super) bytes: u32,
    /// The most it has in use after it has unmasked interrupts; `None` if it does not do that itself.
    pub(super) unmasked: Option<u32>,
    /// Its calls.
    pub(super) calls: Vec<Call>,
    /// Where it has put the stack pointer, if it takes another stack, and the most bytes it has in use on that one. All
    /// its calls happen there.
    pub(super) other_stack: Option<u32>,
}

impl Frame {
    /// Follows a function, which begins at an address and is followed by another one.
    ///
    /// `unmasks` says of other functions whether they unmask interrupts.
    ///
    /// # Errors
    /// Where the stack pointer cannot be followed; the text names the place.
    pub(super) fn of(begin: u32, function: &Function, memory: &Memory, unmasks: &BTreeSet<u32>) -> Result<Self> {
        let mut walk = Walk {
            begin,
            end: function.end,
            all: &function.instructions,
            memory,
            unmasks,
            index: function.instructions.iter().enumerate().map(|(index, read)| (read.address, index)).collect(),
            conditions: conditions(&function.instructions),
            states: BTreeMap::new(),
            tables: Vec::new(),
            open: Vec::new(),
            frame: Self::default(),
        };
        walk.run()?;
        Ok(walk.frame)
    }
}

/// State known before an instruction.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct State {
    /// Bytes in use.
    depth: i32,
    /// Bytes in use where the frame pointer points, if it has been set.
    pointer: Option<i32>,
    /// Interrupts may be unmasked.
    unmasked: bool,
}

/// An instruction. Amid instructions that are executed on a condition: the one that is true, once that has mattered.
type Place = (usize, Option<u16>);

struct Walk<'a> {
    begin: u32,
    end: u32,
    all: &'a [Instruction],
    memory: &'a Memory,
    unmasks: &'a BTreeSet<u32>,
    index: BTreeMap<u32, usize>,
    /// The instructions that are executed on a condition, each with its condition's number.
    conditions: BTreeMap<usize, u16>,
    states: BTreeMap<Place, State>,
    /// Where a table may lead of which only the beginning is known.
    tables: Vec<(usize, State)>,
    open: Vec<Place>,
    frame: Frame,
}

impl Walk<'_> {
    fn run(&mut self) -> Result<()> {
        ensure!(!self.all.is_empty(), "it has no instructions");
        self.reach((0, None), State { depth: 0, pointer: None, unmasked: false }, self.begin)?;
        loop {
            while let Some(place) = self.open.pop() {
                self.step(place)?;
            }
            // Where else the code is reached from is known better.
            let Some((index, state)) = self.tables.pop() else { break };
            if !self.is_reached(index) {
                self.reach((index, None), state, self.all[index].address)?;
            }
        }
        for (index, instruction) in self.all.iter().enumerate() {
            ensure!(
                is_filling(instruction) || self.is_reached(index),
                "the code at {:#010x} is not reached from its beginning",
                instruction.address
            );
        }
        self.frame.calls.sort_by_key(|call| (call.address, call.target));
        self.frame.calls.dedup();
        Ok(())
    }

    fn is_reached(&self, index: usize) -> bool {
        self.states.range((index, None)..).next().is_some_and(|((reached, _), _)| *reached == index)
    }

    /// One instruction, and where it goes on.
    fn step(&mut self, (index, mut is_true): Place) -> Result<()> {
        let instruction = self.all[index];
        let Some(before) = self.states.get(&(index, is_true)).copied() else { return Ok(()) };
        let (at, way) = (instruction.address, step::way(&instruction));
        let condition = self.conditions.get(&index).copied();
        if condition.is_some() && condition.map(opposite) == is_true {
            return self.go(at + instruction.bytes, before, at, is_true);
        }
        let after = self.after(index, before)?;
        ensure!(after.depth >= 0, "the stack pointer is above where it began after {at:#010x}");
        if let Some(condition) = condition.filter(|_| condition != is_true) {
            // Both ways; from here on only one of them, if the stack pointer depends on it.
            let matters = after.depth != before.depth;
            self.go(at + instruction.bytes, before, at, matters.then(|| opposite(condition)))?;
            is_true = matters.then_some(condition);
        }
        self.note(after);
        let called = match way {
            Way::CallBy(register) => Some(self.pointed(index, register)),
            Way::Known => match instruction.flow {
                Flow::Call(to) => Some(Target::Function(to)),
                _ => None,
            },
            _ => None,
        };
        let mut goes_on = called.is_some();
        let mut next = after;
        if let Some(target) = called {
            self.call(at, after, target);
            next.unmasked |= matches!(target, Target::Function(to) if self.unmasks.contains(&to));
        }
        match way {
            Way::CallBy(_) => {}
            Way::Known => match instruction.flow {
                Flow::Call(_) | Flow::Abort | Flow::Unreachable => {}
                Flow::Next => goes_on = true,
                Flow::Jump(to) => self.jump(to, after, at)?,
                Flow::Branch(to) => {
                    self.jump(to, after, at)?;
                    goes_on = true;
                }
                Flow::Elsewhere => bail!("nobody can read where it goes on after {at:#010x}"),
            },
            Way::By(LINK) | Way::Return => {
                ensure!(after.depth == 0, "it returns at {at:#010x} with {} bytes left on the stack", after.depth);
            }
            Way::By(register) => self.call(at, after, self.pointed(index, register)),
            Way::Loaded(from) => match self.memory.word(from) {
                Some(to) => self.call(at, after, Target::Function(to & !1)),
                None => bail!("it goes on at {at:#010x} where a missing constant says"),
            },
            Way::Table { base, entry } => self.table(index, base, entry, after)?,
            Way::Unknown => bail!("nobody can read where it goes on after {at:#010x}"),
        }
        // Behind a call that never returns and a branch that is always taken the compiler may end a function as it
        // likes.
        let may_end = called.is_some() || matches!(instruction.flow, Flow::Branch(_));
        if goes_on && !(may_end && self.is_last(index)) {
            self.go(at + instruction.bytes, next, at, is_true)?;
        }
        Ok(())
    }

    /// True if nothing but filling follows until the function or this piece of its code ends.
    fn is_last(&self, index: usize) -> bool {
        let mut end = self.all[index].address + self.all[index].bytes;
        for next in self.all.iter().skip(index + 1) {
            if next.address != end {
                break;
            }
            if !is_filling(next) {
                return false;
            }
            end += next.bytes;
        }
        true
    }

    /// Target of a register that is called.
    fn pointed(&self, index: usize, register: u32) -> Target {
        self.constant(index, register).map_or(Target::Pointer, |to| Target::Function(to & !1))
    }

    /// State known after an instruction.
    fn after(&mut self, index: usize, before: State) -> Result<State> {
        let instruction = &self.all[index];
        let at = instruction.address;
        let mut after = before;
        if instruction.halves.0 == UNMASK {
            after.unmasked = true;
        }
        if let Some((FRAME_POINTER, Source::StackPlus(bytes))) = step::source(instruction)
            && before.pointer.is_none()
        {
            after.pointer = Some(before.depth - bytes);
        }
        let number = |register| {
            self.constant(index, register)
                .map(u32::cast_signed)
                .ok_or_else(|| anyhow::anyhow!("the stack pointer changes at {at:#010x} by a number nobody can read"))
        };
        match step::effect(instruction) {
            Effect::None => {}
            Effect::Down(bytes) => after.depth += bytes,
            Effect::DownBy(register) => after.depth += number(register)?,
            Effect::UpBy(register) => after.depth -= number(register)?,
            Effect::From(register) => self.replaced(index, register, &mut after)?,
            Effect::Unknown => bail!("the stack pointer changes at {at:#010x} in a way nobody can read"),
        }
        Ok(after)
    }

    /// The stack pointer becomes a register: the frame pointer, itself aligned, or another stack.
    fn replaced(&mut self, index: usize, register: u32, state: &mut State) -> Result<()> {
        let at = self.all[index].address;
        let pointed = |pointer: Option<i32>, above: i32| {
            pointer.map(|depth| depth - above).ok_or_else(|| anyhow::anyhow!("no frame pointer is set at {at:#010x}"))
        };
        if register == FRAME_POINTER {
            state.depth = pointed(state.pointer, 0)?;
            return Ok(());
        }
        if let Some(top) = self.constant(index, register) {
            ensure!(
                self.frame.other_stack.is_none_or(|other| other == top) && self.frame.calls.is_empty(),
                "it takes another stack at {at:#010x}, after calls or for the second time"
            );
            self.frame.other_stack = Some(top);
            self.frame.bytes = 0;
            state.depth = 0;
            return Ok(());
        }
        let before = |back: usize| index.checked_sub(back).and_then(|index| step::source(self.all.get(index)?));
        match before(1) {
            Some((to, Source::RegisterPlus(FRAME_POINTER, above))) if to == register => {
                state.depth = pointed(state.pointer, above)?;
            }
            Some((to, Source::Aligned(bits))) if to == register && bits < 16 => match before(2) {
                Some((to, Source::StackPlus(above))) if to == register => {
                    state.depth += ((1 << bits) - WORD).max(0) - above;
                }
                _ => bail!("the stack pointer changes at {at:#010x} in a way nobody can read"),
            },
            _ => bail!("the stack pointer changes at {at:#010x} in a way nobody can read"),
        }
        Ok(())
    }

    /// The number in a register, if the instructions just before put it there.
    fn constant(&self, index: usize, register: u32) -> Option<u32> {
        let before = |back: usize| {
            let index = index.checked_sub(back)?;
            let (to, source) = step::source(self.all.get(index)?)?;
            (to == register).then_some(source)
        };
        match before(1)? {
            Source::Constant(number) => Some(number),
            Source::Word(address) => self.memory.word(address),
            Source::Upper(upper) => match before(2)? {
                Source::Constant(lower) => Some(upper << 16 | lower & 0xFFFF),
                _ => None,
            },
            _ => None,
        }
    }

    fn note(&mut self, state: State) {
        let depth = state.depth.unsigned_abs();
        self.frame.bytes = self.frame.bytes.max(depth);
        if state.unmasked {
            self.frame.unmasked = Some(self.frame.unmasked.unwrap_or(0).max(depth));
        }
    }

    fn call(&mut self, address: u32, state: State, target: Target) {
        let depth = state.depth.unsigned_abs();
        self.frame.calls.push(Call { address, depth, unmasked: state.unmasked, target });
    }

    /// Goes on elsewhere: in this function, or at the beginning of another one.
    fn jump(&mut self, to: u32, state: State, from: u32) -> Result<()> {
        self.go(to, state, from, None)
    }

    fn go(&mut self, to: u32, state: State, from: u32, is_true: Option<u16>) -> Result<()> {
        match self.index.get(&to) {
            Some(index) if to != self.begin || state.depth == 0 => {
                let matters = self.conditions.contains_key(index) || is_it(&self.all[*index]);
                let is_true = is_true.filter(|_| matters);
                self.reach((*index, is_true), state, from)?;
            }
            Some(_) => bail!("it begins anew at {from:#010x} with {} bytes left on the stack", state.depth),
            None => self.call(from, state, Target::Function(to)),
        }
        Ok(())
    }

    /// A table of ways to go on. Behind the instruction it ends where code begins again, or with a zero, which would
    /// lead to the table itself; elsewhere constants may follow.
    fn table(&mut self, index: usize, base: u32, entry: u32, state: State) -> Result<()> {
        let instruction = self.all[index];
        let counted = instruction.address + instruction.bytes;
        let is_behind = base == PC;
        let first = if is_behind { counted } else { self.near(index, base)? };
        let end = self.index.range(first..).next().map_or(self.end, |(next, _)| *next);
        ensure!(end > first, "the table behind {:#010x} is missing", instruction.address);
        for at in (first..end).step_by(entry as usize) {
            let offset = if entry == 1 { self.memory.byte(at) } else { self.memory.half(at) };
            let Some(offset) = offset else { bail!("the table of {:#010x} is cut off", instruction.address) };
            if is_behind && offset == 0 {
                break;
            }
            match self.index.get(&(counted + 2 * offset)) {
                Some(to) if is_behind => self.reach((*to, None), state, instruction.address)?,
                // A zero behind the last entry.
                Some(to) if self.is_padding(*to) => {}
                Some(to) => self.tables.push((*to, state)),
                None => {}
            }
        }
        Ok(())
    }

    /// True for a NOP with no code behind it: it aligns constants.
    fn is_padding(&self, index: usize) -> bool {
        let instruction = self.all[index];
        instruction.halves.0 == 0xBF00 && !self.index.contains_key(&(instruction.address + instruction.bytes))
    }

    /// The address near the code that a register holds, from the last instruction that can be read to set it.
    fn near(&self, index: usize, register: u32) -> Result<u32> {
        let at = self.all[index].address;
        let before = self.all[..index].iter().rev().filter_map(step::source);
        match before.into_iter().find(|(to, _)| *to == register) {
            Some((_, Source::Constant(address))) => Ok(address),
            _ => bail!("nobody can read where the table of {at:#010x} is"),
        }
    }

    fn reach(&mut self, place: Place, state: State, from: u32) -> Result<()> {
        match self.states.get_mut(&place) {
            None => {
                self.states.insert(place, state);
                self.open.push(place);
            }
            Some(known) => {
                ensure!(
                    known.depth == state.depth,
                    "{:#010x} is reached with {} and, from {from:#010x}, {} bytes on the stack",
                    self.all[place.0].address,
                    known.depth,
                    state.depth
                );
                let joined = State {
                    unmasked: known.unmasked || state.unmasked,
                    pointer: if known.pointer == state.pointer { known.pointer } else { None },
                    ..*known
                };
                if joined != *known {
                    *known = joined;
                    self.open.push(place);
                }
            }
        }
        Ok(())
    }
}

/// True if an instruction does nothing, or ends everything: what is put between pieces of code.
fn is_filling(instruction: &Instruction) -> bool {
    matches!(instruction.halves, (0xBF00 | 0, 0) | (0xF3AF, 0x8000))
        || matches!(instruction.flow, Flow::Abort | Flow::Unreachable)
}
