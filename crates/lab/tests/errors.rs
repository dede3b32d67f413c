//! `docs/errors.md` is what the table of errors, the refusals and the faults say.
//!
//! After a change of those: `UPDATE_DOCUMENTS=1 cargo test -p lab --test library errors::` writes the document anew.

use std::fmt::Write as _;
use std::path::Path;

use control::Fault;
use lab::error_code::ErrorCode;
use lab::fault_guide::FaultGuide;
use link::Refusal;

const HEAD: &str = "\
# Errors, refusals and faults

Who reads this: whoever has a number in front of them. This file is written from `crates/lab/src/error_code.rs`,
`crates/link/src/refusal.rs`, `crates/control/src/guard/fault.rs` and `crates/lab/src/fault_guide.rs`; change it there
(`crates/lab/tests/errors.rs`).

A command that fails prints `error[E...]`, the cause and a help line, with `--json` as an object too. The hundreds of the
number are the exit code of the process; E130 ends with exit code 130. Numbers never change.
";

fn table(codes: impl Iterator<Item = ErrorCode>) -> String {
    let mut text = "| code | exit | meaning | usual cause | what to do |\n|---|---|---|---|---|\n".to_owned();
    for code in codes {
        let (exit, meaning, cause) = (code.exit() as u8, code.meaning(), code.cause());
        writeln!(text, "| {code} | {exit} | {meaning} | {cause} | {} |", code.remedy()).expect("a text");
    }
    text
}

fn document() -> String {
    let mut text = HEAD.to_owned();
    text += &format!("\n## Of the tool\n\n{}", table(ErrorCode::ALL.iter().copied()));
    text += "\n## Refusals of the device\n\n";
    text += &table(Refusal::ALL.into_iter().map(ErrorCode::Refused));
    text += "\n## Faults\n\nA fault stops the arm and stays until `tactus stop --clear-fault`; `tactus faults` tells the last one. [faults.md](faults.md) says how each is found.\n\n";
    text += "| fault | name | meaning and what to do | the arm | usual cause | check | how to go on |\n|---|---|---|---|---|---|---|\n";
    for fault in Fault::ALL.into_iter().filter(|fault| *fault != Fault::None) {
        let FaultGuide { reaction, cause, check, clear } = FaultGuide::of(fault);
        let (code, meaning) = (fault.code(), fault.explanation());
        writeln!(text, "| {code} | `{fault:?}` | {meaning} | {reaction} | {cause} | {check} | {clear} |")
            .expect("a text");
    }
    text
}

#[test]
fn the_document_of_errors_is_what_the_tables_say() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/errors.md");
    let expected = document();
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&path, &expected).expect("docs/errors.md can be written");
    }
    let found = std::fs::read_to_string(&path).expect("docs/errors.md");
    let differs = found.lines().zip(expected.lines()).find(|(found, expected)| found != expected);
    assert!(
        found == expected,
        "UPDATE_DOCUMENTS=1 cargo test -p lab --test library errors:: mends it; first: {differs:?}"
    );
}
