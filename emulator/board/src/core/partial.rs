//! Parts of words in the tightly coupled data memory, which a reset may lose.
//!
//! The memory has check bits for each word of 32 bits. A whole word that is written goes straight in. A part of one
//! waits beside the memory for the rest of it, until a part of another word is written or that word as a whole; a reset
//! forgets what waits (RM0433 2.4, "incomplete word"; AN5342). The even and the odd words are two memories, with a
//! place to wait in each.

/// Bytes of a word.
const WORD: u32 = 4;

/// A word of which a part waits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Waiting {
    address: u32,
    /// Content of the memory meanwhile.
    held: u32,
}

/// The word that waits, of the even and of the odd ones.
#[derive(Debug, Default)]
pub struct PartialWords([Option<Waiting>; 2]);

impl PartialWords {
    /// So many bytes are about to be written at an address. `read` tells what a word there holds now.
    pub(crate) fn write(&mut self, address: u32, bytes: u32, mut read: impl FnMut(u32) -> u32) {
        let end = address.saturating_add(bytes);
        for word in (address & !(WORD - 1)..end).step_by(WORD as usize) {
            let Some(place) = self.0.get_mut((word / WORD % 2) as usize) else { continue };
            let waits = place.is_some_and(|waiting| waiting.address == word);
            let is_whole = address <= word && word + WORD <= end;
            if is_whole && waits {
                *place = None;
            } else if !is_whole && !waits {
                *place = Some(Waiting { address: word, held: read(word) });
            }
        }
    }

    /// A reset: the words that are as they were before, by address.
    pub(crate) fn forget(&mut self) -> impl Iterator<Item = (u32, u32)> + use<> {
        std::mem::take(&mut self.0).into_iter().flatten().map(|waiting| (waiting.address, waiting.held))
    }
}

#[cfg(test)]
mod tests {
    use super::PartialWords;

    fn lost_of(writes: &[(u32, u32)]) -> Vec<u32> {
        let mut partial = PartialWords::default();
        for (address, bytes) in writes {
            partial.write(*address, *bytes, |word| word + 1);
        }
        partial
            .forget()
            .map(|(address, held)| {
                assert_eq!(held, address + 1, "the content before the first part");
                address
            })
            .collect()
    }

    #[test]
    fn the_last_part_of_a_word_is_lost_in_each_of_the_two_memories() {
        assert_eq!(lost_of(&[(0x100, 1), (0x104, 2)]), [0x100, 0x104]);
        assert_eq!(lost_of(&[(0x100, 1), (0x101, 1), (0x102, 2)]), [0x100], "all four bytes, but none at once");
        assert_eq!(lost_of(&[(0x100, 1), (0x109, 1)]), [0x108], "a part of another word drives the first one in");
        assert_eq!(lost_of(&[(0x102, 4)]), [0x100, 0x104], "across a boundary");
    }

    #[test]
    fn whole_words_are_not_lost_and_only_the_same_one_drives_a_part_in() {
        assert_eq!(lost_of(&[(0x100, 4), (0x108, 8)]), [0; 0]);
        assert_eq!(lost_of(&[(0x100, 1), (0x108, 4)]), [0x100]);
        assert_eq!(lost_of(&[(0x100, 1), (0x100, 4)]), [0; 0]);
    }
}
