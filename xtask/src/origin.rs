//! Whose source an instruction comes from, through every function that was inlined there: the debug information of an
//! image (DWARF).
//!
//! Dropped functions keep their debug information, moved to address 0, where on some boards real code lies: only
//! functions that are in the symbol table count, and only line tables that do not begin at 0.

use std::borrow::Cow;
use std::collections::{BTreeMap, HashMap};

use anyhow::Result;
use gimli::{AttributeValue, DebugInfoOffset, EndianSlice, LittleEndian};
use object::{Object as _, ObjectSection as _};

use crate::code::Code;
use crate::elf::Elf;
use crate::shell;

type Slice<'a> = EndianSlice<'a, LittleEndian>;
type Unit<'a> = gimli::Unit<Slice<'a>>;
type Entry<'e, 'a> = gimli::DebuggingInformationEntry<'e, 'e, Slice<'a>>;

/// Addresses of a function, or of one that was inlined into it.
struct Scope {
    begin: u32,
    end: u32,
    /// Levels of the tree above it: what is inlined is deeper.
    depth: isize,
    function: DebugInfoOffset,
    /// Where it was called, if it is inlined.
    called: Option<Place>,
}

/// A function whose source an instruction is.
pub(crate) struct Frame {
    /// `crate::module::Type::function`, without type parameters.
    pub(crate) name: String,
    /// File and line in it; empty if not known.
    pub(crate) line: String,
}

/// Origin of a function: its own path, or that of its declaration.
struct Declaration {
    path: String,
    means: Option<DebugInfoOffset>,
}

/// A line of the source.
#[derive(Clone, Copy)]
struct Place {
    file: usize,
    line: u32,
}

/// The debug information of an image.
pub(crate) struct Origins {
    scopes: Vec<Scope>,
    declarations: HashMap<DebugInfoOffset, Declaration>,
    files: Vec<String>,
    /// The line in force from an address on; `None` where code ends that has lines, line 0 where the compiler joined
    /// code of several.
    lines: BTreeMap<u32, Option<Place>>,
}

impl Origins {
    /// Reads the debug information of the functions in `code`.
    ///
    /// # Errors
    /// If it is damaged. An image without any is not an error: nothing is known then.
    pub(crate) fn of(file: &Elf<'_>, code: &Code) -> Result<Self> {
        let sections = gimli::DwarfSections::load(|section| -> Result<Cow<'_, [u8]>> {
            let found = file.section_by_name(section.name());
            Ok(found.map(|section| section.data()).transpose()?.unwrap_or_default().into())
        })?;
        let dwarf = sections.borrow(|section| EndianSlice::new(section, LittleEndian));
        let mut origins =
            Self { scopes: Vec::new(), declarations: HashMap::new(), files: Vec::new(), lines: BTreeMap::new() };
        let mut headers = dwarf.units();
        while let Some(header) = headers.next()? {
            let unit = dwarf.unit(header)?;
            let files = origins.read_files(&dwarf, &unit)?;
            origins.read_functions(&dwarf, &unit, code, &files)?;
            origins.read_lines(&unit, &files)?;
        }
        Ok(origins)
    }

    /// The functions whose source the instruction is, innermost first.
    pub(crate) fn path(&self, address: u32) -> Vec<Frame> {
        let mut scopes: Vec<&Scope> =
            self.scopes.iter().filter(|scope| (scope.begin..scope.end).contains(&address)).collect();
        scopes.sort_by_key(|scope| -scope.depth);
        let mut place = self.lines.range(..=address).next_back().and_then(|(_, place)| *place);
        let mut path = Vec::new();
        for scope in scopes {
            let line = place.map(|place| self.line(place)).unwrap_or_default();
            path.extend(self.name(scope.function).map(|name| Frame { name, line }));
            place = scope.called;
        }
        path
    }

    /// True if the compiler joined the code of several places into this instruction, so that its path is only what they
    /// share.
    pub(crate) fn is_joined(&self, address: u32) -> bool {
        self.lines.range(..=address).next_back().and_then(|(_, place)| *place).is_some_and(|place| place.line == 0)
    }

    fn line(&self, place: Place) -> String {
        format!("{}:{}", self.files.get(place.file).map(String::as_str).unwrap_or_default(), place.line)
    }

    fn name(&self, function: DebugInfoOffset) -> Option<String> {
        let mut declaration = self.declarations.get(&function)?;
        // An inlined copy refers to its body, that to its declaration.
        for _ in 0..4 {
            match declaration.means.and_then(|means| self.declarations.get(&means)) {
                Some(meant) => declaration = meant,
                None => break,
            }
        }
        Some(declaration.path.clone())
    }

    fn read_functions<'a>(
        &mut self,
        dwarf: &gimli::Dwarf<Slice<'a>>,
        unit: &Unit<'a>,
        code: &Code,
        files: &HashMap<u64, usize>,
    ) -> Result<()> {
        let mut entries = unit.entries();
        let mut depth = 0;
        // The names of the entries above, and how deep in the tree the function is whose inside this is.
        let mut above: Vec<(isize, String)> = Vec::new();
        let mut inside: Option<isize> = None;
        while let Some((step, entry)) = entries.next_dfs()? {
            depth += step;
            above.retain(|(level, _)| *level < depth);
            inside = inside.filter(|level| *level < depth);
            let is_function = entry.tag() == gimli::DW_TAG_subprogram;
            let is_inlined = entry.tag() == gimli::DW_TAG_inlined_subroutine;
            if let Some(offset) =
                entry.offset().to_debug_info_offset(&unit.header).filter(|_| is_function || is_inlined)
            {
                let mut path: Vec<String> = above.iter().map(|(_, name)| name.clone()).collect();
                path.extend(name(dwarf, unit, entry)?);
                path.retain(|segment| !segment.is_empty());
                self.declarations.insert(offset, Declaration { path: path.join("::"), means: meant(unit, entry)? });
                let called = called(entry, files)?;
                let mut ranges = dwarf.die_ranges(unit, entry)?;
                let mut is_first = true;
                while let Some(range) = ranges.next()? {
                    let (begin, end) = (range.begin as u32, range.end as u32);
                    if is_function && is_first && code.at(begin).is_some() {
                        inside = Some(depth);
                    }
                    is_first = false;
                    if inside.is_some() {
                        self.scopes.push(Scope { begin, end, depth, function: offset, called });
                    }
                }
            }
            if !is_inlined && entry.tag() != gimli::DW_TAG_lexical_block {
                above.push((depth, name(dwarf, unit, entry)?.unwrap_or_default()));
            }
        }
        Ok(())
    }

    fn read_lines<'a>(&mut self, unit: &Unit<'a>, files: &HashMap<u64, usize>) -> Result<()> {
        let Some(program) = unit.line_program.clone() else { return Ok(()) };
        let mut rows = program.rows();
        let (mut begins, mut is_dropped) = (true, false);
        while let Some((_, row)) = rows.next_row()? {
            let address = row.address() as u32;
            if begins {
                is_dropped = address == 0;
            }
            begins = row.end_sequence();
            if is_dropped {
                continue;
            }
            if row.end_sequence() {
                self.lines.entry(address).or_insert(None);
            } else {
                let line = row.line().map_or(0, |line| line.get() as u32);
                let file = files.get(&row.file_index()).copied();
                self.lines.insert(address, file.map(|file| Place { file, line }));
            }
        }
        Ok(())
    }

    /// The unit's files by the numbers it has for them.
    fn read_files<'a>(&mut self, dwarf: &gimli::Dwarf<Slice<'a>>, unit: &Unit<'a>) -> Result<HashMap<u64, usize>> {
        let mut known = HashMap::new();
        let Some(program) = &unit.line_program else { return Ok(known) };
        let header = program.header();
        // Counted from 1 up to version 4, from 0 since; one more than there are is none.
        for number in 0..=header.file_names().len() as u64 {
            let Some(file) = header.file(number) else { continue };
            let mut path = shell::root();
            if let Some(folder) = file.directory(header) {
                path.push(dwarf.attr_string(unit, folder)?.to_string_lossy().as_ref());
            }
            path.push(dwarf.attr_string(unit, file.path_name())?.to_string_lossy().as_ref());
            let path = path.strip_prefix(shell::root()).unwrap_or(&path).display().to_string();
            known.insert(number, self.files.len());
            self.files.push(path);
        }
        Ok(known)
    }
}

