//! The outcome of a trial, and what happened to the object on the way.

use control::Fault;
use std::fmt;

use serde::{Deserialize, Serialize};

use super::observation::{Milestones, Observation, SAMPLE_SECONDS, Sample};
use super::quantile::quantile;
use super::shaking::{Shaking, UNSTABLE};

/// An object that leaned farther than this before the grasp closed counts as knocked over.
pub const TILT_LIMIT: f64 = 30.0 * std::f64::consts::PI / 180.0;
/// An object is lifted when it is this far above where it stood, m (of 0.10 m that the hand rises).
const LIFTED: f64 = 0.08;
/// An object that rose by this and is not lifted at the end was dropped, m.
const RAISED: f64 = 0.02;
/// An object that was moved by more than this, and not grasped, was pushed away, m.
const PUSHED: f64 = 0.03;
/// An object that is knocked over has begun to fall when it leaves this lean for good: until then it may still come
/// back.
const FALLING: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Inner links of a hand that holds something stand at 1.8 to 2.2 rad: a finger beyond this, rad, should have met it.
const SHOULD_HOLD: f64 = 1.9;
/// A finger that moved by this much is closing, rad.
const CLOSING: f64 = 0.05;
/// The grasp point is at most this far from the middle of an object in the hand, m.
const IN_HAND: f64 = 0.25;
/// Contact forces below this are no contact, N.
const TOUCH: f64 = 0.05;
/// Time over which a sustained force is averaged, s.
const SUSTAINED: f64 = 0.1;
/// Time over which the force of a finger is averaged, s.
const GRIP: f64 = 0.05;

/// Time over which the speed of a hand that arrives is averaged, s.
const ARRIVAL: f64 = 0.2;

/// The outcome of a trial.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(tag = "outcome", content = "fault", rename_all = "snake_case")]
pub enum Outcome {
    /// Grasped, lifted, and at the end still in the hand: by two fingers, or one against the palm.
    Held,
    /// Leaned over 30 degrees before the grasp closed.
    KnockedOver,
    /// The fingers closed beside it.
    Missed,
    /// Moved out of the fingers' reach.
    PushedAway,
    /// Raised, but not in the hand at the end, or hanging on one finger.
    Dropped,
    /// A finger pressed harder than the object bears.
    Crushed,
    /// Grasped by two fingers or more, but the arm did not raise the hand.
    NotLifted,
    /// Not held, by an arm that shook.
    Unstable,
    /// The arm stopped by itself; the name of the fault.
    Stopped(String),
}

impl Outcome {
    /// True if the arm stopped by itself: what it did not do any more is no merit.
    pub fn is_stopped(&self) -> bool {
        matches!(self, Outcome::Stopped(_))
    }

    /// Its letter in a map.
    pub fn letter(&self) -> char {
        match self {
            Outcome::Held => 'S',
            Outcome::KnockedOver => 'K',
            Outcome::Missed => 'M',
            Outcome::PushedAway => 'P',
            Outcome::Dropped => 'D',
            Outcome::Crushed => 'C',
            Outcome::NotLifted => 'L',
            Outcome::Unstable => 'U',
            Outcome::Stopped(_) => 'F',
        }
    }

    /// True if the object was grasped, lifted and held.
    pub fn is_success(&self) -> bool {
        *self == Outcome::Held
    }

    /// Its kind without particulars: a column of a table.
    pub fn name(&self) -> &'static str {
        match self {
            Outcome::Held => "held",
            Outcome::KnockedOver => "knocked over",
            Outcome::Missed => "missed",
            Outcome::PushedAway => "pushed away",
            Outcome::Dropped => "dropped",
            Outcome::Crushed => "crushed",
            Outcome::NotLifted => "not lifted",
            Outcome::Unstable => "unstable",
            Outcome::Stopped(_) => "stopped",
        }
    }
}

impl fmt::Display for Outcome {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Outcome::Stopped(fault) => write!(formatter, "stopped ({fault})"),
            other => formatter.write_str(other.name()),
        }
    }
}

