//! `Command` and `RunOptions`: requests of a person, already in fixed point.

use crate::DIGITS;
use crate::number::Number;

/// Options of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunOptions {
    /// Speed relative to the taught one.
    pub speed: Number,
    /// The gauges bend the plan, Eqs (8) and (9).
    pub feedback: bool,
    /// The gauges act on the torque, Eq (14).
    pub force_control: bool,
}

/// One request of a person on its way to the control half; each is answered once.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Command {
    /// "The hand may open": drive the digits to their open stops and count from there.
    InitialiseHand,
    /// Keep what is held: the last reference of a move, the measured posture of a run, else the posture by the worm
    /// drives.
    Hold,
    /// Move along a minimum-jerk path.
    Move {
        /// Target: spread, F1, F2, F3 (rad).
        q: [Number; DIGITS],
        /// Requested duration (s); lengthened where the speed limits ask for it.
        duration: Number,
    },
    /// Run the loaded primitive.
    Run(RunOptions),
    /// Change the speed of the present run.
    SetSpeed {
        /// Relative to the taught speed.
        factor: Number,
    },
    /// End any motion: torque off, the worm drives hold.
    Stop,
    /// The same, without latching: the hand may be commanded at once.
    Release,
    /// Leave a stop or a fault, once its cause is gone.
    ClearFault,
    /// Take the present gauges as zero.
    Tare,
}
