//! One loop: a law, a pose and a variation, kicked; how much of the kick is left.

use control::command::{Command, RunOptions};
use control::law::Gains;
use control::model::{self, ArmModel, Frames};
use control::plan::load;
use control::plan::primitive::{
    ExpectedWrench, Feedback, GainSchedule, MovementTables, Primitive, ROWS, SENSORS, Velocity, configuration, gains,
    limits,
};
use control::units::{JointPositions, Vector7};
use control::{BusSample, Cycle, CycleInput, Event, PERIOD, Payload, RATE, State, flags};
use dmp::{Hemisphere, OrientationError};
use nalgebra::Vector3;
use pinned_init::InPlaceWrite;
use puck::SafetyMode;

use crate::plant::{Plant, Variation};

const KERNELS: usize = 10;

/// Duration of the movement that stays where it is (s): that of the demonstration for which the gains of Eq (8) were
/// chosen.
const DURATION: f64 = 12.0;

/// Speed of each motor after the kick (rad/s).
const KICK: f64 = 0.1;

/// Distance from its soft limit at which a joint begins that is then pressed against it (rad), and the time it gets for
/// that before the kick (s).
const BEFORE_LIMIT: f64 = 0.001;
const PRESS: f64 = 1.5;

/// Speed below which every arm may be cleared (rad/s).
const STANDS: f64 = 0.04;

/// Largest distance of a bound from the soft limit beside which the arm was armed (rad).
const SLACK: f64 = 0.01;

/// Time after the kick until its rest is measured, and for how long (s).
const WAIT: f64 = 1.5;
const WINDOW: f64 = 0.35;

/// State and options that decide the torque.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Law {
    Hold,
    /// Moves to another posture.
    Approach,
    /// Led by hand.
    Teach,
    SoftStop,
    /// A run with stiff or compliant gains.
    Run {
        compliant: bool,
        feedback: bool,
        force: bool,
    },
}

/// Rest of a kick.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Rest {
    /// Largest swing of a motor's speed, in parts of the kick.
    pub(crate) share: f64,
    /// Its frequency (Hz), and its joint (1 to 7).
    pub(crate) frequency: f64,
    pub(crate) joint: usize,
}

struct Loop {
    cycle: Box<Cycle<f64, KERNELS>>,
    plant: Plant,
    number: u64,
}

impl Loop {
    fn tick(&mut self, command: Option<Command>) -> control::CycleOutput {
        let sample = BusSample {
            positions: self.plant.counts(),
            wrench: Some(self.plant.wrench()),
            safety: Some(SafetyMode::Active),
            hand: None,
        };
        let output = self.cycle.step(&CycleInput { cycle: self.number, sample, command, external_fault: None });
        let on = output.record.state.has_torque();
        self.plant.advance(on.then(|| Vector7::from(output.record.tau.map(f64::from))));
        self.number += 1;
        output
    }

    fn command(&mut self, command: Command) {
        let output = self.tick(Some(command));
        assert_eq!(output.event, Some(Event::Accepted), "{command:?} in {:?}", output.record.state);
    }

    /// Runs for a time (s); false if the arm was stopped.
    fn run_for(&mut self, seconds: f64) -> bool {
        for _ in 0..(seconds * RATE).round() as usize {
            self.tick(None);
        }
        self.cycle.fault() == control::Fault::None
    }
}

/// Why there is no rest of a kick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stop {
    /// A monitor stopped the nominal loop before the kick: the arm was pushed to a limit of its joints or to a singular
    /// posture.
    Before,
    /// A monitor stopped the arm behind it.
    Behind,
}

/// Kicks one loop.
pub(crate) fn kick(
    gains: &Gains<f64>,
    law: Law,
    q: [f64; 7],
    variation: Variation,
    push: Vector3<f64>,
) -> Result<Rest, Stop> {
    let kicked = course(gains, law, q, variation, push, KICK)?;
    let alone = course(gains, law, q, variation, push, 0.0)?;
    Ok(rest(&kicked.iter().zip(&alone).map(|(kicked, alone)| kicked - alone).collect::<Vec<_>>()))
}