/// Forces and motion of the object, and between hand, object and table. Times are seconds after the primitive started.
/// Measures until the fingers close are measures until the lift where they never close.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Measures {
    /// Height of the object above where it stood, at the end, m.
    pub lift_m: f64,
    /// Largest angle from its upright before the lift, degrees.
    pub tilt_deg: f64,
    /// Horizontal way it was pushed before the fingers began to close, m.
    pub push_m: f64,
    /// First touch of the object.
    pub touch_s: Option<f64>,
    /// Horizontal speed of the hand over the 0.2 s before that, m/s; `None` where the fingers begin to close first. A
    /// movement has the mean speed of what was shown, and the object feels that of the moment.
    #[serde(default)]
    pub touch_speed_m_s: Option<f64>,
    /// The fingers began to close; `None` where they never did.
    pub closing_s: Option<f64>,
    /// The arm began to lift.
    pub lift_s: f64,
    /// When the failure began in the world: the object leaned over 10 degrees and went on to fall, was pushed 3 cm,
    /// the first finger passed the angle at which it should have held the object, or the hand touched what it dropped
    /// for the last time.
    pub failure_s: Option<f64>,
    /// Largest horizontal force on the object before the fingers close, 10 ms average, N.
    pub contact_peak_n: f64,
    /// The same averaged over 100 ms, N.
    pub contact_sustained_n: f64,
    /// Median of the horizontal force on the object before the fingers close, while it is touched, N; `None` where it
    /// is not.
    pub contact_median_n: Option<f64>,
    /// The same in the mean from the first touch until the fingers close, N.
    #[serde(default)]
    pub contact_mean_n: Option<f64>,
    /// Force of each finger on the object at the end, N.
    pub finger_n: [f64; 3],
    /// Largest force of the hand on the table, 10 ms average, N.
    pub table_peak_n: f64,
    /// Largest force of one finger on the object, 10 ms average, N.
    #[serde(default)]
    pub finger_peak_n: f64,
    /// Largest force of F1, F2, F3 on the object, 50 ms average, N.
    #[serde(default)]
    pub finger_grip_n: [f64; 3],
    /// Force that a finger is asked for, N: the torque that the primitive asks for, over the middle of a link.
    #[serde(default)]
    pub finger_asked_n: f64,
    /// Content of the wrist's force above 3 Hz from the closing of the fingers to the lift, RMS, N; `None` of an
    /// arm that stopped before.
    #[serde(default)]
    pub chatter_n: Option<f64>,
    /// Largest [amplitude](crate::shaking::Shaking::largest) of a joint's speed above 15 Hz, rad/s.
    #[serde(default)]
    pub shaking_rad_s: f64,
    /// True if a fault stopped the arm, that of an arm that shakes included.
    #[serde(default)]
    pub stopped: bool,
}

impl Measures {
    /// The measures of the fingers; everything else is zero.
    fn of_fingers(samples: &[Sample]) -> Measures {
        Measures {
            finger_peak_n: samples.iter().flat_map(|sample| sample.contact.fingers).fold(0.0, f64::max),
            finger_grip_n: std::array::from_fn(|finger| {
                let forces: Vec<f64> = samples.iter().map(|sample| sample.contact.fingers[finger]).collect();
                largest_mean(&forces, GRIP)
            }),
            ..Measures::default()
        }
    }

    /// The time at which the fingers began to close; the lift where they never did, s.
    pub fn closed(&self) -> f64 {
        self.closing_s.unwrap_or(self.lift_s)
    }

    /// The time until which the hand touches nothing and holds nothing, s.
    pub fn free_until(&self) -> f64 {
        self.touch_s.map_or(self.closed(), |touch| touch.min(self.closed()))
    }

    /// Largest force of the finger that presses hardest, 50 ms average, N.
    pub fn hardest_finger(&self) -> f64 {
        self.finger_grip_n.into_iter().fold(0.0, f64::max)
    }
}

/// The rule by which a trial is judged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Rule {
    /// True if leaning over counts as failure: not for objects that lie.
    pub upright: bool,
}

/// Conduct of the arm itself in a trial.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ArmConduct<'a> {
    /// Name of the fault that stopped the arm, if one did.
    pub fault: Option<&'a str>,
    /// Its shaking.
    pub shaking: Shaking,
}

/// Outcome of a trial in which the arm was stopped by this fault.
fn stopped(fault: &str) -> Outcome {
    if fault == Fault::Shaking.explanation() { Outcome::Unstable } else { Outcome::Stopped(fault.to_owned()) }
}

