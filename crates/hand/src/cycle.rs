//! `Cycle`: one control period of the hand, and the ladder of its states.
//!
//! ```text
//! Idle/Hold --Move--> Approach --> Hold        torque only in Approach, Run, Coast and a Hold that follows them
//!     |  ------Run--> Run <-> Coast (1..5 cycles of lost replies)
//!     |                |--> Hold (arrived: what is gripped stays gripped)
//!     |                |--> SoftStop   torque off, the worm drives hold: a person's stop, a silent host,
//!     |                |               6 cycles of lost replies, a motor that is too hot
//!     |                '--> Fault      a puck under torque tells that it was reset
//!     <---ClearFault---- SoftStop, Fault
//! ```
//! It goes down by itself and up by a person's command, except from Coast to Run. No state needs torque to be safe: the
//! worms cannot be driven back.

use control::plan::hand::LONGEST_MOVE;
use control::{Fault, HandSample, State, flags};
use device::Refused;
use dmp::Coupling;
use link::Refusal;
use puck::CanFrame;

use crate::command::{Command, RunOptions};
use crate::controller::{HandController, HandReference};
use crate::estimate::{HandEstimator, HandState};
use crate::limit::{HandLimiter, Scales};
use crate::motion::HandMotion;
use crate::number::{Number, ONE, ZERO, at_least, at_most, constant, magnitude};
use crate::primitive::{FingerPrimitive, PERIOD, Rollout};
use crate::record::Record;
use crate::{DIGITS, FINGERS, LOST_CYCLES, RANGE_NUMBERS};

/// Cycles over which feedback fades in and out: 100 ms.
const FADE_STEP: Number = constant(1.0 / 30.0);

/// Largest distance of a digit from the start of a primitive that is to be run (rad).
const START_DISTANCE: Number = constant(0.15);

/// Allowed speeds, and durations of a move (s).
const SPEED_RANGE: [Number; 2] = crate::number::constants([0.1, 2.0]);
const DURATION_RANGE: [Number; 2] = crate::number::constants([0.0, LONGEST_MOVE]);

/// Present task of the hand.
#[derive(Clone, Debug)]
#[expect(clippy::large_enum_variant, reason = "there is one, and no heap to put a run on")]
enum Aim {
    /// Nothing: the worms hold.
    None,
    /// A move.
    Move(HandMotion),
    /// A run.
    Run(Rollout, RunOptions),
    /// A posture, and the gauge torques to hold it with (N m).
    Keep([Number; DIGITS], Option<[Number; FINGERS]>),
}

/// Results of one cycle.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    /// The torque frame; `None` where the hand is not driven.
    pub frame: Option<CanFrame>,
    /// Measurements and decisions.
    pub record: Record,
    /// The state entered in this cycle, if it is another one.
    pub entered: Option<(State, Fault)>,
    /// A move or a run has ended.
    pub arrived: bool,
    /// Answer to the command of this cycle.
    pub answer: Option<Result<(), Refused>>,
}

/// The control cycle.
#[derive(Debug)]
pub struct Cycle {
    count: u32,
    state: State,
    fault: Fault,
    /// State and fault after the last cycle: what the device finds between two cycles is told with the next.
    told: (State, Fault),
    estimator: HandEstimator,
    controller: HandController,
    limiter: HandLimiter,
    scales: Scales,
    aim: Aim,
    fade: Number,
    saturated: bool,
    driven: bool,
    /// A motor is too hot to be driven.
    hot: bool,
    primitive: FingerPrimitive,
}

impl Cycle {
    /// At rest, with nothing known.
    pub fn new() -> Self {
        Cycle {
            count: 0,
            state: State::Idle,
            fault: Fault::None,
            told: (State::Idle, Fault::None),
            estimator: HandEstimator::new(),
            controller: HandController::new(),
            limiter: HandLimiter::new(),
            scales: Scales::new([0; DIGITS]),
            aim: Aim::None,
            fade: ZERO,
            saturated: false,
            driven: false,
            hot: false,
            primitive: FingerPrimitive::EMPTY,
        }
    }

    /// Takes the torque scales of the hand that was found (IPNM of F1, F2, F3, spread).
    pub fn calibrate(&mut self, units_per_newton_metre: [i32; DIGITS]) {
        self.scales = Scales::new(units_per_newton_metre);
    }

