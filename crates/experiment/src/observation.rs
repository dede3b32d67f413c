//! The state of the world in a trial, every 10 ms: quantities that no sensor of the arm measures.

/// Physics steps in one sample: 10 ms, over which contact forces are averaged. Shorter peaks are the contact
/// solver's, not the world's.
pub const STEPS_PER_SAMPLE: usize = 18;

/// Time between two samples, s.
pub const SAMPLE_SECONDS: f64 = STEPS_PER_SAMPLE as f64 * sim::STEP_SECONDS;

/// Contact forces, N.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Contact {
    /// Of the whole hand on the object, world axes.
    pub hand_on_object: [f64; 3],
    /// Of each finger on the object: magnitude.
    pub fingers: [f64; 3],
    /// Of the palm on the object: magnitude.
    pub palm: f64,
    /// Of the hand on the table: magnitude.
    pub table: f64,
}

impl Contact {
    /// Adds a share of another contact.
    pub fn add(&mut self, share: f64, other: &Contact) {
        for axis in 0..3 {
            self.hand_on_object[axis] += share * other.hand_on_object[axis];
            self.fingers[axis] += share * other.fingers[axis];
        }
        self.palm += share * other.palm;
        self.table += share * other.table;
    }

    /// Horizontal force of the hand on the object: the one that tips it over.
    pub fn horizontal(&self) -> f64 {
        self.hand_on_object[0].hypot(self.hand_on_object[1])
    }

    /// True while the hand touches the object.
    pub fn touches(&self) -> bool {
        self.palm > 0.0 || self.fingers.iter().any(|force| *force > 0.0)
    }
}

/// The world at the end of 10 ms, and the forces averaged over them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sample {
    /// Virtual time, s.
    pub time: f64,
    /// Centre of the object, m.
    pub object: [f64; 3],
    /// Angle between the object's axis and its direction at the start of the trial, rad.
    pub tilt: f64,
    /// Grasp point of the hand, m.
    pub hand: [f64; 3],
    /// Spread and inner links of F1, F2, F3, rad.
    pub digits: [f64; 4],
    /// Contact forces.
    pub contact: Contact,
}

/// When the parts of a trial began, virtual time, s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Milestones {
    /// The primitive started.
    pub run: f64,
    /// The arm began to lift.
    pub lift: f64,
    /// The arm had lifted and held.
    pub hold: f64,
}

/// A trial as the world saw it.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Observation {
    /// Samples in order of time.
    pub samples: Vec<Sample>,
    /// True once a finger has pressed harder than the object bears.
    pub crushed: bool,
}

impl Observation {
    /// The samples with `from <= time < to`.
    pub fn between(&self, from: f64, to: f64) -> &[Sample] {
        let begin = self.samples.partition_point(|sample| sample.time < from);
        let end = self.samples.partition_point(|sample| sample.time < to);
        self.samples.get(begin..end.max(begin)).unwrap_or(&[])
    }

    /// The last sample before `time`.
    pub fn at(&self, time: f64) -> Option<&Sample> {
        let next = self.samples.partition_point(|sample| sample.time <= time);
        self.samples.get(next.checked_sub(1)?)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sample_lasts_ten_milliseconds() {
        assert!((SAMPLE_SECONDS - 0.01).abs() < 1e-6);
    }

    #[test]
    fn a_window_holds_its_beginning_and_not_its_end() {
        let sample = |time| Sample {
            time,
            object: [0.0; 3],
            tilt: 0.0,
            hand: [0.0; 3],
            digits: [0.0; 4],
            contact: Contact::default(),
        };
        let observation =
            Observation { samples: (0..10).map(|k| sample(f64::from(k))).collect(), ..Observation::default() };
        assert_eq!(observation.between(2.0, 4.0).iter().map(|s| s.time).collect::<Vec<_>>(), [2.0, 3.0]);
        assert!(observation.between(4.0, 2.0).is_empty());
        assert_eq!(observation.at(3.5).map(|s| s.time), Some(3.0));
        assert_eq!(observation.at(-0.5), None);
    }
}
