//! A measured payload in `--json` and in a report, how one is read back, and what is to be done next.

use std::path::Path;

use control::model::{ArmModel, Frames};
use control::units::JointPositions;
use lab::input_file;
use lab::load::{Body, Contradiction, Extra, Finding, Load};
use nalgebra::Vector3;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use super::Carries;

/// Mass beyond the hand that `calibrate gravity` takes for a weight of the arm, kg. With 0.6 two of five simulated arms
/// asked for a last link of more than half its mass more, with 0.55 none.
const HEAVIEST_MOUNTED: f64 = 0.55;

/// A body from the wrist sensor's origin, in its axes.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct BodyData {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Its centre, m.
    pub centre_m: [f64; 3],
    /// Standard error of the centre along the axis where it is largest, m.
    pub centre_standard_error_m: f64,
}

/// Mass and first moment beyond the model's hand, about the wrist sensor's origin in its axes.
#[derive(Debug, Clone, Copy, Serialize, Deserialize, JsonSchema)]
pub struct ExtraData {
    /// Mass, kg.
    pub mass_kg: f64,
    /// Its standard error, kg.
    pub mass_standard_error_kg: f64,
    /// First moment, kg m.
    pub moment_kgm: [f64; 3],
    /// Its standard errors, kg m.
    pub moment_standard_error_kgm: [f64; 3],
    /// Standard errors of mass (kg) and moment (kg m) without what is wrong in every measurement of one arm alike.
    pub repeat_standard_error: [f64; 4],
}

/// The figures that one of the two tells.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct ReadingData {
    /// All that hangs on the sensor, the hand included.
    pub hanging: BodyData,
    /// The part beyond the model's hand, from 0.1 kg on; null where there is less.
    pub held: Option<BodyData>,
    /// The same as it was regressed.
    pub beyond_hand: ExtraData,
}

/// The part that was subtracted from all that hangs there to get at what is held.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Subtracted {
    /// The hand of the robot model, whose own mass may be some per cent beside it.
    ModelHand,
    /// The same arm's load in an earlier measurement (`--without`).
    Measured,
}

/// A held thing.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct ObjectData {
    /// The part that was subtracted.
    pub subtracted: Subtracted,
    /// Mass and centre as the sensor tells them.
    pub sensor: BodyData,
    /// Standard error of that mass, kg.
    pub sensor_mass_standard_error_kg: f64,
    /// Mass and centre as the joints tell them; null where they tell less than 0.1 kg.
    pub joints: Option<BodyData>,
    /// Centre in the tool frame as the sensor tells it, m: for `tactus rehearse --payload`.
    pub centre_in_tool_m: [f64; 3],
}

/// Difference between sensor and joints.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct DifferenceData {
    /// Of all that hangs there, as the sensor tells it, beyond what the joints tell, kg.
    pub mass_kg: f64,
    /// Distance of the two centres, m.
    pub centre_m: f64,
}

/// Residuals of the sensor's fit.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct SensorLeft {
    /// Force, N RMS.
    pub force_n: f64,
    /// Torque, N m RMS.
    pub torque_nm: f64,
}

/// Data of `tactus --json calibrate payload --measure`.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Measured {
    /// The declared payload: `hand`, `nothing` or `undeclared`.
    pub declared: &'static str,
    /// By the wrist sensor.
    pub sensor: ReadingData,
    /// By the joints, whose links may weigh otherwise than the model's.
    pub joints: ReadingData,
    /// Load of the joints beyond the weight that the device computes with; null on an arm that was never weighed.
    pub since_weighed: Option<ExtraData>,
    /// Sensor beyond joints.
    pub difference: DifferenceData,
    /// The held thing; null where it is lighter than 0.1 kg.
    pub object: Option<ObjectData>,
    /// Residuals of the sensor's fit.
    pub sensor_left: SensorLeft,
    /// Residuals of the joints' fit, N m RMS, J1 first.
    pub joints_left_nm: [f64; 7],
    /// In what sensor and joints contradict each other or themselves; null where they agree.
    pub contradiction: Option<String>,
    /// `hand`, `more`, `less` or `elsewhere`: what hangs there beside the model's hand.
    pub finding: &'static str,
    /// Advice with its command; null where nothing is.
    pub next: Option<String>,
}

impl Subtracted {
    /// Words that a person should know of it, as the end of a sentence.
    pub(super) fn words(self) -> &'static str {
        match self {
            Self::ModelHand => {
                "; the model's hand was subtracted, and this hand's own weight may be some per cent beside it \
                 (`--without FILE` subtracts a measured one)"
            }
            Self::Measured => "; what the earlier report tells was subtracted",
        }
    }
}

fn body_data(extra: &Extra, body: Body) -> BodyData {
    BodyData { mass_kg: body.mass, centre_m: body.centre, centre_standard_error_m: extra.centre_error(&body) }
}

fn extra_data(extra: &Extra) -> ExtraData {
    ExtraData {
        mass_kg: extra.mass,
        mass_standard_error_kg: extra.mass_error,
        moment_kgm: extra.moment,
        moment_standard_error_kgm: extra.moment_error,
        repeat_standard_error: extra.repeat_error,
    }
}

impl ReadingData {
    fn new(extra: &Extra) -> Self {
        Self {
            hanging: body_data(extra, extra.hanging()),
            held: extra.held().map(|body| body_data(extra, body)),
            beyond_hand: extra_data(extra),
        }
    }
}

