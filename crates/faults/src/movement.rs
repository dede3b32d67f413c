//! The movement that every scenario runs: learned from a recording that no arm gave.

use std::path::Path;
use std::sync::OnceLock;

use control::plan::primitive::SENSORS;
use control::{RATE, State};
use lab::arm;
use lab::demonstration::{Recording, RecordingRow, RecordingWriter};
use lab::learn::{LearnOptions, learn};
use lab::primitive_file::{ExpectationTable, PrimitiveFile};
use link::Telemetry;

/// Posture at its start, rad: the hand in front of the shoulder.
pub const START: [f64; 7] = [-0.3, 0.5, 0.1, 1.9, 0.2, -0.6, 0.1];
/// Posture at its end, rad.
pub const GOAL: [f64; 7] = [0.4, 0.8, -0.1, 1.5, -0.1, -0.3, -0.2];
/// Duration, s.
const DURATION: f64 = 3.0;
/// Rest before and behind it, s.
const REST: f64 = 0.5;

/// The movement, with the expectation of no force.
///
/// # Panics
/// It cannot be learned: a defect of `lab`.
pub fn movement() -> &'static PrimitiveFile {
    static MOVEMENT: OnceLock<PrimitiveFile> = OnceLock::new();
    MOVEMENT.get_or_init(|| {
        let recording = Recording::parse(Path::new("faults.csv"), &shown()).expect("a recording that was just written");
        let learned = learn(&recording, Path::new("faults.toml"), &LearnOptions::named("faults"));
        let mut primitive = learned.expect("a smooth movement").primitive;
        primitive.expectation = Some(ExpectationTable {
            model_hash: primitive.model_hash,
            recorded_duration: primitive.movement.duration,
            payload_mass: 0.0,
            payload_centre: [0.0; 3],
            filter_cutoff: control::sense::wrench::WRENCH_CUT_OFF,
            trials: 2,
            spread_floor: 0.05,
            mean: vec![vec![0.0; SENSORS]; 2],
            spread: vec![vec![0.1; SENSORS]; 2],
        });
        primitive
    })
}

/// Joint angles at `time`, rad: minimum jerk.
fn posture(time: f64) -> [f64; 7] {
    let r = ((time - REST) / DURATION).clamp(0.0, 1.0);
    let blend = r * r * r * (10.0 + r * (6.0 * r - 15.0));
    std::array::from_fn(|joint| START[joint] + blend * (GOAL[joint] - START[joint]))
}

/// The recording, as the recorder would write it.
fn shown() -> Vec<u8> {
    let mut writer = RecordingWriter::new(Vec::new(), "Nobody showed this.").expect("in memory");
    for cycle in 0..=((DURATION + 2.0 * REST) * RATE) as u32 {
        let time = f64::from(cycle) / RATE;
        let (q, ahead) = (posture(time), posture(time + 1e-4));
        let ([x, y, z], [qw, qx, qy, qz]) = arm::tool_pose(&q);
        let pose = [x, y, z, qw, qx, qy, qz];
        let telemetry = Telemetry {
            cycle,
            state: State::Gravity.code(),
            q: q.map(|angle| angle as f32),
            dq: std::array::from_fn(|joint| ((ahead[joint] - q[joint]) / 1e-4) as f32),
            pose_d: pose.map(|value| value as f32),
            ..Telemetry::default()
        };
        let row = RecordingRow { time, pose, telemetry };
        writer.write(&row).expect("in memory");
    }
    writer.finish().expect("in memory")
}
