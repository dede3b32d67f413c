//! Images survive a round trip, and anything else than a whole, sound image is refused.

use crate::samples::Tables;
use link::image::{
    EXPECTATION_POINTS_LIMIT, GAIN_POINTS_LIMIT, Hemisphere, IMAGE_BYTES_LIMIT, IMAGE_SCHEMA, ImageContent,
    KERNEL_LIMIT, OrientationError, STATISTICS_POINTS_LIMIT, Waypoint, WaypointVelocity, image_bytes, legible_name,
    renamed_head, stored_crc,
};
use link::{ImageError, Name, PrimitiveImage};
use proptest::prelude::*;

/// Offsets of the header, as in docs/image-format.md.
const SCHEMA: usize = 4;
const FLAGS: usize = 6;
const NAME: usize = 16;
const KERNELS: usize = 48;
const FIRST_REAL: usize = 60;

/// Makes the check sum right again, as somebody would who writes images on purpose.
fn sealed(mut image: Vec<u8>) -> Vec<u8> {
    let crc = stored_crc(&image);
    let end = image.len() - 4;
    image[end..].copy_from_slice(&crc.to_le_bytes());
    image
}

fn refusal(image: &[u8]) -> ImageError {
    PrimitiveImage::parse(image).expect_err("this should be no image")
}

#[test]
fn what_was_written_is_what_is_read() {
    let tables = Tables::new(5, 3, 4, 6);
    let bytes = tables.image();
    let image = PrimitiveImage::parse(&bytes).unwrap();
    let (read, written) = (image.content(), tables.content());
    assert_eq!(image.name(), &Name::new("side-grasp").unwrap());
    assert_eq!(image.crc().to_le_bytes(), bytes[bytes.len() - 4..]);
    assert_eq!(image.bytes(), bytes);
    assert!(image.has_expectation() && image.has_statistics());
    assert_eq!(read.model_hash, written.model_hash);
    assert_eq!(
        (read.duration, read.alpha, read.activation, read.kernels),
        (written.duration, written.alpha, written.activation, written.kernels)
    );
    assert_eq!((read.stiffness, read.damping), (written.stiffness, written.damping));
    assert_eq!((read.orientation_error, read.hemisphere), (written.orientation_error, written.hemisphere));
    assert_eq!((read.start, read.start_velocity, read.goal), (written.start, written.start_velocity, written.goal));
    assert_eq!(
        (read.clamps, read.marks, read.statistics_trials),
        (written.clamps, written.marks, written.statistics_trials)
    );
    for (read, written) in [
        (read.k1, written.k1),
        (read.k2, written.k2),
        (read.weights, written.weights),
        (read.expected_mean, written.expected_mean),
        (read.statistics_mean, written.statistics_mean),
        (read.statistics_spread, written.statistics_spread),
    ] {
        assert_eq!(read.iter().collect::<Vec<_>>(), written);
        assert_eq!(read.get(1), written.get(1).copied());
        assert_eq!(read.get(written.len()), None);
        assert_eq!(read.copy_to(&mut vec![0.0; written.len()]).unwrap(), written);
        assert_eq!(read.copy_to(&mut vec![0.0; written.len() - 1]), None);
    }
}

#[test]
fn the_largest_image_has_the_stated_size() {
    let image = Tables::new(KERNEL_LIMIT, GAIN_POINTS_LIMIT, EXPECTATION_POINTS_LIMIT, STATISTICS_POINTS_LIMIT).image();
    assert_eq!(image.len(), IMAGE_BYTES_LIMIT);
    assert!(PrimitiveImage::parse(&image).is_ok());
    assert_eq!(image_bytes(50, 1, 1, 0, 0), 60 + 4 * (75 + 19 + 850) + 4);
}

#[test]
fn a_primitive_without_feedback_and_expectation_is_an_image() {
    let bytes = Tables::new(2, 0, 0, 0).image();
    let image = PrimitiveImage::parse(&bytes).unwrap();
    assert!(!image.has_expectation() && !image.has_statistics() && image.content().k1.is_empty());
}

#[test]
fn c6_every_single_flipped_bit_is_refused() {
    let image = Tables::new(10, 2, 10, 3).image();
    for bit in 0..8 * image.len() {
        let mut damaged = image.clone();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(PrimitiveImage::parse(&damaged).is_err(), "bit {bit}");
    }
}

