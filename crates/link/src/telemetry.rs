//! `Telemetry`: one control cycle for the host, and in short form for the fault memory.
//!
//! A new field stands at the end of the struct. A real one is also named in `Telemetry::values` and has its steps in
//! `STEPS`; another one has its place in the words at the beginning of the short form.

use serde::{Deserialize, Serialize};

/// One control cycle as the device saw it.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
pub struct Telemetry {
    /// Control cycle, 300 a second. A step of more than the asked decimation is a gap.
    pub cycle: u32,
    /// Code of the supervisor's state.
    pub state: u8,
    /// Code of the latched fault, 0 for none.
    pub fault: u8,
    /// Flag bits of the cycle record (`control`).
    pub flags: u32,
    /// Phase s of the primitive.
    pub phase: f32,
    /// Measured joint angles, rad.
    pub q: [f32; 7],
    /// Estimated joint velocities, rad/s.
    pub dq: [f32; 7],
    /// Joint torques sent, after the limiter, N m.
    pub tau: [f32; 7],
    /// Desired pose of the grasp point in the world: x, y, z (m), quaternion w, x, y, z.
    pub pose_d: [f32; 7],
    /// Wrench of the environment on the robot at the grasp point: force in world axes (N), torque in
    /// hand axes (N m).
    pub wrench: [f32; 6],
    /// Replies missing in this cycle.
    pub lost_replies: u8,
    /// Control computation of this cycle, ticks.
    pub cost_ticks: u32,
    /// Spread and fingers F1 to F3 (inner links) as measured, rad.
    pub hand: [f32; 4],
    /// The same as desired, rad.
    pub hand_d: [f32; 4],
    /// Torque of the environment on fingers F1 to F3 about their outer joints, by the strain gauges, N m: negative when
    /// they close on an object.
    pub gauges: [f32; 3],
    /// Difference between this run and the successful ones before it (z-score); 0 when nothing is compared.
    pub surprise: f32,
}

/// Steps per unit of each run of `Telemetry::values`, with its length. More than 32767 steps become as many.
const STEPS: [(usize, f32); 12] = [
    (1, 30_000.0), // phase
    (7, 6250.0),   // q: 0.16 mrad, up to 5.24 rad: J5 stands at -4.76 when it is at its stop
    (7, 1000.0),   // dq: 1 mrad/s
    (7, 250.0),    // tau: 4 mN m
    (3, 10_000.0), // pose_d: 0.1 mm
    (4, 32_000.0), // its quaternion
    (3, 50.0),     // force: 20 mN
    (3, 500.0),    // torque: 2 mN m
    (4, 8000.0),   // hand
    (4, 8000.0),   // hand_d
    (3, 4000.0),   // gauges: 0.25 mN m
    (1, 100.0),    // surprise
];

/// Words in front of the values: cycle, flags with lost replies, codes, cost.
const FIRST_WORDS: usize = 4;
/// Words of the short form.
const SHORT_WORDS: usize = FIRST_WORDS + value_count().div_ceil(2);

/// The number that stands for one that is not a number.
const NOT_A_NUMBER: i16 = i16::MIN;

/// A control cycle in words, 16 bits a value. All content is a valid cycle.
pub type ShortTelemetry = [u32; SHORT_WORDS];

impl Telemetry {
    /// The real values, in the order of `STEPS`.
    fn values(&mut self) -> impl Iterator<Item = &mut f32> {
        core::iter::once(&mut self.phase)
            .chain(&mut self.q)
            .chain(&mut self.dq)
            .chain(&mut self.tau)
            .chain(&mut self.pose_d)
            .chain(&mut self.wrench)
            .chain(&mut self.hand)
            .chain(&mut self.hand_d)
            .chain(&mut self.gauges)
            .chain(core::iter::once(&mut self.surprise))
    }

