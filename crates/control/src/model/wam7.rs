//! The numbers of the arm, generated from `model/wam7.toml` when the crate is built. SI units.
//!
//! Frames: standard Denavit-Hartenberg, `T(j-1 -> j) = Rz(q_j) Tz(d_j) Tx(a_j) Rx(alpha_j)`; frame 0 is the world, its
//! origin where the axes of J1 and J2 meet, z up. Inertias are about the centre of mass, in the axes of the link frame,
//! with the signs of a physical tensor (`I_xy = -sum m x y`).

/// Mass properties of one body as the model file gives them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyTable {
    /// Mass (kg).
    pub mass: f64,
    /// Centre of mass in the link frame (m).
    pub centre: [f64; 3],
    /// Inertia about the centre of mass (kg m^2): xx, yy, zz, xy, xz, yz.
    pub inertia: [f64; 6],
}

/// Payload on the tool plate, and the tool frame that goes with it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PayloadTable {
    /// Mass properties in frame 7.
    pub body: BodyTable,
    /// Height of the tool frame above frame 7 (m).
    pub tool_z: f64,
    /// Cosine of the turn of the tool frame about z of frame 7.
    pub tool_cosine: f64,
    /// Sine of the turn of the tool frame about z of frame 7.
    pub tool_sine: f64,
}

pub use generated::*;

#[allow(
    clippy::approx_constant,
    reason = "the elbow's stop at 3.14 rad is a number of the model file, not a rounded pi"
)]
mod generated {
    use super::{BodyTable, PayloadTable};

    include!(concat!(env!("OUT_DIR"), "/wam7.rs"));
}
