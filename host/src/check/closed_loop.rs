//! The primitive played by the control code itself on an ideal arm: every margin that counts before motion.

use control::law::Gains;
use control::model::Calibration;
use control::plan::load;
use control::plan::primitive::posture_and_hand;
use control::time::periods;
use control::units::{JointVelocities, Vector7};
use control::{BusSample, Command, Cycle, CycleInput, CycleRecord, Event, Fault, RunOptions, State, flags};
use puck::SafetyMode;

use super::Course;
use super::plant::Plant;
use lab::arm;
use lab::boxed::boxed;
use lab::plan::PERIOD;
use lab::primitive_file::HostPrimitive;
use lab::procedure::{Change, ChangeKind};

/// Time in which the arm is taken up and comes to rest before the run begins: 1.5 s, in control periods.
const SETTLING: u64 = periods(1.5) as u64;

/// Cycles that a run may take beyond its duration: the cycle settles for 1 s and gives up at 1.5 durations.
const OVERTIME: f64 = 1.5;

/// Longest time that a goal takes to a new place: 30 s, after which the control code leaves it.
const GOAL_CHANGE: f64 = 30.0;

fn goal(goal: &link::Goal) -> control::Goal {
    control::Goal { position: goal.position, orientation: goal.orientation }
}

/// One cycle of the run.
#[derive(Debug, Clone, Copy)]
pub(super) struct Sample {
    /// Time since the run began, s.
    pub(super) time: f64,
    /// Joint positions of the arm, rad.
    pub(super) q: [f64; 7],
    /// Joint velocities, rad/s.
    pub(super) dq: [f64; 7],
    /// Speeds of elbow and forearm, as the safety module watches them, and of the tool frame, m/s.
    pub(super) speeds: [f64; 3],
    /// Tool position, m.
    pub(super) position: [f64; 3],
    /// Tool orientation.
    pub(super) orientation: [f64; 4],
    /// The records of the cycle.
    pub(super) record: CycleRecord,
}

/// The end of the run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Ending {
    /// The arm holds the goal.
    Arrived,
    /// The control code refused to begin.
    Refused(control::Refusal),
    /// This arm cannot run the primitive.
    Unfit(control::LoadError),
    /// The control code refused to load it.
    NotLoaded(control::LoadRefusal),
    /// The control code stopped the run by itself.
    Stopped(State, Fault),
    /// The run did not end in time.
    Endless,
    /// The arm's state became infinite.
    Diverged,
}

/// A whole run.
pub(super) struct ClosedLoop {
    pub(super) samples: Vec<Sample>,
    pub(super) ending: Ending,
}

impl ClosedLoop {
    /// Plays the primitive as it will be run; `progress` hears the fraction done now and then.
    pub(super) fn play(primitive: &HostPrimitive, course: &Course, mut progress: impl FnMut(f64)) -> ClosedLoop {
        let speed = course.speed;
        let mut run = ClosedLoop { samples: Vec::new(), ending: Ending::Endless };
        let mut cycle: Box<Cycle<f64>> = boxed(Cycle::init(Calibration::nominal(arm::PAYLOAD), Gains::tuned()));
        let loaded = load::check(cycle.model(), primitive).map(|fit| cycle.load(&fit));
        match loaded {
            Ok(Ok(())) => {}
            Ok(Err(refusal)) => {
                run.ending = Ending::NotLoaded(refusal);
                return run;
            }
            Err(error) => {
                run.ending = Ending::Unfit(error);
                return run;
            }
        }
        let mut plant = Plant::at(posture_and_hand(&primitive.movement().start().points).0);
        let slowest = course.changes.iter().filter_map(Change::speed).fold(speed, f64::min);
        let expected = (primitive.movement().duration() / slowest / PERIOD).ceil();
        let mut last = SETTLING + (expected * (1.0 + OVERTIME)) as u64 + u64::from(periods(6.0));
        if course.goal != link::Goal::default() || !course.changes.is_empty() {
            last += u64::from(periods(GOAL_CHANGE)) + expected as u64;
        }
        let changes = schedule(&course.changes);
        for number in 0..last {
            let Some(counts) = plant.counts() else {
                run.ending = Ending::Diverged;
                return run;
            };
            let command = match number {
                1 => Some(Command::Hold),
                SETTLING => {
                    let (speed, goal) = (speed as f32, goal(&course.goal));
                    Some(Command::Run(RunOptions { speed, goal, ..RunOptions::default() }))
                }
                _ => changes.iter().find(|(due, _)| *due == number).map(|(_, command)| *command),
            };
            let output = cycle.step(&CycleInput {
                cycle: number,
                sample: BusSample {
                    positions: counts.map(Some),
                    wrench: Some(plant.wrench()),
                    safety: Some(SafetyMode::Active),
                    hand: None,
                },
                command,
                external_fault: None,
            });
            if let (Some(Event::Refused(reason)), SETTLING..) = (output.event, number) {
                run.ending = Ending::Refused(reason);
                return run;
            }
            let record = output.record;
            if number >= SETTLING {
                match record.state {
                    State::Run | State::Coast => {
                        let time = (number - SETTLING) as f64 * PERIOD;
                        run.samples.push(sample(&plant, time, record));
                        if number % 100 == 0 {
                            progress((time * speed / primitive.movement().duration()).min(1.0));
                        }
                    }
                    State::Hold => {
                        run.ending = Ending::Arrived;
                        return run;
                    }
                    other => {
                        run.ending = Ending::Stopped(other, record.fault);
                        return run;
                    }
                }
            }
            plant.step(&Vector7::from(record.tau.map(f64::from)));
        }
        run
    }

    /// Cycles in which the limiter cut a torque.
    pub(super) fn limited_cycles(&self) -> usize {
        let cut = flags::JOINT_LIMITED | flags::MOTOR_LIMITED | flags::NOT_FINITE;
        self.samples.iter().filter(|sample| sample.record.flags & cut != 0).count()
    }
}

/// The changes with the cycle of each. A cycle takes one command, so of several at one moment the later ones come in
/// the cycles behind it, in the order in which a run sends them: none is left out.
fn schedule(changes: &[Change]) -> Vec<(u64, Command)> {
    let mut changes = changes.to_vec();
    changes.sort_by(|a, b| a.time.total_cmp(&b.time));
    let mut free = SETTLING + 1;
    changes
        .into_iter()
        .map(|change| {
            let due = free.max(SETTLING + 1 + (change.time / PERIOD) as u64);
            free = due + 1;
            let command = match change.kind {
                ChangeKind::Goal(new) => Command::SetGoal(goal(&new)),
                ChangeKind::Speed(factor) => Command::SetSpeed { factor },
            };
            (due, command)
        })
        .collect()
}

fn sample(plant: &Plant, time: f64, record: CycleRecord) -> Sample {
    let frames = plant.frames();
    let dq = JointVelocities(plant.dq);
    let pose = frames.tool_pose();
    Sample {
        time,
        q: plant.q.into(),
        dq: plant.dq.into(),
        speeds: frames.watched_speeds(&dq, control::guard::monitor::TIP_REACH),
        position: pose.position.into(),
        orientation: pose.orientation.0,
        record,
    }
}
