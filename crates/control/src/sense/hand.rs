//! `HandEstimator`: counts of the hand's pucks to angles, velocities and gauge torques, through lost and implausible
//! replies.

use nalgebra::SVector;
use puck::{Counts, gauge};

use crate::model::hand::{DIGITS, FINGERS, from_pucks};
use crate::real::Real;
use crate::sense::filter::{Butterworth, LowPass};
use crate::sense::joints::VELOCITY_CUT_OFF;
use crate::sense::sample::HandSample;
use crate::sense::wrench::WRENCH_CUT_OFF;
use crate::time::{PERIOD, RATE, few_periods};

/// Time without a reply after which the hand counts as lost: 33 ms, in control periods. A hand alone has half of it, as
/// an arm (A3); behind an arm letting go in the middle of a movement is the greater harm, and the arm goes on without
/// the fingers.
pub const LOST_CYCLES: u8 = few_periods(1.0 / 30.0);

/// Largest believed motion per control period (counts): three times the no-load speeds of 2.44 rad/s (inner link) and
/// 6.3 rad/s (spread). A larger one is believed when the next reply confirms it.
const MOTOR_GATE: [i32; DIGITS] = [
    counts_per_period(597_000.0),
    counts_per_period(597_000.0),
    counts_per_period(597_000.0),
    counts_per_period(216_000.0),
];
/// The same of the worm encoders.
const WORM_GATE: i32 = counts_per_period(240_000.0);

/// Counts in one control period at a speed (counts/s), to the nearest.
const fn counts_per_period(speed: f64) -> i32 {
    (speed * PERIOD + 0.5) as i32
}

/// Largest believed change of a gauge from one sample to the next (N m), unless the next sample confirms it.
const GAUGE_STEP: f64 = 1.0;

/// Largest torque (N m) that an automatic tare takes away once the gauges have been tared: what is more is a grip.
const GAUGE_DRIFT: f64 = 0.05;

/// State of the hand at one tick, digits in the order spread, F1, F2, F3.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandState<R: Real> {
    /// Angles of spread and inner links (rad); the last known ones where a reply is missing.
    pub q: [R; DIGITS],
    /// Filtered velocities (rad/s).
    pub dq: [R; DIGITS],
    /// Outer links relative to the inner ones (rad), without the mechanical bend of 42 degrees.
    pub outer: [R; FINGERS],
    /// Filtered, tared torque of the environment on the fingers (N m).
    pub gauges: [R; FINGERS],
    /// Control periods since each digit answered.
    pub age: [u8; DIGITS],
    /// Control periods since all three gauges answered.
    pub gauge_age: u8,
}

