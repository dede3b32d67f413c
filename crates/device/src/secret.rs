//! The secret in the form in which the device keeps it.
//!
//! ```text
//! "TacS" | layout u16 | 0 u16 | secret 16 bytes | CRC-32/ISCSI u32        little endian
//! ```
//! One that cannot be read neither opens the device nor locks people out: nothing is moved or changed until a person
//! has it keep another one, or none.

use link::frame::CRC;
use link::secret::SECRET_BYTES;
use link::{Secret, SecretState};

/// Bytes of a secret as it is kept.
pub const STORED_BYTES: usize = 28;

/// Begins every one, with the version of the form.
const HEAD: [u8; 8] = *b"TacS\x01\0\0\0";

/// The bytes that are kept.
#[must_use]
pub fn encode(secret: &Secret) -> [u8; STORED_BYTES] {
    let mut bytes = [0; STORED_BYTES];
    for (place, byte) in bytes.iter_mut().zip(HEAD.iter().chain(secret.bytes())) {
        *place = *byte;
    }
    if let Some((body, sum)) = bytes.split_last_chunk_mut::<4>() {
        *sum = CRC.checksum(body).to_le_bytes();
    }
    bytes
}

/// The secret as the device has kept it. The first variant is all zeros in memory.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum StoredSecret {
    /// There is none, or it was forgotten.
    #[default]
    Nothing,
    /// This one.
    Kept(Secret),
    /// There is one that is damaged, or of another layout.
    Unreadable,
}

impl StoredSecret {
    /// Reads what was kept; no bytes at all stand for a secret that was forgotten.
    #[must_use]
    pub fn read(bytes: &[u8]) -> Self {
        if bytes.is_empty() {
            return Self::Nothing;
        }
        Self::parse(bytes).map_or(Self::Unreadable, Self::Kept)
    }

    fn parse(bytes: &[u8]) -> Option<Secret> {
        let (body, sum) = bytes.split_last_chunk::<4>()?;
        let (head, secret) = body.split_first_chunk::<8>()?;
        let secret: [u8; SECRET_BYTES] = secret.try_into().ok()?;
        (CRC.checksum(body).to_le_bytes() == *sum && *head == HEAD).then_some(Secret::new(secret))
    }

    /// The same without its bytes, for a host.
    #[must_use]
    pub fn state(&self) -> SecretState {
        match self {
            Self::Nothing => SecretState::Nothing,
            Self::Kept(_) => SecretState::Kept,
            Self::Unreadable => SecretState::Unreadable,
        }
    }
}
