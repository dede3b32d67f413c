//! One motor puck of the arm (node 1..7): properties, boot, encoder, torque.
//!
//! The encoder counts `floor(theta CTS / 2 pi) + offset`; SET P chooses the offset, power and wake-up lose it. Torque acts
//! only in MODE 2, is clipped to MT, and stays applied until it is changed or the mode changes (wam-can 4.5: no public
//! source knows of a time-out in the puck). In every other mode the puck shorts its windings and brakes.

use crate::boot::{Boot, Presence};
use crate::inbox::{Inbox, SET_TIME};
use crate::noise::Noise;
use crate::time::Ticks;
use puck::device::{position_frame, reply16, reply32};
use puck::{
    Action, CanFrame, Counts, Destination, Group, MotorMode, Node, Property, PropertyId, PropertyTable, Request, Role,
    Status, UnknownFirmware,
};
use std::collections::BTreeMap;
use std::f64::consts::TAU;

/// What distinguishes the pucks of one arm from those of another.
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
    /// Firmware 200, 4096 counts, and the IPNM and MT that one laboratory fitted to its arm (`wam7.toml` `[arm.drive]`).
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

/// What a puck does to its motor.
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

/// Properties that answer but cannot be written.
const READ_ONLY: &[Property] = &[
    Property::Vers,
    Property::Role,
    Property::Sn,
    Property::Id,
    Property::Error,
    Property::Temp,
    Property::Therm,
    Property::Mech,
    Property::Cts,
];

/// One motor puck.
#[derive(Clone, Debug)]
pub(crate) struct Puck {
    node: Node,
    boot: Boot,
    inbox: Inbox,
    table: PropertyTable,
    monitor_version: i32,
    factory: BTreeMap<Property, i32>,
    values: BTreeMap<Property, i32>,
    offset: i64,
    /// T as the master set it; what acts is clipped to MT.
    commanded: i32,
}

impl Puck {
    /// Motor `index` (0..=6), without power.
    pub(crate) fn new(index: usize, config: &PuckConfig, noise: Noise) -> Result<Self, UnknownFirmware> {
        let node = Node::ARM[index];
        let torque_group = if index < 4 { Group::ARM_TORQUES } else { Group::WRIST_TORQUES };
        let factory: BTreeMap<_, _> = [
            (Property::Vers, i32::from(config.version)),
            (Property::Role, i32::from(Role::MOTOR)),
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
        ]
        .into();
        Ok(Self {
            node,
            boot: Boot::new(noise),
            inbox: Inbox::new(SET_TIME),
            table: PropertyTable::motor(config.version.into())?,
            monitor_version: config.monitor_version.into(),
            values: factory.clone(),
            factory,
            offset: 0,
            commanded: 0,
        })
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        self.boot.start(now);
    }

    /// Motor power goes: the position is lost.
    pub(crate) fn power_off(&mut self) {
        self.boot.cut();
        self.forget();
    }

