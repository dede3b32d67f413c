//! The state of one puck as a log has shown it so far: its firmware and its scales. Numbers of properties mean nothing
//! without it.

use puck::{Node, Property, PropertyId, PropertyTable, Role, Status};

/// Firmware that is assumed until a puck has told its own: the newest that Barrett's programs ask for.
pub const ASSUMED_FIRMWARE: i32 = 200;

/// Encoder counts per revolution until a puck has told its own.
const ASSUMED_COUNTS: i32 = 4096;

/// One puck as far as its frames have told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct PuckState {
    node: Node,
    status: Option<Status>,
    version: Option<i32>,
    counts_per_revolution: Option<i32>,
    units_per_newton_metre: Option<i32>,
    role: Option<Role>,
}

impl PuckState {
    /// A puck of which nothing is known but its number.
    #[must_use]
    pub const fn new(node: Node) -> Self {
        Self {
            node,
            status: None,
            version: None,
            counts_per_revolution: None,
            units_per_newton_metre: None,
            role: None,
        }
    }

    /// The properties it has now.
    #[must_use]
    pub fn table(&self) -> PropertyTable {
        if self.status == Some(Status::Reset) {
            return PropertyTable::monitor();
        }
        let version = self.version.unwrap_or(ASSUMED_FIRMWARE);
        let table = match (self.node, self.role.map(Role::kind)) {
            // Sensors may report no usable role: the number decides.
            (Node::FORCE_TORQUE, _) => return PropertyTable::force_torque(),
            (Node::SAFETY_MODULE, _) | (_, Some(Role::SAFETY)) => PropertyTable::safety,
            _ => PropertyTable::motor,
        };
        // A version that no table covers is told as the number it is; its properties are read as if it were newest. By
        // the table of the boot loader MODE would be told as LOCK.
        table(version).or_else(|_| table(ASSUMED_FIRMWARE)).unwrap_or(PropertyTable::monitor())
    }

    /// The property with this number. What the boot loader has not is looked up as if the main firmware ran: one may
    /// be addressed while it wakes.
    #[must_use]
    pub fn property(&self, id: PropertyId) -> Option<Property> {
        self.table().property(id).or_else(|| Self { status: None, ..*self }.table().property(id))
    }

    /// Takes note of a value that the puck has told.
    pub fn told(&mut self, property: Property, value: i32) {
        match property {
            Property::Stat => self.status = Status::from_value(value),
            // The boot loader tells its own version, which says nothing of the firmware.
            Property::Vers if self.status != Some(Status::Reset) => self.version = Some(value),
            Property::Role => self.role = Some(Role::from_value(value)),
            Property::Cts if value > 0 => self.counts_per_revolution = Some(value),
            Property::Ipnm if value > 0 => self.units_per_newton_metre = Some(value),
            _ => {}
        }
    }

    /// Takes note of a value that the puck was given.
    pub fn given(&mut self, property: Property, value: i32) {
        match property {
            // It goes quiet and comes back as something else: it will say what.
            Property::Stat if Status::from_value(value) != self.status => self.status = None,
            Property::Cts if value > 0 => self.counts_per_revolution = Some(value),
            Property::Ipnm if value > 0 => self.units_per_newton_metre = Some(value),
            _ => {}
        }
    }

    /// Its firmware, if it has told.
    #[must_use]
    pub const fn version(&self) -> Option<i32> {
        self.version
    }

    /// Radian of the motor per encoder count.
    #[must_use]
    pub fn radian_per_count(&self) -> f64 {
        std::f64::consts::TAU / f64::from(self.counts_per_revolution.unwrap_or(ASSUMED_COUNTS))
    }

    /// Torque units per N m at the motor, if it has told.
    #[must_use]
    pub const fn units_per_newton_metre(&self) -> Option<i32> {
        self.units_per_newton_metre
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn puck(tell: &[(Property, i32)]) -> PuckState {
        let mut puck = PuckState::new(Node::ARM[0]);
        for (property, value) in tell {
            puck.told(*property, *value);
        }
        puck
    }

    fn name(puck: &PuckState, number: u8) -> Option<&'static str> {
        puck.property(PropertyId::new(number)?).map(Property::mnemonic)
    }

    #[test]
    fn number_77_is_hold_on_new_firmware_and_en_on_old() {
        assert_eq!(name(&puck(&[(Property::Stat, 2), (Property::Vers, 190)]), 77), Some("HOLD"));
        assert_eq!(name(&puck(&[(Property::Stat, 2), (Property::Vers, 130)]), 77), Some("EN"));
    }

    #[test]
    fn firmware_that_no_table_covers_is_read_as_the_newest_and_not_as_the_boot_loader() {
        let unknown = puck(&[(Property::Stat, 2), (Property::Vers, 300)]);
        assert_eq!(
            (name(&unknown, 8), name(&unknown, 48), name(&unknown, 77)),
            (Some("MODE"), Some("P"), Some("HOLD"))
        );
        assert_eq!(unknown.version(), Some(300));
    }

    #[test]
    fn the_version_of_the_boot_loader_is_not_that_of_the_firmware() {
        let mut sleeping = puck(&[(Property::Stat, 0), (Property::Vers, 40)]);
        assert_eq!((sleeping.version(), name(&sleeping, 8)), (None, Some("LOCK")));
        sleeping.given(Property::Stat, 2);
        sleeping.told(Property::Stat, 2);
        sleeping.told(Property::Vers, 145);
        assert_eq!((sleeping.version(), name(&sleeping, 8)), (Some(145), Some("MODE")));
    }
}
