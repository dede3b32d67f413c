//! Differences between two executions of the same movement, cycle by cycle: `tactus compare` shows them, and they must
//! be small between the firmware and the same application in this process.

use std::fmt;

use serde::Serialize;

use crate::demonstration::{RATE, Recording, angle_between};
use crate::tracking::{ComparisonError, Lack};

/// Largest differences over a part of two runs.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, schemars::JsonSchema)]
pub struct Largest {
    /// Cycles compared.
    pub samples: usize,
    /// Of any joint angle, rad.
    pub joint_rad: f64,
    /// Between the measured positions, m.
    pub position_m: f64,
    /// Between the measured orientations, rad.
    pub orientation_rad: f64,
    /// Between the planned positions, m; `None` if a run lacks those columns, or nothing was compared.
    pub plan_m: Option<f64>,
    /// Of any component of the force, N.
    pub force_n: f64,
    /// Of any joint torque, N m; `None` if a run lacks those columns, or nothing was compared.
    pub torque_nm: Option<f64>,
}

/// Differences of two runs.
#[derive(Debug, Clone, PartialEq, Serialize, schemars::JsonSchema)]
pub struct Difference {
    /// In the first cycle that both have.
    pub start: Largest,
    /// From the first cycle until either feels a contact.
    pub before_contact: Largest,
    /// When that was, s after the first cycle of the run; `None`: never.
    pub contact_s: Option<f64>,
    /// Over all cycles that both have.
    pub whole: Largest,
}

/// The columns of one run that are compared.
struct Run<'a> {
    index: Vec<usize>,
    q: &'a [[f64; 7]],
    position: &'a [[f64; 3]],
    orientation: &'a [[f64; 4]],
    wrench: &'a [[f64; 6]],
    plan: Option<&'a [[f64; 3]]>,
    torque: Option<&'a [[f64; 7]]>,
    phase: &'a [f64],
}

impl<'a> Run<'a> {
    fn of(recording: &'a Recording) -> Result<Run<'a>, ComparisonError> {
        let missing = || ComparisonError::of(recording, Lack::Columns);
        let first = recording.time.first().ok_or_else(|| ComparisonError::of(recording, Lack::Run))?;
        Ok(Run {
            // Samples that the link lost leave a gap: cycles are matched by their number since the first of the run.
            index: recording.time.iter().map(|time| ((time - first) * RATE).round() as usize).collect(),
            q: recording.q.as_deref().ok_or_else(missing)?,
            position: recording.position.as_deref().ok_or_else(missing)?,
            orientation: recording.orientation.as_deref().ok_or_else(missing)?,
            wrench: recording.wrench.as_deref().ok_or_else(missing)?,
            plan: recording.position_d.as_deref(),
            torque: recording.tau.as_deref(),
            phase: recording.phase.as_deref().unwrap_or_default(),
        })
    }

    /// The cycle of this run in which another begins, by the phase: its recording may lack the first cycles of the run.
    /// 0 where this one begins later, or the phase is not known.
    fn cycle_of_start(&self, other: &Run<'_>) -> usize {
        let log = |run: &Run<'_>, sample: usize| run.phase.get(sample).filter(|phase| **phase > 0.0).map(|s| s.ln());
        let (Some(start), Some(next)) = (log(other, 0), log(other, 1)) else { return 0 };
        let per_cycle = (start - next) / (other.index[1] - other.index[0]).max(1) as f64;
        let before =
            (0..self.index.len()).take_while(|&sample| log(self, sample).is_some_and(|log| log >= start)).last();
        let Some((at, log)) = before.and_then(|at| Some((at, log(self, at)?))).filter(|_| per_cycle > 0.0) else {
            return 0;
        };
        // This one may lack that very cycle.
        self.index[at] + ((log - start) / per_cycle).round() as usize
    }

    fn force(&self, sample: usize) -> f64 {
        let [x, y, z, ..] = self.wrench[sample];
        (x * x + y * y + z * z).sqrt()
    }
}

impl Largest {
    fn take(&mut self, one: &Run<'_>, a: usize, other: &Run<'_>, b: usize) {
        let distance = |p: &[f64; 3], q: &[f64; 3]| (0..3).map(|axis| (p[axis] - q[axis]).powi(2)).sum::<f64>().sqrt();
        let apart = |p: &[f64], q: &[f64]| p.iter().zip(q).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max);
        self.samples += 1;
        self.joint_rad = self.joint_rad.max(apart(&one.q[a], &other.q[b]));
        self.position_m = self.position_m.max(distance(&one.position[a], &other.position[b]));
        self.orientation_rad = self.orientation_rad.max(angle_between(&one.orientation[a], &other.orientation[b]));
        self.force_n = self.force_n.max(apart(&one.wrench[a][..3], &other.wrench[b][..3]));
        if let (Some(one), Some(other)) = (one.plan, other.plan) {
            self.plan_m = Some(self.plan_m.unwrap_or(0.0).max(distance(&one[a], &other[b])));
        }
        if let (Some(one), Some(other)) = (one.torque, other.torque) {
            self.torque_nm = Some(self.torque_nm.unwrap_or(0.0).max(apart(&one[a], &other[b])));
        }
    }
}

