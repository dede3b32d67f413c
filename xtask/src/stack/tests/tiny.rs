//! Tiny images made by hand: functions of a few instructions at fixed distances, for a board or for none.

use link::metadata::{ImageMetadata, METADATA_SECTION, MemoryRegion};
use object::write::{Object, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionFlags, SectionKind, SymbolFlags, SymbolKind, SymbolScope};

use super::super::Depth;
use super::super::depth::{Calls, Part, Search, Way};
use super::super::levels::Layout;
use super::super::memory::Memory;
use crate::code::Code;
use crate::elf::{CORE_VECTORS, Elf};

/// Distance between the functions of a tiny image.
const STRIDE: u32 = 0x40;
/// Where the first begins: a function at 0 would be taken for every zero.
const FIRST: u32 = STRIDE;
/// Upper and lower end of the stack.
const STACK: (u32, u32) = (0x2000_4000, 0x2000_0000);

/// push {r7, lr}; pop {r7, pc}; bx lr; cpsid i; cpsie i; udf #254
pub(super) const PUSH: u16 = 0xB580;
pub(super) const POP: u16 = 0xBD80;
pub(super) const BACK: u16 = 0x4770;
pub(super) const MASK: u16 = 0xB672;
pub(super) const UNMASK: u16 = 0xB662;
pub(super) const NEVER: u16 = 0xDEFE;

