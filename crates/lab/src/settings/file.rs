//! The settings of a device as a TOML file: sorted keys with units, the device they are of, and the reader's comments.

use std::str::FromStr as _;

use thiserror::Error;
use toml_edit::{DocumentMut, Item, TableLike, Value, value};

use crate::input_file;

use super::{Key, Setting, Settings};

/// Names the layout of the file.
const SCHEMA: &str = "tactus-settings/1";

/// First lines of a new file.
const HEAD: &str = "\
# What a device of Tactus keeps of its arm. `tactus config diff FILE` compares it with a device, `tactus config restore
# FILE` has a device keep it. Comments stay when the file is written anew.
";

/// Why a file holds no settings.
#[derive(Debug, Error)]
pub enum FileError {
    /// It is no TOML.
    #[error("{}", input_file::parser_words(.0))]
    Toml(#[from] toml_edit::TomlError),
    /// It has another layout.
    #[error("its `schema` is not {SCHEMA}")]
    Schema,
    /// It does not say whose settings it has.
    #[error("`{0}` is missing or no text")]
    Head(&'static str),
    /// It has keys that mean nothing.
    #[error("{} no setting: {}", if .0.len() == 1 { "this is" } else { "these are" }, .0.join(", "))]
    UnknownKeys(Vec<String>),
    /// A value is neither a number nor a switch.
    #[error("{0} is neither a number nor true or false")]
    Kind(Key),
}

/// A file of settings that was read.
#[derive(Clone, Debug, PartialEq)]
pub struct SettingsFile {
    /// Serial number of the device they are of.
    pub serial: String,
    /// Hash of the robot model they are for.
    pub model: String,
    /// The settings, sorted by name.
    pub values: Vec<(Key, Setting)>,
}

impl SettingsFile {
    /// Reads one.
    ///
    /// # Errors
    /// [`FileError`] names every key that means nothing, or the first other defect.
    pub fn parse(text: &str) -> Result<Self, FileError> {
        let document = DocumentMut::from_str(text)?;
        let head = |name: &'static str| {
            document.get(name).and_then(Item::as_str).map(str::to_owned).ok_or(FileError::Head(name))
        };
        if head("schema").ok().as_deref() != Some(SCHEMA) {
            return Err(FileError::Schema);
        }
        let (serial, model) = (head("serial")?, head("model")?);
        let (mut values, mut unknown) = (Vec::new(), Vec::new());
        for (name, item) in document.iter().filter(|(name, _)| !["schema", "serial", "model"].contains(name)) {
            let Some(table) = item.as_table_like() else {
                unknown.push(name.to_owned());
                continue;
            };
            for (inner, item) in table.iter() {
                let name = format!("{name}.{inner}");
                match name.parse::<Key>() {
                    Ok(key) => values.push((key, setting(item).ok_or(FileError::Kind(key))?)),
                    Err(_) => unknown.push(name),
                }
            }
        }
        if !unknown.is_empty() {
            return Err(FileError::UnknownKeys(unknown));
        }
        values.sort_by_key(|(key, _)| key.to_string());
        Ok(Self { serial, model, values })
    }

    /// The settings of the device's that the file does not name; without a home or a weight stored they are no loss.
    #[must_use]
    pub fn missing(&self, device: &Settings) -> Vec<Key> {
        let is_named = |key: Key| self.values.iter().any(|(named, _)| *named == key);
        let is_forgotten = |key: Key| self.values.contains(&(key.stored(), Setting::Switch(false)));
        let kept = Key::all().into_iter().filter(|key| device.get(*key).is_some());
        kept.filter(|key| !is_named(*key) && !is_forgotten(*key)).collect()
    }
}

fn setting(item: &Item) -> Option<Setting> {
    match item.as_value()? {
        Value::Boolean(switch) => Some(Setting::Switch(*switch.value())),
        Value::Float(number) => Some(Setting::Number(*number.value() as f32)),
        Value::Integer(number) => Some(Setting::Number(*number.value() as f32)),
        _ => None,
    }
}

/// The settings as the text of a file. Comments of `before`, the file that it takes the place of, are kept.
///
/// # Errors
/// `before` is no file of settings.
pub fn settings_text(
    settings: &Settings,
    serial: &str,
    model_hash: u32,
    before: Option<&str>,
) -> Result<String, FileError> {
    if let Some(before) = before {
        SettingsFile::parse(before)?;
    }
    let mut document = DocumentMut::from_str(before.unwrap_or(HEAD))?;
    if before.is_none() {
        // A text without keys is all trailing: it belongs in front of the first key.
        document.set_trailing("");
    }
    let root = document.as_table_mut();
    put(root, "model", model_text(model_hash).into());
    put(root, "schema", SCHEMA.into());
    put(root, "serial", serial.into());
    for key in Key::all() {
        let (table, name) = key.place();
        let table = root.entry(table).or_insert_with(toml_edit::table);
        let Some(table) = table.as_table_like_mut() else { continue };
        match settings.get(key) {
            Some(Setting::Switch(switch)) => put(table, &name, switch.into()),
            Some(Setting::Number(number)) => put(table, &name, shortest(number).into()),
            None => drop(table.remove(&name)),
        }
    }
    root.sort_values();
    for (_, item) in root.iter_mut() {
        if let Some(table) = item.as_table_like_mut() {
            table.sort_values();
        }
    }
    let text = document.to_string();
    Ok(if before.is_none() { format!("{HEAD}\n{text}") } else { text })
}

/// Sets a value; its comments stay.
fn put(table: &mut dyn TableLike, name: &str, new: Value) {
    match table.get_mut(name).and_then(Item::as_value_mut) {
        Some(place) => {
            let decor = place.decor().clone();
            *place = new;
            *place.decor_mut() = decor;
        }
        None => drop(table.insert(name, value(new))),
    }
}

/// The number with the shortest digits that give the same 32 bits again.
fn shortest(number: f32) -> f64 {
    format!("{number:?}").parse().unwrap_or_else(|_| number.into())
}

/// A model's hash as files have it.
#[must_use]
pub fn model_text(hash: u32) -> String {
    format!("0x{hash:08x}")
}

#[cfg(test)]
mod tests {
    use super::super::KeptWeight;
    use super::*;

