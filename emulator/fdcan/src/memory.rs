//! The message memory that both controllers share: 2560 words, random after power-up.

use crate::random::Random;

/// Words of the message memory.
pub const WORDS: u32 = 2560;

/// Content, and which words have been written since power-up.
#[derive(Clone, Debug)]
pub(crate) struct Memory {
    words: Vec<u32>,
    written: Vec<bool>,
}

impl Memory {
    /// The memory after power-up.
    pub(crate) fn new(random: &mut Random) -> Self {
        Self { words: (0..WORDS).map(|_| random.next()).collect(), written: vec![false; WORDS as usize] }
    }

    /// The word with this number; 0 behind the end.
    pub(crate) fn get(&self, word: u32) -> u32 {
        self.words.get(word as usize).copied().unwrap_or(0)
    }

    /// True if the word exists and has been written since power-up.
    pub(crate) fn is_written(&self, word: u32) -> bool {
        self.written.get(word as usize).copied().unwrap_or(false)
    }

    /// Turns a bit of a word over; behind the end there is none.
    pub(crate) fn flip(&mut self, word: u32, bit: u32) {
        if let Some(place) = self.words.get_mut(word as usize) {
            *place ^= 1 << (bit & 31);
        }
    }

    /// Writes a word; `false` if there is no such word.
    pub(crate) fn set(&mut self, word: u32, value: u32) -> bool {
        let Some(place) = self.words.get_mut(word as usize) else { return false };
        *place = value;
        if let Some(mark) = self.written.get_mut(word as usize) {
            *mark = true;
        }
        true
    }
}