/// Judges a trial.
pub fn judge(
    observation: &Observation,
    marks: &Milestones,
    rule: Rule,
    ArmConduct { fault, shaking }: ArmConduct<'_>,
) -> (Outcome, Measures) {
    let (Some(first), Some(last)) =
        (observation.at(marks.run).or(observation.samples.first()), observation.samples.last())
    else {
        return (Outcome::Stopped(fault.unwrap_or("nothing was seen").to_owned()), Measures::default());
    };
    let run = observation.between(marks.run, marks.lift);
    let closes = |sample: &&Sample| (1..4).any(|finger| sample.digits[finger] - first.digits[finger] > CLOSING);
    let closing = run.iter().find(closes).map(|sample| sample.time);
    let before = observation.between(marks.run, closing.unwrap_or(marks.lift));
    let lifted = observation.between(marks.lift, f64::INFINITY);
    let height = |sample: &Sample| sample.object[2] - first.object[2];
    let moved = |sample: &Sample| (sample.object[0] - first.object[0]).hypot(sample.object[1] - first.object[1]);
    let forces: Vec<f64> = before.iter().map(|sample| sample.contact.horizontal()).collect();
    let touching: Vec<f64> = forces.iter().copied().filter(|force| *force > TOUCH).collect();
    let grasp_moved = run.last().map_or(0.0, moved);
    let tilt = run.iter().map(|sample| sample.tilt).fold(0.0, f64::max);
    let outcome = if let Some(fault) = fault {
        stopped(fault)
    } else if observation.crushed {
        Outcome::Crushed
    } else if rule.upright && tilt > TILT_LIMIT {
        // What falls knocks against the hand: its shaking then is none of the arm's.
        Outcome::KnockedOver
    } else if is_lifted(last, first) && observation.at(marks.hold).is_some_and(|sample| is_lifted(sample, first)) {
        Outcome::Held
    } else if shaking.lasting > UNSTABLE {
        Outcome::Unstable
    } else if lifted.iter().any(|sample| height(sample) > RAISED) {
        Outcome::Dropped
    } else if is_grasped(last) && last.hand[2] - run.last().map_or(0.0, |sample| sample.hand[2]) < RAISED {
        Outcome::NotLifted
    } else if grasp_moved > PUSHED {
        Outcome::PushedAway
    } else {
        Outcome::Missed
    };
    let first_time =
        |test: &dyn Fn(&Sample) -> bool| run.iter().find(|sample| test(sample)).map(|sample| sample.time - marks.run);
    let failure_s = match outcome {
        Outcome::KnockedOver => {
            let over = run.iter().position(|sample| sample.tilt > TILT_LIMIT).unwrap_or(run.len());
            let upright = run[..over].iter().rposition(|sample| sample.tilt <= FALLING).map_or(0, |index| index + 1);
            run.get(upright).map(|sample| sample.time - marks.run)
        }
        Outcome::PushedAway => first_time(&|sample| moved(sample) > PUSHED),
        Outcome::Missed => first_time(&|sample| sample.digits[1..].iter().any(|inner| *inner > SHOULD_HOLD))
            .or(closing.map(|time| time - marks.run)),
        Outcome::Dropped => {
            lifted.iter().rfind(|sample| sample.contact.touches()).map(|sample| sample.time - marks.run)
        }
        Outcome::Crushed | Outcome::Held | Outcome::NotLifted | Outcome::Unstable | Outcome::Stopped(_) => None,
    };
    let whole = observation.between(marks.run, f64::INFINITY);
    let measures = Measures {
        lift_m: height(last),
        tilt_deg: tilt.to_degrees(),
        push_m: before.last().map_or(0.0, moved),
        touch_s: first_time(&|sample| sample.contact.touches()),
        touch_speed_m_s: touch_speed(before),
        closing_s: closing.map(|time| time - marks.run),
        lift_s: marks.lift - marks.run,
        failure_s,
        contact_peak_n: forces.iter().copied().fold(0.0, f64::max),
        contact_sustained_n: largest_mean(&forces, SUSTAINED),
        contact_median_n: quantile(&touching, 0.5),
        contact_mean_n: mean_since(forces.iter().skip_while(|force| **force <= TOUCH)),
        finger_n: last.contact.fingers,
        table_peak_n: whole.iter().map(|sample| sample.contact.table).fold(0.0, f64::max),
        shaking_rad_s: shaking.largest,
        stopped: fault.is_some(),
        ..Measures::of_fingers(whole)
    };
    (outcome, measures)
}

