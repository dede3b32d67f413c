//! Values on the bus in words and SI units, by what they are values of.

use puck::hand::HandCommand;
use puck::safety::{Button, Health};
use puck::{MotorMode, Node, PendantState, Property, PropertyId, Role, SafetyMode, Status, gauge};
use schemars::JsonSchema;
use serde::Serialize;

use crate::puck_state::PuckState;

/// One number off the bus with what it means.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Reading {
    /// The member of several values that it is, e.g. `x` or `M3`; empty if it stands alone.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub of: &'static str,
    /// The integer as sent.
    pub raw: i64,
    /// Its value in the unit below.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub value: Option<f64>,
    /// SI unit or degC; empty for plain numbers.
    #[serde(skip_serializing_if = "str::is_empty")]
    pub unit: &'static str,
    /// The name of the value, if it has one.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub word: Option<String>,
    /// The unit of the integer, for people.
    #[serde(skip)]
    pub raw_unit: &'static str,
    /// Decimals that mean something.
    #[serde(skip)]
    pub decimals: usize,
    /// The integer is a field of bits.
    #[serde(skip)]
    pub bits: bool,
}

impl Reading {
    /// A plain number.
    #[must_use]
    pub fn plain(raw: i64) -> Self {
        Self { of: "", raw, value: None, unit: "", word: None, raw_unit: "", decimals: 0, bits: false }
    }

    /// A number with a name.
    #[must_use]
    pub fn named(raw: i64, word: impl Into<String>) -> Self {
        Self { word: Some(word.into()), ..Self::plain(raw) }
    }

    /// A number with a physical value.
    #[must_use]
    pub fn physical(raw: i64, raw_unit: &'static str, value: f64, unit: &'static str, decimals: usize) -> Self {
        Self { value: Some(value), unit, raw_unit, decimals, ..Self::plain(raw) }
    }

    /// The same as one of several.
    #[must_use]
    pub fn of(self, of: &'static str) -> Self {
        Self { of, ..self }
    }
}

impl std::fmt::Display for Reading {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if !self.of.is_empty() {
            write!(f, "{} ", self.of)?;
        }
        match (&self.word, self.value) {
            (Some(word), _) if self.bits => write!(f, "{word} ({:#X})", self.raw),
            (Some(word), _) => write!(f, "{word} ({})", self.raw),
            (None, Some(value)) if self.raw_unit.is_empty() => write!(f, "{value:.*} {}", self.decimals, self.unit),
            (None, Some(value)) => {
                write!(f, "{} {} ({value:.*} {})", self.raw, self.raw_unit, self.decimals, self.unit)
            }
            (None, None) if self.raw_unit.is_empty() => write!(f, "{}", self.raw),
            (None, None) => write!(f, "{} {}", self.raw, self.raw_unit),
        }
    }
}

/// Counts of a motor's encoder.
#[must_use]
pub(super) fn counts(puck: &PuckState, raw: i32) -> Reading {
    Reading::physical(raw.into(), "counts", f64::from(raw) * puck.radian_per_count(), "rad", 4)
}

/// Torque of a motor in current units.
#[must_use]
pub(super) fn torque(puck: &PuckState, raw: i32) -> Reading {
    match puck.units_per_newton_metre() {
        Some(units) => Reading::physical(raw.into(), "units", f64::from(raw) / f64::from(units), "N m", 4),
        None => Reading { raw_unit: "units", ..Reading::plain(raw.into()) },
    }
}

