//! `tactus can replay`: a log played to the device's application.

use std::path::PathBuf;

use clap::Args;

use super::source::Source;
use super::{ErrorCode, Failure, Global, connection};
use lab::replay::{Difference, DifferenceKind, Outcome, Replay, ReplayError};

/// Options of `can replay`.
///
/// The log must begin before the co-controller gets power. It should hold the host's bus too (`candump -L can0
/// can1`): orders come from there.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// A log as `candump -L` writes it; `-` is standard input
    #[arg(value_name = "LOG")]
    pub log: PathBuf,
}

/// Plays a log.
///
/// # Errors
/// It cannot be read or begins in the middle, or the device does something else than in the log.
pub(super) fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "can replay";
    let refused = |error: ReplayError| Failure::new(ErrorCode::ReplayImpossible, DOING, error);
    let output = global.output();
    let source = Source::open(Some(&command.log), None, false, DOING)?;
    let interrupt = connection::interrupt();
    let mut replay = Replay::default();
    let garbage = source.read(&interrupt, DOING, |heard| {
        let taken = heard.map_or(Ok(()), |(number, line)| replay.take(number, line));
        taken.map(|()| true).map_err(refused)
    })?;
    if interrupt.is_raised() {
        return Err(Failure::new(
            ErrorCode::Interrupted,
            DOING,
            "interrupted before the end of the log: nothing can be said",
        ));
    }
    let outcome = replay.finish().map_err(refused)?;
    if !outcome.has_host {
        output.warn("the log does not hold the host's bus: orders are missing, and what they caused will differ");
    }
    let failure = match (garbage.cause(), differing(&outcome)) {
        (None, None) => return output.result(&outcome, text(&outcome)),
        (Some(cause), _) => Failure::new(ErrorCode::LogLines, DOING, cause),
        (None, Some(cause)) => {
            let failure = Failure::new(ErrorCode::ReplayDiffers, DOING, cause);
            if outcome.has_host { failure } else { failure.help(BOTH_BUSES) }
        }
    };
    if !global.json {
        output.result(&outcome, text(&outcome))?;
    }
    Err(match serde_json::to_value(&outcome) {
        Ok(data) => failure.data(data),
        Err(_) => failure,
    })
}

/// Remedy for a log without the host's orders.
const BOTH_BUSES: &str = "the log has to hold the orders of the host as well; of a simulated arm it does where the host's line is CAN: \
                          `tactus --device sil:line=can run PRIMITIVE --bus-log FILE`";

/// The difference in short, if there is one.
fn differing(outcome: &Outcome) -> Option<String> {
    let (compared, same) = outcome.telemetry;
    let Some(first) = outcome.differences.first() else {
        let cause = "cycles of telemetry differ, though no frame on the arm's bus does";
        return (same < compared).then(|| format!("{} of {compared} {cause}", compared - same));
    };
    let frames = if outcome.different == 1 { "frame of the device differs" } else { "frames of the device differ" };
    Some(format!("{} {frames}, first: {}", outcome.different, told(first)))
}

fn text(outcome: &Outcome) -> String {
    let mut text = format!(
        "replayed {:.3} s: {} slots, {} control cycles\n\
         given to the device: {} frames of pucks, sensor and hand; {} requests of the host\n\
         frames of the device: {} in the log, {} the same, {} different\n",
        outcome.seconds,
        outcome.slots,
        outcome.cycles,
        outcome.given,
        outcome.requests,
        outcome.logged,
        outcome.same,
        outcome.different
    );
    let (compared, same) = outcome.telemetry;
    if compared > 0 {
        text += &format!("telemetry: {compared} cycles compared, {same} the same\n");
    }
    if outcome.different == 0 {
        text += &differing(outcome).unwrap_or_else(|| "no difference".to_owned());
    } else {
        let shown = outcome.differences.len();
        text += &format!("the first {shown} of {} differences:\n", outcome.different);
        for difference in &outcome.differences {
            text += &format!("  {}\n", told(difference));
        }
    }
    text
}

fn told(difference: &Difference) -> String {
    let Difference { kind, time_s, line, cycle, logged, sent } = difference;
    let (logged, sent) = (logged.as_deref().unwrap_or(""), sent.as_deref().unwrap_or(""));
    match kind {
        DifferenceKind::Other => {
            format!("line {line}, {time_s:.6} s, cycle {cycle}: the log has `{logged}`, the device sent `{sent}`")
        }
        DifferenceKind::NotSent => {
            format!("line {line}, {time_s:.6} s, cycle {cycle}: the log has `{logged}`, the device did not send it")
        }
        DifferenceKind::NotInLog => {
            format!("about {time_s:.6} s, cycle {cycle}: the device sent `{sent}`, the log has it not")
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// "No difference" stood below "telemetry: 5 cycles compared, 4 the same", and the command ended with 0.
    ///
    /// The change that makes it fail: only frames on the arm's bus are a difference.
    #[test]
    fn telemetry_that_differs_is_a_difference() {
        let outcome = Outcome { telemetry: (5, 5), ..Outcome::default() };
        assert!(differing(&outcome).is_none() && text(&outcome).ends_with("no difference"));
        let outcome = Outcome { telemetry: (5, 4), ..Outcome::default() };
        let cause = "1 of 5 cycles of telemetry differ, though no frame on the arm's bus does";
        assert_eq!(differing(&outcome).as_deref(), Some(cause));
        assert!(text(&outcome).ends_with(cause), "{}", text(&outcome));
    }
}