impl Difference {
    /// Compares the parts of two recordings in which a plan was played. A contact is a force above `contact` (N).
    ///
    /// # Errors
    /// [`ComparisonError`].
    pub fn between(one: &Recording, other: &Recording, contact: f64) -> Result<Difference, ComparisonError> {
        let (one, other) = (one.running(), other.running());
        let (mut one, mut other) = (Run::of(&one)?, Run::of(&other)?);
        let (in_one, in_other) = (one.cycle_of_start(&other), other.cycle_of_start(&one));
        other.index.iter_mut().for_each(|index| *index += in_one);
        one.index.iter_mut().for_each(|index| *index += in_other);
        let [mut start, mut before_contact, mut whole] = [Largest::default(); 3];
        let mut contact_s = None;
        let mut b = 0;
        for (a, index) in one.index.iter().enumerate() {
            while other.index.get(b).is_some_and(|other| other < index) {
                b += 1;
            }
            if other.index.get(b) != Some(index) {
                continue;
            }
            if contact_s.is_none() && (one.force(a) > contact || other.force(b) > contact) {
                contact_s = Some(*index as f64 / RATE);
            }
            if whole.samples == 0 {
                start.take(&one, a, &other, b);
            }
            if contact_s.is_none() {
                before_contact.take(&one, a, &other, b);
            }
            whole.take(&one, a, &other, b);
        }
        Ok(Difference { start, before_contact, contact_s, whole })
    }
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let heading = self.contact_s.map_or("no contact".to_owned(), |s| format!("before contact ({s:.2} s)"));
        writeln!(f, "largest difference      {:>14}{:>26}{:>14}", "first cycle", heading, "whole run")?;
        let parts = [&self.start, &self.before_contact, &self.whole];
        writeln!(
            f,
            "cycles compared         {:>14}{:>26}{:>14}",
            parts[0].samples, parts[1].samples, parts[2].samples
        )?;
        type Line = (&'static str, fn(&Largest) -> Option<f64>, &'static str);
        let rows: [Line; 6] = [
            ("joint angle", |part| Some(part.joint_rad * 1e3), "mrad"),
            ("position", |part| Some(part.position_m * 1e3), "mm"),
            ("orientation", |part| Some(part.orientation_rad.to_degrees()), "deg"),
            ("planned position", |part| part.plan_m.map(|m| m * 1e3), "mm"),
            ("force", |part| Some(part.force_n), "N"),
            ("joint torque", |part| part.torque_nm, "N m"),
        ];
        for (name, value, unit) in rows {
            let [start, before, whole] = parts.map(|part| match value(part) {
                _ if part.samples == 0 => "-".to_owned(),
                None => "not recorded".to_owned(),
                Some(value) => format!("{value:.3}"),
            });
            writeln!(f, "{:<24}{start:>14}{before:>26}{whole:>14}", format!("{name}, {unit}"))?;
        }
        Ok(())
    }
}
