//! `tactus monitor`: the arm on one screen, beside whoever commands it.

use std::io::IsTerminal as _;
use std::path::PathBuf;
use std::time::Duration;

use clap::Args;

use super::{ErrorCode, Failure, Global, Output, connection, teach, upload};
use crate::monitor::{Screen, Streamed, Watch, Wish};
use lab::client::{Client, Incoming};
use lab::device::Device;
use lab::error::HostError;
use link::Refusal;

/// Cycles between two that are asked for: 30 a second.
const EVERY: u8 = 10;

/// Cycles between two lines of the stream: ten a second.
const LINE_EVERY: u32 = 30;

/// Time between two questions for state and counters.
const ASK_EVERY: Duration = Duration::from_millis(500);

/// Time between two looks at the keyboard.
const LOOK_EVERY: Duration = Duration::from_millis(60);

/// Words where the device does not know this program any more because it was started anew.
const RESTARTED: &str =
    "the device was started anew, and the monitor looks on anew: what happened meanwhile is not shown";

/// Words where the device let go of this program.
const ANEW: &str = "the monitor was suspended, and looks on anew: what happened meanwhile is not shown";

/// Options of `monitor`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The primitive that runs, TOML: the wrench that it expects is shown beside the measured one
    #[arg(long, short, value_name = "PRIMITIVE")]
    pub primitive: Option<PathBuf>,
    /// End after this time, at most 3600 s
    #[arg(long, value_name = "SECONDS", value_parser = teach::duration, allow_hyphen_values = true)]
    pub duration: Option<f64>,
}

/// Shows the arm until somebody has seen enough. Nothing is asked to move; a key stops the arm, whoever commands it.
///
/// # Errors
/// The device cannot be reached or falls silent; there is no terminal, and no JSON is asked for.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "monitor";
    if !global.json && !std::io::stdout().is_terminal() {
        return Err(Failure::new(ErrorCode::NoTerminal, DOING, "standard output is not a terminal"));
    }
    let mut watch = Watch::default();
    if let Some(path) = &command.primitive {
        let file = upload::read(path, DOING)?;
        watch.alpha = Some(file.movement.alpha);
        watch.primitive = Some(file.to_primitive().map_err(|cause| super::check::failure(cause, path, DOING))?);
    }
    let mut client = connection::observe(global, DOING)?;
    watch.hello = client.hello().clone();
    let mut view = if global.json {
        View::Lines(global.output())
    } else {
        View::Screen(Screen::open().map_err(|cause| Failure::new(ErrorCode::NoTerminal, DOING, cause))?)
    };
    let watched = follow_on(&mut client, &mut watch, &mut view, command.duration);
    // What is said of the end belongs to the shell.
    drop(view);
    match watched {
        Err(Ended::Host(HostError::Interrupted | HostError::Left)) | Ok(()) => Ok(()),
        Err(Ended::Host(error)) => Err(error.into_failure(DOING)),
        Err(Ended::View(failure)) => Err(failure),
    }
}

/// Why watching ended before somebody wanted it to.
enum Ended {
    Host(HostError),
    View(Failure),
}

impl From<HostError> for Ended {
    fn from(error: HostError) -> Self {
        Self::Host(error)
    }
}

/// Where it is shown.
enum View {
    Screen(Screen),
    Lines(Output),
}

/// Follows, and looks on anew wherever the device does not know this program any more: it was started anew, or has let
/// go of a program that was suspended.
fn follow_on(
    client: &mut Client<Device>,
    watch: &mut Watch,
    view: &mut View,
    duration: Option<f64>,
) -> Result<(), Ended> {
    let end = duration.map(|seconds| client.now() + Duration::from_secs_f64(seconds));
    loop {
        match follow(client, watch, view, end) {
            Err(Ended::Host(HostError::Refused { reason: Refusal::NoSession, .. })) => {}
            ended => return ended,
        }
        let owner = connection::owner(client.is_virtual());
        let restarted = client.observe_anew(&owner)?;
        watch.hello = client.hello().clone();
        let cycle = client.status()?.cycle;
        let words = watch.note(cycle, if restarted { RESTARTED } else { ANEW }).to_owned();
        match view {
            View::Lines(output) => {
                if !output.line(&Streamed::Event { event: words, cycle }, "").map_err(Ended::View)? {
                    return Ok(());
                }
            }
            // A shell has had the terminal meanwhile.
            View::Screen(screen) => screen.take_back().map_err(broken)?,
        }
    }
}

/// The terminal cannot be used.
fn broken(cause: std::io::Error) -> Ended {
    Ended::View(Failure::new(ErrorCode::NoTerminal, "monitor", cause))
}

fn follow(client: &mut Client<Device>, watch: &mut Watch, view: &mut View, end: Option<Duration>) -> Result<(), Ended> {
    client.set_telemetry(EVERY)?;
    let (mut asked, mut drawn, mut line) = (None, None, None);
    loop {
        let now = client.now();
        if end.is_some_and(|end| now >= end) {
            return Ok(());
        }
        if asked.is_none_or(|asked| now.saturating_sub(asked) >= ASK_EVERY) {
            watch.answer(client.status()?);
            watch.statistics = client.statistics()?;
            asked = Some(now);
        }
        match client.next(LOOK_EVERY)? {
            Some(Incoming::Telemetry(telemetry)) => {
                watch.cycle(telemetry);
                let is_due = line.is_none_or(|last| telemetry.cycle.wrapping_sub(last) >= LINE_EVERY);
                if let (View::Lines(output), true) = (&mut *view, is_due) {
                    if !output.line(&Streamed::Line(Box::new(watch.line())), "").map_err(Ended::View)? {
                        return Ok(());
                    }
                    line = Some(telemetry.cycle);
                }
            }
            Some(Incoming::Event(event)) => {
                let words = watch.event(&event).to_owned();
                if let View::Lines(output) = view {
                    let data = Streamed::Event { event: words, cycle: event.cycle };
                    if !output.line(&data, "").map_err(Ended::View)? {
                        return Ok(());
                    }
                }
            }
            None => {}
        }
        watch.gaps = client.gaps();
        if let View::Screen(screen) = view
            && drawn.is_none_or(|drawn| client.now().saturating_sub(drawn) >= LOOK_EVERY)
        {
            screen.show(watch).map_err(broken)?;
            drawn = Some(client.now());
            match screen.wish().map_err(broken)? {
                Some(Wish::Stop) => client.order_stop()?,
                Some(Wish::Suspend) => screen.suspend().map_err(broken)?,
                Some(Wish::Leave) => return Ok(()),
                None => {}
            }
        }
    }
}
