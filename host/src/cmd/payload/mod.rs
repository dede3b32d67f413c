//! `tactus calibrate payload`: what the arm carries, declared by a person and compared with who answers on its bus, or
//! measured.

pub mod data;
mod measure;

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use control::model::WeightCorrection;
use device::Stage;
use link::{HomeSource, Weight};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global};
use lab::client::Client;
use lab::device::Device;
use lab::error::explain_blocked;

/// Options of `calibrate payload`.
#[derive(Debug, Clone, Args)]
pub struct Payload {
    /// Declare that the arm carries this; without it, what is declared is shown
    #[arg(value_enum)]
    pub carries: Option<Carries>,
    /// Measure mass and centre of what hangs on the wrist, mounted or held, on a tour of slow moves; nothing is kept
    #[arg(long, conflicts_with = "carries")]
    pub measure: bool,
    /// Tell what was taken up since this report of the same arm was made, with an empty hand
    #[arg(long, value_name = "REPORT", requires = "measure", conflicts_with = "carries")]
    pub without: Option<PathBuf>,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long, requires = "measure", conflicts_with = "carries")]
    pub at_home: bool,
    /// Write what was measured into a file too, JSON; in a folder it is named with serial number and time
    #[arg(long, value_name = "FILE", requires = "measure", conflicts_with = "carries")]
    pub report: Option<PathBuf>,
}

impl Payload {
    /// True if the declaration is shown, and nothing else happens.
    pub(super) fn only_looks(&self) -> bool {
        self.carries.is_none() && !self.measure
    }
}

/// Payload of an arm.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
pub enum Carries {
    /// Force/torque sensor and hand: a start-up in which no sensor answers is blocked
    Hand,
    /// Nothing: a start-up in which a sensor answers is blocked
    Nothing,
    /// Whatever answers; nothing is declared
    Undeclared,
}

impl Carries {
    /// As the model has it.
    pub(super) const fn payload(self) -> Option<control::Payload> {
        match self {
            Self::Hand => Some(control::Payload::SensorAndHand),
            Self::Nothing => Some(control::Payload::None),
            Self::Undeclared => None,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Hand => "hand",
            Self::Nothing => "nothing",
            Self::Undeclared => "undeclared",
        }
    }
}

const DOING: &str = "calibrate payload";

/// Shows, declares, takes back or measures what the arm carries. A declaration is kept as a weight without corrections.
///
/// # Errors
/// The device refuses, it keeps a weight that was measured with something else, or what was measured contradicts
/// itself.
pub(super) fn run(command: &Payload, client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    if command.measure {
        return measure::run(command, client, global);
    }
    let failed = |error: lab::error::HostError| error.into_failure(DOING);
    let kept = client.weight().map_err(failed)?;
    if let Some(carries) = command.carries.filter(|carries| *carries != declared(&kept)) {
        if is_measured(&kept) {
            return Err(Failure::new(ErrorCode::WeightOfOtherPayload, DOING, "a measured weight would be lost"));
        }
        match carries.payload() {
            Some(payload) => client.keep_weight(&WeightCorrection::none(payload)),
            None => client.forget_weight(),
        }
        .map_err(failed)?;
        global.tell_forgotten();
        let kept = match carries.payload() {
            Some(_) => "the device keeps the declaration",
            None => "the device has forgotten the declaration",
        };
        return show(client, global).inspect_err(|_| global.output().say(kept));
    }
    show(client, global)
}

/// The payload that a kept weight declares.
pub(super) fn declared(weight: &Weight) -> Carries {
    match (weight.source, weight.hand) {
        (HomeSource::Stored, true) => Carries::Hand,
        (HomeSource::Stored, false) => Carries::Nothing,
        _ => Carries::Undeclared,
    }
}

fn is_measured(weight: &Weight) -> bool {
    weight.source == HomeSource::Stored && weight.links.iter().flatten().any(|number| *number != 0.0)
}

fn show(client: &mut Client<Device>, global: &Global) -> Result<(), Failure> {
    let failed = |error: lab::error::HostError| error.into_failure(DOING);
    let (kept, status) = (client.weight().map_err(failed)?, client.status().map_err(failed)?);
    let is_known = matches!(
        Stage::from_code(status.startup_stage),
        Some(Stage::WaitingForZero | Stage::Zeroing | Stage::Preparing | Stage::WaitingForActive | Stage::Ready)
    );
    let answers = is_known.then(|| status.wrench_zeroed.map_or("no sensor", |_| "sensor"));
    let (declared, blocked) = (declared(&kept), status.blocked.map(explain_blocked));
    let weight = if is_measured(&kept) { "measured" } else { "the model's" };
    let blocked_words = blocked.as_ref().map(|reason| format!("\nstart-up: {reason}")).unwrap_or_default();
    let text = format!(
        "declared: {}\nanswers: {}\nweight: {weight}{blocked_words}",
        declared.name(),
        answers.unwrap_or("not known before the pucks were asked")
    );
    global.output().result(&PayloadShown { declared: declared.name(), answers, weight, blocked }, text)
}

/// Data of `tactus --json calibrate payload` without `--measure`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PayloadShown {
    /// The declared payload: hand, nothing or undeclared.
    pub declared: &'static str,
    /// `sensor` or `no sensor`, by who answers on the arm's bus; null before the pucks were asked.
    pub answers: Option<&'static str>,
    /// Whose weight the links are taken to have.
    pub weight: &'static str,
    /// Why the start-up cannot go on; null where it can.
    pub blocked: Option<String>,
}