#[test]
fn every_shortened_or_lengthened_image_is_refused() {
    let image = Tables::new(3, 1, 2, 1).image();
    for length in 0..image.len() {
        assert!(PrimitiveImage::parse(&image[..length]).is_err(), "{length}");
    }
    assert!(matches!(refusal(&[image, vec![0]].concat()), ImageError::Length { .. }));
}

#[test]
fn c7_another_schema_is_named_even_when_all_else_differs() {
    let mut image = Tables::new(3, 1, 2, 1).image();
    image[SCHEMA] = 9;
    assert_eq!(refusal(&image), ImageError::Schema { found: 9 });
    assert_eq!(refusal(&image[..6]), ImageError::Schema { found: 9 });
    image[0] = b'X';
    assert_eq!(refusal(&image), ImageError::Magic);
}

/// Images of every layout there was, by its number: `images/layout-N.bin`. They are added to, never changed.
#[test]
fn c7_the_image_kept_of_each_layout_is_read_to_the_byte_or_refused_by_its_number() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/link/images");
    let of = |layout: u16| folder.join(format!("layout-{layout}.bin"));
    let today = Tables::new(5, 3, 4, 6).image();
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() && !of(IMAGE_SCHEMA).exists() {
        std::fs::write(of(IMAGE_SCHEMA), &today).expect("a folder of this crate");
    }
    let kept =
        std::fs::read(of(IMAGE_SCHEMA)).expect("UPDATE_DOCUMENTS=1 cargo test -p link writes that of a new layout");
    assert_eq!(kept, today, "the layout has changed and its number has not");
    assert_eq!(PrimitiveImage::parse(&kept).map(|image| image.bytes()), Ok(&kept[..]));
    for layout in 1..IMAGE_SCHEMA {
        // Of layouts 1 and 2, which no release had, the head is kept.
        let older = std::fs::read(of(layout)).expect("an older one is kept");
        assert_eq!(refusal(&older), ImageError::Schema { found: layout });
    }
}

#[test]
fn a_not_finite_real_is_refused_wherever_it_is() {
    let image = Tables::new(2, 1, 2, 1).image();
    let reals = (image.len() - FIRST_REAL - 4) / 4;
    for real in 0..reals {
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            let mut damaged = image.clone();
            damaged[FIRST_REAL + 4 * real..][..4].copy_from_slice(&bad.to_le_bytes());
            assert_eq!(refusal(&sealed(damaged)), ImageError::NotFinite { real: real as u32 });
        }
    }
}

