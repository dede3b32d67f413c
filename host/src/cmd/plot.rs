//! `tactus plot`: one figure of demonstration, plan and execution.

use std::path::{Path, PathBuf};

use clap::Args;
use schemars::JsonSchema;
use serde::Serialize;

use super::{ErrorCode, Failure, Global, Output, files};
use lab::demonstration::{Demonstration, Preparation, Recording};
use lab::learn::SPEEDS;
use lab::output_file::{self, OutputFile};
use lab::plan;
use lab::plot::{self, Movement, movement::PosePath};
use lab::primitive_file::{PrimitiveFile, Provenance};
use lab::tracking::{ComparisonError, Lack, Tracking};

/// The action that fails.
const DOING: &str = "plot";

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
    /// Also a picture of the simulated arm along the run, PNG.
    #[arg(long, value_name = "FILE", requires = "run")]
    pub picture: Option<PathBuf>,
}

/// Draws the figure.
///
/// # Errors
/// A file cannot be read or is wrong, or the figure cannot be written.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let output = global.output();
    let invalid =
        |cause: Box<dyn std::error::Error + Send + Sync>| Failure::of_file(ErrorCode::PlotInput, DOING, cause);
    let inputs: Vec<&Path> = [&command.demonstration, &command.primitive, &command.run]
        .into_iter()
        .flatten()
        .map(PathBuf::as_path)
        .collect();
    let (outputs, picture_file) = open_outputs(command, global, &inputs)?;
    let mut shown = None;
    let demonstration = match &command.demonstration {
        None => None,
        Some(file) => {
            let preparation = if command.no_trim { Preparation { still_speed: None } } else { Preparation::default() };
            let recording = Recording::read(file).map_err(|cause| invalid(cause.into()))?;
            shown = Some(recording.checksum);
            Some(Demonstration::prepare(&recording, &preparation).map_err(|cause| invalid(cause.into()))?)
        }
    };
    let primitive = command.primitive.as_deref().map(|path| super::check::read(path, DOING)).transpose()?;
    let plan = match &primitive {
        None => None,
        Some(file) => {
            let primitive = file.to_primitive().map_err(|cause| invalid(cause.into()))?;
            let references = plan::roll_out(&primitive).map_err(|cause| invalid(cause.to_string().into()))?;
            Some(plan::pose_path(&references))
        }
    };
    let execution = command.run.as_deref().map(Recording::read).transpose().map_err(|cause| invalid(cause.into()))?;
    if let (Some(file), Some(recording)) = (&primitive, &execution) {
        same_movement(file, recording, "plot refused")?;
    }
    let from = primitive.as_ref().and_then(|file| file.provenance.as_ref());
    let learned = from.filter(|from| Some(from.demonstration_checksum) == shown);
    if shown.is_some() && from.is_some() && learned.is_none() {
        output.warn("the primitive was learned from another demonstration than the one that is drawn");
    }
    execution.iter().for_each(|recording| tell_of_others(recording, output));
    let tracking = execution.as_ref().map(|recording| tracking(recording, output)).transpose()?.flatten();
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
        demonstration: demonstration.as_ref().map(|shown| aligned(shown, learned, execution.as_ref())),
        plan,
        execution: execution.map(|recording| if tracking.is_some() { recording.running() } else { recording }),
    };
    let page = movement.page().map_err(|cause| Failure::new(ErrorCode::NothingToDraw, DOING, cause))?;
    let spinner = output.spinner("drawing");
    write(&page, &command.output, outputs)?;
    if let (Some(file), Some(run)) = (&command.picture, &movement.execution) {
        spinner.set_message("rendering");
        let part = picture_file.as_ref().map_or(file.as_path(), OutputFile::part);
        picture(run, part)?;
        if let Some(picture_file) = picture_file {
            picture_file.commit().map_err(|error| files::failure(error, DOING))?;
        }
    }
    spinner.finish_and_clear();
    let files = command.output.iter().chain(&command.picture);
    let text: Vec<String> = files.map(|file| file.display().to_string()).collect();
    output.result(
        &Drawn {
            figures: command.output.iter().map(|file| files::text(file)).collect(),
            picture: command.picture.as_deref().map(files::text),
            tracking,
        },
        text.join("\n"),
    )
}

