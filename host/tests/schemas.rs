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

/// The change that makes it fail: a quantity that two commands call by the same words in another order.
#[test]
fn no_quantity_has_two_names_of_the_same_words() {
    fn collect(value: &serde_json::Value, names: &mut Vec<String>) {
        let properties = value.get("properties").and_then(serde_json::Value::as_object);
        names.extend(properties.into_iter().flat_map(|properties| properties.keys().cloned()));
        let inner: Vec<&serde_json::Value> = match value {
            serde_json::Value::Object(object) => object.values().collect(),
            serde_json::Value::Array(values) => values.iter().collect(),
            _ => Vec::new(),
        };
        inner.into_iter().for_each(|value| collect(value, names));
    }
    let mut names = Vec::new();
    tactus::schemas::all().iter().for_each(|(_, schema)| collect(schema.as_value(), &mut names));
    names.sort();
    names.dedup();
    let words = |name: &String| {
        let mut words: Vec<&str> = name.split('_').collect();
        words.sort_unstable();
        words.join(" ")
    };
    let mut of_words: std::collections::BTreeMap<String, Vec<&String>> = std::collections::BTreeMap::new();
    names.iter().for_each(|name| of_words.entry(words(name)).or_default().push(name));
    of_words.retain(|_, names| names.len() > 1);
    assert!(names.len() > 100 && of_words.is_empty(), "{of_words:?}");
}
