//! A demonstration that no arm gave: a smooth movement of the joints, written as the recorder would write it.

#![allow(dead_code, reason = "each test program uses its own part of these helpers")]

use std::path::{Path, PathBuf};

use control::State;
use lab::arm;
use lab::demonstration::{RecordingRow, RecordingWriter};
use link::Telemetry;

/// Posture at the start of the movement, rad: hand in front of the shoulder.
pub(crate) const START: [f64; 7] = [-0.3, 0.5, 0.1, 1.9, 0.2, -0.6, 0.1];
/// Posture at its end, rad.
pub(crate) const GOAL: [f64; 7] = [0.4, 0.8, -0.1, 1.5, -0.1, -0.3, -0.2];

/// Minimum jerk with three ripples that vanish at both ends, 0 to 1.
pub(crate) fn blend(r: f64) -> f64 {
    let r = r.clamp(0.0, 1.0);
    let jerk = r * r * r * (10.0 + r * (6.0 * r - 15.0));
    let window = (r * (1.0 - r) * 4.0).powi(3);
    jerk + 0.05 * window * (3.0 * std::f64::consts::TAU * r).sin()
}

/// Joint angles `fraction` of the way along the movement.
pub(crate) fn posture(fraction: f64) -> [f64; 7] {
    let b = blend(fraction);
    std::array::from_fn(|joint| START[joint] + b * (GOAL[joint] - START[joint]))
}

/// A recording: half a second of rest, `duration` s of movement, half a second of rest.
pub(crate) fn rows(duration: f64) -> Vec<RecordingRow> {
    let count = ((duration + 1.0) * control::RATE).round() as u32 + 1;
    (0..count)
        .map(|cycle| {
            let time = f64::from(cycle) / control::RATE;
            let q = posture((time - 0.5) / duration);
            let ahead = posture((time + 1e-4 - 0.5) / duration);
            let (position, orientation) = arm::tool_pose(&q);
            let pose =
                [position[0], position[1], position[2], orientation[0], orientation[1], orientation[2], orientation[3]];
            let telemetry = Telemetry {
                cycle: 1000 + cycle,
                state: State::Gravity.code(),
                q: q.map(|value| value as f32),
                dq: std::array::from_fn(|joint| ((ahead[joint] - q[joint]) / 1e-4) as f32),
                tau: [0.0, 20.0, 0.0, 5.0, 0.0, 0.5, 0.0],
                pose_d: pose.map(|value| value as f32),
                wrench: [0.5, -0.25, 1.0, 0.0, 0.0, 0.125],
                cost_ticks: 20_000,
                hand: [0.0, 0.25, 0.5, 0.75],
                hand_d: [0.0, 0.25, 0.5, 1.0],
                gauges: [0.0, -0.5, 0.125],
                surprise: 1.5,
                ..Telemetry::default()
            };
            RecordingRow { time, pose, telemetry }
        })
        .collect()
}

/// The recording as text.
pub(crate) fn text(rows: &[RecordingRow]) -> String {
    let mut writer = RecordingWriter::new(Vec::new(), "Recorded by nobody, for tests.").expect("in memory");
    for row in rows {
        writer.write(row).expect("in memory");
    }
    String::from_utf8(writer.finish().expect("in memory")).expect("text")
}

/// Writes the recording of a movement of `duration` s to a folder.
pub(crate) fn demonstration(folder: &Path, duration: f64) -> PathBuf {
    let file = folder.join("demo.csv");
    let mut rows = rows(duration);
    // An open hand, as the primitive that is learned from it begins.
    rows.iter_mut().for_each(|row| row.telemetry.hand = [0.0; 4]);
    std::fs::write(&file, text(&rows)).expect("a writable folder");
    file
}

/// A recording of poses alone, as other laboratories write it: `turn` rad about a wandering axis in 4 s.
pub(crate) fn foreign(turn: f64) -> String {
    let mut text =
        String::from("# poses of somebody's arm\nt_s,px_m,py_m,pz_m,qw,qx,qy,qz,fx_N,fy_N,fz_N,tx_Nm,ty_Nm,tz_Nm\n");
    for k in 0..=1200 {
        let r = f64::from(k) / 1200.0;
        let b = blend(r);
        let angle = turn * b;
        let axis = [(0.4 * b).cos(), (0.4 * b).sin(), 0.0];
        let (s, c) = (angle / 2.0).sin_cos();
        let pose = [0.5 + 0.1 * b, -0.1 + 0.2 * b, 0.3 - 0.05 * b, c, s * axis[0], s * axis[1], s * axis[2]];
        text += &format!("{}", 4.0 * r);
        for value in pose {
            text += &format!(",{value}");
        }
        text += ",1,2,3,0.1,0.2,0.3\n";
    }
    text
}
