//! `HandEstimator`: counts to angles, velocities and gauge torques in fixed point, through lost and implausible
//! replies.
//!
//! The rules are those of `control::sense::hand`; the gates are the same.

use control::HandSample;
use puck::Counts;
use puck::hand::{COUNTS_PER_REVOLUTION, INNER_LINK_RATIO, SECONDARY_RATIO, SPREAD_RATIO};

use crate::filter::{GAUGE, LowPass, VELOCITY};
use crate::number::{Number, ZERO, constants, within};
use crate::{DIGITS, FINGERS, LOST_CYCLES};

/// Largest believed motion per control period (counts), F1 to F3 and spread: three times the no-load speeds. A larger
/// one is believed when the next reply confirms it.
const MOTOR_GATE: [i32; DIGITS] = [1990, 1990, 1990, 720];
/// The same of the worm encoders.
const WORM_GATE: i32 = 800;

/// Largest believed change of a gauge from one sample to the next (N m), unless the next sample confirms it.
const GAUGE_STEP: Number = Number::constant(1.0);

/// Reading of an unloaded gauge, before a tare.
const UNLOADED: u16 = puck::gauge::UNLOADED;

/// Barrett's curve of a gauge over `counts / 4096`, constant first (N m): the powers of 4096 keep its coefficients, of
/// which the largest power has 2.8e-10, above the resolution.
const CURVE: [Number; 4] =
    constants([-2.85, 0.003764 * 4096.0, -1.708e-6 * 4096.0 * 4096.0, 2.754e-10 * 4096.0 * 4096.0 * 4096.0]);

/// Fraction bits of the angle of one count.
const COUNT_BITS: u32 = 48;

/// Angle of one count of an encoder that turns `ratio` times as fast as its link, 48 fraction bits.
const fn angle_per_count(ratio: f64) -> i64 {
    (core::f64::consts::TAU / COUNTS_PER_REVOLUTION / ratio * (1_u64 << COUNT_BITS) as f64 + 0.5) as i64
}
const MOTOR_ANGLE: i64 = angle_per_count(INNER_LINK_RATIO);
const WORM_ANGLE: i64 = angle_per_count(SECONDARY_RATIO);
const SPREAD_ANGLE: i64 = angle_per_count(SPREAD_RATIO);

/// The control rate over 1 to 256 control periods (Hz).
const RATES: [Number; 256] = {
    let mut rates = [ZERO; 256];
    let mut index = 0;
    while index < 256 {
        rates[index] = Number::constant(control::RATE / (index as f64 + 1.0));
        index += 1;
    }
    rates
};

/// Angle (rad) of a position in counts.
fn angle(counts: Counts, per_count: i64) -> Number {
    // 32 bits of counts times at most 2^41 do not reach 2^63 for what 22 bits and some turns can hold; beyond, it
    // saturates.
    Number::from_bits(i64::from(counts.0).saturating_mul(per_count) >> (COUNT_BITS - crate::number::FRACTION_BITS))
}

/// Torque of the environment on the finger (N m) for a reading, by Barrett's curve: negative when the finger presses in
/// closing.
pub fn gauge_torque(counts: u16) -> Number {
    let place = Number::from_bits(i64::from(counts.min(puck::gauge::LARGEST)) << 20);
    let [c0, c1, c2, c3] = CURVE;
    -(((c3 * place + c2) * place + c1) * place + c0)
}

/// Measured state of the hand at one tick, spread first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HandState {
    /// Angles of spread and inner links (rad); the last known ones where a reply is missing.
    pub q: [Number; DIGITS],
    /// Filtered velocities (rad/s).
    pub dq: [Number; DIGITS],
    /// Filtered, tared torque of the environment on the fingers (N m).
    pub gauges: [Number; FINGERS],
    /// Control periods since each digit answered.
    pub age: [u8; DIGITS],
    /// Control periods since all three gauges answered.
    pub gauge_age: u8,
}

impl HandState {
    /// Control periods since the digit that is silent the longest answered.
    pub fn oldest(&self) -> u8 {
        self.age.iter().copied().max().unwrap_or(u8::MAX)
    }

    /// True if the gauges can be believed.
    pub fn feels(&self) -> bool {
        self.gauge_age <= LOST_CYCLES
    }
}

/// One encoder.
#[derive(Clone, Copy, Debug)]
struct Encoder {
    counts: Counts,
    age: u8,
    doubtful: Option<Counts>,
}

