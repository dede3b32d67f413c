//! One motor puck of the arm (node 1..7): properties, boot, encoder, torque.
//!
//! The encoder counts `floor(theta CTS / 2 pi) + offset`; SET P chooses the offset, power and wake-up lose it. Torque
//! acts only in MODE 2, is clipped to MT, and stays applied until it is changed or the mode changes
//! (docs/barrett-can.md: no public source knows of a time-out in the puck). In every other mode the puck shorts its
//! windings and brakes.

use crate::firmware::{Firmware, Heard, Order};
use crate::noise::Noise;
use crate::time::Ticks;
use puck::device::position_frame;
use puck::{CanFrame, Counts, Group, MotorMode, Node, Property, Request, Role, UnknownFirmware};
use std::f64::consts::TAU;

/// Figures in which the pucks of two arms differ.
#[derive(Clone, Debug, PartialEq)]
pub struct PuckConfig {
    /// VERS of the boot loader; differs from the main firmware's, so that a master must read it again after waking.
    pub monitor_version: i16,
    /// VERS of the main firmware; decides the property numbers.
    pub version: i16,
    /// CTS, encoder counts per motor revolution.
    pub counts_per_revolution: i32,
    /// IPNM of M1..M7, current units per N m at the motor.
    pub units_per_newton_metre: [i16; 7],
    /// MT of M1..M7, current units.
    pub torque_limit: [i16; 7],
}

impl Default for PuckConfig {
    /// Firmware 200, 4096 counts, and the IPNM and MT that one laboratory fitted to its arm (`wam7.toml`
    /// `[arm.drive]`).
    fn default() -> Self {
        Self {
            monitor_version: 16,
            version: 200,
            counts_per_revolution: 4096,
            units_per_newton_metre: [2472, 2472, 2472, 2472, 6105, 6105, 21400],
            torque_limit: [4860, 4860, 4860, 4320, 3900, 3900, 3200],
        }
    }
}

/// Action of a puck on its motor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Drive {
    /// Shorted windings: a torque against the motor's velocity.
    Brake,
    /// A torque, current units of the puck.
    Torque(i32),
}

/// Number of motor poles (POLES): 12 for M1-4, 8 for M5, M6, and 6 for M7, which tells a wrist from gimbals.
const POLES: [i32; 7] = [12, 12, 12, 12, 8, 8, 6];

/// PIDX: place in the packed torque frame of the puck's group.
const PLACES: [i32; 7] = [1, 2, 3, 4, 1, 2, 3];

/// Puck temperature TEMP and motor temperature THERM, deg C. Constant: nothing here heats up.
const TEMPERATURES: (i32, i32) = (34, 31);

/// One motor puck.
#[derive(Clone, Debug)]
pub(crate) struct Puck {
    firmware: Firmware,
    offset: i64,
    /// Counts by which the position is off, of each fault: gone where the counts begin anew or are set.
    jumps: Vec<i32>,
    /// Temperature that it tells because of a fault, degree Celsius.
    heated: Option<i32>,
    /// T as the master set it; what acts is clipped to MT.
    commanded: i32,
}

impl Puck {
    /// Motor `index` (0..=6), without power.
    pub(crate) fn new(index: usize, config: &PuckConfig, noise: Noise) -> Result<Self, UnknownFirmware> {
        let node = Node::ARM[index];
        let torque_group = if index < 4 { Group::ARM_TORQUES } else { Group::WRIST_TORQUES };
        let factory = [
            (Property::Vers, i32::from(config.version)),
            (Property::Role, i32::from(Role::MOTOR | Role::ABSOLUTE_ANGLE)),
            (Property::Sn, 1000 + i32::from(node.number())),
            (Property::Id, i32::from(node.number())),
            (Property::Error, 0),
            (Property::Mode, MotorMode::Idle.value()),
            (Property::Temp, TEMPERATURES.0),
            (Property::Ptemp, TEMPERATURES.0),
            (Property::Otemp, 60),
            (Property::Therm, TEMPERATURES.1),
            (Property::Grpa, i32::from(Group::ALL_MOTORS.number())),
            (Property::Grpb, i32::from(torque_group.number())),
            (Property::Grpc, i32::from(Group::ARM.number())),
            (Property::Mt, i32::from(config.torque_limit[index])),
            (Property::Cts, config.counts_per_revolution),
            (Property::Pidx, PLACES[index]),
            (Property::Jidx, i32::from(node.number())),
            (Property::Ipnm, i32::from(config.units_per_newton_metre[index])),
            (Property::Poles, POLES[index]),
            (Property::Ecmax, 0),
            (Property::Ecmin, 0),
        ];
        let firmware = Firmware::new(node, config.monitor_version, &factory, noise)?;
        Ok(Self { firmware, offset: 0, jumps: Vec::new(), heated: None, commanded: 0 })
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        self.firmware.power_on(now);
    }