/// An arm that has come to rest under this law; from now on what varies acts. `None`: a monitor stopped it before.
fn settled(gains: &Gains<f64>, law: Law, q: [f64; 7], variation: Variation, push: Vector3<f64>) -> Option<Loop> {
    let q = at_limit(q, variation);
    // Rest comes first, with the nominal loop and time; then what varies is switched on.
    let plant = Plant::new(q, variation);
    let Ok(cycle) = Box::new_uninit().write_init(Cycle::init(plant.calibration(), *gains));
    let mut arm = Loop { cycle, plant, number: 0 };
    arm.run_for(0.01);
    match law {
        Law::Teach => arm.command(Command::Gravity),
        _ => arm.command(Command::Hold),
    }
    if !arm.run_for(1.0) {
        return None;
    }
    match law {
        Law::Hold | Law::Teach => {}
        Law::SoftStop => arm.command(Command::Stop),
        Law::Approach => {
            // Slowly, and away from the nearer limit; the trial of the motors with which it begins is over by then.
            let there = arm.tick(None).record.q;
            let target = core::array::from_fn(|at| {
                let middle = 0.5 * (model::SOFT_MIN[at] + model::SOFT_MAX[at]);
                there[at] + if f64::from(there[at]) < middle { 0.05 } else { -0.05 }
            });
            arm.command(Command::Approach { q: target, duration: 30.0 });
            arm.run_for(3.0);
        }
        Law::Run { compliant, feedback, force } => {
            arm.command(Command::Tare);
            while arm.number < 3000 && arm.tick(None).record.dq.iter().any(|v| v.abs() > 0.02) {}
            if arm.cycle.fault() != control::Fault::None {
                return None;
            }
            let there: [f64; 7] = arm.tick(None).record.q.map(f64::from);
            // A joint that settled a little beyond its soft limit is taught at it: no movement may begin beyond.
            let taught = core::array::from_fn(|at| there[at].clamp(model::SOFT_MIN[at], model::SOFT_MAX[at]));
            let primitive = staying(taught);
            // The brake would hold up a plan that bends, and the joints contradict what the sensor measures.
            arm.plant.braked = false;
            arm.cycle.load(&load::check(arm.cycle.model(), &primitive).expect("runs")).expect("loads");
            arm.command(Command::Run(RunOptions {
                feedback,
                force_control: force,
                compliant,
                finger_feedback: false,
                ..RunOptions::default()
            }));
            arm.run_for(0.3);
            arm.plant.push = push;
            if !arm.run_for(3.0) {
                return None;
            }
        }
    }
    arm.run_for(0.2);
    arm.plant.settle();
    Some(arm)
}

/// Speeds of the motors, some time after a kick.
fn course(
    gains: &Gains<f64>,
    law: Law,
    q: [f64; 7],
    variation: Variation,
    push: Vector3<f64>,
    kick: f64,
) -> Result<Vec<Vector7<f64>>, Stop> {
    let mut arm = settled(gains, law, q, variation, push).ok_or(Stop::Before)?;
    if variation.pressed.is_some() {
        arm.run_for(PRESS);
    }
    for (joint, speed) in arm.plant.omega.iter_mut().enumerate() {
        *speed += if joint % 2 == 0 { kick } else { -kick };
    }
    arm.run_for(WAIT);
    let mut seen = Vec::new();
    for _ in 0..(WINDOW * RATE) as usize {
        arm.tick(None);
        seen.push(arm.plant.omega);
    }
    let wanted = match law {
        Law::Hold => State::Hold,
        Law::Approach => State::Approach,
        Law::Teach => State::Gravity,
        Law::SoftStop => State::SoftStop,
        Law::Run { .. } => State::Run,
    };
    if arm.cycle.state() == wanted && arm.plant.omega.amax().is_finite() { Ok(seen) } else { Err(Stop::Behind) }
}