impl Encoder {
    fn new(counts: Counts) -> Self {
        Encoder { counts: counts.wrapped(), age: 0, doubtful: None }
    }

    /// Takes a reply; false if it is missing or not believed.
    fn take(&mut self, reply: Option<Counts>, gate: i32) -> bool {
        let elapsed = self.age.saturating_add(1);
        self.age = elapsed;
        let Some(counts) = reply.map(|raw| raw.unwrapped_near(self.counts)) else {
            return false;
        };
        let near =
            |one: Counts, other: Counts, gate: i32| one.0.wrapping_sub(other.0).unsigned_abs() <= gate.unsigned_abs();
        let reach = gate.saturating_mul(i32::from(elapsed.min(LOST_CYCLES)));
        if near(counts, self.counts, reach) || self.doubtful.is_some_and(|before| near(counts, before, gate)) {
            *self = Encoder { counts, age: 0, doubtful: None };
            return true;
        }
        self.doubtful = Some(counts);
        false
    }
}

/// The encoders of an initialised hand, in the order of its pucks.
#[derive(Clone, Copy, Debug)]
struct Encoders {
    motors: [Encoder; DIGITS],
    worms: [Option<Encoder>; FINGERS],
    /// Angles at the last reply (rad), spread first.
    q: [Number; DIGITS],
}

/// Estimates the state of the hand.
#[derive(Clone, Debug)]
pub struct HandEstimator {
    encoders: Option<Encoders>,
    velocity: LowPass<DIGITS>,
    gauge: LowPass<FINGERS>,
    /// Last believed torque of each gauge, not tared (N m).
    measured: [Number; FINGERS],
    doubtful: [bool; FINGERS],
    zero: Option<[Number; FINGERS]>,
    gauge_age: Option<u8>,
}

impl HandEstimator {
    /// An estimator that has not heard of a hand yet.
    pub const fn new() -> Self {
        HandEstimator {
            encoders: None,
            velocity: LowPass::new(VELOCITY),
            gauge: LowPass::new(GAUGE),
            measured: [ZERO; FINGERS],
            doubtful: [false; FINGERS],
            zero: None,
            gauge_age: None,
        }
    }

    /// Takes what the hand told since the last cycle. `None` until all four digits have answered in the same cycle; a
    /// hand that is gone is learned anew. The tare of the gauges is kept.
    pub fn update(&mut self, sample: Option<&HandSample>) -> Option<HandState> {
        let Some(sample) = sample else {
            self.encoders = None;
            self.gauge_age = None;
            return None;
        };
        self.feel(&sample.gauges);
        match &mut self.encoders {
            None => {
                self.encoders = Some(Encoders::begin(sample)?);
                self.velocity.settle(&[ZERO; DIGITS]);
            }
            Some(encoders) => {
                let rates = encoders.update(sample, self.velocity.output());
                self.velocity.step(&rates);
            }
        }
        self.state()
    }

    /// The present state; `None` without an initialised hand.
    pub fn state(&self) -> Option<HandState> {
        let encoders = self.encoders.as_ref()?;
        let zero = self.zero.unwrap_or([gauge_torque(UNLOADED); FINGERS]);
        let gauges = self.gauge.output();
        Some(HandState {
            q: encoders.q,
            dq: *self.velocity.output(),
            gauges: core::array::from_fn(|finger| gauges[finger] - zero[finger]),
            age: encoders.ages(),
            gauge_age: self.gauge_age.unwrap_or(u8::MAX),
        })
    }

    /// Takes the present gauges as zero; false if none was. Those that fell silent stay as they are: what pressed on
    /// them is no zero.
    pub fn tare(&mut self) -> bool {
        let present = self.gauge_age.is_some_and(|age| age <= LOST_CYCLES);
        if present {
            self.zero = Some(*self.gauge.output());
        }
        present
    }

    /// Tares, unless that was done. Not inlined: a run that begins goes deepest of all.
    #[inline(never)]
    pub fn tare_first(&mut self) {
        if !self.is_tared() {
            self.tare();
        }
    }

    /// True if the gauges have been tared.
    pub fn is_tared(&self) -> bool {
        self.zero.is_some()
    }

