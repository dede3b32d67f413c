//! The safety module (node 10): its modes, its limits and the state of its pendants.
//!
//! A person at the pendant raises the mode; software can only lower it. Leave 10 ms between two SETs to this node.

use core::fmt;

use crate::bits::appended;
use crate::can::{CanFrame, Node};
use crate::message::set;
use crate::property::{Property, PropertyTable};
use crate::units::{NotFinite, PACKED_TORQUE_LIMIT, Real};

/// MODE of the safety module.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum SafetyMode {
    /// 0: motor power is cut, the pucks vanish from the bus.
    EStop,
    /// 1: the pucks are powered and brake; torques are ignored.
    Idle,
    /// 2: torques are applied.
    Active,
}

impl SafetyMode {
    /// From the value of MODE; `None` for a value that no document names.
    #[must_use]
    pub const fn from_value(value: i32) -> Option<SafetyMode> {
        match value {
            0 => Some(SafetyMode::EStop),
            1 => Some(SafetyMode::Idle),
            2 => Some(SafetyMode::Active),
            _ => None,
        }
    }

    /// The value of MODE.
    #[must_use]
    pub const fn value(self) -> i32 {
        self as i32
    }
}

/// The safety module's judgement of one supervised quantity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Health {
    /// 1: within limits.
    Safe,
    /// 2: beyond the warning limit.
    Warning,
    /// 4: beyond the fault limit.
    Fault,
}

impl Health {
    const fn from_bits(bits: u32) -> Option<Health> {
        match bits & 7 {
            1 => Some(Health::Safe),
            2 => Some(Health::Warning),
            4 => Some(Health::Fault),
            _ => None,
        }
    }

    const fn bits(self) -> u64 {
        match self {
            Health::Safe => 1,
            Health::Warning => 2,
            Health::Fault => 4,
        }
    }
}

/// The button a person holds down on a pendant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub enum Button {
    /// 00: the emergency stop.
    EmergencyStop,
    /// 01: activate.
    Activate,
    /// 10: idle.
    Idle,
    /// 11: none.
    None,
}

/// Both pendants: five supervised quantities, display, lights and buttons. The mode is not among them: read MODE.
///
/// ```
/// use puck::PendantState;
///
/// let all_safe = 1 | 1 << 3 | 1 << 6 | 1 << 9 | 1 << 12;
/// assert!(PendantState::from_value(all_safe)?.all_safe());
/// # Ok::<(), puck::safety::InvalidPendant>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize))]
pub struct PendantState {
    /// Velocity of the arm.
    pub velocity: Health,
    /// Commanded torque.
    pub torque: Health,
    /// Bus voltage.
    pub voltage: Health,
    /// Traffic on the bus.
    pub heartbeat: Health,
    /// Everything else.
    pub other: Health,
    /// Pattern of the seven-segment display (0x3F shows "0"): see [`PendantState::display`].
    pub segments: u8,
    /// The idle light.
    pub idle_light: bool,
    /// The activate light.
    pub activate_light: bool,
    /// The button pressed.
    pub button: Button,
}

/// A pendant word in which a supervised quantity is not exactly one of safe, warning and fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct InvalidPendant;

impl fmt::Display for InvalidPendant {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("pendant word with a field that is not one-hot")
    }
}

impl core::error::Error for InvalidPendant {}

impl PendantState {
    /// From the value of PEN. It needs 28 bits: a 16-bit reply would lose lights, display and buttons.
    ///
    /// # Errors
    /// [`InvalidPendant`] if one of the five three-bit fields is not one-hot.
    pub const fn from_value(value: i32) -> Result<PendantState, InvalidPendant> {
        let bits = value as u32;
        let (Some(velocity), Some(torque), Some(voltage), Some(heartbeat), Some(other)) = (
            Health::from_bits(bits),
            Health::from_bits(bits >> 3),
            Health::from_bits(bits >> 6),
            Health::from_bits(bits >> 9),
            Health::from_bits(bits >> 12),
        ) else {
            return Err(InvalidPendant);
        };
        let button = match (bits >> 26) & 3 {
            0 => Button::EmergencyStop,
            1 => Button::Activate,
            2 => Button::Idle,
            _ => Button::None,
        };
        Ok(PendantState {
            velocity,
            torque,
            voltage,
            heartbeat,
            other,
            segments: (bits >> 16) as u8,
            idle_light: bits & 1 << 24 != 0,
            activate_light: bits & 1 << 25 != 0,
            button,
        })
    }

    /// Device side: the value of PEN.
    #[must_use]
    pub const fn value(&self) -> i32 {
        let button = match self.button {
            Button::EmergencyStop => 0,
            Button::Activate => 1,
            Button::Idle => 2,
            Button::None => 3,
        };
        // From bit 27 down to bit 0; bit 15 is not used.
        let bits = appended(button, 1, self.activate_light as u64);
        let bits = appended(bits, 1, self.idle_light as u64);
        let bits = appended(bits, 8, self.segments as u64);
        let bits = appended(bits, 4, self.other.bits());
        let bits = appended(bits, 3, self.heartbeat.bits());
        let bits = appended(bits, 3, self.voltage.bits());
        let bits = appended(bits, 3, self.torque.bits());
        appended(bits, 3, self.velocity.bits()) as i32
    }

