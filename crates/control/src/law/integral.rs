//! `PostureIntegral`: the slow part of holding a posture, which takes away what friction leaves.
//!
//! Eq (10) alone rests wherever `K_p (q_d - q)` is less than the Coulomb friction: up to 0.04 rad at J7. While the arm
//! holds or approaches, the desired posture is therefore shifted towards the error, joint by joint, until the joint
//! moves:
//!
//! * at a constant rate while the joint stands, the whole clamp in [`RISE`], so that friction is overcome in the same
//!   time however small the error; once it moves, at a rate that falls with the error, at most 0.08 rad/s (J7);
//! * from an error of three quarters of [`TOLERANCE`] on, until it is less than half of it; in between nothing changes,
//!   which is why it does not hunt;
//! * within a clamp worth 1.5 times the friction of the model: an obstacle feels that much more, and no more with time.

use crate::law::gains::Gains;
use crate::real::{Real, at_least, at_most, within};
use crate::time::PERIOD;
use crate::units::{JOINTS, JointPositions, Vector7};

/// Accuracy of a held posture under the friction of the model, 30 % more or less (rad).
pub const TOLERANCE: [f64; JOINTS] = [0.004, 0.004, 0.004, 0.004, 0.008, 0.008, 0.008];

/// Time from zero to the clamp (s).
pub const RISE: f64 = 0.8;

/// Fractions of the tolerance beyond which a joint begins to be shifted, and below which it is left alone again.
const BAND: (f64, f64) = (0.75, 0.5);

/// Least part of that rate for a joint that moves. It is all of it from one and a half times the tolerance on, and in
/// between in proportion to the error: with all of it at the edge of the band J7, J5 and J3 swing at 3 to 4 Hz at half
/// the stiffness, and at the nominal one each edge is a jerk of 0.07 rad/s.
const LEAST_RATE: f64 = 0.3;

/// Speed below which a joint stands (rad/s): friction holds it, and it swings with nothing.
const STANDS: f64 = 0.004;

/// Integral action on the posture that is held.
#[derive(Clone, Debug)]
pub struct PostureIntegral<R: Real> {
    /// Shift of the desired posture (rad).
    shift: Vector7<R>,
    /// Joints that are being shifted.
    seeking: [bool; JOINTS],
}

impl<R: Real> PostureIntegral<R> {
    /// Without a shift.
    pub fn new() -> Self {
        PostureIntegral { shift: Vector7::zeros(), seeking: [false; JOINTS] }
    }

    /// Shift of the desired posture (rad); times `K_p` it is the torque of the integral.
    pub fn shift(&self) -> &Vector7<R> {
        &self.shift
    }

    /// Takes over from a law whose torque, beyond what the arm itself needs, equals `K_p offset`: as much of the offset
    /// (rad) as the clamp allows becomes shift, so that the torque makes no step. Returns the posture to hold: `q`
    /// where friction and the error of the model alone are in the way.
    pub fn take_over(&mut self, gains: &Gains<R>, offset: &Vector7<R>, q: &JointPositions<R>) -> JointPositions<R> {
        *self = PostureIntegral { shift: offset.zip_map(&gains.settling, within), seeking: [false; JOINTS] };
        JointPositions(q.0 + offset - self.shift)
    }

    /// True if every joint was close enough to be left alone in the last control period.
    pub fn is_settled(&self) -> bool {
        !self.seeking.contains(&true)
    }

    /// One control period towards the posture `q_d`, measured at `q`; the caller leaves it out where a torque could not
    /// be given in full or a position is not measured.
    ///
    /// A joint that already closes its error (rad) at the rate of the integral, `closing` (rad/s), is left alone: more
    /// torque would only carry it past.
    pub fn step(&mut self, gains: &Gains<R>, error: &Vector7<R>, closing: &Vector7<R>) {
        let joints = self.shift.iter_mut().zip(&mut self.seeking).zip(error.iter()).zip(gains.settling.iter());
        for (((((shift, seeking), error), clamp), tolerance), closing) in joints.zip(TOLERANCE).zip(closing.iter()) {
            let zero = R::constant(0.0);
            let (sign, magnitude) =
                if *error < zero { (R::constant(-1.0), -*error) } else { (R::constant(1.0), *error) };
            let bound = if *seeking { BAND.1 } else { BAND.0 };
            *seeking = magnitude > R::constant(bound * tolerance);
            let advancing = *closing * sign;
            if *seeking && advancing < *clamp * R::constant(1.0 / RISE) {
                let beyond = magnitude * R::constant(1.0 / tolerance) - R::constant(BAND.1);
                let stands = advancing < R::constant(STANDS) && advancing > R::constant(-STANDS);
                let least = R::constant(if stands { 1.0 } else { LEAST_RATE });
                let rate = at_least(at_most(beyond, R::constant(1.0)), least);
                *shift = within(*shift + sign * *clamp * rate * R::constant(PERIOD / RISE), *clamp);
            }
        }
    }
}

impl<R: Real> Default for PostureIntegral<R> {
    fn default() -> Self {
        PostureIntegral::new()
    }
}
