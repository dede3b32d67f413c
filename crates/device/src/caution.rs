//! `Watch`: what temperatures and the pendant ask for: to be told, to run slowly, to stop.
//!
//! | | told | held to half speed | stopped |
//! |---|---|---|---|
//! | hottest motor | 60 degrees C | 70 | 80 |
//! | pendant | | a warning of velocity, torque, voltage, heartbeat or another quantity | the safety module does it |
//!
//! What began at a temperature ends 5 degrees below it. Supply that falls is the pendant's voltage warning.

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
pub(crate) struct Watch {
    /// How many of the three temperatures have been passed.
    heat: u8,
}

impl Watch {
    /// Takes the temperatures known so far and the latest word of the pendant.
    pub(crate) fn look(&mut self, temperatures: impl Iterator<Item = i16>, pendant: Option<i32>) -> Caution {
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
    pub(crate) fn is_too_hot(self) -> bool {
        self.heat >= 3
    }
}

fn warns(state: &PendantState) -> bool {
    [state.velocity, state.torque, state.voltage, state.heartbeat, state.other]
        .into_iter()
        .any(|health| health == safety::Health::Warning)
}
