//! The common part of all motor pucks, on the arm and in the hand: power, boot loader, groups, receive buffer, stored
//! properties.
//!
//! A device on top of it says what is special: encoders, torque, commands. Rules: docs/barrett-can.md.

use crate::boot::{Boot, Presence};
use crate::inbox::{Inbox, SET_TIME};
use crate::noise::Noise;
use crate::properties::{Numbers, Values};
use crate::time::Ticks;
use puck::device::{reply16, reply32};
use puck::{
    Action, CanFrame, Destination, Node, Property, PropertyId, PropertyTable, Request, Status, UnknownFirmware,
};

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
    Property::Sg,
    Property::Jp,
];

/// Effect of a frame on a puck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Heard {
    /// Not for this puck, or it has no power.
    Nothing,
    /// It waits in the receive buffer, or was lost there.
    Queued,
    /// A packed torque for this puck, current units: it acts at once.
    Torque(i32),
}

/// The device's task after a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Order {
    /// Nothing but sending this, if there is anything to send.
    Answer(Option<CanFrame>),
    /// Tell the value of a property; the shared part has stored values of most.
    Get {
        /// The property.
        property: Property,
        /// Its number on the wire.
        id: PropertyId,
    },
    /// Change a property that [`Firmware::store`] alone does not cover.
    Set {
        /// The property.
        property: Property,
        /// The new value, cut to the property's width.
        value: i32,
    },
    /// The main firmware begins or ends: state is lost.
    Restarted,
}

/// The shared part of one motor puck.
#[derive(Clone, Debug)]
pub(crate) struct Firmware {
    node: Node,
    boot: Boot,
    inbox: Inbox,
    numbers: Numbers,
    monitor_numbers: Numbers,
    torque_id: Option<PropertyId>,
    monitor_version: i32,
    factory: Values,
    values: Values,
}

impl Firmware {
    /// A puck without power. `factory` holds what it stores, VERS of the main firmware included.
    pub(crate) fn new(
        node: Node,
        monitor_version: i16,
        factory: &[(Property, i32)],
        noise: Noise,
    ) -> Result<Self, UnknownFirmware> {
        let factory = Values::new(factory);
        let table = PropertyTable::motor(factory.of(Property::Vers))?;
        Ok(Self {
            node,
            boot: Boot::new(noise),
            inbox: Inbox::new(SET_TIME),
            numbers: Numbers::new(&table),
            monitor_numbers: Numbers::new(&PropertyTable::monitor()),
            torque_id: table.id(Property::T),
            monitor_version: monitor_version.into(),
            values: factory.clone(),
            factory,
        })
    }

    /// The node number.
    pub(crate) fn node(&self) -> Node {
        self.node
    }

    /// Motor power comes.
    pub(crate) fn power_on(&mut self, now: Ticks) {
        self.boot.start(now);
    }

    /// The main firmware has been running for long.
    pub(crate) fn run(&mut self) {
        self.boot.run();
    }

    /// Motor power goes: what was set is lost.
    pub(crate) fn power_off(&mut self) {
        self.boot.cut();
        self.forget();
    }

    /// True if the main firmware runs at `now`.
    pub(crate) fn is_ready(&self, now: Ticks) -> bool {
        self.boot.presence(now) == Presence::Ready
    }

    /// A request on the bus at time `at`.
    pub(crate) fn receive(&mut self, at: Ticks, request: &Request) -> Heard {
        if !self.listens_to(request.to) {
            return Heard::Nothing;
        }
        let presence = self.boot.presence(at);
        if presence == Presence::Absent {
            return Heard::Nothing;
        }
        match request.action {
            Action::PackedTorques { property, .. } => {
                let place = u8::try_from(self.values.of(Property::Pidx)).unwrap_or(0);
                match request.action.torque_for(place) {
                    Some(torque) if presence == Presence::Ready && Some(property) == self.torque_id => {
                        Heard::Torque(torque.units().into())
                    }
                    _ => Heard::Nothing,
                }
            }
            action => {
                self.inbox.receive(at, action);
                Heard::Queued
            }
        }
    }

    /// When the next request will be done.
    pub(crate) fn next_time(&self) -> Option<Ticks> {
        self.inbox.next_time()
    }

    /// Takes one request that is done by `now`; `None` if there is none.
    pub(crate) fn take(&mut self, now: Ticks) -> Option<Order> {
        let action = self.inbox.take(now)?;
        let presence = self.boot.presence(now);
        let numbers = match presence {
            Presence::Absent => return Some(Order::Answer(None)),
            Presence::Monitor => &self.monitor_numbers,
            Presence::Ready => &self.numbers,
        };
        let (Action::Get { property: id } | Action::Set { property: id, .. }) = action else {
            return Some(Order::Answer(None));
        };
        // No source knows what a puck replies to an unknown property: nothing.
        let Some(property) = numbers.property(id) else {
            return Some(Order::Answer(None));
        };
        let is_ready = presence == Presence::Ready;
        Some(match (action, property) {
            (Action::Set { value, .. }, Property::Stat) => self.set_status(now, is_ready, value),
            (Action::Set { .. }, other) if READ_ONLY.contains(&other) => Order::Answer(None),
            (Action::Set { value, .. }, property) => {
                // P is short by its table, but SET P carries 32 bits.
                let is_wide = property.is_wide() || property == Property::P;
                Order::Set { property, value: if is_wide { value } else { i32::from(value as i16) } }
            }
            (_, Property::Stat) => {
                let status = if is_ready { Status::Ready } else { Status::Reset };
                Order::Answer(Some(self.reply(property, id, status.value())))
            }
            (_, Property::Vers) if !is_ready => Order::Answer(Some(self.reply(property, id, self.monitor_version))),
            _ => Order::Get { property, id },
        })
    }

    /// The reply with the stored value; `None` if the puck has no such property.
    pub(crate) fn answer(&self, property: Property, id: PropertyId) -> Option<CanFrame> {
        Some(self.reply(property, id, self.values.get(property)?))
    }

    /// An ordinary reply as wide as the property.
    pub(crate) fn reply(&self, property: Property, id: PropertyId, value: i32) -> CanFrame {
        // 16-bit values were cut when they were stored, so the cast keeps them.
        if property.is_wide() { reply32(self.node, id, value) } else { reply16(self.node, id, value as i16) }
    }

    /// The stored value of a property, 0 for one the puck has not.
    pub(crate) fn value(&self, property: Property) -> i32 {
        self.values.of(property)
    }

    /// Stores a value.
    pub(crate) fn store(&mut self, property: Property, value: i32) {
        self.values.set(property, value);
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
                .any(|property| self.values.get(*property) == Some(i32::from(group.number()))),
        }
    }

    fn set_status(&mut self, now: Ticks, is_ready: bool, value: i32) -> Order {
        if !is_ready && value == Status::Ready.value() {
            self.boot.wake(now);
        } else if is_ready && value == Status::Reset.value() {
            self.boot.start(now);
        } else {
            return Order::Answer(None);
        }
        self.forget();
        Order::Restarted
    }

    fn forget(&mut self) {
        self.inbox.clear();
        self.values = self.factory.clone();
    }
}
