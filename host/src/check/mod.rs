//! Validation before motion: is this primitive whole, does it belong to this arm, and can the arm follow it?
//!
//! First the plan alone (finite, goal reached, within reach), then the plan played by the *same* control code that
//! runs on the device, in double precision, on an ideal arm with the model's friction. Every limit is reported with
//! its worst margin and the time at which it occurs; a negative margin is a violation.

mod advice;
mod closed_loop;
mod expected;
mod plant;

use control::guard::monitor::{HAND_SPEED_LIMIT, TIP_SPEED_LIMIT, TIP_SPEED_WARNING};
use control::model::{FINGER_RANGE, SOFT_MAX, SOFT_MIN, SPREAD_RANGE, VELOCITY_MAX};
use control::plan::bounds::HELD_BACK;
use control::plan::load::{REACH, within_reach};
use control::plan::primitive::posture_and_hand;
use serde::Serialize;

use closed_loop::{ClosedLoop, Ending, Sample};
use lab::arm::TORQUE_LIMITS;
use lab::demonstration::angle_between;
use lab::plan;
use lab::primitive_file::{PrimitiveFile, PrimitiveFileError};
use lab::procedure::{Change, ChangeKind};
use lab::table::Table;
use link::Goal;

/// Largest distance of the arm from the goal when the run is over, m.
pub const GOAL_DISTANCE: f64 = 3e-3;
/// Largest angle from the goal when the run is over, rad: 1 degree.
pub const GOAL_ANGLE: f64 = std::f64::consts::PI / 180.0;

/// Share of a speed limit that a plan may use: a compliant arm that catches up with it is up to a tenth faster.
const CATCHING_UP: f64 = 0.9;

/// The digits of the hand and the angles they can have, rad.
pub const DIGITS: [(&str, [f64; 2]); 4] =
    [("spread", SPREAD_RANGE), ("finger 1", FINGER_RANGE), ("finger 2", FINGER_RANGE), ("finger 3", FINGER_RANGE)];

/// Angle by which a plan of the hand may leave its range, rad: a smooth plan between two ends of it overshoots by that.
const HAND_SLACK: f64 = 0.05;

/// Which limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, schemars::JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Limit {
    /// Distance of a joint to its nearer soft limit, rad.
    JointPosition,
    /// Joint speed, rad/s.
    JointVelocity,
    /// Joint torque, N m.
    JointTorque,
    /// Speed of elbow and forearm, m/s.
    TipSpeed,
    /// Speed of the hand, m/s.
    HandSpeed,
    /// Distance of the planned tool position from the shoulder, m.
    Reach,
    /// Angle of a digit of the hand, rad.
    HandPosition,
    /// Distance from the goal at the end of the run, m.
    GoalPosition,
    /// Angle from the goal at the end of the run, rad.
    GoalOrientation,
    /// Torque about the force sensor if it measures what is expected, N m.
    ExpectedAtSensor,
    /// Joint torque if the arm presses as it expects, N m.
    ExpectedTorque,
}

impl Limit {
    /// Its name for people, and its unit.
    pub const fn name(self) -> (&'static str, &'static str) {
        match self {
            Limit::JointPosition => ("soft limit", "rad"),
            Limit::JointVelocity => ("velocity", "rad/s"),
            Limit::JointTorque => ("torque", "N m"),
            Limit::TipSpeed => ("elbow/forearm speed", "m/s"),
            Limit::HandSpeed => ("hand speed", "m/s"),
            Limit::Reach => ("reach", "m"),
            Limit::HandPosition => ("range", "rad"),
            Limit::GoalPosition => ("goal distance", "m"),
            Limit::GoalOrientation => ("goal angle", "rad"),
            Limit::ExpectedAtSensor => ("expected, at the sensor", "N m"),
            Limit::ExpectedTorque => ("expected torque", "N m"),
        }
    }
}

