//! The second half of the start-up: a person says where the arm stands, the pucks and the safety module are told.

use puck::{Counts, Group, Node, PropertyId, SafetyMode, Status, get, set};

use super::continuity::Continuity;
use super::home::home_counts;
use super::rest::Rest;
use super::{Next, POLL_US, REVOCATIONS, Startup, Step, ZeroRequest, after};
use crate::bus::{Answer, Outlet};
use crate::command::Refusal;
use crate::stage::StartupError;

/// Longest time from a command to zero the arm until positions are rewritten, us: two questions to the safety module
/// and two looks, of which some may be lost. A host gives a command up after 200 ms, and an arm must not be zeroed by
/// one that was given up.
const CONFIRM_US: u64 = 170_000;
/// Longest time from the second look until the last position is written, us. It takes 10 to 50 ms; where the bus has no
/// room for longer the arm may have been activated, and stand elsewhere.
const WRITE_US: u64 = 100_000;
/// Longest time for the seven replies to one position request, us.
const POSITIONS_US: u64 = 10_000;
/// Largest distance of a puck from the position just written, counts (0.3 rad of a motor, 7 mrad of J1): a braked arm
/// sinks a little between the write and the read.
const ZERO_TOLERANCE: i32 = 200;

impl Startup {
    /// The arm stands at `home` (rad): write the positions. The answer follows in [`Startup::zero_answer`].
    pub(crate) fn zero(&mut self, home: &[f32; 7]) {
        self.zero_request = match self.accept_zero(home) {
            Ok(()) => ZeroRequest::Pending,
            Err(reason) => ZeroRequest::Answered(Err(reason)),
        };
    }

    /// The same out of the cyclic loop. Until the first position is written the old zero counts, and where the zeroing
    /// comes to nothing the loop goes on with it: counts are not to change unseen meanwhile. `last` as for a restart.
    #[cold]
    #[inline(never)]
    pub(crate) fn zero_again(&mut self, home: &[f32; 7], now_us: u64, last: Option<[(Counts, u8); 7]>) {
        self.zero(home);
        self.from_loop = true;
        self.continuity = Some(Continuity::since(now_us, last));
    }

    fn accept_zero(&mut self, home: &[f32; 7]) -> Result<(), Refusal> {
        let (Some(calibration), Step::AwaitZero { .. } | Step::Done) = (&self.calibration, self.step) else {
            return Err(Refusal::NotReady(self.stage()));
        };
        self.targets = home_counts(calibration, home)?;
        self.home = *home;
        self.exchange.abandon();
        self.step = Step::ConfirmIdle { until_us: None, rests: false };
        Ok(())
    }

    /// True if a command to zero the arm has no answer yet.
    pub(crate) fn is_zero_pending(&self) -> bool {
        self.zero_request == ZeroRequest::Pending
    }

    /// The answer to a command to zero the arm, once.
    pub(crate) fn zero_answer(&mut self) -> Option<Result<(), Refusal>> {
        let ZeroRequest::Answered(answer) = self.zero_request else {
            return None;
        };
        self.zero_request = ZeroRequest::None;
        Some(answer)
    }

    /// Asks the safety module before the arm is looked at; then, if it `rests`, once more before positions are
    /// rewritten.
    pub(super) fn confirm_idle(
        &mut self,
        until_us: Option<u64>,
        rests: bool,
        outlet: &mut impl Outlet,
    ) -> Result<Next, StartupError> {
        let until_us = until_us.unwrap_or(outlet.now_us() + CONFIRM_US);
        self.step = Step::ConfirmIdle { until_us: Some(until_us), rests };
        if outlet.now_us() >= until_us {
            // Not even the question may have left.
            return Err(StartupError::NoAnswer(Node::SAFETY_MODULE));
        }
        let Some(mode) = self.ask_safety(PropertyId::MODE, outlet)? else {
            return Ok(Next::Stay);
        };
        if SafetyMode::from_value(mode) == Some(SafetyMode::Idle) {
            if !rests {
                return Ok(Next::Go(Step::AwaitRest(Rest::new(until_us))));
            }
            self.zero_request = ZeroRequest::Answered(Ok(()));
            // Broken off, it leaves a mixture of two zeros. Not even a board that restarts meanwhile may believe the
            // word of the safety module for it.
            if self.zeroed {
                self.revocations = REVOCATIONS;
            }
            self.doubt.get_or_insert(StartupError::ZeroUnfinished);
            self.zeroed = false;
            self.zeroed_at = None;
            return Ok(Next::Go(Step::IgnoreFaults { until_us: outlet.now_us() + WRITE_US }));
        }
        if SafetyMode::from_value(mode) == Some(SafetyMode::EStop) {
            self.zero_request = ZeroRequest::Answered(Err(Refusal::ZeroNeedsIdle));
            self.power_is_off();
            return Ok(Next::Stay);
        }
        Ok(self.refuse_zero(outlet))
    }

    /// Asks the safety module if positions count from a known pose.
    pub(super) fn ask_zero(&mut self, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        let Some(zero) = self.ask_safety(self.safety()?.zero, outlet)? else { return Ok(Next::Stay) };
        self.zeroed = zero != 0 && self.doubt.is_none();
        self.zeroed_at = self.zeroed_at();
        Ok(match zero {
            0 => {
                // A doubt that has cost a zero is told still, what has passed is not.
                self.error = self.error.filter(|error| Some(*error) == self.doubt);
                self.await_next_zero(outlet)
            }
            _ if self.doubt.is_some() => {
                self.error = self.doubt;
                Next::Go(Step::RevokeZero { word: 0 })
            }
            _ => Next::Go(Step::Tare),
        })
    }

