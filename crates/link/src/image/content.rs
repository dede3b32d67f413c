//! Content of an image: plain numbers with their units, not yet checked.

use serde::{Deserialize, Serialize};

pub use dmp::{Hemisphere, OrientationError};

/// Pose, posture and hand of one moment. As text each key names its unit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Waypoint<T = f32> {
    /// Grasp point in the world frame, m.
    #[serde(rename = "position_m")]
    pub position: [T; 3],
    /// Hand to world, unit quaternion (w, x, y, z).
    #[serde(rename = "orientation_wxyz")]
    pub orientation: [T; 4],
    /// Joint angles, rad.
    #[serde(rename = "posture_rad")]
    pub posture: [T; 7],
    /// Spread and three fingers, rad.
    #[serde(rename = "hand_rad")]
    pub hand: [T; 4],
}

impl Waypoint<f64> {
    /// The same in single precision.
    #[must_use]
    pub fn single(&self) -> Waypoint {
        Waypoint {
            position: self.position.map(|value| value as f32),
            orientation: self.orientation.map(|value| value as f32),
            posture: self.posture.map(|value| value as f32),
            hand: self.hand.map(|value| value as f32),
        }
    }
}

/// Velocities at the start of the demonstration. As text each key names its unit.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct WaypointVelocity<T = f32> {
    /// World frame, m/s.
    #[serde(rename = "position_m_s")]
    pub position: [T; 3],
    /// Body frame, rad/s.
    #[serde(rename = "orientation_rad_s")]
    pub orientation: [T; 3],
    /// rad/s.
    #[serde(rename = "posture_rad_s")]
    pub posture: [T; 7],
    /// rad/s.
    #[serde(rename = "hand_rad_s")]
    pub hand: [T; 4],
}

impl WaypointVelocity<f64> {
    /// The same in single precision.
    #[must_use]
    pub fn single(&self) -> WaypointVelocity {
        WaypointVelocity {
            position: self.position.map(|value| value as f32),
            orientation: self.orientation.map(|value| value as f32),
            posture: self.posture.map(|value| value as f32),
            hand: self.hand.map(|value| value as f32),
        }
    }
}

/// Largest displacement of the plan by feedback at rest, Eq (8).
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct FeedbackClamps {
    /// Position, m.
    pub position: f32,
    /// Orientation, rad.
    pub orientation: f32,
    /// Hand joints, rad.
    pub hand: f32,
}

/// Circumstances in which the expected wrench was recorded.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ExpectationMarks {
    /// Duration of the recorded runs, s. The inertial part of a wrench goes with its square.
    pub recorded_duration: f32,
    /// Mass carried while recording, beyond the hand, kg.
    pub payload_mass: f32,
    /// Centre of that mass in the hand frame, m.
    pub payload_centre: [f32; 3],
    /// Cut-off of the filter on the recorded wrench, Hz; the live one must have the same.
    pub filter_cutoff: f32,
    /// Runs that were averaged.
    pub trials: f32,
    /// Relative spread below which no sensor is trusted more, sigma_min / sigma.
    pub spread_floor: f32,
}

/// Everything an image holds, with tables of reals of type `F`: slices to write one, [`Reals`](super::Reals) when read.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageContent<F> {
    /// Hash of the robot model the primitive was learned with.
    pub model_hash: u32,
    /// Duration as taught, s.
    pub duration: f32,
    /// Decay of the phase, Eq (3).
    pub alpha: f32,
    /// Activation of a kernel at the next centre, Eq (2). Centres: exp(-alpha i / (kernels - 1)).
    pub activation: f32,
    /// K of position, orientation, posture, hand.
    pub stiffness: [f32; 4],
    /// D of position, orientation, posture, hand.
    pub damping: [f32; 4],
    /// Orientation error.
    pub orientation_error: OrientationError,
    /// Signs of the quaternions.
    pub hemisphere: Hemisphere,
    /// Start of the demonstration.
    pub start: Waypoint,
    /// Velocity there.
    pub start_velocity: WaypointVelocity,
    /// Goal of the demonstration.
    pub goal: Waypoint,
    /// Clamps of the feedback.
    pub clamps: FeedbackClamps,
    /// Circumstances in which the expectation was recorded; all zero without one.
    pub marks: ExpectationMarks,
    /// Successful runs behind the statistics; 0 without one.
    pub statistics_trials: u16,
    /// Kernels of each row.
    pub kernels: usize,
    /// K1 of Eq (8) by phase: points x [`COUPLED_ROWS`](super::COUPLED_ROWS), point after point, first at the start.
    /// Empty: no feedback. One point: constant.
    pub k1: F,
    /// K2 of Eq (8) by phase: points x [`SENSOR_ROWS`](super::SENSOR_ROWS).
    pub k2: F,
    /// Weights, [`WEIGHT_ROWS`](super::WEIGHT_ROWS) x kernels, row after row.
    pub weights: F,
    /// Expected sensor values by phase: points x [`SENSOR_ROWS`](super::SENSOR_ROWS), environment on robot. Force N in
    /// world axes, torque N m in hand axes at the grasp point, fingers N m. May be empty.
    pub expected_mean: F,
    /// Sensor statistics of successful runs, by phase: points x [`STATISTICS_ROWS`](super::STATISTICS_ROWS): the sensor
    /// values as in `expected_mean`, then the angles of fingers F1 to F3, rad. May be empty.
    pub statistics_mean: F,
    /// Their standard deviations, same shape.
    pub statistics_spread: F,
}