#[test]
fn counts_beyond_the_limits_are_refused() {
    let with_counts = |kernels: u16, k1: u16, k2: u16, expectation: u16, statistics: u16| {
        let length = image_bytes(kernels.into(), k1.into(), k2.into(), expectation.into(), statistics.into());
        let mut image = Tables::new(2, 0, 0, 0).image();
        image.resize(length, 0);
        image[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        for (index, count) in [kernels, k1, k2, expectation, statistics].into_iter().enumerate() {
            image[KERNELS + 2 * index..][..2].copy_from_slice(&count.to_le_bytes());
        }
        sealed(image)
    };
    assert!(PrimitiveImage::parse(&with_counts(100, 32, 1, 128, 64)).is_ok());
    assert_eq!(refusal(&with_counts(101, 0, 0, 0, 0)), ImageError::Kernels { found: 101 });
    assert_eq!(refusal(&with_counts(1, 0, 0, 0, 0)), ImageError::Kernels { found: 1 });
    assert_eq!(refusal(&with_counts(2, 33, 1, 0, 0)), ImageError::GainPoints { found: 33 });
    assert_eq!(refusal(&with_counts(2, 1, 0, 0, 0)), ImageError::GainPoints { found: 1 });
    assert_eq!(refusal(&with_counts(2, 0, 0, 129, 0)), ImageError::ExpectationPoints { found: 129 });
    assert_eq!(refusal(&with_counts(2, 0, 0, 0, 65)), ImageError::StatisticsPoints { found: 65 });
    assert_eq!(refusal(&with_counts(u16::MAX, 0, 0, 0, 0)), ImageError::Kernels { found: 65_535 });

    let mut lying = Tables::new(2, 0, 0, 0).image();
    lying[KERNELS] = 3;
    assert!(matches!(refusal(&sealed(lying)), ImageError::Length { .. }), "counts that ask for another length");
}

#[test]
fn bad_names_and_unknown_flags_are_refused() {
    let image = Tables::new(2, 0, 0, 0).image();
    for name in [b"../etc".as_slice(), b"a b", b"", b"\xFF\xFE"] {
        let mut damaged = image.clone();
        damaged[NAME..NAME + 32].fill(0);
        damaged[NAME..NAME + name.len()].copy_from_slice(name);
        assert_eq!(refusal(&sealed(damaged)), ImageError::Name, "{name:?}");
    }
    let mut hidden = image.clone();
    hidden[NAME + 31] = b'x';
    assert_eq!(refusal(&sealed(hidden)), ImageError::Name, "text behind the padding");
    let mut flags = image;
    flags[FLAGS + 1] = 0x80;
    assert!(matches!(refusal(&sealed(flags)), ImageError::Flags { .. }));
}

#[test]
fn each_flag_has_its_documented_bit_and_is_read_as_it_was_written() {
    let tables = Tables::new(2, 0, 0, 0);
    let mut bytes = vec![0; 8192];
    for (flags, orientation_error, hemisphere) in [
        (0, OrientationError::Quaternion, Hemisphere::Demonstrated),
        (1, OrientationError::RotationVector, Hemisphere::Demonstrated),
        (2, OrientationError::Quaternion, Hemisphere::Nearest),
        (3, OrientationError::RotationVector, Hemisphere::Nearest),
    ] {
        let content = ImageContent { orientation_error, hemisphere, ..tables.content() };
        let length = content.encode(&Name::new("a").unwrap(), &mut bytes).unwrap();
        assert_eq!(bytes[FLAGS..FLAGS + 2], [flags, 0]);
        let read = PrimitiveImage::parse(&bytes[..length]).unwrap();
        let read = read.content();
        assert_eq!((read.orientation_error, read.hemisphere), (orientation_error, hemisphere));
    }
}

#[test]
fn a_moment_in_single_precision_is_the_same_moment() {
    let moment =
        Waypoint { position: [0.25, 0.5, 1.0], orientation: [1.0, 0.0, -0.5, 0.5], posture: [2.0; 7], hand: [3.0; 4] };
    let there: Waypoint = moment.single();
    assert_eq!((there.position, there.orientation), ([0.25, 0.5, 1.0], [1.0, 0.0, -0.5, 0.5]));
    assert_eq!((there.posture, there.hand), ([2.0; 7], [3.0; 4]));
    let speeds = WaypointVelocity {
        position: [0.25, 0.5, 1.0],
        orientation: [4.0, 5.0, 6.0],
        posture: [2.0; 7],
        hand: [3.0; 4],
    };
    let there: WaypointVelocity = speeds.single();
    assert_eq!((there.position, there.orientation), ([0.25, 0.5, 1.0], [4.0, 5.0, 6.0]));
    assert_eq!((there.posture, there.hand), ([2.0; 7], [3.0; 4]));
}

#[test]
fn every_refusal_says_what_is_wrong_with_its_numbers() {
    for (refusal, words) in [
        (ImageError::TooShort { length: 7 }, &["7 bytes"][..]),
        (ImageError::Magic, &["not a primitive"]),
        (ImageError::Schema { found: 9 }, &["version 9", "version 3"]),
        (ImageError::Length { expected: 70, found: 71 }, &["have 70", "has 71"]),
        (ImageError::Crc { computed: 0xAB, stored: 0xCD }, &["0x000000ab", "0x000000cd"]),
        (ImageError::Name, &["name"]),
        (ImageError::Flags { found: 0x80 }, &["0x0080"]),
        (ImageError::Kernels { found: 101 }, &["101", "100"]),
        (ImageError::GainPoints { found: 33 }, &["33", "32"]),
        (ImageError::ExpectationPoints { found: 129 }, &["129", "128"]),
        (ImageError::StatisticsPoints { found: 65 }, &["65", "64"]),
        (ImageError::NotFinite { real: 12 }, &["12", "not finite"]),
        (ImageError::Shape, &["shape"]),
    ] {
        let text = refusal.to_string();
        assert!(words.iter().all(|word| text.contains(word)), "{text}");
    }
}

#[test]
fn a_name_is_read_from_the_first_bytes_of_a_damaged_image() {
    let mut image = Tables::new(2, 0, 0, 0).image();
    image[FIRST_REAL] ^= 1;
    assert!(matches!(refusal(&image), ImageError::Crc { .. }));
    let head = &image[..NAME + 32];
    assert_eq!(legible_name(head), Some(Name::new("side-grasp").unwrap()));
    assert_eq!(legible_name(&image), legible_name(head), "what follows does not matter");
    assert_eq!(legible_name(&head[..NAME + 31]), None, "not all of it");
    image[NAME] = 0xFF;
    assert_eq!(legible_name(&image), None);
}

#[test]
fn a_renamed_head_differs_in_nothing_but_the_whole_name() {
    let image = Tables::new(2, 0, 0, 0).image();
    let head = renamed_head(&image, &Name::new("b").unwrap()).unwrap();
    assert_eq!((&head[..NAME], head.len()), (&image[..NAME], NAME + 32));
    assert_eq!((head[NAME], &head[NAME + 1..]), (b'b', &[0; 31][..]), "nothing of the longer name is left");
    assert_eq!(renamed_head(&image[..NAME + 31], &Name::new("b").unwrap()), None);
}

#[test]
fn what_could_not_be_read_back_is_not_written() {
    let tables = Tables::new(4, 1, 2, 1);
    let mut out = vec![0; 8192];
    let name = Name::new("a").unwrap();
    let good = tables.content();
    let length = good.encode(&name, &mut out).unwrap();
    assert_eq!(good.encode(&name, &mut out[..length - 1]), Err(ImageError::Shape));

    let start = Waypoint { position: [0.0, f32::NAN, 0.0], ..good.start };
    let bad = ImageContent { start, ..good };
    assert_eq!(bad.encode(&name, &mut out), Err(ImageError::NotFinite { real: 12 }));
    let bad = ImageContent { kernels: 5, ..good };
    assert_eq!(bad.encode(&name, &mut out), Err(ImageError::Shape));
    let bad = ImageContent { k1: &good.k1[1..], ..good };
    assert_eq!(bad.encode(&name, &mut out), Err(ImageError::Shape));
    let bad = ImageContent { statistics_spread: &good.k1[..0], ..good };
    assert_eq!(bad.encode(&name, &mut out), Err(ImageError::Shape));
    let bad = ImageContent { k2: &good.k2[..0], ..good };
    assert_eq!(bad.encode(&name, &mut out), Err(ImageError::GainPoints { found: 1 }));
}

proptest! {
    #[test]
    fn any_bytes_are_harmless(bytes in prop::collection::vec(any::<u8>(), 0..2000)) {
        prop_assert!(PrimitiveImage::parse(&bytes).is_err());
    }

    #[test]
    fn any_counts_behind_a_right_check_sum_are_harmless(header in prop::collection::vec(any::<u8>(), 48), length in 60_usize..4000) {
        let mut image = Tables::new(2, 0, 0, 0).image();
        image.resize(length, 0);
        image[12..60].copy_from_slice(&header);
        image[FLAGS..FLAGS + 2].fill(0);
        image[8..12].copy_from_slice(&(length as u32).to_le_bytes());
        // It may be refused or, by luck, be an image; it must not panic.
        let _ = PrimitiveImage::parse(&sealed(image)).is_ok();
    }

    #[test]
    fn every_shape_within_the_limits_survives(kernels in 2_usize..=100, gains in 0_usize..=32, expectation in 0_usize..=128, statistics in 0_usize..=64) {
        let tables = Tables::new(kernels, gains, expectation, statistics);
        let bytes = tables.image();
        let image = PrimitiveImage::parse(&bytes).unwrap();
        prop_assert!(image.content().weights.iter().eq(tables.content().weights.iter().copied()));
        prop_assert!(image.content().expected_mean.iter().eq(tables.content().expected_mean.iter().copied()));
        prop_assert!(image.content().statistics_spread.iter().eq(tables.content().statistics_spread.iter().copied()));
    }
}