    fn feel(&mut self, counts: &[Option<u16>; FINGERS]) {
        let first = self.gauge_age.is_none();
        if first && counts.contains(&None) {
            return;
        }
        let mut complete = true;
        for ((measured, doubtful), counts) in self.measured.iter_mut().zip(&mut self.doubtful).zip(counts) {
            let Some(counts) = counts else {
                complete = false;
                continue;
            };
            let torque = gauge_torque(*counts);
            let step = torque - *measured;
            let jumped = !first && within(step, GAUGE_STEP) != step;
            *doubtful = jumped && !*doubtful;
            if !*doubtful {
                *measured = torque;
            }
        }
        if first {
            self.gauge.settle(&self.measured);
        }
        self.gauge.step(&self.measured);
        self.gauge_age = Some(if complete { 0 } else { self.gauge_age.unwrap_or(0).saturating_add(1) });
    }
}

impl Default for HandEstimator {
    fn default() -> Self {
        HandEstimator::new()
    }
}

impl Encoders {
    fn begin(sample: &HandSample) -> Option<Self> {
        let [Some(f1), Some(f2), Some(f3), Some(spread)] = sample.primary else {
            return None;
        };
        let mut encoders = Encoders {
            motors: [f1, f2, f3, spread].map(Encoder::new),
            worms: sample.secondary.map(|worm| worm.map(Encoder::new)),
            q: [ZERO; DIGITS],
        };
        encoders.q = encoders.angles();
        Some(encoders)
    }

    /// Takes the replies of one cycle; returns the velocities (rad/s) they show, `last` where they show none.
    fn update(&mut self, sample: &HandSample, last: &[Number; DIGITS]) -> [Number; DIGITS] {
        let before = self.ages();
        let mut heard = [false; DIGITS];
        let mut jumped = [false; DIGITS];
        let motors = self.motors.iter_mut().zip(&sample.primary).zip(MOTOR_GATE);
        for (((motor, reply), gate), (heard, jumped)) in motors.zip(heard.iter_mut().zip(&mut jumped)) {
            *jumped = motor.doubtful.is_some();
            *heard = motor.take(*reply, gate);
        }
        for (((worm, reply), heard), jumped) in
            self.worms.iter_mut().zip(&sample.secondary).zip(&mut heard).zip(&mut jumped)
        {
            match worm {
                // Both encoders come in one frame: half of it is none.
                Some(worm) => {
                    *jumped |= worm.doubtful.is_some();
                    *heard &= worm.take(*reply, WORM_GATE);
                }
                None => *worm = reply.filter(|_| *heard).map(Encoder::new),
            }
        }
        let now = self.angles();
        let (heard, jumped) = (spread_first(heard), spread_first(jumped));
        let mut rates = *last;
        for digit in 0..DIGITS {
            if heard[digit] && !jumped[digit] {
                rates[digit] = (now[digit] - self.q[digit]) * RATES[usize::from(before[digit])];
            }
            if heard[digit] {
                self.q[digit] = now[digit];
            }
        }
        rates
    }

    /// Angles of spread and inner links (rad).
    fn angles(&self) -> [Number; DIGITS] {
        let [f1, f2, f3, spread] = self.motors;
        let [w1, w2, w3] = self.worms;
        let inner = |motor: Encoder, worm: Option<Encoder>| match worm {
            Some(worm) => angle(worm.counts, WORM_ANGLE),
            None => angle(motor.counts, MOTOR_ANGLE),
        };
        [angle(spread.counts, SPREAD_ANGLE), inner(f1, w1), inner(f2, w2), inner(f3, w3)]
    }

    /// Control periods since each digit's replies, spread first.
    fn ages(&self) -> [u8; DIGITS] {
        let mut ages = self.motors.map(|motor| motor.age);
        for (age, worm) in ages.iter_mut().zip(&self.worms) {
            *age = worm.map_or(*age, |worm| worm.age.max(*age));
        }
        spread_first(ages)
    }
}

/// From the pucks' order (F1, F2, F3, spread) to that of the primitives (spread, F1, F2, F3).
pub(crate) fn spread_first<T>([f1, f2, f3, spread]: [T; DIGITS]) -> [T; DIGITS] {
    [spread, f1, f2, f3]
}

/// From the primitives' order to that of the pucks.
pub(crate) fn spread_last<T>([spread, f1, f2, f3]: [T; DIGITS]) -> [T; DIGITS] {
    [f1, f2, f3, spread]
}
