//! Frames of the arm's bus to sentences: who says what to whom.
//!
//! A frame alone does not tell what its number means: the firmware of the puck decides, and the puck tells that in
//! other frames. So the decoder must see the frames in order; [`PuckState`] keeps what they have told.

use puck::{
    Action, CanFrame, Counts, Destination, Group, Node, Property, PropertyId, Reply, ReplyError, Request, RequestError,
    force_torque, tactile,
};
use schemars::JsonSchema;
use serde::Serialize;

use crate::candump::AnyFrame;
use crate::names;
use crate::puck_state::PuckState;
use crate::value::{self, Reading};

/// Nodes that the address field can name.
const NODES: usize = 32;

/// The kind of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The host asks for a property.
    Get,
    /// The host sets a property.
    Set,
    /// Torques for up to four motors.
    Torques,
    /// Position of a motor.
    Position,
    /// Position of a secondary encoder alone.
    SecondaryPosition,
    /// Value of a property.
    Property,
    /// Force of the sensor.
    Force,
    /// Torque of the sensor.
    Torque,
    /// Acceleration of the sensor.
    Acceleration,
    /// Tactile cells.
    Tactile,
    /// The safety module to all motors.
    SafetyBroadcast,
    /// The link on the host's bus.
    Link,
    /// A report of the controller about errors.
    Error,
    /// Nothing that has a place on this bus.
    Unknown,
}

impl Kind {
    /// All kinds, in the order of a summary.
    pub const ALL: [Self; 14] = [
        Self::Get,
        Self::Set,
        Self::Torques,
        Self::Position,
        Self::SecondaryPosition,
        Self::Property,
        Self::Force,
        Self::Torque,
        Self::Acceleration,
        Self::Tactile,
        Self::SafetyBroadcast,
        Self::Link,
        Self::Error,
        Self::Unknown,
    ];

    /// The name for people.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Get => "GET",
            Self::Set => "SET",
            Self::Torques => "packed torques",
            Self::Position => "position",
            Self::SecondaryPosition => "secondary position",
            Self::Property => "property",
            Self::Force => "force",
            Self::Torque => "torque",
            Self::Acceleration => "acceleration",
            Self::Tactile => "tactile",
            Self::SafetyBroadcast => "safety broadcast",
            Self::Link => "host link",
            Self::Error => "error",
            Self::Unknown => "unknown",
        }
    }
}

/// The meaning of a frame.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Meaning {
    /// Its kind.
    pub kind: Kind,
    /// Who sends it.
    pub from: String,
    /// Whom it is for.
    pub to: String,
    /// Barrett's mnemonic of the property it is about.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub property: Option<&'static str>,
    /// The values it carries.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub values: Vec<Reading>,
    /// More in words: a status, or why it is unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub remark: Option<String>,
}

impl Meaning {
    fn new(kind: Kind, from: impl Into<String>, to: impl Into<String>) -> Self {
        Self { kind, from: from.into(), to: to.into(), property: None, values: Vec::new(), remark: None }
    }

    /// A frame that has no meaning here.
    pub(super) fn unknown(from: impl Into<String>, to: impl Into<String>, why: impl Into<String>) -> Self {
        Self { remark: Some(why.into()), ..Self::new(Kind::Unknown, from, to) }
    }

    /// The same frame with something to add.
    pub(super) fn remark(self, remark: impl Into<String>) -> Self {
        Self { remark: Some(remark.into()), ..self }
    }

    /// Segments of the link.
    pub(super) fn link(from: impl Into<String>, to: impl Into<String>, remark: String) -> Self {
        Self::new(Kind::Link, from, to).remark(remark)
    }