    /// The character on the seven-segment display; `None` for a pattern that no document names.
    #[must_use]
    pub const fn display(&self) -> Option<char> {
        Some(match self.segments {
            0x3F => '0',
            0x06 => '1',
            0x5B => '2',
            0x4F => '3',
            0x66 => '4',
            0x6D => '5',
            0x7D => '6',
            0x07 => '7',
            0x77 => 'A',
            0x79 => 'E',
            0x76 => 'H',
            0x38 => 'L',
            _ => return None,
        })
    }

    /// The five supervised quantities, velocity first.
    #[must_use]
    pub const fn health(&self) -> [Health; 5] {
        [self.velocity, self.torque, self.voltage, self.heartbeat, self.other]
    }

    /// Neither warning nor fault anywhere.
    #[must_use]
    pub fn all_safe(&self) -> bool {
        self.health().iter().all(|health| *health == Health::Safe)
    }

    /// A fault somewhere.
    #[must_use]
    pub fn has_faults(&self) -> bool {
        self.health().contains(&Health::Fault)
    }
}

/// VL1, VL2: counts per m/s (Q4.12).
pub const VELOCITY_UNITS_PER_METRE_PER_SECOND: f64 = 4096.0;

/// Reason for which no limit was encoded.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum LimitError {
    /// The limit is NaN or infinite.
    NotFinite,
    /// The fault limit is not positive, or it rounds to 0, which would switch the supervision off.
    NotPositive,
    /// The warning limit is negative or above the fault limit.
    Order,
    /// The value does not fit into the 16 bits of the property.
    Range,
    /// No torque that can be commanded exceeds the fault limit: the fault could never trip.
    NeverExceeded,
    /// The safety module's firmware has no such property.
    Property,
    /// The IPNM is not positive.
    UnitsPerNewtonMetre,
}

impl fmt::Display for LimitError {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str(match self {
            LimitError::NotFinite => "limit is NaN or infinite",
            LimitError::NotPositive => "fault limit is zero or negative: that would switch the supervision off",
            LimitError::Order => "warning limit is negative or above the fault limit",
            LimitError::Range => "limit does not fit into 16 bits",
            LimitError::NeverExceeded => "no torque that can be commanded exceeds the fault limit: it would never trip",
            LimitError::Property => "the safety module has no such property",
            LimitError::UnitsPerNewtonMetre => "the IPNM is not positive",
        })
    }
}

impl core::error::Error for LimitError {}

impl From<NotFinite> for LimitError {
    fn from(_: NotFinite) -> LimitError {
        LimitError::NotFinite
    }
}

/// Fault and warning limit of the supervised tip velocity, m/s: SET VL2, then SET VL1, 10 ms apart.
///
/// # Errors
/// [`LimitError`]. A fault limit of 0 means "never fault" to the module; it is refused.
pub fn velocity_limits<R: Real>(table: &PropertyTable, fault: R, warning: R) -> Result<[CanFrame; 2], LimitError> {
    let scale = R::from_f64(VELOCITY_UNITS_PER_METRE_PER_SECOND);
    limits(table, [Property::Vl2, Property::Vl1], fault, warning, scale)
}

/// Fault and warning limit of the commanded torque, N m at the motor: SET TL2, then SET TL1, 10 ms apart.
///
/// `units_per_newton_metre` is IPNM of the strictest puck.
///
/// # Errors
/// [`LimitError`]. A fault limit that no packed torque exceeds (8191 units and more) means "never fault" as much as 0;
/// it is refused.
pub fn torque_limits<R: Real>(
    table: &PropertyTable,
    fault: R,
    warning: R,
    units_per_newton_metre: i32,
) -> Result<[CanFrame; 2], LimitError> {
    if units_per_newton_metre <= 0 {
        return Err(LimitError::UnitsPerNewtonMetre);
    }
    let scale = R::from_i32(units_per_newton_metre);
    if fault.is_finite() && (fault * scale).to_i32() >= PACKED_TORQUE_LIMIT as i32 {
        return Err(LimitError::NeverExceeded);
    }
    limits(table, [Property::Tl2, Property::Tl1], fault, warning, scale)
}

/// Both limits in bus units, truncated as the library does, fault first.
fn limits<R: Real>(
    table: &PropertyTable,
    [fault_property, warning_property]: [Property; 2],
    fault: R,
    warning: R,
    scale: R,
) -> Result<[CanFrame; 2], LimitError> {
    if !fault.is_finite() || !warning.is_finite() {
        return Err(LimitError::NotFinite);
    }
    // Its sign is that of the value: what is below one unit is cut to 0.
    let is_negative = warning < R::from_i32(0);
    let (fault, warning) = ((fault * scale).to_i32(), (warning * scale).to_i32());
    if fault <= 0 {
        return Err(LimitError::NotPositive);
    }
    if is_negative || warning > fault {
        return Err(LimitError::Order);
    }
    if fault > i16::MAX as i32 {
        return Err(LimitError::Range);
    }
    let fault_id = table.id(fault_property).ok_or(LimitError::Property)?;
    let warning_id = table.id(warning_property).ok_or(LimitError::Property)?;
    Ok([set(Node::SAFETY_MODULE, fault_id, fault), set(Node::SAFETY_MODULE, warning_id, warning)])
}

/// Ignore the next `count` velocity faults: before positions are rewritten, and before the first poll after a pause.
///
/// # Errors
/// [`LimitError::Property`] if the firmware has no IFAULT.
pub fn ignore_velocity_faults(table: &PropertyTable, count: u8) -> Result<CanFrame, LimitError> {
    let id = table.id(Property::Ifault).ok_or(LimitError::Property)?;
    Ok(set(Node::SAFETY_MODULE, id, count as i32))
}
