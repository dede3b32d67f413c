//! Figures of an injection that mean nothing: a puck that no arm has, a time that never comes.

use std::ops::RangeInclusive;

use super::{FaultKind, Frames, Injection};

/// Shortest time that a fault lasts or that lies between two, s: below it there is no frame.
const SHORTEST_TIME: f64 = 1e-6;

/// Longest time of a script, s: eleven days.
const LONGEST_TIME: f64 = 1e6;

/// Most times that one fault comes.
const MOST_TIMES: u32 = 100_000;

/// Numbers of the nodes of a bus.
const NODES: RangeInclusive<u8> = 0..=31;

/// Pucks of the arm.
const PUCKS: RangeInclusive<u8> = 1..=7;

/// Most frames of a flood in a second: more than any bus carries.
const MOST_FRAMES: f64 = 1e6;

/// Largest force, torque, mass, friction or drift, in its SI unit.
const LARGEST: f64 = 1e6;

/// Largest share by which a clock is slow or fast, of all its faults together: time goes on.
pub(super) const LARGEST_CLOCK_ERROR: f64 = 0.9;

/// Largest jump of a count.
const LARGEST_JUMP: f64 = 1e9;

impl Injection {
    /// Succeeds if the figures mean something.
    ///
    /// # Errors
    /// The first figure that means nothing, and what it may be.
    pub fn check(&self) -> Result<(), String> {
        within("at", self.at, 0.0, LONGEST_TIME)?;
        let is_of_a_moment = matches!(self.what, FaultKind::Restart { .. } | FaultKind::Pendant(_));
        if self.lasts != f64::INFINITY {
            within("lasts", self.lasts, if is_of_a_moment { 0.0 } else { SHORTEST_TIME }, LONGEST_TIME)?;
        }
        within("times", self.times.into(), 1.0, MOST_TIMES.into())?;
        // One of them alone is a fault that comes once, or several times at once.
        if self.times > 1 {
            within("every", self.every, SHORTEST_TIME, LONGEST_TIME)?;
        } else if self.every != 0.0 {
            within("times", self.times.into(), 2.0, MOST_TIMES.into())?;
        }
        match &self.what {
            FaultKind::Drop(frames)
            | FaultKind::Repeat(frames)
            | FaultKind::Flip(frames)
            | FaultKind::Freeze(frames) => frames.check(),
            FaultKind::Delay { frames, by } => frames.check().and_then(|()| within("by", *by, 0.0, LONGEST_TIME)),
            FaultKind::CountJump { node, by } => {
                one_of("node", *node, &PUCKS)?;
                within("by", (*by).into(), -LARGEST_JUMP, LARGEST_JUMP)
            }
            FaultKind::Restart { node: node @ (0 | 9..=10 | 15..) } => {
                Err(format!("node is {node}; motors (1 to 7), the sensor (8) and the hand (11 to 14) can restart"))
            }
            FaultKind::Restart { .. } => Ok(()),
            FaultKind::Temperature { node, celsius } => {
                one_of("node", *node, &PUCKS)?;
                within("celsius", (*celsius).into(), i16::MIN.into(), i16::MAX.into())
            }
            FaultKind::Sensor { error, drift } => all("error", error).and_then(|()| all("drift", drift)),
            FaultKind::Flood { rate, bytes } => {
                within("rate", *rate, 1e-3, MOST_FRAMES)?;
                one_of("bytes", *bytes, &(0..=8))
            }
            FaultKind::Clock(share) => within("clock", *share, -LARGEST_CLOCK_ERROR, LARGEST_CLOCK_ERROR),
            FaultKind::Push { force } => all("force", force),
            FaultKind::Payload(mass) => within("payload", *mass, -LARGEST, LARGEST),
            FaultKind::Friction(added) => all("friction", added),
            FaultKind::TorqueDelay(by) => within("torque-delay", *by, 0.0, LONGEST_TIME),
            FaultKind::Pendant(_) | FaultKind::Warning(_) | FaultKind::BusOff | FaultKind::Refuse(_) => Ok(()),
        }
    }
}

impl Frames {
    fn check(&self) -> Result<(), String> {
        within("share", self.share, 0.0, 1.0)?;
        within("most", self.most.into(), 1.0, u32::MAX.into())?;
        self.from.iter().try_for_each(|node| one_of("from", *node, &NODES))
    }
}

fn all(what: &str, values: &[f64]) -> Result<(), String> {
    values.iter().try_for_each(|value| within(what, *value, -LARGEST, LARGEST))
}

fn within(what: &str, value: f64, least: f64, most: f64) -> Result<(), String> {
    if (least..=most).contains(&value) {
        Ok(())
    } else {
        Err(format!("{what} is {value}; it must be from {least} to {most}"))
    }
}

fn one_of(what: &str, value: u8, known: &RangeInclusive<u8>) -> Result<(), String> {
    within(what, value.into(), (*known.start()).into(), (*known.end()).into())
}
