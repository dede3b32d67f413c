//! Damaged input files: every command that reads a file ends within seconds, with 0, 2 or 6, and replaces nothing.
//!
//! `TACTUS_MUTATIONS=2000` runs the full count.

use std::path::Path;
use std::process::Stdio;
use std::time::{Duration, Instant};

use crate::common;
use crate::tool::command;

/// Damaged files that are tried unless the environment says otherwise.
const FEW: u64 = 60;

/// Longest time a command may take with one of them.
const TIME_LIMIT: Duration = Duration::from_secs(10);

/// Numbers that look random, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: usize) -> usize {
        // Splitmix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.0;
        value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((value ^ (value >> 31)) % bound.max(1) as u64) as usize
    }
}

/// Values that break what expects an ordinary number.
const WORDS: [&str; 12] =
    ["NaN", "inf", "-1e308", "1e400", "", "0", "-0", "18446744073709551616", "\"", "[[", "\u{fffd}", "9999999999"];

/// One kind of damage, or several.
fn damage(bytes: &[u8], numbers: &mut Numbers) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..=numbers.below(3) {
        let at = numbers.below(bytes.len());
        match numbers.below(7) {
            0 => bytes.truncate(at),
            1 if !bytes.is_empty() => bytes[at] ^= 1 << numbers.below(8),
            2 if !bytes.is_empty() => bytes[at] = numbers.below(256) as u8,
            3 => {
                let piece: Vec<u8> = bytes.iter().skip(at).take(numbers.below(2000)).copied().collect();
                bytes.splice(at..at, piece);
            }
            4 => {
                let end = (at + numbers.below(2000)).min(bytes.len());
                bytes.drain(at..end);
            }
            5 => {
                // A field, a word or a line becomes something else.
                let is_end = |byte: &u8| matches!(byte, b',' | b'\n' | b' ' | b']' | b'#');
                let begin = bytes[..at].iter().rposition(is_end).map_or(0, |place| place + 1);
                let end = bytes[at..].iter().position(is_end).map_or(bytes.len(), |place| at + place);
                bytes.splice(begin..end, WORDS[numbers.below(WORDS.len())].bytes());
            }
            _ => {
                let end = (at + numbers.below(40)).min(bytes.len());
                bytes[at..end].reverse();
            }
        }
    }
    bytes
}

/// A command with a damaged file, run to its end.
fn run(folder: &Path, line: &str) -> (Option<i32>, String, Duration) {
    let begun = Instant::now();
    let mut command = command(folder, line);
    let said = std::fs::File::create(folder.join("said")).unwrap();
    let mut child = command.stdout(Stdio::null()).stderr(said).spawn().unwrap();
    while begun.elapsed() < TIME_LIMIT {
        if let Some(status) = child.try_wait().unwrap() {
            return (status.code(), std::fs::read_to_string(folder.join("said")).unwrap_or_default(), begun.elapsed());
        }
        std::thread::sleep(Duration::from_millis(2));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    (None, "it hangs".to_owned(), begun.elapsed())
}

/// The damage made a whole name of another version: then the file is one of that version, as far as anybody can tell.
fn names_another_version(said: &str) -> bool {
    let version = said.split("schema `tactus-primitive/").nth(1).and_then(|rest| rest.split('`').next());
    said.starts_with("error[E431]") && version.is_some_and(|version| version.parse::<u32>().is_ok())
}

#[test]
fn cli_14_a_damaged_name_of_the_layout_is_a_damaged_file_and_another_version_is_told_as_one() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 2.0);
    assert_eq!(run(at, "learn demo.csv -o reach.toml").0, Some(0));
    let text = std::fs::read_to_string(at.join("reach.toml")).unwrap();
    for (schema, code, error) in [
        ("tactus-primitive/2", 4, "E431"),
        ("tactus-primitive/", 6, "E63"),
        ("tactus-primitive/NaN", 6, "E63"),
        ("tactus-trimitive/1", 6, "E63"),
        ("", 6, "E63"),
    ] {
        std::fs::write(at.join("bad.toml"), text.replacen("tactus-primitive/1", schema, 1)).unwrap();
        let (found, said, _) = run(at, "check bad.toml");
        assert!(found == Some(code) && said.contains(error) && said.contains(schema), "{schema}: {found:?} {said}");
    }
}

