//! Feedback for a movement without recorded forces: springs, sensitivity K1 of Eq (8), limits, and what they
//! mean in newtons and kilograms.
//!
//! The gains act in the tau-scaled system: pushed by a force F the plan behaves like a mass `tau^2/K1` on a damper `D
//! tau/K1` and a spring `K/K1`. What gives way to a standing object before it topples is therefore fixed by `K/K1` (0.3
//! N for 25 cm) and a virtual mass of at most 2 kg, and `K`, `K1` grow with the square of the duration.

use control::plan::bounds::GAIN;
use control::plan::inertia::MASS;
use dmp::Gain;
use serde::Serialize;

use super::LearnOptions;
use crate::primitive_file::{FeedbackTables, PrimitiveFile};
use crate::table::Table;

/// Duration for which the recommended gains were found, s.
const REFERENCE_DURATION: f64 = 12.0;
/// K of the position rows at that duration.
const POSITION_STIFFNESS: f64 = 400.0;
/// K_o of the orientation rows at that duration.
const ORIENTATION_STIFFNESS: f64 = 200.0;
/// No K is smaller, however short the movement: softer plans are late at a goal that was moved.
const SOFTEST: f64 = dmp::TransformationSystem::<f64>::DEFAULT_STIFFNESS;
/// K1/K of the position rows, m/N: 25 cm of way for 0.3 N beyond the dead band of 0.3 N. A flashlight topples at 2 N
/// and a small torch at 0.8 N, but what leans resists less, and friction lets the arm come on in steps.
const POSITION_COMPLIANCE: f64 = 0.8;
/// K1/K_o about the vertical, rad/(N m).
const ROTATION_COMPLIANCE: f64 = 3.7;
/// K1/K of the fingers, rad/(N m). At the drive's whole torque (1.4 N m) a finger yields by 0.42 rad, within its limit,
/// and at the 0.3 N m of a light touch by 0.1 rad: it takes the shape of the object instead of pushing it.
const FINGER_COMPLIANCE: f64 = 0.3;
/// Limits: displacement m, rotation degrees, fingers rad.
pub const DEFAULT_LIMITS: [f64; 3] = [0.25, 25.0, 0.6];
/// An axis of the hand counts as vertical up to this angle, degrees.
const VERTICAL: f64 = 25.0;
/// Virtual mass beyond which the plan gives way too late, kg.
pub const HEAVIEST: f64 = 2.0;

/// Gains that the user chose instead of the recommended ones.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedbackOptions {
    /// K of the position rows.
    pub stiffness: Option<f64>,
    /// K_o of the orientation rows.
    pub orientation_stiffness: Option<f64>,
    /// K of the hand rows.
    pub hand_stiffness: Option<f64>,
    /// K1: position x, y, z (world), rotation x, y, z (hand), spread, F1, F2, F3.
    pub sensitivity: Option<[f64; 10]>,
    /// Limits: displacement m, rotation degrees, fingers rad.
    pub limits: Option<[f64; 3]>,
}

/// K of position, orientation, posture and hand for a movement of this duration (s).
pub fn stiffness(options: &FeedbackOptions, duration: f64) -> [f64; 4] {
    let scale = (duration / REFERENCE_DURATION).powi(2);
    // Beyond a minute the recommended gain would be more than any device takes.
    let scaled = |k: f64| (k * scale).clamp(SOFTEST, GAIN);
    [
        options.stiffness.unwrap_or_else(|| scaled(POSITION_STIFFNESS)),
        options.orientation_stiffness.unwrap_or_else(|| scaled(ORIENTATION_STIFFNESS)),
        SOFTEST,
        options.hand_stiffness.unwrap_or_else(|| scaled(SOFTEST)),
    ]
}

/// The tables of a fitted primitive; K2 is 1 until rehearsals tell the spread of the sensors.
///
/// A plan turns about the vertical only, so that a push cannot tilt what the hand holds. K1 is diagonal in axes of the
/// hand: where none of them is vertical at the goal, the plan does not turn by itself.
pub fn tables(primitive: &PrimitiveFile, options: &LearnOptions) -> FeedbackTables {
    let [position, orientation, _, hand] = primitive.gains.in_order().map(|gain| gain.stiffness);
    let [metres, degrees, fingers] = options.feedback.limits.unwrap_or(DEFAULT_LIMITS);
    let k1 = options.feedback.sensitivity.unwrap_or_else(|| {
        let mut k1 = [0.0; 10];
        k1[0] = POSITION_COMPLIANCE * position;
        k1[1] = POSITION_COMPLIANCE * position;
        if let Some(axis) = vertical_axis(&primitive.goal.orientation) {
            k1[3 + axis] = ROTATION_COMPLIANCE * orientation;
        }
        k1[7..].fill(FINGER_COMPLIANCE * hand);
        k1
    });
    FeedbackTables {
        clamp_position: metres,
        clamp_orientation: degrees.to_radians(),
        clamp_hand: fingers,
        k1: vec![k1.to_vec()],
        k2: vec![vec![1.0; control::plan::primitive::SENSORS]],
    }
}

/// The axis of the hand (0 = x) that stands vertical, up or down, if there is one.
fn vertical_axis(orientation: &[f64; 4]) -> Option<usize> {
    let [w, x, y, z] = *orientation;
    // Third row of R(q): the world's vertical in axes of the hand.
    let vertical = [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)];
    (0..3).find(|axis| vertical[*axis].abs() > VERTICAL.to_radians().cos())
}