/// The worst moment with respect to one limit.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Margin {
    /// The limit.
    pub limit: Limit,
    /// The joint it concerns, 1 to 7; of the hand: spread 1, fingers 2 to 4.
    pub joint: Option<u8>,
    /// The value at the worst moment.
    pub value: f64,
    /// The bound it is compared with.
    pub bound: f64,
    /// The margin: negative is a violation.
    pub margin: f64,
    /// When, s since the start of the movement.
    pub time_s: f64,
}

impl Margin {
    /// The limit, what is left of it, and when, in words.
    pub fn words(&self) -> String {
        let ((name, unit), part) = (self.limit.name(), self.part());
        let blank = if part.is_empty() { "" } else { " " };
        let Margin { value, bound, time_s, .. } = self;
        format!("{part}{blank}{name} {value:.3} of {bound:.3} {unit}, at {time_s:.2} s")
    }

    /// The joint or digit it concerns, as a word; empty for none.
    fn part(&self) -> String {
        match (self.limit, self.joint) {
            (_, None) => String::new(),
            (Limit::HandPosition, Some(digit)) => {
                DIGITS.get(usize::from(digit).wrapping_sub(1)).map_or(String::new(), |(name, _)| (*name).to_owned())
            }
            (_, Some(joint)) => format!("J{joint}"),
        }
    }
}

/// The result of a check.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct CheckReport {
    /// Name of the primitive.
    pub name: String,
    /// Check sum of its content.
    pub checksum: String,
    /// Hash of the robot model.
    pub model_hash: String,
    /// Bytes of its image and check sum of that image.
    pub image: (usize, String),
    /// Kernels of each row.
    pub kernels: usize,
    /// Duration as taught, s.
    pub duration_s: f64,
    /// Speed factor of the check.
    pub speed: f64,
    /// Goal of the check instead of the stored one, world frame, m.
    pub goal_m: Option<[f64; 3]>,
    /// Duration of the checked run until the arm rests at the goal, s.
    pub run_duration_s: f64,
    /// Worst margins.
    pub margins: Vec<Margin>,
    /// Largest distance of the tool from the plan, m, over the run.
    pub tracking_max_m: f64,
    /// Largest speed of the tool, m/s.
    pub tool_speed_max_m_s: f64,
    /// Cycles in which the torque limiter cut.
    pub limited_cycles: usize,
    /// The violations; empty if the primitive may move an arm.
    pub violations: Vec<String>,
    /// Conduct of the device in such a run that nobody has asked for; empty for none.
    pub warnings: Vec<String>,
    /// True if the plan itself comes to its goal; false as well of one that nobody has followed so far.
    #[serde(skip)]
    plan_arrives: bool,
}

impl CheckReport {
    /// True if there is no violation.
    pub fn passed(&self) -> bool {
        self.violations.is_empty()
    }

    /// The report as text for a terminal.
    pub fn to_text(&self) -> String {
        let mut text = format!(
            "{}: content {}, model {}, image {} bytes {}, {} kernels, {:.3} s at speed {}\n\n",
            self.name,
            self.checksum,
            self.model_hash,
            self.image.0,
            self.image.1,
            self.kernels,
            self.duration_s,
            self.speed
        );
        let mut table = Table::new(["limit", "joint", "value", "bound", "margin", "unit", "at"]);
        for margin in &self.margins {
            let (name, unit) = margin.limit.name();
            table.row([
                name.to_owned(),
                Some(margin.part()).filter(|part| !part.is_empty()).unwrap_or_else(|| "-".to_owned()),
                format!("{:.4}", margin.value),
                format!("{:.4}", margin.bound),
                format!("{:.4}{}", margin.margin, if margin.margin < 0.0 { " !" } else { "" }),
                unit.to_owned(),
                format!("{:.3} s", margin.time_s),
            ]);
        }
        text += &table.to_string();
        text += &format!(
            "\narm at rest after {:.3} s; tracking error at most {:.2} mm; tool speed at most {:.3} m/s; torque cut in {} cycles\n",
            self.run_duration_s,
            self.tracking_max_m * 1e3,
            self.tool_speed_max_m_s,
            self.limited_cycles
        );
        if self.passed() {
            text += "passed\n";
        } else {
            text +=
                &format!("{} violation{}:\n", self.violations.len(), if self.violations.len() == 1 { "" } else { "s" });
            for violation in &self.violations {
                text += &format!("  - {violation}\n");
            }
        }
        text
    }
}