#[test]
fn cli_14_a_device_with_a_damaged_memory_gives_a_sound_primitive_or_none() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    common::demonstration(at, 2.0);
    for line in [
        "learn demo.csv -o reach.toml",
        "--device sil:world=simple,flash=arm.flash --non-interactive upload reach.toml",
        "--device sil:world=simple,flash=arm.flash get reach -o good.toml",
    ] {
        assert_eq!(run(at, line).0, Some(0), "{line}: {}", run(at, line).1);
    }
    let (memory, good) = (std::fs::read(at.join("arm.flash")).unwrap(), std::fs::read(at.join("good.toml")).unwrap());
    // Most of it is empty.
    let written = memory.iter().rposition(|byte| *byte != 0xFF).unwrap() + 1;
    for seed in 0..FEW {
        let mut numbers = Numbers(seed);
        let mut bad = damage(&memory[..written], &mut numbers);
        bad.resize(memory.len(), 0xFF);
        std::fs::write(at.join("bad.flash"), bad).unwrap();
        let (code, said, took) = run(at, "--device sil:world=simple,flash=bad.flash get reach -o new.toml");
        assert!(matches!(code, Some(0 | 2 | 5 | 6)) && !said.contains("panicked"), "seed {seed}: {code:?} {said}");
        assert!(took < TIME_LIMIT, "seed {seed}: {took:?}");
        let got = std::fs::read(at.join("new.toml")).ok();
        assert!(got.is_none_or(|got| code == Some(0) && got == good), "seed {seed}: half a primitive, {said}");
        let _ = std::fs::remove_file(at.join("new.toml"));
    }
}

#[test]
fn cli_14_damaged_files_are_refused_or_used_and_nothing_is_replaced() {
    let folder = tempfile::tempdir().unwrap();
    let at = folder.path();
    let succeeds = |line: &str| assert_eq!(run(at, line).0, Some(0), "{line}: {}", run(at, line).1);
    common::demonstration(at, 2.0);
    succeeds("learn demo.csv -o reach.toml");
    succeeds("--device sil:world=simple --non-interactive run reach.toml --record run.csv");
    succeeds("--device sil:world=simple,line=can,bus=bus.log list");
    let read = |name: &str| std::fs::read(at.join(name)).unwrap();
    let (demonstration, primitive, recording, log) =
        (read("demo.csv"), read("reach.toml"), read("run.csv"), read("bus.log"));
    std::fs::write(at.join("there.toml"), "precious").unwrap();
    let kinds: [(&[u8], &str, &[&str]); 6] = [
        (
            &demonstration,
            "bad.csv",
            &[
                "learn bad.csv --name a -o new.toml",
                "learn bad.csv --name a -o there.toml",
                "plot -d bad.csv -o new.svg",
            ],
        ),
        (
            &primitive,
            "bad.toml",
            &["check bad.toml", "plot -p bad.toml -o new.svg", "statistics bad.toml run.csv -o new.toml"],
        ),
        (
            &recording,
            "bad.csv",
            &["compare run.csv bad.csv", "statistics reach.toml bad.csv -o new.toml", "plot -r bad.csv -o new.svg"],
        ),
        (&primitive, "bad.toml", &["report run.csv -p bad.toml -o new.html"]),
        (&recording, "bad.csv", &["report bad.csv -o new.html", "report run.csv bad.csv -o new.html"]),
        (&log, "bad.log", &["can decode bad.log", "can replay bad.log"]),
    ];
    let count = std::env::var("TACTUS_MUTATIONS").ok().and_then(|count| count.parse().ok()).unwrap_or(FEW);
    let (mut worst, mut refused, mut runs) = (Duration::ZERO, 0, 0);
    for seed in 0..count {
        let mut numbers = Numbers(seed);
        let (whole, name, lines) = kinds[seed as usize % kinds.len()];
        let bad = damage(whole, &mut numbers);
        std::fs::write(at.join(name), &bad).unwrap();
        for line in lines {
            let (code, said, took) = run(at, line);
            assert!(
                (matches!(code, Some(0 | 2 | 6)) || code == Some(4) && names_another_version(&said))
                    && !said.contains("panicked"),
                "seed {seed}, {line}: {code:?} {said}"
            );
            assert_eq!(std::fs::read(at.join(name)).unwrap(), bad, "seed {seed}, {line}");
            worst = worst.max(took);
            refused += u32::from(code != Some(0));
            runs += 1;
            for new in ["new.toml", "new.svg", "new.html"] {
                let _ = std::fs::remove_file(at.join(new));
            }
        }
        assert_eq!(std::fs::read(at.join("there.toml")).unwrap(), b"precious");
        let parts = std::fs::read_dir(at).unwrap().filter_map(|entry| entry.unwrap().file_name().into_string().ok());
        assert_eq!(parts.filter(|name| name.ends_with(".part")).count(), 0, "seed {seed}");
    }
    println!("{count} damaged files, {runs} commands: {refused} refused, the longest took {worst:.2?}");
}
