//! `Secret`: the number that a host proves to know before a device that keeps one moves or changes anything for it.
//!
//! ```text
//! proof = SipHash-2-4(secret, nonce u64 | session u16 | "proof" | 0)        message of 16 bytes, little endian
//! ```
//! Source: Aumasson and Bernstein, "SipHash: a fast short-input PRF", INDOCRYPT 2012. A proof tells nothing of the
//! secret but to those who try every secret there is, which is hopeless for one that was drawn at random.

use core::fmt;
use core::hash::Hasher as _;

use serde::{Deserialize, Serialize};
use siphasher::sip::SipHasher24;

/// Bytes of a secret.
pub const SECRET_BYTES: usize = 16;

/// Upper six bytes of the second word of a proof's message: no other hash under the secret has them.
const PROOF: u64 = u64::from_le_bytes(*b"\0\0proof\0");

/// Bytes drawn at random. They are not shown: neither in an error nor in a log.
#[derive(Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Secret([u8; SECRET_BYTES]);

impl Secret {
    /// The secret of these bytes.
    #[must_use]
    pub const fn new(bytes: [u8; SECRET_BYTES]) -> Self {
        Self(bytes)
    }

    /// Its bytes, for whoever has to keep it.
    #[must_use]
    pub const fn bytes(&self) -> &[u8; SECRET_BYTES] {
        &self.0
    }

    /// The answer to a challenge: it proves, under this session number, that its sender knows the secret.
    #[must_use]
    pub fn proof(&self, nonce: u64, session: u16) -> u64 {
        self.hash([nonce, PROOF | u64::from(session)])
    }

    /// A number that nobody can foresee who lacks the secret, or one of the words.
    #[must_use]
    pub fn hash(&self, words: impl IntoIterator<Item = u64>) -> u64 {
        let [a0, a1, a2, a3, a4, a5, a6, a7, b0, b1, b2, b3, b4, b5, b6, b7] = self.0;
        let first = u64::from_le_bytes([a0, a1, a2, a3, a4, a5, a6, a7]);
        let second = u64::from_le_bytes([b0, b1, b2, b3, b4, b5, b6, b7]);
        let mut hasher = SipHasher24::new_with_keys(first, second);
        for word in words {
            hasher.write_u64(word);
        }
        hasher.finish()
    }
}

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(..)")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The key of the vectors that the authors of SipHash have published: 0, 1, 2 ...
    const KEY: Secret = Secret::new([0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15]);

    #[test]
    fn the_hash_is_siphash_2_4_as_its_authors_published_it() {
        let words = [0x0706_0504_0302_0100, 0x0f0e_0d0c_0b0a_0908];
        assert_eq!(KEY.hash([]), 0x726f_db47_dd0e_0e31);
        assert_eq!(KEY.hash([words[0]]), 0x93f5_f579_9a93_2462);
        assert_eq!(KEY.hash(words), 0x3f2a_cc7f_57c2_9bdb);
    }

    #[test]
    fn a_proof_is_of_its_nonce_its_session_and_its_secret() {
        let proof = KEY.proof(7, 300);
        assert_eq!(proof, KEY.hash([7, u64::from_le_bytes(*b"\x2c\x01proof\0")]));
        // The example of `docs/protocol.md`, computed with another program.
        assert_eq!(proof, 0x8a86_da1b_cd25_6a5e);
        assert!(include_str!("../../../docs/protocol.md").contains("0x8a86da1bcd256a5e"));
        let mut other = *KEY.bytes();
        other[15] ^= 1;
        for wrong in [KEY.proof(8, 300), KEY.proof(7, 301), Secret::new(other).proof(7, 300), KEY.hash([7, 300])] {
            assert_ne!(proof, wrong);
        }
    }

    #[test]
    fn a_secret_is_not_shown() {
        extern crate alloc;
        assert_eq!(alloc::format!("{:?}", Secret::new([0x5A; SECRET_BYTES])), "Secret(..)");
    }
}
