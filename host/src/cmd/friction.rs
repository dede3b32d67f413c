//! `tactus calibrate friction`: the friction of the arm's joints, measured and shown beside the model's.

use std::path::PathBuf;

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use super::calibration_report::{self, CalibrationReport};
use super::{ErrorCode, Failure, Global, Table, connection};
use control::model::{FRICTION_COULOMB, FRICTION_VISCOUS};
use lab::client::Client;
use lab::device::Device;
use lab::friction::{DURATIONS, Estimate, JointFriction, POSTURES, measure};
use lab::procedure;

/// Options of `calibrate friction`.
#[derive(Debug, Clone, Args)]
pub struct Friction {
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Write what was found into a file too, JSON; in a folder it is named with serial number and time
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

const DOING: &str = "calibrate friction";

/// Measures friction and shows it; the device goes on with the model's.
///
/// # Errors
/// The device refuses, the arm stops, or the passes tell no friction.
pub(super) fn run(command: &Friction, client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let report = CalibrationReport::open(command.report.as_deref(), &[], client, global, DOING)?;
    connection::ready(client, command.at_home, global.output(), DOING)?;
    let weight = procedure::weight_in_use(client).map_err(|error| connection::failure(error, DOING))?;
    let (postures, speeds) = (POSTURES.len(), DURATIONS.len());
    global.output().say(format!(
        "the arm moves through {postures} postures at {speeds} speeds, some three minutes; Ctrl-C stops it"
    ));
    let spinner = global.output().spinner("measuring friction");
    let measured = procedure::slide_postures(client, POSTURES, &DURATIONS, |posture| {
        spinner.set_message(format!("posture {} of {postures}", posture + 1));
    });
    spinner.finish_and_clear();
    let crossings = measured.map_err(|error| connection::failure(error, DOING))?;
    let joints =
        measure(&weight, &crossings).map_err(|error| Failure::new(ErrorCode::FrictionNotTold, DOING, error))?;
    let written = report.write("friction", Some(false), &data(&joints), global);
    let text = format!("{}shown only: the device goes on with the model's", table(&joints));
    calibration_report::tell(written, &data(&joints), text, global)
}

fn table(joints: &[JointFriction; 7]) -> Table {
    let mut table =
        Table::new(["joint", "Coulomb, N m", "model's", "viscous, N m s/rad", "model's", "left, N m", "speeds, rad/s"]);
    let plain = |estimate: Estimate| format!("{:.3} +-{:.3}", estimate.value, estimate.error);
    for (joint, friction) in joints.iter().enumerate() {
        let [slowest, fastest] = friction.speeds;
        table.row([
            format!("J{}", joint + 1),
            plain(friction.coulomb),
            format!("{:.3}", FRICTION_COULOMB[joint]),
            plain(friction.viscous),
            format!("{:.3}", FRICTION_VISCOUS[joint]),
            format!("{:.3}", friction.left),
            format!("{slowest:.2} .. {fastest:.2}"),
        ]);
    }
    table
}

fn data(joints: &[JointFriction; 7]) -> Value {
    let estimate = |Estimate { value, error }: Estimate| Estimated { value, standard_error: error };
    let joints = joints.iter().enumerate().map(|(joint, friction)| JointData {
        coulomb_nm: estimate(friction.coulomb),
        viscous_nms_per_rad: estimate(friction.viscous),
        left_rms_nm: friction.left,
        speeds_rad_s: friction.speeds,
        model: ModelData { coulomb_nm: FRICTION_COULOMB[joint], viscous_nms_per_rad: FRICTION_VISCOUS[joint] },
    });
    json!(Measured { joints: joints.collect() })
}

/// Data of `tactus --json calibrate friction`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Measured {
    /// The joints, J1 first.
    pub joints: Vec<JointData>,
}

/// Friction of a joint.
#[derive(Debug, Serialize, JsonSchema)]
pub struct JointData {
    /// Friction that does not depend on the speed, N m.
    pub coulomb_nm: Estimated,
    /// Friction that grows with it, N m s/rad.
    pub viscous_nms_per_rad: Estimated,
    /// Residual of the line over the passes, N m RMS.
    pub left_rms_nm: f64,
    /// Slowest and fastest pass, rad/s.
    pub speeds_rad_s: [f64; 2],
    /// The same as the robot's model has it.
    pub model: ModelData,
}

/// A number with its standard error.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Estimated {
    /// The number.
    pub value: f64,
    /// Its standard error.
    pub standard_error: f64,
}

/// Friction of a joint by the robot's model.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ModelData {
    /// Friction that does not depend on the speed, N m.
    pub coulomb_nm: f64,
    /// Friction that grows with it, N m s/rad.
    pub viscous_nms_per_rad: f64,
}
