//! Primitive images with one thing wrong, and an upload that does not look at them first.

use lab::error::HostError;
use link::frame::CRC;
use link::image::{WEIGHT_ROWS, stored_crc};
use link::message::{CHUNK_BYTES, ChunkData};
use link::{Name, Request};

use crate::{Arm, expect};

/// Places of the header's fields and of the first real, from `docs/image-format.md`.
const SCHEMA: usize = 4;
const LENGTH: usize = 8;
const MODEL: usize = 12;
const KERNELS: usize = 48;
const REALS: usize = 60;

/// Reals that every image has between header and tables.
const FIXED_REALS: usize = 75;

/// Real numbers of an image that the tests change, counted from the end of the header.
#[derive(Clone, Copy, Debug)]
#[repr(usize)]
pub enum Real {
    /// Duration as taught, s.
    Duration = 0,
    /// Stiffness of the position system.
    Stiffness = 3,
    /// w of the start orientation.
    StartOrientation = 14,
    /// Angle of joint 2 at the goal, rad.
    GoalJoint2 = 54,
}

/// The image with other bytes at a place, and a check sum that fits them.
fn patched(image: &[u8], at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut image = image.to_vec();
    image[at..at + bytes.len()].copy_from_slice(bytes);
    sealed(image)
}

/// Puts the right check sum at the end.
fn sealed(mut image: Vec<u8>) -> Vec<u8> {
    let covered = image.len() - 4;
    let crc = CRC.checksum(&image[..covered]);
    image[covered..].copy_from_slice(&crc.to_le_bytes());
    image
}

/// With another real number somewhere.
#[must_use]
pub fn with_real(image: &[u8], real: Real, value: f32) -> Vec<u8> {
    patched(image, REALS + 4 * real as usize, &value.to_le_bytes())
}

/// Of another layout.
#[must_use]
pub fn of_schema(image: &[u8], schema: u16) -> Vec<u8> {
    patched(image, SCHEMA, &schema.to_le_bytes())
}

/// Made for another model of the arm.
#[must_use]
pub fn of_model(image: &[u8], model: u32) -> Vec<u8> {
    patched(image, MODEL, &model.to_le_bytes())
}

/// With a wrong check sum at its end.
#[must_use]
pub fn with_wrong_crc(image: &[u8]) -> Vec<u8> {
    let mut image = image.to_vec();
    if let Some(last) = image.last_mut() {
        *last ^= 0x40;
    }
    image
}

/// A whole and sound image, but for the number of its kernels.
#[must_use]
pub fn with_kernels(image: &[u8], kernels: u16) -> Vec<u8> {
    let tables = REALS + 4 * FIXED_REALS;
    let mut longer = image[..tables].to_vec();
    longer.resize(tables + 4 * WEIGHT_ROWS * usize::from(kernels) + 4, 0);
    let length = longer.len() as u32;
    longer[LENGTH..LENGTH + 4].copy_from_slice(&length.to_le_bytes());
    longer[KERNELS..KERNELS + 2].copy_from_slice(&kernels.to_le_bytes());
    sealed(longer)
}

/// Uploads bytes as they are, announced with the check sum of what is sent.
///
/// # Errors
/// Asserts that the device refuses, and with which reason.
pub fn upload_unseen(arm: &mut Arm, name: &str, image: &[u8]) -> Result<(), HostError> {
    let length = image.len() as u32;
    arm.request(&Request::UploadBegin { name: expect(Name::new(name)), length, crc: stored_crc(image) })?;
    for (index, part) in image.chunks(CHUNK_BYTES).enumerate() {
        let data = ChunkData::from_slice(part).unwrap_or_default();
        let offset = (index * CHUNK_BYTES) as u32;
        arm.request(&Request::UploadChunk { offset, data })?;
    }
    arm.request(&Request::UploadCommit).map(|_| ())
}
