//! Rendered frames of one trial in each mode: the paper's figure 6.

use std::path::Path;

use sim::render::{Camera, RenderError, RenderOptions, Scene, render_strip};

use crate::trial::Trial;

/// Width and height of a strip, px.
const SIZE: (u32, u32) = (2400, 480);
/// Frames of a strip.
const FRAMES: usize = 5;

/// Writes a strip of a trial: first touch, half way, fingers closing, before the lift, at the end.
///
/// # Errors
/// [`RenderError`], for instance without EGL.
pub fn write(trial: &Trial, file: &Path) -> Result<(), RenderError> {
    let scenes = frames(trial);
    let [x, y] = trial.report.object;
    let options = RenderOptions {
        width: SIZE.0,
        height: SIZE.1,
        camera: Camera { look_at: [x - 0.05, y - 0.02, 0.0], distance: 1.05, azimuth: 150.0, elevation: -22.0 },
        ..RenderOptions::default()
    };
    render_strip(&scenes, file, &options)
}

fn frames(trial: &Trial) -> Vec<Scene> {
    let m = &trial.report.measures;
    let run = trial.marks.run;
    // Fingers that never close are shown as those that close with the lift.
    let closing = m.closed();
    let touch = m.touch_s.unwrap_or(0.6 * closing).min(closing);
    let end = trial.snapshots.last().map_or(run, |snapshot| snapshot.time);
    let times: [f64; FRAMES] = [run, run + touch, run + 0.5 * (touch + closing), run + m.lift_s, end];
    times
        .into_iter()
        .filter_map(|time| {
            let after = trial.snapshots.partition_point(|snapshot| snapshot.time < time);
            let snapshot = trial.snapshots.get(after).or(trial.snapshots.last())?;
            Scene::stored(&trial.scene, &snapshot.configuration)
        })
        .collect()
}