/// The run that is checked.
#[derive(Debug, Clone)]
pub struct Course {
    /// Speed relative to the taught one.
    pub speed: f64,
    /// Goal from the start on.
    pub goal: Goal,
    /// Changes on the way.
    pub changes: Vec<Change>,
}

impl Course {
    /// To the stored goal, at `speed` times the taught speed.
    pub fn stored(speed: f64) -> Self {
        Course { speed, goal: Goal::default(), changes: Vec::new() }
    }

    /// Position of the last goal (m), and its orientation, where they are not the stored ones.
    fn last_goal(&self) -> Goal {
        let mut changes = self.changes.clone();
        changes.sort_by(|a, b| a.time.total_cmp(&b.time));
        changes.iter().fold(self.goal, |last, change| match change.kind {
            ChangeKind::Goal(goal) => {
                Goal { position: goal.position.or(last.position), orientation: goal.orientation.or(last.orientation) }
            }
            ChangeKind::Speed(_) => last,
        })
    }
}

/// Checks a primitive that was read from its file for a run; `progress` hears the fraction done now and then.
///
/// # Errors
/// The file cannot be turned into a primitive or an image at all, or belongs to another model of the arm. Everything
/// that can be measured is in the report instead.
pub fn check(
    file: &PrimitiveFile,
    course: &Course,
    progress: impl FnMut(f64),
) -> Result<CheckReport, PrimitiveFileError> {
    file.require_model(control::MODEL_HASH)?;
    let image = file.to_image()?;
    let primitive = file.to_primitive()?;
    let mut report = CheckReport {
        name: file.name.clone(),
        checksum: format!("0x{:08x}", file.checksum()),
        model_hash: format!("0x{:08x}", file.model_hash),
        image: (image.len(), format!("0x{:08x}", image_checksum(&image))),
        kernels: file.kernels(),
        duration_s: file.movement.duration,
        speed: course.speed,
        goal_m: course.last_goal().position.map(|goal| goal.map(f64::from)),
        run_duration_s: 0.0,
        margins: Vec::new(),
        tracking_max_m: 0.0,
        tool_speed_max_m_s: 0.0,
        limited_cycles: 0,
        violations: Vec::new(),
        warnings: Vec::new(),
        plan_arrives: false,
    };
    check_plan(&primitive, course.speed, &mut report);
    let run = ClosedLoop::play(&primitive, course, progress);
    check_run(file, course, &run, &mut report);
    violations(&mut report);
    report.warnings.extend(held_back(&report));
    expected::check(file, &primitive, &run, &mut report);
    Ok(report)
}

/// Says which margins are negative.
fn violations(report: &mut CheckReport) {
    for margin in &report.margins {
        // A NaN is no margin either.
        if margin.margin.is_nan() || margin.margin < 0.0 {
            let (name, unit) = margin.limit.name();
            let part = margin.part();
            let space = if part.is_empty() { "" } else { " " };
            report.violations.push(format!(
                "{part}{space}{name}: {:.4} {unit} against {:.4} {unit} at {:.3} s",
                margin.value, margin.bound, margin.time_s
            ));
        }
    }
}

/// Says where the pendant will warn and the device hold the run back, and at which speed it will not.
fn held_back(report: &CheckReport) -> Option<String> {
    let fastest = report.margins.iter().find(|margin| margin.limit == Limit::TipSpeed)?;
    let asked = report.speed > f64::from(HELD_BACK);
    (asked && fastest.value > CATCHING_UP * TIP_SPEED_WARNING).then(|| {
        // Rounded down, and a little less: a plan that is slower by half is followed by an arm that is not quite.
        let below = (0.95 * CATCHING_UP * report.speed * TIP_SPEED_WARNING / fastest.value * 100.0).floor() / 100.0;
        format!(
            "elbow or forearm come to {:.2} m/s at {:.2} s, or a tenth more: from {TIP_SPEED_WARNING} m/s on the \
             pendant warns, and while it does the run is held to half of the taught speed; with `--speed {below}` it \
             does not",
            fastest.value, fastest.time_s
        )
    })
}

