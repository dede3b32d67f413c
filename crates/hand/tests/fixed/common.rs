//! Helpers of the tests: primitives as images, in fixed point and in f64.

use control::plan::primitive::{MovementTables, Primitive, ROWS, configuration as rows, gains, limits, velocity};
use dmp::{Configuration, Gain, Gains, PrimitiveTables};
use hand::image::ImageReader;
use hand::number::{Number, from_real};
use hand::{FingerPrimitive, FingerTables, Rollout};
use link::Name;
use link::image::{
    ExpectationMarks, FeedbackClamps, Hemisphere, ImageContent, OrientationError, Waypoint, WaypointVelocity,
};

/// A movement of the hand, in real numbers.
#[derive(Clone, Debug)]
pub(crate) struct Movement {
    pub(crate) duration: f32,
    pub(crate) alpha: f32,
    pub(crate) activation: f32,
    pub(crate) stiffness: f32,
    pub(crate) damping: f32,
    pub(crate) kernels: usize,
    /// Rows of the hand, spread first.
    pub(crate) weights: [Vec<f32>; 4],
    pub(crate) start: [f32; 4],
    pub(crate) goal: [f32; 4],
    pub(crate) start_velocity: [f32; 4],
    /// K1 of the fingers, K2 of the gauges, points by three.
    pub(crate) k1: Vec<[f32; 3]>,
    pub(crate) k2: Vec<[f32; 3]>,
    pub(crate) limit: f32,
    pub(crate) expected: Vec<[f32; 3]>,
    pub(crate) recorded_duration: f32,
}

impl Movement {
    /// A closing hand: `kernels` smooth weights up to `amplitude`.
    pub(crate) fn closing(kernels: usize, duration: f32, amplitude: f32) -> Self {
        let row = |phase: f32| {
            (0..kernels)
                .map(|i| {
                    let place = (i as f32 + 0.5) / kernels as f32;
                    amplitude * (7.0 * place + phase).sin() * (std::f32::consts::PI * place).sin().powi(2)
                })
                .collect()
        };
        Movement {
            duration,
            alpha: 4.605_170_2,
            activation: 0.7,
            stiffness: 200.0,
            damping: 28.284_271,
            kernels,
            weights: [row(0.3), row(1.1), row(2.0), row(2.9)],
            start: [0.1, 0.0, 0.05, 0.1],
            goal: [0.6, 1.9, 2.1, 2.0],
            start_velocity: [0.0; 4],
            k1: Vec::new(),
            k2: Vec::new(),
            limit: 0.5,
            expected: Vec::new(),
            recorded_duration: duration,
        }
    }

    /// The same with an expectation of a closing grip and gains of its feedback.
    pub(crate) fn feeling(self) -> Self {
        let expected = (0..101)
            .map(|i| {
                let u = i as f32 / 100.0;
                let grip = -0.25 * (3.0 * (u - 0.6)).clamp(0.0, 1.0);
                [grip, 1.1 * grip, 0.9 * grip]
            })
            .collect();
        let k1 = (0..9).map(|i| [60.0 + i as f32, 55.0, 50.0]).collect();
        let k2 = (0..9).map(|i| [1.0, 1.0 + 0.05 * i as f32, 0.8]).collect();
        Movement { expected, k1, k2, ..self }
    }

    /// As an image.
    pub(crate) fn image(&self, name: &str) -> Vec<u8> {
        let mut weights = vec![0.0; 13 * self.kernels];
        weights.extend(self.weights.iter().flatten());
        let spread_out = |columns: usize, table: &[[f32; 3]]| -> Vec<f32> {
            let fill = vec![0.25; columns - 3];
            table.iter().flat_map(|row| fill.iter().chain(row).copied().collect::<Vec<_>>()).collect()
        };
        let (k1, k2) = (spread_out(10, &self.k1), spread_out(9, &self.k2));
        let expected_mean = spread_out(9, &self.expected);
        let waypoint = |hand: [f32; 4]| Waypoint {
            position: [0.4, 0.0, 0.2],
            orientation: [1.0, 0.0, 0.0, 0.0],
            posture: [0.1; 7],
            hand,
        };
        let content = ImageContent {
            model_hash: control::MODEL_HASH,
            duration: self.duration,
            alpha: self.alpha,
            activation: self.activation,
            stiffness: [150.0, 150.0, 150.0, self.stiffness],
            damping: [24.0, 24.0, 24.0, self.damping],
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Nearest,
            start: waypoint(self.start),
            start_velocity: WaypointVelocity { hand: self.start_velocity, ..WaypointVelocity::default() },
            goal: waypoint(self.goal),
            clamps: FeedbackClamps { position: 0.2, orientation: 0.5, hand: self.limit },
            marks: ExpectationMarks {
                recorded_duration: self.recorded_duration,
                filter_cutoff: 15.0,
                trials: 5.0,
                ..ExpectationMarks::default()
            },
            statistics_trials: 0,
            kernels: self.kernels,
            k1: k1.as_slice(),
            k2: k2.as_slice(),
            weights: weights.as_slice(),
            expected_mean: expected_mean.as_slice(),
            statistics_mean: &[][..],
            statistics_spread: &[][..],
        };
        let mut bytes = vec![0; 30_000];
        let length = content.encode(&Name::new(name).expect("a name"), &mut bytes).expect("an image");
        bytes.truncate(length);
        bytes
    }