/// Presses a joint against its limit. Returns in how many control periods it was beyond, and in how many the flag that
/// tells so was wrong.
pub(crate) fn beyond_limit(law: Law, q: [f64; 7], variation: Variation) -> (u32, u32) {
    let mut arm = settled(&Gains::tuned(), law, q, variation, Vector3::zeros()).expect("an arm at rest");
    let (mut beyond, mut wrong) = (0, 0);
    for _ in 0..(PRESS * RATE) as u32 {
        let record = arm.tick(None).record;
        let farthest = (0..7).map(|at| {
            let q = f64::from(record.q[at]);
            (q - model::SOFT_MAX[at]).max(model::SOFT_MIN[at] - q)
        });
        let farthest = farthest.fold(f64::NEG_INFINITY, f64::max);
        let told = record.flags & flags::NEAR_LIMIT != 0;
        // A bound lies up to the slack beyond where the arm was armed.
        beyond += u32::from(farthest > SLACK);
        wrong += u32::from(farthest > SLACK && !told || farthest < 0.0 && told);
    }
    (beyond, wrong)
}

/// End of an arm whose loop is not stable.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stopped {
    pub(crate) fault: control::Fault,
    /// Time from the first swing of a motor with this speed (rad/s) to the soft stop (s).
    pub(crate) after: f64,
    /// Fastest motor one second later (rad/s).
    pub(crate) left: f64,
    /// Faults afterwards: after clearing and a second of being led by hand, and after another three of holding.
    pub(crate) then: [control::Fault; 2],
}

/// Holds `q` with gains that swing until the arm is stopped; `None` if it is not within 3 s. `strong` is the speed that
/// counts as a swing (rad/s).
pub(crate) fn shake(gains: &Gains<f64>, q: [f64; 7], strong: f64) -> Option<Stopped> {
    let plant = Plant::new(q, Variation::NONE);
    let Ok(cycle) = Box::new_uninit().write_init(Cycle::init(plant.calibration(), *gains));
    let mut arm = Loop { cycle, plant, number: 0 };
    arm.run_for(0.01);
    arm.command(Command::Hold);
    arm.run_for(1.0);
    arm.plant.settle();
    arm.plant.omega[3] += KICK;
    let mut swinging = None;
    for tick in 0..(3.0 * RATE) as u32 {
        arm.tick(None);
        if arm.plant.omega.amax() > strong {
            swinging = swinging.or(Some(tick));
        }
        if arm.cycle.fault() != control::Fault::None {
            let (fault, after) = (arm.cycle.fault(), f64::from(tick - swinging.unwrap_or(tick)) * PERIOD);
            arm.run_for(1.0);
            let left = arm.plant.omega.amax();
            // Without friction an arm floats for a while; one that moves is not cleared.
            while arm.plant.omega.amax() > STANDS && arm.number < 10_000 {
                arm.tick(None);
            }
            arm.command(Command::ClearFault);
            arm.command(Command::Gravity);
            arm.run_for(1.0);
            let led = arm.cycle.fault();
            arm.command(Command::Hold);
            arm.run_for(3.0);
            return Some(Stopped { fault, after, left, then: [led, arm.cycle.fault()] });
        }
    }
    None
}

/// A fast move from one posture to another, kicked on its way.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Move {
    pub(crate) from: [f64; 7],
    pub(crate) to: [f64; 7],
    /// When it is kicked (s after its beginning).
    pub(crate) kicked: f64,
}

/// Speeds of the motors in a move, from the kick on; `None`: a monitor stopped the arm.
fn on_the_way(place: &Move, variation: Variation, kick: f64) -> Option<Vec<Vector7<f64>>> {
    let plant = Plant::new(place.from, variation);
    let Ok(cycle) = Box::new_uninit().write_init(Cycle::init(plant.calibration(), Gains::tuned()));
    let mut arm = Loop { cycle, plant, number: 0 };
    arm.run_for(0.01);
    arm.command(Command::Hold);
    arm.run_for(1.0);
    arm.plant.settle();
    // As fast as the device allows.
    arm.command(Command::Approach { q: place.to.map(|q| q as f32), duration: 0.0 });
    arm.run_for(place.kicked);
    for (joint, speed) in arm.plant.omega.iter_mut().enumerate() {
        *speed += if joint % 2 == 0 { kick } else { -kick };
    }
    let mut seen = Vec::new();
    while arm.cycle.state() == State::Approach {
        arm.tick(None);
        seen.push(arm.plant.omega);
    }
    (arm.cycle.fault() == control::Fault::None).then_some(seen)
}

