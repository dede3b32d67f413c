//! The initialisation of the hand (HI): its digits drive to their open stops and count from there.
//!
//! Fingers first, then the spread; meanwhile the hand hears nothing but GET MODE, for any other request can break it
//! off. If something has, for example the safety module's own broadcast of MODE, the positions show it: they must be
//! zero. Afterwards no digit ends a torque because it stalls (TSTOP 0): a grasp is a stall.

use puck::hand::HandCommand;
use puck::{Counts, Group, MotorMode, Node, PropertyId, get, set};

use super::failure::HandFailure;
use super::found::HandProperties;
use crate::bus::{Answer, Exchange, Outlet};

/// Between two looks at the modes, us.
const POLL_US: u64 = 100_000;
/// Wait for the answers to a look, us.
const LISTEN_US: u64 = 20_000;
/// Longest time for the fingers, and then for the spread, us. Barrett waits 3 s and 2 s.
const LIMIT_US: u64 = 10_000_000;
/// Looks in a row that a digit may leave unanswered.
const SILENT_POLLS: u8 = 5;
/// Largest distance of a digit from zero after its initialisation, counts: 0.025 rad of a finger, 0.18 rad of the
/// spread, whose brake is soft. A puck that was not initialised counts from anywhere.
const ZERO_TOLERANCE: i32 = 2000;
/// Times that a setting is written, or positions are asked for, before it counts as not taken, or they as missing.
const ATTEMPTS: u8 = 3;

/// Which digits are under way.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Digits {
    Fingers,
    Spread,
}

