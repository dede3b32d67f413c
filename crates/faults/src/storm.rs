//! Storms: one to three faults and orders at random moments of a random state, and the way back.

use std::f64::consts::PI;

use lab::procedure::Mode;
use lab::transport::SimulatorKind;
use serde::Serialize;
use sim::fault::{FaultKind, FrameKind, Frames, Injection, Supervised};
use sim::{Noise, PendantAction};

use crate::entry::{Entry, Expect, From, Given, Order, Recover, Scenario};
use crate::figure::Figure;
use crate::run::{self, Verdict};

/// Stream of noise that draws storms.
const STREAM: u64 = 0x5702;

/// The same for what a wide one has more.
const WIDE_STREAM: u64 = 0x5703;

/// Faults on the way back begin within this time, s.
const ON_THE_WAY: f64 = 15.0;

/// Faults and orders begin within this time, s.
const BEGIN: f64 = 2.5;

/// A storm and what came of it.
#[derive(Debug, Serialize)]
pub struct Outcome {
    /// Seed that draws it.
    pub seed: u64,
    /// The storm.
    pub scenario: Scenario,
    /// Result.
    pub verdict: Verdict,
}

/// The storm of this seed, run; a `wide` one has more orders, and faults on the way back.
#[must_use]
pub fn run(seed: u64, wide: bool) -> Outcome {
    let scenario = if wide { draw_wide(seed) } else { draw(seed) };
    let entry = Entry {
        id: "storm".to_owned(),
        title: String::new(),
        bar: String::new(),
        today: String::new(),
        hardware: None,
        test: Vec::new(),
        scenario: Vec::new(),
    };
    let verdict = run::run(&entry, &scenario, SimulatorKind::InProcess);
    Outcome { seed, scenario, verdict }
}

/// The storm of this seed, as a scenario that can be put into a file of `tests/faults`.
#[must_use]
pub fn draw(seed: u64) -> Scenario {
    let mut dice = Dice(Noise::new(seed, STREAM));
    let from = dice.of(&[From::Gravity, From::Hold, From::Approach, From::Run, From::Run, From::Lowering]);
    let mode = dice.of(&[Mode::Track, Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive]);
    let (mut inject, mut order) = (Vec::new(), Vec::new());
    for _ in 0..1 + dice.below(3) {
        let at = dice.between(0.02, BEGIN);
        if dice.below(4) == 0 {
            order.push(Order { at, give: dice.order(), answer: None });
        } else {
            inject.push(dice.injection(at));
        }
    }
    let ends = inject.iter().map(|fault| if fault.lasts.is_finite() { fault.at + fault.lasts } else { fault.at });
    let watch = ends.fold(BEGIN, f64::max) + 1.0;
    let expect = Expect { most: bars(&inject), ..Expect::default() };
    let name = format!("storm {seed}");
    Scenario {
        name,
        from,
        mode,
        seed,
        watch,
        firmware: false,
        known: None,
        inject,
        sweep: None,
        order,
        expect,
        recover: Recover::ZeroIfAsked,
        late: Vec::new(),
    }
}

/// The storm of this seed, with one to three orders more, of every kind, and one or two faults on the way back.
#[must_use]
pub fn draw_wide(seed: u64) -> Scenario {
    let mut scenario = draw(seed);
    let mut dice = Dice(Noise::new(seed, WIDE_STREAM));
    for _ in 0..1 + dice.below(3) {
        let at = dice.between(0.02, BEGIN);
        scenario.order.push(Order { at, give: dice.any_order(), answer: None });
    }
    for _ in 0..1 + dice.below(2) {
        let at = dice.scale(0.02, ON_THE_WAY);
        scenario.late.push(dice.injection(at));
    }
    scenario.name = format!("wide storm {seed}");
    scenario
}

