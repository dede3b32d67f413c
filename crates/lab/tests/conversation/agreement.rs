//! The host against the device, about what is a primitive: each refuses what the other refuses.

use std::path::Path;

use control::plan::load;
use lab::primitive_file::{ExpectationTable, FeedbackTables, Hemisphere, OrientationError, PrimitiveFile};
use lab::primitive_file::{PrimitiveFileError, StatisticsTable};
use link::PrimitiveImage;

use crate::fixture::{connected, image};

/// Primitives that are tried.
const COUNT: u64 = 400;

/// Values at which something begins or ends to be allowed, and some that no f32 holds.
const EDGES: [f64; 30] = [
    0.0, -0.0, -1.0, 1e-60, 1e-45, 1e-6, 1e-3, 0.05, 0.1, 0.5, 0.95, 1.0, 2.0, 3.0, 4.0, 7.0, 8.0, 12.0, 20.0, 40.0,
    50.0, 120.0, 128.0, 1e4, 1e5, 1e6, 65_535.0, 1e20, 3.5e38, 1e300,
];

/// Numbers that look random, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn below(&mut self, bound: usize) -> usize {
        // Splitmix64.
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut value = self.0;
        value = (value ^ (value >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        value = (value ^ (value >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((value ^ (value >> 31)) % bound.max(1) as u64) as usize
    }

    /// A number from 0 to 1.
    fn unit(&mut self) -> f64 {
        self.below(1 << 30) as f64 / f64::from(1 << 30)
    }

    /// Another value for this one.
    fn instead_of(&mut self, old: f64) -> f64 {
        let edge = EDGES[self.below(EDGES.len())];
        match self.below(6) {
            0 => edge,
            1 => edge * (1.0 + 1e-3 * (self.unit() - 0.5)),
            2 => f64::from((edge as f32).next_up()),
            3 => -old,
            4 => old * (0.2 + 2.0 * self.unit()),
            _ => old + self.unit() - 0.5,
        }
    }
}

/// A primitive with everything that an image holds.
fn sound() -> PrimitiveFile {
    let bytes = image("reach", 2.0);
    let image = PrimitiveImage::parse(&bytes).unwrap();
    let mut primitive = PrimitiveFile::from_image(Path::new("reach.toml"), &image);
    primitive.feedback = Some(FeedbackTables {
        clamp_position: 0.2,
        clamp_orientation: 0.4,
        clamp_hand: 0.6,
        k1: vec![vec![20.0; 10]; 2],
        k2: vec![vec![1.0; 9]; 2],
    });
    primitive.expectation = Some(ExpectationTable {
        model_hash: primitive.model_hash,
        recorded_duration: 2.0,
        payload_mass: 0.5,
        payload_centre: [0.0, 0.0, 0.1],
        filter_cutoff: control::sense::wrench::WRENCH_CUT_OFF,
        trials: 3,
        spread_floor: 0.5,
        mean: vec![vec![0.5; 9]; 3],
        spread: Vec::new(),
    });
    primitive.statistics =
        Some(StatisticsTable { trials: 3, mean: vec![vec![0.5; 12]; 3], spread: vec![vec![0.2; 12]; 3] });
    primitive
}

/// One of the numbers of a primitive that has all tables.
fn any<'a>(numbers: &mut Numbers, primitive: &'a mut PrimitiveFile) -> &'a mut f64 {
    let (kind, at, of) = (numbers.below(25), numbers.below(1 << 20), numbers.below(4));
    let PrimitiveFile { movement, gains, start, start_velocity: velocity, goal, weights, .. } = primitive;
    let (feedback, expectation) = (primitive.feedback.as_mut().unwrap(), primitive.expectation.as_mut().unwrap());
    let statistics = primitive.statistics.as_mut().unwrap();
    match kind {
        0 => &mut movement.duration,
        1 => &mut movement.alpha,
        2 => &mut movement.activation,
        3 | 4 => {
            let gain = [&mut gains.position, &mut gains.orientation, &mut gains.posture, &mut gains.hand];
            let gain = gain.into_iter().nth(of).unwrap();
            if kind == 3 { &mut gain.stiffness } else { &mut gain.damping }
        }
        5 => &mut start.position[at % 3],
        6 => &mut start.orientation[at % 4],
        7 => &mut start.posture[at % 7],
        8 => &mut start.hand[at % 4],
        9 => &mut goal.position[at % 3],
        10 => &mut goal.orientation[at % 4],
        11 => &mut goal.posture[at % 7],
        12 => &mut goal.hand[at % 4],
        13 => &mut velocity.position[at % 3],
        14 => &mut velocity.orientation[at % 3],
        15 => &mut velocity.posture[at % 7],
        16 => &mut velocity.hand[at % 4],
        17 => {
            let rows = [&mut weights.position, &mut weights.orientation, &mut weights.posture, &mut weights.hand];
            let rows = rows.into_iter().nth(of).unwrap();
            let (row, kernel) = (at % rows.len(), at / 32 % rows[0].len());
            &mut rows[row][kernel]
        }
        18 => {
            let clamps = [&mut feedback.clamp_position, &mut feedback.clamp_orientation, &mut feedback.clamp_hand];
            clamps.into_iter().nth(at % 3).unwrap()
        }
        19 => &mut feedback.k1[at % 2][at / 4 % 10],
        20 => &mut feedback.k2[at % 2][at / 4 % 9],
        21 => {
            let ExpectationTable { recorded_duration, payload_mass, filter_cutoff, spread_floor, .. } = expectation;
            let [x, y, z] = &mut expectation.payload_centre;
            let marks = [recorded_duration, payload_mass, filter_cutoff, spread_floor, x, y, z];
            marks.into_iter().nth(at % 7).unwrap()
        }
        22 => &mut expectation.mean[at % 3][at / 4 % 9],
        23 => &mut statistics.mean[at % 3][at / 4 % 12],
        _ => &mut statistics.spread[at % 3][at / 4 % 12],
    }
}

