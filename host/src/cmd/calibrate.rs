//! `tactus calibrate`: the home of the arm, where it stands when it is zeroed, weight and friction, and its payload.

use std::path::PathBuf;

use clap::{ArgGroup, Args, Subcommand};
use link::{Calibration, Refusal};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::{Value, json};

use super::calibration_report::{self, CalibrationReport};
use super::{ErrorCode, Failure, Global, Table, connection, friction, learn, payload, weigh};
use lab::client::Client;
use lab::device::Device;
use lab::error::{Capability, HostError};
use lab::procedure::{self, HomeCorrection};

/// Options of `calibrate`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Action
    #[command(subcommand)]
    pub action: Action,
}

/// Actions on home, weight and payload.
#[derive(Debug, Clone, Subcommand)]
pub enum Action {
    /// Show where the arm is taken to stand when it is zeroed, and whose home that is
    Show,
    /// Store a home of this arm's own; it takes effect at the next zeroing
    Home(Home),
    /// Forget it: the robot model's home is used again
    Forget,
    /// Weigh the links of this arm on a tour of slow moves; its hand must be empty and the way free
    Gravity(weigh::Gravity),
    /// Measure the friction of each joint on slow and faster moves and show it beside the model's; the way must be free
    Friction(friction::Friction),
    /// Declare what the arm carries, or measure its mass and centre by sensor and joints; the way must be free then
    Payload(payload::Payload),
}

impl Action {
    /// True if nothing is changed or moved: it may be asked for beside a host that commands the arm.
    fn only_looks(&self) -> bool {
        match self {
            Self::Show => true,
            Self::Payload(payload) => payload.only_looks(),
            Self::Home(_) | Self::Forget | Self::Gravity(_) | Self::Friction(_) => false,
        }
    }
}

/// The home to store.
#[derive(Debug, Clone, Args)]
#[command(group = ArgGroup::new("angles").required(true))]
pub struct Home {
    /// The arm stands at these true angles now, zeroed, and the home is corrected by what it reads instead, rad
    #[arg(long, group = "angles", value_name = "J1,...,J7", value_parser = posture, allow_hyphen_values = true)]
    pub here: Option<Posture>,
    /// This home itself, rad
    #[arg(long, group = "angles", value_name = "J1,...,J7", value_parser = posture, allow_hyphen_values = true)]
    pub set: Option<Posture>,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long, conflicts_with = "set")]
    pub at_home: bool,
    /// Write what was found into a file too, JSON; in a folder it is named with serial number and time
    #[arg(long, value_name = "FILE")]
    pub report: Option<PathBuf>,
}

/// Joint angles from J1 to J7, rad.
pub type Posture = [f64; 7];

fn posture(text: &str) -> Result<Posture, String> {
    learn::numbers::<7>(text)
}

const DOING: &str = "calibrate";

/// Tells which home the device keeps.
const LOOK: &str = "tactus calibrate show";

/// Shows, stores or forgets the home of the arm.
///
/// # Errors
/// The device cannot be reached, the arm is not zeroed or moves, or the device refuses the home.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let mut client = match command.action.only_looks() {
        true => connection::observe(global, DOING)?,
        false => connection::open(global, DOING, |_| {})?,
    };
    client.require(Capability::Arm).map_err(|error| error.into_failure(DOING))?;
    match &command.action {
        Action::Gravity(command) => weigh::run(command, &mut client, global),
        Action::Friction(command) => friction::run(command, &mut client, global),
        Action::Payload(command) => payload::run(command, &mut client, global),
        Action::Show => show(&mut client, global),
        Action::Forget => {
            client.forget_calibration().map_err(|error| error.into_failure(DOING))?;
            show(&mut client, global).inspect_err(|_| global.output().say("the device has forgotten the home"))
        }
        Action::Home(Home { set: Some(home), report, .. }) => {
            let report = CalibrationReport::open(report.as_deref(), &[], &client, global, DOING)?;
            let stored = store(&mut client, home.map(|angle| angle as f32), None, global);
            let is_kept = calibration_report::is_kept(&stored, LOOK, global);
            let written = report.write("home", is_kept, &json!({ "home_rad": home }), global);
            stored?;
            global.tell_forgotten();
            if written.is_err() {
                global.output().say("the home is stored in the device; its report is not written");
            }
            let stored = |_: &Failure| global.output().say("the home is stored in the device");
            written.and_then(|()| show(&mut client, global).inspect_err(stored))
        }
        Action::Home(Home { here: Some(truth), at_home, report, .. }) => {
            let report = CalibrationReport::open(report.as_deref(), &[], &client, global, DOING)?;
            connection::joints_read(&mut client, *at_home, global.output(), DOING)?;
            let corrected = procedure::correct_home(&mut client, *truth);
            let correction = corrected.map_err(|error| connection::failure(error, DOING))?;
            let stored = store(&mut client, correction.home, Some(&correction), global);
            let is_kept = calibration_report::is_kept(&stored, LOOK, global);
            let written = report.write("home", is_kept, &data(&correction), global);
            stored?;
            global.tell_forgotten();
            let text = format!("{}stored in the device", table(&correction));
            calibration_report::tell(written, &data(&correction), text, global)
        }
        Action::Home(Home { here: None, set: None, .. }) => {
            Err(Failure::new(ErrorCode::NoAngles, DOING, "no angles are given"))
        }
    }
}

