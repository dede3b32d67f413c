//! `Rest`: two looks at the arm before it is zeroed. What a person says of an arm that moves is no longer so once it is
//! written.

use puck::Node;

use super::{Next, Startup, Step};
use crate::bus::Outlet;
use crate::stage::StartupError;

/// Between the two looks, us.
const PAUSE_US: u64 = 50_000;

/// Largest change of a motor's counts between them. At a motor's 1 rad/s, 0.02 rad/s of J1 and 0.1 rad/s of J6, a joint
/// turns at most 10 mrad from the time at which a person looks at the arm until the counts are written.
const MOST_COUNTS: i32 = (PAUSE_US as f64 * 1e-6 * 4096.0 / core::f64::consts::TAU) as i32;

/// The state of the two looks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rest {
    /// The zeroing is given up at this time, us.
    deadline_us: u64,
    /// Earliest time of the look, us.
    due_us: u64,
    /// True at the second look.
    is_second: bool,
    /// Until when the answers are waited for, us, once the request has left.
    pub(super) until_us: Option<u64>,
}

impl Rest {
    pub(super) fn new(deadline_us: u64) -> Self {
        Self { deadline_us, due_us: 0, is_second: false, until_us: None }
    }
}

impl Startup {
    /// Looks at the arm twice; goes on if no motor has turned, refuses the zeroing if one has. A look of which an
    /// answer is lost is repeated.
    pub(super) fn await_rest(&mut self, rest: Rest, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let (now_us, confirm) = (outlet.now_us(), Step::ConfirmIdle { until_us: Some(rest.deadline_us), rests: true });
        if rest.until_us.is_none() && now_us >= rest.deadline_us {
            // Not even the request may have left.
            let [first, ..] = Node::ARM;
            return Err(StartupError::NoAnswer(first));
        }
        if rest.until_us.is_none() && now_us < rest.due_us {
            return Ok(Next::Stay);
        }
        let waiting = |until_us| Step::AwaitRest(Rest { until_us, ..rest });
        let next = match self.read_positions(rest.until_us, confirm, outlet, waiting) {
            Err(StartupError::NoAnswer(_)) if now_us < rest.deadline_us => Next::Go(waiting(None)),
            next => next?,
        };
        if !matches!(next, Next::Go(Step::ConfirmIdle { .. })) {
            return Ok(next);
        }
        if !rest.is_second {
            self.first_look = self.positions;
            let due_us = now_us + PAUSE_US;
            return Ok(Next::Go(Step::AwaitRest(Rest { due_us, is_second: true, until_us: None, ..rest })));
        }
        let mut looks = self.first_look.into_iter().zip(self.positions);
        let stands = looks.all(|look| match look {
            (Some(first), Some(second)) => {
                second.unwrapped_near(first).0.abs_diff(first.0) <= MOST_COUNTS.unsigned_abs()
            }
            _ => false,
        });
        Ok(if stands { next } else { self.refuse_zero(outlet) })
    }
}
