//! Requests that move the arm, and the ways to bring it to rest.

use std::time::Duration;

use control::State;
use link::{Goal, HandStage, Name, Request, RunOptions, Status};

use super::Client;
use crate::error::HostError;
use crate::transport::Transport;

/// Longest time until the arm leaves its motion after a stop was accepted. The soft stop begins in the cycle
/// after the command; this leaves room for a slow line.
const STOP_TIMEOUT: Duration = Duration::from_millis(200);

/// Longest time that a motion of the hand takes whose duration the device chooses, or an initialisation after it was
/// last seen to go on; behind a motion of another duration it is more than enough.
const HAND_CHOOSES: Duration = Duration::from_secs(10);

impl<T: Transport> Client<T> {
    /// Tells the device at which joint angles (rad) the arm stands now.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn zero(&mut self, home: [f32; 7]) -> Result<(), HostError> {
        self.order(&Request::Zero { home })
    }

    /// Compensates gravity, so that a person can lead the arm.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn gravity(&mut self) -> Result<(), HostError> {
        self.order(&Request::Gravity)
    }

    /// Holds the present pose.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn hold(&mut self) -> Result<(), HostError> {
        self.order(&Request::Hold)
    }

    /// Moves the joints to `q` (rad) in `duration` (s); 0 lets the device choose.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn approach(&mut self, q: [f32; 7], duration: f32) -> Result<(), HostError> {
        self.order(&Request::Approach { q, duration })
    }

    /// Takes the present wrench and the present gauges as zero, or those of them that the device has.
    ///
    /// # Errors
    /// As [`Client::request`]; refused in a run, and where no wrench is measured by an arm that has a sensor.
    pub fn tare(&mut self) -> Result<(), HostError> {
        self.order(&Request::Tare)
    }

    /// Initialises the hand: the fingers drive to their stops, for about five seconds. Accepted before that time is
    /// over; the status tells the rest.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn initialise_hand(&mut self) -> Result<(), HostError> {
        self.order(&Request::InitialiseHand)
    }

    /// Moves spread and fingers F1 to F3 to `q` (rad) in `duration` (s); 0 lets the device choose.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn move_hand(&mut self, q: [f32; 4], duration: f32) -> Result<(), HostError> {
        self.order(&Request::MoveHand { q, duration })
    }

    /// Starts a stored primitive.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn run(&mut self, name: &Name, options: RunOptions) -> Result<(), HostError> {
        self.order(&Request::Run { name: name.clone(), options })
    }

    /// Moves the goal of the running primitive.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn set_goal(&mut self, goal: Goal) -> Result<(), HostError> {
        self.order(&Request::SetGoal(goal))
    }

    /// Changes the speed of the running primitive; 1 is as taught.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn set_speed(&mut self, factor: f32) -> Result<(), HostError> {
        self.order(&Request::SetSpeed { factor })
    }

    /// Clears a fault whose cause is gone.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn clear_fault(&mut self) -> Result<(), HostError> {
        self.order(&Request::ClearFault)
    }

    /// Gives up torque. An arm that is not braked sinks.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn release(&mut self) -> Result<(), HostError> {
        self.order(&Request::Release)
    }

    /// Stops any motion and waits until the arm has left it.
    ///
    /// # Errors
    /// As [`Client::request`]; [`HostError::NotStopped`] if the motion goes on after 200 ms.
    pub fn stop(&mut self) -> Result<(), HostError> {
        self.order(&Request::Stop)?;
        let started = self.now();
        loop {
            let status = self.status()?;
            if !is_moving(status.state) {
                return Ok(());
            }
            let after = self.now().saturating_sub(started);
            if after > STOP_TIMEOUT {
                return Err(HostError::NotStopped { after });
            }
        }
    }

    /// Waits until an arm that is stopping stands still, for a second at most: the next command may ask for that.
    fn come_to_rest(&mut self) -> Result<(), HostError> {
        let end = self.now() + REST_TIMEOUT;
        let (mut before, mut looked) = (self.status()?.q, self.now());
        while self.now() < end {
            let now = self.status()?.q;
            if self.now().saturating_sub(looked) < LOOK {
                continue;
            }
            if before.iter().zip(&now).all(|(before, now)| (before - now).abs() < STILL) {
                break;
            }
            (before, looked) = (now, self.now());
        }
        Ok(())
    }

    /// Notes what a request that was taken sets in motion, or ends.
    pub(super) fn note_order(&mut self, request: &Request) {
        match request {
            Request::Gravity | Request::Approach { .. } | Request::Run { .. } => {
                (self.moving, self.seen_moving) = (true, false);
            }
            Request::MoveHand { duration, .. } => self.hand_may_move_for(*duration),
            Request::InitialiseHand => self.hand_may_move_for(0.0),
            Request::Stop => (self.moving, self.hand_moves_until) = (false, Duration::ZERO),
            Request::Hold | Request::Release => self.moving = false,
            _ => {}
        }
    }

    /// Notes the state in a cycle of the device. The event that ends a motion may have been lost on the line; a motion
    /// that has ended is not stopped. Cycles of before the motion may come behind the answer to its order.
    pub(super) fn note_state(&mut self, state: u8) {
        match State::from_code(state) {
            Some(State::Gravity | State::Approach | State::Run) => self.seen_moving = true,
            // What is bridged may be a hold as well as a motion.
            Some(State::Coast) => {}
            _ => self.moving &= !self.seen_moving,
        }
    }

    /// Notes what a status tells of motions. A hand takes up to ten seconds for its fingers and ten for its spread: an
    /// initialisation of this host goes on for as long as it is seen to.
    pub(super) fn note_status(&mut self, status: &Status) {
        self.moving &= is_moving(status.state);
        if status.hand_stage == HandStage::Initialising && self.now() < self.hand_moves_until {
            self.hand_may_move_for(0.0);
        }
    }

    /// A motion of the hand begins that takes so long, s; 0 is as long as the device chooses, or an initialisation
    /// takes.
    pub(super) fn hand_may_move_for(&mut self, seconds: f32) {
        let asked = Duration::try_from_secs_f32(seconds).unwrap_or_default();
        self.hand_moves_until = self.now() + asked + HAND_CHOOSES;
    }

    /// Stops the arm because the user asked to; the error to end with.
    ///
    /// Nothing is stopped where this host has set nothing in motion: what moves is another's, and `tactus stop` is
    /// there for it.
    pub(super) fn interrupted(&mut self) -> HostError {
        self.is_heeded = true;
        if !self.moving && self.now() >= self.hand_moves_until {
            return HostError::Left;
        }
        // Stopping waits for answers, and must not be interrupted by the wish to stop.
        let interrupt = std::mem::take(&mut self.interrupt);
        let stopped = self.stop().and_then(|()| self.come_to_rest());
        self.interrupt = interrupt;
        match stopped {
            Ok(()) => HostError::Interrupted,
            Err(error) => error,
        }
    }
}

/// Largest change (rad) of a joint in [`LOOK`] for which an arm counts as at rest: 0.05 rad/s.
const STILL: f32 = 0.001;

/// Time between two looks at the joints of an arm that is stopping.
const LOOK: Duration = Duration::from_millis(20);

/// Longest time for which an arm that is stopping is waited for.
const REST_TIMEOUT: Duration = Duration::from_secs(1);

/// True for what sets arm or hand in motion, or gives an arm torque that had none: a hold of one that is `moving` for
/// this host is how its motion ends.
pub(super) fn begins(request: &Request, moving: bool) -> bool {
    match request {
        Request::Gravity
        | Request::Approach { .. }
        | Request::Run { .. }
        | Request::InitialiseHand
        | Request::MoveHand { .. } => true,
        Request::Hold => !moving,
        _ => false,
    }
}

/// True for a state that the device would end when this host fell silent.
pub(super) fn is_moving(state: u8) -> bool {
    matches!(State::from_code(state), Some(State::Gravity | State::Approach | State::Run | State::Coast))
}
