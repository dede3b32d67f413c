//! `Settings`: what a device keeps of its arm, the home and the weight of the links, under names with units.

mod file;
mod key;

use control::Payload;
use control::model::{HOME, LinkWeight, WeightCorrection, WeightError};
use device::calibration::{Home, HomeError};
use link::HomeSource;
use thiserror::Error;

use crate::client::Client;
use crate::error::HostError;
use crate::transport::Transport;

pub use file::{FileError, SettingsFile, model_text, settings_text};
pub use key::{Key, Setting, UnknownKey};

/// The weight of the links as the device keeps it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeptWeight {
    /// It was measured with sensor and hand, otherwise with the bare arm.
    pub hand: bool,
    /// Share of mass beyond the model's, and shift of the first moment x, y, z (m), of links 1 to 7.
    pub links: [[f32; 4]; 7],
}

impl KeptWeight {
    /// It differs from the robot model's: it was measured, or set by a person, and is no mere declaration.
    #[must_use]
    pub fn is_measured(&self) -> bool {
        self.links.iter().flatten().any(|number| *number != 0.0)
    }
}

/// Settings that a device keeps. `None`: nothing is kept, the robot model's counts.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Settings {
    /// Joint angles at which the arm stands when it is zeroed, rad.
    pub home: Option<[f32; 7]>,
    /// Weight of its links.
    pub weight: Option<KeptWeight>,
}

/// Why a setting cannot have a value.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum SettingError {
    /// A number is needed.
    #[error("{0} takes a number")]
    NumberNeeded(Key),
    /// A switch is needed.
    #[error("{0} takes true or false")]
    SwitchNeeded(Key),
    /// There is nothing that could be stored.
    #[error("{0} = true needs the values that are to be stored")]
    NothingToStore(Key),
    /// The values are given, and are not to be stored.
    #[error("{0} contradicts {1} = false")]
    NotStored(Key, Key),
    /// No arm has such a home.
    #[error("home: {0}")]
    Home(HomeError),
    /// No arm has such links.
    #[error("weight: {0}")]
    Weight(WeightError),
}

/// Why settings were not written, or not all of them.
#[derive(Debug, Error)]
pub enum WriteError {
    /// No arm can have them; nothing was written.
    #[error(transparent)]
    Impossible(#[from] SettingError),
    /// The device refused, or the line failed.
    #[error(transparent)]
    Device(#[from] HostError),
    /// A weight that was measured with one payload would count as measured with another; nothing was written.
    #[error("the weight that the device keeps was measured {}, and this would call it measured {}", with(!.hand), with(*.hand))]
    OtherPayload {
        /// It would be called measured with sensor and hand.
        hand: bool,
    },
    /// The device keeps other values than were written.
    #[error("read back, {0} is another value than was written")]
    ReadBack(Key),
}

/// The payload of a weight, in words.
fn with(hand: bool) -> &'static str {
    if hand { "with sensor and hand" } else { "with the bare arm" }
}

/// One setting that two sets of settings differ in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Change {
    /// Its name.
    pub key: Key,
    /// Value in the first; `None`: it has none.
    pub before: Option<Setting>,
    /// Value in the second; `None`: it has none.
    pub after: Option<Setting>,
}

impl Settings {
    /// Reads what a device keeps. What is damaged or foreign there counts as nothing, as it does for the device.
    ///
    /// # Errors
    /// As [`Client::request`].
    pub fn of_device<T: Transport>(client: &mut Client<T>) -> Result<Self, HostError> {
        let (home, weight) = (client.calibration()?, client.weight()?);
        Ok(Self {
            home: (home.source == HomeSource::Stored).then_some(home.home),
            weight: (weight.source == HomeSource::Stored)
                .then_some(KeptWeight { hand: weight.hand, links: weight.links }),
        })
    }