/// The value of a property of a node.
#[must_use]
pub(super) fn reading(node: Node, puck: &PuckState, property: Property, raw: i32) -> Reading {
    let number = i64::from(raw);
    let named = |word: Option<&'static str>| word.map_or(Reading::plain(number), |word| Reading::named(number, word));
    let safety = node == Node::SAFETY_MODULE;
    match property {
        Property::Stat => named(Status::from_value(raw).map(|status| match status {
            Status::Reset => "RESET: boot loader",
            Status::Error => "ERROR",
            Status::Ready => "READY",
        })),
        Property::Mode if safety => named(SafetyMode::from_value(raw).map(|mode| match mode {
            SafetyMode::EStop => "E-STOP",
            SafetyMode::Idle => "IDLE",
            SafetyMode::Active => "ACTIVE",
        })),
        Property::Mode => named(MotorMode::from_value(raw).map(|mode| match mode {
            MotorMode::Idle => "IDLE",
            MotorMode::Duty => "DUTY",
            MotorMode::Torque => "TORQUE",
            MotorMode::Position => "PID",
            MotorMode::Velocity => "VELOCITY",
            MotorMode::Trapezoidal => "TRAPEZOIDAL",
        })),
        Property::Role => Reading { bits: true, ..Reading::named(number, role(Role::from_value(raw))) },
        Property::Pen => Reading { bits: true, ..Reading::named(number, pendant(raw)) },
        Property::Zero => named(match raw {
            0 => Some("not zeroed"),
            1 => Some("zeroed"),
            _ => None,
        }),
        Property::Ifault => Reading::named(number, format!("ignore the next {raw} velocity faults")),
        Property::Cmd => named(command(raw)),
        Property::Tact => named(["off", "top ten", "full", "tare"].get(raw as usize).copied()),
        Property::Ft if raw == 0 => Reading::named(number, "tare"),
        Property::Hold => named(["release after a move", "hold after a move"].get(raw as usize).copied()),
        Property::Def | Property::Load | Property::Save | Property::Find => {
            let which = u8::try_from(raw).ok().and_then(PropertyId::new).and_then(|id| puck.property(id));
            named(which.map(Property::mnemonic))
        }
        Property::P
        | Property::E
        | Property::Dp
        | Property::Ot
        | Property::Ct
        | Property::M
        | Property::Ds
        | Property::Mech
        | Property::Ioff => counts(puck, raw),
        Property::Jp | Property::Jofst | Property::Cts => Reading { raw_unit: "counts", ..Reading::plain(number) },
        Property::T | Property::Mt => torque(puck, raw),
        Property::Ipnm => Reading { raw_unit: "units per N m", ..Reading::plain(number) },
        Property::V | Property::Vcmd | Property::Mv | Property::Mcv | Property::Mov | Property::Ivel if !safety => {
            Reading::physical(number, "counts/ms", f64::from(raw) * 1000.0 * puck.radian_per_count(), "rad/s", 2)
        }
        Property::Temp | Property::Ptemp | Property::Otemp | Property::Therm => {
            Reading { raw_unit: "degC", ..Reading::plain(number) }
        }
        Property::Sg => Reading::physical(number, "counts", gauge::torque(f64::from(raw)), "N m nominal", 3),
        Property::Vl1 | Property::Vl2 => Reading::physical(number, "units", f64::from(raw) / 4096.0, "m/s", 3),
        Property::Tl1 | Property::Tl2 => Reading { raw_unit: "units", ..Reading::plain(number) },
        Property::Voltl1 | Property::Voltl2 | Property::Volth1 | Property::Volth2 => {
            Reading { raw_unit: "V", ..Reading::plain(number) }
        }
        Property::Tstop => Reading { raw_unit: "ms", ..Reading::plain(number) },
        _ => Reading::plain(number),
    }
}

fn role(role: Role) -> String {
    const KINDS: [&str; 7] = ["motor", "gimbals", "safety", "wraptor", "trigger", "hand", "force/torque"];
    let mut text =
        KINDS.get(usize::from(role.kind())).map_or_else(|| format!("kind {}", role.kind()), ToString::to_string);
    for (has, option) in [
        (role.has_magnetic_encoder(), "magnetic encoder"),
        (role.has_strain_gauge(), "strain gauge"),
        (role.has_tactile_array(), "tactile"),
        (role.has_joint_encoder(), "joint encoder"),
    ] {
        if has {
            text = format!("{text}, {option}");
        }
    }
    text
}