    /// The arm is not idle, or it moves. Back to where the command came in: to the loop, or to the person.
    pub(super) fn refuse_zero(&mut self, outlet: &mut impl Outlet) -> Next {
        self.zero_request = ZeroRequest::Answered(Err(Refusal::ZeroNeedsIdle));
        if self.zeroed { Next::Go(Step::AskZero) } else { self.await_next_zero(outlet) }
    }

    /// The arm has no zero. What waits for one is the loop, if it was begun: a hand would be told to be ready, and
    /// nobody would ask it.
    pub(super) fn await_next_zero(&self, outlet: &mut impl Outlet) -> Next {
        let next_us = outlet.now_us() + POLL_US;
        Next::Go(if self.from_loop { Step::Tare } else { Step::AwaitZero { next_us, look: 0 } })
    }

    /// Every other look is for a puck: one that restarts meanwhile has to be woken before a person zeroes the arm.
    pub(super) fn await_zero(
        &mut self,
        next_us: u64,
        look: u8,
        outlet: &mut impl Outlet,
    ) -> Result<Next, StartupError> {
        if outlet.now_us() < next_us {
            return Ok(Next::Stay);
        }
        let go_on = |now_us: u64| {
            let look = (look + 1) % (2 * Node::ARM.len() as u8);
            Ok(Next::Go(Step::AwaitZero { next_us: now_us + POLL_US / 2, look }))
        };
        if let (1, Some(node)) = (look % 2, Node::ARM.get(usize::from(look / 2)).copied()) {
            return match self.exchange.ask(node, PropertyId::STAT, outlet) {
                Answer::Pending => Ok(Next::Stay),
                Answer::Value(status) if status != Status::Ready.value() => Err(StartupError::CountsAnew(node)),
                // Who is silent is told by who needs it.
                Answer::Value(_) | Answer::Silent => go_on(outlet.now_us()),
            };
        }
        let Some(mode) = self.ask_safety(PropertyId::MODE, outlet)? else {
            return Ok(Next::Stay);
        };
        if SafetyMode::from_value(mode) == Some(SafetyMode::EStop) {
            self.power_is_off();
            return Ok(Next::Stay);
        }
        go_on(outlet.now_us())
    }

    /// The pucks have lost power, and with it everything read and written. A doubt stays: the word may be wrong.
    fn power_is_off(&mut self) {
        let (hand, zero_request, declared, doubt) = (self.hand.again(), self.zero_request, self.declared, self.doubt);
        // The mode may have been misheard.
        let zeroed_at = self.zeroed_at;
        *self = Startup { hand, zero_request, declared, doubt, zeroed_at, ..Startup::new() };
    }

    pub(super) fn write_position(&mut self, joint: u8, until_us: u64, outlet: &mut impl Outlet) -> Next {
        if self.revocations > 0 {
            self.revoke_zero(outlet);
            return Next::Stay;
        }
        let index = usize::from(joint);
        match (Node::ARM.get(index), self.targets.get(index)) {
            (Some(node), Some(target)) => {
                let frame = set(*node, PropertyId::POSITION, target.0);
                after(outlet.send(frame), Step::WritePosition { joint: joint + 1, until_us })
            }
            _ => Next::Go(Step::CheckPositions { until_us: None }),
        }
    }

    pub(super) fn check_positions(
        &mut self,
        until_us: Option<u64>,
        outlet: &mut impl Outlet,
    ) -> Result<Next, StartupError> {
        let next =
            self.read_positions(until_us, Step::TellZero, outlet, |until_us| Step::CheckPositions { until_us })?;
        if matches!(next, Next::Go(Step::TellZero)) {
            for ((node, position), target) in Node::ARM.into_iter().zip(self.positions).zip(self.targets) {
                let near = position.is_some_and(|position| (position.0 - target.0).abs() <= ZERO_TOLERANCE);
                if !near {
                    return Err(StartupError::ZeroNotTaken(node));
                }
            }
        }
        Ok(next)
    }

    /// The safety module is asked if it has taken the zero.
    pub(super) fn confirm_zero(&mut self, outlet: &mut impl Outlet) -> Result<Next, StartupError> {
        Ok(match self.ask_safety(self.safety()?.zero, outlet)? {
            None => Next::Stay,
            Some(0) => return Err(StartupError::SafetyNotZeroed),
            Some(_) => {
                self.zeroed = true;
                self.doubt = None;
                // A person stands beside it, and nothing presses.
                self.tared = false;
                self.zeroed_at = Some(self.home);
                Next::Go(Step::Tare)
            }
        })
    }

    /// One position request to the arm; goes on to `done` when all seven have answered.
    pub(super) fn read_positions(
        &mut self,
        until_us: Option<u64>,
        done: Step,
        outlet: &mut impl Outlet,
        waiting: impl Fn(Option<u64>) -> Step,
    ) -> Result<Next, StartupError> {
        let Some(until_us) = until_us else {
            self.positions = [None; 7];
            let sent = outlet.send(get(Group::ARM, PropertyId::POSITION));
            if let Some(continuity) = self.continuity.as_mut().filter(|_| sent) {
                continuity.note_asked(outlet.now_us());
            }
            return Ok(after(sent, waiting(Some(outlet.now_us() + POSITIONS_US))));
        };
        match Node::ARM.into_iter().zip(self.positions).find(|(_, position)| position.is_none()) {
            None => Ok(Next::Go(done)),
            Some((node, _)) if outlet.now_us() >= until_us => Err(StartupError::NoAnswer(node)),
            Some(_) => Ok(Next::Stay),
        }
    }
}
