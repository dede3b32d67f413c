//! Reasons for which a MuJoCo world cannot be set up.

/// Reason for which a MuJoCo world or its kinematics cannot be set up.
#[derive(Debug, thiserror::Error)]
pub enum WorldError {
    /// MuJoCo did not take the model: the library does not fit to this program.
    #[error("MuJoCo refuses the arm model: {0}")]
    Model(String),
    /// The model lacks a part that this program looks up by name.
    #[error("the arm model has no {kind} named `{name}`")]
    Missing {
        /// Kind of the part.
        kind: &'static str,
        /// Name looked for.
        name: String,
    },
    /// A starting joint angle is not a number within the joint's range.
    #[error("joint {joint} cannot start at {angle} rad: its range is {low} .. {high} rad")]
    Posture {
        /// Joint, 1 to 7.
        joint: usize,
        /// Angle asked for, rad.
        angle: f64,
        /// Lower end of its range, rad.
        low: f64,
        /// Upper end of its range, rad.
        high: f64,
    },
    /// The object would stand beside the table.
    #[error("the object cannot be at ({x}, {y}) m: that is not on the table")]
    OffTable {
        /// World x, m.
        x: f64,
        /// World y, m.
        y: f64,
    },
    /// A finger or spread angle, gravity, or a figure of the object or of an imperfection is not a usable number.
    #[error("{what} cannot be {value}")]
    OutOfRange {
        /// The quantity that is out of range.
        what: &'static str,
        /// The value asked for.
        value: f64,
    },
}