    /// Takes another primitive; false, and nothing happens, while one runs.
    pub fn load(&mut self, primitive: &FingerPrimitive) -> bool {
        let running = matches!(self.aim, Aim::Run(..));
        if !running {
            self.primitive.copy_from(primitive);
        }
        !running
    }

    /// Present state.
    pub fn state(&self) -> State {
        self.state
    }

    /// Latched fault.
    pub fn fault(&self) -> Fault {
        self.fault
    }

    /// The device found that the hand cannot be driven: a puck was reset or fell silent.
    pub fn hand_failed(&mut self) {
        if self.driven || self.is_active() {
            self.stop(State::Fault, Fault::BusFault);
        }
    }

    /// Takes note of a motor that is too hot to be driven, or that none is any more.
    pub fn heat(&mut self, hot: bool) {
        self.hot = hot;
    }

    /// The torques of the last cycle did not leave. The next step counts from those that did.
    pub fn not_sent(&mut self) {
        self.limiter.not_sent();
    }

    fn is_active(&self) -> bool {
        matches!(self.state, State::Approach | State::Run | State::Coast)
    }

    /// One control period: takes what the hand told (`None`: it is not ready) and a command.
    pub fn step(&mut self, sample: Option<&HandSample>, command: Option<Command>) -> Output {
        self.count = self.count.wrapping_add(1);
        let hand = self.estimator.update(sample);
        if hand.is_none() && !matches!(self.aim, Aim::None) {
            self.hand_failed();
            self.aim = Aim::None;
        }
        if self.hot && !matches!(self.aim, Aim::None) {
            self.stop(State::SoftStop, Fault::MotorHot);
        }
        let answer = command.map(|command| self.command(command, hand.as_ref()));
        let mut record = Record { cycle: self.count, ..Record::EMPTY };
        let mut arrived = false;
        let frame = match hand {
            Some(hand) => {
                self.note(&hand, &mut record);
                self.survive(&hand);
                self.drive(&hand, &mut record, &mut arrived)
            }
            None => None,
        };
        if frame.is_none() && self.driven {
            self.driven = false;
            self.controller.reset();
            self.limiter.reset();
            self.saturated = false;
        }
        record.state = self.state;
        record.fault = self.fault;
        let now = (self.state, self.fault);
        let entered = (now != core::mem::replace(&mut self.told, now)).then_some(now);
        Output { frame, record, entered, arrived, answer }
    }

    /// Puts the measurements into the record.
    fn note(&self, hand: &HandState, record: &mut Record) {
        record.q = hand.q;
        record.q_d = hand.q;
        record.gauges = hand.gauges;
        record.lost = hand.age.iter().filter(|age| **age > 0).count().try_into().unwrap_or(u8::MAX);
        record.flags = flags::HAND_READY;
        if self.estimator.is_tared() {
            record.flags |= flags::TARED;
        }
        if hand.gauge_age > 0 {
            record.flags |= flags::WRENCH_STALE;
        }
        if hand.oldest() > LOST_CYCLES {
            record.flags |= flags::HAND_LOST;
        }
    }

    /// Lost replies: bridged, then no more torque.
    fn survive(&mut self, hand: &HandState) {
        match (hand.oldest(), self.state) {
            (0, State::Coast) => self.state = State::Run,
            (1..=LOST_CYCLES, State::Run) => self.state = State::Coast,
            (age, _) if age > LOST_CYCLES && !matches!(self.aim, Aim::None) => {
                self.stop(State::SoftStop, Fault::RepliesLost);
            }
            _ => {}
        }
    }

