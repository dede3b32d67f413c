//! The gains of all controllers, with the values that were tuned against the simulated arm.
//!
//! The arm tracks in one of two ways: *stiff*, for everything that has to be exact (`Hold`, `Approach`, a run in free
//! space), and *compliant*, for a run whose contacts the force controller and the feedback are to decide: with stiff
//! joints the position loop overrules them.

use crate::model::wam7;
use crate::real::Real;
use crate::time::{PERIOD, periods};
use crate::units::{JOINTS, Vector7};

/// Numbers of one way to track, before they are turned into the number type of the control code.
struct Numbers {
    stiffness: [f64; 7],
    damping: [f64; 7],
    clamp: [f64; 7],
    pose: f64,
    posture: f64,
    force: (f64, f64),
    moment_share: f64,
    force_window: usize,
    force_limit: (f64, f64),
    friction_speed: f64,
}

/// Exact. With a stiffer J2 or J3 the delay of the loop and the elastic cables leave no margin where there is no
/// friction (decision 0093). Clamp times stiffness is the most a blocked joint pushes with, and that has to be more
/// than its friction.
const STIFF: Numbers = Numbers {
    stiffness: [250.0, 280.0, 105.0, 130.0, 10.0, 16.0, 2.5],
    damping: [18.0, 18.5, 4.5, 5.0, 0.3, 0.5, 0.07],
    clamp: [0.10, 0.10, 0.10, 0.10, 0.20, 0.15, 0.20],
    pose: 2.0,
    posture: 1.0,
    // What comes fast is the inertia of the hand, which drives the cables where there is no friction.
    force: (0.05, 2.0),
    moment_share: 1.0,
    force_window: periods(0.2) as usize,
    force_limit: (10.0, 1.0),
    // Friction that is not fed forward while a plan is slow is what a run is beside it at its beginning.
    friction_speed: 0.004,
};

/// Soft in contact.
const COMPLIANT: Numbers = Numbers {
    stiffness: [40.0, 55.0, 20.0, 20.0, 6.0, 5.0, 1.5],
    damping: [8.0, 12.0, 4.0, 3.5, 0.35, 0.3, 0.07],
    clamp: [0.3; 7],
    pose: 3.0,
    posture: 1.0,
    force: (0.8, 7.5),
    moment_share: 0.4,
    force_window: periods(0.5) as usize,
    // With what pushes, less than what bends the spring by the 0.3 m from which on an arm is off its plan.
    force_limit: (8.0, 1.0),
    // Along a plan that bends, a steeper sign is a gain that swings an arm without friction.
    friction_speed: 0.05,
};

/// Gain of Eq (12) at rest in a compliant run, `P + K_i Dt`.
pub(crate) const FORCE_AT_REST: f64 = COMPLIANT.force.0 + COMPLIANT.force.1 * COMPLIANT.force_window as f64 * PERIOD;

/// Distance by which friction alone, 1.5 times that of the model, draws the spring of a compliant run (rad): once a
/// joint stands there, nothing but the integral brings it to its plan.
pub(crate) const HELD_BY_FRICTION: [f64; JOINTS] = {
    let mut held = wam7::FRICTION_COULOMB;
    let mut joint = 0;
    while joint < JOINTS {
        held[joint] *= 1.5 / COMPLIANT.stiffness[joint];
        joint += 1;
    }
    held
};

/// Fraction of the model's Coulomb friction that is fed forward. Below 1, so that too large an estimate never drives.
const FRICTION_FRACTION: f64 = 0.8;

/// Planned speed of an approach at which half of the Coulomb friction is fed forward (rad/s). Without friction its
/// integral works against what is fed forward: at 0.006 rad/s J7 swings at 4 Hz.
pub(crate) const POSTURE_FRICTION_SPEED: f64 = 0.01;

/// Largest torque of the integral of `Hold` and `Approach`, in parts of the model's Coulomb friction: enough for
/// friction that is 30 % more, with 20 % to spare.
const SETTLING_FRACTION: f64 = 1.5;

