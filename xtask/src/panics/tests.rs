//! The search on a tiny image made by hand: constants amid code, inlined functions, joined ends, a dropped function.

use gimli::write::{Address, AttributeValue, DwarfUnit, EndianVec, LineProgram, LineString, Sections, UnitEntryId};
use gimli::{Encoding, Format, LineEncoding, LittleEndian};
use object::write::{Object, Symbol, SymbolSection};
use object::{Architecture, BinaryFormat, Endianness, SectionKind, SymbolFlags, SymbolKind, SymbolScope};

use super::kind::Kind;
use super::site::{self, Site};
use super::unknown;
use crate::board::Board;
use crate::elf::Elf;

const PANIC: &str = "_ZN4core9panicking18panic_bounds_check17h0123456789abcdefE";
const THUNK: &str = "__Thumbv7ABSLongThunk__ZN4core9panicking18panic_bounds_check17h0123456789abcdefE";

/// The code, by halves. The handler begins at 0x10, the function for giving up at 0x40, the bridge to it at 0x44.
const CODE: [(usize, &[u16]); 4] = [
    // cbz r0, 0x1c; cbz r1, 0x1c; bx lr; nop; a constant that reads `bl 0x40`; bl 0x40; udf #254
    (0x10, &[0xB120, 0xB119, 0x4770, 0xBF00, 0xF000, 0xF812, 0xF000, 0xF810, 0xDEFE]),
    // b .
    (0x40, &[0xE7FE, 0xBF00]),
    // bx r12
    (0x44, &[0x4760, 0xBF00]),
    // bl 0x44; b.w 0x40
    (0x48, &[0xF7FF, 0xFFFC, 0xF7FF, 0xBFF8]),
];

const TEXT_BYTES: u64 = 0x60;

fn text() -> Vec<u8> {
    let mut text = vec![0; TEXT_BYTES as usize];
    for (at, halves) in CODE {
        for (place, byte) in text[at..].iter_mut().zip(halves.iter().flat_map(|half| half.to_le_bytes())) {
            *place = byte;
        }
    }
    text
}

/// An entry below `parent` with a name.
fn entry(dwarf: &mut DwarfUnit, parent: UnitEntryId, tag: gimli::DwTag, name: &str) -> UnitEntryId {
    let entry = dwarf.unit.add(parent, tag);
    dwarf.unit.get_mut(entry).set(gimli::DW_AT_name, AttributeValue::String(name.into()));
    entry
}

fn place(dwarf: &mut DwarfUnit, entry: UnitEntryId, begin: u64, bytes: u64) {
    let entry = dwarf.unit.get_mut(entry);
    entry.set(gimli::DW_AT_low_pc, AttributeValue::Address(Address::Constant(begin)));
    entry.set(gimli::DW_AT_high_pc, AttributeValue::Udata(bytes));
}

/// `arm::handler` with `link::frame::take` and `cobs::dec::decode` inlined, one branch each; and a function that was
/// dropped, whose debug information lies over all of it.
fn debug_information() -> DwarfUnit {
    let encoding = Encoding { format: Format::Dwarf32, version: 4, address_size: 4 };
    let mut dwarf = DwarfUnit::new(encoding);
    let string = |text: &str| LineString::String(text.into());
    let mut lines = LineProgram::new(encoding, LineEncoding::default(), string("here"), None, string("main.rs"), None);
    let folder = lines.default_directory();
    let file = lines.add_file(string("main.rs"), folder, None);
    let handler = (0x10, &[(0, 7), (2, 9), (4, 30), (12, 0)][..], CODE[0].1.len() as u64 * 2);
    let dropped = (0, &[(0, 98), (0x1C, 99)][..], 0x50);
    for (begin, rows, end) in [handler, dropped] {
        lines.begin_sequence(Some(Address::Constant(begin)));
        for (offset, line) in rows {
            lines.row().address_offset = *offset;
            lines.row().file = file;
            lines.row().line = *line;
            lines.generate_row();
        }
        lines.end_sequence(end);
    }
    dwarf.unit.line_program = lines;
    let root = dwarf.unit.root();
    let mut inlined = Vec::new();
    for (path, begin) in
        [(["link", "frame", "{impl#0}", "take<u8>"], 0x10), (["cobs", "dec", "{impl#1}", "decode"], 0x12)]
    {
        let [outer, module, implementation, function] = path;
        let outer = entry(&mut dwarf, root, gimli::DW_TAG_namespace, outer);
        let module = entry(&mut dwarf, outer, gimli::DW_TAG_namespace, module);
        let implementation = entry(&mut dwarf, module, gimli::DW_TAG_namespace, implementation);
        inlined.push((entry(&mut dwarf, implementation, gimli::DW_TAG_subprogram, function), begin));
    }
    let arm = entry(&mut dwarf, root, gimli::DW_TAG_namespace, "arm");
    let handler = entry(&mut dwarf, arm, gimli::DW_TAG_subprogram, "handler");
    place(&mut dwarf, handler, 0x10, CODE[0].1.len() as u64 * 2);
    for (function, begin) in inlined {
        let copy = dwarf.unit.add(handler, gimli::DW_TAG_inlined_subroutine);
        dwarf.unit.get_mut(copy).set(gimli::DW_AT_abstract_origin, AttributeValue::UnitRef(function));
        place(&mut dwarf, copy, begin, 2);
    }
    let dropped = entry(&mut dwarf, root, gimli::DW_TAG_subprogram, "dropped");
    place(&mut dwarf, dropped, 0, 0x50);
    dwarf
}

