//! No file of tests is left out: one beside a `main.rs` in a folder `tests` is a module of it, because cargo finds none
//! there by itself; and one that needs the world is in a program that is run with it.

use super::Finding;
use crate::test::WITH_THE_WORLD;

/// Checks every file of tests.
pub(super) fn check(files: &[(String, String)]) -> Vec<Finding> {
    let mut found = modules(files);
    found.extend(world(files));
    found
}

/// Tests with the world, in a program that nothing runs with it.
fn world(files: &[(String, String)]) -> impl Iterator<Item = Finding> {
    let asks = "feature = \"mujoco\"";
    let tests = files.iter().filter(|(path, _)| path.contains("tests/") && path.ends_with(".rs"));
    let left_out = tests.filter(move |(path, text)| {
        text.contains(asks) && !WITH_THE_WORLD.iter().any(|(_, folder)| path.starts_with(folder))
    });
    left_out.map(|(path, _)| {
        Finding::new(
            path,
            "never run with the world: its place is in tests/tests/system, or name it in xtask/src/test.rs",
        )
    })
}

/// Checks every folder `tests` whose files are one program.
fn modules(files: &[(String, String)]) -> Vec<Finding> {
    let programs = files.iter().filter_map(|(path, text)| Some((path.strip_suffix("tests/main.rs")?, text)));
    let left_out = |(package, text): (&str, &str)| {
        let modules = text.lines().filter_map(|line| line.strip_prefix("mod ")?.strip_suffix(';')).collect::<Vec<_>>();
        let folder = format!("{package}tests/");
        let beside = files.iter().filter_map(|(path, _)| path.strip_prefix(&folder)?.strip_suffix(".rs"));
        let never_run = beside.filter(|name| !name.contains('/') && *name != "main" && !modules.contains(name));
        never_run
            .map(|name| {
                Finding::new(
                    format!("{folder}{name}.rs"),
                    format!("never run: 'mod {name};' is not in {folder}main.rs"),
                )
            })
            .collect::<Vec<_>>()
    };
    programs.flat_map(|(package, text)| left_out((package, text))).collect()
}
