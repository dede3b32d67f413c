//! The text of a primitive: serde's TOML, with its schema and check sum in front, comments, and tables by row.

use std::path::Path;

use serde::de::Error as _;
use serde::{Deserialize, Deserializer};

use crate::input_file;

use super::{PrimitiveFile, PrimitiveFileError, SCHEMA};

/// Columns after which a table of numbers breaks.
const LINE_WIDTH: usize = 118;

/// The first lines of every file.
const HEAD: &str = "\
# Movement primitive of Tactus. SI units; quaternions are (w, x, y, z), tool to world; the position is that
# of the grasp point in the world frame. Comments may be changed; content_crc32 covers every number
# but those of [provenance].";

/// Comments behind the lines that begin so.
const COMMENTS: [(&str, &str); 12] = [
    ("model_hash = ", "model of the arm it was learned or recorded with"),
    ("alpha = ", "decay of the phase: s(duration) = exp(-alpha)"),
    ("activation = ", "of a kernel at the centre of the next"),
    ("[gains.position]", "spring K and damper D of the transformation systems, dimensionless"),
    ("[start]", "of the demonstration"),
    ("[start_velocity]", "angular velocity in the body frame"),
    ("[weights]", "theta of Eq (2), one row a degree of freedom: position m, orientation (body) and joints rad"),
    ("[feedback]", "Eq (8), by phase: first point at the start, last at the end of the movement"),
    ("[expectation]", "wrench of the environment on the robot by phase: force N (world), torque N m, gauges N m"),
    ("[statistics]", "of successful runs, by phase: the rows of the expectation, then fingers F1 to F3 rad"),
    ("[provenance]", "where it comes from; errors are [maximum, RMS] of the reproduction"),
    ("spread_floor = ", "relative spread below which no sensor is trusted more"),
];

/// Read before everything else, so that a file of another version is named as such.
#[derive(Deserialize)]
struct Head {
    schema: String,
    #[serde(default, deserialize_with = "hexadecimal::deserialize")]
    content_crc32: u32,
}

/// Reads text; gives the primitive and the check sum that stands in the file.
pub(super) fn parse(file: &Path, text: &str) -> Result<(PrimitiveFile, u32), PrimitiveFileError> {
    let syntax = |error: toml::de::Error| PrimitiveFileError::Syntax {
        file: file.to_owned(),
        message: input_file::parser_words(&error),
    };
    let head: Head = toml::from_str(text).map_err(syntax)?;
    if !is_schema(&head.schema) {
        let message = format!("schema `{}` is none of a primitive: it should be `{SCHEMA}`", head.schema);
        return Err(PrimitiveFileError::Syntax { file: file.to_owned(), message });
    }
    if head.schema != SCHEMA {
        return Err(PrimitiveFileError::Schema { file: file.to_owned(), found: head.schema, expected: SCHEMA });
    }
    let primitive: PrimitiveFile = toml::from_str(text).map_err(syntax)?;
    Ok((PrimitiveFile { file: file.to_owned(), ..primitive }, head.content_crc32))
}

/// True for the name of a version, this one or another: anything else is damage.
fn is_schema(name: &str) -> bool {
    let version = |name: &str| name.split_once('/').map(|(kind, number)| (kind.to_owned(), number.parse::<u32>().ok()));
    matches!((version(name), version(SCHEMA)), (Some((kind, Some(_))), Some((own, _))) if kind == own)
}

/// The text of the file. Every number is printed so that it reads back as the same f64.
pub(super) fn render(primitive: &PrimitiveFile) -> String {
    let body = toml::to_string(primitive).expect("numbers, texts and tables can be written as TOML");
    let mut text = format!("{HEAD}\nschema = \"{SCHEMA}\"\ncontent_crc32 = \"0x{:08x}\"\n", primitive.checksum());
    for line in body.lines() {
        if let Some((key, rows)) = line.split_once(" = [[") {
            text.push_str(&format!("{key} = [\n"));
            rows.trim_end_matches("]]").split("], [").for_each(|row| push_row(&mut text, row));
            text.push_str("]\n");
            continue;
        }
        text.push_str(line);
        if let Some((_, comment)) = COMMENTS.iter().find(|(start, _)| line.starts_with(start)) {
            text.push_str(&format!("      # {comment}"));
        }
        text.push('\n');
    }
    text
}

/// Writes one row of a table, broken at [`LINE_WIDTH`].
fn push_row(text: &mut String, row: &str) {
    let mut line = String::from("  [");
    for (index, number) in row.split(", ").enumerate() {
        if index == 0 {
            line.push_str(number);
        } else if line.len() + number.len() + 4 > LINE_WIDTH {
            text.push_str(&format!("{line},\n"));
            line = format!("   {number}");
        } else {
            line.push_str(&format!(", {number}"));
        }
    }
    text.push_str(&format!("{line}],\n"));
}

/// Reads a name that a device takes.
pub(super) fn name<'de, D: Deserializer<'de>>(deserializer: D) -> Result<String, D::Error> {
    let text = String::deserialize(deserializer)?;
    link::Name::new(&text).map_err(|error| D::Error::custom(format!("`{text}` is not a name: {error}")))?;
    Ok(text)
}

/// Hashes and check sums as text: `0x` and eight digits.
pub(super) mod hexadecimal {
    use serde::de::Error as _;
    use serde::{Deserialize, Deserializer, Serializer};

    /// Writes the number.
    pub(in crate::primitive_file) fn serialize<S: Serializer>(value: &u32, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(&format_args!("0x{value:08x}"))
    }

    /// Reads the number.
    pub(in crate::primitive_file) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<u32, D::Error> {
        let text = String::deserialize(deserializer)?;
        let digits = text.strip_prefix("0x").and_then(|digits| u32::from_str_radix(digits, 16).ok());
        digits.ok_or_else(|| {
            D::Error::custom(format!("`{text}` is not a hexadecimal number of up to 8 digits, as in \"0x1234abcd\""))
        })
    }
}
