//! The help for a run that its check refuses: a command that shows the same refusal, and what to change.

use std::fmt::Write as _;
use std::path::Path;

use lab::procedure::{Change, ChangeKind};
use link::Goal;

use super::{CheckReport, Course, Limit, UNFIT};
use lab::quoted;

/// Slowest run, as a factor of the taught speed.
const SLOWEST: f64 = 0.1;

impl CheckReport {
    /// Changes by which the run may pass: a slower run only where a limit of speed or torque is in its way.
    pub fn advice(&self) -> String {
        let broken = || self.margins.iter().filter(|margin| margin.margin.is_nan() || margin.margin < 0.0);
        let of_speed =
            |limit| matches!(limit, Limit::JointVelocity | Limit::JointTorque | Limit::TipSpeed | Limit::HandSpeed);
        let slower = (self.speed / 2.0).max(SLOWEST);
        let mut advice = String::new();
        let can_help = self.limited_cycles > 0 || broken().any(|margin| of_speed(margin.limit));
        if slower < self.speed && can_help {
            let _ = write!(advice, "run it more slowly (`--speed {}`), ", rounded(slower));
        }
        if self.goal_m.is_some() {
            advice.push_str("choose another goal, ");
        }
        if !advice.is_empty() {
            advice.push_str("or ");
        }
        // The fingers were not shown: options of `learn` gave their angles.
        let of_hand = broken().next().is_some() && broken().all(|margin| margin.limit == Limit::HandPosition);
        // A plan that does not arrive comes to its goal in motion, or short of it: its end was cut off, or was never at
        // rest, or its last part is too fast for its kernels. Where the plan arrives, it is the arm that does not.
        let of_goal = broken().next().is_some()
            && broken().all(|margin| matches!(margin.limit, Limit::GoalPosition | Limit::GoalOrientation));
        let of_expectation = broken().next().is_some()
            && broken().all(|margin| matches!(margin.limit, Limit::ExpectedAtSensor | Limit::ExpectedTorque));
        let is_unfit =
            broken().next().is_none() && self.violations.iter().any(|violation| violation.starts_with(UNFIT));
        let last = if is_unfit {
            "no speed and no goal helps: learn it again, from another demonstration or with other options"
        } else if of_expectation {
            "record what it expects again (`tactus rehearse`)"
        } else if of_hand {
            "learn it again with other angles of the hand (`--hand-start`, `--hand-goal`)"
        } else if of_goal && self.goal_m.is_none() && self.plan_arrives {
            "show the movement with its end farther from where the arm is stretched out, and from the limits of its joints: near them it comes to its goal too slowly"
        } else if of_goal && self.goal_m.is_none() {
            "learn it again so that it ends at rest: with more kernels (`--kernels 100`), with a lower `--still-speed 0.001`, with `--no-trim`, or from a demonstration that rests at its goal"
        } else {
            "show the movement farther from the limits and learn it again"
        };
        advice + last
    }

    /// Moment of the first violation that has one, s.
    fn first_broken(&self) -> Option<f64> {
        let broken = self.margins.iter().filter(|margin| margin.margin.is_nan() || margin.margin < 0.0);
        broken.map(|margin| margin.time_s).min_by(f64::total_cmp)
    }
}

impl Course {
    /// Help for a run of this primitive that the check refused: the change on the way that it comes after, or the
    /// command that shows every limit.
    pub fn help(&self, file: &Path, report: &CheckReport) -> String {
        let before = report.first_broken().unwrap_or(f64::INFINITY);
        let earlier = self.changes.iter().filter(|change| change.time <= before);
        if let Some(change) = earlier.max_by(|a, b| a.time.total_cmp(&b.time)) {
            let asked = words(change);
            return match change.kind {
                ChangeKind::Goal(_) => format!("it comes after `{asked}`: choose another goal or time there"),
                ChangeKind::Speed(_) => format!("it comes after `{asked}`: choose a lower speed or another time there"),
            };
        }
        let mut options = String::new();
        if (self.speed - 1.0).abs() > f64::EPSILON {
            let _ = write!(options, " --speed {}", self.speed);
        }
        if let Some(goal) = self.goal.position {
            let _ = write!(options, " --goal {}", place(goal));
        }
        let name = quoted::path(file);
        let command = if file.is_file() {
            format!("`tactus check {name}{options}`")
        } else {
            format!("`tactus get {name}` and `tactus check {name}.toml{options}`")
        };
        format!("{}; {command} shows every limit", report.advice())
    }
}

/// A change on the way as the command line has it.
fn words(change: &Change) -> String {
    match change.kind {
        ChangeKind::Goal(Goal { position, .. }) => {
            format!("--goal-at {}:{}", change.time, position.map_or_else(String::new, place))
        }
        ChangeKind::Speed(factor) => format!("--speed-at {}:{factor}", change.time),
    }
}

fn place([x, y, z]: [f32; 3]) -> String {
    format!("{x},{y},{z}")
}

/// Two digits behind the point are enough for a speed.
fn rounded(speed: f64) -> f64 {
    (speed * 100.0).round() / 100.0
}