/// Check sum of an image as the device tells it: of everything before the check sum at its end.
fn image_checksum(image: &[u8]) -> u32 {
    let sum = image.len().saturating_sub(size_of::<u32>());
    lab::demonstration::recording::checksum(image.get(..sum).unwrap_or_default())
}

/// The plan alone: finite everywhere, within reach, ending at its goal. Times are those of a run at `speed`.
fn check_plan(primitive: &lab::primitive_file::HostPrimitive, speed: f64, report: &mut CheckReport) {
    let references = match plan::roll_out(primitive) {
        Ok(mut references) => {
            references.iter_mut().for_each(|reference| reference.time /= speed);
            references
        }
        Err(error) => {
            report.violations.push(format!("the plan cannot start: {error}"));
            return;
        }
    };
    let finite = |values: &[f64]| values.iter().all(|value| value.is_finite());
    let broken = references.iter().find(|reference| {
        let ([pose], points) = (&reference.poses, &reference.points);
        !(finite(&pose.position.x)
            && finite(&pose.position.a)
            && finite(&plan::orientation(reference))
            && finite(&pose.orientation.domega)
            && finite(&points.x)
            && finite(&points.a))
    });
    if let Some(reference) = broken {
        report.violations.push(format!("the plan is not finite at {:.3} s", reference.time));
        return;
    }
    for (digit, (_, [min, max])) in DIGITS.into_iter().enumerate() {
        let (min, max) = (min - HAND_SLACK, max + HAND_SLACK);
        let margins = references.iter().map(|reference| {
            let value = posture_and_hand(&reference.points.x).1[digit];
            let (bound, margin) = if value - min < max - value { (min, value - min) } else { (max, max - value) };
            let joint = Some(digit as u8 + 1);
            Margin { limit: Limit::HandPosition, joint, value, bound, margin, time_s: reference.time }
        });
        report.margins.extend(margins.min_by(|a, b| a.margin.total_cmp(&b.margin)));
    }
    let farthest = references.iter().map(|reference| {
        let distance = reference.poses[0].position.x.iter().map(|x| x * x).sum::<f64>().sqrt();
        (reference.time, distance)
    });
    if let Some((time_s, distance)) = farthest.max_by(|a, b| a.1.total_cmp(&b.1)) {
        report.margins.push(Margin {
            limit: Limit::Reach,
            joint: None,
            value: distance,
            bound: REACH,
            margin: REACH - distance,
            time_s,
        });
        debug_assert_eq!(within_reach(&nalgebra::Vector3::new(distance, 0.0, 0.0)), distance <= REACH);
    }
}

/// Begin of the violation of a primitive that no run of it could mend.
const UNFIT: &str = "the control code refuses the primitive";

