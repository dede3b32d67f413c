//! The supervisor: which state the arm is in, and who may change it.
//!
//! ```text
//!            Gravity, Hold (a person, safety ACTIVE)        Approach, Run (a person)
//!   Idle ------------------------------------------> Gravity, Hold ------> Approach, Run
//!    ^  <-- Lower <-- Release (any state with torque)     ^                      |  Arrived -> Hold
//!    |  <-- safety not ACTIVE (any state)                 | Clear                | reply missing <-> Coast (5 cycles)
//!  Fault <------- SoftStop <------------------------------+----------------------+ Stop, limits, 6 bad cycles
//!    Clear -> Idle
//! ```
//!
//! The first cause of a stop stays until a person clears it, whatever follows from it.

use crate::command::Refusal;
use crate::guard::fault::Fault;

/// State of the arm. The codes travel in telemetry and are never renumbered.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum State {
    /// No torque authority.
    Idle = 0,
    /// Gravity compensation: the arm floats and can be taught by hand.
    Gravity = 1,
    /// Holds a posture.
    Hold = 2,
    /// Moves in joint space to a posture.
    Approach = 3,
    /// Runs the loaded primitive.
    Run = 4,
    /// Bridges up to five cycles of lost replies; returns by itself.
    Coast = 5,
    /// Gravity compensation and damping after a stop.
    SoftStop = 6,
    /// Torque is off until a person clears the fault.
    Fault = 7,
    /// Sinks slowly after a release, until it rests.
    Lower = 8,
}

impl State {
    /// Every state, in the order of the codes.
    pub const ALL: [State; 9] = [
        State::Idle,
        State::Gravity,
        State::Hold,
        State::Approach,
        State::Run,
        State::Coast,
        State::SoftStop,
        State::Fault,
        State::Lower,
    ];

    /// The stable number of this state.
    pub const fn code(self) -> u8 {
        self as u8
    }

    /// The state with this number, if there is one.
    pub fn from_code(code: u8) -> Option<State> {
        State::ALL.into_iter().find(|state| state.code() == code)
    }

    /// True if torque is sent in this state.
    pub const fn has_torque(self) -> bool {
        !matches!(self, State::Idle | State::Fault)
    }

    /// The name shown to a person.
    pub const fn name(self) -> &'static str {
        match self {
            State::Idle => "idle",
            State::Gravity => "gravity",
            State::Hold => "hold",
            State::Approach => "approach",
            State::Run => "run",
            State::Coast => "coast",
            State::SoftStop => "soft stop",
            State::Fault => "fault",
            State::Lower => "lowering",
        }
    }
}

impl core::fmt::Display for State {
    fn fmt(&self, formatter: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        formatter.write_str(self.name())
    }
}

/// Something that may change the state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// A person asks to float.
    Gravity,
    /// A person asks to hold.
    Hold,
    /// A person asks for a joint-space move.
    Approach,
    /// A person asks to run the primitive.
    Run,
    /// A person asks to stop.
    Stop,
    /// A person gives up torque.
    Release,
    /// A person clears a stop or a fault.
    Clear,
    /// Positions are missing in this cycle, and the bridge still holds.
    RepliesMissing,
    /// All positions are there again.
    RepliesBack,
    /// A limit was passed, or positions were missing for too long.
    SoftFault,
    /// Torque must go off.
    HardFault,
    /// The safety module is no longer ACTIVE.
    SafetyDropped,
    /// The movement is over; of a lowered arm, that it rests.
    Arrived,
}

impl Trigger {
    /// Every trigger.
    pub const ALL: [Trigger; 13] = [
        Trigger::Gravity,
        Trigger::Hold,
        Trigger::Approach,
        Trigger::Run,
        Trigger::Stop,
        Trigger::Release,
        Trigger::Clear,
        Trigger::RepliesMissing,
        Trigger::RepliesBack,
        Trigger::SoftFault,
        Trigger::HardFault,
        Trigger::SafetyDropped,
        Trigger::Arrived,
    ];

    /// True if a person caused it.
    pub const fn is_command(self) -> bool {
        matches!(
            self,
            Trigger::Gravity
                | Trigger::Hold
                | Trigger::Approach
                | Trigger::Run
                | Trigger::Stop
                | Trigger::Release
                | Trigger::Clear
        )
    }
}

/// Effect of a trigger in a state.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Transition {
    /// Nothing changes.
    Stay,
    /// The state changes.
    Enter(State),
    /// Back to the state that was bridged.
    Resume,
    /// The command is not allowed in this state.
    Refuse,
}

