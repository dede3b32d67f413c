//! The BarrettHand BH8-280 on the bus: four pucks (nodes 11..14), three worm-driven fingers and the spread.
//!
//! ```text
//! torque, moves, HI --> Digit x 4 --demand--> Finger x 3, Spread --targets--> World::drive_hand
//! P, SG <-- encoders, Gauge x 3 <------------- loads ------------------------- World::hand
//! ```
//! Figures of the drives: docs/arm-model.md; 2.44 rad/s free and some 15 N at the tip (Barrett). How a torque command
//! becomes that force is not published: an efficiency of 0.1 between motor and link fits both, and makes the worm
//! self-locking.

mod digit;
mod drive;
mod finger;
mod gauge;
mod spread;

use crate::noise::Noise;
use crate::time::{STEP_TICKS, Ticks, seconds};
use crate::world::{HandState, HandTargets, World};
use digit::{Digit, Motion};
use drive::{Demand, Inertia};
use finger::Finger;
use gauge::Gauge;
use puck::{CanFrame, Node, Request, UnknownFirmware};
use spread::Spread;

/// Motor, gears and worm of a finger at the inner link. The inertia is the motor's times 125^2; viscous friction such
/// that 1.3 N m drive a free finger at 2.44 rad/s.
const FINGER: Inertia = Inertia { inertia: 0.0022, viscous: 1.2 / 2.44, coulomb: 0.1 };

/// Motor and gears of the spread at the fingers' bases; all assumed.
const SPREAD: Inertia = Inertia { inertia: 4e-4, viscous: 0.1, coulomb: 0.1 };

/// Set-up of the hand. Digits in the order F1, F2, F3, spread.
#[derive(Clone, Debug, PartialEq)]
pub struct HandConfig {
    /// VERS of the boot loader.
    pub monitor_version: i16,
    /// VERS of the main firmware.
    pub version: i16,
    /// IPNM, current units per N m at the motor.
    pub units_per_newton_metre: [i16; 4],
    /// MT, current units.
    pub torque_limit: [i16; 4],
    /// Part of a finger motor's torque that arrives at the links.
    pub finger_efficiency: f64,
    /// Part of the spread motor's torque that arrives at the spread.
    pub spread_efficiency: f64,
    /// Torque through the TorqueSwitch clutch at which it lets go, N m at the inner link.
    pub breakaway: [f64; 3],
    /// Reading of each strain gauge without load, counts.
    pub gauge_zero: [f64; 3],
    /// Standard deviation of a gauge reading, counts.
    pub gauge_noise: f64,
    /// From when on a gauge repeats its last reading; `None`: never. A fault to inject.
    pub gauge_stuck_from: [Option<Ticks>; 3],
}

impl Default for HandConfig {
    /// Firmware 200, Barrett's default IPNM and MT, a clutch set to 0.9 N m, gauges about 2000 with 3 counts of noise.
    fn default() -> Self {
        Self {
            monitor_version: 16,
            version: 200,
            units_per_newton_metre: [20_000; 4],
            torque_limit: [2200; 4],
            finger_efficiency: 0.1,
            spread_efficiency: 1.0,
            breakaway: [0.9; 3],
            gauge_zero: [2004.0, 1987.0, 2021.0],
            gauge_noise: 3.0,
            gauge_stuck_from: [None; 3],
        }
    }
}

/// The hand.
#[derive(Clone, Debug)]
pub(crate) struct Hand {
    config: HandConfig,
    digits: [Digit; 4],
    fingers: [Finger; 3],
    spread: Spread,
    gauges: [Gauge; 3],
    /// Last readings, which a stuck gauge repeats.
    readings: [u16; 3],
    stepped_at: Ticks,
}

impl Hand {
    /// The hand of `world`, without power, at time 0. `noise` gives the stream of a number.
    pub(crate) fn new(
        config: HandConfig,
        world: &dyn World,
        noise: impl Fn(u64) -> Noise,
    ) -> Result<Self, UnknownFirmware> {
        let state = world.hand();
        let versions = (config.monitor_version, config.version);
        // Streams: node numbers for waking as with the arm's pucks; 100 and up for counters, 110 and up for gauges.
        let digit = |index: usize| {
            let number = Node::HAND[index].number().into();
            let streams = [noise(number), noise(100 + index as u64)];
            let (ipnm, limit) = (config.units_per_newton_metre[index], config.torque_limit[index]);
            Digit::new(index, versions, ipnm, limit, streams)
        };
        Ok(Self {
            digits: [digit(0)?, digit(1)?, digit(2)?, digit(3)?],
            fingers: std::array::from_fn(|finger| {
                Finger::new(state.inner[finger], state.outer[finger], config.breakaway[finger], FINGER)
            }),
            spread: Spread::new(state.spread, SPREAD),
            gauges: std::array::from_fn(|finger| {
                Gauge::new(config.gauge_zero[finger], config.gauge_noise, noise(110 + finger as u64))
            }),
            readings: config.gauge_zero.map(|zero| zero as u16),
            config,
            stepped_at: 0,
        })
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        self.digits.iter_mut().for_each(|digit| digit.power_on(now));
    }

