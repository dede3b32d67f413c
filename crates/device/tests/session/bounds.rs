//! Forged images with a right check sum (faults H2 and H5): no number of an image may be absurd, nor the plan it gives.

use control::LoadError;
use control::plan::bounds::Quantity;
use control::plan::primitive::RowGroup;
use device::PrimitiveDefect;
use link::image::ExpectationMarks;
use link::{Refusal, Reply, Request, RunOptions};

use crate::rig::{Rig, image, image_with};

/// Bytes before the reals of an image, and behind them.
const HEADER: usize = 60;
const CRC: usize = 4;

/// A check sum that fits.
fn sealed(mut image: Vec<u8>) -> Vec<u8> {
    let covered = image.len() - CRC;
    let crc = link::frame::CRC.checksum(&image[..covered]);
    image[covered..].copy_from_slice(&crc.to_le_bytes());
    image
}

/// An image with every table.
fn full() -> Vec<u8> {
    image_with("forged", 3.0, 10, |content| {
        content.marks = ExpectationMarks {
            recorded_duration: 3.0,
            payload_mass: 0.5,
            payload_centre: [0.0, 0.0, 0.1],
            filter_cutoff: control::sense::wrench::WRENCH_CUT_OFF as f32,
            trials: 5.0,
            spread_floor: 0.05,
        };
        (content.k1, content.k2, content.expected_mean) = (&[4.0; 10], &[1.0; 9], &[0.0; 2 * 9]);
        (content.statistics_trials, content.statistics_mean, content.statistics_spread) =
            (3, &[0.1; 2 * 12], &[0.5; 2 * 12]);
    })
}

fn refusal(rig: &mut Rig, image: &[u8]) -> Option<(Refusal, [u32; 2])> {
    match rig.upload("forged", image) {
        Some(Reply::Refused { reason, detail, .. }) => Some((reason, detail)),
        Some(Reply::Accepted { .. }) => None,
        other => panic!("{other:?}"),
    }
}

#[test]
fn h5_no_number_of_an_image_may_be_absurd() {
    let sound = full();
    let mut rig = Rig::greeted();
    assert_eq!(refusal(&mut rig, &sound), None, "the image itself is sound");
    let mut accepted = Vec::new();
    for place in (HEADER..sound.len() - CRC).step_by(4) {
        for value in [1e30f32, -1e30, 3e38, 1e7, -1e7, f32::NAN, f32::INFINITY] {
            let mut forged = sound.clone();
            forged[place..place + 4].copy_from_slice(&value.to_le_bytes());
            if refusal(&mut rig, &sealed(forged)).is_none() {
                accepted.push(((place - HEADER) / 4, value));
            }
        }
    }
    assert!(accepted.is_empty(), "{accepted:?}");
}

#[test]
fn h5_what_no_arm_has_is_refused_with_its_name() {
    type Change = fn(&mut link::image::ImageContent<&[f32]>);
    let cases: [(Change, Quantity); 8] = [
        (|content| content.marks.payload_mass = -5.0, Quantity::Load),
        (|content| content.marks.payload_centre[1] = 0.6, Quantity::Load),
        (|content| content.marks.trials = -1.0, Quantity::Recording),
        (|content| content.marks.spread_floor = 2.0, Quantity::Recording),
        (|content| content.start_velocity.position[2] = 40.0, Quantity::StartVelocity(RowGroup::Position)),
        (|content| content.start_velocity.hand[0] = -40.0, Quantity::StartVelocity(RowGroup::Hand)),
        (|content| (content.stiffness[1], content.damping[1]) = (2e4, 282.0), Quantity::Gain(RowGroup::Orientation)),
        (|content| (content.clamps.position, content.k1, content.k2) = (1.5, &[1.0; 10], &[1.0; 9]), {
            Quantity::Displacement(RowGroup::Position)
        }),
    ];
    let mut rig = Rig::greeted();
    for (change, quantity) in cases {
        let answer = refusal(&mut rig, &image_with("forged", 3.0, 10, change));
        let defect = PrimitiveDefect::from(LoadError::Bound(quantity));
        assert_eq!(answer, Some((Refusal::PrimitiveInvalid, defect.0)), "{quantity:?}");
        assert_eq!(defect.to_string(), quantity.to_string(), "the words arrive");
    }
    // What comes after: a sound image is taken, and runs.
    rig.store("forged", &image("forged", 3.0, 10));
    rig.commanded(Request::Run { name: link::Name::new("forged").unwrap(), options: RunOptions::default() });
}

#[test]
fn h2_weights_that_throw_one_joint_are_refused_at_load() {
    let kernels = 20;
    let mut rig = Rig::greeted();
    for (stiffness, damping) in [(1e6, 2000.0), (1e4, 140.0), (2000.0, 89.0), (200.0, 28.28)] {
        for (row, size) in (0..17).flat_map(|row| [1.0, 10.0, 30.0, 50.0].map(|size| (row, size))) {
            if row >= 13 && size < 10.0 {
                // Digits are light: what is slow enough for them is not refused.
                continue;
            }
            let mut weights = vec![0.0; 17 * kernels];
            for (kernel, weight) in weights[row * kernels..][..kernels].iter_mut().enumerate() {
                *weight = if kernel % 8 < 4 { size } else { -size };
            }
            let weights = &*weights.leak();
            let forged = image_with("forged", 0.5, kernels, |content| {
                (content.stiffness, content.damping, content.weights) = ([stiffness; 4], [damping; 4], weights);
            });
            let answer = refusal(&mut rig, &forged);
            let refused = answer.map(|(reason, _)| reason) == Some(Refusal::PrimitiveInvalid);
            assert!(refused, "K {stiffness}, row {row}, weights {size}: {answer:?}");
        }
    }
}