    /// The content in one phrase.
    #[must_use]
    pub fn sentence(&self) -> String {
        let values: Vec<String> = self.values.iter().map(ToString::to_string).collect();
        let values = values.join(", ");
        let property = self.property.unwrap_or("");
        let text = match self.kind {
            Kind::Get => format!("GET {property}"),
            Kind::Set => format!("SET {property} = {values}"),
            Kind::Property => format!("{property} = {values}"),
            Kind::Link | Kind::Error | Kind::Unknown => String::new(),
            kind => format!("{} {values}", kind.name()),
        };
        match (&self.remark, self.kind) {
            (Some(remark), Kind::Unknown) => format!("unknown: {remark}"),
            (Some(remark), _) if text.is_empty() => remark.clone(),
            (Some(remark), _) => format!("{text} ({remark})"),
            (None, _) => text.trim_end().to_owned(),
        }
    }

    /// True if everything in the frame has a name.
    #[must_use]
    pub fn is_named(&self) -> bool {
        let needs_property = matches!(self.kind, Kind::Get | Kind::Set | Kind::Property);
        self.kind != Kind::Unknown && (!needs_property || self.property.is_some())
    }
}

/// Reads frames of the arm's bus in their order.
#[derive(Debug, Clone)]
pub struct Decoder {
    pucks: [PuckState; NODES],
}

impl Default for Decoder {
    fn default() -> Self {
        let node = |number: usize| Node::new(number as u8).unwrap_or(Node::HOST);
        Self { pucks: std::array::from_fn(|number| PuckState::new(node(number))) }
    }
}

impl Decoder {
    /// Everything known of a node.
    #[must_use]
    pub fn puck(&self, node: Node) -> &PuckState {
        // Node numbers end at 31.
        &self.pucks[usize::from(node.number()) % NODES]
    }

    fn puck_mut(&mut self, node: Node) -> &mut PuckState {
        &mut self.pucks[usize::from(node.number()) % NODES]
    }

    /// Who answers for a group: its members share one firmware.
    fn speaker(to: Destination) -> Node {
        match to {
            Destination::Node(node) => node,
            Destination::Group(group) => names::members(group).first().copied().unwrap_or(Node::HOST),
        }
    }

    /// Reads the next frame, of any kind.
    pub fn read(&mut self, frame: &AnyFrame) -> Meaning {
        let nobody = "?";
        match frame {
            AnyFrame::Data(frame) => self.data(frame),
            AnyFrame::Extended { .. } => Meaning::unknown(nobody, nobody, "29-bit identifier: not Barrett's protocol"),
            AnyFrame::Remote { .. } => Meaning::unknown(nobody, nobody, "remote frame: not Barrett's protocol"),
            AnyFrame::FlexibleRate { .. } => Meaning::unknown(nobody, nobody, "CAN FD frame: not Barrett's protocol"),
            AnyFrame::Error { class, data } => {
                Meaning::new(Kind::Error, "controller", "host").remark(errors(*class, data))
            }
        }
    }

    fn data(&mut self, frame: &CanFrame) -> Meaning {
        let id = frame.can_id();
        let (from, to) = (names::node(id.sender()), names::destination(id.destination()));
        if id.sender() == Node::HOST {
            return match Request::decode(frame) {
                Ok(request) => self.request(&request, from, to),
                Err(RequestError::ReplyGroup) => Meaning::unknown(from, to, "a request to a group for replies"),
                Err(error) => Meaning::unknown(from, to, error.to_string()),
            };
        }
        match Reply::decode(frame) {
            Ok(Reply::SafetyBroadcast) => match Request::decode(frame) {
                Ok(request) => Meaning { kind: Kind::SafetyBroadcast, ..self.request(&request, from, to) },
                Err(_) => Meaning::new(Kind::SafetyBroadcast, from, to).remark("payload is not documented"),
            },
            Ok(reply) => self.reply(&reply, from, to),
            Err(ReplyError::ToNode) => Meaning::unknown(from, to, "a device that speaks to a node"),
            Err(error) => Meaning::unknown(from, to, error.to_string()),
        }
    }