/// Physical meaning of the gains of one row.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct RowFeedback {
    /// Name of the row.
    pub row: &'static str,
    /// K1.
    pub k1: f64,
    /// Force (N) or torque (N m) that displaces the plan as far as it may go.
    pub load_at_limit: f64,
    /// Virtual mass (kg) or inertia (kg m^2), `tau^2/K1`; no plan is lighter than 2 kg for what is fast.
    pub inertia: f64,
    /// Damping (N s/m or N m s/rad), `D tau/K1`.
    pub damping: f64,
}

/// Physical meaning of the feedback.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct FeedbackReport {
    /// Largest displacement, m.
    pub displacement_m: f64,
    /// Largest rotation, rad.
    pub rotation_rad: f64,
    /// Largest displacement of the fingers, rad.
    pub hand_rad: f64,
    /// Rows that force bends at all.
    pub rows: Vec<RowFeedback>,
}

impl FeedbackReport {
    /// Of a primitive with feedback; `None` without.
    pub fn of(primitive: &PrimitiveFile) -> Option<FeedbackReport> {
        const NAMES: [&str; 10] = [
            "position x",
            "position y",
            "position z",
            "rotation x",
            "rotation y",
            "rotation z",
            "spread",
            "F1",
            "F2",
            "F3",
        ];
        let tables = primitive.feedback.as_ref()?;
        let (displacement_m, rotation_rad, hand_rad) =
            (tables.clamp_position, tables.clamp_orientation, tables.clamp_hand);
        let gains = &primitive.gains;
        let rows = NAMES.into_iter().enumerate().filter_map(|(index, row)| {
            let k1 = tables.k1.iter().filter_map(|point| point.get(index)).copied().fold(0.0, f64::max);
            let (Gain { stiffness, damping }, limit) = match index {
                0..3 => (gains.position, displacement_m),
                3..6 => (gains.orientation, (rotation_rad / 2.0).sin()),
                _ => (gains.hand, hand_rad),
            };
            let tau = primitive.movement.duration;
            (k1 > 0.0).then(|| RowFeedback {
                row,
                k1,
                load_at_limit: stiffness * limit / k1,
                inertia: f64::max(tau * tau / k1, if index < 3 { MASS } else { 0.0 }),
                damping: damping * tau / k1,
            })
        });
        Some(FeedbackReport { displacement_m, rotation_rad, hand_rad, rows: rows.collect() })
    }

    /// Warnings of a plan that gives way too slowly.
    pub fn warnings(&self) -> Vec<String> {
        let heavy = self.rows.iter().filter(|row| row.row.starts_with("position") && row.inertia > HEAVIEST);
        heavy
            .map(|row| {
                format!(
                    "{}: pushed by a force the plan moves like {:.1} kg; beyond {HEAVIEST} kg a standing object topples before the hand gives way: raise --k1 and --stiffness together",
                    row.row, row.inertia
                )
            })
            .collect()
    }

    /// As text for a terminal.
    pub fn to_text(&self) -> String {
        let mut table = Table::new(["feedback", "K1", "load at the limit", "virtual mass", "damping"]);
        for row in &self.rows {
            let (load, mass, damper) =
                if row.row.starts_with("position") { ("N", "kg", "N s/m") } else { ("N m", "kg m^2", "N m s/rad") };
            table.row([
                row.row.to_owned(),
                format!("{:.1}", row.k1),
                format!("{:.2} {load}", row.load_at_limit),
                format!("{:.2} {mass}", row.inertia),
                format!("{:.2} {damper}", row.damping),
            ]);
        }
        let turns = self.rows.iter().any(|row| row.row.starts_with("rotation"));
        let note = if turns {
            ""
        } else {
            "the plan does not turn by what it feels: no axis of the hand is vertical at the goal; --k1 chooses otherwise\n"
        };
        format!(
            "limits of the adaptation: {:.2} m, {:.0} degrees, fingers {:.2} rad\n{note}\n{table}",
            self.displacement_m,
            self.rotation_rad.to_degrees(),
            self.hand_rad
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_axis_of_the_hand_that_is_vertical_is_found_whichever_way_it_points() {
        let half = std::f64::consts::FRAC_1_SQRT_2;
        assert_eq!(vertical_axis(&[1.0, 0.0, 0.0, 0.0]), Some(2));
        assert_eq!(vertical_axis(&[0.0, 1.0, 0.0, 0.0]), Some(2));
        // A quarter turn about x brings y upright, one about y brings x (down).
        assert_eq!(vertical_axis(&[half, half, 0.0, 0.0]), Some(1));
        assert_eq!(vertical_axis(&[half, 0.0, half, 0.0]), Some(0));
        let slanted = std::f64::consts::FRAC_PI_8;
        assert_eq!(vertical_axis(&[slanted.cos(), slanted.sin(), 0.0, 0.0]), None);
    }

    #[test]
    fn gains_keep_their_physical_meaning_when_the_movement_takes_longer() {
        let options = FeedbackOptions::default();
        assert_eq!(stiffness(&options, 12.0), [400.0, 200.0, 200.0, 200.0]);
        assert_eq!(stiffness(&options, 24.0), [1600.0, 800.0, 200.0, 800.0]);
        assert_eq!(stiffness(&options, 5.0), [200.0; 4]);
        // Two minutes, the longest movement: no gain that a device refuses.
        assert_eq!(stiffness(&options, 120.0), [GAIN, GAIN, 200.0, GAIN]);
        let chosen = FeedbackOptions { stiffness: Some(300.0), ..options };
        assert_eq!(stiffness(&chosen, 24.0)[0], 300.0);
    }
}