/// A piece of a function.
#[derive(Clone)]
pub(super) enum Piece {
    Code(Vec<u16>),
    /// BL to a function.
    Call(&'static str),
    /// B.W to a function.
    Jump(&'static str),
    /// Constants.
    Data(Vec<u16>),
}

pub(super) use Piece::{Call, Data, Jump};

pub(super) fn code(halves: &[u16]) -> Piece {
    Piece::Code(halves.to_vec())
}

/// push {r7, lr}; sub.w sp, sp, #bytes; the calls; add.w sp, sp, #bytes; pop {r7, pc}
pub(super) fn framed(bytes: u16, calls: &[&'static str]) -> Vec<Piece> {
    // Twelve bits of a plain number: i, imm3, imm8.
    let number = (bytes >> 11 & 1, bytes >> 8 & 7, bytes & 0xFF);
    let second = number.1 << 12 | 0xD00 | number.2;
    let mut pieces = vec![code(&[PUSH, 0xF2AD | number.0 << 10, second])];
    pieces.extend(calls.iter().map(|name| Call(name)));
    pieces.push(code(&[0xF20D | number.0 << 10, second, POP]));
    pieces
}

/// Functions in the order of memory.
#[derive(Clone, Default)]
pub(super) struct Tiny {
    pub(super) functions: Vec<(&'static str, Vec<Piece>)>,
    /// Words behind the last function.
    data: Vec<u32>,
}

impl Tiny {
    pub(super) fn with(mut self, name: &'static str, pieces: Vec<Piece>) -> Self {
        match self.functions.iter_mut().find(|(known, _)| *known == name) {
            Some((_, known)) => *known = pieces,
            None => self.functions.push((name, pieces)),
        }
        self
    }

    /// With words behind the last function, and where they are: no function may be added any more.
    pub(super) fn with_data(mut self, words: &[u32]) -> (Self, u32) {
        self.data = words.to_vec();
        let begin = FIRST + STRIDE * self.functions.len() as u32;
        (self, begin)
    }

    pub(super) fn address(&self, name: &str) -> u32 {
        let index = self.functions.iter().position(|(known, _)| *known == name).expect("a function of this name");
        FIRST + STRIDE * index as u32
    }

    /// The ELF file. With a board: vector table, description and stack as well.
    fn file(&self, board: Option<&str>) -> Vec<u8> {
        let mut image = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
        let section = image.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
        let mut text = vec![0; FIRST as usize];
        let mut symbols = Vec::new();
        for (name, pieces) in &self.functions {
            let begin = self.address(name);
            for piece in pieces {
                let at = text.len() as u32;
                let halves = match piece {
                    Piece::Code(halves) | Data(halves) => halves.clone(),
                    Call(to) => branch(at, self.address(to), 0xD000),
                    Jump(to) => branch(at, self.address(to), 0x9000),
                };
                text.extend(halves.iter().flat_map(|half| half.to_le_bytes()));
                let mark = if matches!(piece, Data(_)) { "$d" } else { "$t" };
                symbols.push((mark.to_owned(), u64::from(at), 0, SymbolKind::Label));
            }
            let bytes = text.len() as u64 - u64::from(begin);
            symbols.push(((*name).to_owned(), u64::from(begin | 1), bytes, SymbolKind::Text));
            assert!(bytes <= u64::from(STRIDE), "{name} is too long");
            text.resize((begin + STRIDE) as usize, 0);
        }
        symbols.push(("$d".to_owned(), text.len() as u64, 0, SymbolKind::Label));
        text.extend(self.data.iter().flat_map(|word| word.to_le_bytes()));
        image.append_section_data(section, &text, 4);
        let mut add = |name: &str, value, size, kind, section| {
            let (scope, flags) = (SymbolScope::Compilation, SymbolFlags::None);
            image.add_symbol(Symbol { name: name.into(), value, size, kind, scope, weak: false, section, flags });
        };
        for (name, value, size, kind) in symbols {
            add(&name, value, size, kind, SymbolSection::Section(section));
        }
        for (name, value) in [("_stack_start", STACK.0), ("_stack_end", STACK.1), ("__emergency_stack", 0x2001_0000)] {
            add(name, u64::from(value), 0, SymbolKind::Data, SymbolSection::Absolute);
        }
        if let Some(board) = board {
            self.add_board(&mut image, board);
        }
        image.write().expect("the image is complete")
    }

    fn add_board(&self, image: &mut Object<'_>, board: &str) {
        let region = MemoryRegion { start: 0, length: 0x1000 };
        let description = ImageMetadata {
            link_version: 0,
            simulated: true,
            schema_hash: 0,
            model_hash: 0,
            image: region,
            store: None,
            firmware: "",
            board,
        };
        let place = image.add_section(Vec::new(), METADATA_SECTION.as_bytes().to_vec(), SectionKind::ReadOnlyData);
        image.append_section_data(place, &description.encode(), 4);
        let lines = lines(board);
        let is_core = |name: &str| !INNER.contains(&name) && !name.starts_with('<') && !lines.contains(&name);
        let core = self.functions.iter().filter(|(name, _)| is_core(name)).map(|(name, _)| self.address(name) | 1);
        let mut vectors: Vec<u32> = std::iter::once(STACK.0).chain(core).collect();
        vectors.resize(CORE_VECTORS, 0);
        let line = |name: &&str| self.functions.iter().find(|(known, _)| known == name).map(|_| self.address(name) | 1);
        vectors.extend(lines.iter().map(|name| line(name).unwrap_or(0)));
        let vectors: Vec<u8> = vectors.into_iter().flat_map(u32::to_le_bytes).collect();
        let place = image.add_section(Vec::new(), b".vector_table".to_vec(), SectionKind::ReadOnlyData);
        image.append_section_data(place, &vectors, 4);
        image.section_mut(place).flags = SectionFlags::Elf { sh_flags: 2 };
    }

    pub(super) fn calls(&self) -> anyhow::Result<Calls> {
        let file = self.file(None);
        let file = Elf::parse(&*file)?;
        Calls::of(Code::of(&file)?, &Memory::of(&file)?)
    }

    /// The deepest way from a function.
    pub(super) fn deepest(&self, name: &str) -> anyhow::Result<Way> {
        let calls = self.calls()?;
        let function = calls.address(name)?;
        Search::new(&calls, function, &[], Default::default()).deepest(function, Part::Whole)
    }

    pub(super) fn depth(&self, board: &str) -> anyhow::Result<Depth> {
        let file = self.file(Some(board));
        super::super::of(&Elf::parse(&*file)?)
    }
}

/// BL or B.W.
fn branch(from: u32, to: u32, kind: u16) -> Vec<u16> {
    let offset = to.wrapping_sub(from + 4);
    let (sign, upper) = (offset >> 24 & 1, |bit: u32| 1 ^ (offset >> bit & 1) ^ (offset >> 24 & 1));
    let first = 0xF000 | sign << 10 | offset >> 12 & 0x3FF;
    let second = u32::from(kind) | upper(23) << 13 | upper(22) << 11 | offset >> 1 & 0x7FF;
    vec![first as u16, second as u16]
}

/// Functions of the tiny images that are no handlers.
const INNER: [&str; 6] = ["main", "begin", "idle", "deep", "rust_begin_unwind", "stranger"];

/// The handlers of a board, by their lines.
fn lines(board: &str) -> Vec<&'static str> {
    let layout = Layout::of(board).map(|layout| layout.levels).unwrap_or_default();
    layout.iter().flat_map(|level| level.handlers).copied().collect()
}

/// Their priorities, by the table.
pub(super) fn priorities(board: &str) -> Vec<u32> {
    let layout = Layout::of(board).expect("a board of this name");
    layout.levels.iter().flat_map(|level| level.handlers.iter().map(|_| level.priority)).collect()
}

/// push; cpsid i; movw r0, #0xe400; movt r0, #0xe000; for every line movs r1, #level; strb r1, [r0, #line]; start;
/// serve
pub(super) fn main(priorities: &[u32]) -> Vec<Piece> {
    let stores = priorities.iter().zip(0..).flat_map(|(priority, line)| {
        let level = (16 - *priority as u16) << 4;
        [0x2100 | level, 0x7001 | line << 6]
    });
    let stores: Vec<u16> = stores.collect();
    let begin = [PUSH, MASK, 0xF24E, 0x4000, 0xF2CE, 0x0000];
    vec![code(&begin), code(&stores), Call("begin"), Call("idle"), code(&[NEVER])]
}

/// An image for a board that starts, serves and can end: 8 B for Reset's call of main, 8 for main.
pub(super) fn board(name: &str) -> Tiny {
    let mut tiny = Tiny::default()
        .with("Reset", vec![Call("main"), code(&[NEVER])])
        .with("main", main(&priorities(name)))
        .with("begin", vec![code(&[PUSH]), Call("deep"), code(&[UNMASK, POP])])
        .with("deep", framed(400, &[]))
        .with("idle", framed(100, &[]))
        .with("rust_begin_unwind", vec![code(&[PUSH, MASK]), Call("deep"), code(&[NEVER])]);
    let layout = Layout::of(name).expect("a board of this name");
    for handler in layout.levels.iter().flat_map(|level| level.handlers).chain(layout.ends) {
        tiny = tiny.with(handler, framed(40, &[]));
    }
    // ldr r1, [pc, #4]; mov sp, r1; b.w deep; the upper end of the emergency stack
    let emergency = || vec![code(&[0x4901, 0x468D]), Jump("deep"), Data(vec![0x0000, 0x2001])];
    for handler in layout.other.iter().flat_map(|other| other.handlers) {
        tiny = tiny.with(handler, emergency());
    }
    tiny
}

pub(super) const HAND: &str = "mps2-an385";
pub(super) const REAL: &str = "nucleo-h743zi2";