impl ObjectData {
    fn new(subtracted: Subtracted, [sensor, joints]: &[Extra; 2]) -> Option<Self> {
        let body = sensor.held()?;
        Some(Self {
            subtracted,
            sensor: body_data(sensor, body),
            sensor_mass_standard_error_kg: sensor.mass_error,
            joints: joints.held().map(|body| body_data(joints, body)),
            centre_in_tool_m: in_tool(body.centre),
        })
    }
}

impl Measured {
    pub(super) fn new(
        declared: Carries,
        load: &Load,
        object: Option<&[Extra; 2]>,
        contradiction: Option<Contradiction>,
        next: Option<String>,
    ) -> Self {
        let (mass_kg, centre_m) = load.sensor.hanging().beside(&load.joints.hanging());
        let object = match object {
            Some(object) => ObjectData::new(Subtracted::Measured, object),
            None => ObjectData::new(Subtracted::ModelHand, &[load.sensor, load.joints]),
        };
        Self {
            declared: declared.name(),
            sensor: ReadingData::new(&load.sensor),
            joints: ReadingData::new(&load.joints),
            since_weighed: load.since_weighed.as_ref().map(extra_data),
            difference: DifferenceData { mass_kg, centre_m },
            object,
            sensor_left: SensorLeft { force_n: load.sensor_left[0], torque_nm: load.sensor_left[1] },
            joints_left_nm: load.joints_left,
            contradiction: contradiction.map(|contradiction| contradiction.to_string()),
            finding: match load.finding() {
                Finding::Hand => "hand",
                Finding::More(_) => "more",
                Finding::Less(_) => "less",
                Finding::Elsewhere(_) => "elsewhere",
            },
            // Where nothing is believed nothing follows from it.
            next: next.filter(|_| contradiction.is_none()),
        }
    }
}

/// A place from the sensor's origin in its axes, in the tool frame (m). Sensor and tool turn together.
fn in_tool(place: [f64; 3]) -> [f64; 3] {
    let model = ArmModel::<f64>::new(control::Payload::SensorAndHand);
    let frames = Frames::new(&model, &JointPositions::from_array([0.0; 7]));
    let from_tool = frames.sensor_to_world() * Vector3::from(place) + frames.tool_to_sensor();
    frames.tool_to_world().tr_mul(&from_tool).into()
}

/// Advice after this was found on an arm of which this is declared.
pub(super) fn next(declared: Carries, load: &Load, object: Option<&[Extra; 2]>) -> Option<String> {
    if let Some(body) = object.and_then(|[sensor, _]| sensor.held()) {
        let [x, y, z] = in_tool(body.centre);
        return Some(format!(
            "a rehearsal that begins with it in the hand: `tactus rehearse PRIMITIVE --payload {:.3},{x:.3},{y:.3},{z:.3}`",
            body.mass
        ));
    }
    match load.finding() {
        Finding::Hand if declared == Carries::Undeclared => {
            Some("`tactus calibrate payload hand` declares it".to_owned())
        }
        Finding::Hand => None,
        _ if load.is_carried() => Some("the weight in use carries it already: nothing is to be done".to_owned()),
        Finding::More(body) if body.mass > HEAVIEST_MOUNTED => Some(
            "put it down: so much is no weight that `tactus calibrate gravity` would keep as the arm's own".to_owned(),
        ),
        Finding::More(_) => Some(
            "put down what is held; what stays mounted the arm is weighed with: `tactus calibrate gravity`".to_owned(),
        ),
        Finding::Less(_) | Finding::Elsewhere(_) => {
            Some("the arm is weighed with the hand that it has: `tactus calibrate gravity`".to_owned())
        }
    }
}

/// Why an earlier measurement cannot be subtracted.
#[derive(Debug, thiserror::Error)]
pub(super) enum EarlierError {
    /// The system refuses.
    #[error("{0} cannot be read: {1}")]
    Unreadable(String, #[source] std::io::Error),
    /// It is no report of `calibrate payload --measure`.
    #[error("{0} is no report of `tactus calibrate payload --measure`: {1}")]
    OtherKind(String, String),
    /// It belongs to another arm.
    #[error("the report is of the arm '{0}'")]
    OtherArm(String),
    /// The figures were not believed.
    #[error("what it reports was not believed: {0}")]
    Contradicted(String),
}

#[derive(Deserialize)]
struct Report {
    action: String,
    serial: String,
    found: Found,
}

#[derive(Deserialize)]
struct Found {
    sensor: FoundTold,
    joints: FoundTold,
    contradiction: Option<String>,
}

#[derive(Deserialize)]
struct FoundTold {
    beyond_hand: ExtraData,
}

/// Reads what sensor and joints of the arm with this serial number told earlier.
pub(super) fn read_earlier(path: &Path, serial: &str) -> Result<[Extra; 2], EarlierError> {
    let name = || path.display().to_string();
    let text = input_file::read_text(path).map_err(|error| EarlierError::Unreadable(name(), error))?;
    let report: Report =
        serde_json::from_str(&text).map_err(|error| EarlierError::OtherKind(name(), error.to_string()))?;
    if report.action != "payload" {
        return Err(EarlierError::OtherKind(name(), format!("it is of `{}`", report.action)));
    }
    if report.serial != serial {
        return Err(EarlierError::OtherArm(report.serial));
    }
    if let Some(contradiction) = report.found.contradiction {
        return Err(EarlierError::Contradicted(contradiction));
    }
    Ok([report.found.sensor, report.found.joints].map(|FoundTold { beyond_hand: told }| Extra {
        mass: told.mass_kg,
        mass_error: told.mass_standard_error_kg,
        moment: told.moment_kgm,
        moment_error: told.moment_standard_error_kgm,
        repeat_error: told.repeat_standard_error,
    }))
}