/// Has the device keep a home. Where the arm has torque the measurement is not lost: the help repeats its result.
fn store(
    client: &mut Client<Device>,
    home: [f32; 7],
    correction: Option<&HomeCorrection>,
    global: &Global,
) -> Result<(), Failure> {
    client.calibrate(home).map_err(|error| {
        let has_torque = matches!(error, HostError::Refused { reason: Refusal::HasTorque, .. });
        let mut failure = error.into_failure(DOING);
        if has_torque {
            let angles = home.map(|angle| format!("{angle:.5}")).join(",");
            failure = failure.help(format!(
                "support the arm, press Shift+Idle on the pendant, then `tactus calibrate home --set {angles}`"
            ));
        }
        match correction {
            Some(correction) => failure.data(data(correction)),
            None => failure,
        }
    })?;
    // The home is kept: what is only told beside it fails nothing.
    if client.status().is_ok_and(|status| status.zeroed) {
        global.output().say("the arm still counts from its old zero: emergency stop, bring it home, zero it again");
    }
    Ok(())
}

fn show(client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let calibration = client.calibration().map_err(|error| error.into_failure(DOING))?;
    let Calibration { home, source, zeroed_at } = calibration;
    let mut table = Table::new(["joint", "home", "model's", "difference", "zeroed at"]);
    for (joint, (home, model)) in home.iter().zip(control::model::HOME).enumerate() {
        let zeroed_at = zeroed_at.map_or_else(|| "-".to_owned(), |posture| format!("{:.5}", posture[joint]));
        let difference = f64::from(*home) - model;
        table.row([
            format!("J{}", joint + 1),
            format!("{home:.5}"),
            format!("{model:.5}"),
            degrees(difference),
            zeroed_at,
        ]);
    }
    let data = HomeShown {
        home_rad: home.map(f64::from),
        stored: source == link::HomeSource::Stored,
        source: source.name(),
        model_rad: control::model::HOME,
        zeroed_at_rad: zeroed_at.map(|posture| posture.map(f64::from)),
    };
    global.output().result(&data, format!("{table}home: {}", source.name()))
}

/// Data of `tactus --json calibrate show`, `home --set` and `forget`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct HomeShown {
    /// Home of the next zeroing, rad.
    pub home_rad: Posture,
    /// It is this arm's own, stored in the device.
    pub stored: bool,
    /// Whose home it is.
    pub source: &'static str,
    /// Home of the robot model, rad.
    pub model_rad: Posture,
    /// Where the last zeroing took the arm to stand, rad; null if the device does not know.
    pub zeroed_at_rad: Option<Posture>,
}

/// Data of `tactus --json calibrate home --here`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct HomeCorrected {
    /// Angles that the arm read, rad.
    pub read_rad: Posture,
    /// Angles that it really stands at, rad.
    pub true_rad: Posture,
    /// The one less the other, rad.
    pub difference_rad: Posture,
    /// Where the last zeroing took the arm to stand, rad.
    pub home_before_rad: Posture,
    /// The home that is stored now, rad.
    pub home_rad: Posture,
}

/// A difference in rad and degrees.
fn degrees(difference: f64) -> String {
    format!("{difference:+.5} ({:+.2} deg)", difference.to_degrees())
}

fn table(correction: &HomeCorrection) -> Table {
    let mut table = Table::new(["joint", "read", "true", "difference", "home before", "home now"]);
    for joint in 0..7 {
        let (read, truth) = (correction.read[joint], correction.truth[joint]);
        table.row([
            format!("J{}", joint + 1),
            format!("{read:.5}"),
            format!("{truth:.5}"),
            degrees(truth - read),
            format!("{:.5}", correction.zeroed_at[joint]),
            format!("{:.5}", correction.home[joint]),
        ]);
    }
    table
}

fn data(correction: &HomeCorrection) -> Value {
    let HomeCorrection { zeroed_at, read, truth, home } = correction;
    json!(HomeCorrected {
        read_rad: *read,
        true_rad: *truth,
        difference_rad: std::array::from_fn(|joint| truth[joint] - read[joint]),
        home_before_rad: zeroed_at.map(f64::from),
        home_rad: home.map(f64::from),
    })
}
