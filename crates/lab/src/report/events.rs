//! The course of a run: changes of state, and the stretches in which something was out of the ordinary.

use control::{Fault, flags};

use super::progress;
use crate::demonstration::Recording;

/// Something that happened.
#[derive(Debug, Clone, PartialEq)]
pub struct Happening {
    /// Time since the movement began, s; negative before.
    pub time: f64,
    /// Progress of the movement, 0 to 1; 0 outside.
    pub progress: f64,
    /// One sentence without full stop.
    pub words: String,
}

/// Stretches shorter than this, s, are one with the one before them.
const PAUSE: f64 = 0.1;

const OUT_OF_THE_ORDINARY: [(u32, &str); 9] = [
    (flags::SURPRISE, "the run was not as the successful ones"),
    (flags::CLAMPED, "the adaptation was at its limits"),
    (flags::FEEDBACK_FADED, "the adaptation was derated or fading"),
    (flags::JOINT_LIMITED | flags::MOTOR_LIMITED | flags::RATE_LIMITED, "the torque was cut at its limit"),
    (flags::NEAR_LIMIT, "a joint was near its limit"),
    (flags::SENSOR_SATURATED, "the force sensor was saturated"),
    (flags::WRENCH_STALE, "the force sensor was silent"),
    (flags::HAND_LOST, "the hand did not answer"),
    (flags::CONTACT_UNSEEN, "a push came that the force sensor does not see"),
];

/// Everything that happened, in its order; `began` is the first sample of the run that is told.
pub(super) fn of(recording: &Recording, began: usize, alpha: f64) -> Vec<Happening> {
    let states = recording.state.as_deref().unwrap_or_default();
    let zero = recording.time.get(began).copied().unwrap_or(0.0);
    let at = |sample: usize, words: String| Happening {
        time: recording.time.get(sample).map_or(0.0, |time| time - zero),
        progress: recording.phase.as_ref().and_then(|all| all.get(sample)).map_or(0.0, |phase| progress(*phase, alpha)),
        words,
    };
    let mut happenings = Vec::new();
    for (sample, pair) in states.windows(2).enumerate() {
        if pair[0] != pair[1] {
            let code = recording.fault.as_ref().and_then(|all| all.get(sample + 1)).copied().unwrap_or(0);
            let fault = u8::try_from(code).ok().and_then(Fault::from_code).filter(|fault| *fault != Fault::None);
            let because = fault.map(|fault| format!(": {fault}")).unwrap_or_default();
            happenings.push(at(sample + 1, format!("state '{}' after '{}'{because}", pair[1], pair[0])));
        }
    }
    for (mask, words) in OUT_OF_THE_ORDINARY {
        for (first, last) in stretches(recording, mask) {
            let seconds = recording.time[last] - recording.time[first] + crate::plan::PERIOD;
            happenings.push(at(first, format!("{words}, for {seconds:.2} s")));
        }
    }
    happenings.sort_by(|a, b| a.time.total_cmp(&b.time));
    happenings
}

/// First and last samples of the stretches in which one of the bits was set.
fn stretches(recording: &Recording, mask: u32) -> Vec<(usize, usize)> {
    let mut stretches: Vec<(usize, usize)> = Vec::new();
    let all = recording.flags.as_deref().unwrap_or_default();
    for (sample, _) in all.iter().enumerate().filter(|(_, bits)| *bits & mask != 0) {
        match stretches.last_mut() {
            Some((_, last)) if recording.time[sample] - recording.time[*last] < PAUSE => *last = sample,
            _ => stretches.push((sample, sample)),
        }
    }
    stretches
}