    /// Value of a setting; `None` where nothing is stored that could have one.
    #[must_use]
    pub fn get(&self, key: Key) -> Option<Setting> {
        let link = |link: u8| self.weight.and_then(|weight| weight.links.get(usize::from(link)).copied());
        match key {
            Key::HomeStored => Some(Setting::Switch(self.home.is_some())),
            Key::WeightStored => Some(Setting::Switch(self.weight.is_some())),
            Key::HomeJoint(joint) => self.home?.get(usize::from(joint)).copied().map(Setting::Number),
            Key::WeightHand => self.weight.map(|weight| Setting::Switch(weight.hand)),
            Key::LinkShare(index) => link(index).map(|[share, ..]| Setting::Number(share)),
            Key::LinkShift(index, axis) => link(index)?.get(1 + usize::from(axis)).copied().map(Setting::Number),
        }
    }

    /// These settings with some of them changed. What is not named keeps its value; where nothing was stored it has
    /// the robot model's.
    ///
    /// # Errors
    /// [`SettingError`]: a value of the wrong kind, a contradiction, or what no arm can have.
    pub fn with(mut self, changes: &[(Key, Setting)]) -> Result<Self, SettingError> {
        let forgotten: Vec<Key> = changes
            .iter()
            .filter(|(key, value)| key.is_stored() && *value == Setting::Switch(false))
            .map(|(key, _)| *key)
            .collect();
        for (key, value) in changes {
            if let Some(stored) = forgotten.iter().find(|stored| **stored == key.stored() && *stored != key) {
                return Err(SettingError::NotStored(*key, *stored));
            }
            self.set(*key, *value)?;
        }
        for (key, value) in changes {
            if key.is_stored() && self.get(*key) != Some(*value) {
                return Err(SettingError::NothingToStore(*key));
            }
        }
        self.check()?;
        Ok(self)
    }

    fn set(&mut self, key: Key, value: Setting) -> Result<(), SettingError> {
        let number = || value.number().ok_or(SettingError::NumberNeeded(key));
        let switch = || value.switch().ok_or(SettingError::SwitchNeeded(key));
        let nothing = KeptWeight { hand: true, links: [[0.0; 4]; 7] };
        match key {
            Key::HomeStored => {
                if !switch()? {
                    self.home = None;
                }
            }
            Key::WeightStored => {
                if !switch()? {
                    self.weight = None;
                }
            }
            Key::HomeJoint(joint) => {
                let home = self.home.get_or_insert(HOME.map(|angle| angle as f32));
                if let Some(angle) = home.get_mut(usize::from(joint)) {
                    *angle = number()?;
                }
            }
            Key::WeightHand => self.weight.get_or_insert(nothing).hand = switch()?,
            Key::LinkShare(link) => {
                if let Some([share, ..]) = self.weight.get_or_insert(nothing).links.get_mut(usize::from(link)) {
                    *share = number()?;
                }
            }
            Key::LinkShift(link, axis) => {
                let links = &mut self.weight.get_or_insert(nothing).links;
                let shift = links.get_mut(usize::from(link)).and_then(|link| link.get_mut(1 + usize::from(axis)));
                if let Some(shift) = shift {
                    *shift = number()?;
                }
            }
        }
        Ok(())
    }

    /// Holds the values against what the device accepts, before any of them is written.
    fn check(&self) -> Result<(), SettingError> {
        if let Some(home) = self.home {
            Home::new(home).map_err(SettingError::Home)?;
        }
        self.correction().map(|_| ())
    }

    fn correction(&self) -> Result<Option<WeightCorrection>, SettingError> {
        let Some(KeptWeight { hand, links }) = self.weight else { return Ok(None) };
        let payload = if hand { Payload::SensorAndHand } else { Payload::None };
        let links = links.map(|[share, shift @ ..]| LinkWeight { share, shift });
        WeightCorrection::new(payload, links).map(Some).map_err(SettingError::Weight)
    }