/// Bars other than those of every scenario. What a device is told wrong with a right check sum, or not told at all, it
/// cannot tell rightly; a person has the way back show that it is right afterwards.
fn bars(inject: &[Injection]) -> std::collections::BTreeMap<Figure, f64> {
    let blinds = |fault: &Injection| match &fault.what {
        FaultKind::Drop(frames) | FaultKind::Flip(frames) | FaultKind::Freeze(frames) => {
            matches!(frames.kind, FrameKind::Any | FrameKind::Position | FrameKind::PositionRequest)
        }
        FaultKind::Delay { .. } | FaultKind::Refuse(_) | FaultKind::BusOff => true,
        FaultKind::CountJump { .. } | FaultKind::Restart { .. } => true,
        _ => false,
    };
    // The word of the safety module can be lost: then its silence has to end the torque.
    let deafens = |fault: &Injection| match &fault.what {
        FaultKind::Drop(frames) | FaultKind::Flip(frames) | FaultKind::Freeze(frames) => {
            matches!(frames.kind, FrameKind::Any | FrameKind::Property)
        }
        FaultKind::Delay { .. } | FaultKind::Refuse(_) | FaultKind::BusOff => true,
        _ => false,
    };
    // An emergency stop takes the power of the pucks, and with it their angles; only the safety module can tell so.
    let cuts_power = |fault: &Injection| matches!(fault.what, FaultKind::Pendant(PendantAction::PressEStop));
    let is_deaf = inject.iter().any(deafens);
    let is_blind = inject.iter().any(blinds) || (is_deaf && inject.iter().any(cuts_power));
    let bar = |is_free: bool, bar: f64| if is_free { f64::INFINITY } else { bar };
    [
        (Figure::Belief, bar(is_blind, 20.0)),
        (Figure::FreeSpeed, f64::INFINITY),
        (Figure::FallSpeed, 0.25),
        (Figure::TorqueUnasked, bar(is_deaf, 0.0)),
        (Figure::TorqueUnheard, 0.0),
    ]
    .into()
}

/// Draws of one storm.
struct Dice(Noise);

