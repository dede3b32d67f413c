//! `Brakes`: whom the device asks to brake when torque has ended, and how often.

use control::time::periods;
use puck::{CanFrame, Group, MotorMode, Node, PropertyId, SafetyMode, set};

/// Time between two requests to the safety module to go IDLE: 20 ms, in slow slots; an arm whose first request was lost
/// falls as long.
const REQUEST_SLOTS: u16 = periods(0.02);
/// Time for which puck 1 is asked in every second cycle if it brakes, after the safety module has said so: 0.5 s, in
/// slow slots.
const LOOK_SLOTS: u16 = periods(0.5);
/// Cycles with a word to the pucks in every slot after torque has ended: 100 ms. No longer, because a bus without
/// room has to carry positions again.
const URGENT_CYCLES: u16 = periods(0.1);
/// Of so many of these cycles one has zero torques. A puck that is told zero and misses the words lets the arm fall;
/// one that brakes needs no zero.
const ZEROS_EVERY: u16 = 4;

/// Answers in a row of a braking puck under an ACTIVE safety module that mean IDLE: one may be older than the
/// activation.
const BRAKING_ANSWERS: u8 = 2;

/// The requests to brake.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Brakes {
    wanted: bool,
    request_in: u16,
    look_slots: u16,
    /// Puck 1 did not brake when it was asked; nothing has been heard of the safety module since.
    pulling: bool,
    /// The pucks did not brake, and afterwards the safety module said that it is IDLE: its frame to them was lost.
    owed: bool,
    /// Puck 1 has told that it brakes since torque ended.
    braked: bool,
    /// A puck (0..=6), and how many times in a row it told of its brakes under an ACTIVE safety module.
    suspect: (usize, u8),
    /// Urgent cycles left.
    urgent: u16,
    /// Torque flowed in the last cycle of an open request.
    flowed: bool,
}

impl Brakes {
    /// The control cycle wants the safety module to go to IDLE, or no longer does.
    pub(super) fn want(&mut self, wanted: bool) {
        if wanted && !self.wanted {
            self.braked = false;
            self.urgent = URGENT_CYCLES;
            self.look_slots = LOOK_SLOTS;
        }
        self.wanted = wanted;
    }

    /// True while the control cycle wants the safety module to go to IDLE, and while a request for that which nobody
    /// wants any more may still be answered.
    pub(super) fn are_asked_for(&self) -> bool {
        self.wanted || self.request_in > 0
    }

    /// A puck (0..=6) has told if it brakes; `active`: while the safety module is ACTIVE.
    pub(super) fn hear_puck(&mut self, puck: usize, braking: bool, active: bool) {
        if puck == 0 {
            self.pulling = !braking;
            self.braked |= braking;
        }
        let (suspect, answers) = self.suspect;
        match (braking && active, puck == suspect) {
            (true, true) => self.suspect.1 = answers.saturating_add(1),
            (true, false) if answers == 0 => self.suspect = (puck, 1),
            (false, true) => self.suspect.1 = 0,
            _ => {}
        }
    }

    /// The puck (0..=6) that has told of its brakes under an ACTIVE safety module, if one has.
    pub(super) fn suspect(&self) -> Option<usize> {
        let (puck, answers) = self.suspect;
        (answers > 0).then_some(puck)
    }

    /// The safety module has told its mode.
    pub(super) fn hear_safety(&mut self, mode: SafetyMode) {
        if mode != SafetyMode::Active {
            self.suspect.1 = 0;
        }
        self.owed = core::mem::take(&mut self.pulling) && mode == SafetyMode::Idle;
    }

    /// True if a puck brakes although the safety module says that it is ACTIVE: its word to them was lost.
    pub(super) fn are_on_under_active(&self) -> bool {
        self.suspect.1 >= BRAKING_ANSWERS
    }

    /// One slow slot: what has to leave in it. `mode` is that of the safety module, `writable` says that it takes one.
    pub(super) fn frame(&mut self, mode: Option<SafetyMode>, writable: bool) -> Option<CanFrame> {
        self.request_in = self.request_in.saturating_sub(1);
        self.look_slots = match mode {
            _ if self.wanted => LOOK_SLOTS,
            // A person has activated the arm again.
            Some(SafetyMode::Active) => 0,
            _ => self.look_slots.saturating_sub(1),
        };
        // Asked for even of a module that has told IDLE: the word may be wrong, and then nothing brakes.
        // Of one that is ACTIVE while a puck brakes too: it has to go down to them before a person can raise both.
        if (self.wanted || self.are_on_under_active())
            && writable
            && self.request_in == 0
            && mode != Some(SafetyMode::EStop)
        {
            self.request_in = REQUEST_SLOTS;
            return Some(set(Node::SAFETY_MODULE, PropertyId::MODE, SafetyMode::Idle.value()));
        }
        // The module's word to the pucks may be lost, and with it the brakes; so may this one. That the module is IDLE
        // does not say that a puck brakes: the words go on until one has told so.
        let due = core::mem::take(&mut self.owed) || self.is_open();
        due.then(brake_frame)
    }

    /// A control slot of an open request; `flows`: torque still flows, or does again. True if its torques are to leave.
    pub(super) fn begin_cycle(&mut self, flows: bool) -> bool {
        let has_ended = core::mem::replace(&mut self.flowed, flows) && !flows;
        if has_ended {
            self.urgent = URGENT_CYCLES;
        }
        if flows && !self.wanted {
            // A person has commanded the arm again.
            self.look_slots = 0;
        }
        let Some(left) = self.urgent.checked_sub(1).filter(|_| self.is_open()) else { return true };
        self.urgent = left;
        // A torque that is held back makes the next step larger than the limiter grants.
        flows || (URGENT_CYCLES - 1 - left).is_multiple_of(ZEROS_EVERY)
    }

