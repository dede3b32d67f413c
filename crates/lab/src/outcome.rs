//! `Outcome`: the end of a recorded run, as a report tells it and as a success is judged by.

use std::ops::Range;

use control::{Fault, State};

use crate::demonstration::Recording;
use crate::tracking::{Missed, Tracking};

/// The end of a run.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Outcome {
    /// No plan was played.
    NeverBegan,
    /// No plan was played, because a fault came before.
    FaultedBefore(Fault),
    /// The arm came to the end of the movement and held.
    Arrived,
    /// The same, but what was measured on the way was not as in the successful runs.
    ArrivedUnlike,
    /// It came to the end of the movement and held, away from its goal.
    Missed(Missed),
    /// A fault stopped it.
    Faulted(Fault),
    /// It was stopped, by a person or another program.
    Stopped,
    /// The recording ends before the movement does.
    Unfinished,
}

impl Outcome {
    /// The end of the last run of a recording; the whole of one without states counts as a run whose end was not
    /// recorded.
    #[must_use]
    pub fn of(recording: &Recording) -> Outcome {
        let last = recording.runs().pop().unwrap_or_default();
        match end(recording, &last) {
            Outcome::Arrived => arrival(&recording.running()),
            end => end,
        }
    }

    /// True for the one that was wanted.
    #[must_use]
    pub fn is_good(self) -> bool {
        self == Self::Arrived
    }

    /// One sentence without full stop.
    #[must_use]
    pub fn words(self) -> String {
        match self {
            Self::NeverBegan => "no movement was played".to_owned(),
            Self::FaultedBefore(fault) => {
                format!("stopped by a fault before any movement was played ({fault:?}): {fault}")
            }
            Self::Arrived => "arrived, and held the goal".to_owned(),
            Self::ArrivedUnlike => {
                "arrived, and held the goal, but not as the successful runs: what was to be done may have failed"
                    .to_owned()
            }
            Self::Missed(missed) => missed.to_string(),
            Self::Faulted(fault) => format!("stopped by a fault ({fault:?}): {fault}"),
            Self::Stopped => "stopped by a person or by another program".to_owned(),
            Self::Unfinished => {
                "the recording ends in the middle of the movement, as when somebody stops it".to_owned()
            }
        }
    }
}

/// An arm that holds at the end of its plan may be elsewhere, or have measured what it did not in the successful runs.
fn arrival(running: &Recording) -> Outcome {
    if let Some(missed) = Tracking::of_run(running).ok().and_then(|tracking| tracking.missed()) {
        return Outcome::Missed(missed);
    }
    let is_unlike = running.flags.iter().flatten().any(|sample| sample & control::flags::SURPRISE != 0);
    if is_unlike { Outcome::ArrivedUnlike } else { Outcome::Arrived }
}

/// The end of the run of these samples: what came right behind it counts. A fault that was cleared before, and what the
/// arm did afterwards, are other stories.
fn end(recording: &Recording, run: &Range<usize>) -> Outcome {
    let fault = |samples: Range<usize>| {
        let codes = recording.fault.iter().flatten().take(samples.end).skip(samples.start);
        let mut faults = codes.filter_map(|code| u8::try_from(*code).ok().and_then(Fault::from_code));
        faults.find(|fault| *fault != Fault::None)
    };
    if run.is_empty() {
        return fault(0..recording.len()).map_or(Outcome::NeverBegan, Outcome::FaultedBefore);
    }
    let states: Vec<Option<State>> = recording.state.iter().flatten().map(|name| named(name)).collect();
    let behind = run.end;
    // Until the arm is taken up again: that clears the fault.
    let taken_up = |state: &Option<State>| matches!(state, Some(State::Hold | State::Gravity | State::Approach));
    let end = states.iter().skip(behind).position(taken_up).map_or(recording.len(), |at| behind + at);
    match (states.get(behind), fault(behind..end)) {
        (Some(Some(State::Hold)), _) => Outcome::Arrived,
        (_, Some(fault)) => Outcome::Faulted(fault),
        (Some(_), None) => Outcome::Stopped,
        (None, None) => Outcome::Unfinished,
    }
}

fn named(name: &str) -> Option<State> {
    State::ALL.into_iter().find(|state| state.name() == name)
}
