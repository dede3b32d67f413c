//! A report of runs as one page of HTML: what was asked, what happened, and figures of it over the progress of the
//! movement. It needs no network and no other file.

mod events;
mod figures;
mod html;
mod watched;

use std::path::Path;

use dmp::CanonicalSystem;

use crate::demonstration::{Recording, RecordingError, layout, recording};
use crate::input_file;
use crate::outcome::Outcome;
use crate::primitive_file::PrimitiveFile;
use crate::procedure::FlagCounts;
use crate::tracking::Tracking;

pub use events::Happening;
pub use html::page;

/// A run as its recording tells it.
pub struct ReportedRun {
    /// Its file, without the folder.
    pub name: String,
    /// Notes at the head of the recording.
    pub notes: Vec<String>,
    /// The runs that the recording holds; the last one is told here.
    pub runs: usize,
    /// The part in which its plan was played; the whole recording if none was.
    pub running: Recording,
    /// Progress of the movement at each of its samples, 0 to 1; empty if no plan was played.
    pub progress: Vec<f64>,
    /// Its end.
    pub outcome: Outcome,
    /// Everything out of the ordinary, and the changes of state, in their order.
    pub happenings: Vec<Happening>,
    /// Samples in which something was out of the ordinary.
    pub flags: FlagCounts,
    /// Samples that the recording lacks.
    pub missing: usize,
    /// Tracking of the plan, where poses were recorded.
    pub tracking: Option<Tracking>,
}

impl ReportedRun {
    /// Reads a recording. `primitive` is the one that ran, if it is known.
    ///
    /// # Errors
    /// [`RecordingError`].
    pub fn read(file: &Path, primitive: Option<&PrimitiveFile>) -> Result<ReportedRun, RecordingError> {
        let bytes = input_file::read(file, input_file::LONGEST_RECORDING)
            .map_err(|cause| RecordingError::Unreadable { file: file.to_owned(), cause })?;
        let recording = Recording::parse(file, &bytes)?;
        // Without them nobody can say where a run began, how it ended, or how far it came.
        let told = [(layout::STATE, recording.state.is_none()), (layout::PHASE, recording.phase.is_none())];
        let missing: Vec<&str> = told.iter().filter(|(_, is_missing)| *is_missing).map(|(name, _)| *name).collect();
        if !missing.is_empty() {
            return Err(RecordingError::MissingColumns {
                file: file.to_owned(),
                line: recording.header_line,
                column: recording.names.len() + 1,
                missing: missing.join(", "),
            });
        }
        let notes = recording::notes(&bytes);
        let alpha = primitive.map_or(CanonicalSystem::<f64>::DEFAULT_ALPHA, |primitive| primitive.movement.alpha);
        let runs = recording.runs();
        let last = runs.last().cloned().unwrap_or_default();
        let played = recording.running();
        let progress: Vec<f64> = played.phase.iter().flatten().map(|phase| progress(*phase, alpha)).collect();
        // Where none was played, as in the record of a fault on the way to the start, all that is known is shown.
        let running = if runs.is_empty() { recording.clone() } else { played };
        let mut flags = FlagCounts::default();
        running.flags.iter().flatten().for_each(|sample| flags.add(*sample));
        let mut happenings = events::of(&recording, last.start, alpha);
        let departures =
            primitive.filter(|_| !runs.is_empty()).map(|primitive| watched::departures(&running, &progress, primitive));
        for departure in departures.into_iter().flatten() {
            let time = |sample: usize| running.time.get(sample).copied().unwrap_or(0.0);
            happenings.push(Happening {
                time: time(departure.sample) - time(0),
                progress: progress.get(departure.sample).copied().unwrap_or(0.0),
                words: departure.words(),
            });
        }
        happenings.sort_by(|a, b| a.time.total_cmp(&b.time));
        Ok(ReportedRun {
            name: file.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default(),
            notes,
            progress,
            runs: runs.len(),
            outcome: Outcome::of(&recording),
            happenings,
            flags,
            missing: running.missing_samples,
            tracking: Tracking::of_run(&recording).ok(),
            running,
        })
    }

    /// Duration of the movement, s.
    #[must_use]
    pub fn duration(&self) -> f64 {
        self.running.time.last().zip(self.running.time.first()).map_or(0.0, |(last, first)| last - first)
    }

    /// The largest of a value over the movement, and the progress there.
    fn peak(&self, value: impl Fn(usize) -> Option<f64>) -> Option<(f64, f64)> {
        let values = (0..self.running.len()).filter_map(|at| Some((value(at)?, *self.progress.get(at)?)));
        values.max_by(|a, b| a.0.total_cmp(&b.0))
    }

    /// Largest force on the hand, N, and the progress there.
    #[must_use]
    pub fn largest_force(&self) -> Option<(f64, f64)> {
        let wrench = self.running.wrench.as_ref()?;
        self.peak(|at| wrench.get(at).map(|[x, y, z, ..]| (x * x + y * y + z * z).sqrt()))
    }

    /// Largest surprise, and the progress there.
    #[must_use]
    pub fn largest_surprise(&self) -> Option<(f64, f64)> {
        let surprise = self.running.surprise.as_ref()?;
        self.peak(|at| surprise.get(at).copied())
    }
}

/// Progress of a movement at a phase, 0 to 1.
fn progress(phase: f64, alpha: f64) -> f64 {
    // Added so that no progress is not written as -0.
    if phase > 0.0 { (-phase.ln() / alpha).clamp(0.0, 1.0) + 0.0 } else { 0.0 }
}
