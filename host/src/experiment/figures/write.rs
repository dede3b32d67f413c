//! All figures of an experiment, written into a folder.

use std::path::{Path, PathBuf};

use super::series::Expected;
use super::{forces, paths, series, strip, success_map};
use crate::experiment::Config;
use crate::experiment::mode::Mode;
use crate::experiment::runner::Experiment;
use crate::experiment::trace::CHANNELS;
use crate::experiment::trial::Trial;
use crate::plot::PlotError;
use crate::primitive_file::PrimitiveFile;

/// Points of an expected curve.
const EXPECTED_POINTS: usize = 200;

/// Why a figure was not made.
#[derive(Debug, thiserror::Error)]
pub enum FigureError {
    /// A diagram.
    #[error(transparent)]
    Plot(#[from] PlotError),
    /// A rendered picture.
    #[error(transparent)]
    Render(#[from] sim::render::RenderError),
    /// The folder.
    #[error("{}: {cause}", folder.display())]
    Folder {
        /// The folder.
        folder: PathBuf,
        /// What the operating system says.
        #[source]
        cause: std::io::Error,
    },
}

/// Writes every figure for which there is something to show; gives the files. Time series and strips need the traces of
/// [`Config::keep_traces`]; strips are rendered if `render`.
///
/// # Errors
/// [`FigureError`]
pub fn write(
    config: &Config,
    experiment: &Experiment,
    folder: &Path,
    render: bool,
) -> Result<Vec<PathBuf>, FigureError> {
    std::fs::create_dir_all(folder).map_err(|cause| FigureError::Folder { folder: folder.to_owned(), cause })?;
    let results = &experiment.results;
    let title = config.object.title();
    let radius = config.object_at(&experiment.prepared.frame, Default::default()).foot_radius();
    let mut written = Vec::new();
    let mut put = |drawing: super::drawing::Drawing, name: &str| -> Result<(), FigureError> {
        drawing.write(folder, name)?;
        written.push(folder.join(format!("{name}.svg")));
        written.push(folder.join(format!("{name}.png")));
        Ok(())
    };
    if config.grid.columns().len() > 1 || config.grid.rows().len() > 1 {
        put(success_map::draw(results, &config.grid, &format!("{title}: where it is grasped"), radius), "map")?;
        let taught: Vec<[f64; 2]> =
            experiment.prepared.taught.iter().step_by(30).map(|(position, _)| [position[0], position[1]]).collect();
        let frame = &experiment.prepared.frame;
        put(
            paths::draw(results, &config.grid, frame, &taught, &format!("{title}: ways of the hand"), radius),
            "paths",
        )?;
    }
    put(forces::draw(results, &format!("{title}: contact forces"), config.tipping_force()), "forces")?;
    let shown = telling(&experiment.trials);
    if !shown.is_empty() {
        let expected = expected(&config.primitive);
        let runs: Vec<_> = shown
            .iter()
            .filter(|trial| trial.report.key.mode != Mode::ForceControl || shown.len() == 1)
            .map(|trial| (trial.report.key.mode, &trial.trace))
            .collect();
        let measures = &shown[shown.len() - 1].report.measures;
        let marks = [(measures.closing_s, "fingers close"), (measures.lift_s, "lift")];
        let cell = shown[0].report.key.cell;
        let title = format!("{title} at {cell} cm from where it is expected");
        put(series::draw(&runs, expected.as_ref(), &marks, &title), "series")?;
    }
    if render {
        for trial in shown {
            let file = folder.join(format!("strip-{}.png", trial.report.key.mode));
            strip::write(trial, &file)?;
            written.push(file);
        }
    }
    Ok(written)
}

/// One trial of each mode in the cell that tells most: the adapted one held the object and the open loop did not; the nearest of them to the middle of
/// all such cells' distances, neither the easiest nor the hardest.
fn telling(trials: &[Trial]) -> Vec<&Trial> {
    let find = |index: usize, mode: Mode| {
        trials.iter().find(|trial| trial.report.key.index == index && trial.report.key.mode == mode)
    };
    let held = |index: usize, mode: Mode| find(index, mode).map(|trial| trial.report.outcome.is_success());
    let mut cells: Vec<(f64, usize)> = trials
        .iter()
        .map(|trial| trial.report.key)
        .filter(|key| key.mode == trials[0].report.key.mode)
        .map(|key| (key.cell.distance(), key.index))
        .collect();
    cells.sort_by(|a, b| a.0.total_cmp(&b.0));
    let telling: Vec<usize> = cells
        .iter()
        .map(|(_, index)| *index)
        .filter(|index| held(*index, Mode::Adaptive) == Some(true) && held(*index, Mode::OpenLoop) == Some(false))
        .collect();
    let chosen = telling.get(telling.len() / 2).or(cells.get(cells.len() / 2).map(|(_, index)| index));
    chosen.map(|&index| Mode::ALL.into_iter().filter_map(|mode| find(index, mode)).collect()).unwrap_or_default()
}

/// What the primitive expects, over time: the experience of successful runs if there is one, else the rehearsals.
fn expected(primitive: &PrimitiveFile) -> Option<Expected> {
    let (mean, spread) = match (&primitive.expectation, &primitive.experience) {
        (Some(table), _) => (&table.mean, &table.spread),
        (None, Some(table)) => (&table.mean, &table.spread),
        (None, None) => return None,
    };
    let points = mean.len().min(spread.len());
    let row = |table: &[Vec<f64>], progress: f64| -> [f64; CHANNELS] {
        let at = progress * (points.max(1) - 1) as f64;
        let (low, high) = (at.floor() as usize, at.ceil() as usize);
        std::array::from_fn(|channel| {
            let value = |index: usize| table.get(index).and_then(|row| row.get(channel)).copied().unwrap_or(0.0);
            value(low) + (value(high) - value(low)) * at.fract()
        })
    };
    let progress = |k: usize| k as f64 / (EXPECTED_POINTS - 1) as f64;
    (points > 0).then(|| Expected {
        time: (0..EXPECTED_POINTS).map(|k| progress(k) * primitive.duration).collect(),
        mean: (0..EXPECTED_POINTS).map(|k| row(mean, progress(k))).collect(),
        spread: (0..EXPECTED_POINTS).map(|k| row(spread, progress(k))).collect(),
    })
}
