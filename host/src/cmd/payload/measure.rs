//! `tactus calibrate payload --measure`: mass and centre of what hangs on the wrist, by its sensor and by the joints.

use std::path::{Path, PathBuf};

use super::data::{EarlierError, Measured, ObjectData, next, read_earlier};
use super::{DOING, Payload, declared};
use crate::cmd::calibration_report::{self, CalibrationReport};
use crate::cmd::{ErrorCode, Failure, Global, Table, connection};
use lab::client::Client;
use lab::device::Device;
use lab::load::{self, Body, Contradiction, Extra, Finding, LEAST_HELD, Load, LoadError, POSTURES};
use lab::procedure;
use lab::weigh::PASS_SECONDS;

/// Measures what hangs on the wrist, compares sensor and joints, and says what is to be done; the device goes on as
/// before.
///
/// # Errors
/// The device refuses, the arm stops, there is no wrist sensor, the postures do not tell the load, the earlier
/// measurement is of another arm, or sensor and joints contradict each other.
pub(super) fn run(command: &Payload, client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let refused = |error: LoadError| Failure::new(ErrorCode::LoadNotTold, DOING, error);
    let unusable = |error: EarlierError| Failure::of_file(ErrorCode::EmptyHandInvalid, DOING, error);
    let earlier = command.without.as_deref().map(|file| read_earlier(file, client.hello().serial.as_str()));
    let earlier = earlier.transpose().map_err(unusable)?;
    let inputs: Vec<&Path> = command.without.iter().map(PathBuf::as_path).collect();
    let report = CalibrationReport::open(command.report.as_deref(), &inputs, client, global, DOING)?;
    connection::ready(client, command.at_home, global.output(), DOING)?;
    let weight = procedure::weight_in_use(client).map_err(|error| connection::failure(error, DOING))?;
    if weight.payload() == control::Payload::None {
        return Err(refused(LoadError::NoSensor));
    }
    let kept = client.weight().map_err(|error| error.into_failure(DOING))?;
    let postures = POSTURES.len();
    global.output().say(format!("the arm moves through {postures} postures, some two minutes; Ctrl-C stops it"));
    let spinner = global.output().spinner("measuring what the arm carries");
    let measured = procedure::slide_postures(client, POSTURES, &[PASS_SECONDS], |posture| {
        spinner.set_message(format!("posture {} of {postures}", posture + 1));
    });
    spinner.finish_and_clear();
    let crossings = measured.map_err(|error| connection::failure(error, DOING))?;
    let load = load::measure(&weight, &crossings).map_err(refused)?;
    let object = earlier.map(|[sensor, joints]| [load.sensor.beyond(&sensor), load.joints.beyond(&joints)]);
    let judged = judge(&load, object.as_ref());
    let advice = next(declared(&kept), &load, object.as_ref());
    let found = Measured::new(declared(&kept), &load, object.as_ref(), judged.err(), advice.clone());
    // Texts and numbers only.
    let data = serde_json::to_value(&found).unwrap_or_default();
    let written = report.write("payload", Some(false), &data, global);
    let shown =
        format!("{}{}", table(&load), object.as_ref().map(|of| object_table(of).to_string()).unwrap_or_default());
    if let Err(contradiction) = judged {
        global.output().say(shown.trim_end());
        if let Err(failure) = &written {
            global.output().warn(failure.to_string());
        }
        return Err(Failure::new(ErrorCode::PayloadContradicted, DOING, contradiction).data(data));
    }
    let advice = advice.map(|advice| format!("\nnext: {advice}")).unwrap_or_default();
    calibration_report::tell(written, &found, format!("{shown}{}{advice}", words(&found, &load)), global)
}

/// Judges the whole load, or what was taken up since, which is told more precisely.
fn judge(load: &Load, object: Option<&[Extra; 2]>) -> Result<(), Contradiction> {
    load.judge()?;
    object.map_or(Ok(()), |[sensor, joints]| sensor.agree(joints))
}

fn centre(extra: &Extra, body: &Body) -> String {
    if body.mass < LEAST_HELD {
        return "-".to_owned();
    }
    let [x, y, z] = body.centre.map(|part| part * 1e3);
    format!("{x:+.1} {y:+.1} {z:+.1} +-{:.1}", extra.centre_error(body) * 1e3)
}

fn mass(extra: &Extra) -> String {
    format!("{:+.3} +-{:.3}", extra.mass, extra.mass_error)
}

fn table(load: &Load) -> Table {
    let mut table =
        Table::new(["told by", "hanging, kg", "centre x, y, z, mm", "beyond the hand, kg", "its centre, mm", "left"]);
    let [force, torque] = load.sensor_left;
    let (joint, worst) =
        load.joints_left.into_iter().enumerate().max_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or_default();
    let left = [format!("{force:.2} N, {torque:.4} N m"), format!("{worst:.2} N m at J{}", joint + 1)];
    for ((name, extra), left) in [("wrist sensor", &load.sensor), ("joints", &load.joints)].into_iter().zip(left) {
        let hanging = extra.hanging();
        table.row([
            name.to_owned(),
            format!("{:.3}", hanging.mass),
            centre(extra, &hanging),
            mass(extra),
            extra.held().map_or_else(|| "-".to_owned(), |body| centre(extra, &body)),
            left,
        ]);
    }
    if let Some(since) = &load.since_weighed {
        let place = since.held().map_or_else(|| "-".to_owned(), |body| centre(since, &body));
        let nothing = || "-".to_owned();
        table.row(["joints, since weighed".to_owned(), nothing(), nothing(), mass(since), place, nothing()]);
    }
    table
}

fn object_table([sensor, joints]: &[Extra; 2]) -> Table {
    let mut table = Table::new(["taken up since, by", "mass, kg", "centre x, y, z, mm"]);
    for (name, extra) in [("wrist sensor", sensor), ("joints", joints)] {
        let place = extra.held().map_or_else(|| "-".to_owned(), |body| centre(extra, &body));
        table.row([name.to_owned(), mass(extra), place]);
    }
    table
}

fn words(found: &Measured, load: &Load) -> String {
    let apart = &found.difference;
    let what = match load.finding() {
        Finding::Hand => "the model's hand and nothing else".to_owned(),
        Finding::More(body) => format!("{:.3} kg more than the model's hand", body.mass),
        Finding::Less(mass) => format!("{mass:.3} kg less than the model's hand"),
        Finding::Elsewhere(distance) => format!("a hand with its centre {:.0} mm from the model's", distance * 1e3),
    };
    let object = found.object.as_ref().map(|ObjectData { subtracted, .. }| subtracted.words()).unwrap_or_default();
    format!(
        "sensor and joints agree: {:+.0} g and {:.1} mm apart\ndeclared: {}; found: {what}{object}",
        apart.mass_kg * 1e3,
        apart.centre_m * 1e3,
        found.declared,
    )
}