    /// The law of the present aim; the torque frame, if there is one.
    fn drive(&mut self, hand: &HandState, record: &mut Record, arrived: &mut bool) -> Option<CanFrame> {
        let feels = hand.feels();
        self.fade = if feels { at_most(self.fade + FADE_STEP, ONE) } else { at_least(self.fade - FADE_STEP, ZERO) };
        let (reference, expected) = match &mut self.aim {
            Aim::None => return None,
            Aim::Keep(q, expected) => (HandReference::at_rest(*q), *expected),
            Aim::Move(motion) => {
                let reference = motion.step();
                if motion.is_finished() {
                    *arrived = true;
                    self.aim = Aim::Keep(motion.goal(), None);
                    self.state = State::Hold;
                }
                (reference, None)
            }
            Aim::Run(rollout, options) => {
                let expected = self.primitive.expected(rollout).filter(|_| options.force_control);
                let mut coupling = Coupling::NONE;
                if options.feedback {
                    let share = self.primitive.trust(rollout) * self.fade;
                    coupling = self.primitive.coupling(rollout, &hand.gauges, share);
                    record.flags |= flags::FEEDBACK | if share < ONE { flags::FEEDBACK_FADED } else { 0 };
                }
                let Ok(plan) = rollout.step(self.primitive.movement(), PERIOD, &coupling) else {
                    // Of another primitive: none is loaded while one runs, so nobody has asked for this.
                    self.stop(State::SoftStop, Fault::None);
                    return None;
                };
                record.phase = plan.phase;
                let reference = HandReference { q: plan.points.x, dq: plan.points.v }.kept_in_range();
                if plan.progress >= ONE && matches!(self.state, State::Run) {
                    *arrived = true;
                    self.aim = Aim::Keep(reference.q, expected);
                    self.state = State::Hold;
                    record.flags |= flags::ARRIVED;
                }
                (reference, expected)
            }
        };
        record.q_d = reference.q;
        if expected.is_some() {
            record.flags |= flags::FORCE_CONTROL;
        }
        if hand.oldest() > 0 {
            record.flags |= flags::COASTING;
        }
        let wanted = self.controller.torque(hand, &reference, expected.as_ref(), self.saturated);
        let (limited, saturated) = self.limiter.limit(&wanted);
        self.saturated = saturated;
        if saturated {
            record.flags |= flags::JOINT_LIMITED;
        }
        if *limited.torques() != wanted {
            record.flags |= flags::RATE_LIMITED;
        }
        self.driven = true;
        record.torque = *limited.torques();
        Some(limited.frame(&self.scales))
    }

    /// Torque ends in this cycle.
    fn stop(&mut self, state: State, fault: Fault) {
        // Down the ladder only: a latched fault stays.
        if self.state != State::Fault {
            self.state = state;
            self.fault = fault;
        }
        self.aim = Aim::None;
    }

    fn command(&mut self, command: Command, hand: Option<&HandState>) -> Result<(), Refused> {
        let state: Refused = (Refusal::State, [self.state.code().into(), 0]);
        match command {
            // The core has let this one through; here it only ends what was held.
            Command::InitialiseHand => match self.state {
                State::Idle | State::Hold | State::SoftStop => {
                    self.aim = Aim::None;
                    Ok(())
                }
                State::Fault => Err((Refusal::Faulted, [self.fault.code().into(), 0])),
                _ => Err(state),
            },
            Command::Stop => {
                if self.is_active() || self.state == State::Hold {
                    self.stop(State::SoftStop, Fault::None);
                }
                Ok(())
            }
            Command::Release => {
                self.aim = Aim::None;
                if !matches!(self.state, State::SoftStop | State::Fault) {
                    self.state = State::Idle;
                }
                Ok(())
            }
            Command::ClearFault => self.clear_fault(hand),
            _ if matches!(self.state, State::Fault | State::SoftStop) && self.fault != Fault::None => {
                Err((Refusal::Faulted, [self.fault.code().into(), 0]))
            }
            Command::Tare => match self.state {
                State::Run | State::Coast => Err(state),
                _ if self.estimator.tare() => Ok(()),
                _ if hand.is_some() => Err((Refusal::WrenchMissing, [0, 0])),
                _ => Err((Refusal::HandNotReady, [0, 0])),
            },
            Command::Hold => {
                if self.is_active() {
                    match (&self.aim, hand) {
                        (Aim::Move(motion), _) => self.aim = Aim::Keep(motion.now().q, None),
                        (Aim::Run(..), Some(hand)) => self.aim = Aim::Keep(hand.q, None),
                        _ => {}
                    }
                }
                self.state = State::Hold;
                Ok(())
            }
            Command::SetSpeed { factor } => {
                if !in_range(factor, SPEED_RANGE) {
                    return Err((Refusal::BadValue, [0, 0]));
                }
                match &mut self.aim {
                    Aim::Run(rollout, _) => {
                        rollout.set_speed(self.primitive.movement(), factor).map_err(|_| (Refusal::BadValue, [0, 0]))
                    }
                    _ => Err(state),
                }
            }
            Command::Move { q, duration } => self.move_to(&q, duration, hand),
            Command::Run(options) => {
                let hand = self.drivable(hand)?;
                if self.is_active() {
                    return Err(state);
                }
                self.run(options, hand)
            }
        }
    }