    /// The word to the pucks for a request or a control slot.
    pub(super) fn urgent_frame(&self) -> Option<CanFrame> {
        (self.urgent > 0 && self.is_open()).then(brake_frame)
    }

    /// True from the end of the torque on until puck 1 has told that it brakes, at most for the time of the looks.
    pub(super) fn is_open(&self) -> bool {
        self.look_slots > 0 && !self.braked
    }

    /// True if a question may leave in the same slot: beside the words to the pucks, not beside the request, because
    /// the safety module has one SET to work on then.
    pub(super) fn leaves_room(&self) -> bool {
        self.request_in != REQUEST_SLOTS
    }

    /// The frame could not leave.
    pub(super) fn ask_again(&mut self) {
        self.request_in = 0;
    }

    /// True while puck 1 is to be asked more often if it brakes: not before the safety module is IDLE, because pucks
    /// that brake under an ACTIVE one would hide that.
    pub(super) fn look(&self, mode: Option<SafetyMode>) -> bool {
        self.look_slots > 0 && (!self.wanted || mode == Some(SafetyMode::Idle))
    }
}

/// The word to the pucks of the arm that they shall brake.
fn brake_frame() -> CanFrame {
    set(Group::ARM, PropertyId::MODE, MotorMode::Idle.value())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Storm 119029: the brakes are asked for while torque damps an arm of which one joint is unseen, and a step of
    /// that torque was twice what the limiter grants. The changes that make it fail: torque that flows leaves as rarely
    /// as zero torques; urgent cycles that are used up while it flows, or never end.
    #[test]
    fn g7_torque_that_still_flows_leaves_in_every_cycle_and_its_end_is_urgent() {
        let mut brakes = Brakes::default();
        brakes.want(true);
        assert!((0..URGENT_CYCLES + 7).all(|_| brakes.begin_cycle(true)));
        let mut words = 0;
        let zeros = (0..URGENT_CYCLES).filter(|_| {
            let leaves = brakes.begin_cycle(false);
            words += u16::from(brakes.urgent_frame().is_some());
            leaves
        });
        assert_eq!(zeros.count(), usize::from(URGENT_CYCLES.div_ceil(ZEROS_EVERY)));
        assert_eq!(words, URGENT_CYCLES - 1);
        assert!(brakes.begin_cycle(false) && brakes.urgent_frame().is_none() && brakes.is_open());
    }

    /// The change that makes it fail: a request that stays open while a person commands the arm again.
    #[test]
    fn g7_an_arm_that_is_commanded_again_is_not_told_to_brake() {
        let mut brakes = Brakes::default();
        brakes.want(true);
        assert!(brakes.begin_cycle(false) && brakes.urgent_frame().is_some());
        brakes.want(false);
        assert!(brakes.begin_cycle(true) && brakes.urgent_frame().is_none() && !brakes.is_open());
    }

    /// One answer may be older than the activation: two in a row count, of the puck that told first. The changes that
    /// make it fail: a puck that pulls again stays suspect; another puck that brakes takes the place of the first.
    #[test]
    fn two_answers_in_a_row_of_one_puck_say_that_it_brakes_under_an_active_safety_module() {
        let mut brakes = Brakes::default();
        for braking in [true, false, true] {
            brakes.hear_puck(3, braking, true);
            assert!(!brakes.are_on_under_active());
        }
        brakes.hear_puck(5, true, true);
        assert_eq!(brakes.suspect(), Some(3));
        assert!(!brakes.are_on_under_active());
        brakes.hear_puck(3, true, true);
        assert!(brakes.are_on_under_active());
    }

    /// The changes that make it fail: the looks end while the brakes are wanted, or go on after a person has activated;
    /// puck 1 is not asked more often as soon as the safety module is IDLE.
    #[test]
    fn the_words_to_brake_go_on_while_the_brakes_are_wanted_and_end_when_a_person_activates() {
        let mut brakes = Brakes::default();
        brakes.want(true);
        for _ in 0..=LOOK_SLOTS {
            assert_eq!(brakes.frame(Some(SafetyMode::Active), false), Some(brake_frame()));
        }
        assert!(!brakes.look(Some(SafetyMode::Active)) && brakes.look(Some(SafetyMode::Idle)));
        brakes.want(false);
        assert!(brakes.look(None));
        assert_eq!(brakes.frame(Some(SafetyMode::Idle), false), Some(brake_frame()));
        assert_eq!(brakes.frame(Some(SafetyMode::Active), false), None);
        assert!(!brakes.is_open());
    }

    /// The changes that make it fail: a question beside the request; a request that could not leave waits for 20 ms.
    #[test]
    fn a_request_to_the_safety_module_leaves_alone_and_again_at_once_if_it_could_not() {
        let mut brakes = Brakes::default();
        brakes.want(true);
        let request = Some(set(Node::SAFETY_MODULE, PropertyId::MODE, SafetyMode::Idle.value()));
        for _ in 0..2 {
            assert_eq!(brakes.frame(Some(SafetyMode::Active), true), request);
            assert!(!brakes.leaves_room());
            brakes.ask_again();
        }
        assert_eq!(brakes.frame(Some(SafetyMode::Active), true), request);
        assert_eq!(brakes.frame(Some(SafetyMode::Active), true), Some(brake_frame()));
        assert!(brakes.leaves_room());
    }
}
