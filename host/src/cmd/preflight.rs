//! The preconditions of a run: each with its value, told before anything moves.

use control::{Fault, State};
use device::Stage;
use lab::client::Client;
use lab::device::Device;
use lab::error::explain_blocked;
use lab::primitive_file::{PrimitiveFile, Waypoint};
use lab::procedure::Mode;
use lab::startup_guide::{blocked_remedy, stage_remedy};
use link::message::Capabilities;
use link::{HandStage, Listing, Refusal, Status};
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Output};
use crate::check::CheckReport;

/// A joint nearer than this to the start posture is there, rad.
const AT_START: f64 = 0.02;

/// One precondition.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Precondition {
    /// Name of the item.
    pub item: &'static str,
    /// Value that was found.
    pub value: String,
    /// A run may begin, as far as this goes.
    pub met: bool,
    /// Remedy, in words for a person; none where it is met.
    pub remedy: Option<&'static str>,
    #[serde(skip)]
    refusal: Option<Refusal>,
}

/// The run that is asked for, and the findings without the device.
pub(super) struct Asked<'a> {
    /// The primitive.
    pub file: &'a PrimitiveFile,
    /// Speed relative to the taught one.
    pub speed: f64,
    /// Another goal than the taught one, m.
    pub goal: Option<[f64; 3]>,
    /// Use of the measured force.
    pub mode: Mode,
    /// The check of the movement.
    pub check: &'a CheckReport,
}

/// All preconditions of a run, in the order in which they are told.
///
/// # Errors
/// The device does not answer.
pub(super) fn look(client: &mut Client<Device>, asked: &Asked<'_>, doing: &str) -> Result<Vec<Precondition>, Failure> {
    let status = client.status().map_err(|error| error.into_failure(doing))?;
    let name = link::Name::new(&asked.file.name).map_err(|cause| Failure::new(ErrorCode::NameInvalid, doing, cause))?;
    let stored = client.find(&name).map_err(|error| error.into_failure(doing))?;
    let hello = client.hello();
    let device = format!("{} {}", hello.board.as_str(), hello.serial.as_str()).trim_end().to_owned();
    let mut list = vec![met("device", device)];
    list.extend(of_movement(asked, stored.as_ref()));
    list.extend(of_device(&status, hello.capabilities, asked.mode, &asked.file.start));
    Ok(list)
}

/// Refuses a run that lacks something: the first such item is named, with its remedy.
///
/// # Errors
/// An item is not met.
pub(super) fn require(list: &[Precondition]) -> Result<(), Failure> {
    let missing = list.iter().find_map(|item| Some((item, item.refusal?)));
    missing.map_or(Ok(()), |(Precondition { item, value, remedy, .. }, refusal)| {
        let failure = Failure::new(ErrorCode::Refused(refusal), "run refused", format!("{item}: {value}"))
            .help(remedy.unwrap_or(refusal.remedy()));
        Err(failure.data(serde_json::json!({ "preconditions": list })))
    })
}

/// Says the list to a person.
pub(super) fn tell(list: &[Precondition], output: Output) {
    let wide = list.iter().map(|entry| entry.item.len()).max().unwrap_or(0);
    for Precondition { item, value, met, .. } in list {
        output.say(format!("{} {item:wide$}  {value}", if *met { "  " } else { "! " }));
    }
}

/// Names of the items that are not met.
pub(super) fn missing(list: &[Precondition]) -> Vec<&'static str> {
    list.iter().filter(|entry| !entry.met).map(|entry| entry.item).collect()
}

fn met(item: &'static str, value: impl Into<String>) -> Precondition {
    Precondition { item, value: value.into(), met: true, remedy: None, refusal: None }
}

fn item(item: &'static str, value: impl Into<String>, is_met: bool, refusal: Refusal) -> Precondition {
    let refusal = Some(refusal).filter(|_| !is_met);
    Precondition { met: is_met, remedy: refusal.map(Refusal::remedy), refusal, ..met(item, value) }
}

fn of_movement(asked: &Asked<'_>, stored: Option<&Listing>) -> Vec<Precondition> {
    let Asked { file, speed, goal, mode, check } = asked;
    let duration = file.movement.duration;
    let primitive = match stored {
        Some(stored) => format!("{}, checksum 0x{:08x}, {} kernels", file.name, stored.crc, stored.kernels),
        None => format!("{} is not in the device", file.name),
    };
    let goal = goal.map_or("as taught".to_owned(), |[x, y, z]| format!("{x:.3}, {y:.3}, {z:.3} m"));
    let expectation = match &file.expectation {
        Some(expectation) => format!("recorded in {:.2} s", expectation.recorded_duration),
        None => "none".to_owned(),
    };
    let mut list = vec![
        item("primitive", primitive, stored.is_some(), Refusal::NoSuchPrimitive),
        met("speed", format!("{speed:.2} of the taught one: {:.2} s", duration / speed)),
        met("goal", goal),
        met("mode", mode.name()),
        // A mode that needs it has been refused before, if it is missing.
        met("expected force", expectation),
    ];
    let relative = |margin: &&crate::check::Margin| margin.margin / margin.bound.abs().max(f64::MIN_POSITIVE);
    let worst = check.margins.iter().min_by(|a, b| relative(a).total_cmp(&relative(b)));
    list.extend(worst.map(|worst| met("nearest limit", worst.words())));
    list
}