    fn request(&mut self, request: &Request, from: String, to: String) -> Meaning {
        let speaker = Self::speaker(request.to);
        match request.action {
            Action::Get { property } => self.with_property(Meaning::new(Kind::Get, from, to), speaker, property),
            Action::Set { property: id, value } => {
                let mut meaning = self.with_property(Meaning::new(Kind::Set, from, to), speaker, id);
                let property = self.puck(speaker).property(id);
                meaning.values = vec![match property {
                    Some(property) => value::reading(speaker, self.puck(speaker), property, value),
                    None => Reading::plain(value.into()),
                }];
                if let Some(property) = property {
                    let one;
                    let nodes = match request.to {
                        Destination::Node(node) => {
                            one = [node];
                            &one
                        }
                        Destination::Group(group) => names::members(group),
                    };
                    nodes.iter().for_each(|node| self.puck_mut(*node).given(property, value));
                }
                meaning
            }
            Action::PackedTorques { torques, property } => {
                const NAMES: [[&str; 4]; 3] =
                    [["M1", "M2", "M3", "M4"], ["M5", "M6", "M7", "-"], ["F1", "F2", "F3", "spread"]];
                let (group, names) = match request.to {
                    Destination::Group(Group::ARM_TORQUES) => (Group::ARM_TORQUES, NAMES[0]),
                    Destination::Group(Group::WRIST_TORQUES) => (Group::WRIST_TORQUES, NAMES[1]),
                    Destination::Group(Group::HAND) => (Group::HAND, NAMES[2]),
                    _ => return Meaning::unknown(from, to, "packed torques to a group that takes none"),
                };
                let mut meaning = Meaning::new(Kind::Torques, from, to);
                meaning.property = self.puck(speaker).property(property).map(Property::mnemonic);
                if meaning.property != Some(Property::T.mnemonic()) {
                    meaning = meaning.remark(format!("property {} instead of T", property.number()));
                }
                let members = names::members(group).iter().zip(torques).zip(names);
                meaning.values = members
                    .map(|((node, torque), name)| value::torque(self.puck(*node), torque.units().into()).of(name))
                    .collect();
                meaning
            }
        }
    }

    fn reply(&mut self, reply: &Reply, from: String, to: String) -> Meaning {
        let wrench = |kind, counts: [i16; 3], unit: f64, name| {
            let mut meaning = Meaning::new(kind, &*from, &*to);
            let axes = ["x", "y", "z"].into_iter().zip(counts).zip(force_torque::scaled_counts(counts, unit));
            meaning.values =
                axes.map(|((axis, raw), value)| Reading::physical(raw.into(), "", value, name, 3).of(axis)).collect();
            meaning
        };
        match *reply {
            Reply::Property { node, property: id, value } => {
                let mut meaning = self.with_property(Meaning::new(Kind::Property, from, to), node, id);
                let property = self.puck(node).property(id);
                if let Some(property) = property {
                    self.puck_mut(node).told(property, value);
                }
                meaning.values = vec![match property {
                    Some(property) => value::reading(node, self.puck(node), property, value),
                    None => Reading::plain(value.into()),
                }];
                meaning
            }
            Reply::Position { node, primary, secondary } => {
                let mut meaning = Meaning::new(Kind::Position, from, to);
                meaning.values.push(value::counts(self.puck(node), primary.0));
                meaning.values.extend(secondary.map(secondary_counts));
                meaning
            }
            Reply::SecondaryPosition { secondary, .. } => {
                let mut meaning = Meaning::new(Kind::SecondaryPosition, from, to);
                meaning.values.push(secondary_counts(secondary));
                meaning
            }
            Reply::Force { counts, status, .. } => {
                with_status(wrench(Kind::Force, counts, force_torque::NEWTON_PER_COUNT, "N"), status)
            }
            Reply::Torque { counts, status, .. } => {
                with_status(wrench(Kind::Torque, counts, force_torque::NEWTON_METRE_PER_COUNT, "N m"), status)
            }
            Reply::Acceleration { counts, status, .. } => {
                let unit = force_torque::ACCELERATION_PER_COUNT;
                with_status(wrench(Kind::Acceleration, counts, unit, "m/s^2 (unverified)"), status)
            }
            Reply::TactileFull { block, .. } => {
                let first = usize::from(block.sequence) * 5;
                let mut meaning = Meaning::new(Kind::Tactile, from, to)
                    .remark(format!("cells {first} to {}", first + block.cell_count() - 1));
                let pressures = block.cells.into_iter().zip(block.pressures::<f64>()).take(block.cell_count());
                meaning.values =
                    pressures.map(|(raw, value)| Reading::physical(raw.into(), "", value, "N/cm^2", 2)).collect();
                meaning
            }
            Reply::TactileTop { top, .. } => {
                let mut meaning = Meaning::new(Kind::Tactile, from, to).remark(format!(
                    "highest of {}, map {:06X}",
                    tactile::CELLS,
                    top.map
                ));
                let physical = |raw: u8| Reading::physical(raw.into(), "", raw.into(), "N/cm^2", 0);
                meaning.values = top.values.into_iter().map(physical).collect();
                meaning
            }
            // Read as a request before it came here.
            Reply::SafetyBroadcast => Meaning::new(Kind::SafetyBroadcast, from, to),
        }
    }