/// Damping of an arm that is led by hand (N m s/rad): little beside its friction, and enough for its cables where there
/// is none.
const LEAD_DAMPING: [f64; 7] = [2.0, 3.5, 0.45, 0.5, 0.07, 0.18, 0.02];

/// Damping of a soft stop (N m s/rad).
const STOP_DAMPING: [f64; 7] = [22.0, 40.0, 4.5, 5.0, 0.22, 0.6, 0.06];

/// Digits of the hand: stiffness (N m/rad) and damping (N m s/rad) of Eq (14), in the order spread, F1, F2, F3. At a
/// finger 6 N m/rad against 0.1 N m of friction leave 0.017 rad; the reflected rotor (2.2e-3 kg m^2) and 10 ms of delay
/// bound both.
pub const HAND_STIFFNESS: [f64; 4] = [2.0, 6.0, 6.0, 6.0];
/// Damping of the digits (N m s/rad), see [`HAND_STIFFNESS`].
pub const HAND_DAMPING: [f64; 4] = [0.02, 0.1, 0.1, 0.1];

/// Friction of the hand's drives fed forward along the desired velocity: viscous (N m s/rad; a finger turns at 2.44
/// rad/s with its full torque) and 0.8 of the Coulomb friction (N m). All estimates.
pub const HAND_VISCOUS: [f64; 4] = [0.1, 0.49, 0.49, 0.49];
/// Coulomb friction of the digits that is fed forward (N m), see [`HAND_VISCOUS`].
pub const HAND_COULOMB: [f64; 4] = [0.05, 0.08, 0.08, 0.08];

/// Proportional and integral gain (1/s) of the gauges, and their window (control periods). The finger is stiff behind
/// its gauge: with the delay of filter and bus a proportional gain of 1 is close to ringing.
pub const HAND_FORCE: (f64, f64, usize) = (0.5, 2.0, periods(0.2) as usize);

/// Torque of a finger that a plan asks for which tells none (N m).
pub const HAND_GRIP: f64 = 0.45;
/// Expected torque of a gauge (N m) from which on a plan tells what it asks of that finger: what is less is drift.
pub const HAND_TOLD: f64 = 0.1;
/// Distance of a contact from the joint that presses there (m), in the middle of a link: the torque that is asked for
/// over this distance is the force that is asked for.
pub const HAND_RADIUS: f64 = 0.035;

/// Gains with which the arm follows a reference.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tracking<R: Real> {
    /// `K_p` of Eq (10) (N m/rad). Error of the plan under Coulomb friction alone: friction / K_p.
    pub stiffness: Vector7<R>,
    /// `K_d` of Eq (10) (N m s/rad).
    pub damping: Vector7<R>,
    /// Coulomb friction fed forward (N m).
    pub coulomb: Vector7<R>,
    /// Planned speed of a run at which half of the Coulomb friction is fed forward (rad/s).
    pub friction_speed: R,
    /// Viscous friction fed forward (N m s/rad).
    pub viscous: Vector7<R>,
    /// Largest `|q_d - q|` per joint (rad): anti-windup of Eq (11).
    pub clamp: Vector7<R>,
    /// `K_x` of Eq (11) for the position (1/s).
    pub position: R,
    /// `K_x` of Eq (11) for the orientation (1/s).
    pub orientation: R,
    /// `K_post` of Eq (11) (1/s).
    pub posture: R,
    /// Damping `lambda` of the pseudo-inverse (m^2). Accuracy near a singularity against joint speed there: with 4e-4 a
    /// direction of singular value 0.16 keeps 98 % of its motion, with the 0.01 of other controllers 72 %.
    pub inverse_damping: R,
    /// Proportional gain of Eq (12); the paper has 1. Less has more margin, and touches harder (decision 0130).
    pub force_proportional: R,
    /// `K_i` of Eq (12) (1/s).
    pub force_integral: R,
    /// Share of both gains that acts on the torque rows. Below 1 where the wrist is soft: the forearm's inertia about
    /// the hand's axis is so small that, at full gain, closing fingers make it whip.
    pub moment_share: R,
    /// Window `Delta t` of Eq (12) (control periods).
    pub force_window: usize,
    /// Largest force (N) and torque (N m) that Eq (12) commands: a sensor that is stuck pushes with no more.
    pub force_limit: (R, R),
}

