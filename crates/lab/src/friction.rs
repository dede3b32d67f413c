//! The friction of one arm's joints, from passes through postures both ways, slow and faster.
//!
//! A posture that all joints pass upwards and downwards at the same speed costs gravity both times and friction with
//! either sign: half the difference of the torques is friction. What accelerates the arm has either sign too: the
//! model's torque for the mean acceleration of a pass, which the first and the last velocity tell, is taken off before.
//! Of several speeds each joint gets the line
//!
//! ```text
//! friction(v) = coulomb + viscous v        least squares over all passes
//! ```
//!
//! A pass counts with the square of its time: the arm swings a little about its way, and the mean of a swing is the
//! smaller the longer it is watched. Unweighted, the one fastest pass turns the line.

use control::model::{ArmModel, Frames, WeightCorrection};
use control::units::{JointAccelerations, JointPositions, JointVelocities, Vector7};

use crate::weigh::{Crossing, Sample, TOUR};

/// Postures whose passes tell friction: the first of the tour, so that the ways between them are those of the tour.
pub const POSTURES: &[[f32; 7]] = TOUR.split_at(6).0;

/// Durations of the passes, s: 0.11 to 0.34 rad/s in the middle, less where the hand would be too fast for the device.
/// Faster passes tell less: what accelerates the arm then outweighs the friction.
pub const DURATIONS: [f32; 4] = [4.0, 3.0, 2.0, 1.3];

/// Fewest passes from which a line is drawn.
pub const FEWEST: usize = 4;

/// Least difference between the slowest and the fastest pass of a joint, rad/s.
pub const LEAST_RANGE: f64 = 0.05;

/// Standard errors beyond which friction below zero is no chance.
const DEVIATIONS: f64 = 3.0;

/// Friction that nobody can tell from none, N m.
const LEAST: f64 = 0.02;

/// A number with its standard error.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Estimate {
    /// The number.
    pub value: f64,
    /// Its standard error, from what the line leaves.
    pub error: f64,
}

/// Friction of one joint.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct JointFriction {
    /// Friction that does not depend on the speed, N m.
    pub coulomb: Estimate,
    /// Friction that grows with it, N m s/rad.
    pub viscous: Estimate,
    /// Residual of the line over the passes, N m RMS.
    pub left: f64,
    /// Slowest and fastest pass, rad/s.
    pub speeds: [f64; 2],
}

impl JointFriction {
    /// Friction at a speed (rad/s), N m.
    fn at(&self, speed: f64) -> f64 {
        self.coulomb.value + self.viscous.value * speed
    }
}

/// Why friction cannot be told.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum FrictionError {
    /// Too few passes were measured.
    #[error("{passes} passes both ways are too few to tell friction")]
    TooFew {
        /// Their number.
        passes: usize,
    },
    /// A sample is not a number.
    #[error("a joint angle, velocity or torque is not a number")]
    NotANumber,
    /// The torques turned the joint less than it turned: something moved it.
    #[error(
        "J{} seems to have friction of {:.2} N m: something moves it, or its torque is not what it is told",
        .joint + 1, f64::from(*.milli_nm) * 1e-3
    )]
    Negative {
        /// The joint, 0 for J1.
        joint: usize,
        /// Friction at its slowest pass, mN m.
        milli_nm: i32,
    },
    /// All passes had about the same speed.
    #[error("J{} was passed at one speed only", .joint + 1)]
    OneSpeed {
        /// The joint, 0 for J1.
        joint: usize,
    },
}

/// Mean of one pass: torque beyond what the model needs for weight and motion, and speed without its sign.
fn mean(model: &ArmModel<f64>, samples: &[Sample]) -> [[f64; 2]; 7] {
    let share = 1.0 / samples.len().max(1) as f64;
    let mut mean = [[0.0; 2]; 7];
    let acceleration = JointAccelerations(mean_acceleration(samples));
    let rotors = model.rotor_torque(&acceleration).0;
    for sample in samples {
        let (frames, speed) = (Frames::new(model, &JointPositions::from_array(sample.q)), Vector7::from(sample.speed));
        let needed = model.inverse_dynamics(&frames, &JointVelocities(speed), &acceleration).0 + rotors;
        for (joint, [torque, speed]) in mean.iter_mut().enumerate() {
            *torque += share * (sample.torque[joint] - needed[joint]);
            *speed += share * sample.speed[joint].abs();
        }
    }
    mean
}