/// Opens the figures and the picture: each another file, and none that is read.
fn open_outputs(
    command: &Cmd,
    global: &Global,
    inputs: &[&Path],
) -> Result<(Vec<OutputFile>, Option<OutputFile>), Failure> {
    output_file::apart(command.output.iter().chain(&command.picture).map(PathBuf::as_path))
        .map_err(|error| files::failure(error, DOING))?;
    let is_png = |file: &Path| file.extension().is_some_and(|end| end.eq_ignore_ascii_case("png"));
    if let Some(picture) = command.picture.as_deref().filter(|file| !is_png(file)) {
        let cause = format!("{}: a picture is written as .png", picture.display());
        return Err(Failure::new(ErrorCode::FigureFormat, "plot refused", cause).help("name a file that ends in .png"));
    }
    let create = |file: &PathBuf| files::create(file, global, inputs, DOING);
    let outputs = command.output.iter().map(create).collect::<Result<Vec<_>, _>>()?;
    Ok((outputs, command.picture.as_ref().map(create).transpose()?))
}

/// Data of `tactus --json plot`.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Drawn {
    /// The figures that were written.
    pub figures: Vec<String>,
    /// The picture that was written; `null`: none was asked for.
    pub picture: Option<String>,
    /// Distances of the arm from its plan; `null`: no run was given, or it has no poses.
    pub tracking: Option<Tracking>,
}

/// The demonstration in the time of the primitive that was learned from it, and of its run: however much of its
/// beginning each leaves out, however much faster than shown it was learned, and at whichever speed it was played.
/// Otherwise the curves of a good primitive lie beside one another.
fn aligned(demonstration: &Demonstration, learned: Option<&Provenance>, run: Option<&Recording>) -> PosePath {
    let mut path = PosePath::of_demonstration(demonstration);
    if let Some(from) = learned {
        let [before, _] = from.trimmed;
        let played = run.filter(|run| run.origin.changes.is_none()).and_then(|run| run.origin.speed);
        // Files may say anything of themselves.
        let known = |speed: f64| if SPEEDS.contains(&speed) { speed } else { 1.0 };
        let speed = known(from.speed) * known(played.unwrap_or(1.0));
        path.time.iter_mut().for_each(|time| *time = (*time + demonstration.trimmed.0 - before) / speed);
    }
    path
}

/// Fills the files of the figure.
fn write(page: &plot::Page, names: &[PathBuf], outputs: Vec<OutputFile>) -> Result<(), Failure> {
    for (file, output_file) in names.iter().zip(outputs) {
        let bytes = plot::encode(page, file).map_err(|cause| {
            let is_format = matches!(cause, plot::PlotError::Format { .. });
            let code = if is_format { ErrorCode::FigureFormat } else { ErrorCode::FigureNotWritten };
            Failure::new(code, DOING, cause)
        })?;
        files::fill(output_file, &bytes, DOING)?;
    }
    Ok(())
}

/// Tracking of the plan in a recording; `None` where nothing was played.
fn tracking(recording: &Recording, output: Output) -> Result<Option<Tracking>, Failure> {
    match Tracking::of_run(recording) {
        Ok(tracking) => Ok(Some(tracking)),
        Err(ComparisonError { lack: Lack::Run, .. }) => {
            output.warn("nothing was played in this recording: all of it is drawn, without figures of tracking");
            Ok(None)
        }
        Err(cause @ ComparisonError { lack: Lack::Poses, .. }) => {
            Err(Failure::new(ErrorCode::PlotInput, "plot", cause)
                .help("a recording of joint angles alone is drawn with `--demonstration`"))
        }
        Err(cause) => Err(Failure::new(ErrorCode::PlotInput, "plot", cause)),
    }
}

/// Warns where a recording holds more runs than the one that is looked at.
pub(super) fn tell_of_others(recording: &Recording, output: Output) {
    let runs = recording.runs().len();
    if runs > 1 {
        output.warn(format!("{} holds {runs} runs: the last one is taken", recording.file.display()));
    }
}

/// Refuses a run of another movement than the primitive's.
pub(super) fn same_movement(file: &PrimitiveFile, recording: &Recording, doing: &str) -> Result<(), Failure> {
    let Some(played) = recording.origin.primitive.as_ref().filter(|played| played.movement != file.movement_checksum())
    else {
        return Ok(());
    };
    let text = format!(
        "{} shows the movement {played}, {} is {} 0x{:08x}",
        recording.file.display(),
        file.file.display(),
        file.name,
        file.movement_checksum()
    );
    Err(Failure::new(ErrorCode::RecordingOfOthers, doing, text))
}