/// Leaves out or changes a part of a primitive.
fn part(numbers: &mut Numbers, primitive: &mut PrimitiveFile) {
    let trials = [0, 1, 65_535, 65_536, u32::MAX][numbers.below(5)];
    match numbers.below(8) {
        0 => primitive.feedback = None,
        1 => primitive.expectation = None,
        2 => primitive.statistics = None,
        3 => primitive.movement.orientation_error = OrientationError::RotationVector,
        4 => primitive.movement.hemisphere = Hemisphere::Nearest,
        5 => primitive.goal.orientation = primitive.goal.orientation.map(|part| -part),
        6 => primitive.expectation.iter_mut().for_each(|table| table.trials = trials),
        _ => primitive.statistics.iter_mut().for_each(|table| table.trials = trials),
    }
}

/// The image of a primitive, if the host would send it.
fn sent(primitive: &PrimitiveFile) -> Result<Vec<u8>, String> {
    primitive.checked_text().map_err(|error| error.to_string())?;
    let image = primitive.to_image().map_err(|error| error.to_string())?;
    let built = primitive.to_primitive().map_err(|error| error.to_string())?;
    load::check(&lab::arm::MODEL, &built).map(|_| image).map_err(|error| error.to_string())
}

/// The change that makes it fail: the host does not look at the filter of an expectation, which the device does.
#[test]
fn the_host_refuses_what_the_device_refuses_and_nothing_that_it_takes() {
    let mut client = connected();
    let (mut taken, mut refused) = (0, 0);
    for seed in 0..COUNT {
        let (mut numbers, mut primitive) = (Numbers(seed), sound());
        for _ in 0..=numbers.below(2) {
            let number = any(&mut numbers, &mut primitive);
            *number = numbers.instead_of(*number);
        }
        if numbers.below(8) == 0 {
            part(&mut numbers, &mut primitive);
        }
        // What does not even make an image cannot be offered to the device.
        let Ok(image) = primitive.to_image() else { continue };
        let (host, device) = (sent(&primitive), client.upload(&image, |_, _, _| {}));
        assert_eq!(host.is_ok(), device.is_ok(), "{seed}: host {host:?}, device {device:?}, {}", primitive.to_text());
        *if host.is_ok() { &mut taken } else { &mut refused } += 1;
    }
    assert!(taken > COUNT / 4 && refused > COUNT / 4, "{taken} taken, {refused} refused");
}

#[test]
fn an_expectation_through_another_filter_makes_no_image() {
    let mut primitive = sound();
    assert!(sent(&primitive).is_ok());
    primitive.expectation.as_mut().unwrap().filter_cutoff = 20.0;
    let error = primitive.to_image().unwrap_err();
    assert!(matches!(error, PrimitiveFileError::ExpectationFilter { .. }), "{error}");
    assert!(error.to_string().contains("through a filter of 20 Hz, that of the device has 15 Hz"), "{error}");
}
