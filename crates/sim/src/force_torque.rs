//! The wrist force/torque sensor (node 8): GET FT answers with a force frame and a torque frame.
//!
//! The wrench is that of the environment (hand and payload) **on** the sensor, sensor frame, as its elastic element
//! gives it away: lagging by its hysteresis, plus seeded noise, minus what that was at the last tare; then bias and
//! drift, which are what the tare did *not* catch; quantised and saturated to 16 bits. Hysteresis is that of play: the
//! output stays while the input turns back by less than twice the half-width. After an overload the torque frame
//! carries a status byte until the next tare. The sensor boots like a motor puck and loses power with them (assumed:
//! docs/barrett-can.md).

use crate::boot::{Boot, Presence};
use crate::inbox::{Inbox, SET_TIME};
use crate::noise::Noise;
use crate::properties::Numbers;
use crate::time::{Ticks, seconds};
use puck::device::{acceleration_frame, force_frame, quantise, reply16, torque_frame};
use puck::force_torque::{NEWTON_METRE_PER_COUNT, NEWTON_PER_COUNT};
use puck::{Action, CanFrame, Destination, GaugeStatus, Node, Property, PropertyTable, Request, Role, Status};

/// Set-up of the sensor.
#[derive(Clone, Debug, PartialEq)]
pub struct ForceTorqueConfig {
    /// True if the arm has the sensor; without it node 8 never answers.
    pub fitted: bool,
    /// Standard deviation of each force axis, N.
    pub force_noise: f64,
    /// Standard deviation of each torque axis, N m.
    pub torque_noise: f64,
    /// Multiplies both standard deviations.
    pub noise_scale: f64,
    /// Added to every sample after the tare, N and N m: the error that a tare leaves.
    pub bias: [f64; 6],
    /// Grows from the last tare on, N/s and N m/s.
    pub drift: [f64; 6],
    /// Half-width of the hysteresis loop of each force axis, N.
    pub force_hysteresis: f64,
    /// Half-width of the hysteresis loop of each torque axis, N m.
    pub torque_hysteresis: f64,
    /// From when on the sensor says nothing more; `None`: never. A fault to inject.
    pub silent_from: Option<Ticks>,
}

impl Default for ForceTorqueConfig {
    /// Fitted, without systematic errors; 50 mN and 1.5 mN m, the resolution of the sensor's data sheet.
    fn default() -> Self {
        Self {
            fitted: true,
            force_noise: 0.05,
            torque_noise: 0.0015,
            noise_scale: 1.0,
            bias: [0.0; 6],
            drift: [0.0; 6],
            force_hysteresis: 0.0,
            torque_hysteresis: 0.0,
            silent_from: None,
        }
    }
}

/// An error that comes up slowly and stays, such as that of a sensor that warms.
#[derive(Clone, Copy, Debug)]
struct Creep {
    error: [f64; 6],
    from: Ticks,
    to: Ticks,
}

impl Creep {
    fn share(&self, now: Ticks) -> f64 {
        let whole = seconds(self.to.saturating_sub(self.from)).max(f64::MIN_POSITIVE);
        (seconds(now.saturating_sub(self.from)) / whole).min(1.0)
    }
}

/// Load at which a gauge saturates: forces N, torques N m (`wam7.toml` `[ft_sensor]` ranges).
const RANGE: [f64; 6] = [80.0, 80.0, 135.0, 2.75, 2.75, 2.75];

/// Monitor and main firmware version. Drivers do not read them (trap T16).
const VERSIONS: (i16, i16) = (16, 200);

/// The sensor.
#[derive(Clone, Debug)]
pub(crate) struct ForceTorque {
    config: ForceTorqueConfig,
    boot: Boot,
    inbox: Inbox,
    noise: Noise,
    tare: [f64; 6],
    tared_at: Ticks,
    creep: Option<Creep>,
    /// Output of the elastic element, N and N m; `None` before the first sample.
    strained: Option<[f64; 6]>,
    numbers: [Numbers; 2],
    /// Gauges that have saturated since the last tare. Which axis strains which gauge is not documented: one each.
    saturated: u8,
}

impl ForceTorque {
    /// A sensor without power.
    pub(crate) fn new(config: ForceTorqueConfig, boot_noise: Noise, sensor_noise: Noise) -> Self {
        Self {
            config,
            boot: Boot::new(boot_noise),
            inbox: Inbox::new(SET_TIME),
            noise: sensor_noise,
            tare: [0.0; 6],
            tared_at: 0,
            creep: None,
            strained: None,
            numbers: [PropertyTable::monitor(), PropertyTable::force_torque()].map(|table| Numbers::new(&table)),
            saturated: 0,
        }
    }

    /// From `from` on the samples become wrong by `error` (N and N m), all of it at `to`: what no earlier tare can
    /// catch.
    pub(crate) fn creep(&mut self, error: [f64; 6], from: Ticks, to: Ticks) {
        self.creep = Some(Creep { error, from, to });
    }

    /// One step of physics: the elastic element follows the true `wrench` (N, N m).
    pub(crate) fn follow(&mut self, wrench: &[f64; 6]) {
        let half_width = per_axis(self.config.force_hysteresis, self.config.torque_hysteresis);
        let before = self.strained.unwrap_or(*wrench);
        self.strained = Some(std::array::from_fn(|axis| {
            before[axis].clamp(wrench[axis] - half_width[axis], wrench[axis] + half_width[axis])
        }));
    }

    /// True if the sensor needs every step of physics.
    pub(crate) fn has_memory(&self) -> bool {
        self.config.force_hysteresis != 0.0 || self.config.torque_hysteresis != 0.0
    }

