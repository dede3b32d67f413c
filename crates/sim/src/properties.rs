//! The values of a puck's properties, and which number on the wire names which property.
//!
//! Plain arrays: a request is looked up in constant time, and 24 frames a cycle ask for a lot of look-ups.

use puck::{Property, PropertyId, PropertyTable};

/// A value for each property that the puck has.
#[derive(Clone, Debug)]
pub(crate) struct Values([Option<i32>; Property::ALL.len()]);

impl Values {
    /// These properties with these values, no others.
    pub(crate) fn new(pairs: &[(Property, i32)]) -> Self {
        let mut values = [None; Property::ALL.len()];
        for (property, value) in pairs {
            values[*property as usize] = Some(*value);
        }
        Self(values)
    }

    /// The value; `None` if the puck has no such property.
    pub(crate) fn get(&self, property: Property) -> Option<i32> {
        self.0[property as usize]
    }

    /// The value, 0 if the puck has no such property.
    pub(crate) fn of(&self, property: Property) -> i32 {
        self.get(property).unwrap_or(0)
    }

    /// Changes the value of a property that the puck has; others stay absent.
    pub(crate) fn set(&mut self, property: Property, value: i32) {
        if let Some(stored) = &mut self.0[property as usize] {
            *stored = value;
        }
    }
}

/// Property by number, for one table.
#[derive(Clone, Debug)]
pub(crate) struct Numbers([Option<Property>; 128]);

impl Numbers {
    /// The numbers of this table.
    pub(crate) fn new(table: &PropertyTable) -> Self {
        Self(std::array::from_fn(|number| {
            u8::try_from(number).ok().and_then(PropertyId::new).and_then(|id| table.property(id))
        }))
    }

    /// The property with this number; `None` if there is none.
    pub(crate) fn property(&self, id: PropertyId) -> Option<Property> {
        self.0[usize::from(id.number())]
    }
}