    /// Starts with the main firmware running and the hand initialised.
    pub(crate) fn run(&mut self) {
        self.digits.iter_mut().for_each(Digit::run);
    }

    /// Motor power goes: the worms hold, the spread is free.
    pub(crate) fn power_off(&mut self) {
        self.digits.iter_mut().for_each(Digit::power_off);
    }

    /// Power of one digit's puck fails for an instant.
    pub(crate) fn restart(&mut self, digit: usize, now: Ticks) {
        if let Some(digit) = self.digits.get_mut(digit) {
            digit.power_off();
            digit.power_on(now);
        }
    }

    /// A request on the bus at time `at`.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) {
        self.digits.iter_mut().for_each(|digit| digit.receive(at, request));
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.digits.iter().filter_map(Digit::next_time).min()
    }

    /// Carries out what is due by `now`; hands each reply to `send`.
    pub(crate) fn step(&mut self, now: Ticks, mut send: impl FnMut(Node, CanFrame)) {
        let ahead = seconds(now - self.stepped_at);
        for index in 0..self.digits.len() {
            while self.digits[index].next_time().is_some_and(|at| at <= now) {
                let motion = self.motion(index, ahead);
                let Self { digits, gauges, readings, config, .. } = self;
                let reply = digits[index]
                    .step(now, &motion, || read_gauge(index, now, gauges, readings, &config.gauge_stuck_from));
                if let Some(frame) = reply {
                    send(Node::HAND[index], frame);
                }
            }
        }
    }

    /// One step of physics of the drives, which ends at `end`; then the world's step may follow.
    pub(crate) fn drive(&mut self, end: Ticks, world: &mut dyn World) {
        let HandState { inner_load, outer_load, spread_load, .. } = world.hand();
        let begin = end - STEP_TICKS;
        for (index, finger) in self.fingers.iter_mut().enumerate() {
            let motion = finger_motion(finger, 0.0);
            let demand = derated(self.digits[index].demand(begin, &motion), self.config.finger_efficiency);
            finger.step(demand, inner_load[index], outer_load[index]);
            self.gauges[index].feel(outer_load[index]);
        }
        let motion = Motion { angle: self.spread.angle(), speed: self.spread.speed(), secondary: None };
        let [.., spread] = &mut self.digits;
        let demand = derated(spread.demand(begin, &motion), self.config.spread_efficiency);
        self.spread.step(demand, spread_load);
        self.stepped_at = end;
        world.drive_hand(&HandTargets {
            inner: std::array::from_fn(|finger| self.fingers[finger].inner()),
            outer: std::array::from_fn(|finger| self.fingers[finger].outer()),
            spread: self.spread.angle(),
        });
    }

    /// Requests lost to full receive buffers.
    pub(crate) fn lost_requests(&self) -> u64 {
        self.digits.iter().map(Digit::lost_requests).sum()
    }

    fn motion(&self, index: usize, ahead: f64) -> Motion {
        match self.fingers.get(index) {
            Some(finger) => finger_motion(finger, ahead),
            None => {
                let speed = self.spread.speed();
                Motion { angle: self.spread.angle() + ahead * speed, speed, secondary: None }
            }
        }
    }
}

/// A finger's drive `ahead` seconds after the last step.
fn finger_motion(finger: &Finger, ahead: f64) -> Motion {
    Motion {
        angle: finger.drive() + ahead * finger.speed(),
        speed: finger.speed(),
        secondary: Some(finger.inner() + ahead * finger.inner_speed()),
    }
}

/// Torque that arrives at the link.
fn derated(demand: Demand, efficiency: f64) -> Demand {
    match demand {
        Demand::Idle => Demand::Idle,
        Demand::Torque(torque) => Demand::Torque(torque * efficiency),
        Demand::Velocity(velocity, limit) => Demand::Velocity(velocity, limit * efficiency),
    }
}

/// The spread puck answers too; its value means nothing.
fn read_gauge(
    index: usize,
    now: Ticks,
    gauges: &mut [Gauge; 3],
    readings: &mut [u16; 3],
    stuck_from: &[Option<Ticks>; 3],
) -> u16 {
    const MEANINGLESS: u16 = 2048;
    let (Some(gauge), Some(reading)) = (gauges.get_mut(index), readings.get_mut(index)) else {
        return MEANINGLESS;
    };
    if stuck_from[index].is_none_or(|from| now < from) {
        *reading = gauge.read();
    }
    *reading
}
