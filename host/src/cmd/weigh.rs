//! `tactus calibrate gravity`: the weight of the arm's links, measured, judged, and kept by its device.

use std::path::PathBuf;

use clap::Args;
use control::Payload;
use control::model::WeightCorrection;
use link::{HomeSource, Weight};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use super::calibration_report::{self, CalibrationReport};
use super::{ErrorCode, Failure, Global, Table, connection, payload};
use lab::client::Client;
use lab::device::Device;
use lab::error::HostError;
use lab::procedure::{self, Crossings};
use lab::weigh::{Residual, TOUR, WeighError, Weighing, weigh};

/// Options of `calibrate gravity`.
#[derive(Debug, Clone, Args)]
pub struct Gravity {
    /// Show the weight that counts; nothing moves
    #[arg(long, conflicts_with_all = ["reset", "at_home"])]
    pub show: bool,
    /// Forget it: the robot model's weight counts again, for the declared payload; nothing moves
    #[arg(long, conflicts_with = "at_home")]
    pub reset: bool,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
    /// Write what was found into a file too, JSON; in a folder it is named with serial number and time
    #[arg(long, value_name = "FILE", conflicts_with_all = ["show", "reset"])]
    pub report: Option<PathBuf>,
}

const DOING: &str = "calibrate gravity";

/// Shows, measures or forgets the weight of the links.
///
/// # Errors
/// The device refuses, the arm stops, or what was measured is not accepted; the device then goes on as before.
pub(super) fn run(command: &Gravity, client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    if command.reset {
        forget(client, global)?;
    }
    if command.show || command.reset {
        let weight = client.weight().map_err(|error| error.into_failure(DOING)).inspect_err(|_| {
            if command.reset {
                global.output().say("the device has forgotten the measured weight");
            }
        })?;
        return global.output().result(&weight_data(&weight), weight_text(&weight));
    }
    let report = CalibrationReport::open(command.report.as_deref(), &[], client, global, DOING)?;
    connection::ready(client, command.at_home, global.output(), DOING)?;
    let present = procedure::weight_in_use(client).map_err(|error| connection::failure(error, DOING))?;
    global.output().say(format!("the arm moves through {} postures, a few minutes; Ctrl-C stops it", TOUR.len()));
    let spinner = global.output().spinner("weighing");
    let measured = procedure::cross_postures(client, &TOUR, |posture| {
        spinner.set_message(format!("posture {} of {}", posture + 1, TOUR.len()));
    });
    spinner.finish_and_clear();
    let Crossings { fitted, held_out } = measured.map_err(|error| connection::failure(error, DOING))?;
    let weighing = weigh(&present, present.payload(), &fitted, &held_out).map_err(refused)?;
    let judged = weighing.judge().map_err(|error| refused(error).data(data(&weighing)));
    let kept = judged.and_then(|()| {
        client.keep_weight(&weighing.correction).map_err(|error| error.into_failure(DOING).data(data(&weighing)))
    });
    let is_kept = calibration_report::is_kept(&kept, "tactus calibrate gravity --show", global);
    let written = report.write("gravity", is_kept, &data(&weighing), global);
    kept?;
    global.tell_forgotten();
    let text =
        format!("{}accepted, stored in the device; it takes effect when the arm next has no torque", table(&weighing));
    calibration_report::tell(written, &data(&weighing), text, global)
}

/// The failure of a weight that is not accepted. One that is right already asks for nothing.
fn refused(error: WeighError) -> Failure {
    let help = match &error {
        WeighError::NoBetter { .. } => {
            "the weight in use explains what the arm carries as well as another would: nothing is to be done; \
             `tactus calibrate gravity --show` tells whose it is"
        }
        WeighError::TooFew { .. } | WeighError::NotANumber => {
            "messages were lost: `tactus status --line 10` tells how many, then `tactus calibrate gravity` again"
        }
        WeighError::Absurd(_) | WeighError::TooLarge { .. } => ErrorCode::WeightNotAccepted.remedy(),
    };
    Failure::new(ErrorCode::WeightNotAccepted, DOING, error).help(help)
}

/// Forgets the measured weight. The declared payload stays: its own command takes that back, and without it a sensor
/// that falls silent would be no reason to stop a start-up.
fn forget(client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let failed = |error: HostError| error.into_failure(DOING);
    let declared = payload::declared(&client.weight().map_err(failed)?);
    let Some(carried) = declared.payload() else { return client.forget_weight().map_err(failed) };
    client.keep_weight(&WeightCorrection::none(carried)).map_err(failed)?;
    let words = match carried {
        Payload::SensorAndHand => "sensor and hand stay declared",
        Payload::None => "the bare arm stays declared",
    };
    global.output().say(format!("{words}; `tactus calibrate payload undeclared` takes that back"));
    Ok(())
}

