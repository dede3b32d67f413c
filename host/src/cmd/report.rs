//! `tactus report`: one page of HTML about one run or several.

use std::path::{Path, PathBuf};

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, files, plot};
use lab::demonstration::RecordingError;
use lab::report::{ReportedRun, page};

/// Options of `report`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Recordings of `tactus run --record`; several are laid over one another by the progress of the movement
    #[arg(value_name = "RUN", required = true)]
    pub runs: Vec<PathBuf>,
    /// The primitive that ran, TOML: its expectation becomes a band in the figures
    #[arg(long, short, value_name = "PRIMITIVE")]
    pub primitive: Option<PathBuf>,
    /// Heading; otherwise the name of the primitive or of the first run
    #[arg(long)]
    pub title: Option<String>,
    /// Where the page goes, HTML
    #[arg(long, short, value_name = "FILE", default_value = "report.html")]
    pub output: PathBuf,
}

/// Writes the report.
///
/// # Errors
/// A file cannot be read or is wrong, a run played another primitive, or the page is there already or cannot be
/// written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    const DOING: &str = "report";
    let inputs: Vec<&Path> = command.runs.iter().chain(&command.primitive).map(PathBuf::as_path).collect();
    let output_file = files::create(&command.output, global, &inputs, "report refused")?;
    let invalid = |cause: RecordingError| match cause {
        RecordingError::MissingColumns { .. } => Failure::new(ErrorCode::PlotInput, DOING, cause)
            .help("give a recording of `tactus run --record`; `tactus plot` draws others"),
        _ => Failure::of_file(ErrorCode::PlotInput, DOING, cause),
    };
    let primitive = command.primitive.as_deref().map(|path| super::check::read(path, DOING)).transpose()?;
    let read = |file: &PathBuf| ReportedRun::read(file, primitive.as_ref()).map_err(invalid);
    let given = once_each(&command.runs, global);
    let mut runs = given.iter().copied().map(read).collect::<Result<Vec<_>, _>>()?;
    tell_apart(&mut runs, &given);
    if let Some(file) = &primitive {
        runs.iter().try_for_each(|run| plot::same_movement(file, &run.running, "report refused"))?;
    }
    // A recording that does not name its movement contradicts none.
    let named: Vec<_> = runs.iter().map(|run| &run.running).filter(|run| run.origin.primitive.is_some()).collect();
    named.iter().try_for_each(|run| plot::same_as(named[0], run, "report refused"))?;
    for run in runs.iter().filter(|run| run.runs > 1) {
        global.output().warn(format!("{} holds {} runs: the last one is taken", run.name, run.runs));
    }
    let name = primitive.as_ref().map(|primitive| primitive.name.clone());
    let title = command.title.clone().or(name).or_else(|| Some(runs.first()?.name.clone())).unwrap_or_default();
    let html = page(&title, &runs, primitive.as_ref());
    files::fill(output_file, html.as_bytes(), DOING)?;
    let outcome = |run: &ReportedRun| ReportedOutcome { run: run.name.clone(), outcome: run.outcome.words() };
    let outcomes: Vec<_> = runs.iter().map(outcome).collect();
    let lines: Vec<String> = runs.iter().map(|run| format!("{}: {}", run.name, run.outcome.words())).collect();
    global.output().result(
        &Reported { file: files::text(&command.output), runs: outcomes },
        format!("{}\nwrote {}", lines.join("\n"), command.output.display()),
    )
}

/// The recordings, each once, by whatever names: a line that hides another would look like two equal runs.
fn once_each<'a>(given: &'a [PathBuf], global: &Global) -> Vec<&'a PathBuf> {
    let mut places = Vec::new();
    let is_new = |file: &&PathBuf| {
        let place = file.canonicalize().unwrap_or_else(|_| PathBuf::clone(file));
        let is_new = !places.contains(&place);
        if is_new {
            places.push(place);
        } else {
            global.output().warn(format!("{} is given twice: it is drawn once", file.display()));
        }
        is_new
    };
    given.iter().filter(is_new).collect()
}

/// Names recordings by their paths where two have the same name, as those in folders of `tactus run --keep` have.
fn tell_apart(runs: &mut [ReportedRun], files: &[&PathBuf]) {
    let names: Vec<String> = runs.iter().map(|run| run.name.clone()).collect();
    for (run, file) in runs.iter_mut().zip(files) {
        if names.iter().filter(|name| **name == run.name).count() > 1 {
            run.name = files::text(file);
        }
    }
}

/// Data of `tactus --json report`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Reported {
    /// The page that was written.
    pub file: String,
    /// The runs in it.
    pub runs: Vec<ReportedOutcome>,
}

/// The end of one run.
#[derive(Debug, Serialize, JsonSchema)]
pub struct ReportedOutcome {
    /// Its recording.
    pub run: String,
    /// Its end, in words.
    pub outcome: String,
}