/// The plan as the arm follows it.
fn check_run(file: &PrimitiveFile, course: &Course, run: &ClosedLoop, report: &mut CheckReport) {
    match run.ending {
        Ending::Arrived => {}
        Ending::Unfit(reason) => report.violations.push(format!("{UNFIT}: {reason}")),
        Ending::NotLoaded(reason) => report.violations.push(format!("{UNFIT}: {reason}")),
        Ending::Refused(reason) => report.violations.push(format!("the control code refuses the run: {reason}")),
        Ending::Stopped(state, fault) => {
            let time = run.samples.last().map_or(0.0, |sample| sample.time);
            report
                .violations
                .push(format!("the control code stops the run at {time:.3} s: {fault} (state {})", state.name()));
        }
        Ending::Endless => report.violations.push("the run does not come to its end".to_owned()),
        Ending::Diverged => report.violations.push("the arm's state becomes infinite".to_owned()),
    }
    let Some(last) = run.samples.last() else {
        return;
    };
    report.run_duration_s = last.time;
    for joint in 0..7 {
        report.margins.push(worst(run, Limit::JointPosition, Some(joint), |sample| {
            let q = sample.q[joint];
            let bound = if q - SOFT_MIN[joint] < SOFT_MAX[joint] - q { SOFT_MIN[joint] } else { SOFT_MAX[joint] };
            let margin = if bound == SOFT_MIN[joint] { q - bound } else { bound - q };
            (q, bound, margin)
        }));
    }
    for (joint, bound) in VELOCITY_MAX.into_iter().enumerate() {
        report.margins.push(worst(run, Limit::JointVelocity, Some(joint), |sample| {
            (sample.dq[joint], bound, bound - sample.dq[joint].abs())
        }));
    }
    for joint in 0..7 {
        report.margins.push(worst(run, Limit::JointTorque, Some(joint), |sample| {
            let (value, bound) = (f64::from(sample.record.tau[joint]), TORQUE_LIMITS[joint]);
            (value, bound, bound - value.abs())
        }));
    }
    report.margins.push(worst(run, Limit::TipSpeed, None, |sample| {
        let speed = sample.speeds[0].max(sample.speeds[1]);
        (speed, TIP_SPEED_LIMIT, TIP_SPEED_LIMIT - speed)
    }));
    report.margins.push(worst(run, Limit::HandSpeed, None, |sample| {
        let [_, _, speed] = sample.speeds;
        (speed, HAND_SPEED_LIMIT, HAND_SPEED_LIMIT - speed)
    }));
    report.limited_cycles = run.limited_cycles();
    if report.limited_cycles > 0 {
        report.violations.push(format!(
            "the torque limiter cuts in {} of {} cycles: the arm cannot follow the plan",
            report.limited_cycles,
            run.samples.len()
        ));
    }
    let maximum = |pick: &dyn Fn(&Sample) -> f64| run.samples.iter().map(pick).fold(0.0, f64::max);
    report.tool_speed_max_m_s = maximum(&|sample| sample.speeds[2]);
    report.tracking_max_m = maximum(&|sample| distance(&sample.position, &sample.record.pose_d));
    if run.ending == Ending::Arrived {
        let goal = course.last_goal();
        let place = goal.position.map_or(file.goal.position, |place| place.map(f64::from));
        let orientation = goal.orientation.map_or(file.goal.orientation, |parts| parts.map(f64::from));
        let away = (0..3).map(|axis| (last.position[axis] - place[axis]).powi(2)).sum::<f64>().sqrt();
        let turned = angle_between(&last.orientation, &orientation);
        let [x, y, z, planned @ ..] = last.record.pose_d.map(f64::from);
        let off = (0..3).map(|axis| ([x, y, z][axis] - place[axis]).powi(2)).sum::<f64>().sqrt();
        report.plan_arrives = off < GOAL_DISTANCE / 2.0 && angle_between(&planned, &orientation) < GOAL_ANGLE / 2.0;
        for (limit, value, bound) in
            [(Limit::GoalPosition, away, GOAL_DISTANCE), (Limit::GoalOrientation, turned, GOAL_ANGLE)]
        {
            report.margins.push(Margin { limit, joint: None, value, bound, margin: bound - value, time_s: last.time });
        }
    }
}

fn distance(position: &[f64; 3], pose_d: &[f32; 7]) -> f64 {
    (0..3).map(|axis| (position[axis] - f64::from(pose_d[axis])).powi(2)).sum::<f64>().sqrt()
}

/// The moment of the smallest margin; `look` gives value, bound and margin.
fn worst(run: &ClosedLoop, limit: Limit, joint: Option<usize>, look: impl Fn(&Sample) -> (f64, f64, f64)) -> Margin {
    let mut worst = Margin {
        limit,
        joint: joint.map(|joint| joint as u8 + 1),
        value: 0.0,
        bound: 0.0,
        margin: f64::INFINITY,
        time_s: 0.0,
    };
    for sample in &run.samples {
        let (value, bound, margin) = look(sample);
        if margin.is_nan() || margin < worst.margin {
            worst = Margin { value, bound, margin, time_s: sample.time, ..worst };
        }
    }
    worst
}
