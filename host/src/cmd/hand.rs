//! `tactus hand`: initialises the hand, opens, closes or moves it.

use clap::{Args, Subcommand};
use link::HandStage;
use schemars::JsonSchema;
use serde::Serialize;

use crate::check::DIGITS;

use super::{ErrorCode, Failure, Global, connection};
use lab::client::Client;
use lab::device::Device;
use lab::error::Capability;
use lab::procedure::{self, HandReach, ProcedureError};

/// Fingers open, spread as it stands, rad. A tenth off the stops, which the drives need not press.
const OPEN: f32 = 0.1;

/// Fingers closed without an object, rad: short of the 140 degrees at which they would touch the palm.
const CLOSED: f32 = 2.3;

/// Options of `hand`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Action of the hand
    #[command(subcommand)]
    pub action: Action,
    /// I have brought the arm to its home pose: zero it there if need be
    #[arg(long)]
    pub at_home: bool,
}

/// Actions of a hand.
#[derive(Debug, Clone, Copy, PartialEq, Subcommand)]
pub enum Action {
    /// Drive the fingers to their stops, from where they count; again, if that was done
    Init,
    /// Open the fingers
    Open,
    /// Close the fingers, as far as what is between them allows
    Close,
    /// Move to spread and fingers 1 to 3, rad
    To {
        /// Spread and fingers 1 to 3, rad
        #[arg(value_name = "S,F1,F2,F3", value_parser = digits, allow_hyphen_values = true)]
        posture: Posture,
    },
}

/// Spread and fingers F1 to F3, rad.
pub type Posture = [f32; 4];

/// Moves the hand; the arm holds its pose meanwhile.
///
/// # Errors
/// The device cannot be reached, has no hand, or refuses.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "hand";
    let output = global.output();
    let mut client = connection::open(global, DOING, |_| {})?;
    client.require(Capability::Hand).map_err(|error| error.into_failure(DOING))?;
    let before = client.status().map_err(|error| error.into_failure(DOING))?;
    connection::ready(&mut client, command.at_home, output, DOING)?;
    if command.action == Action::Init && before.hand_stage == HandStage::Ready {
        // Whoever asks for it has a reason: a finger or the spread that met something counts from there.
        procedure::initialise_hand_anew(&mut client).map_err(|error| connection::failure(error, DOING))?;
    }
    let status = client.status().map_err(|error| error.into_failure(DOING))?;
    if status.hand_stage != HandStage::Ready {
        return Err(Failure::new(ErrorCode::NoHand, DOING, "the arm has no hand that works"));
    }
    let spread = status.hand[0];
    let target = match command.action {
        Action::Init => None,
        Action::Open => Some([spread, OPEN, OPEN, OPEN]),
        Action::Close => Some([spread, CLOSED, CLOSED, CLOSED]),
        Action::To { posture } => Some(posture),
    };
    let spinner = output.spinner("moving the hand");
    let reached = target.map(|target| go(&mut client, target)).transpose();
    spinner.finish_and_clear();
    let reached = reached.map_err(|error| connection::failure(error, DOING))?;
    let hand = client.status().map_err(|error| error.into_failure(DOING))?.hand;
    let [spread, first, second, third] = hand;
    let word = match reached {
        Some(HandReach::Stopped(_)) => "stopped by something",
        Some(HandReach::Reached) => "reached",
        None => "initialised",
    };
    output.result(
        &Moved { hand_rad: hand, result: word.to_owned() },
        format!("{word}: spread {spread:.3}, fingers {first:.3}, {second:.3}, {third:.3} rad"),
    )
}

/// Data of `tactus --json hand`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Moved {
    /// Spread and fingers 1 to 3, rad.
    pub hand_rad: Posture,
    /// `initialised`, `reached` or `stopped by something`.
    pub result: String,
}

/// The hand moves only while the arm has torque.
fn go(client: &mut Client<Device>, target: Posture) -> Result<HandReach, ProcedureError> {
    let state = control::State::from_code(client.status()?.state);
    if !matches!(state, Some(control::State::Hold | control::State::Gravity)) {
        client.hold()?;
    }
    procedure::move_hand_to_the_end(client, target)
}

/// Four angles separated by commas.
fn digits(text: &str) -> Result<Posture, String> {
    let angles = super::learn::numbers::<4>(text)?;
    for (angle, (digit, [min, max])) in angles.iter().zip(DIGITS) {
        if !(min..=max).contains(angle) {
            return Err(format!("{digit}: {angle} rad is outside {min:.2} to {max:.2} rad"));
        }
    }
    Ok(angles.map(|angle| angle as f32))
}