    fn move_to(&mut self, q: &[Number; DIGITS], duration: Number, hand: Option<&HandState>) -> Result<(), Refused> {
        let hand = self.drivable(hand)?;
        if matches!(self.state, State::Run | State::Coast) {
            return Err((Refusal::State, [self.state.code().into(), 0]));
        }
        if let Some(digit) = q.iter().zip(RANGE_NUMBERS).position(|(q, range)| !in_range(*q, range)) {
            return Err((Refusal::HandOutOfRange, [u32::try_from(digit).unwrap_or(0), 0]));
        }
        if !in_range(duration, DURATION_RANGE) {
            return Err((Refusal::BadValue, [4, 0]));
        }
        let from = self.held(hand);
        if q.iter().zip(&hand.q).skip(1).any(|(goal, now)| goal > now) {
            // Fingers that are to close may hold something from now on: the last moment for a first zero.
            self.estimator.tare_first();
        }
        self.begin(Aim::Move(HandMotion::new(&from, q, duration)), State::Approach);
        Ok(())
    }

    fn clear_fault(&mut self, hand: Option<&HandState>) -> Result<(), Refused> {
        if matches!(self.state, State::Fault | State::SoftStop) {
            // Without a hand nothing can be driven: clearing makes way for its initialisation.
            if self.hot || hand.is_some_and(|hand| hand.oldest() > 0) {
                return Err((Refusal::CauseRemains, [0, 0]));
            }
            self.state = State::Idle;
            self.fault = Fault::None;
        }
        Ok(())
    }

    fn run(&mut self, options: RunOptions, hand: &HandState) -> Result<(), Refused> {
        if !self.primitive.is_whole() {
            return Err((Refusal::NoSuchPrimitive, [0, 0]));
        }
        if (options.feedback || options.force_control) && !self.primitive.has_expectation() {
            return Err((Refusal::NoExpectation, [0, 0]));
        }
        let from = self.held(hand);
        let start = &self.primitive.movement().start().points;
        let far = from.iter().zip(start).position(|(at, to)| magnitude(*at - *to) > START_DISTANCE);
        if let Some(digit) = far {
            return Err((Refusal::HandFarFromStart, [u32::try_from(digit).unwrap_or(0), 0]));
        }
        if !in_range(options.speed, SPEED_RANGE) {
            return Err((Refusal::BadValue, [0, 0]));
        }
        let rollout = self.primitive.run(&from, options.speed).map_err(|_| (Refusal::BadValue, [0, 0]))?;
        self.estimator.tare_first();
        self.begin(Aim::Run(rollout, options), State::Run);
        Ok(())
    }

    /// The state of a hand that may be driven: every digit answered in this cycle, and no motor is too hot.
    fn drivable<'a>(&self, hand: Option<&'a HandState>) -> Result<&'a HandState, Refused> {
        match hand {
            None => Err((Refusal::HandNotReady, [0, 0])),
            Some(hand) if hand.oldest() > 0 => Err((Refusal::PositionsMissing, [0, 0])),
            Some(_) if self.hot => Err((Refusal::CauseRemains, [0, 0])),
            Some(hand) => Ok(hand),
        }
    }

    /// Where the hand is held, or is (rad).
    fn held(&self, hand: &HandState) -> [Number; DIGITS] {
        match &self.aim {
            Aim::Keep(q, _) => *q,
            _ => hand.q,
        }
    }

    fn begin(&mut self, aim: Aim, state: State) {
        self.aim = aim;
        self.state = state;
        self.fault = Fault::None;
        self.controller.reset();
    }
}

impl Default for Cycle {
    fn default() -> Self {
        Cycle::new()
    }
}

fn in_range(value: Number, [low, high]: [Number; 2]) -> bool {
    value >= low && value <= high
}
