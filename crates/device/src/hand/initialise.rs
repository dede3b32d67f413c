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