fn is_lifted(sample: &Sample, first: &Sample) -> bool {
    let distance = (0..3).map(|axis| (sample.object[axis] - sample.hand[axis]).powi(2)).sum::<f64>().sqrt();
    sample.object[2] - first.object[2] >= LIFTED && distance < IN_HAND && is_grasped(sample)
}

/// Two fingers or more on the object, or one against the palm.
fn is_grasped(sample: &Sample) -> bool {
    let fingers = sample.contact.fingers.iter().filter(|force| **force > TOUCH).count();
    fingers + usize::from(sample.contact.palm > TOUCH) >= 2
}

/// Horizontal speed of the hand over the [`ARRIVAL`] before the first touch, m/s; `None` without one, or without that
/// time before it.
fn touch_speed(samples: &[Sample]) -> Option<f64> {
    let steps = (ARRIVAL / SAMPLE_SECONDS).round() as usize;
    let last = samples.iter().position(|sample| sample.contact.touches())?.checked_sub(1)?;
    let (first, last) = (samples.get(last.checked_sub(steps)?)?, samples.get(last)?);
    Some((last.hand[0] - first.hand[0]).hypot(last.hand[1] - first.hand[1]) / (last.time - first.time))
}

/// Mean of forces; `None` of none.
fn mean_since<'a>(forces: impl Iterator<Item = &'a f64>) -> Option<f64> {
    let (sum, count) = forces.fold((0.0, 0.0), |(sum, count), force| (sum + force, count + 1.0));
    (count > 0.0).then(|| sum / count)
}

