//! The figures of a report: every run over the progress of the movement, so that runs of any speed lie on one another;
//! recordings in which no movement was played over time.

use crate::arm::TORQUE_LIMITS;
use crate::plan;
use crate::plot::Page;
use crate::plot::canvas::{Curve, Ink, Panel};
use crate::plot::movement::rotation_vectors;
use crate::primitive_file::PrimitiveFile;

use super::ReportedRun;

/// The looks of runs, in their order.
const RUNS: [Ink; 4] = [Ink::Execution, Ink::First, Ink::Second, Ink::Third];

/// Standard deviations on either side of the expected value that the band covers.
const BAND: f64 = 2.0;

/// The look of a run.
fn ink(run: usize) -> Ink {
    RUNS[run % RUNS.len()]
}

/// Every figure for which there are data, with its heading.
pub(super) fn all(runs: &[ReportedRun], primitive: Option<&PrimitiveFile>) -> Vec<(&'static str, Page)> {
    let figures = Figures { runs, primitive };
    // From the fifth run on looks are used again: every run is named beside its own.
    let alike = |at: usize| runs.iter().skip(at).step_by(RUNS.len()).map(|run| run.name.as_str()).collect::<Vec<_>>();
    let mut legend: Vec<(Ink, String)> =
        (0..RUNS.len().min(runs.len())).map(|at| (ink(at), alike(at).join(", "))).collect();
    legend.push((Ink::Plan, format!("plan{}", if runs.len() > 1 { " of the first" } else { "" })));
    legend.push((Ink::Band, "expected, \u{b1} 2 standard deviations".to_owned()));
    legend.push((Ink::Limit, "limit".to_owned()));
    let (x_label, x_range) = match figures.over_time() {
        None => ("progress of the movement (%)", (0.0, 100.0)),
        Some(longest) => ("time (s)", (0.0, longest)),
    };
    let page = |rows: Vec<Vec<Panel>>| {
        let is_drawn = |ink: Ink| rows.iter().flatten().flat_map(|panel| &panel.curves).any(|curve| curve.ink == ink);
        Page {
            title: String::new(),
            x_label: x_label.to_owned(),
            x_range,
            legend: legend.iter().filter(|(ink, _)| is_drawn(*ink)).cloned().collect(),
            rows: rows.into_iter().filter(|row| !row.is_empty()).collect(),
        }
    };
    let pages = vec![
        ("Pose of the grasp point", page(vec![figures.positions(), figures.orientations()])),
        ("Force and torque of the environment", page(figures.wrench())),
        ("Fingers", page(vec![figures.hand(), figures.gauges()])),
        ("Adaptation, surprise and torque", page(vec![figures.rest()])),
    ];
    pages.into_iter().filter(|(_, page)| !page.rows.is_empty()).collect()
}

struct Figures<'a> {
    runs: &'a [ReportedRun],
    primitive: Option<&'a PrimitiveFile>,
}

