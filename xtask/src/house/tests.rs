//! Each violation is found, and what is right beside it is not.

use super::{Finding, arrows, circles, programs, sizes, words};

fn files(files: &[(&str, &str)]) -> Vec<(String, String)> {
    files.iter().map(|(path, text)| ((*path).to_owned(), (*text).to_owned())).collect()
}

/// The findings as lines.
fn lines(found: Vec<Finding>) -> Vec<String> {
    found.into_iter().map(|finding| format!("{}: {}", finding.place, finding.text)).collect()
}

/// Findings of the circle check in a crate with these modules; `lib.rs` declares the names before the first slash.
fn circles_in(modules: &[(&str, &str)]) -> Vec<String> {
    let named: Vec<String> = modules.iter().map(|(name, _)| format!("c/src/{name}.rs")).collect();
    let all: Vec<_> = named.iter().zip(modules).map(|(path, (_, text))| (path.as_str(), *text)).collect();
    lines(circles::check(&files(&all)))
}

#[test]
fn modules_that_name_each_other_are_a_circle() {
    let lib = ("lib", "mod a; mod b; mod c;");
    let b = ("b", "pub struct B; fn f(_: super::a::A) {}");
    assert_eq!(
        circles_in(&[lib, ("a", "use crate::b::B;\npub struct A;"), b]),
        ["c/src/lib.rs: module circle: c/src/a.rs:1 names c/src/b.rs, c/src/b.rs:1 names c/src/a.rs"]
    );
    assert_eq!(circles_in(&[lib, ("a", "pub struct A;"), b]), [""; 0]);
    // A longer way round.
    let longer = [lib, ("a", "use crate::c::C;"), ("b", "use crate::a::A;"), ("c", "use crate::b::B;")];
    assert_eq!(circles_in(&longer).len(), 1);
}

#[test]
fn a_circle_through_a_re_export_a_glob_an_alias_or_a_macro_is_found() {
    let b = ("b", "pub struct B; use crate::a::A;");
    for (lib, a) in [
        ("mod a; mod b; pub use b::B;", "use crate::B;"),
        ("mod a; mod b; pub use b::*;", "pub struct A(crate::B);"),
        ("mod a; mod b; use b as other;", "fn f() { crate::other::B; }"),
        ("mod a; mod b;", "fn f() { println!(\"{:?}\", [crate::b::B]); }"),
        ("mod a; mod b;", "use super::b; fn f() { b::B; }"),
    ] {
        assert_eq!(circles_in(&[("lib", lib), ("a", a), b]).len(), 1, "{lib} {a}");
    }
}

#[test]
fn a_circle_through_an_inline_module_is_found() {
    let lib = ("lib", "mod a; mod b;");
    let b = ("b", "pub struct B; use crate::a::A;");
    for a in [
        "mod inner { use super::super::b::B; }",
        "mod inner { mod innermost { fn f(_: super::super::super::b::B) {} } }",
        "mod inner { use crate::b::B; }",
    ] {
        assert_eq!(circles_in(&[lib, ("a", a), b]).len(), 1, "{a}");
    }
    // What is above an inline module is its own file.
    let a =
        ("a", "pub struct A; mod inner { use super::A; use super::*; pub(super) use self::other::C; mod other {} }");
    assert_eq!(circles_in(&[lib, a, ("b", "use crate::a::A;")]), [""; 0]);
}

#[test]
fn tests_do_not_make_a_circle() {
    let lib = ("lib", "mod a; mod b;");
    let a = ("a", "#[cfg(test)] mod tests { use crate::b::B; }\n#[cfg(all(test, unix))] fn f(_: crate::b::B) {}");
    assert_eq!(circles_in(&[lib, a, ("b", "use crate::a::A;")]), [""; 0]);
    let a = ("a", "#[cfg(not(test))] fn f(_: crate::b::B) {}");
    assert_eq!(circles_in(&[lib, a, ("b", "use crate::a::A;")]).len(), 1);
}

#[test]
fn a_folder_is_one_room_inside_and_one_module_outside() {
    let lib = ("lib", "mod room; mod other;");
    let other = ("other", "pub struct O;");
    let room = ("room/mod", "mod first; mod second; pub struct R; use first::F;");
    let second = ("room/second", "pub struct S;");
    // The file of the room and a file in it.
    assert_eq!(circles_in(&[lib, other, room, ("room/first", "use super::R; use super::second::S;"), second]), [""; 0]);
    // Two files in it.
    let circle = ("room/second", "pub struct S; use super::first::F;");
    assert_eq!(circles_in(&[lib, other, room, ("room/first", "use super::second::S;"), circle]).len(), 1);
    // A file in it and one outside.
    let back = ("other", "pub struct O; use crate::room::second::S;");
    assert_eq!(circles_in(&[lib, back, room, ("room/first", "use crate::other::O;"), second]).len(), 1);
}