fn image() -> Vec<u8> {
    let mut image = Object::new(BinaryFormat::Elf, Architecture::Arm, Endianness::Little);
    let section = image.add_section(Vec::new(), b".text".to_vec(), SectionKind::Text);
    image.append_section_data(section, &text(), 4);
    let mut symbol = |name: &str, value, size, kind| {
        image.add_symbol(Symbol {
            name: name.into(),
            value,
            size,
            kind,
            scope: SymbolScope::Compilation,
            weak: false,
            section: SymbolSection::Section(section),
            flags: SymbolFlags::None,
        });
    };
    symbol("handler", 0x11, CODE[0].1.len() as u64 * 2, SymbolKind::Text);
    symbol(PANIC, 0x41, 2, SymbolKind::Text);
    symbol(THUNK, 0x45, 2, SymbolKind::Text);
    symbol("assembly", 0x49, 8, SymbolKind::Text);
    for (name, value) in [("$t", 0x10), ("$d.1", 0x18), ("$t.2", 0x1C), ("$t", 0x40)] {
        symbol(name, value, 0, SymbolKind::Label);
    }
    let mut dwarf = debug_information();
    let mut sections = Sections::new(EndianVec::new(LittleEndian));
    dwarf.write(&mut sections).expect("the debug information is complete");
    sections
        .for_each(|id, data| {
            let section = image.add_section(Vec::new(), id.name().into(), SectionKind::Debug);
            image.append_section_data(section, data.slice(), 1);
            Ok::<(), gimli::write::Error>(())
        })
        .expect("the sections are written");
    image.write().expect("the image is complete")
}

fn sites() -> Vec<Site> {
    let image = image();
    site::find(&Elf::parse(&*image).expect("an ELF file")).expect("code and debug information")
}

#[test]
fn calls_jumps_and_bridges_are_found_and_constants_are_not() {
    let found: Vec<String> = sites().into_iter().map(|site| site.function).collect();
    assert_eq!(found, ["handler", "assembly", "assembly"]);
    assert!(sites().iter().all(|site| site.origins.iter().all(|origin| origin.kind == Kind::Index)));
}

#[test]
fn a_bridge_has_the_name_of_what_it_leads_to() {
    for site in sites() {
        assert_eq!(site.target, "core::panicking::panic_bounds_check");
    }
}

#[test]
fn joined_ends_belong_to_the_inlined_functions_that_lead_there() {
    let origins = sites().swap_remove(0).origins;
    let expected = [("cobs::dec::decode", "main.rs:9"), ("link::frame::take", "main.rs:7")];
    let found: Vec<(&str, &str)> =
        origins.iter().map(|origin| (origin.function.as_str(), origin.line.trim_start_matches("here/"))).collect();
    assert_eq!(found, expected);
}

#[test]
fn code_without_debug_information_has_its_symbol() {
    let names: Vec<String> = sites().swap_remove(1).origins.into_iter().map(|origin| origin.function).collect();
    assert_eq!(names, ["assembly"]);
}

#[test]
fn what_is_not_listed_is_named_with_its_line_and_what_is_listed_is_not() {
    let said = unknown(&sites()[0], Board::Mps2).expect("nothing in `link` may panic");
    for part in ["link::frame::take (index, ", "main.rs:7)", "core::panicking::panic_bounds_check", "in handler"] {
        assert!(said.contains(part), "{said}");
    }
    assert!(!said.contains("cobs"), "{said}");
}
