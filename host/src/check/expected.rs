//! Joint torques and a load of the force sensor, as a run that presses as it expects would ask for them.
//!
//! A force across the hand turns the sensor by its lever, and a sensor at the end of its range stops the run: such an
//! expectation could never be met. Nor can one for which a joint has no torque left.

use control::model::{Frames, SENSOR_TORQUE_RANGE};
use control::sense::wrench::FULL_SCALE;
use control::units::{JointPositions, Vector6};
use nalgebra::Vector3;

use super::closed_loop::{ClosedLoop, Sample};
use super::{CheckReport, Limit, Margin};
use lab::arm::{self, TORQUE_LIMITS};
use lab::primitive_file::{HostPrimitive, PrimitiveFile};

/// The expectation in one cycle of the run.
struct Moment {
    /// Number among the samples of the expectation, from 0.
    sample: usize,
    /// Force, world axes, N.
    force: Vector3<f64>,
    margin: Margin,
}

/// Adds the worst margins of the expectation, if there is one, and says what is beyond them.
pub(super) fn check(file: &PrimitiveFile, primitive: &HostPrimitive, run: &ClosedLoop, report: &mut CheckReport) {
    let Some(expected) = primitive.expected() else { return };
    let samples = expected.samples().len();
    let mut worst: Vec<Moment> = Vec::new();
    for cycle in &run.samples {
        let phase = f64::from(cycle.record.phase);
        if phase <= 0.0 {
            continue;
        }
        let progress = (-phase.ln() / file.movement.alpha).clamp(0.0, 1.0);
        let values = expected.at(progress);
        let sample = (progress * samples.saturating_sub(1) as f64).round() as usize;
        let force = Vector3::new(values[0], values[1], values[2]);
        let torque = Vector3::new(values[3], values[4], values[5]);
        let margins = margins(cycle, &force, &torque);
        let moments = margins.into_iter().map(|margin| Moment { sample, force, margin });
        if worst.is_empty() {
            worst = moments.collect();
            continue;
        }
        for (worst, moment) in worst.iter_mut().zip(moments) {
            if moment.margin.margin < worst.margin.margin {
                *worst = moment;
            }
        }
    }
    for Moment { sample, force, margin } in worst {
        report.margins.push(margin);
        if margin.margin < 0.0 {
            let Margin { value, bound, time_s, .. } = margin;
            let asks = match margin.joint {
                None => format!("turns the force sensor by {value:.2} N m, and {bound:.2} N m stop a run"),
                Some(joint) => format!("asks for {value:.2} N m of J{joint}, which has {bound:.2} N m"),
            };
            report.violations.push(format!(
                "sample {} of {samples} expects {:.1} N ({:.1}, {:.1}, {:.1}), at {time_s:.3} s: that {asks}",
                sample + 1,
                force.norm(),
                force.x,
                force.y,
                force.z
            ));
        }
    }
}

/// The margins of one cycle: of the sensor, and of each joint.
fn margins(cycle: &Sample, force: &Vector3<f64>, torque: &Vector3<f64>) -> Vec<Margin> {
    let frames = Frames::new(&arm::MODEL, &JointPositions::from_array(cycle.q));
    let world = frames.tool_to_world() * torque;
    // About the sensor instead of the grasp point, with the hand that hangs on it.
    let about = frames.sensor_to_world().tr_mul(&(world - frames.tool_to_sensor().cross(force)));
    let weight = arm::MODEL.hanging_weight(&frames);
    let of = |limit, joint, value: f64, bound: f64| {
        let margin = bound - value.abs();
        Margin { limit, joint, value: value.abs(), bound, margin, time_s: cycle.time }
    };
    let axes = (0..3).map(|axis| {
        of(Limit::ExpectedAtSensor, None, about[axis] + weight[3 + axis], FULL_SCALE * SENSOR_TORQUE_RANGE[axis])
    });
    let sensor = axes.min_by(|a, b| a.margin.total_cmp(&b.margin));
    let pressing = frames.joint_torques(&Vector6::new(force.x, force.y, force.z, world.x, world.y, world.z)).0;
    let joints = (0..7).map(|joint| {
        // The expectation is what the environment does to the arm, which has to bear it.
        let value = f64::from(cycle.record.tau[joint]) - pressing[joint];
        of(Limit::ExpectedTorque, Some(joint as u8 + 1), value, TORQUE_LIMITS[joint])
    });
    sensor.into_iter().chain(joints).collect()
}