/// Gains of Eq (14), digits in the order spread, F1, F2, F3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandGains<R: Real> {
    /// Stiffness (N m/rad).
    pub stiffness: [R; 4],
    /// Damping (N m s/rad).
    pub damping: [R; 4],
    /// Viscous friction fed forward (N m s/rad).
    pub viscous: [R; 4],
    /// Coulomb friction fed forward (N m).
    pub coulomb: [R; 4],
    /// Proportional gain of the gauges.
    pub force_proportional: R,
    /// Integral gain of the gauges (1/s).
    pub force_integral: R,
    /// Window of that integral (control periods).
    pub force_window: usize,
}

/// Every gain of the controllers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gains<R: Real> {
    /// For `Hold`, `Approach` and runs that are to be exact.
    pub stiff: Tracking<R>,
    /// For runs that are to be soft in contact.
    pub compliant: Tracking<R>,
    /// Largest shift of a held posture by the integral (rad); times `K_p` the most it adds against an obstacle.
    pub settling: Vector7<R>,
    /// Damping of an arm that is led by hand (N m s/rad).
    pub lead_damping: Vector7<R>,
    /// Damping of a soft stop (N m s/rad).
    pub stop_damping: Vector7<R>,
    /// The hand.
    pub hand: HandGains<R>,
}

impl<R: Real> Gains<R> {
    /// The gains this crate was tuned with.
    pub fn tuned() -> Self {
        Gains {
            stiff: Tracking::from_numbers(&STIFF),
            compliant: Tracking::from_numbers(&COMPLIANT),
            settling: (vector(wam7::FRICTION_COULOMB) * R::constant(SETTLING_FRACTION))
                .component_div(&vector(STIFF.stiffness)),
            lead_damping: vector(LEAD_DAMPING),
            stop_damping: vector(STOP_DAMPING),
            hand: HandGains {
                stiffness: HAND_STIFFNESS.map(R::constant),
                damping: HAND_DAMPING.map(R::constant),
                viscous: HAND_VISCOUS.map(R::constant),
                coulomb: HAND_COULOMB.map(R::constant),
                force_proportional: R::constant(HAND_FORCE.0),
                force_integral: R::constant(HAND_FORCE.1),
                force_window: HAND_FORCE.2,
            },
        }
    }

    /// The way to track that a run asks for.
    pub fn tracking(&self, compliant: bool) -> &Tracking<R> {
        if compliant { &self.compliant } else { &self.stiff }
    }
}

impl<R: Real> Tracking<R> {
    fn from_numbers(numbers: &Numbers) -> Self {
        Tracking {
            stiffness: vector(numbers.stiffness),
            damping: vector(numbers.damping),
            coulomb: vector(wam7::FRICTION_COULOMB) * R::constant(FRICTION_FRACTION),
            friction_speed: R::constant(numbers.friction_speed),
            viscous: vector(wam7::FRICTION_VISCOUS),
            clamp: vector(numbers.clamp),
            position: R::constant(numbers.pose),
            orientation: R::constant(numbers.pose),
            posture: R::constant(numbers.posture),
            inverse_damping: R::constant(4e-4),
            force_proportional: R::constant(numbers.force.0),
            force_integral: R::constant(numbers.force.1),
            moment_share: R::constant(numbers.moment_share),
            force_window: numbers.force_window,
            force_limit: (R::constant(numbers.force_limit.0), R::constant(numbers.force_limit.1)),
        }
    }
}

fn vector<R: Real>(values: [f64; 7]) -> Vector7<R> {
    Vector7::from(values.map(R::constant))
}

impl<R: Real> Default for Gains<R> {
    fn default() -> Self {
        Gains::tuned()
    }
}