    fn with_property(&self, meaning: Meaning, node: Node, id: PropertyId) -> Meaning {
        match self.puck(node).property(id) {
            Some(property) => Meaning { property: Some(property.mnemonic()), ..meaning },
            None => {
                let version = self.puck(node).version().map_or("unknown".to_owned(), |version| version.to_string());
                meaning.remark(format!("property {}, which firmware {version} has not", id.number()))
            }
        }
    }
}

fn secondary_counts(secondary: Counts) -> Reading {
    Reading { raw_unit: "counts", ..Reading::plain(secondary.0.into()) }.of("secondary")
}

fn with_status(meaning: Meaning, status: Option<puck::GaugeStatus>) -> Meaning {
    let Some(status) = status else {
        return meaning;
    };
    let mut words = Vec::new();
    if status.is_bad() {
        words.push("data are bad".to_owned());
    }
    if status.saturated_gauges() != 0 {
        let gauges: Vec<String> =
            (0..6).filter(|bit| status.saturated_gauges() >> bit & 1 == 1).map(|bit| (bit + 1).to_string()).collect();
        words.push(format!("saturated since the tare: gauge {}", gauges.join(", ")));
    }
    if status.suggests_tare() {
        words.push("tare again".to_owned());
    }
    if words.is_empty() { meaning } else { meaning.remark(words.join("; ")) }
}

/// The complaints of the controller: the classes of Linux' `can/error.h`.
fn errors(class: u32, data: &[u8]) -> String {
    const CLASSES: [&str; 10] = [
        "transmit time-out",
        "lost arbitration",
        "controller",
        "protocol violation",
        "transceiver",
        "no acknowledgement",
        "bus-off",
        "bus error",
        "restarted",
        "error counters",
    ];
    let names = CLASSES.iter().enumerate().filter(|(bit, _)| class >> bit & 1 == 1).map(|(_, name)| *name);
    let mut text = names.collect::<Vec<_>>().join(", ");
    if text.is_empty() {
        text = format!("class {class:#x}");
    }
    const STATES: [&str; 7] = [
        "receive overflow",
        "transmit overflow",
        "receive warning",
        "transmit warning",
        "receive passive",
        "transmit passive",
        "active again",
    ];
    if class & 4 != 0 {
        let states = data.get(1).copied().unwrap_or(0);
        let states = STATES.iter().enumerate().filter(|(bit, _)| states >> bit & 1 == 1).map(|(_, name)| *name);
        text = format!("{text}: {}", states.collect::<Vec<_>>().join(", "));
    }
    format!("error frame: {text}")
}
