//! The numbers by which host and device recognise that they fit together.

/// Version of the link, from the schema text. It rises whenever a message is added, or a field at the end of one.
pub const LINK_VERSION: u16 = version(SCHEMA.as_bytes());

/// Every message with its encoding, and the image with its layout, as text.
///
/// `tests/link/golden.rs` encodes each message and compares it with its line here. So a layout cannot change
/// without this file changing, and this file cannot change without [`SCHEMA_HASH`] changing.
const SCHEMA: &str = include_str!("schema.txt");

/// FNV-1a (32 bit) of the schema text: equal on two sides exactly if all their layouts are.
pub const SCHEMA_HASH: u32 = fnv1a(SCHEMA.as_bytes());

/// FNV-1a, 32 bit. Carriage returns are left out: a checkout that converts line ends keeps its hash.
const fn fnv1a(bytes: &[u8]) -> u32 {
    let mut hash: u32 = 0x811c_9dc5;
    let mut index = 0;
    while index < bytes.len() {
        if bytes[index] != b'\r' {
            hash = (hash ^ bytes[index] as u32).wrapping_mul(0x0100_0193);
        }
        index += 1;
    }
    hash
}

/// The number behind "link" in the second line of the schema text.
const fn version(text: &[u8]) -> u16 {
    let mut index = 0;
    while text[index] != b'\n' {
        index += 1;
    }
    let (mut version, mut place) = (0, index + 1 + "link ".len());
    while text[place].is_ascii_digit() {
        version = 10 * version + (text[place] - b'0') as u16;
        place += 1;
    }
    assert!(version > 0, "the second line of the schema text begins with \"link \" and the version");
    version
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_version_is_the_whole_number_in_the_second_line() {
        assert_eq!(version(b"schema 1\nlink 407\nrequest 5\n"), 407);
        assert_eq!(version(b"\nlink 9\n"), 9);
    }
}