    /// In fixed point, by way of the image.
    pub(crate) fn fixed(&self) -> Box<FingerPrimitive> {
        let mut primitive = Box::new(FingerPrimitive::EMPTY);
        primitive.assign(&self.tables()).expect("a movement of the hand");
        primitive
    }

    /// The movement alone in fixed point, by way of the image, for another control period than the device's.
    pub(crate) fn fixed_at(&self, control_period: Number) -> Box<hand::primitive::Movement> {
        let tables = self.tables();
        let gain = Gain { stiffness: from_real(tables.stiffness), damping: from_real(tables.damping) };
        let at = |points: [f32; 4]| Configuration { poses: [], points: points.map(from_real) };
        let movement = hand::primitive::Movement::new(&PrimitiveTables {
            control_period,
            duration: from_real(tables.duration),
            alpha: from_real(tables.alpha),
            activation: from_real(tables.activation),
            kernel_count: tables.kernels,
            weights: &tables.weights,
            gains: Gains { poses: [], points: [gain; 4] },
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Demonstrated,
            start: at(tables.start),
            goal: at(tables.goal),
            start_velocity: dmp::Velocity { poses: [], points: tables.start_velocity.map(from_real) },
        });
        Box::new(movement.expect("a movement of the hand"))
    }

    fn tables(&self) -> Box<FingerTables> {
        let image = self.image("movement");
        let mut tables = Box::new(FingerTables::EMPTY);
        let mut reader = ImageReader::new(image.len() as u32);
        image.chunks(192).for_each(|chunk| reader.take(chunk, &mut tables));
        reader.finish(&tables, link::image::stored_crc(&image)).expect("a sound image");
        tables
    }

    /// In f64: the same numbers on the arm's path.
    pub(crate) fn exact(&self) -> Primitive<f64, 100> {
        let mut weights = vec![0.0; (ROWS - 4) * self.kernels];
        weights.extend(self.weights.iter().flatten().map(|weight| f64::from(*weight)));
        let configuration = |hand: [f32; 4]| rows([0.0; 3], [1.0, 0.0, 0.0, 0.0], [0.0; 7], hand.map(f64::from));
        let (k, d) = (f64::from(self.stiffness), f64::from(self.damping));
        let mut primitive = Primitive::new(&MovementTables {
            control_period: control::PERIOD,
            duration: f64::from(self.duration),
            alpha: f64::from(self.alpha),
            activation: f64::from(self.activation),
            kernel_count: self.kernels,
            weights: &weights,
            gains: gains([k; 4], [d; 4]),
            orientation_error: OrientationError::Quaternion,
            hemisphere: Hemisphere::Nearest,
            start: configuration(self.start),
            goal: configuration(self.goal),
            start_velocity: velocity([0.0; 3], [0.0; 3], [0.0; 7], self.start_velocity.map(f64::from)),
        })
        .expect("a primitive");
        let column = |columns: usize, table: &[[f32; 3]]| -> Vec<f64> {
            let fill = vec![0.0; columns - 3];
            let row = |row: &[f32; 3]| fill.iter().copied().chain(row.map(f64::from)).collect::<Vec<_>>();
            table.iter().flat_map(row).collect()
        };
        if !self.k1.is_empty() {
            let limits = limits(0.2, 0.5, f64::from(self.limit));
            primitive.assign_feedback(column(10, &self.k1), column(9, &self.k2), limits).expect("gains");
        }
        if !self.expected.is_empty() {
            primitive
                .assign_expected(column(9, &self.expected), f64::from(self.recorded_duration))
                .expect("an expectation");
        }
        primitive
    }
}

/// A run as the demonstration started, with its initial velocity.
pub(crate) fn demonstrated(movement: &hand::primitive::Movement) -> Rollout {
    Rollout::start(movement, &dmp::StartState::demonstrated(movement)).expect("a start")
}

/// The plan at this tick under the feedback of these gauges.
pub(crate) fn step(
    primitive: &FingerPrimitive,
    rollout: &mut Rollout,
    gauges: &[Number; 3],
) -> dmp::Trajectory<Number, 4> {
    let coupling = primitive.coupling(rollout, gauges, primitive.trust(rollout));
    rollout.step(primitive.movement(), Number::constant(control::PERIOD), &coupling).expect("its own").points
}

/// Pseudo-random numbers, always the same.
pub(crate) struct Random(pub(crate) u64);

impl Random {
    pub(crate) fn bits(&mut self) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0
    }

    /// Between -1 and 1.
    pub(crate) fn unit(&mut self) -> f64 {
        self.bits().cast_signed() as f64 / 2.0_f64.powi(63)
    }
}
