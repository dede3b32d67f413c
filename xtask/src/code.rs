//! The functions of an image, read instruction by instruction.
//!
//! Constants lie between the instructions; the mapping symbols of the ARM ABI (`$t`: instructions from here, `$d`:
//! data) tell them apart.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use anyhow::{Result, ensure};
use object::{Object as _, ObjectSection as _, ObjectSymbol as _, SymbolKind};

use crate::elf::Elf;
use crate::thumb::Instruction;

/// Where a branch cannot reach, the linker puts a bridge; its name has this in front of the name of the function meant.
const FAR: &str = "LongThunk_";

/// A function.
pub(crate) struct Function {
    /// All its names, as the compiler encodes them: equal functions may be one.
    names: Vec<String>,
    /// Its instructions in the order of memory, without the constants.
    pub(crate) instructions: Vec<Instruction>,
    /// Where it ends, its constants included.
    pub(crate) end: u32,
}

impl Function {
    /// Its first name, readable; that of the function meant, if it is a linker's bridge to one.
    pub(crate) fn name(&self) -> String {
        self.names.first().map(|name| readable(name)).unwrap_or_default()
    }

    /// True if it is a linker's bridge.
    pub(crate) fn is_bridge(&self) -> bool {
        self.names.iter().any(|name| name.contains(FAR))
    }

    /// All its names, readable in the same way.
    pub(crate) fn names(&self) -> impl Iterator<Item = String> {
        self.names.iter().map(|name| readable(name))
    }
}

/// All functions by their address.
pub(crate) struct Code(BTreeMap<u32, Function>);

impl Code {
    /// Reads the functions of an image.
    ///
    /// # Errors
    /// If the file is damaged or has no functions in its symbol table.
    pub(crate) fn of(file: &Elf<'_>) -> Result<Self> {
        let mut marks: HashMap<_, BTreeMap<u32, bool>> = HashMap::new();
        for symbol in file.symbols() {
            let kind = symbol.name()?.split('.').next();
            if let (Some(kind @ ("$t" | "$d")), Some(section)) = (kind, symbol.section_index()) {
                marks.entry(section).or_default().insert(symbol.address() as u32, kind == "$t");
            }
        }
        // The lowest bit of an address says Thumb.
        let mut symbols = Vec::new();
        for symbol in file.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text) {
            if let Some(section) = symbol.section_index() {
                symbols.push((symbol.size(), section, symbol.address() as u32 & !1, symbol.name()?.to_owned()));
            }
        }
        // Assembly may not say how long its functions are: such a one ends where the next begins.
        symbols.sort_by_key(|(bytes, ..)| *bytes == 0);
        let begins: BTreeSet<u32> = symbols.iter().map(|(_, _, address, _)| *address).collect();
        let mut functions: BTreeMap<u32, Function> = BTreeMap::new();
        for (bytes, section, address, name) in symbols {
            if let Some(known) = functions.get_mut(&address) {
                known.names.push(name);
                continue;
            }
            let content = file.section_by_index(section)?;
            let end = content.address() + content.size();
            let end = begins.range(address + 1..).next().map_or(end, |next| end.min(u64::from(*next)));
            let bytes = if bytes == 0 { end.saturating_sub(u64::from(address)) } else { bytes };
            let code = content.data_range(u64::from(address), bytes)?.unwrap_or_default();
            let marks = marks.get(&section);
            let is_code =
                |at: u32| marks.and_then(|marks| marks.range(..=at).next_back()).is_none_or(|(_, code)| *code);
            let mut instructions = Vec::new();
            let mut at = 0;
            while let Some(read) = code.get(at..).and_then(|rest| Instruction::read(address + at as u32, rest)) {
                if is_code(read.address) {
                    at += read.bytes as usize;
                    instructions.push(read);
                } else {
                    at += 2;
                }
            }
            functions.insert(address, Function { names: vec![name], instructions, end: address + bytes as u32 });
        }
        ensure!(!functions.is_empty(), "the image has no symbols");
        Ok(Self(functions))
    }

    /// Every function with its address.
    pub(crate) fn functions(&self) -> impl Iterator<Item = (u32, &Function)> {
        self.0.iter().map(|(address, function)| (*address, function))
    }

    /// The function that begins there.
    pub(crate) fn at(&self, address: u32) -> Option<&Function> {
        self.0.get(&address)
    }

    /// Where a linker's bridge leads; `None` for any other function.
    pub(crate) fn beyond(&self, function: &Function) -> Option<u32> {
        let meant = function.names.iter().find_map(|name| name.split_once(FAR))?.1;
        self.address(meant)
    }

    /// True if an address lies in a function, between its first instruction and its last.
    pub(crate) fn is_inside(&self, address: u32) -> bool {
        let function = self.0.range(..=address).next_back().and_then(|(_, function)| function.instructions.last());
        function.is_some_and(|last| address < last.address + last.bytes)
    }

    /// Where the function of this name begins; the name as the compiler encodes it.
    pub(crate) fn address(&self, name: &str) -> Option<u32> {
        self.functions().find(|(_, function)| function.names.iter().any(|known| known == name)).map(|found| found.0)
    }
}

/// A name as a person writes it, without the hash at its end.
fn readable(name: &str) -> String {
    let name = name.split_once(FAR).map_or(name, |(_, meant)| meant);
    format!("{:#}", rustc_demangle::demangle(name))
}