/// Refuses two recordings that say which movement they show, and show different ones.
pub(super) fn same_as(one: &Recording, other: &Recording, doing: &str) -> Result<(), Failure> {
    if !one.origin.contradicts(&other.origin) {
        return Ok(());
    }
    let name = |recording: &Recording| recording.origin.primitive.as_ref().map(ToString::to_string).unwrap_or_default();
    let (first, second) = (one.file.display(), other.file.display());
    let text = format!("{first} shows the movement {}, {second} shows {}", name(one), name(other));
    Err(Failure::new(ErrorCode::RecordingOfOthers, doing, text))
}

/// Renders the scene at the end of the run, the way of the grasp point, and ghosts of the arm along it.
#[cfg(feature = "mujoco")]
fn picture(run: &Recording, file: &std::path::Path) -> Result<(), Failure> {
    use sim::render::{RenderOptions, Scene, Trail, render_png};
    use sim::world::mujoco::MujocoOptions;

    /// Arm postures drawn as ghosts.
    const GHOSTS: usize = 4;
    /// One dot of the trail every so many cycles.
    const DOT_EVERY: usize = 15;

    let doing = "plot: the picture";
    let failed =
        |cause: Box<dyn std::error::Error + Send + Sync>| Failure::new(ErrorCode::PictureNotRendered, doing, cause);
    let (Some(postures), Some(path)) = (&run.q, &run.position) else {
        return Err(Failure::new(ErrorCode::RunWithoutPath, doing, "the run has no joint angles or no positions"));
    };
    let Some(last) = postures.last() else {
        return Err(Failure::new(ErrorCode::RunEmpty, doing, "the run has no samples"));
    };
    let ghosts = (0..GHOSTS).map(|ghost| postures[ghost * postures.len() / (GHOSTS + 1)]).collect();
    let trail = Trail {
        points: path.iter().copied().step_by(DOT_EVERY).collect(),
        colour: [0.84, 0.37, 0.0, 1.0],
        radius: 0.006,
    };
    let scene = Scene::set_up(&MujocoOptions::default()).map_err(|cause| failed(cause.into()))?.with_posture(last);
    let options = RenderOptions { ghosts, trails: vec![trail], ..RenderOptions::default() };
    render_png(&scene, file, &options)
        .map_err(|cause| failed(cause.into()).help("`cargo xtask setup` installs what pictures need"))
}

/// Without MuJoCo there is nothing to see.
#[cfg(not(feature = "mujoco"))]
fn picture(_run: &Recording, _file: &std::path::Path) -> Result<(), Failure> {
    Err(Failure::new(ErrorCode::WithoutMujoco, "plot: the picture", "this tactus was built without the MuJoCo world")
        .help("`cargo xtask build`"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_demonstration_lies_on_the_primitive_whatever_either_left_out_of_its_beginning() {
        let count = 10;
        let demonstration = Demonstration {
            time: (0..count).map(|index| f64::from(index) / control::RATE).collect(),
            position: vec![[0.0; 3]; 10],
            orientation: vec![[1.0, 0.0, 0.0, 0.0]; 10],
            q: None,
            wrench: None,
            trimmed: (0.75, 0.0),
            crept: None,
            left_out: (0.0, 0.0),
            pose_source: lab::demonstration::PoseSource::PoseColumns,
        };
        assert_eq!(aligned(&demonstration, None, None).time[0], 0.0);
        // Learned with `--no-trim`: its time counts from the first line of the recording.
        let mut learned = Provenance { speed: 1.0, ..Provenance::default() };
        assert_eq!(aligned(&demonstration, Some(&learned), None).time[0], 0.75);
        // Learned twice as fast as it was shown.
        learned.speed = 2.0;
        assert_eq!(aligned(&demonstration, Some(&learned), None).time[0], 0.375);
        // And played at half the speed of that.
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docs/examples/reach.csv");
        let mut run = Recording::read(&file).unwrap();
        run.origin.speed = Some(0.5);
        assert_eq!(aligned(&demonstration, Some(&learned), Some(&run)).time[0], 0.75);
        run.origin.changes = Some("speed 2 at 3 s".to_owned());
        assert_eq!(aligned(&demonstration, Some(&learned), Some(&run)).time[0], 0.375);
        learned.speed = 0.0;
        assert!(aligned(&demonstration, Some(&learned), None).time.iter().all(|time| time.is_finite()));
    }
}