fn table(weighing: &Weighing) -> Table {
    let [before, after] = weighing.held_out;
    let [_, fitted] = weighing.fitted;
    let mut table = Table::new(["joint", "before, N m", "after, N m", "worst", "fitted", "friction, N m"]);
    for joint in 0..7 {
        table.row([
            format!("J{}", joint + 1),
            format!("{:.3}", before.rms[joint]),
            format!("{:.3}", after.rms[joint]),
            format!("{:.3}", after.worst[joint]),
            format!("{:.3}", fitted.rms[joint]),
            format!("{:.2}", weighing.friction[joint]),
        ]);
    }
    table
}

fn data(weighing: &Weighing) -> Value {
    let residual = |Residual { rms, worst }: Residual| Left { rms_nm: rms, worst_nm: worst };
    let both = |[before, after]: [Residual; 2]| BeforeAfter { before: residual(before), after: residual(after) };
    let links = weighing
        .correction
        .links()
        .map(|link| LinkData { share: link.share.into(), shift_m: link.shift.map(f64::from) });
    json!(Weighed {
        fitted: both(weighing.fitted),
        held_out: both(weighing.held_out),
        friction_nm: weighing.friction,
        determined: weighing.determined,
        links,
    })
}

/// Data of `tactus --json calibrate gravity`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Weighed {
    /// Torques that the weight does not explain, over the postures that it was found from.
    pub fitted: BeforeAfter,
    /// The same over postures that it was not found from.
    pub held_out: BeforeAfter,
    /// Friction of each joint at the speed of the passes, N m.
    pub friction_nm: [f64; 7],
    /// Combinations of the 28 numbers that the torques determined better than the model's.
    pub determined: f64,
    /// Corrections of the links, the one that J1 turns first.
    pub links: [LinkData; 7],
}

/// Residuals with the weight before, and with the one that was found.
#[derive(Debug, Serialize, JsonSchema)]
pub struct BeforeAfter {
    /// With the weight before.
    pub before: Left,
    /// With the weight that was found.
    pub after: Left,
}

/// Residuals of each joint.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Left {
    /// Root of the mean square, N m.
    pub rms_nm: [f64; 7],
    /// Largest, N m.
    pub worst_nm: [f64; 7],
}

/// Correction of a link.
#[derive(Debug, Serialize, JsonSchema)]
pub struct LinkData {
    /// Mass beyond the model's, as a share of it.
    pub share: f64,
    /// Shift of the first moment, as a share of the model's mass, m.
    pub shift_m: [f64; 3],
}

/// Data of `tactus --json calibrate gravity --show` and `--reset`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct WeightShown {
    /// Whose weight it is.
    pub source: &'static str,
    /// It is stored in the device.
    pub stored: bool,
    /// The device computes with it now.
    pub in_use: bool,
    /// It counts for an arm with sensor and hand.
    pub with_hand: bool,
    /// Corrections of the links, the one that J1 turns first.
    pub links: [LinkData; 7],
}

/// The words for whose weight counts.
pub(super) fn weight_words(weight: &Weight) -> String {
    let is_models = weight.links.iter().flatten().all(|number| *number == 0.0);
    match (weight.source, weight.in_use) {
        (HomeSource::Stored, _) if is_models => "the robot model's, for the declared payload".to_owned(),
        (HomeSource::Stored, false) => "stored in the device, not in use: torque, or another payload".to_owned(),
        (source, _) => source.name().to_owned(),
    }
}

fn weight_data(weight: &Weight) -> WeightShown {
    WeightShown {
        source: weight.source.name(),
        stored: weight.source == HomeSource::Stored,
        in_use: weight.in_use,
        with_hand: weight.hand,
        links: weight.links.map(|link| {
            let [share, x, y, z] = link.map(f64::from);
            LinkData { share, shift_m: [x, y, z] }
        }),
    }
}

fn weight_text(weight: &Weight) -> String {
    let mut table = Table::new(["link", "mass beyond the model's", "shift x, y, z, mm"]);
    for (link, [share, shift @ ..]) in weight.links.iter().enumerate() {
        let [x, y, z] = shift.map(|shift| shift * 1e3);
        table.row([format!("{}", link + 1), format!("{:+.1} %", share * 100.0), format!("{x:+.1} {y:+.1} {z:+.1}")]);
    }
    format!("{table}weight: {}", weight_words(weight))
}