/// Largest swing beyond 8 Hz of a motor that a kick leaves in a move, from 0.2 s behind it on, in parts of the kick;
/// `None`: a monitor stopped the arm.
pub(crate) fn left_on_the_way(place: &Move, variation: Variation) -> Option<f64> {
    let (kicked, alone) = (on_the_way(place, variation, KICK)?, on_the_way(place, variation, 0.0)?);
    let seen: Vec<_> = kicked.iter().zip(&alone).map(|(kicked, alone)| kicked - alone).collect();
    let half = (0.5 * RATE / 8.0) as usize;
    let swings = seen.windows(2 * half + 1).skip((0.2 * RATE) as usize).map(|window| {
        let mean = window.iter().sum::<Vector7<f64>>() / window.len() as f64;
        window.get(half).map_or(0.0, |omega| (omega - mean).amax())
    });
    Some(swings.fold(0.0, f64::max) / KICK)
}

/// The posture with the joint that is pressed just inside its soft limit.
fn at_limit(mut q: [f64; 7], variation: Variation) -> [f64; 7] {
    if let Some((joint, torque)) = variation.pressed {
        let (min, max) = (model::SOFT_MIN[joint] + BEFORE_LIMIT, model::SOFT_MAX[joint] - BEFORE_LIMIT);
        q[joint] = if torque > 0.0 { max } else { min };
    }
    q
}

fn rest(seen: &[Vector7<f64>]) -> Rest {
    // About a straight line: an arm that floats may drift.
    let middle = (seen.len() - 1) as f64 / 2.0;
    let mean = seen.iter().sum::<Vector7<f64>>() / seen.len() as f64;
    let spread: f64 = (0..seen.len()).map(|at| (at as f64 - middle).powi(2)).sum();
    let slope = seen.iter().enumerate().map(|(at, omega)| omega * (at as f64 - middle)).sum::<Vector7<f64>>() / spread;
    let seen: Vec<_> = seen.iter().enumerate().map(|(at, omega)| omega - mean - slope * (at as f64 - middle)).collect();
    let swing = |joint: usize| seen.iter().map(|omega| omega[joint].abs()).fold(0.0, f64::max);
    let joint = (0..7).max_by(|a, b| swing(*a).total_cmp(&swing(*b))).unwrap_or(0);
    let turns = seen.windows(2).filter(|w| (w[0][joint] > 0.0) != (w[1][joint] > 0.0)).count();
    Rest { share: swing(joint) / KICK, frequency: turns as f64 / 2.0 / (seen.len() as f64 * PERIOD), joint: joint + 1 }
}

/// A movement that stays at `q`, with the feedback gains that a demonstration of this duration gets.
fn staying(q: [f64; 7]) -> Primitive<f64, KERNELS> {
    let model = ArmModel::new(Payload::SensorAndHand);
    let frames = Frames::new(&model, &JointPositions::from_array(q));
    let pose = frames.tool_pose();
    let upright = (0..3).find(|axis| frames.tool_to_world()[(2, *axis)].abs() > 0.9);
    let at = configuration(pose.position.into(), pose.orientation.0, q, [0.0, 0.25, 0.25, 0.25]);
    let mut k1 = [320.0, 320.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    if let Some(axis) = upright {
        k1[3 + axis] = 740.0;
    }
    let feedback = Feedback::new(
        GainSchedule::constant(k1).expect("gains"),
        GainSchedule::constant([1.0; SENSORS]).expect("gains"),
        limits(0.25, 0.436, 0.6),
    );
    let tables = MovementTables {
        control_period: PERIOD,
        duration: DURATION,
        alpha: -(0.01f64).ln(),
        activation: 0.7,
        kernel_count: KERNELS,
        weights: &[0.0; ROWS * KERNELS],
        gains: gains([400.0, 200.0, 200.0, 200.0], [40.0, 20.0, 800f64.sqrt(), 800f64.sqrt()]),
        orientation_error: OrientationError::Quaternion,
        hemisphere: Hemisphere::Nearest,
        start: at,
        goal: at,
        start_velocity: Velocity::ZERO,
    };
    let mut primitive = load::primitive(&model, &tables).expect("a movement this arm can run");
    let none = [0.0; SENSORS];
    primitive.set_feedback(Some(&feedback.expect("feedback")));
    primitive.set_expected(Some(&ExpectedWrench::new(&[none, none], DURATION).expect("an expectation")));
    primitive
}
