//! The schemas of `docs/schemas` are those of the types that commands write.

use std::path::Path;

#[test]
fn cli_13_the_schema_files_are_those_of_the_types_and_nothing_else_is_there() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/schemas");
    let update = std::env::var_os("UPDATE_DOCUMENTS").is_some();
    let mut names = vec!["README.md".to_owned()];
    for (name, schema) in tactus::schemas::all() {
        let file = format!("{name}.json");
        let text = format!("{}\n", serde_json::to_string_pretty(schema.as_value()).unwrap());
        if update {
            std::fs::write(folder.join(&file), &text).unwrap();
        }
        let found = std::fs::read_to_string(folder.join(&file)).unwrap_or_default();
        assert!(found == text, "{file} is old: UPDATE_DOCUMENTS=1 cargo test -p tactus --test command schemas::");
        names.push(file);
    }
    let mut found: Vec<String> =
        folder.read_dir().unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    found.sort();
    assert_eq!(found, names);
}

/// The change that makes it fail: a quantity of a cycle that `faults` calls otherwise than `monitor`.
#[test]
fn a_cycle_of_a_fault_has_the_names_of_one_of_the_monitor() {
    let names = |schema: &str, within: &str| -> Vec<String> {
        let (_, schema) = tactus::schemas::all().into_iter().find(|(name, _)| *name == schema).unwrap();
        let properties = schema.as_value().pointer(within).unwrap().as_object().unwrap();
        properties.keys().cloned().collect()
    };
    let shown = names("monitor", "/$defs/Line/properties");
    let kept = names("faults", "/$defs/Cycle/properties");
    let others: Vec<&String> = kept.iter().filter(|name| !shown.contains(name)).collect();
    assert_eq!(others, ["cost_ticks", "flags"], "only these are of the record alone");
}
