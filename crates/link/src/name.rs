//! Names of primitives and short texts, bounded so that they need no allocation.
//!
//! A [`Name`] is also a file name on the host and a word on a command line, so its alphabet is narrow:
//! ASCII letters, digits, `-`, `_` and `.`, not starting with `.` or `-`.

use core::fmt;
use core::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

/// Longest name of a primitive in bytes. It is part of the image layout: changing it is a new schema.
pub const NAME_BYTES: usize = 32;

/// Longest free text in a message (version, board, serial number, owner of a session) in bytes.
pub const TEXT_BYTES: usize = 48;

/// The name of a primitive: 1 to [`NAME_BYTES`] characters out of `A-Z a-z 0-9 - _ .`.
#[derive(Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Name(heapless::String<NAME_BYTES>);

/// Why a text is not a [`Name`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NameError {
    /// The text has no characters.
    Empty,
    /// The text is longer than [`NAME_BYTES`].
    TooLong,
    /// A character outside `A-Z a-z 0-9 - _ .`, or a leading `-` or `.`.
    BadCharacter,
}

impl fmt::Display for NameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Empty => f.write_str("the name is empty"),
            Self::TooLong => write!(f, "the name is longer than {NAME_BYTES} characters"),
            Self::BadCharacter => {
                f.write_str("a name has letters, digits, '-', '_' and '.', and starts with a letter, digit or '_'")
            }
        }
    }
}

impl core::error::Error for NameError {}

impl Name {
    /// Checks a text and makes it a name.
    ///
    /// # Errors
    /// [`NameError`] says which rule the text breaks.
    pub fn new(text: &str) -> Result<Self, NameError> {
        if text.is_empty() {
            return Err(NameError::Empty);
        }
        if text.starts_with(['-', '.']) {
            return Err(NameError::BadCharacter);
        }
        if !text.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'-' | b'_' | b'.')) {
            return Err(NameError::BadCharacter);
        }
        heapless::String::try_from(text).map(Self).map_err(|_| NameError::TooLong)
    }

    /// The name as text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl FromStr for Name {
    type Err = NameError;

    fn from_str(text: &str) -> Result<Self, NameError> {
        Self::new(text)
    }
}

impl fmt::Display for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl fmt::Debug for Name {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}

impl Serialize for Name {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.0)
    }
}

impl<'de> Deserialize<'de> for Name {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        // An unchecked name must not enter through the wire either: it would reach the host's file system.
        let text = heapless::String::<NAME_BYTES>::deserialize(deserializer)?;
        Self::new(&text).map_err(serde::de::Error::custom)
    }
}

/// A short free text: cut, never refused, when it is too long.
#[derive(Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Text(heapless::String<TEXT_BYTES>);

impl Text {
    /// Takes as many whole characters of `text` as fit into [`TEXT_BYTES`].
    #[must_use]
    pub fn new(text: &str) -> Self {
        let mut cut = heapless::String::new();
        for character in text.chars() {
            if cut.push(character).is_err() {
                break;
            }
        }
        Self(cut)
    }

    /// The text.
    #[must_use]
    pub fn as_str(&self) -> &str {
        &self.0
    }
}

impl From<&str> for Text {
    fn from(text: &str) -> Self {
        Self::new(text)
    }
}

impl fmt::Display for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(&self.0)
    }
}

impl fmt::Debug for Text {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Debug::fmt(self.as_str(), f)
    }
}