    /// The main firmware runs, and its position is the true one: power and zeroing lie in the past.
    pub(crate) fn run(&mut self) {
        self.firmware.run();
    }

    /// Motor power goes: the position is lost.
    pub(crate) fn power_off(&mut self) {
        self.firmware.power_off();
        self.forget();
    }

    /// Power fails for an instant: what was set is lost, and the counts begin anew.
    pub(crate) fn restart(&mut self, now: Ticks) {
        self.power_off();
        self.power_on(now);
    }

    /// The position is off by so many counts from now on, or no longer.
    pub(crate) fn jump(&mut self, counts: i32, begins: bool) {
        if begins {
            self.jumps.push(counts);
        } else if let Some(place) = self.jumps.iter().position(|jump| *jump == counts) {
            self.jumps.remove(place);
        }
    }

    /// Puck and motor are this hot, degree Celsius, over a restart as well; `None`: as usual.
    pub(crate) fn heat(&mut self, celsius: Option<i32>) {
        self.heated = celsius;
    }

    /// A request on the bus at time `at`; packed torques act at once, the rest waits its turn.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) {
        if let Heard::Torque(units) = self.firmware.receive(at, request) {
            self.command(units);
        }
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.firmware.next_time()
    }

    /// Carries out one request that is done by `now`, with the motor at `angle` (rad); the reply, if there is one.
    pub(crate) fn step(&mut self, now: Ticks, angle: f64) -> Option<CanFrame> {
        match self.firmware.take(now)? {
            Order::Answer(frame) => frame,
            Order::Get { property: Property::P, .. } => {
                Some(position_frame(self.firmware.node(), self.position(angle), None))
            }
            Order::Get { property: Property::T, id } => Some(self.firmware.reply(Property::T, id, self.commanded)),
            Order::Get { property: Property::Mech, id } => {
                let within = self.encoder(angle).rem_euclid(self.counts_per_revolution());
                Some(self.firmware.reply(Property::Mech, id, within as i32))
            }
            Order::Get { property: property @ (Property::Temp | Property::Therm), id } => match self.heated {
                Some(celsius) => Some(self.firmware.reply(property, id, celsius)),
                None => self.firmware.answer(property, id),
            },
            Order::Get { property, id } => self.firmware.answer(property, id),
            Order::Set { property, value } => {
                self.set(property, value, angle);
                None
            }
            Order::Restarted => {
                self.forget();
                // The encoder counter starts at zero with the main firmware.
                self.offset = -self.encoder(angle);
                None
            }
        }
    }

    /// Returns the puck's action on its motor at `now`.
    pub(crate) fn drive(&self, now: Ticks) -> Drive {
        if self.firmware.value(Property::Mode) != MotorMode::Torque.value() || !self.firmware.is_ready(now) {
            return Drive::Brake;
        }
        let limit = self.firmware.value(Property::Mt).max(0);
        Drive::Torque(self.commanded.clamp(-limit, limit))
    }

    /// Requests lost to a full receive buffer.
    pub(crate) fn lost_requests(&self) -> u64 {
        self.firmware.lost_requests()
    }

    fn set(&mut self, property: Property, value: i32, angle: f64) {
        match property {
            Property::P => {
                self.offset = i64::from(value) - self.encoder(angle);
                self.jumps.clear();
            }
            Property::T => self.command(value),
            Property::Mode => {
                self.commanded = 0;
                self.firmware.store(Property::Mode, value);
            }
            other => self.firmware.store(other, value),
        }
    }

    fn command(&mut self, units: i32) {
        let is_torque_mode = self.firmware.value(Property::Mode) == MotorMode::Torque.value();
        self.commanded = if is_torque_mode { units } else { 0 };
    }

    fn forget(&mut self) {
        self.offset = 0;
        self.jumps.clear();
        self.commanded = 0;
    }

    fn counts_per_revolution(&self) -> i64 {
        self.firmware.value(Property::Cts).into()
    }

    /// Encoder counts before the offset: quantised toward minus infinity, as Barrett's library rounds.
    fn encoder(&self, angle: f64) -> i64 {
        (angle * self.counts_per_revolution() as f64 / TAU).floor() as i64
    }

    fn position(&self, angle: f64) -> Counts {
        // The cast keeps the low 32 bits, of which the frame takes 22: the position wraps as on the puck.
        let jumped: i64 = self.jumps.iter().map(|jump| i64::from(*jump)).sum();
        Counts((self.encoder(angle) + self.offset + jumped) as i32)
    }
}