    /// Has a device keep these settings, those that differ from what it keeps now, and reads them back.
    ///
    /// The home is written first: it is what a device refuses while the arm has torque, and then nothing has changed.
    ///
    /// # Errors
    /// [`WriteError`]; an error of the weight leaves the new home written, which [`Self::of_device`] tells.
    pub fn write<T: Transport>(&self, client: &mut Client<T>) -> Result<(), WriteError> {
        self.check()?;
        let before = Self::of_device(client)?;
        if let (Some(kept), Some(wanted)) = (before.weight, self.weight)
            && kept.is_measured()
            && kept.links == wanted.links
            && kept.hand != wanted.hand
        {
            return Err(WriteError::OtherPayload { hand: wanted.hand });
        }
        match self.home {
            _ if self.home == before.home => {}
            Some(home) => client.calibrate(home)?,
            None => client.forget_calibration()?,
        }
        match self.correction()? {
            _ if self.weight == before.weight => {}
            Some(weight) => client.keep_weight(&weight)?,
            None => client.forget_weight()?,
        }
        let kept = Self::of_device(client)?;
        self.changes(&kept).first().map_or(Ok(()), |change| Err(WriteError::ReadBack(change.key)))
    }

    /// Differences from these settings to others, sorted by name.
    #[must_use]
    pub fn changes(&self, after: &Self) -> Vec<Change> {
        let changed = Key::all().into_iter().map(|key| Change { key, before: self.get(key), after: after.get(key) });
        changed.filter(|change| change.before != change.after).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn key(name: &str) -> Key {
        name.parse().unwrap()
    }

    #[test]
    fn every_key_is_read_by_the_name_that_it_has_and_the_names_are_sorted() {
        let names: Vec<String> = Key::all().iter().map(Key::to_string).collect();
        assert!(names.is_sorted() && names.len() == 8 + 2 + 28, "{names:?}");
        for name in &names {
            assert_eq!(key(name).to_string(), *name);
        }
        for wrong in ["home.joint_0_rad", "home.joint_8_rad", "home.joint_1_deg", "weight.link_1_shift_m", "home", ""] {
            assert!(wrong.parse::<Key>().is_err(), "{wrong}");
        }
    }

    #[test]
    fn what_is_set_can_be_read_and_nothing_else_changes() {
        for changed in Key::all().into_iter().filter(|key| !key.is_stored()) {
            let value = match changed {
                Key::WeightHand => Setting::Switch(false),
                Key::HomeJoint(joint) => Setting::Number(HOME[usize::from(joint)] as f32 * 0.99 + 0.001),
                _ => Setting::Number(0.004),
            };
            let all = Settings { home: Some(HOME.map(|q| q as f32)), weight: None };
            let all = all.with(&[(key("weight.with_hand"), Setting::Switch(true))]).unwrap();
            let after = all.with(&[(changed, value)]).unwrap();
            let expected = Change { key: changed, before: all.get(changed), after: Some(value) };
            assert_eq!(all.changes(&after), [expected]);
        }
    }

    #[test]
    fn what_contradicts_itself_or_no_arm_can_have_is_refused() {
        let number = |name, value| (key(name), Setting::Number(value));
        let switch = |name, value| (key(name), Setting::Switch(value));
        let refused = |changes: &[_]| Settings::default().with(changes).unwrap_err();
        let contradiction = refused(&[number("home.joint_1_rad", 0.0), switch("home.stored", false)]);
        assert!(matches!(contradiction, SettingError::NotStored(..)), "{contradiction}");
        assert!(matches!(refused(&[switch("weight.stored", true)]), SettingError::NothingToStore(_)));
        assert!(matches!(refused(&[number("weight.with_hand", 1.0)]), SettingError::SwitchNeeded(_)));
        assert!(matches!(refused(&[switch("home.joint_2_rad", true)]), SettingError::NumberNeeded(_)));
        assert!(matches!(refused(&[number("home.joint_2_rad", 1.0)]), SettingError::Home(_)));
        assert!(matches!(refused(&[number("home.joint_2_rad", f32::NAN)]), SettingError::Home(_)));
        assert!(matches!(refused(&[number("weight.link_2_mass_share", 9.0)]), SettingError::Weight(_)));
        assert!(matches!(refused(&[number("weight.link_2_shift_y_m", f32::INFINITY)]), SettingError::Weight(_)));
    }
}