impl Figures<'_> {
    /// The longest of the recordings (s), if no movement was played in any of them.
    fn over_time(&self) -> Option<f64> {
        let none = self.runs.iter().all(|run| run.progress.is_empty());
        none.then(|| self.runs.iter().map(ReportedRun::duration).fold(0.0, f64::max)).filter(|longest| *longest > 0.0)
    }

    /// Where each sample of a run is drawn: at its progress, %, or at its time, s.
    fn places(&self, run: &ReportedRun) -> Vec<f64> {
        if self.over_time().is_none() {
            return run.progress.iter().map(|u| 100.0 * u).collect();
        }
        let began = run.running.time.first().copied().unwrap_or(0.0);
        run.running.time.iter().map(|time| time - began).collect()
    }

    /// One panel; `value` gives a sample of a run, `planned` the same of its plan.
    fn panel(
        &self,
        title: impl Into<String>,
        unit: &str,
        least_height: f64,
        band: Option<Curve>,
        value: impl Fn(&ReportedRun, usize) -> Option<f64>,
        planned: impl Fn(&ReportedRun, usize) -> Option<f64>,
    ) -> Option<Panel> {
        let curve = |ink, run: &ReportedRun, value: &dyn Fn(&ReportedRun, usize) -> Option<f64>| {
            let places = self.places(run).into_iter().enumerate();
            Curve { ink, points: places.filter_map(|(at, x)| Some((x, value(run, at)?))).collect() }
        };
        let mut curves: Vec<Curve> = band.into_iter().collect();
        curves.extend(self.runs.iter().enumerate().map(|(at, run)| curve(ink(at), run, &value)));
        curves.extend(self.runs.first().map(|run| curve(Ink::Plan, run, &planned)));
        curves.retain(|curve| !curve.points.is_empty());
        let is_measured = curves.iter().any(|curve| curve.ink != Ink::Band);
        is_measured.then(|| Panel {
            title: title.into(),
            y_label: unit.to_owned(),
            curves,
            least_height,
            from_zero: false,
        })
    }

    fn positions(&self) -> Vec<Panel> {
        let panel = |axis: usize| {
            self.panel(
                format!("Position {}", ["x", "y", "z"][axis]),
                "m",
                0.02,
                None,
                |run, at| Some(run.running.position.as_ref()?.get(at)?[axis]),
                |run, at| Some(run.running.position_d.as_ref()?.get(at)?[axis]),
            )
        };
        (0..3).filter_map(panel).collect()
    }

    fn orientations(&self) -> Vec<Panel> {
        let end = || self.runs.first().and_then(|run| run.running.orientation_d.as_ref()?.last().copied());
        // A plan that was bent, or a run that was stopped, ends elsewhere than at the goal.
        let (goal, named) = match (self.primitive.map(|primitive| primitive.goal.orientation), end()) {
            (Some(goal), _) => (goal, "the goal"),
            (None, Some(end)) => (end, "where the plan ended,"),
            (None, None) => return Vec::new(),
        };
        let vectors = |path: &Option<Vec<[f64; 4]>>| rotation_vectors(&goal, path.as_deref().unwrap_or_default());
        let measured: Vec<_> = self.runs.iter().map(|run| vectors(&run.running.orientation)).collect();
        let planned: Vec<_> = self.runs.iter().map(|run| vectors(&run.running.orientation_d)).collect();
        let place = |run: &ReportedRun| self.runs.iter().position(|other| std::ptr::eq(other, run));
        let panel = |axis: usize| {
            let of = |all: &[Vec<[f64; 3]>], run: &ReportedRun, at: usize| {
                Some(all.get(place(run)?)?.get(at)?[axis].to_degrees())
            };
            self.panel(
                format!("Angle to {named} about {}", ["x", "y", "z"][axis]),
                "deg",
                4.0,
                None,
                |run, at| of(&measured, run, at),
                |run, at| of(&planned, run, at),
            )
        };
        (0..3).filter_map(panel).collect()
    }

    fn wrench(&self) -> Vec<Vec<Panel>> {
        let panel = |axis: usize| {
            let (what, unit, least) = if axis < 3 { ("Force", "N", 2.0) } else { ("Torque", "N m", 0.2) };
            self.panel(
                format!("{what} {}", ["x", "y", "z"][axis % 3]),
                unit,
                least,
                self.expected(axis),
                |run, at| Some(run.running.wrench.as_ref()?.get(at)?[axis]),
                |_, _| None,
            )
        };
        vec![(0..3).filter_map(panel).collect(), (3..6).filter_map(panel).collect()]
    }

    fn hand(&self) -> Vec<Panel> {
        let panel = |digit: usize| {
            self.panel(
                ["Spread", "Finger F1", "Finger F2", "Finger F3"][digit],
                "rad",
                0.1,
                None,
                |run, at| Some(run.running.hand.as_ref()?.get(at)?[digit]),
                |run, at| Some(run.running.hand_d.as_ref()?.get(at)?[digit]),
            )
        };
        (0..4).filter_map(panel).collect()
    }

    fn gauges(&self) -> Vec<Panel> {
        let panel = |finger: usize| {
            self.panel(
                format!("Gauge of F{}", finger + 1),
                "N m",
                0.1,
                self.expected(6 + finger),
                |run, at| Some(run.running.gauges.as_ref()?.get(at)?[finger]),
                |_, _| None,
            )
        };
        (0..3).filter_map(panel).collect()
    }

    /// Plan beside the taught one, surprise, and the torque as a share of its limit.
    fn rest(&self) -> Vec<Panel> {
        let taught = self.primitive.and_then(|file| plan::roll_out(&file.to_primitive().ok()?).ok());
        let taught = taught.map(|references| plan::pose_path(&references).position).unwrap_or_default();
        let beside = |run: &ReportedRun, at: usize| {
            let planned = run.running.position_d.as_ref()?.get(at)?;
            let place = run.progress.get(at)? * taught.len().checked_sub(1)? as f64;
            let (before, after) = (taught.get(place as usize)?, taught.get(place.ceil() as usize)?);
            let distance = |axis: usize| planned[axis] - before[axis] - place.fract() * (after[axis] - before[axis]);
            Some(1e3 * (0..3).map(|axis| distance(axis).powi(2)).sum::<f64>().sqrt())
        };
        let share = |run: &ReportedRun, at: usize| {
            let tau = run.running.tau.as_ref()?.get(at)?;
            Some(100.0 * tau.iter().zip(&*TORQUE_LIMITS).map(|(tau, limit)| tau.abs() / limit).fold(0.0, f64::max))
        };
        let limit = Curve { ink: Ink::Limit, points: vec![(0.0, 100.0), (self.over_time().unwrap_or(100.0), 100.0)] };
        let surprise = |run: &ReportedRun, at: usize| run.running.surprise.as_ref()?.get(at).copied();
        let panels = [
            self.panel("Plan beside the taught one", "mm", 5.0, None, beside, |_, _| None),
            self.panel("Surprise", "1", 1.0, None, surprise, |_, _| None),
            self.panel("Largest share of a torque limit", "%", 1.0, Some(limit), share, |_, _| None),
        ];
        panels.into_iter().flatten().map(|panel| Panel { from_zero: true, ..panel }).collect()
    }

    /// The band of the expected values of a sensor row; where their spread is not known, a band without width.
    fn expected(&self, row: usize) -> Option<Curve> {
        // What is expected is known over the progress alone.
        let table = self.primitive.filter(|_| self.over_time().is_none())?.expectation.as_ref()?;
        let last = table.mean.len().checked_sub(1)?.max(1) as f64;
        let side = |sign: f64| {
            let spread = |at: usize| table.spread.get(at).and_then(|point| point.get(row)).copied().unwrap_or(0.0);
            let value = move |at: usize, point: &Vec<f64>| Some(point.get(row)? + sign * BAND * spread(at));
            table
                .mean
                .iter()
                .enumerate()
                .filter_map(move |(at, point)| Some((100.0 * at as f64 / last, value(at, point)?)))
        };
        let back: Vec<_> = side(-1.0).collect();
        Some(Curve { ink: Ink::Band, points: side(1.0).chain(back.into_iter().rev()).collect() })
    }
}
