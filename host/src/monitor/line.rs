//! Data of `tactus --json monitor`: one object a line, ten a second, and one for each event.

use schemars::JsonSchema;
use serde::Serialize;

/// A line of the stream.
#[derive(Debug, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum Streamed {
    /// The arm.
    Line(Box<Line>),
    /// Something that the device tells by itself.
    Event {
        /// The event in words.
        event: String,
        /// The control cycle in which it happened.
        cycle: u32,
    },
}

/// The arm at one moment.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Line {
    /// State of the supervisor.
    pub state: &'static str,
    /// Name of the latched fault; null for none.
    pub fault: Option<String>,
    /// Reason for the state: the fault or the start-up; empty for none.
    pub cause: String,
    /// The primitive in use.
    pub loaded: Option<String>,
    /// Progress of the movement, 0 to 1; null outside a run.
    pub progress: Option<f64>,
    /// The newest control cycle; null, as what follows, before one came.
    pub cycle: Option<u32>,
    /// Phase of the primitive.
    pub phase: Option<f32>,
    /// Joint angles, rad; null, as the velocities, before each was measured once.
    pub q_rad: Option<[f32; 7]>,
    /// Joint velocities, rad/s.
    pub dq_rad_s: Option<[f32; 7]>,
    /// Joint torques sent, N m.
    #[serde(rename = "tau_Nm")]
    pub tau_nm: Option<[f32; 7]>,
    /// Force of the environment on the robot (N, world axes) and torque (N m, hand axes); null without a sensor, and
    /// before the joint angles are known.
    #[serde(rename = "wrench_N_Nm")]
    pub wrench_n_nm: Option<[f32; 6]>,
    /// The same as the primitive expects it; null outside a run and without `--primitive`.
    #[serde(rename = "expected_N_Nm")]
    pub expected_n_nm: Option<[f64; 6]>,
    /// Spread and fingers F1 to F3, rad; null, as the two that follow, unless the hand is ready.
    pub hand_rad: Option<[f32; 4]>,
    /// The same as desired, rad.
    pub hand_d_rad: Option<[f32; 4]>,
    /// Torque of the environment on each finger, N m.
    #[serde(rename = "gauges_Nm")]
    pub gauges_nm: Option<[f32; 3]>,
    /// Adaptation: off, on, derated or at its limits.
    pub adaptation: &'static str,
    /// Difference between this run and the successful ones (z-score); 0 when nothing is compared.
    pub surprise: Option<f32>,
    /// Duration of the newest control computation, us.
    pub computation_us: Option<f64>,
    /// The longest one, us.
    pub worst_computation_us: f64,
    /// Cycles whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// Replies that did not come in their cycle.
    pub lost_replies: u32,
    /// Errors that the bus controller reported.
    pub bus_errors: u32,
    /// Starts of the bus from the beginning.
    pub bus_restarts: u32,
    /// Telemetry that did not arrive here.
    pub telemetry_lost: u32,
    /// Telemetry that the device left out.
    pub telemetry_dropped: u32,
}
