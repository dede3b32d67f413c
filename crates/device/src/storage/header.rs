//! The header that the log writes before every value: check sum of the value, its length, check sum of the length.

/// Most bytes of a word of the flash.
pub(super) const WORD_LIMIT: usize = 32;

/// Bytes of a header that count.
pub(super) const HEADER_BYTES: usize = 8;

/// Length of a value by its header; `None`: the header is damaged. A blank word in which one certain bit has fallen
/// over has the right check sum of a length of all ones, which no value has.
pub(super) fn length_of(header: &[u8; WORD_LIMIT]) -> Option<u16> {
    let [_, _, _, _, low, high, sum @ ..] = header.first_chunk::<HEADER_BYTES>().copied()?;
    let length = u16::from_le_bytes([low, high]);
    (length != u16::MAX && length_sum([low, high]) == u16::from_le_bytes(sum)).then_some(length)
}

/// CRC-16F/4.2 of a length, as the log writes it; all ones become something else.
fn length_sum(length: [u8; 2]) -> u16 {
    let step = |sum: u16, _| if sum & 1 == 1 { (sum >> 1) ^ 0x1A2E } else { sum >> 1 };
    let sum = length.into_iter().fold(u16::MAX, |sum, byte| (0..8).fold(sum ^ u16::from(byte), step)) ^ u16::MAX;
    if sum == u16::MAX { sum - 1 } else { sum }
}