/// The whole state machine. Torque authority goes down by itself; it goes up by a person's command alone (whose further
/// conditions, above all an ACTIVE safety module, the cycle checks first). The one exception is `Coast`, which returns
/// to the state it bridged.
pub const fn transition(state: State, trigger: Trigger) -> Transition {
    use Transition::{Enter, Refuse, Resume, Stay};
    match (state, trigger) {
        // The safety module has the last word in every state with torque; a latched fault stays.
        (State::Idle | State::Fault, Trigger::SafetyDropped) => Stay,
        (_, Trigger::SafetyDropped) => Enter(State::Idle),
        (State::Idle | State::Fault, Trigger::HardFault) => Stay,
        (_, Trigger::HardFault) => Enter(State::Fault),
        (State::Idle | State::Fault | State::SoftStop, Trigger::SoftFault) => Stay,
        (_, Trigger::SoftFault) => Enter(State::SoftStop),

        (State::Gravity | State::Hold | State::Approach | State::Run, Trigger::RepliesMissing) => Enter(State::Coast),
        (_, Trigger::RepliesMissing) => Stay,
        (State::Coast, Trigger::RepliesBack) => Resume,
        (_, Trigger::RepliesBack) => Stay,
        (State::Approach | State::Run, Trigger::Arrived) => Enter(State::Hold),
        (State::Lower, Trigger::Arrived) => Enter(State::Idle),
        (_, Trigger::Arrived) => Stay,

        (State::Fault, Trigger::Release | Trigger::Stop) => Stay,
        (State::Idle, Trigger::Release | Trigger::Stop) => Stay,
        (State::Lower, Trigger::Release) => Stay,
        (_, Trigger::Release) => Enter(State::Lower),
        (State::SoftStop, Trigger::Stop) => Stay,
        (_, Trigger::Stop) => Enter(State::SoftStop),

        (State::Idle, Trigger::Clear) => Stay,
        (State::Fault, Trigger::Clear) => Enter(State::Idle),
        (State::SoftStop, Trigger::Clear) => Enter(State::Gravity),
        (_, Trigger::Clear) => Refuse,

        (State::Gravity, Trigger::Gravity) => Stay,
        (
            State::Idle | State::Hold | State::Approach | State::Run | State::SoftStop | State::Lower,
            Trigger::Gravity,
        ) => Enter(State::Gravity),
        (State::Hold, Trigger::Hold) => Stay,
        (
            State::Idle | State::Gravity | State::Approach | State::Run | State::SoftStop | State::Lower,
            Trigger::Hold,
        ) => Enter(State::Hold),
        (State::Gravity | State::Hold, Trigger::Approach) => Enter(State::Approach),
        (State::Gravity | State::Hold, Trigger::Run) => Enter(State::Run),
        (_, Trigger::Gravity | Trigger::Hold | Trigger::Approach | Trigger::Run) => Refuse,
    }
}

/// The state with what has to be remembered beside it.
#[derive(Clone, Copy, Debug)]
pub struct Supervisor {
    state: State,
    bridged: State,
    fault: Fault,
}

impl Supervisor {
    /// Idle, without a fault.
    pub const fn new() -> Self {
        Supervisor { state: State::Idle, bridged: State::Idle, fault: Fault::None }
    }

    /// The present state.
    pub const fn state(&self) -> State {
        self.state
    }

    /// The state whose control law acts: while coasting, the bridged one.
    pub const fn law(&self) -> State {
        match self.state {
            State::Coast => self.bridged,
            state => state,
        }
    }

    /// The latched fault.
    pub const fn fault(&self) -> Fault {
        self.fault
    }

    /// True if a command would be taken.
    ///
    /// # Errors
    /// [`Refusal::WrongState`] where it would not.
    pub const fn allows(&self, trigger: Trigger) -> Result<(), Refusal> {
        match transition(self.state, trigger) {
            Transition::Refuse => Err(Refusal::WrongState),
            _ => Ok(()),
        }
    }

    /// Latches a fault, unless an earlier one waits for a person. A loss that goes on is the same cause.
    pub fn latch(&mut self, fault: Fault) {
        let goes_on = (self.fault, fault) == (Fault::RepliesLost, Fault::RepliesLostForLong);
        if self.fault == Fault::None || goes_on {
            self.fault = fault;
        }
    }

    /// Takes a trigger; true if the control law changed. `fault` is latched if the trigger takes torque authority away,
    /// or finds it taken by a stop. A person clears it: with Clear, or by arming again after the safety module's drop.
    ///
    /// # Errors
    /// [`Refusal::WrongState`] for a command that the state does not allow.
    pub fn take(&mut self, trigger: Trigger, fault: Fault) -> Result<bool, Refusal> {
        let before = self.law();
        match transition(self.state, trigger) {
            Transition::Refuse => return Err(Refusal::WrongState),
            Transition::Stay => {
                match trigger {
                    Trigger::Clear => self.fault = Fault::None,
                    Trigger::SoftFault if self.state == State::SoftStop => self.latch(fault),
                    _ => {}
                }
                return Ok(false);
            }
            Transition::Resume => self.state = self.bridged,
            Transition::Enter(State::Coast) => {
                self.bridged = self.state;
                self.state = State::Coast;
            }
            Transition::Enter(next) => {
                self.state = next;
                let arms = matches!(trigger, Trigger::Gravity | Trigger::Hold);
                if !trigger.is_command() {
                    self.latch(fault);
                } else if trigger == Trigger::Clear || (arms && self.fault == Fault::SafetyDropped) {
                    self.fault = Fault::None;
                }
            }
        }
        Ok(self.law() != before)
    }
}

impl Default for Supervisor {
    fn default() -> Self {
        Supervisor::new()
    }
}