    /// A request on the bus at time `at`; packed torques act at once, the rest waits its turn.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) {
        let presence = self.boot.presence(at);
        if presence == Presence::Absent || !self.listens_to(request.to) {
            return;
        }
        match request.action {
            Action::PackedTorques { property, .. } => {
                let place = self.values.get(&Property::Pidx).and_then(|place| u8::try_from(*place).ok());
                let torque = place.and_then(|place| request.action.torque_for(place));
                if presence == Presence::Ready
                    && self.table.property(property) == Some(Property::T)
                    && let Some(torque) = torque
                {
                    self.command(torque.units().into());
                }
            }
            action => self.inbox.receive(at, action),
        }
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.inbox.next_time()
    }

    /// Carries out one request that is done by `now`, with the motor at `angle` (rad); the reply, if there is one.
    pub(crate) fn step(&mut self, now: Ticks, angle: f64) -> Option<CanFrame> {
        let action = self.inbox.take(now)?;
        let (table, presence) = match self.boot.presence(now) {
            Presence::Absent => return None,
            Presence::Monitor => (PropertyTable::monitor(), Presence::Monitor),
            Presence::Ready => (self.table, Presence::Ready),
        };
        match action {
            Action::Get { property: id } => self.reply(table.property(id)?, id, presence, angle),
            Action::Set { property: id, value } => {
                self.set(now, table.property(id)?, value, presence, angle);
                None
            }
            Action::PackedTorques { .. } => None,
        }
    }

    /// What the puck does to its motor at `now`.
    pub(crate) fn drive(&self, now: Ticks) -> Drive {
        let value = |property| self.values.get(&property).copied().unwrap_or(0);
        if self.boot.presence(now) != Presence::Ready || value(Property::Mode) != MotorMode::Torque.value() {
            return Drive::Brake;
        }
        let limit = value(Property::Mt).max(0);
        Drive::Torque(self.commanded.clamp(-limit, limit))
    }

    /// Requests lost to a full receive buffer.
    pub(crate) fn lost_requests(&self) -> u64 {
        self.inbox.lost()
    }

    fn listens_to(&self, to: Destination) -> bool {
        match to {
            Destination::Node(node) => node == self.node,
            Destination::Group(group) => [Property::Grpa, Property::Grpb, Property::Grpc]
                .iter()
                .any(|property| self.values.get(property) == Some(&i32::from(group.number()))),
        }
    }

    fn reply(&self, property: Property, id: PropertyId, presence: Presence, angle: f64) -> Option<CanFrame> {
        let value = match property {
            Property::P => return Some(position_frame(self.node, self.position(angle), None)),
            Property::Stat if presence == Presence::Ready => Status::Ready.value(),
            Property::Stat => Status::Reset.value(),
            Property::Vers if presence == Presence::Monitor => self.monitor_version,
            Property::T => self.commanded,
            Property::Mech => self.encoder(angle).rem_euclid(self.counts_per_revolution()) as i32,
            other => *self.values.get(&other)?,
        };
        // 16-bit values were truncated when they were stored, so the cast keeps them.
        Some(if property.is_wide() { reply32(self.node, id, value) } else { reply16(self.node, id, value as i16) })
    }

    fn set(&mut self, now: Ticks, property: Property, value: i32, presence: Presence, angle: f64) {
        let value = if property.is_wide() || property == Property::P { value } else { i32::from(value as i16) };
        match property {
            Property::Stat if presence == Presence::Monitor && value == Status::Ready.value() => {
                self.boot.wake(now);
                self.forget();
                // The encoder counter starts at zero with the main firmware.
                self.offset = -self.encoder(angle);
            }
            Property::Stat if presence == Presence::Ready && value == Status::Reset.value() => {
                self.boot.start(now);
                self.forget();
            }
            Property::Stat => {}
            Property::P => self.offset = i64::from(value) - self.encoder(angle),
            Property::T => self.command(value),
            Property::Mode => {
                self.commanded = 0;
                self.values.insert(Property::Mode, value);
            }
            other if READ_ONLY.contains(&other) => {}
            other => {
                if let Some(stored) = self.values.get_mut(&other) {
                    *stored = value;
                }
            }
        }
    }

    fn command(&mut self, units: i32) {
        let is_torque_mode = self.values.get(&Property::Mode) == Some(&MotorMode::Torque.value());
        self.commanded = if is_torque_mode { units } else { 0 };
    }

    fn forget(&mut self) {
        self.inbox.clear();
        self.values = self.factory.clone();
        self.offset = 0;
        self.commanded = 0;
    }

    fn counts_per_revolution(&self) -> i64 {
        self.values.get(&Property::Cts).copied().unwrap_or(4096).into()
    }

    /// Encoder counts before the offset: quantised toward minus infinity, as Barrett's library rounds.
    fn encoder(&self, angle: f64) -> i64 {
        (angle * self.counts_per_revolution() as f64 / TAU).floor() as i64
    }

    fn position(&self, angle: f64) -> Counts {
        // The cast keeps the low 32 bits, of which the frame takes 22: the position wraps as on the puck.
        Counts((self.encoder(angle) + self.offset) as i32)
    }
}