/// Mean acceleration from the first to the last sample, rad/s^2.
fn mean_acceleration(samples: &[Sample]) -> Vector7<f64> {
    match samples {
        [first, .., last] if last.time > first.time => {
            (Vector7::from(last.speed) - Vector7::from(first.speed)) / (last.time - first.time)
        }
        _ => Vector7::zeros(),
    }
}

/// Friction of the joints from passes of an arm that weighs as `weight` says.
///
/// # Errors
/// [`FrictionError`]
pub fn measure(weight: &WeightCorrection, crossings: &[Crossing]) -> Result<[JointFriction; 7], FrictionError> {
    let complete = |crossing: &&Crossing| !crossing.up.is_empty() && !crossing.down.is_empty();
    let crossings: Vec<&Crossing> = crossings.iter().filter(complete).collect();
    if crossings.len() < FEWEST {
        return Err(FrictionError::TooFew { passes: crossings.len() });
    }
    let model = ArmModel::<f64>::corrected(weight.payload(), weight);
    let mut weights = Vec::with_capacity(crossings.len());
    let passes: Vec<[[f64; 2]; 7]> = crossings
        .iter()
        .map(|crossing| {
            let (up, down) = (mean(&model, &crossing.up), mean(&model, &crossing.down));
            weights.push((crossing.up.len().min(crossing.down.len()) as f64).powi(2));
            std::array::from_fn(|joint| {
                let ([up, up_speed], [down, down_speed]) = (up[joint], down[joint]);
                [0.5 * (up - down), 0.5 * (up_speed + down_speed)]
            })
        })
        .collect();
    let mut joints = [JointFriction::default(); 7];
    for (joint, friction) in joints.iter_mut().enumerate() {
        let points: Vec<_> = passes.iter().map(|pass| pass[joint]).zip(weights.iter().copied()).collect();
        *friction = line(&points).ok_or(FrictionError::OneSpeed { joint })?;
        if !friction.left.is_finite() {
            return Err(FrictionError::NotANumber);
        }
        let (slowest, doubt) = (friction.at(friction.speeds[0]), DEVIATIONS * friction.coulomb.error + LEAST);
        if slowest < -doubt {
            return Err(FrictionError::Negative { joint, milli_nm: (slowest * 1e3) as i32 });
        }
    }
    Ok(joints)
}

/// The line through points (friction, speed) of these weights; `None` where they are of one speed.
fn line(points: &[([f64; 2], f64)]) -> Option<JointFriction> {
    let count = points.len() as f64;
    // Their sum is that of as many points.
    let whole = count / points.iter().map(|(_, weight)| weight).sum::<f64>();
    let sum = |of: &dyn Fn(f64, f64) -> f64| points.iter().map(|([f, v], w)| w * whole * of(*f, *v)).sum::<f64>();
    let (friction, speed) = (sum(&|f, _| f) / count, sum(&|_, v| v) / count);
    let squares = sum(&|_, v| (v - speed).powi(2));
    let (slowest, fastest) = points.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), ([_, v], _)| (a.min(*v), b.max(*v)));
    if fastest - slowest < LEAST_RANGE {
        return None;
    }
    let viscous = sum(&|f, v| (v - speed) * (f - friction)) / squares;
    let coulomb = friction - viscous * speed;
    let left = sum(&|f, v| (f - coulomb - viscous * v).powi(2));
    let variance = left / (count - 2.0);
    Some(JointFriction {
        coulomb: Estimate { value: coulomb, error: (variance * (1.0 / count + speed * speed / squares)).sqrt() },
        viscous: Estimate { value: viscous, error: (variance / squares).sqrt() },
        left: (left / count).sqrt(),
        speeds: [slowest, fastest],
    })
}
