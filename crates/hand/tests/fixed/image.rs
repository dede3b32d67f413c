//! The reader that never holds an image against the one that does.

use hand::image::{ImageReader, Summary};
use hand::{FingerPrimitive, FingerTables};
use link::image::{PrimitiveImage, stored_crc};
use link::{Name, Refusal};

use crate::common::{Movement, Random};

fn read(image: &[u8], chunk: usize) -> Result<Summary, (Refusal, [u32; 2])> {
    let mut tables = Box::new(FingerTables::EMPTY);
    let mut reader = ImageReader::new(image.len() as u32);
    image.chunks(chunk).for_each(|part| reader.take(part, &mut tables));
    let summary = reader.finish(&tables, stored_crc(image))?;
    let mut primitive = Box::new(FingerPrimitive::EMPTY);
    primitive.assign(&tables)?;
    Ok(summary)
}

#[test]
fn every_chunking_gives_the_same_summary_as_the_whole_image() {
    let image = Movement::closing(50, 5.0, 0.3).feeling().image("grip");
    let whole = PrimitiveImage::parse(&image).expect("sound");
    for chunk in [1, 3, 64, 192, 100_000] {
        let summary = read(&image, chunk).expect("sound");
        assert_eq!(summary.name, Name::new("grip").expect("a name"));
        assert_eq!((summary.crc, summary.length as usize), (whole.crc(), image.len()));
        assert_eq!(summary.model, whole.content().model_hash);
        assert!(summary.expectation && summary.kernels == 50);
    }
}

#[test]
fn each_damaged_byte_is_refused() {
    let image = Movement::closing(10, 5.0, 0.3).image("grip");
    for place in 0..image.len() {
        let mut damaged = image.clone();
        damaged[place] ^= 0x10;
        assert!(PrimitiveImage::parse(&damaged).is_err());
        // Announced with the check sum of what left the host, as a damaged line would have it.
        let mut tables = Box::new(FingerTables::EMPTY);
        let mut reader = ImageReader::new(damaged.len() as u32);
        reader.take(&damaged, &mut tables);
        let result = reader.finish(&tables, stored_crc(&image));
        assert!(result.is_err(), "byte {place}");
    }
}

#[test]
fn images_that_the_whole_reader_refuses_are_refused_for_the_same_reason() {
    let sound = Movement::closing(10, 5.0, 0.3).image("grip");
    let sealed = |mut image: Vec<u8>| {
        let covered = image.len() - 4;
        let crc = link::frame::CRC.checksum(&image[..covered]);
        image[covered..].copy_from_slice(&crc.to_le_bytes());
        image
    };
    let patched = |at: usize, bytes: &[u8]| {
        let mut image = sound.clone();
        image[at..at + bytes.len()].copy_from_slice(bytes);
        sealed(image)
    };
    let cases = [
        patched(0, b"NOPE"),
        patched(4, &9_u16.to_le_bytes()),
        patched(6, &0x80_u16.to_le_bytes()),
        patched(8, &7_u32.to_le_bytes()),
        patched(16, b"\xFF"),
        patched(48, &200_u16.to_le_bytes()),
        patched(50, &33_u16.to_le_bytes()),
        patched(54, &200_u16.to_le_bytes()),
        patched(60, &f32::NAN.to_le_bytes()),
        patched(sound.len() - 40, &f32::INFINITY.to_le_bytes()),
    ];
    for image in cases {
        let error = PrimitiveImage::parse(&image).expect_err("unsound");
        let (reason, detail) = read(&image, 192).expect_err("unsound");
        match error {
            link::image::ImageError::Kernels { found } => {
                assert_eq!((reason, detail[0]), (Refusal::TooManyKernels, found))
            }
            error => assert_eq!((reason, detail), (Refusal::ImageInvalid, [error.code(), error.number()])),
        }
    }
}