/// Lights, display, button, and everything that is not safe.
fn pendant(raw: i32) -> String {
    let Ok(pendant) = PendantState::from_value(raw) else {
        return "unreadable".to_owned();
    };
    let mut text = match (pendant.activate_light, pendant.idle_light) {
        (true, _) => "lit active".to_owned(),
        (false, true) => "lit idle".to_owned(),
        (false, false) => "dark".to_owned(),
    };
    if let Some(display) = pendant.display() {
        text += &format!(", shows {display}");
    }
    match pendant.button {
        Button::None => {}
        Button::EmergencyStop => text += ", E-stop pressed",
        Button::Activate => text += ", Activate pressed",
        Button::Idle => text += ", Idle pressed",
    }
    const SUPERVISED: [&str; 5] = ["velocity", "torque", "voltage", "heartbeat", "other"];
    for (quantity, health) in SUPERVISED.iter().zip(pendant.health()) {
        match health {
            Health::Safe => {}
            Health::Warning => text += &format!(", {quantity} WARNING"),
            Health::Fault => text += &format!(", {quantity} FAULT"),
        }
    }
    if pendant.all_safe() { text + ", all safe" } else { text }
}

fn command(raw: i32) -> Option<&'static str> {
    const COMMANDS: [(HandCommand, &str); 9] = [
        (HandCommand::Initialise, "HI: initialise"),
        (HandCommand::IncrementClose, "IC: close a step"),
        (HandCommand::IncrementOpen, "IO: open a step"),
        (HandCommand::TorqueClose, "TC: close with torque"),
        (HandCommand::TorqueOpen, "TO: open with torque"),
        (HandCommand::Close, "C: close"),
        (HandCommand::Move, "M: move to the default position"),
        (HandCommand::Open, "O: open"),
        (HandCommand::Terminate, "T: terminate"),
    ];
    COMMANDS.iter().find(|(command, _)| *command as i32 == raw).map(|(_, word)| *word)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn text(node: Node, property: Property, raw: i32) -> String {
        reading(node, &PuckState::new(node), property, raw).to_string()
    }

    #[test]
    fn values_are_told_in_words_and_si_units() {
        let [m1, ..] = Node::ARM;
        assert_eq!(text(m1, Property::Mode, 2), "TORQUE (2)");
        assert_eq!(text(Node::SAFETY_MODULE, Property::Mode, 2), "ACTIVE (2)");
        assert_eq!(text(m1, Property::Stat, 0), "RESET: boot loader (0)");
        assert_eq!(text(m1, Property::P, 4096), "4096 counts (6.2832 rad)");
        assert_eq!(text(m1, Property::T, 100), "100 units");
        assert_eq!(text(Node::SAFETY_MODULE, Property::Vl2, 4096), "4096 units (1.000 m/s)");
        assert_eq!(text(Node::SAFETY_MODULE, Property::Pen, 0x0F3F_1249), "lit active, shows 0, all safe (0xF3F1249)");
        assert_eq!(text(Node::HAND[0], Property::Cmd, 13), "HI: initialise (13)");
        assert_eq!(text(Node::HAND[0], Property::Role, 0x0A05), "hand, magnetic encoder, strain gauge (0xA05)");
        assert_eq!(text(Node::SAFETY_MODULE, Property::Def, 45), "VL1 (45)");
        assert_eq!(text(m1, Property::Mode, 9), "9");
        assert_eq!(text(m1, Property::Tact, -1), "-1");
    }

    #[test]
    fn a_torque_has_newton_metres_once_the_puck_has_told_its_scale() {
        let [m1, ..] = Node::ARM;
        let mut puck = PuckState::new(m1);
        puck.told(Property::Ipnm, 2700);
        assert_eq!(reading(m1, &puck, Property::T, -270).to_string(), "-270 units (-0.1000 N m)");
    }
}