/// Name of a module, type or function; empty for what has none that stays the same (`{impl#3}`, `{closure#0}`).
fn name<'a>(dwarf: &gimli::Dwarf<Slice<'a>>, unit: &Unit<'a>, entry: &Entry<'_, 'a>) -> Result<Option<String>> {
    let is_named = matches!(
        entry.tag(),
        gimli::DW_TAG_namespace
            | gimli::DW_TAG_subprogram
            | gimli::DW_TAG_structure_type
            | gimli::DW_TAG_enumeration_type
            | gimli::DW_TAG_union_type
    );
    let Some(name) = entry.attr_value(gimli::DW_AT_name)?.filter(|_| is_named) else { return Ok(None) };
    let name = dwarf.attr_string(unit, name)?;
    let name = name.to_string_lossy();
    let plain = name.split('<').next().unwrap_or_default();
    Ok((!plain.starts_with('{')).then(|| plain.to_owned()))
}

/// Where an inlined function was called.
fn called(entry: &Entry<'_, '_>, files: &HashMap<u64, usize>) -> Result<Option<Place>> {
    let Some(AttributeValue::FileIndex(file)) = entry.attr_value(gimli::DW_AT_call_file)? else { return Ok(None) };
    let line = entry.attr_value(gimli::DW_AT_call_line)?.and_then(|line| line.udata_value()).unwrap_or(0);
    Ok(files.get(&file).map(|file| Place { file: *file, line: line as u32 }))
}

/// The entry that this one is a copy of or declared by.
fn meant<'a>(unit: &Unit<'a>, entry: &Entry<'_, 'a>) -> Result<Option<DebugInfoOffset>> {
    for attribute in [gimli::DW_AT_abstract_origin, gimli::DW_AT_specification] {
        match entry.attr_value(attribute)? {
            Some(AttributeValue::UnitRef(offset)) => return Ok(offset.to_debug_info_offset(&unit.header)),
            Some(AttributeValue::DebugInfoRef(offset)) => return Ok(Some(offset)),
            _ => {}
        }
    }
    Ok(None)
}
