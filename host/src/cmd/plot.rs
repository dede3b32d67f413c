//! `tactus plot`: one figure of demonstration, plan and execution.

use std::path::PathBuf;

use clap::Args;
use serde_json::json;

use super::{Exit, Failure, Global};
use crate::demonstration::{Demonstration, Preparation, Recording};
use crate::plan;
use crate::plot::{self, Movement, movement::PosePath};
use crate::primitive_file::PrimitiveFile;
use crate::tracking::Tracking;

/// Options of `plot`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// The demonstration, CSV.
    #[arg(long, short, value_name = "CSV")]
    pub demonstration: Option<PathBuf>,
    /// The primitive, TOML.
    #[arg(long, short, value_name = "TOML")]
    pub primitive: Option<PathBuf>,
    /// The recording of a run, CSV.
    #[arg(long, short, value_name = "CSV")]
    pub run: Option<PathBuf>,
    /// Title; otherwise the name of the primitive or of the first file.
    #[arg(long)]
    pub title: Option<String>,
    /// Show the whole demonstration, with the time in which the arm stood still.
    #[arg(long)]
    pub no_trim: bool,
    /// Where to write the figure: `.svg` or `.png`. May be given more than once.
    #[arg(long, short, required = true, value_name = "FILE")]
    pub output: Vec<PathBuf>,
}

/// Draws the figure.
///
/// # Errors
/// A file cannot be read or is wrong, or the figure cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let doing = "plot";
    let invalid = |cause: Box<dyn std::error::Error + Send + Sync>| Failure::new(Exit::Invalid, "E610", doing, cause);
    let demonstration = match &command.demonstration {
        None => None,
        Some(file) => {
            let preparation = if command.no_trim { Preparation { still_speed: None } } else { Preparation::default() };
            let recording = Recording::read(file).map_err(|cause| invalid(cause.into()))?;
            Some(Demonstration::prepare(&recording, &preparation).map_err(|cause| invalid(cause.into()))?)
        }
    };
    let primitive =
        command.primitive.as_deref().map(PrimitiveFile::read).transpose().map_err(|cause| invalid(cause.into()))?;
    let plan = match &primitive {
        None => None,
        Some(file) => {
            let primitive = file.to_primitive().map_err(|cause| invalid(cause.into()))?;
            let references = plan::roll_out(&primitive).map_err(|cause| invalid(cause.to_string().into()))?;
            Some(plan::pose_path(&references))
        }
    };
    let execution = command.run.as_deref().map(Recording::read).transpose().map_err(|cause| invalid(cause.into()))?;
    let tracking = match &execution {
        None => None,
        Some(recording) => Some(Tracking::of_run(recording).map_err(|cause| invalid(cause.into()))?),
    };
    let name = command
        .title
        .clone()
        .or_else(|| primitive.as_ref().map(|primitive| primitive.name.clone()))
        .or_else(|| {
            let file = command.run.as_ref().or(command.demonstration.as_ref())?;
            Some(file.file_stem()?.to_string_lossy().into_owned())
        })
        .unwrap_or_default();
    let movement = Movement {
        name,
        demonstration: demonstration.as_ref().map(PosePath::of_demonstration),
        plan,
        execution: execution.map(|recording| recording.running()),
    };
    let page = movement.page().map_err(|cause| {
        Failure::new(Exit::Usage, "E210", doing, cause)
            .help("tactus plot --demonstration demo.csv --primitive reach.toml --run run.csv --output figure.png")
    })?;
    let spinner = output.spinner("drawing");
    for file in &command.output {
        plot::write(&page, file).map_err(|cause| {
            let exit = if matches!(cause, plot::PlotError::Format { .. }) { Exit::Usage } else { Exit::Internal };
            let code = if exit == Exit::Usage { "E211" } else { "E111" };
            Failure::new(exit, code, doing, cause)
        })?;
    }
    spinner.finish_and_clear();
    let text: Vec<String> = command.output.iter().map(|file| file.display().to_string()).collect();
    output.result(&json!({ "figures": command.output, "tracking": tracking }), text.join("\n"))
}