    /// The short form: values rounded to their step and cut at 32767 of them, flags to 24 bits.
    #[must_use]
    pub fn shortened(mut self) -> ShortTelemetry {
        let [low, middle, high, _] = self.flags.to_le_bytes();
        let first = [
            self.cycle,
            u32::from_le_bytes([low, middle, high, self.lost_replies]),
            u32::from_le_bytes([self.state, self.fault, 0, 0]),
            self.cost_ticks,
        ];
        let mut halves = self.values().zip(steps()).map(|(value, steps)| {
            let scaled = *value * steps;
            let rounded = (scaled + if scaled < 0.0 { -0.5 } else { 0.5 }) as i16;
            let short = if scaled.is_nan() { NOT_A_NUMBER } else { rounded.max(-i16::MAX) };
            u32::from(short.cast_unsigned())
        });
        let pairs = core::iter::from_fn(|| halves.next().map(|low| low | halves.next().unwrap_or(0) << 16));
        let mut words = [0; SHORT_WORDS];
        for (word, value) in words.iter_mut().zip(first.into_iter().chain(pairs)) {
            *word = value;
        }
        words
    }

    /// The cycle that a short form stands for. What was no number is none.
    #[must_use]
    pub fn from_short(words: &ShortTelemetry) -> Telemetry {
        let [cycle, flags, codes, cost_ticks, pairs @ ..] = words;
        let [low, middle, high, lost_replies] = flags.to_le_bytes();
        let [state, fault, ..] = codes.to_le_bytes();
        let mut telemetry = Telemetry {
            cycle: *cycle,
            state,
            fault,
            flags: u32::from_le_bytes([low, middle, high, 0]),
            lost_replies,
            cost_ticks: *cost_ticks,
            ..Telemetry::default()
        };
        let halves = pairs.iter().flat_map(|pair| [*pair as u16, (pair >> 16) as u16]);
        for ((value, steps), half) in telemetry.values().zip(steps()).zip(halves) {
            let short = half.cast_signed();
            *value = if short == NOT_A_NUMBER { f32::NAN } else { f32::from(short) / steps };
        }
        telemetry
    }
}

/// Steps per unit of each value.
fn steps() -> impl Iterator<Item = f32> {
    STEPS.into_iter().flat_map(|(count, steps)| core::iter::repeat_n(steps, count))
}

const fn value_count() -> usize {
    let (mut sum, mut run) = (0, 0);
    while run < STEPS.len() {
        sum += STEPS[run].0;
        run += 1;
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A cycle with 62 or 0.186 in every field: one that is new needs no word here.
    fn full() -> Telemetry {
        postcard::from_bytes(&[0x3E; 256]).expect("numbers")
    }

    #[test]
    fn short_form_keeps_every_field_to_its_step() {
        let (mut whole, mut kept) = (full(), Telemetry::from_short(&full().shortened()));
        for ((whole, kept), steps) in whole.values().zip(kept.values()).zip(steps()) {
            let within = (-32767.0 / steps..=32767.0 / steps).contains(whole);
            assert!(*whole != 0.0 && within && (*whole - *kept).abs() <= 0.5 / steps + 1e-6, "{whole} {kept} {steps}");
            (*whole, *kept) = (0.0, 0.0);
        }
        assert_eq!(kept, whole, "what is no real number is kept as it is");
        assert_eq!((whole.values().count(), steps().count()), (value_count(), value_count()));
    }

    #[test]
    fn no_word_of_the_short_form_is_spare() {
        assert!(full().shortened().iter().all(|word| *word != 0));
    }

    #[test]
    fn what_is_no_number_stays_none_and_what_is_too_large_is_cut() {
        let mut broken = Telemetry { fault: 6, ..Telemetry::default() };
        (broken.tau[3], broken.dq[0], broken.wrench[2]) = (f32::NAN, f32::INFINITY, -1e9);
        (broken.q[0], broken.tau[0], broken.gauges[2]) = (-2.6001, 79.998, -0.5001);
        let kept = Telemetry::from_short(&broken.shortened());
        assert!(kept.tau[3].is_nan() && kept.tau[2] == 0.0 && kept.fault == 6);
        let off = [kept.q[0] + 2.6001, kept.tau[0] - 79.998, kept.gauges[2] + 0.5001];
        assert!(off.iter().zip([70e-6, 2.1e-3, 130e-6]).all(|(off, most)| off.abs() < most), "{off:?}");
        assert!((kept.dq[0] - 32.767).abs() < 1e-3 && (kept.wrench[2] + 655.34).abs() < 1e-3, "{kept:?}");
    }
}
