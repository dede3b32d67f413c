//! Each kind of dead word is found, and what is alive or none of our business is not.

use super::check;

/// A catalogue with two entries: each a row that leads to a section.
const CATALOGUE: &str = "# Faults

| id | today |
|---|---|
| [A8](#a8) | **held** |
| [B12](#b12) | **part**: `b12_in_its_row` |

### A8

Two tests:

- `a8_a_stuck_encoder_stops_the_arm`
- `a8_b12_stop`

### B12

- `a8_b12_stop`, and `b12_in_its_section` of `a8_of_the_other`

## Storms

No entry: `b12_behind_the_entries`.
";

/// A small repository: a catalogue, a guide, a decision, a package with a test, and the files of the test.
fn repository(more: &[(&str, String)]) -> Vec<(String, String)> {
    let mut files = vec![
        ("docs/faults.md".to_owned(), CATALOGUE.to_owned()),
        ("docs/guide.md".to_owned(), "# Guide\n\n## Two words, and `code`\n".to_owned()),
        ("docs/decisions/0007-seven.md".to_owned(), String::new()),
        ("docs/README.md".to_owned(), "[f](faults.md) [g](guide.md) [7](decisions/0007-seven.md) [a](a.md)".to_owned()),
        ("crates/arm/Cargo.toml".to_owned(), String::new()),
        ("crates/arm/src/lib.rs".to_owned(), "pub const fn limit() {}\n".to_owned()),
        ("crates/arm/tests/all.rs".to_owned(), "    fn a8_a_stuck_encoder_stops_the_arm() {}\n".to_owned()),
        ("README.md".to_owned(), String::new()),
    ];
    if more.iter().all(|(path, _)| *path != "docs/a.md") {
        files.push(("docs/a.md".to_owned(), String::new()));
    }
    files.extend(more.iter().map(|(path, text)| ((*path).to_owned(), text.clone())));
    files
}

/// Returns the findings in a file with this text.
fn found(path: &str, text: impl Into<String>) -> Vec<String> {
    check(&repository(&[(path, text.into())])).into_iter().map(|dead| dead.text).collect()
}

/// Returns the findings in a repository with this catalogue.
fn in_catalogue(catalogue: &str) -> Vec<String> {
    let mut files = repository(&[]);
    files.retain(|(path, _)| path != "docs/faults.md");
    files.push(("docs/faults.md".to_owned(), catalogue.to_owned()));
    check(&files).into_iter().map(|dead| dead.text).collect()
}

/// Passes with `alive`, and fails in its first line, naming `dead`, when that stands in its place.
fn tells_apart(path: &str, alive: &str, dead: &str, cause: &str) {
    assert_eq!(found(path, alive), Vec::<String>::new(), "{alive}");
    let causes = found(path, dead);
    assert_eq!(causes.len(), 1, "{dead}: {causes:?}");
    assert!(causes[0].starts_with(&format!("{path}:1: ")) && causes[0].contains(cause), "{causes:?}");
}

#[test]
fn links_lead_to_files_folders_and_headings() {
    tells_apart("a.md", "[a](docs/guide.md)", "[a](crates/gone.md)", "dead link 'crates/gone.md'");
    tells_apart("docs/a.md", "[a](guide.md) [b](../README.md) [c](decisions/)", "[a](docs/guide.md)", "dead link");
    tells_apart("a.md", "[a](docs/guide.md#two-words-and-code)", "[a](docs/guide.md#two)", "no heading '#two'");
    tells_apart("docs/a.md", "[a][b]\n\n[b]: guide.md", "[b]: gone.md", "dead link 'gone.md'");
    tells_apart("a.md", "[a](docs)", "[a](../a.md)", "dead link '../a.md'");
    assert_eq!(
        found("a.md", "[a](https://example.org/x) [b](crate::x) `[c](gone.md)`\n```\n[d](gone.md)\n```"),
        [""; 0]
    );
    assert_eq!(found("a.md", "```\n[d](gone.md)\n```\n\n[d](gone.md)"), ["a.md:5: dead link 'gone.md'"]);
}

#[test]
fn paths_in_code_spans_and_comments_are_there() {
    tells_apart("a.md", "`crates/arm/src/lib.rs`", "`crates/arm/src/leg.rs`", "'crates/arm/src/leg.rs'");
    tells_apart("a.md", "`crates/arm/{src,tests}`", "`crates/arm/{src,benches}`", "benches");
    tells_apart("a.md", "`docs/decisions/000*.md`, `crates/*/src`", "`docs/decisions/9*.md`", "9*.md");
    tells_apart("crates/arm/src/a.rs", "// see crates/arm/src/lib.rs:1.", "// see crates/leg.", "'crates/leg'");
    tells_apart("crates/arm/src/a.rs", "let p = \"crates/leg\";", "//! As crates/leg: x", "'crates/leg'");
    // Relative to the package of the file that names it.
    tells_apart("crates/arm/docs/b.md", "`docs/b.md`", "`docs/c.md`", "'docs/c.md'");
    assert_eq!(
        found("a.md", "`docs/decisions/NNNN-title.md` `docs/{name}.md` `target/x` `a/b` `cargo run crates/x`"),
        [""; 0]
    );
}

#[test]
fn documents_are_checked_in_any_file_and_messages_too() {
    tells_apart("crates/arm/src/a.rs", "f(\"see docs/guide.md\");", "f(\"see docs/gone.md\");", "'docs/gone.md'");
    tells_apart("deny.toml", "# docs/guide.md, docs/decisions/0007", "# (docs/gone.md)", "'docs/gone.md'");
    tells_apart("a.md", "```\nless docs/guide.md\n```", "less docs/gone.md", "'docs/gone.md'");
    tells_apart("a.yml", "# decision 0007", "# Decision 0008.", "no decision 0008");
}

#[test]
fn fault_identifiers_are_those_of_the_catalogue() {
    let test = |name: &str| format!("fn {name}() {{}}");
    tells_apart("crates/arm/tests/b.rs", &test("a8_b12_stop"), &test("g3_stop"), "no fault G3");
    tells_apart("crates/arm/tests/b.rs", &test("a8_b12_stop"), &test("b12_halt"), "does not name b12_halt under B12");
    tells_apart("crates/arm/tests/b.rs", &(test("f32_is_no_fault") + &test("d3")), &test("f1_is_one"), "no fault F1");
    tells_apart("crates/arm/src/a.rs", "/// A8: stuck", "/// A9: stuck", "no fault A9");
    tells_apart("crates/arm/src/a.rs", "// at rest (A8, B12)", "// at rest (A8, B13)", "no fault B13");
    tells_apart("crates/arm/src/a.rs", "// (faults A8 to B12).", "// (faults A8 to B13).", "no fault B13");
    tells_apart("a.md", "stuck (A8) pin (PD0) E999 (A7.7)", "stuck (A7)", "no fault A7");
    assert_eq!(found("crates/arm/src/a.rs", "let x = f(A9);"), [""; 0], "code is no comment");
}

#[test]
fn a_test_is_named_by_the_row_or_the_section_of_its_entry() {
    let test = |name: &str| found("crates/arm/tests/b.rs", format!("fn {name}() {{}}"));
    for named in ["a8_b12_stop", "b12_in_its_row", "b12_in_its_section"] {
        assert_eq!(test(named), [""; 0], "{named}");
    }
    for (elsewhere, entry) in [
        ("a8_of_the_other", "A8"),
        ("b12_behind_the_entries", "B12"),
        ("b12_in_its", "B12"),
        ("a8_a_stuck_encoder_stops", "A8"),
    ] {
        let cause = format!("crates/arm/tests/b.rs:1: docs/faults.md does not name {elsewhere} under {entry}");
        assert_eq!(test(elsewhere), [cause]);
    }
}

#[test]
fn a_name_in_the_section_of_an_entry_is_a_function() {
    let gone = CATALOGUE.replace("Two tests:", "`a8_a_stuck_encoder_that_is_gone`");
    assert_eq!(in_catalogue(&gone), ["docs/faults.md:10: no function 'a8_a_stuck_encoder_that_is_gone'"]);
}

#[test]
fn every_row_has_one_section_and_every_section_one_row() {
    let a_row = "| [B12](#b12) | **part**: `b12_in_its_row` |\n";
    for (from, to, cause) in [
        (a_row, "", "docs/faults.md:14: the section B12 has no row"),
        ("### B12", "### B13", "docs/faults.md:6: no heading '#b12' in docs/faults.md"),
        ("### B12", "### B12 and more", "docs/faults.md:6: the row B12 has no section"),
        ("## Storms", "### B12", "docs/faults.md:19: the section B12 stands there twice"),
        (a_row, &a_row.repeat(2), "docs/faults.md:7: the row B12 stands there twice"),
        ("[B12](#b12)", "B12", "docs/faults.md:6: the row B12 does not lead to '#b12'"),
        ("(#b12)", "(#a8)", "docs/faults.md:6: the row B12 does not lead to '#b12'"),
    ] {
        let causes = in_catalogue(&CATALOGUE.replacen(from, to, 1));
        assert!(causes.iter().any(|found| found == cause), "{from} to {to}: {causes:?}");
    }
    let fenced = CATALOGUE.replace("## Storms", "```\n### C1\n| C2 | row |\n```\n\n## Storms");
    assert_eq!(in_catalogue(&fenced), [""; 0], "an example is no entry");
}

#[test]
fn test_names_in_documents_are_functions() {
    let alive = "`a8_a_stuck_encoder_stops_the_arm` `a_b_c` `limit`";
    tells_apart("a.md", alive, "`a8_a_stuck_encoder_stops_the_leg`", "no function");
}

#[test]
fn every_document_is_in_the_index() {
    let more = [("docs/a.md", String::new()), ("docs/new.md", String::new()), ("crates/arm/new.md", String::new())];
    let causes: Vec<String> = check(&repository(&more)).into_iter().map(|dead| dead.text).collect();
    assert_eq!(causes, ["docs/README.md does not list new.md"]);
}

#[test]
fn a_catalogue_without_identifiers_is_an_error() {
    let mut files = repository(&[]);
    assert!(check(&files).is_empty());
    files.retain(|(path, _)| path != "docs/faults.md");
    let causes: Vec<String> = check(&files).into_iter().map(|dead| dead.text).collect();
    assert!(causes.iter().any(|cause| cause.contains("defines no fault")), "{causes:?}");
    assert!(causes.iter().any(|cause| cause.contains("no fault A8")), "{causes:?}");
}