#[test]
fn movements_outside_the_numbers_are_refused_with_a_reason() {
    let movement = || Movement::closing(10, 5.0, 0.3);
    let refused = |movement: Movement| read(&movement.image("grip"), 192).expect_err("outside").0;
    let mut heavy = movement();
    heavy.weights[2][3] = 1000.0;
    for unfit in [
        heavy,
        Movement { duration: 0.1, ..movement() },
        Movement { duration: 1e6, ..movement() },
        Movement { alpha: 1.0, ..movement() },
        Movement { activation: 0.99, ..movement() },
        Movement { stiffness: 1e6, ..movement() },
        Movement { damping: 1e5, ..movement() },
        Movement { stiffness: -1.0, ..movement() },
        Movement { goal: [0.0, 9.0, 0.0, 0.0], ..movement() },
        Movement { start: [0.0, -1.0, 0.0, 0.0], ..movement() },
        Movement { start_velocity: [99.0; 4], ..movement() },
        Movement { limit: 100.0, ..movement() },
        Movement { k1: vec![[-1.0; 3]; 2], k2: vec![[1.0; 3]; 2], ..movement() },
        Movement { expected: vec![[2e5; 3]; 4], ..movement() },
    ] {
        assert_eq!(refused(unfit), Refusal::PrimitiveInvalid);
    }
}

#[test]
fn a_refused_upload_leaves_the_movement_that_was_there() {
    let mut primitive = Movement::closing(10, 5.0, 0.3).feeling().fixed();
    let sound = FingerTables { duration: 5.0, ..FingerTables::EMPTY };
    assert!(primitive.assign(&sound).is_err(), "no kernels");
    assert!(primitive.is_whole() && primitive.has_expectation());
    assert_eq!(primitive.movement().basis().count(), 10);
}

#[test]
fn a_recorded_duration_below_the_resolution_of_the_numbers_leaves_the_movement_that_was_there() {
    let mut primitive = Movement::closing(10, 5.0, 0.3).feeling().fixed();
    let movement = Movement { recorded_duration: 1e-12, ..Movement::closing(20, 5.0, 0.3).feeling() };
    let mut tables = Box::new(FingerTables::EMPTY);
    let image = movement.image("grip");
    ImageReader::new(image.len() as u32).take(&image, &mut tables);
    assert!(primitive.assign(&tables).is_err());
    assert!(primitive.is_whole() && primitive.has_expectation());
    assert_eq!(primitive.movement().basis().count(), 10);
}

#[test]
fn random_bytes_are_refused_and_nothing_panics() {
    let mut random = Random(42);
    let sound = Movement::closing(10, 5.0, 0.3).feeling().image("grip");
    for round in 0..20_000 {
        let length = (random.bits() % 400) as usize;
        let mut bytes: Vec<u8> = (0..length).map(|_| random.bits() as u8).collect();
        if round % 2 == 0 {
            // A sound head with a random rest.
            let keep = (random.bits() as usize) % sound.len().min(400);
            bytes.splice(0..keep.min(bytes.len()), sound[..keep.min(bytes.len())].iter().copied());
        }
        assert!(read(&bytes, 61).is_err());
    }
}

#[test]
fn h5_no_number_that_a_hand_reads_may_be_absurd() {
    let sound = Movement::closing(10, 5.0, 0.3).feeling().image("grip");
    let forged = |place: usize, value: f32| {
        let mut image = sound.clone();
        image[60 + 4 * place..][..4].copy_from_slice(&value.to_le_bytes());
        let covered = image.len() - 4;
        let crc = link::frame::CRC.checksum(&image[..covered]);
        image[covered..].copy_from_slice(&crc.to_le_bytes());
        image
    };
    assert!(read(&sound, 192).is_ok());
    // Timing, K, D, start, its velocity, goal, clamp, the marks of the recording; then the gains of the fingers.
    let (k1, k2, weights) = (75, 75 + 9 * 10, 75 + 9 * 10 + 9 * 9);
    let expected = weights + 17 * 10;
    let own = [0, 1, 2, 6, 10, 66, 67, 68, 69, 70, 71, 72, 73, 74].into_iter();
    let own = own.chain(25..29).chain(42..46).chain(60..64);
    let own = own.chain(k1 + 7..k1 + 10).chain(k2 + 6..k2 + 9).chain(weights + 130..weights + 170);
    for place in own.chain(expected + 6..expected + 9) {
        for value in [1e30, -1e30, 3e38, 1e7, -1e7, f32::NAN, f32::INFINITY] {
            assert!(read(&forged(place, value), 192).is_err(), "real {place} of {value}");
        }
    }
    // No gauge measures more than its drive can press with.
    for (place, value) in [(expected + 6, 1.3), (expected + 8, -20.0), (42, 40.0), (68, -5.0)] {
        assert!(read(&forged(place, value), 192).is_err(), "real {place} of {value}");
    }
}
