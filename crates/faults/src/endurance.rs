//! Endurance: storm after storm on one arm in one process, uploads and whole movements between them, for hours of
//! simulated time. Memory and descriptors of the process stay what they are.

use std::path::Path;
use std::time::Duration;

use lab::transport::SimulatorKind;
use sim::{PendantAction, seconds};

use crate::bench::{self, Arm, Failure, plant};
use crate::entry::Recover;
use crate::recovery;
use crate::run::{self, Verdict};
use crate::storm;

/// The session's clock, in ms, begins anew after this time: it does in the middle of every course.
const WRAP: Duration = Duration::from_millis(1 << 32);

/// Part of the course after which memory is that of a process that has seen everything.
const WARM: f64 = 0.5;

/// Most by which memory may grow from then on, kiB: what the allocator moves about.
const GROWTH: u64 = 2048;

/// State of the process at one moment.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Process {
    /// Resident memory, kiB.
    pub memory: u64,
    /// Open file descriptors.
    pub descriptors: usize,
}

/// Result of a course.
#[derive(Debug)]
pub struct Course {
    /// Simulated time, h.
    pub hours: f64,
    /// Rounds: a storm, the way back, a whole movement.
    pub rounds: u64,
    /// Rounds outside the bars, or without a way back other than by an E-stop.
    pub failed: Vec<Verdict>,
    /// Cycles whose torque frames were not queued in time.
    pub missed_deadlines: u32,
    /// The process after the first part, and at the end.
    pub process: [Process; 2],
}

impl Course {
    /// True if every round was within its bars and the process is what it was.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.failed.is_empty() && self.missed_deadlines == 0 && self.is_constant()
    }

    /// True if memory and descriptors are what they were.
    #[must_use]
    pub fn is_constant(&self) -> bool {
        let [before, after] = self.process;
        after.memory <= before.memory + GROWTH && after.descriptors == before.descriptors
    }
}

/// Lets storms of the seeds from `first` on befall one arm for so many hours of simulated time. `tell` is given the
/// hours, rounds and failures so far, and the process, after every round.
///
/// # Errors
/// The arm does not come back even by an E-stop, or the process cannot be looked at.
pub fn run(hours: f64, first: u64, mut tell: impl FnMut(f64, u64, usize, Process)) -> Result<Course, Failure> {
    let uptime = WRAP.saturating_sub(Duration::from_secs_f64(1800.0 * hours));
    let mut arm = bench::connected(bench::simulation(first, uptime, SimulatorKind::InProcess)?)?;
    let (mut rounds, mut failed, mut warm) = (0, Vec::new(), None);
    loop {
        let verdict = round(&mut arm, first.wrapping_add(rounds))?;
        rounds += 1;
        failed.extend(Some(verdict).filter(|verdict| !verdict.holds()));
        let (now, process) = (seconds(plant(&mut arm).now()) / 3600.0, process()?);
        tell(now, rounds, failed.len(), process);
        if warm.is_none() && now >= WARM * hours {
            warm = Some(process);
        }
        if now >= hours {
            let missed_deadlines = arm.statistics()?.missed_deadlines;
            let process = [warm.unwrap_or(process), process];
            return Ok(Course { hours: now, rounds, failed, missed_deadlines, process });
        }
    }
}

/// One storm, and the way back.
fn round(arm: &mut Arm, seed: u64) -> Result<Verdict, Failure> {
    let scenario = storm::draw(seed);
    let mut verdict = Verdict::open("endurance", &scenario);
    let outcome = bench::begin(arm, &scenario)
        .and_then(|()| Ok(arm.set_telemetry(1)?))
        .and_then(|()| run::judged(arm, &scenario, None, &mut verdict));
    if let Err(failure) = outcome {
        verdict.failures.push(failure.to_string());
        // Where the arm cannot be got back otherwise, a person presses the E-stop: its zero is lost, and given anew.
        plant(arm).press(PendantAction::PressEStop);
        arm.next(Duration::from_secs(1))?;
        recovery::recover(arm, Recover::ZeroIfAsked)
            .map_err(|second| format!("seed {seed}: {failure}; after an E-stop: {second}"))?;
    }
    plant(arm).take_recorded();
    Ok(verdict)
}

/// The process now.
fn process() -> Result<Process, Failure> {
    let status = std::fs::read_to_string("/proc/self/status")?;
    let memory = status.lines().find_map(|line| line.strip_prefix("VmRSS:")?.split_whitespace().next()?.parse().ok());
    let descriptors = std::fs::read_dir(Path::new("/proc/self/fd"))?.count();
    Ok(Process { memory: memory.ok_or("/proc/self/status tells no memory")?, descriptors })
}
