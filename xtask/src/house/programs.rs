//! Every file of tests beside a `main.rs` in a folder `tests` is a module of it: cargo finds no file there by itself.

use super::Finding;

/// Checks every folder `tests` whose files are one program.
pub(super) fn check(files: &[(String, String)]) -> Vec<Finding> {
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
