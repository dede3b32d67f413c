//! Torques as they were on the bus.

use std::sync::LazyLock;

use control::act::limit::STEP_LIMIT;
use lab::arm::TORQUE_LIMITS;
use puck::{Action, Destination, Drives, Group, PuckTorque, Ratios, Request, Transmission};
use sim::{Passage, PuckConfig, Ticks};

/// Joint torques from one pair of torque frames on.
#[derive(Debug, Clone, Copy)]
pub struct Sent {
    /// Start of the second frame of the pair.
    pub at: Ticks,
    /// Joint torques, N m.
    pub torques: [f64; 7],
    /// True if every motor is told zero.
    pub is_zero: bool,
}

/// Units and gears of the simulated pucks.
static ARM: LazyLock<(Drives, Transmission<f64>)> = LazyLock::new(|| {
    let pucks = PuckConfig::default();
    let drives = Drives::new([pucks.counts_per_revolution; 7], pucks.units_per_newton_metre.map(i32::from));
    (drives.expect("positive"), Transmission::new(&Ratios::WAM7).expect("positive"))
});

/// Every pair of torque frames, in order; a frame whose partner is missing counts with the last of the other group.
#[must_use]
pub fn sent(frames: &[Passage]) -> Vec<Sent> {
    let mut motors = [PuckTorque::ZERO; 7];
    let mut pairs: Vec<Sent> = Vec::new();
    let mut half = None;
    for passage in frames {
        let Ok(request) = Request::decode(&passage.frame) else { continue };
        let Action::PackedTorques { torques, .. } = request.action else { continue };
        let (group, place) = match request.to {
            Destination::Group(Group::ARM_TORQUES) => (Group::ARM_TORQUES, 0..4),
            Destination::Group(Group::WRIST_TORQUES) => (Group::WRIST_TORQUES, 4..7),
            _ => continue,
        };
        motors[place.clone()].copy_from_slice(&torques[..place.len()]);
        if half.replace(group).is_some_and(|other| other != group) {
            half = None;
            let torques = ARM.1.joint_torques_from_motor(&ARM.0.motor_torques(&motors));
            let is_zero = motors.iter().all(|torque| torque.units() == 0);
            pairs.push(Sent { at: passage.start, torques, is_zero });
        }
    }
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
    ratios.fold(0.0, f64::max)
}