impl Dice {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.uniform(low, high)
    }

    /// As [`Dice::between`], each order of magnitude alike.
    fn scale(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.between(0.0, 1.0))
    }

    fn below(&mut self, end: usize) -> usize {
        self.between(0.0, end as f64) as usize
    }

    fn of<T: Copy>(&mut self, values: &[T]) -> T {
        values[self.below(values.len()).min(values.len() - 1)]
    }

    fn node(&mut self) -> u8 {
        1 + self.below(7) as u8
    }

    fn sign(&mut self) -> f64 {
        self.of(&[-1.0, 1.0])
    }

    fn order(&mut self) -> Given {
        match self.below(9) {
            0 | 1 => Given::Stop,
            2 => Given::Clear,
            3 => Given::Hold,
            4 => Given::Gravity,
            5 => Given::Release,
            6 => Given::Silence(self.scale(0.1, 2.0)),
            7 => Given::Speed(self.scale(0.1, 2.0)),
            _ => {
                let size = self.between(0.0, 0.3);
                Given::Goal(self.direction().map(|axis| size * axis))
            }
        }
    }

    fn any_order(&mut self) -> Given {
        match self.below(8) {
            0 => Given::Approach,
            1 => Given::Run,
            2 => Given::Hand([0.0, 1.0, 1.0, 1.0].map(|share| share * self.between(0.0, 2.0))),
            3 => Given::InitialiseHand,
            4 => Given::Tare,
            5 => Given::Upload,
            _ => self.order(),
        }
    }

    fn direction(&mut self) -> [f64; 3] {
        let (height, turn) = (self.between(-1.0, 1.0), self.between(-PI, PI));
        let radius = (1.0 - height * height).sqrt();
        [radius * turn.cos(), radius * turn.sin(), height]
    }

    fn frames(&mut self) -> Frames {
        let kind = self.of(&[
            FrameKind::Any,
            FrameKind::PositionRequest,
            FrameKind::Position,
            FrameKind::Position,
            FrameKind::SensorRequest,
            FrameKind::Force,
            FrameKind::Moment,
            FrameKind::ArmTorques,
            FrameKind::WristTorques,
            FrameKind::Torques,
            FrameKind::Property,
        ]);
        let of_a_puck = matches!(kind, FrameKind::Position | FrameKind::Property) && self.below(2) == 0;
        let from = if of_a_puck { vec![self.node()] } else { Vec::new() };
        let share = if self.below(2) == 0 { 1.0 } else { self.scale(0.01, 1.0) };
        Frames { kind, from, share, most: u32::MAX }
    }

    /// A fault that begins at `at`.
    fn injection(&mut self, at: f64) -> Injection {
        let once = f64::INFINITY;
        let (what, lasts) = match self.below(19) {
            0..=2 => (FaultKind::Drop(self.frames()), self.scale(0.003, 1.0)),
            3 => {
                let by = self.scale(0.0003, 0.02);
                (FaultKind::Delay { frames: self.frames(), by }, self.scale(0.003, 0.5))
            }
            4 => (FaultKind::Repeat(self.frames()), self.scale(0.003, 1.0)),
            5 | 6 => {
                let most = self.scale(1.0, 9.0) as u32;
                (FaultKind::Flip(Frames { most, ..self.frames() }), self.scale(0.003, 1.0))
            }
            7 => {
                let kind = self.of(&[FrameKind::Position, FrameKind::Force, FrameKind::Moment]);
                let from = if kind == FrameKind::Position { vec![self.node()] } else { Vec::new() };
                (FaultKind::Freeze(Frames { kind, from, ..Frames::default() }), self.scale(0.01, 1.0))
            }
            8 => {
                // Beyond what a motor can have done in a cycle. Below that nobody can tell it from a motion (A7).
                let by = (self.sign() * self.scale(2_000.0, 2_097_151.0)) as i32;
                (FaultKind::CountJump { node: self.node(), by }, if self.below(2) == 0 { once } else { 0.3 })
            }
            9 => (FaultKind::Restart { node: self.node() }, once),
            10 => {
                let celsius = self.between(20.0, 95.0) as i32;
                (FaultKind::Temperature { node: self.node(), celsius }, self.scale(0.1, 2.0))
            }
            11 => (FaultKind::Pendant(self.of(&[PendantAction::PressEStop, PendantAction::ShiftIdle])), once),
            12 => {
                let of = [Supervised::Velocity, Supervised::Torque, Supervised::Voltage, Supervised::Heartbeat];
                (FaultKind::Warning(self.of(&of)), self.scale(0.1, 1.0))
            }
            13 => (self.sensor(), self.scale(0.003, 1.0)),
            14 => (FaultKind::BusOff, self.scale(0.003, 1.0)),
            15 => {
                let kind = self.of(&[FrameKind::Any, FrameKind::PositionRequest, FrameKind::Torques]);
                (FaultKind::Refuse(kind), self.scale(0.003, 0.5))
            }
            16 | 17 => {
                let size = self.between(10.0, 80.0);
                (FaultKind::Push { force: self.direction().map(|axis| size * axis) }, self.scale(0.05, 0.5))
            }
            _ => {
                let friction = std::array::from_fn(|_| self.between(0.0, 0.5));
                let what = [FaultKind::Payload(self.between(0.0, 1.0)), FaultKind::Friction(friction)];
                (what[self.below(2).min(1)].clone(), self.scale(0.1, 1.0))
            }
        };
        Injection { at, lasts, every: 0.0, times: 1, what }
    }

    fn sensor(&mut self) -> FaultKind {
        let mut error = [0.0; 6];
        error[self.below(6).min(5)] = self.sign() * self.scale(0.5, 100.0);
        FaultKind::Sensor { error, drift: [0.0; 6] }
    }
}
