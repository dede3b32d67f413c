//! Reading the golden vectors: rows by column name, payloads in hexadecimal.

use std::collections::HashMap;

use puck::{CanFrame, CanId};

/// One row of a vector file.
pub(crate) struct Row {
    file: String,
    line: u64,
    cells: HashMap<String, String>,
}

impl Row {
    /// The text of a cell.
    pub(crate) fn text(&self, column: &str) -> &str {
        self.cells.get(column).unwrap_or_else(|| panic!("{}: no column {column}", self.file))
    }

    /// The cell as a number.
    pub(crate) fn number<T: std::str::FromStr>(&self, column: &str) -> T {
        let text = self.text(column);
        text.parse().unwrap_or_else(|_| panic!("{}: {column} = {text:?} is no number", self.at()))
    }

    /// The cell as a number, `None` if it is empty.
    pub(crate) fn optional<T: std::str::FromStr>(&self, column: &str) -> Option<T> {
        (!self.text(column).is_empty()).then(|| self.number(column))
    }

    /// The cells `prefix1..prefixN`.
    pub(crate) fn numbers<T: std::str::FromStr, const N: usize>(&self, prefix: &str, first: usize) -> [T; N] {
        std::array::from_fn(|index| self.number(&format!("{prefix}{}", index + first)))
    }

    /// The bytes of a payload column.
    pub(crate) fn payload(&self, column: &str) -> Vec<u8> {
        payload(self.text(column))
    }

    /// The identifier in a hexadecimal column.
    pub(crate) fn id(&self, column: &str) -> CanId {
        can_id(self.text(column))
    }

    /// The frame of an identifier and a payload column.
    pub(crate) fn frame(&self, id: &str, data: &str) -> CanFrame {
        CanFrame::from_slice(self.id(id), &self.payload(data)).expect("at most eight bytes")
    }

    /// File and line, for messages.
    pub(crate) fn at(&self) -> String {
        format!("{}:{}", self.file, self.line)
    }
}

/// Bytes from `AA 00 01`.
pub(crate) fn payload(text: &str) -> Vec<u8> {
    text.split_whitespace().map(|byte| u8::from_str_radix(byte, 16).expect("a hexadecimal byte")).collect()
}

/// An identifier from `0x426` or `426`.
pub(crate) fn can_id(text: &str) -> CanId {
    let digits = text.trim_start_matches("0x");
    CanId::new(u16::from_str_radix(digits, 16).expect("a hexadecimal identifier")).expect("eleven bits")
}

/// All rows of a vector file. Panics when it has none: an empty file would pass every test.
pub(crate) fn rows(name: &str) -> Vec<Row> {
    let path = format!("{}/tests/vectors/{name}.csv", env!("CARGO_MANIFEST_DIR"));
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(&path).expect("the vector file");
    let header = reader.headers().expect("a header").clone();
    let rows: Vec<Row> = reader
        .records()
        .map(|record| {
            let record = record.expect("a row");
            let line = record.position().map_or(0, |position| position.line());
            let cells = header.iter().zip(record.iter()).map(|(key, cell)| (key.into(), cell.into())).collect();
            Row { file: name.into(), line, cells }
        })
        .collect();
    assert!(!rows.is_empty(), "{name} has no rows");
    rows
}