    /// Starts with the main firmware running.
    pub(crate) fn run(&mut self) {
        if self.config.fitted {
            self.boot.run();
        }
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        if self.config.fitted {
            self.boot.start(now);
        }
    }

    /// Motor power goes: the tare is lost.
    pub(crate) fn power_off(&mut self) {
        self.boot.cut();
        self.forget();
    }

    /// A request on the bus at time `at`. Its group membership is unknown, so it listens to its own node number alone.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) {
        let is_mine = request.to == Destination::Node(Node::FORCE_TORQUE);
        if is_mine && self.boot.presence(at) != Presence::Absent {
            self.inbox.receive(at, request.action);
        }
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.inbox.next_time()
    }

    /// Carries out one request that is done by `now` under the true `wrench` (N, N m); the frames to send.
    pub(crate) fn step(&mut self, now: Ticks, wrench: &[f64; 6]) -> [Option<CanFrame>; 2] {
        const NOTHING: [Option<CanFrame>; 2] = [None; 2];
        let Some(action) = self.inbox.take(now) else {
            return NOTHING;
        };
        let presence = self.boot.presence(now);
        let [monitor, main] = &self.numbers;
        let numbers = match presence {
            Presence::Absent => return NOTHING,
            Presence::Monitor => monitor,
            Presence::Ready => main,
        };
        if self.config.silent_from.is_some_and(|from| now >= from) {
            return NOTHING;
        }
        match action {
            Action::Get { property: id } => match numbers.property(id) {
                Some(Property::Ft) => self.sample(now, wrench),
                // At rest the sensor feels no acceleration that a consumer of this simulator would use.
                Some(Property::A) => [Some(acceleration_frame([0; 3])), None],
                Some(property) => {
                    let value = small_property(property, presence);
                    [value.map(|value| reply16(Node::FORCE_TORQUE, id, value)), None]
                }
                None => NOTHING,
            },
            Action::Set { property: id, value } => {
                match numbers.property(id) {
                    Some(Property::Ft) if value == 0 => self.tare(now, wrench),
                    Some(Property::Stat) => self.set_status(now, presence, value),
                    _ => {}
                }
                NOTHING
            }
            Action::PackedTorques { .. } => NOTHING,
        }
    }

    fn sample(&mut self, now: Ticks, wrench: &[f64; 6]) -> [Option<CanFrame>; 2] {
        let overloaded = gauges_beyond_range(wrench);
        self.saturated |= overloaded;
        let measured = self.measured(wrench);
        let age = seconds(now - self.tared_at);
        let creep = self.creep.map_or([0.0; 6], |creep| creep.error.map(|error| error * creep.share(now)));
        let [fx, fy, fz, tx, ty, tz] = std::array::from_fn(|axis| {
            measured[axis] - self.tare[axis] + self.config.bias[axis] + self.config.drift[axis] * age + creep[axis]
        });
        let status = (self.saturated != 0).then(|| {
            let bad = if overloaded != 0 { 0x40 } else { 0 };
            GaugeStatus(0x80 | bad | self.saturated)
        });
        [
            Some(force_frame([fx, fy, fz].map(|force: f64| quantise(force, NEWTON_PER_COUNT)))),
            Some(torque_frame([tx, ty, tz].map(|torque: f64| quantise(torque, NEWTON_METRE_PER_COUNT)), status)),
        ]
    }

    fn tare(&mut self, now: Ticks, wrench: &[f64; 6]) {
        self.tare = self.measured(wrench);
        self.tared_at = now;
        self.saturated = gauges_beyond_range(wrench);
    }

    /// Output of the gauges, with this sample's noise.
    fn measured(&mut self, wrench: &[f64; 6]) -> [f64; 6] {
        self.follow(wrench);
        let strained = self.strained.unwrap_or(*wrench);
        let sigma = per_axis(self.config.force_noise, self.config.torque_noise);
        std::array::from_fn(|axis| strained[axis] + self.noise.gaussian(sigma[axis] * self.config.noise_scale))
    }

    fn set_status(&mut self, now: Ticks, presence: Presence, value: i32) {
        if presence == Presence::Monitor && value == Status::Ready.value() {
            self.boot.wake(now);
            self.forget();
        } else if presence == Presence::Ready && value == Status::Reset.value() {
            self.boot.start(now);
            self.forget();
        }
    }

    fn forget(&mut self) {
        self.inbox.clear();
        self.tare = [0.0; 6];
        self.tared_at = 0;
        self.strained = None;
        self.saturated = 0;
    }
}

/// The same value for the three forces, another for the three torques.
fn per_axis(force: f64, torque: f64) -> [f64; 6] {
    [force, force, force, torque, torque, torque]
}

/// Properties that are constants.
fn small_property(property: Property, presence: Presence) -> Option<i16> {
    let is_ready = presence == Presence::Ready;
    match property {
        Property::Vers => Some(if is_ready { VERSIONS.1 } else { VERSIONS.0 }),
        Property::Role => Some(Role::FORCE_TORQUE as i16),
        Property::Stat => Some(if is_ready { Status::Ready } else { Status::Reset }.value() as i16),
        Property::Id => Some(Node::FORCE_TORQUE.number().into()),
        Property::Sn | Property::Error => Some(0),
        _ => None,
    }
}

/// One bit per axis beyond its range.
fn gauges_beyond_range(wrench: &[f64; 6]) -> u8 {
    wrench.iter().zip(RANGE).enumerate().fold(
        0,
        |bits, (axis, (load, range))| {
            if load.abs() > range { bits | 1 << axis } else { bits }
        },
    )
}
