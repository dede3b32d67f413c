//! Commands of the host in the cyclic loop: for the control cycle, the start-up, or the hand.

use control::State;
use link::HandStage;

use super::DeviceController;
use crate::application::ControllerIo;
use crate::command::{Command, Refusal};
use crate::event::EventKind;
use puck::SafetyMode;

impl DeviceController {
    /// The command for the control cycle; those for others are answered here. Not inlined: it is rare, and the
    /// memory of the control slot is small.
    #[cold]
    #[inline(never)]
    pub(super) fn obey(
        &mut self,
        command: Command,
        now_us: u64,
        io: &mut impl ControllerIo<Self>,
    ) -> Option<control::Command> {
        match command {
            Command::Control(control::Command::Run(_)) if self.hand.stage() == HandStage::Initialising => {
                // The plan would go on without the digits, and they would be thrown after it.
                self.tell(EventKind::Refused(Refusal::HandBusy), io);
                None
            }
            Command::Control(command) => {
                if command == control::Command::Stop {
                    self.hand.stop();
                }
                Some(command)
            }
            Command::InitialiseHand => {
                let running = matches!(self.cycle.state(), State::Run | State::Coast);
                let outcome = if running { Err(Refusal::HandBusy) } else { self.hand.initialise(now_us) };
                self.tell(outcome.map_or_else(EventKind::Refused, |()| EventKind::Accepted), io);
                None
            }
            Command::Zero { home } => {
                if self.hand.stage() == HandStage::Initialising {
                    // The bus would be zeroing's alone, and a stop would not reach the digits that move.
                    self.tell(EventKind::Refused(Refusal::HandBusy), io);
                } else if !self.cycle.state().has_torque() && self.safety_mode == Some(SafetyMode::Idle) {
                    // Under a latched fault too: what has lost its zero cannot be cleared before.
                    self.startup.zero_again(&home, now_us, self.cycle.last_counts());
                } else {
                    self.tell(EventKind::Refused(Refusal::ZeroNeedsIdle), io);
                }
                None
            }
        }
    }
}
