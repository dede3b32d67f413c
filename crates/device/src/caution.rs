//! `Watch`: temperatures and warnings of the pendant, and the caution that they ask for.
//!
//! | | told | held to half speed | stopped |
//! |---|---|---|---|
//! | hottest motor | 60 degrees C | 70 | 80 |
//! | pendant | | a warning of velocity, torque, voltage, heartbeat or another quantity | the safety module does it |
//!
//! Each ends 5 degrees below the temperature at which it began. Supply that falls is the pendant's voltage warning.

use control::Caution;
use puck::{PendantState, safety};

/// Temperatures (degrees C) from which a person is told, runs are slow, and the arm stops.
const WARM: i16 = 60;
const HOT: i16 = 70;
const TOO_HOT: i16 = 80;
/// Fall of the temperature that ends it.
const HYSTERESIS: i16 = 5;

/// The present findings.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Watch {
    /// Number of the three temperatures that have been passed.
    heat: u8,
}

impl Watch {
    /// Takes the temperatures known so far and the latest word of the pendant.
    pub fn look(&mut self, temperatures: impl Iterator<Item = i16>, pendant: Option<i32>) -> Caution {
        let hottest = temperatures.max().unwrap_or(0);
        self.heat = (1u8..).zip([WARM, HOT, TOO_HOT]).fold(0, |heat, (level, limit)| {
            let left = if self.heat >= level { limit.saturating_sub(HYSTERESIS) } else { limit };
            if hottest >= left { level } else { heat }
        });
        let warned = pendant.and_then(|word| PendantState::from_value(word).ok()).is_some_and(|state| warns(&state));
        match self.heat {
            2.. => Caution::Slowed,
            _ if warned => Caution::Slowed,
            1 => Caution::Warned,
            _ => Caution::None,
        }
    }

    /// True while a motor is too hot to go on.
    pub fn is_too_hot(self) -> bool {
        self.heat >= 3
    }
}

fn warns(state: &PendantState) -> bool {
    [state.velocity, state.torque, state.voltage, state.heartbeat, state.other]
        .into_iter()
        .any(|health| health == safety::Health::Warning)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAFE: i32 = 1 | 1 << 3 | 1 << 6 | 1 << 9 | 1 << 12;

    #[test]
    fn g14_temperatures_and_warnings_ask_for_what_the_table_says() {
        let mut watch = Watch::default();
        let mut look = |celsius: i16, word: i32| {
            let found = watch.look([20, celsius, 30].into_iter(), Some(word));
            (found, watch.is_too_hot())
        };
        // Upwards, and down again with five degrees of play.
        for (celsius, found, stops) in [
            (59, Caution::None, false),
            (60, Caution::Warned, false),
            (56, Caution::Warned, false),
            (54, Caution::None, false),
            (70, Caution::Slowed, false),
            (66, Caution::Slowed, false),
            (64, Caution::Warned, false),
            (80, Caution::Slowed, true),
            (75, Caution::Slowed, true),
            (74, Caution::Slowed, false),
            (20, Caution::None, false),
        ] {
            assert_eq!(look(celsius, SAFE), (found, stops), "{celsius} degrees");
        }
        // Each of the five quantities, as a warning; a fault is the safety module's own matter.
        for place in [0, 3, 6, 9, 12] {
            let word = |health: i32| SAFE & !(1 << place) | health << place;
            assert_eq!(look(20, word(2)).0, Caution::Slowed, "quantity {place}");
            assert_eq!(look(20, word(4)).0, Caution::None);
        }
        assert_eq!(Watch::default().look(core::iter::empty(), None), Caution::None, "nothing is known yet");
    }
}