impl Digits {
    /// True if a digit (0 to 3) belongs to them.
    const fn contains(self, digit: usize) -> bool {
        match self {
            Digits::Fingers => digit < Node::FINGERS.len(),
            Digits::Spread => digit == Node::FINGERS.len(),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Step {
    /// SET MODE IDLE: the hand was driven.
    Brake,
    /// CMD to each digit that waits for it.
    Command,
    /// Look at the modes from this time on.
    Poll { next_us: u64 },
    /// Hear the answers until this time.
    Listen { until_us: u64 },
    /// Ask for the positions.
    Measure { attempt: u8 },
    /// Hear them until this time.
    Compare { until_us: u64, attempt: u8 },
    /// Write TSTOP of a digit.
    Write { digit: usize, attempt: u8 },
    /// Read it back.
    Check { digit: usize, attempt: u8 },
}

/// State of the initialisation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// Under way.
    Busy,
    /// The hand counts from its open stops.
    Done,
    /// It did not work, because of this puck.
    Failed(Node, HandFailure),
}

/// An initialisation under way.
#[derive(Clone, Copy, Debug)]
pub struct Initialisation {
    step: Step,
    digits: Digits,
    limit_us: u64,
    /// Digits that wait for their CMD.
    waiting: [bool; 4],
    /// Answers of the digits to the latest look.
    modes: [Option<i32>; 4],
    /// Digits that were seen at work since their first CMD.
    worked: [bool; 4],
    /// Digits that got a second CMD, because they were never seen at work: a SET has no acknowledge.
    repeated: [bool; 4],
    silent_polls: [u8; 4],
    positions: [Option<Counts>; 4],
    exchange: Exchange,
}

impl Initialisation {
    /// Begins; `driven` says whether the drives may be under torque.
    pub fn new(driven: bool, now_us: u64) -> Initialisation {
        Initialisation {
            step: if driven { Step::Brake } else { Step::Command },
            digits: Digits::Fingers,
            limit_us: now_us + LIMIT_US,
            waiting: [true, true, true, false],
            modes: [None; 4],
            worked: [false; 4],
            repeated: [false; 4],
            silent_polls: [0; 4],
            positions: [None; 4],
            exchange: Exchange::default(),
        }
    }

    /// A property reply of a digit has come; whether it was expected.
    pub fn receive(&mut self, digit: usize, node: Node, property: PropertyId, value: i32) -> bool {
        if property != PropertyId::MODE {
            return self.exchange.receive(node, property, value);
        }
        match (self.step, self.modes.get_mut(digit)) {
            (Step::Listen { .. }, Some(place)) => {
                *place = Some(value);
                true
            }
            _ => false,
        }
    }

    /// The position of a digit has come; whether it was expected.
    pub fn receive_position(&mut self, digit: usize, position: Counts) -> bool {
        match (self.step, self.positions.get_mut(digit)) {
            (Step::Compare { .. }, Some(place)) => {
                *place = Some(position);
                true
            }
            _ => false,
        }
    }

    /// A slot in which the hand may be asked: sends at most one frame.
    pub fn advance(&mut self, properties: &HandProperties, outlet: &mut impl Outlet) -> Outcome {
        let now_us = outlet.now_us();
        match self.step {
            Step::Brake => {
                if outlet.send(properties.commander.mode(MotorMode::Idle)) {
                    self.step = Step::Command;
                }
            }
            Step::Command => match Node::HAND.into_iter().zip(&mut self.waiting).find(|(_, waiting)| **waiting) {
                Some((node, waiting)) => {
                    if outlet.send(properties.commander.command(node, HandCommand::Initialise)) {
                        *waiting = false;
                    }
                }
                None => self.step = Step::Poll { next_us: now_us + POLL_US },
            },
            Step::Poll { next_us } if now_us < next_us => {}
            Step::Poll { .. } => {
                self.modes = [None; 4];
                if outlet.send(get(Group::HAND, PropertyId::MODE)) {
                    self.step = Step::Listen { until_us: now_us + LISTEN_US };
                }
            }
            Step::Listen { until_us } if now_us < until_us => {}
            Step::Listen { .. } => return self.judge(properties, now_us),
            Step::Measure { attempt } => {
                self.positions = [None; 4];
                if outlet.send(get(Group::HAND, PropertyId::POSITION)) {
                    self.step = Step::Compare { until_us: now_us + LISTEN_US, attempt };
                }
            }
            Step::Compare { until_us, .. } if now_us < until_us => {}
            Step::Compare { attempt, .. } => {
                let mut digits = Node::HAND.into_iter().zip(self.positions);
                let away =
                    |position: Option<Counts>| position.is_some_and(|Counts(count)| count.abs() > ZERO_TOLERANCE);
                if let Some((node, _)) = digits.clone().find(|(_, position)| away(*position)) {
                    return Outcome::Failed(node, HandFailure::NotZeroed);
                }
                match digits.find(|(_, position)| position.is_none()) {
                    None => self.step = Step::Write { digit: 0, attempt: 0 },
                    Some((node, _)) if attempt + 1 >= ATTEMPTS => return Outcome::Failed(node, HandFailure::NoAnswer),
                    Some(_) => self.step = Step::Measure { attempt: attempt + 1 },
                }
            }
            Step::Write { digit, attempt } => {
                let Some(node) = Node::HAND.get(digit) else {
                    return Outcome::Done;
                };
                if outlet.send(set(*node, properties.stall, 0)) {
                    self.step = Step::Check { digit, attempt };
                }
            }
            Step::Check { digit, attempt } => {
                let Some(node) = Node::HAND.get(digit) else {
                    return Outcome::Done;
                };
                match self.exchange.ask(*node, properties.stall, outlet) {
                    Answer::Pending => {}
                    Answer::Silent => return Outcome::Failed(*node, HandFailure::NoAnswer),
                    Answer::Value(0) => self.step = Step::Write { digit: digit + 1, attempt: 0 },
                    Answer::Value(_) if attempt + 1 >= ATTEMPTS => {
                        return Outcome::Failed(*node, HandFailure::NotTaken);
                    }
                    Answer::Value(_) => self.step = Step::Write { digit, attempt: attempt + 1 },
                }
            }
        }
        Outcome::Busy
    }

    /// All answers to a look are in: are the digits at rest?
    fn judge(&mut self, properties: &HandProperties, now_us: u64) -> Outcome {
        let mut laggard = None;
        for (digit, node) in Node::HAND.into_iter().enumerate().filter(|(digit, _)| self.digits.contains(*digit)) {
            let holds = properties.holds.get(digit).copied().unwrap_or(false);
            let (Some(mode), Some(worked), Some(silent)) =
                (self.modes.get(digit), self.worked.get_mut(digit), self.silent_polls.get_mut(digit))
            else {
                continue;
            };
            let Some(mode) = mode else {
                *silent += 1;
                if *silent >= SILENT_POLLS {
                    return Outcome::Failed(node, HandFailure::Silent);
                }
                laggard = laggard.or(Some(node));
                continue;
            };
            *silent = 0;
            let at_rest = match MotorMode::from_value(*mode) {
                Some(MotorMode::Idle) => true,
                Some(MotorMode::Position) => holds,
                _ => false,
            };
            if !at_rest {
                *worked = true;
                laggard = laggard.or(Some(node));
            }
        }
        if let Some(node) = laggard {
            if now_us >= self.limit_us {
                return Outcome::Failed(node, HandFailure::TimedOut);
            }
            self.step = Step::Poll { next_us: now_us + POLL_US - LISTEN_US };
            return Outcome::Busy;
        }
        let mut again = false;
        for digit in (0..4).filter(|digit| self.digits.contains(*digit)) {
            if let (Some(worked), Some(repeated), Some(waiting)) =
                (self.worked.get(digit), self.repeated.get_mut(digit), self.waiting.get_mut(digit))
                && !worked
                && !*repeated
            {
                (*repeated, *waiting, again) = (true, true, true);
            }
        }
        self.step = if again {
            Step::Command
        } else {
            match self.digits {
                Digits::Fingers => {
                    self.digits = Digits::Spread;
                    self.waiting = [false, false, false, true];
                    self.limit_us = now_us + LIMIT_US;
                    Step::Command
                }
                Digits::Spread => Step::Measure { attempt: 0 },
            }
        };
        Outcome::Busy
    }
}

#[cfg(test)]
mod tests {
    use heapless::Vec;
    use puck::hand::HandCommander;
    use puck::{Action, CanFrame, Property, PropertyTable, Request};

    use super::*;

    /// A bus with room at a time that the test sets.
    struct Bus {
        now_us: u64,
        sent: Vec<Action, 64>,
    }

    impl Outlet for Bus {
        fn now_us(&self) -> u64 {
            self.now_us
        }

        fn send(&mut self, frame: CanFrame) -> bool {
            self.sent.push(Request::decode(&frame).expect("a request").action).is_ok()
        }
    }

    fn properties() -> HandProperties {
        let table = PropertyTable::motor(200).expect("known");
        HandProperties {
            commander: HandCommander::new(&table).expect("a hand's"),
            gauge: table.id(Property::Sg).expect("a hand has it"),
            stall: table.id(Property::Tstop).expect("a hand has it"),
            holds: [false; 4],
        }
    }

    /// The digits have come to rest, and are to tell where they stand.
    fn at_rest() -> (Initialisation, Bus) {
        let rest = Initialisation { step: Step::Measure { attempt: 0 }, ..Initialisation::new(false, 0) };
        (rest, Bus { now_us: 1_000_000, sent: Vec::new() })
    }

    /// One look at the positions, of which those of the digits that are not `lost` come; the outcome when its time is
    /// over, and before that none.
    fn look(rest: &mut Initialisation, bus: &mut Bus, lost: &[usize], count: i32) -> Outcome {
        let before = bus.sent.len();
        assert_eq!(rest.advance(&properties(), bus), Outcome::Busy);
        assert_eq!(bus.sent[before..], [Action::Get { property: PropertyId::POSITION }]);
        for digit in (0..4).filter(|digit| !lost.contains(digit)) {
            assert!(rest.receive_position(digit, Counts(count)));
        }
        bus.now_us += LISTEN_US - 1;
        assert_eq!(rest.advance(&properties(), bus), Outcome::Busy, "answers may still come");
        assert!(matches!(rest.step, Step::Compare { .. }), "{:?}", rest.step);
        bus.now_us += 1;
        rest.advance(&properties(), bus)
    }

    /// The change that makes it fail: a lost answer ends the initialisation, or one that never comes is asked for
    /// without end.
    #[test]
    fn a_position_that_is_lost_is_asked_for_three_times() {
        let (mut rest, mut bus) = at_rest();
        for _ in 0..2 {
            assert_eq!(look(&mut rest, &mut bus, &[1], 5), Outcome::Busy);
        }
        assert_eq!(look(&mut rest, &mut bus, &[], 5), Outcome::Busy);
        assert_eq!(rest.step, Step::Write { digit: 0, attempt: 0 }, "the third look has brought all four");

        let (mut rest, mut bus) = at_rest();
        for _ in 0..2 {
            assert_eq!(look(&mut rest, &mut bus, &[1], 5), Outcome::Busy);
        }
        let silent = Outcome::Failed(Node::HAND[1], HandFailure::NoAnswer);
        assert_eq!(look(&mut rest, &mut bus, &[1], 5), silent);
    }

    /// The change that makes it fail: a digit that is not at its stop is believed, because another one is silent.
    #[test]
    fn a_digit_that_counts_from_elsewhere_is_named_at_once() {
        for (count, is_zero) in [(2000, true), (-2000, true), (2001, false), (-2001, false)] {
            let (mut rest, mut bus) = at_rest();
            let expected = if is_zero { Outcome::Busy } else { Outcome::Failed(Node::HAND[0], HandFailure::NotZeroed) };
            assert_eq!(look(&mut rest, &mut bus, &[3], count), expected, "{count}");
        }
    }

    /// The change that makes it fail: a setting that is not taken is written once, or without end.
    #[test]
    fn a_setting_that_is_not_taken_is_written_three_times() {
        for (taken_at, expected) in [(1, Outcome::Done), (2, Outcome::Done), (3, Outcome::Done), (4, Outcome::Busy)] {
            let (mut rest, mut bus) = at_rest();
            rest.step = Step::Write { digit: 0, attempt: 0 };
            let (stall, mut outcome) = (properties().stall, Outcome::Busy);
            let writes = |bus: &Bus| bus.sent.iter().filter(|action| matches!(action, Action::Set { .. })).count();
            for _ in 0..40 {
                outcome = rest.advance(&properties(), &mut bus);
                bus.now_us += 1_000;
                if outcome != Outcome::Busy {
                    break;
                }
                if let Step::Check { digit, .. } = rest.step {
                    // The second puck keeps its value until it has been told so many times.
                    let value = if digit == 1 && writes(&bus) <= taken_at { 50 } else { 0 };
                    rest.receive(digit, Node::HAND[digit], stall, value);
                }
            }
            if expected == Outcome::Done {
                assert_eq!((outcome, writes(&bus)), (expected, 3 + taken_at));
            } else {
                let kept = Outcome::Failed(Node::HAND[1], HandFailure::NotTaken);
                assert_eq!((outcome, writes(&bus)), (kept, 4), "the first puck once, the second three times");
            }
        }
    }

    /// The change that makes it fail: one lost answer ends the initialisation, or a silent digit is looked at until the
    /// time is over.
    #[test]
    fn a_digit_may_leave_four_looks_in_a_row_unanswered_and_not_five() {
        let mut rest = Initialisation::new(false, 0);
        let mut bus = Bus { now_us: 0, sent: Vec::new() };
        let mut look = |answers: bool| {
            rest.step = Step::Listen { until_us: bus.now_us };
            for (digit, node) in Node::HAND.into_iter().enumerate().take(3).filter(|(digit, _)| *digit != 1 || answers)
            {
                assert!(rest.receive(digit, node, PropertyId::MODE, MotorMode::Velocity.value()));
            }
            let outcome = rest.advance(&properties(), &mut bus);
            rest.modes = [None; 4];
            outcome
        };
        for answers in [false, false, false, false, true, false, false, false, false] {
            assert_eq!(look(answers), Outcome::Busy);
        }
        assert_eq!(look(false), Outcome::Failed(Node::HAND[1], HandFailure::Silent));
    }
}