impl<R: Real> HandState<R> {
    /// True if a digit has been silent for so long that the hand must not be driven.
    pub fn is_lost(&self) -> bool {
        self.age.iter().any(|age| *age > LOST_CYCLES)
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
struct Encoders<R: Real> {
    motors: [Encoder; DIGITS],
    worms: [Option<Encoder>; FINGERS],
    /// Angles at the last reply (rad), spread first.
    q: [R; DIGITS],
}

/// Estimates the state of the hand.
#[derive(Clone, Debug)]
pub struct HandEstimator<R: Real> {
    encoders: Option<Encoders<R>>,
    velocity: LowPass<R, DIGITS>,
    gauge: LowPass<R, FINGERS>,
    /// Last believed torque of each gauge, not tared (N m).
    torques: [R; FINGERS],
    doubtful: [bool; FINGERS],
    zero: [R; FINGERS],
    tared: bool,
    gauge_age: Option<u8>,
}

impl<R: Real> HandEstimator<R> {
    /// An estimator that has not heard of a hand yet.
    pub fn new() -> Self {
        HandEstimator {
            encoders: None,
            velocity: LowPass::new(Butterworth::new(VELOCITY_CUT_OFF, RATE)),
            gauge: LowPass::new(Butterworth::new(WRENCH_CUT_OFF, RATE)),
            torques: [R::constant(0.0); FINGERS],
            doubtful: [false; FINGERS],
            zero: [-gauge::torque(R::from_counts(i32::from(gauge::UNLOADED))); FINGERS],
            tared: false,
            gauge_age: None,
        }
    }

    /// Takes what the hand told since the last cycle. `None` until all four digits have answered in the same cycle; a
    /// hand that is gone is learned anew, because it may have been zeroed meanwhile. The tare of the gauges is kept.
    pub fn update(&mut self, sample: Option<&HandSample>) -> Option<HandState<R>> {
        let Some(sample) = sample else {
            self.encoders = None;
            self.gauge_age = None;
            return None;
        };
        self.feel(&sample.gauges);
        match &mut self.encoders {
            None => {
                self.encoders = Some(Encoders::begin(sample)?);
                self.velocity.settle(&SVector::zeros());
            }
            Some(encoders) => {
                let rates = encoders.update(sample, self.velocity.output());
                self.velocity.step(&rates);
            }
        }
        self.state()
    }

    /// Returns the present state; `None` without an initialised hand.
    pub fn state(&self) -> Option<HandState<R>> {
        let encoders = self.encoders.as_ref()?;
        let tared = self.gauge.output() - SVector::from(self.zero);
        Some(HandState {
            q: encoders.q,
            dq: (*self.velocity.output()).into(),
            outer: encoders.angles().outer,
            gauges: tared.into(),
            age: encoders.ages(),
            gauge_age: self.gauge_age.unwrap_or(u8::MAX),
        })
    }

    /// Takes the present gauges as zero; false if none was. Those that fell silent stay as they are: what pressed on
    /// them is no zero.
    pub fn tare(&mut self) -> bool {
        let present = self.gauge_age.is_some_and(|age| age <= LOST_CYCLES);
        if present {
            self.zero = (*self.gauge.output()).into();
            self.tared = true;
        }
        present
    }

    /// Tares, unless that was done.
    pub fn tare_first(&mut self) {
        if !self.tared {
            self.tare();
        }
    }

    /// Tares each gauge, unless the gauges have been tared already and this one differs from that by more than a gauge
    /// drifts.
    pub fn tare_drift(&mut self) {
        if !self.tared {
            self.tare();
            return;
        }
        if self.gauge_age.is_none_or(|age| age > LOST_CYCLES) {
            return;
        }
        for (zero, now) in self.zero.iter_mut().zip(self.gauge.output().iter()) {
            let offset = *now - *zero;
            if offset <= R::constant(GAUGE_DRIFT) && offset >= R::constant(-GAUGE_DRIFT) {
                *zero = *now;
            }
        }
    }

    fn feel(&mut self, counts: &[Option<u16>; FINGERS]) {
        let first = self.gauge_age.is_none();
        if first && counts.contains(&None) {
            return;
        }
        let mut complete = true;
        for ((last, doubtful), counts) in self.torques.iter_mut().zip(&mut self.doubtful).zip(counts) {
            let Some(counts) = counts else {
                complete = false;
                continue;
            };
            let torque = -gauge::torque(R::from_counts(i32::from(*counts)));
            let step = torque - *last;
            let jumped = !first && (step > R::constant(GAUGE_STEP) || step < R::constant(-GAUGE_STEP));
            *doubtful = jumped && !*doubtful;
            if !*doubtful {
                *last = torque;
            }
        }
        let torques = SVector::from(self.torques);
        if first {
            self.gauge.settle(&torques);
        }
        self.gauge.step(&torques);
        self.gauge_age = Some(if complete { 0 } else { self.gauge_age.unwrap_or(0).saturating_add(1) });
    }
}

impl<R: Real> Default for HandEstimator<R> {
    fn default() -> Self {
        HandEstimator::new()
    }
}

impl<R: Real> Encoders<R> {
    fn begin(sample: &HandSample) -> Option<Self> {
        let [Some(f1), Some(f2), Some(f3), Some(spread)] = sample.primary else {
            return None;
        };
        let mut encoders = Encoders {
            motors: [f1, f2, f3, spread].map(Encoder::new),
            worms: sample.secondary.map(|worm| worm.map(Encoder::new)),
            q: [R::constant(0.0); DIGITS],
        };
        encoders.q = encoders.inner_and_spread();
        Some(encoders)
    }

    /// Takes the replies of one cycle; returns the velocities (rad/s) they show, `last` where they show none.
    fn update(&mut self, sample: &HandSample, last: &SVector<R, DIGITS>) -> SVector<R, DIGITS> {
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
        let now = self.inner_and_spread();
        let (heard, jumped) = (from_pucks(heard), from_pucks(jumped));
        let mut rates = *last;
        for digit in 0..DIGITS {
            if heard[digit] && !jumped[digit] {
                let elapsed = R::from_counts(i32::from(before[digit].saturating_add(1)));
                rates[digit] = (now[digit] - self.q[digit]) * R::constant(RATE) / elapsed;
            }
            if heard[digit] {
                self.q[digit] = now[digit];
            }
        }
        rates
    }

    fn angles(&self) -> puck::hand::HandAngles<R> {
        puck::hand::angles(&self.motors.map(|motor| motor.counts), &self.worms.map(|worm| worm.map(|worm| worm.counts)))
    }

    fn inner_and_spread(&self) -> [R; DIGITS] {
        let angles = self.angles();
        let [f1, f2, f3] = angles.inner;
        [angles.spread, f1, f2, f3]
    }

    /// Control periods since each digit's replies, spread first.
    fn ages(&self) -> [u8; DIGITS] {
        let mut ages = self.motors.map(|motor| motor.age);
        for (age, worm) in ages.iter_mut().zip(&self.worms) {
            *age = worm.map_or(*age, |worm| worm.age.max(*age));
        }
        from_pucks(ages)
    }
}