fn of_device(status: &Status, drives: Capabilities, mode: Mode, start: &Waypoint) -> Vec<Precondition> {
    let fault = Fault::from_code(status.fault).filter(|fault| *fault != Fault::None);
    let stage = Stage::from_code(status.startup_stage);
    let mut starts = stage.map_or("unknown", Stage::explanation).to_owned();
    if let Some(numbers) = status.blocked {
        starts += &format!(": {}", explain_blocked(numbers));
    }
    let words = fault.map_or("none".to_owned(), |fault| format!("{fault:?}: {fault}"));
    let mut startup = item("start-up", starts, stage == Some(Stage::Ready), Refusal::NotReady);
    let remedy = status.blocked.and_then(blocked_remedy).or_else(|| stage.and_then(stage_remedy));
    startup.remedy = startup.remedy.map(|usual| remedy.unwrap_or(usual));
    let mut list = vec![item("fault", words, fault.is_none(), Refusal::Faulted), startup];
    if drives.arm {
        let zeroed = if status.zeroed { "count from home" } else { "not zeroed" };
        let pendant = super::status::safety_mode(status.safety_mode);
        list.push(item("joint angles", zeroed, status.zeroed, Refusal::NotZeroed));
        list.push(item("pendant", pendant, status.safety_mode == Some(2), Refusal::SafetyMode));
        let sensor = super::status::force_sensor(status.wrench_zeroed);
        let is_enough = !mode.needs_expectation() || status.wrench_zeroed == Some(true);
        list.push(item("force sensor", sensor, is_enough, Refusal::WrenchMissing));
    }
    let is_there = drives.arm || status.hand_stage != HandStage::Absent;
    let hand = match status.hand_stage {
        HandStage::NotInitialised => "its fingers go to their stops first",
        HandStage::Failed => "it failed before; its fingers go to their stops first",
        stage => stage.name(),
    };
    list.push(item("hand", hand, is_there, Refusal::NoHand));
    if drives.arm && status.zeroed {
        list.push(met("start posture", distance(status, start)));
    }
    let state = State::from_code(status.state).map_or("unknown", State::name);
    list.push(met("state", state));
    list
}

/// The joint that is farthest from the start of the movement.
fn distance(status: &Status, start: &Waypoint) -> String {
    let away = status.q.iter().zip(&start.posture).map(|(at, to)| (f64::from(*at) - to).abs());
    match (1..).zip(away).max_by(|a, b| a.1.total_cmp(&b.1)) {
        Some((joint, away)) if away > AT_START => format!("J{joint} is {away:.3} rad away: the arm goes there first"),
        Some((joint, away)) => format!("reached; J{joint} is {away:.3} rad away"),
        None => "reached".to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ARM: Capabilities = Capabilities { arm: true, hand: true, wrench: true };

    fn begins(posture: [f64; 7]) -> Waypoint {
        Waypoint { position: [0.5; 3], orientation: [1.0, 0.0, 0.0, 0.0], posture, hand: [0.0; 4] }
    }

    fn ready() -> Status {
        Status {
            startup_stage: Stage::Ready.code(),
            state: State::Hold.code(),
            zeroed: true,
            safety_mode: Some(2),
            hand_stage: HandStage::Ready,
            wrench_zeroed: Some(true),
            ..Status::default()
        }
    }

    fn named(status: &Status, drives: Capabilities, mode: Mode) -> Vec<&'static str> {
        let start = begins([0.5; 7]);
        let list = of_device(status, drives, mode, &start);
        let names = missing(&list);
        let told = require(&list).err();
        assert_eq!(told.is_some(), !names.is_empty());
        if let (Some(failure), Some(first)) = (told, names.first()) {
            assert_eq!(failure.code.exit() as u8, 5);
            assert!(failure.to_string().contains(first) && failure.help.is_some(), "{failure}");
        }
        names
    }

    #[test]
    fn cli_10_each_item_that_is_missing_is_named_with_its_remedy_and_ends_with_5() {
        let fault = Fault::ALL.iter().find(|fault| **fault != Fault::None).unwrap().code();
        let table: [(Status, Mode, &[&str]); 10] = [
            (ready(), Mode::Adaptive, &[]),
            (Status { fault, ..ready() }, Mode::Track, &["fault"]),
            (Status { startup_stage: Stage::WaitingForZero.code(), ..ready() }, Mode::Track, &["start-up"]),
            (Status { zeroed: false, ..ready() }, Mode::Track, &["joint angles"]),
            (Status { safety_mode: Some(1), ..ready() }, Mode::Track, &["pendant"]),
            (Status { safety_mode: None, ..ready() }, Mode::Track, &["pendant"]),
            (Status { wrench_zeroed: Some(false), ..ready() }, Mode::Adaptive, &["force sensor"]),
            (Status { wrench_zeroed: None, ..ready() }, Mode::ForceControl, &["force sensor"]),
            (Status { wrench_zeroed: None, ..ready() }, Mode::Track, &[]),
            (Status { hand_stage: HandStage::Absent, ..ready() }, Mode::Track, &[]),
        ];
        for (status, mode, expected) in table {
            assert_eq!(named(&status, ARM, mode), expected, "{status:?}");
        }
        let alone = Capabilities { arm: false, ..ARM };
        assert!(named(&Status { zeroed: false, safety_mode: None, ..ready() }, alone, Mode::Track).is_empty());
        assert_eq!(named(&Status { hand_stage: HandStage::Absent, ..ready() }, alone, Mode::Track), ["hand"]);
    }

    #[test]
    fn the_joint_that_is_farthest_from_the_start_is_named() {
        let start = begins([0.0, 0.0, 0.0, 0.75, 0.0, 0.0, 0.0]);
        assert_eq!(distance(&ready(), &start), "J4 is 0.750 rad away: the arm goes there first");
        assert!(distance(&ready(), &begins([0.0; 7])).starts_with("reached"));
    }
}
