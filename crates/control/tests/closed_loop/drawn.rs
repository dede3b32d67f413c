//! Movements that nobody chose: drawn postures, times, friction, goals and speeds (faults A8, B3 and G9).
//!
//! `DRAWN=2000:4000 cargo test -p control --test closed_loop drawn -- --nocapture` plays others, and tells of all that
//! are stopped.

use control::command::{Command, RunOptions};
use control::model::{Frames, SOFT_MAX, SOFT_MIN};
use control::units::JointPositions;
use control::{Fault, RATE_HZ, State};

use crate::goals::{Dice, goal, model};
use crate::primitives::{Design, adapting, primitive};
use crate::rig::Rig;

/// Largest distance of a new goal from the one that was shown (m).
const REACH: f64 = 0.3;

/// A movement that was drawn.
struct Drawn {
    dice: Dice,
    start: [f64; 7],
    end: [f64; 7],
    duration: f64,
    compliant: bool,
    rig: Rig<f32>,
}

impl Drawn {
    /// One about a posture with this angle of J2 (rad); `None` where it leaves the soft limits.
    fn new(seed: u64, j2: f64) -> Option<Drawn> {
        let mut dice = Dice::new(seed);
        let middle = [0.0, j2, 0.0, 1.6, 0.0, 0.0, 0.0];
        let start = middle.map(|angle| angle + 1.2 * (dice.roll() - 0.5));
        let end = start.map(|angle| angle + 0.9 * (dice.roll() - 0.5));
        let farthest = start.iter().zip(&end).map(|(start, end)| (end - start).abs()).fold(0.0, f64::max);
        let duration = (2.6 * farthest / (0.2 + 0.4 * dice.roll())).max(1.0);
        let friction = [0.0, 0.5, 1.0, 1.3][(dice.roll() * 4.0) as usize];
        let (bent, compliant) = (dice.roll() > 0.5, dice.roll() > 0.5);
        let inside = |posture: &[f64; 7]| {
            posture.iter().zip(SOFT_MIN).zip(SOFT_MAX).all(|((angle, min), max)| (min..=max).contains(angle))
        };
        if !(inside(&start) && inside(&end)) {
            return None;
        }
        let mut rig = Rig::<f32>::new(start, 1);
        rig.plant.coulomb *= friction;
        let expected = compliant.then_some([0.0; 6]);
        rig.load(&primitive(&Design { start, goal: end, duration, bent, expected, ..Design::default() })).ok()?;
        rig.command(Command::Hold);
        rig.run_for(1.5);
        rig.command(Command::Tare);
        Some(Drawn { dice, start, end, duration, compliant, rig })
    }

    /// Begins the run, at this speed.
    fn begin(&mut self, speed: f32) -> bool {
        let options = if self.compliant { adapting() } else { RunOptions::default() };
        self.rig.command(Command::Run(RunOptions { speed, ..options }));
        self.rig.cycle.state() == State::Run
    }

    /// The run to its end, with so many changes of its goal and its speed. The fault that stops it.
    fn play(mut self, changes: usize) -> Option<Fault> {
        let speed = if changes > 0 { 0.5 + 0.7 * self.dice.roll() } else { 1.0 };
        if !self.begin(speed as f32) {
            return None;
        }
        let shown = Frames::new(&model(), &JointPositions::from_array(self.end)).tool_pose().position;
        let periods = self.duration * f64::from(RATE_HZ);
        let mut moments: Vec<u64> = (0..changes).map(|_| (1.1 * periods * self.dice.roll()) as u64).collect();
        moments.sort_unstable();
        let (begun, mut moments) = (self.rig.number, moments.into_iter().peekable());
        while self.rig.cycle.state() == State::Run {
            let now = self.rig.number - begun;
            assert!(now < 60 * u64::from(RATE_HZ), "{:?} to {:?} never ends", self.start, self.end);
            let command = moments.next_if(|moment| *moment <= now).map(|_| {
                if self.dice.roll() < 0.3 {
                    Command::SetSpeed { factor: (0.2 + self.dice.roll()) as f32 }
                } else {
                    Command::SetGoal(goal(shown + self.dice.place(REACH)))
                }
            });
            self.rig.tick(command);
        }
        Some(self.rig.cycle.fault())
    }
}

/// Plays these movements. Those that were stopped, and the number of all.
fn stopped(seeds: impl Iterator<Item = u64>, j2: f64, changes: usize) -> (Vec<(u64, Fault)>, usize) {
    let seeds: Vec<u64> = match std::env::var("DRAWN") {
        Ok(range) => {
            let (from, to) = range.split_once(':').expect("DRAWN=from:to");
            (from.parse().expect("a seed")..to.parse().expect("a seed")).collect()
        }
        Err(_) => seeds.collect(),
    };
    let faults: Vec<(u64, Fault)> =
        seeds.into_iter().filter_map(|seed| Some((seed, Drawn::new(seed, j2)?.play(changes)?))).collect();
    let played = faults.len();
    let stopped: Vec<(u64, Fault)> = faults.into_iter().filter(|(_, fault)| *fault != Fault::None).collect();
    println!("{} of {played} stopped, {changes} changes: {stopped:?}", stopped.len());
    (stopped, played)
}

/// The change that makes it fail: a joint that is turned round counts as one that meets something (`UnseenContact`), or
/// no joint of the plan is held to its speed (`JointSpeed`).
#[test]
fn b3_no_drawn_movement_near_the_axis_of_the_shoulder_is_stopped() {
    let (stopped, played) = stopped((0..60).chain([92, 290, 409, 643]), 0.0, 0);
    assert!(stopped.is_empty() && played > 60, "{stopped:?} of {played}");
}

/// The change that makes it fail: as above.
#[test]
fn b3_no_drawn_movement_is_stopped() {
    let (stopped, played) = stopped(0..60, 0.9, 0);
    assert!(stopped.is_empty() && played > 50, "{stopped:?} of {played}");
}

/// The change that makes it fail: those of above, and what a limit asks of the plan.
#[test]
fn g9_no_drawn_goal_and_no_drawn_speed_stops_a_run() {
    let (stopped, played) = stopped((0..100).chain([103, 181]), 1.1, 4);
    assert!(stopped.is_empty() && played > 90, "{stopped:?} of {played}");
}