    const SETTINGS: Settings = Settings {
        home: Some([0.0, -1.98, 0.1, 3.13, 1e-7, -1.57, 0.333_333_34]),
        weight: Some(KeptWeight { hand: true, links: [[0.012_345_678, -0.001, 0.0, 0.002]; 7] }),
    };

    #[test]
    fn settings_are_the_same_to_the_bit_after_writing_and_reading() {
        for settings in [SETTINGS, Settings::default(), Settings { weight: None, ..SETTINGS }] {
            let text = settings_text(&settings, "A1", 0xab, None).unwrap();
            let file = SettingsFile::parse(&text).unwrap();
            assert_eq!((file.serial.as_str(), file.model.as_str()), ("A1", "0x000000ab"));
            let values: Vec<_> = Key::all().into_iter().filter_map(|key| Some((key, settings.get(key)?))).collect();
            assert_eq!(file.values, values);
            assert_eq!(settings_text(&settings, "A1", 0xab, Some(&text)).unwrap(), text, "written again: the same");
        }
    }

    #[test]
    fn comments_stay_keys_stay_sorted_and_what_is_no_longer_kept_goes() {
        let text = settings_text(&SETTINGS, "A1", 0xab, None).unwrap();
        let noted = text.replace("joint_4_rad = 3.13", "# the new stop\njoint_4_rad = 3.13 # measured on Monday");
        assert_ne!(noted, text);
        let mut other = SETTINGS;
        other.home.as_mut().unwrap()[3] = 3.1;
        let again = settings_text(&other, "A1", 0xab, Some(&noted)).unwrap();
        assert!(again.contains("# the new stop\njoint_4_rad = 3.1 # measured on Monday"), "{again}");
        let bare = settings_text(&Settings::default(), "A1", 0xab, Some(&again)).unwrap();
        assert!(!bare.contains("joint_4_rad") && bare.contains("stored = false"), "{bare}");
        let lines: Vec<&str> = text.lines().filter(|line| line.starts_with("link_")).collect();
        assert!(lines.is_sorted() && lines.len() == 28, "{lines:?}");
    }

    #[test]
    fn what_is_wrong_in_a_file_is_named() {
        let text = settings_text(&SETTINGS, "A1", 0xab, None).unwrap();
        let wrong = |from: &str, to: &str| {
            assert!(text.contains(from), "{from}");
            SettingsFile::parse(&text.replacen(from, to, 1)).unwrap_err().to_string()
        };
        assert_eq!(wrong("joint_4_rad", "joint_4_deg"), "this is no setting: home.joint_4_deg");
        assert!(wrong("[home]", "[house]").starts_with("these are no setting: house.joint_1_rad, "));
        assert_eq!(wrong("settings/1", "settings/2"), "its `schema` is not tactus-settings/1");
        assert_eq!(wrong("serial = \"A1\"", "serial = 1"), "`serial` is missing or no text");
        assert_eq!(wrong("stored = true", "stored = \"yes\""), "home.stored is neither a number nor true or false");
        assert!(wrong("[home]", "[home").contains("TOML parse error at line "));
        let file = SettingsFile::parse(&text.replace("joint_4_rad = 3.13\n", "")).unwrap();
        assert_eq!(file.missing(&SETTINGS), [Key::HomeJoint(3)]);
        assert_eq!(file.missing(&Settings::default()), []);
    }
}