/// Largest mean over `seconds`.
fn largest_mean(forces: &[f64], seconds: f64) -> f64 {
    let length = (seconds / SAMPLE_SECONDS).round() as usize;
    let mean = |window: &[f64]| window.iter().sum::<f64>() / length as f64;
    if forces.len() < length {
        return mean(forces);
    }
    forces.windows(length).map(mean).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::observation::Contact;

    const MILESTONES: Milestones = Milestones { run: 1.0, lift: 13.0, hold: 15.0 };
    const UPRIGHT: Rule = Rule { upright: true };

    /// A grasp that works: touched at 6 s with 3 N, fingers close from 9 s, lifted from 13 to 15 s.
    fn good() -> Observation {
        let samples = (0..1700).map(|k| {
            let time = f64::from(k) * 0.01;
            let touched = time >= 6.0;
            let rise = ((time - 13.0) / 2.0).clamp(0.0, 1.0) * 0.1;
            let finger = 0.25 + ((time - 9.0) / 3.0).clamp(0.0, 1.0) * 1.5;
            let grip = if time >= 12.0 { 8.0 } else { 0.0 };
            Sample {
                time,
                object: [0.75, 0.2, 0.0 + rise],
                tilt: if touched { 0.05 } else { 0.0 },
                hand: [0.74, 0.2, -0.03 + rise],
                digits: [0.0, finger, finger, finger],
                contact: Contact {
                    hand_on_object: [if touched { 3.0 } else { 0.0 }, 0.0, 0.0],
                    fingers: [grip; 3],
                    palm: if touched { 3.0 } else { 0.0 },
                    table: 0.0,
                },
            }
        });
        Observation { samples: samples.collect(), crushed: false }
    }

    #[test]
    fn a_lifted_object_that_stays_in_the_hand_is_held() {
        let (outcome, measures) = judge(&good(), &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!(outcome, Outcome::Held);
        assert!((measures.lift_m - 0.1).abs() < 1e-9);
        assert!(
            (measures.contact_peak_n - 3.0).abs() < 1e-12 && (measures.contact_median_n.unwrap() - 3.0).abs() < 1e-12
        );
        assert!(
            (measures.contact_sustained_n - 3.0).abs() < 1e-12
                && (measures.contact_mean_n.unwrap() - 3.0).abs() < 1e-12
        );
        assert!((measures.touch_s.unwrap() - 5.0).abs() < 0.011, "{:?}", measures.touch_s);
        // The fingers have moved 0.05 rad a tenth of a second after they began.
        assert!((measures.closing_s.unwrap() - 8.1).abs() < 0.02, "{:?}", measures.closing_s);
        assert_eq!((measures.failure_s, measures.lift_s), (None, 12.0));
    }

    /// The change that makes it fail: the speed is that of the whole way, or goes on beyond the touch.
    #[test]
    fn the_speed_of_a_touch_is_that_of_the_moment_and_not_of_the_whole_way() {
        let mut observation = good();
        // At 3 cm/s until half a second before the touch, then at 7 cm/s along a diagonal, then standing.
        for sample in &mut observation.samples {
            let way = 0.03 * sample.time.min(5.5) + 0.07 * (sample.time - 5.5).clamp(0.0, 0.5);
            sample.hand = [0.6 * way, 0.8 * way, sample.hand[2]];
        }
        let speed = |observation: &Observation| {
            judge(observation, &MILESTONES, UPRIGHT, ArmConduct::default()).1.touch_speed_m_s
        };
        assert!((speed(&observation).unwrap() - 0.07).abs() < 1e-3, "{:?}", speed(&observation));
        // What is touched only by the closing fingers was not arrived at, and what is touched at once from nowhere.
        observation.samples.iter_mut().filter(|sample| sample.time < 9.5).for_each(|s| s.contact = Contact::default());
        assert_eq!(speed(&observation), None);
        observation.samples.retain(|sample| sample.time >= 9.5);
        assert_eq!(speed(&observation), None);
    }

    #[test]
    fn fingers_that_never_closed_have_no_time_at_which_they_did() {
        let mut observation = good();
        observation.samples.iter_mut().for_each(|sample| {
            (sample.digits, sample.object[2]) = ([0.0, 0.25, 0.25, 0.25], 0.0);
        });
        let (outcome, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!((outcome, measures.closing_s, measures.failure_s), (Outcome::Missed, None, None));
        // What is measured before they close is measured until the lift.
        assert_eq!(measures.contact_peak_n, 3.0);
    }

    #[test]
    fn a_force_on_an_object_that_is_not_touched_is_not_measured() {
        let mut observation = good();
        observation.samples.iter_mut().for_each(|sample| sample.contact.hand_on_object = [0.0; 3]);
        let (_, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!((measures.contact_median_n, measures.contact_mean_n, measures.contact_peak_n), (None, None, 0.0));
    }

    #[test]
    fn an_object_that_hangs_on_one_finger_is_not_held() {
        let mut observation = good();
        let last = observation.samples.last_mut().unwrap();
        (last.contact.fingers, last.contact.palm) = ([8.0, 0.0, 0.0], 0.0);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0, Outcome::Dropped);
        // One against the palm, or against another, holds.
        for (fingers, palm) in [([8.0, 0.0, 0.0], 3.0), ([8.0, 0.0, 8.0], 0.0)] {
            let last = observation.samples.last_mut().unwrap();
            (last.contact.fingers, last.contact.palm) = (fingers, palm);
            assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0, Outcome::Held);
        }
    }

    #[test]
    fn leaning_over_thirty_degrees_before_the_lift_is_a_failure_even_if_it_is_held() {
        let mut observation = good();
        observation.samples[800].tilt = 0.53;
        // It rocked once and came back; half a second before it falls it leaves its foot for good.
        observation.samples[700].tilt = 0.3;
        observation.samples[750..800].iter_mut().for_each(|sample| sample.tilt = 0.2);
        let (outcome, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!(outcome, Outcome::KnockedOver);
        assert!((measures.failure_s.unwrap() - 6.5).abs() < 1e-9);
        // A bottle that lies has no upright to lean from.
        assert_eq!(judge(&observation, &MILESTONES, Rule { upright: false }, ArmConduct::default()).0, Outcome::Held);
    }

    #[test]
    fn a_crushed_object_is_no_success_however_well_it_is_held() {
        let mut observation = good();
        observation.crushed = true;
        let (outcome, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!((outcome.is_success(), outcome.name(), measures.finger_peak_n), (false, "crushed", 8.0));
    }

    #[test]
    fn a_finger_is_judged_by_fifty_milliseconds_and_not_by_a_knock() {
        let mut observation = good();
        observation.samples[1100].contact.fingers = [0.0, 50.0, 0.0];
        observation.samples[1400..1405].iter_mut().for_each(|sample| sample.contact.fingers[2] = 20.0);
        let (_, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert!((measures.finger_grip_n[1] - 10.0).abs() < 1e-9 && measures.finger_peak_n == 50.0);
        assert!((measures.hardest_finger() - 20.0).abs() < 1e-9, "{:?}", measures.finger_grip_n);
    }

    #[test]
    fn an_object_that_falls_while_it_is_held_was_dropped() {
        let mut observation = good();
        observation.samples.iter_mut().filter(|sample| sample.time > 16.0).for_each(|sample| sample.object[2] = 0.0);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0, Outcome::Dropped);
        observation.samples[1620..].iter_mut().for_each(|sample| sample.contact = Contact::default());
        assert!(
            (judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).1.failure_s.unwrap() - 15.19).abs()
                < 1e-9
        );
        // Thrown up and out of the hand is not held either.
        let mut observation = good();
        observation.samples.iter_mut().filter(|sample| sample.time > 15.5).for_each(|sample| sample.object[0] = 1.3);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0, Outcome::Dropped);
    }

    #[test]
    fn an_object_that_stays_was_missed_and_one_that_went_was_pushed_away() {
        let mut observation = good();
        observation.samples.iter_mut().for_each(|sample| sample.object[2] = 0.0);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0, Outcome::Missed);
        observation.samples.iter_mut().filter(|sample| sample.time > 7.0).for_each(|sample| sample.object[1] = 0.26);
        let (outcome, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert_eq!(outcome, Outcome::PushedAway);
        assert!((measures.push_m - 0.06).abs() < 1e-12 && (measures.failure_s.unwrap() - 6.01).abs() < 1e-9);
    }

    #[test]
    fn an_arm_that_leaves_a_grasped_object_on_the_table_did_not_lift_it() {
        let mut observation = good();
        for sample in &mut observation.samples {
            (sample.object[2], sample.hand[2]) = (0.0, -0.03);
        }
        let judged = |observation: &Observation| judge(observation, &MILESTONES, UPRIGHT, ArmConduct::default()).0;
        assert_eq!(judged(&observation), Outcome::NotLifted);
        observation.samples.iter_mut().for_each(|sample| sample.contact = Contact::default());
        assert_eq!(judged(&observation), Outcome::Missed, "nothing is grasped");
    }

    #[test]
    fn an_arm_that_shakes_is_the_cause_of_a_failure_and_is_told_with_a_success() {
        let conduct = |lasting| ArmConduct { fault: None, shaking: Shaking { largest: 0.4, lasting } };
        let (outcome, measures) = judge(&good(), &MILESTONES, UPRIGHT, conduct(0.4));
        assert_eq!((outcome, measures.shaking_rad_s), (Outcome::Held, 0.4));
        let mut observation = good();
        observation.samples.iter_mut().for_each(|sample| sample.object[2] = 0.0);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, conduct(0.4)).0, Outcome::Unstable);
        assert_eq!(judge(&observation, &MILESTONES, UPRIGHT, conduct(0.25)).0, Outcome::Missed);
        let stopped = ArmConduct { fault: Some(Fault::Shaking.explanation()), ..ArmConduct::default() };
        assert_eq!(judge(&good(), &MILESTONES, UPRIGHT, stopped).0, Outcome::Unstable, "one that was stopped for it");
    }

    #[test]
    fn a_fault_outweighs_everything_and_keeps_its_name() {
        let (outcome, _) =
            judge(&good(), &MILESTONES, UPRIGHT, ArmConduct { fault: Some("soft limits"), ..ArmConduct::default() });
        assert_eq!(outcome, Outcome::Stopped("soft limits".into()));
        let text = serde_json::to_string(&outcome).unwrap();
        assert_eq!(text, r#"{"outcome":"stopped","fault":"soft limits"}"#);
        assert_eq!(serde_json::from_str::<Outcome>(&text).unwrap(), outcome);
    }

    #[test]
    fn a_short_peak_is_a_peak_but_no_sustained_force() {
        let mut observation = good();
        observation.samples[650].contact.hand_on_object = [0.0, 30.0, 400.0];
        let (_, measures) = judge(&observation, &MILESTONES, UPRIGHT, ArmConduct::default());
        assert!((measures.contact_peak_n - 30.0).abs() < 1e-12);
        assert!((measures.contact_sustained_n - 5.7).abs() < 1e-9, "{}", measures.contact_sustained_n);
        assert!((measures.contact_median_n.unwrap() - 3.0).abs() < 1e-12);
    }
}
