//! `tactus calibrate load`: mass and centre of what hangs on the wrist, by its sensor and by the joints.

use std::path::PathBuf;

use clap::Args;
use serde_json::{Value, json};

use super::calibration_report::CalibrationReport;
use super::{ErrorCode, Failure, Global, Table, connection};
use lab::client::Client;
use lab::device::Device;
use lab::load::{self, Body, Extra, LoadError, POSTURES};
use lab::procedure;
use lab::weigh::PASS_SECONDS;

/// Options of `calibrate load`.
#[derive(Debug, Clone, Args)]
pub struct Load {
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Write what was found into a file too, JSON; in a folder it is named with serial number and time
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

const DOING: &str = "calibrate load";

/// Measures what hangs on the wrist and shows it; the device goes on as before.
///
/// # Errors
/// The device refuses, the arm stops, there is no wrist sensor, or the postures do not tell the load.
pub(super) fn run(command: &Load, client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let refused = |error: LoadError| Failure::new(ErrorCode::LoadNotTold, DOING, error);
    let report = CalibrationReport::open(command.report.as_deref(), client, global, DOING)?;
    connection::ready(client, command.at_home, global.output(), DOING)?;
    let weight = procedure::weight_in_use(client).map_err(|error| connection::failure(error, DOING))?;
    if weight.payload() == control::Payload::None {
        return Err(refused(LoadError::NoSensor));
    }
    let postures = POSTURES.len();
    global.output().say(format!("the arm moves through {postures} postures, some two minutes; Ctrl-C stops it"));
    let spinner = global.output().spinner("measuring the load");
    let measured = procedure::slide_postures(client, POSTURES, &[PASS_SECONDS], |posture| {
        spinner.set_message(format!("posture {} of {postures}", posture + 1));
    });
    spinner.finish_and_clear();
    let crossings = measured.map_err(|error| connection::failure(error, DOING))?;
    let load = load::measure(&weight, &crossings).map_err(refused)?;
    report.write("load", false, &data(&load), global)?;
    global.output().result(&data(&load), format!("{}{}", table(&load), words(&load)))
}

fn table(load: &load::Load) -> Table {
    let mut table =
        Table::new(["told by", "hanging, kg", "centre x, y, z, mm", "beyond the hand, kg", "its centre, mm"]);
    let centre = |body: Body| {
        let [x, y, z] = body.centre.map(|part| part * 1e3);
        format!("{x:+.1} {y:+.1} {z:+.1}")
    };
    for (name, extra) in [("wrist sensor", &load.sensor), ("joints", &load.joints)] {
        let hanging = extra.hanging();
        table.row([
            name.to_owned(),
            format!("{:.3}", hanging.mass),
            centre(hanging),
            format!("{:+.3} +-{:.3}", extra.mass, extra.mass_error),
            extra.held().map_or_else(|| "-".to_owned(), centre),
        ]);
    }
    table
}

fn words(load: &load::Load) -> String {
    let (mass, apart) = load.sensor.hanging().beside(&load.joints.hanging());
    format!(
        "the sensor tells {:+.0} g beyond what the joints tell, centres {:.1} mm apart; shown only: the device goes on as before",
        mass * 1e3,
        apart * 1e3
    )
}

fn data(load: &load::Load) -> Value {
    let body = |body: Body| json!({ "mass_kg": body.mass, "centre_m": body.centre });
    let told = |extra: &Extra| {
        json!({
            "hanging": body(extra.hanging()), "held": extra.held().map(body),
            "beyond_hand": {
                "mass_kg": extra.mass, "mass_standard_error_kg": extra.mass_error,
                "moment_kgm": extra.moment, "moment_standard_error_kgm": extra.moment_error,
            },
        })
    };
    let (mass, apart) = load.sensor.hanging().beside(&load.joints.hanging());
    json!({
        "sensor": told(&load.sensor), "joints": told(&load.joints),
        "difference": { "mass_kg": mass, "centre_m": apart },
        "sensor_left": { "force_n": load.sensor_left[0], "torque_nm": load.sensor_left[1] },
        "joints_left_nm": load.joints_left,
    })
}
