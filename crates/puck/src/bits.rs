//! Numbers made of bit fields, one field behind the other.

/// `bits`, and behind it a field of `width` bits, as a digit is put behind a number. No field has more bits than its
/// width.
pub(crate) const fn appended(bits: u64, width: u32, field: u64) -> u64 {
    (bits << width) + field
}
