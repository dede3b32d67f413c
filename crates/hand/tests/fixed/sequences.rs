//! Every order of commands and faults up to four long, through the control cycle of the hand.

use control::{Fault, HandSample, State};
use dmp::Scalar;
use hand::Command;
use hand::command::RunOptions;
use hand::cycle::{Cycle, Output};
use hand::number::{Number, constant};
use puck::Counts;

use crate::common::Movement;

/// Length of the sequences.
const LENGTH: u32 = 4;

/// Cycles between two steps of a sequence: torque has built up by then, and no motion has ended.
const BETWEEN: usize = 12;

/// A step of a sequence.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Step {
    Order(Command),
    /// Replies of a finger are lost for so many cycles.
    Lose(usize),
    /// The device has given the hand up.
    Fail,
    /// The hand is not ready for some cycles.
    Gone,
    /// A motor is too hot, or is so no more.
    Heat,
}

fn steps() -> Vec<Step> {
    let options = |force: bool| RunOptions { speed: constant(1.0), feedback: force, force_control: force };
    let orders = [
        Command::InitialiseHand,
        Command::Hold,
        Command::Move { q: [0.3, 0.5, 0.5, 0.5].map(constant), duration: constant(1.0) },
        Command::Run(options(true)),
        Command::SetSpeed { factor: constant(0.5) },
        Command::Stop,
        Command::Release,
        Command::ClearFault,
        Command::Tare,
    ];
    let faults = [Step::Lose(3), Step::Lose(8), Step::Fail, Step::Gone, Step::Heat];
    orders.map(Step::Order).into_iter().chain(faults).collect()
}

fn sample(lost: bool) -> HandSample {
    let one = Some(Counts(0));
    let first = if lost { None } else { one };
    HandSample { primary: [first, one, one, one], secondary: [first, one, one], gauges: [Some(2000); 3] }
}

/// A hand, and what it did last.
struct Watched {
    cycle: Cycle,
    last: [Number; 4],
    hot: bool,
}

impl Watched {
    fn new(primitive: &hand::FingerPrimitive) -> Watched {
        let mut cycle = Cycle::new();
        cycle.calibrate([20_000; 4]);
        assert!(cycle.load(primitive));
        let mut hand = Watched { cycle, last: [Number::ZERO; 4], hot: false };
        for _ in 0..3 {
            hand.step(Some(&sample(false)), None, &[]);
        }
        hand
    }

    /// One cycle, in which what is always so is looked at.
    fn step(&mut self, sample: Option<&HandSample>, command: Option<Command>, told: &[Step]) -> Output {
        let output = self.cycle.step(sample, command);
        let (state, fault) = (self.cycle.state(), self.cycle.fault());
        assert_eq!(output.answer.is_some(), command.is_some(), "one answer: {told:?}");
        let torque = output.record.torque;
        let driven = output.frame.is_some();
        assert!(driven || torque == [Number::ZERO; 4], "{told:?}");
        if matches!(state, State::Idle | State::SoftStop | State::Fault) {
            assert!(!driven, "torque in {state:?}: {told:?}");
        }
        if matches!(state, State::Approach | State::Run | State::Coast) {
            assert!(driven && sample.is_some(), "{state:?} without torque: {told:?}");
        }
        assert!(!driven || !self.hot, "a hot motor is driven: {told:?}");
        assert_eq!(fault != Fault::None, matches!(state, State::SoftStop | State::Fault) && fault != Fault::None);
        for (digit, (now, last)) in torque.iter().zip(self.last).enumerate() {
            let limit = if digit == 0 { 0.6 } else { 1.2 };
            let rise = now.to_f64().abs() - last.to_f64().abs();
            assert!(now.to_f64().abs() <= limit + 1e-9, "{told:?}");
            assert!(rise <= limit / 15.0 + 1e-9, "torque rises by {rise} N m: {told:?}");
        }
        self.last = torque;
        output
    }

    /// Does what a sequence orders; then some cycles.
    fn carry_out(&mut self, step: Step, told: &[Step]) {
        let (before, fault) = (self.cycle.state(), self.cycle.fault());
        let (mut lost, mut gone) = (0, 0);
        match step {
            Step::Order(command) => {
                let output = self.step(Some(&sample(false)), Some(command), told);
                let accepted = output.answer.is_some_and(|answer| answer.is_ok());
                let after = self.cycle.state();
                match command {
                    Command::Stop | Command::Release => {
                        assert!(accepted && output.frame.is_none(), "{told:?}");
                        assert!(before != State::Fault || after == State::Fault, "a stop clears nothing: {told:?}");
                    }
                    Command::Move { .. } | Command::Run(_) | Command::Hold if fault != Fault::None => {
                        assert!(!accepted, "nothing goes up from a fault: {told:?}");
                    }
                    Command::InitialiseHand if accepted => assert!(output.frame.is_none(), "{told:?}"),
                    Command::ClearFault if accepted => assert_eq!(self.cycle.fault(), Fault::None, "{told:?}"),
                    _ => {}
                }
            }
            Step::Lose(cycles) => lost = cycles,
            Step::Fail => self.cycle.hand_failed(),
            Step::Gone => gone = 3,
            Step::Heat => {
                self.hot = !self.hot;
                self.cycle.heat(self.hot);
            }
        }
        for cycle in 0..BETWEEN {
            let told_now = (cycle >= gone).then(|| sample(cycle < lost));
            self.step(told_now.as_ref(), None, told);
        }
    }

    /// The way back that people are told: cool, clear, move.
    fn comes_back(&mut self, told: &[Step]) {
        if self.hot {
            self.carry_out(Step::Heat, told);
        }
        self.carry_out(Step::Order(Command::Stop), told);
        self.carry_out(Step::Order(Command::ClearFault), told);
        assert_eq!((self.cycle.state(), self.cycle.fault()), (State::Idle, Fault::None), "{told:?}");
        self.carry_out(Step::Order(steps_move()), told);
        assert_eq!(self.cycle.state(), State::Approach, "{told:?}");
        assert!(self.last[1].to_f64() > 0.0, "{told:?}");
    }
}

fn steps_move() -> Command {
    Command::Move { q: [0.3, 0.5, 0.5, 0.5].map(constant), duration: constant(1.0) }
}

/// The change that makes it fail: a release lifts a fault, or torque begins at what it was before a stop.
#[test]
fn every_order_of_commands_and_faults_keeps_the_torque_within_its_limits_and_ends_in_a_hand_that_moves_again() {
    let movement = Movement { start: [0.0; 4], ..Movement::closing(10, 2.0, 0.1) }.feeling();
    let primitive = movement.fixed();
    let steps = steps();
    let count = steps.len();
    for number in 0..count.pow(LENGTH) {
        let sequence: Vec<Step> = (0..LENGTH).map(|place| steps[number / count.pow(place) % count]).collect();
        let mut hand = Watched::new(&primitive);
        for step in &sequence {
            hand.carry_out(*step, &sequence);
        }
        hand.comes_back(&sequence);
    }
}
