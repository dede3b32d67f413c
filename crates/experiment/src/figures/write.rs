//! All figures of an experiment, written into a folder.

use std::path::{Path, PathBuf};

use super::series::Expected;
use super::{bars, forces, paths, series, strip, success_map};
use crate::carried::Carried;
use crate::lift::Case;
use crate::outcome::Measures;
use crate::runner::{Experiment, representative};
use crate::trace::CHANNELS;
use crate::trial::Trial;
use crate::{Config, Scenario, comparison};
use lab::plot::PlotError;
use lab::primitive_file::PrimitiveFile;
use lab::procedure::Mode;

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
        /// The operating system's reason.
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
    let title = &config.object.row().title;
    let radius = config.object_at(&experiment.prepared.frame, Default::default()).foot_radius();
    let mut written = Vec::new();
    let mut put = |drawing: lab::plot::drawing::Drawing, name: &str| -> Result<(), FigureError> {
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
    let modes = results.modes();
    let several = |count: usize| if count == 1 { String::new() } else { format!(", mean of {count} seeds") };
    let panel = |name: &str, unit: &str, scale: f64, value: fn(&Measures) -> f64, limit: Option<(f64, String)>| {
        let title = format!("{name}, {unit}{}", several(results.seeds().len()));
        bars::by_cell(results, &config.grid, &modes, title, move |measures| scale * value(measures), limit)
    };
    let mut panels: Vec<bars::Panel> = comparison::quantities(config.scenario)
        .iter()
        .filter(|_| config.scenario != Scenario::Flashlight)
        .map(|quantity| panel(quantity.name, quantity.unit, quantity.scale, quantity.value, None))
        .collect();
    if let Some(limit) = config.object_at(&experiment.prepared.frame, Default::default()).crush_force {
        let words = format!("crushed by {limit:.0} N");
        let name = "largest force of a finger on the object";
        panels.push(panel(name, "N", 1.0, |measures| measures.finger_peak_n, Some((limit, words))));
    }
    if !panels.is_empty() {
        let below = "cell: object along the approach and sideways, cm";
        put(bars::draw(&panels, &bars::members(&modes), &format!("{title}: mode against mode"), below), "bars")?;
    }
    let keys = representative(results);
    let shown: Vec<&Trial> =
        keys.iter().filter_map(|key| experiment.trials.iter().find(|trial| trial.report.key == *key)).collect();
    if !shown.is_empty() {
        let expected = expected(&config.primitive);
        let runs: Vec<_> = shown
            .iter()
            .filter(|trial| trial.report.key.mode != Mode::ForceControl || shown.len() == 1)
            .map(|trial| (trial.report.key.mode, &trial.trace))
            .collect();
        let measures = &shown[shown.len() - 1].report.measures;
        let closing = measures.closing_s.map(|time| (time, "fingers close"));
        let marks: Vec<_> = closing.into_iter().chain([(measures.lift_s, "lift")]).collect();
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

/// Writes the sag of every case of the experiment with a weight; `trials` of each case and mode.
///
/// # Errors
/// [`FigureError`]
pub fn write_lift(rows: &[Carried], trials: usize, folder: &Path) -> Result<(), FigureError> {
    std::fs::create_dir_all(folder).map_err(|cause| FigureError::Folder { folder: folder.to_owned(), cause })?;
    let mut modes: Vec<Mode> = rows.iter().map(|row| row.mode).collect();
    modes.sort_unstable();
    modes.dedup();
    let groups = Case::ALL.into_iter().map(|case| {
        let of = |mode: Mode| rows.iter().find(|row| row.case == case.name() && row.mode == mode);
        let label = modes
            .iter()
            .find_map(|mode| of(*mode))
            .map_or_else(String::new, |row| format!("{:.1} kg, {:.1} kg expected", row.carried_kg, row.remembered_kg));
        (label, modes.iter().map(|mode| of(*mode).and_then(|row| row.sag_median_m).map(|sag| sag * 1e3)).collect())
    });
    let title = format!("distance of the lifted hand from its plan, mm, median of {trials} trials");
    let panel = bars::Panel { title, groups: groups.collect(), limit: None };
    let title = "Weight: what is expected is carried on the plan";
    bars::draw(&[panel], &bars::members(&modes), title, "weight carried, weight expected").write(folder, "sag")?;
    Ok(())
}

/// The primitive's expectation over time: the statistics of successful runs if there are any, else the rehearsals.
fn expected(primitive: &PrimitiveFile) -> Option<Expected> {
    let (mean, spread) = match (&primitive.expectation, &primitive.statistics) {
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
        time: (0..EXPECTED_POINTS).map(|k| progress(k) * primitive.movement.duration).collect(),
        mean: (0..EXPECTED_POINTS).map(|k| row(mean, progress(k))).collect(),
        spread: (0..EXPECTED_POINTS).map(|k| row(spread, progress(k))).collect(),
    })
}
