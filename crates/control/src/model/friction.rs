//! The friction of the joints, as the motors feel it.

use puck::Transmission;

use crate::model::wam7;
use crate::real::{Real, at_least};
use crate::units::JOINTS;

/// Largest swing of the torque against friction that a motor can take without turning, in parts of the model's
/// friction. Friction that is 30 % more holds 2.6 of it, from one direction to the other.
pub(crate) const SWING: f64 = 3.0;

/// Coulomb friction of the model at each motor (N m), were that of every joint it turns to act against it.
pub(crate) fn at_motors<R: Real>(transmission: &Transmission<R>) -> [R; JOINTS] {
    let zero = R::constant(0.0);
    let mut most = [zero; JOINTS];
    for (joint, friction) in wam7::FRICTION_COULOMB.into_iter().enumerate() {
        let torque = core::array::from_fn(|of| if of == joint { R::constant(friction) } else { zero });
        for (most, part) in most.iter_mut().zip(transmission.motor_torques_from_joint(&torque)) {
            *most += at_least(part, -part);
        }
    }
    most
}
