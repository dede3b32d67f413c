//! The mode of the hand's drives: MODE of its four pucks.
//!
//! Nobody but us sets the mode of a hand puck. TORQUE is entered before the first torque frame and left when none has
//! come for some cycles: then the worm drives hold the fingers without current. A puck keeps its last torque until it
//! hears another or leaves TORQUE, so the first cycle without a torque sends zeros.

use puck::{CanFrame, Group, MotorMode, Node, PropertyId, PuckTorque, packed_torques, set};

/// Cycles without a torque after which the drives are set to IDLE.
const UNDRIVEN_CYCLES: u8 = 3;

/// The mode asked of the four pucks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wanted {
    /// Whatever the initialisation left, IDLE or holding: never TORQUE.
    Rest,
    /// TORQUE; frames may leave once the SET has.
    Torque,
}

/// The drives of the hand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Drive {
    wanted: Wanted,
    /// The SET of the wanted mode has not left yet.
    due: bool,
    undriven: u8,
    /// A puck that told another mode than the wanted one.
    astray: Option<Node>,
}

impl Drive {
    /// Drives at rest. `due`: MODE IDLE shall be sent, for what they did before is not known.
    pub const fn resting(due: bool) -> Drive {
        Drive { wanted: Wanted::Rest, due, undriven: 0, astray: None }
    }

    /// The frame of this cycle from the one the control cycle asks for.
    pub fn torque_frame(&mut self, asked: Option<CanFrame>) -> Option<CanFrame> {
        match (asked, self.wanted) {
            (Some(frame), Wanted::Torque) => {
                self.undriven = 0;
                (!self.due).then_some(frame)
            }
            (Some(_), Wanted::Rest) => {
                *self = Drive { wanted: Wanted::Torque, due: true, undriven: 0, astray: None };
                None
            }
            (None, Wanted::Torque) => {
                self.undriven = self.undriven.saturating_add(1);
                if self.undriven >= UNDRIVEN_CYCLES {
                    *self = Drive::resting(true);
                }
                Some(packed_torques(Group::HAND, PropertyId::TORQUE, [PuckTorque::ZERO; 4]))
            }
            (None, Wanted::Rest) => None,
        }
    }

    /// The SET that is due, if there is one. Call [`Drive::mode_sent`] when it has left.
    pub fn mode_frame(&self) -> Option<CanFrame> {
        let value = match self.wanted {
            Wanted::Rest => MotorMode::Idle,
            Wanted::Torque => MotorMode::Torque,
        }
        .value();
        if self.due {
            Some(set(Group::HAND, PropertyId::MODE, value))
        } else {
            self.astray.map(|node| set(node, PropertyId::MODE, value))
        }
    }

    /// Notes that the frame of [`Drive::mode_frame`] has left.
    pub fn mode_sent(&mut self) {
        self.due = false;
        self.astray = None;
    }

    /// A puck has told its MODE. One that is to rest and drives has not heard the word to brake.
    pub fn hear_mode(&mut self, node: Node, value: i32) {
        let mode = MotorMode::from_value(value);
        let right = match self.wanted {
            Wanted::Torque => mode == Some(MotorMode::Torque),
            Wanted::Rest => matches!(mode, None | Some(MotorMode::Idle | MotorMode::Position)),
        };
        if !right {
            self.astray = Some(node);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn torque() -> CanFrame {
        let units = PuckTorque::from_units(100.0_f64).expect("finite");
        packed_torques(Group::HAND, PropertyId::TORQUE, [units; 4])
    }

    fn zero() -> CanFrame {
        packed_torques(Group::HAND, PropertyId::TORQUE, [PuckTorque::ZERO; 4])
    }

    fn mode(to: impl Into<puck::Destination>, mode: MotorMode) -> Option<CanFrame> {
        Some(set(to, PropertyId::MODE, mode.value()))
    }

    #[test]
    fn torque_mode_is_set_before_the_first_torque() {
        let mut drive = Drive::resting(false);
        assert_eq!(drive.mode_frame(), None);
        assert_eq!(drive.torque_frame(Some(torque())), None, "the mode is not set yet");
        assert_eq!(drive.mode_frame(), mode(Group::HAND, MotorMode::Torque));
        assert_eq!(drive.torque_frame(Some(torque())), None, "the SET has not left");
        drive.mode_sent();
        assert_eq!(drive.torque_frame(Some(torque())), Some(torque()));
        assert_eq!(drive.mode_frame(), None);
    }

    #[test]
    fn an_undriven_hand_gets_zeros_and_then_its_mode() {
        let mut drive = Drive::resting(false);
        drive.torque_frame(Some(torque()));
        drive.mode_sent();
        drive.torque_frame(Some(torque()));
        for _ in 0..2 {
            assert_eq!(drive.torque_frame(None), Some(zero()));
            assert_eq!(drive.mode_frame(), None, "a gap of two cycles is no end");
        }
        assert_eq!(drive.torque_frame(None), Some(zero()));
        assert_eq!(drive.mode_frame(), mode(Group::HAND, MotorMode::Idle));
        drive.mode_sent();
        assert_eq!(drive.torque_frame(None), None, "silence from here on");
    }

    #[test]
    fn a_puck_in_another_mode_is_told_again() {
        let mut drive = Drive::resting(false);
        drive.hear_mode(Node::SPREAD, MotorMode::Position.value());
        assert_eq!(drive.mode_frame(), None, "a spread that holds may go on holding");
        drive.hear_mode(Node::SPREAD, MotorMode::Torque.value());
        assert_eq!(drive.mode_frame(), mode(Node::SPREAD, MotorMode::Idle));
        drive.mode_sent();
        drive.torque_frame(Some(torque()));
        drive.mode_sent();
        drive.hear_mode(Node::FINGERS[1], MotorMode::Idle.value());
        assert_eq!(drive.mode_frame(), mode(Node::FINGERS[1], MotorMode::Torque));
    }
}