#[test]
fn files_functions_and_comments_have_a_largest_size() {
    let check = |text: &str| lines(sizes::check(&files(&[("a.rs", text)])));
    assert_eq!(check(&"\n".repeat(600)), [""; 0]);
    assert_eq!(check(&"\n".repeat(601)), ["a.rs: 601 lines; at most 600"]);
    let function = |lines: usize| format!("/// Long.\nimpl A {{ fn f() {{{}}} }}", "\n".repeat(lines - 1));
    assert_eq!(check(&function(80)), [""; 0]);
    assert_eq!(check(&function(81)), ["a.rs:2: function 'f' of 81 lines; at most 80"]);
    let in_a_macro = |lines: usize| format!("proptest! {{ fn f(x in 0..9) {{{}}} }}", "\n".repeat(lines - 1));
    assert_eq!(check(&in_a_macro(80)), [""; 0]);
    assert_eq!(check(&in_a_macro(81)), ["a.rs:1: function 'f' of 81 lines; at most 80"]);
    assert_eq!(check(&format!("// {}", "é".repeat(117))), [""; 0]);
    assert_eq!(check(&format!("\n// {}", "é".repeat(118))), ["a.rs:2: comment of 121 columns; at most 120"]);
}

#[test]
fn old_words_are_found_where_they_are_old() {
    let check = |path: &str, text: &str| lines(words::check(&files(&[(path, text)])));
    assert_eq!(check("crates/device/src/a.rs", "struct Core;"), ["crates/device/src/a.rs:1: 'Core'; use Controller"]);
    for (path, text) in [
        ("crates/device/src/a.rs", "struct CoreRegisters; use core::fmt;"),
        ("emulator/board/src/core.rs", "struct Core;"),
        ("a.md", "Core values of a person"),
        ("docs/decisions/NNNN-a.md", "`FitPrimitive`"),
    ] {
        assert_eq!(check(path, text), [""; 0], "{path}");
    }
    assert_eq!(check("a.md", "see `FitPrimitive`"), ["a.md:1: 'FitPrimitive'; use CheckedPrimitive"]);
    assert_eq!(check("a.toml", "# Before the story begins").len(), 1);
    assert_eq!(
        check("a.rs", "    /// Whether it moves."),
        ["a.rs:1: doc line opens with 'Whether'; \"True if\" or \"True while\""]
    );
    assert_eq!(check("a.rs", "// What it is\n/// Whatever\n/// Which of them.\nlet a = \"/// What \";"), [""; 0]);
}

#[test]
fn a_file_of_tests_that_no_program_has_is_found() {
    let check = |main: &str, other: &str| lines(programs::check(&files(&[("a/tests/main.rs", main), (other, "")])));
    assert_eq!(check("mod b;\n", "a/tests/b.rs"), [""; 0]);
    assert_eq!(check("mod bc;\n", "a/tests/b.rs"), ["a/tests/b.rs: never run: 'mod b;' is not in a/tests/main.rs"]);
    assert_eq!(check("", "a/tests/common/mod.rs"), [""; 0], "a folder is a module of what names it");
    assert_eq!(check("", "c/tests/b.rs"), [""; 0], "a program of its own");
}

#[test]
fn a_test_that_needs_the_world_in_a_program_without_it_is_found() {
    let check = |path: &str, text: &str| lines(programs::check(&files(&[(path, text)])));
    let asks = "#[cfg(feature = \"mujoco\")]\nmod b;\n";
    assert_eq!(check("host/tests/b.rs", asks).len(), 1);
    assert_eq!(check("crates/sim/tests/b.rs", asks), [""; 0]);
    assert_eq!(check("host/tests/b.rs", "mod b;\n"), [""; 0]);
    assert_eq!(check("host/src/b.rs", asks), [""; 0], "what is no test is compiled with the rest");
}

#[test]
fn arrows_of_manifests_and_table_are_compared_both_ways() {
    let table = |second: &str| {
        let text = format!("| crate | depends on |\n|---|---|\n| `a` | |\n| `b` | {second} |\n\n| `c` | `a` |\n");
        arrows::from_table(&text)
    };
    let real = table("`a`");
    assert_eq!(real.len(), 2, "a table without the column is none");
    let differences = |left: &arrows::Arrows, right: &arrows::Arrows| lines(arrows::compare(left, right));
    assert_eq!(differences(&real, &table("`a`")), [""; 0]);
    assert_eq!(
        differences(&real, &table("")),
        ["docs/architecture.md: 'b' depends on 'a'; the table says it does not"]
    );
    assert_eq!(
        differences(&table(""), &real),
        ["docs/architecture.md: 'b' does not depend on 'a'; the table says it does"]
    );
    let mut more = real.clone();
    more.insert("d".to_owned(), std::iter::once("a".to_owned()).collect());
    assert_eq!(differences(&more, &real), ["docs/architecture.md: the table lacks 'd'"]);
    assert_eq!(differences(&real, &more), ["docs/architecture.md: there is no package 'd'"]);
}
