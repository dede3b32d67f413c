//! Torques as they were on the bus.

use std::ops::Range;
use std::sync::LazyLock;

use control::act::limit::STEP_LIMIT;
use lab::arm::TORQUE_LIMITS;
use puck::{Action, Destination, Drives, Group, PuckTorque, Ratios, Request, Transmission};
use sim::{Passage, PuckConfig, Ticks};

use crate::figure;

/// Joint torques from one pair of torque frames on, or from one frame whose partner is missing.
#[derive(Debug, Clone, Copy)]
pub struct Sent {
    /// Start of the frame that made it so.
    pub at: Ticks,
    /// Joint torques, N m.
    pub torques: [f64; 7],
    /// True if every motor that is told anything is told zero.
    pub is_zero: bool,
}

/// Units and gears of the simulated pucks.
static ARM: LazyLock<(Drives, Transmission<f64>)> = LazyLock::new(|| {
    let pucks = PuckConfig::default();
    let drives = Drives::new([pucks.counts_per_revolution; 7], pucks.units_per_newton_metre.map(i32::from));
    (drives.expect("positive"), Transmission::new(&Ratios::WAM7).expect("positive"))
});

/// Every pair of torque frames, in order. A frame whose partner is missing counts with the last of the other group: the
/// motors of either group turn joints of their own.
#[must_use]
pub fn sent(frames: &[Passage]) -> Vec<Sent> {
    let mut motors = [PuckTorque::ZERO; 7];
    let mut pairs: Vec<Sent> = Vec::new();
    let joined = |at: Ticks, motors: &[PuckTorque; 7], told: Range<usize>| {
        let torques = ARM.1.joint_torques_from_motor(&ARM.0.motor_torques(motors));
        Sent { at, torques, is_zero: motors[told].iter().all(|torque| torque.units() == 0) }
    };
    let mut half: Option<(Ticks, Range<usize>)> = None;
    for passage in frames {
        let Ok(request) = Request::decode(&passage.frame) else { continue };
        let Action::PackedTorques { torques, .. } = request.action else { continue };
        let place = match request.to {
            Destination::Group(Group::ARM_TORQUES) => 0..4,
            Destination::Group(Group::WRIST_TORQUES) => 4..7,
            _ => continue,
        };
        let is_alone = half.take_if(|(_, other)| *other == place);
        pairs.extend(is_alone.map(|(at, told)| joined(at, &motors, told)));
        motors[place.clone()].copy_from_slice(&torques[..place.len()]);
        half = match half {
            Some(_) => {
                pairs.push(joined(passage.start, &motors, 0..7));
                None
            }
            None => Some((passage.start, place)),
        };
    }
    pairs.extend(half.map(|(at, told)| joined(at, &motors, told)));
    pairs
}

/// The largest torque, of what the limiter grants its joint.
#[must_use]
pub fn largest(sent: &[Sent]) -> f64 {
    ratio(sent.iter().map(|pair| pair.torques), &TORQUE_LIMITS)
}

/// The largest step from one pair to the next, of what the limiter grants its joint in a cycle. Torque may end at once.
#[must_use]
pub fn largest_step(sent: &[Sent]) -> f64 {
    let steps = sent.windows(2).filter(|pair| !pair[1].is_zero);
    ratio(steps.map(|pair| std::array::from_fn(|joint| pair[1].torques[joint] - pair[0].torques[joint])), &STEP_LIMIT)
}

fn ratio(torques: impl Iterator<Item = [f64; 7]>, limits: &[f64; 7]) -> f64 {
    let ratios = torques.flat_map(|torques| (0..7).map(move |joint| torques[joint].abs() / limits[joint]));
    figure::largest(ratios)
}
