//! Runs scenarios and judges them.

use lab::transport::SimulatorKind;
use serde::Serialize;

use crate::bench::{self, Failure};
use crate::entry::{Entry, Recover, Scenario, fault_name};
use crate::figure::{ALWAYS, Figure, Figures};
use crate::measure;
use crate::recovery;
use crate::watch::{self, Watched};

/// One figure against its bar.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// Word of the figure.
    pub figure: &'static str,
    /// Measured; `None` if there was nothing to measure.
    pub value: Option<f64>,
    /// Bar.
    pub bar: f64,
    /// True if the bar is the smallest value, not the largest.
    pub is_least: bool,
    /// Unit.
    pub unit: &'static str,
    /// Within the bar.
    pub is_within: bool,
}

/// Result of one scenario.
#[derive(Debug, Clone, Serialize)]
pub struct Verdict {
    /// Identifier of the entry.
    pub id: String,
    /// Name of the scenario.
    pub scenario: String,
    /// State at the end of the watch.
    pub state: &'static str,
    /// Fault at the end of the watch.
    pub fault: String,
    /// Figures with bars.
    pub figures: Vec<Judged>,
    /// Everything else that is not as it must be.
    pub failures: Vec<String>,
    /// The defect that is known, if one is.
    pub known: Option<String>,
}

impl Verdict {
    /// The verdict on a scenario of this entry before it has run.
    #[must_use]
    pub fn open(id: &str, scenario: &Scenario) -> Self {
        Self {
            id: id.to_owned(),
            scenario: scenario.name.clone(),
            state: "",
            fault: String::new(),
            figures: Vec::new(),
            failures: Vec::new(),
            known: scenario.known.clone(),
        }
    }

    /// Takes in the verdict on one more arm: its end, and the worse of each figure.
    fn join(&mut self, one: Verdict) {
        let before = std::mem::take(&mut self.figures);
        *self = one;
        for old in before {
            let now = self.figures.iter_mut().find(|now| (now.figure, now.is_least) == (old.figure, old.is_least));
            // The end of the last arm is told, and of the figures the worst.
            if let Some(now) = now.filter(|now| now.is_within && worse(&old, now)) {
                *now = old;
            }
        }
    }

    /// True if everything is as it must be.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.failures.is_empty() && self.figures.iter().all(|judged| judged.is_within)
    }

    /// True if the verdict is the expected one: it holds, or fails where a defect is known.
    #[must_use]
    pub fn is_as_told(&self) -> bool {
        self.holds() == self.known.is_none()
    }
}

/// Runs one scenario of an entry, and the same without the faults, with the same orders, if a bar compares the two.
#[must_use]
pub fn run(entry: &Entry, scenario: &Scenario, kind: SimulatorKind) -> Verdict {
    let mut verdict = Verdict::open(&entry.id, scenario);
    if let Err(failure) = go_through(scenario, kind, &mut verdict) {
        verdict.failures.push(failure.to_string());
    }
    verdict
}

fn go_through(scenario: &Scenario, kind: SimulatorKind, verdict: &mut Verdict) -> Result<(), Failure> {
    let compares = |figure: &Figure| matches!(figure, Figure::Deviation | Figure::Tracking | Figure::Plan);
    let (most, least) = (&scenario.expect.most, &scenario.expect.least);
    let nominal = most.keys().chain(least.keys()).any(compares).then(|| watched_without(scenario, kind)).transpose()?;
    for arm in scenario.each() {
        let mut one = Verdict::open(&verdict.id, scenario);
        let failure = judged(&mut bench::arm(&arm, true, kind)?, &arm, nominal.as_ref(), &mut one).err();
        one.failures.extend(failure.map(|failure| failure.to_string()));
        if scenario.sweep.is_some() && !one.holds() {
            let last = arm.inject.last().map_or(0.0, |injection| injection.at);
            one.failures.push(format!("with the last fault at {last:.4} s"));
        }
        verdict.join(one);
        if !verdict.holds() {
            break;
        }
    }
    Ok(())
}

/// Watches an arm in the state where the scenario begins, judges what comes of it, and goes the way back.
///
/// # Errors
/// The arm does not answer, or the way back fails.
pub fn judged(
    arm: &mut bench::Arm,
    scenario: &Scenario,
    nominal: Option<&Watched>,
    verdict: &mut Verdict,
) -> Result<(), Failure> {
    let watched = watch::watch(arm, scenario.watch, &scenario.order)?;
    let figures = measure::all(scenario, &watched, nominal);
    let last = watched.moments.last().ok_or("nothing was seen")?;
    (verdict.state, verdict.fault) = (last.state.name(), fault_name(last.fault));
    let expected = &scenario.expect;
    if !expected.state.is_empty() && expected.state.iter().all(|name| name != verdict.state) {
        verdict.failures.push(format!("ends in '{}', not in {:?}", verdict.state, expected.state));
    }
    if !expected.fault.is_empty() && !expected.fault.contains(&verdict.fault) {
        verdict.failures.push(format!("the fault is {}, not {:?}", verdict.fault, expected.fault));
    }
    verdict.failures.extend(watched.surprises.iter().cloned());
    let usual = ALWAYS.iter().filter(|(figure, _)| !expected.most.contains_key(figure));
    let most = usual.copied().chain(expected.most.iter().map(|(figure, bar)| (*figure, *bar)));
    verdict.figures.extend(most.map(|(figure, bar)| judge(&figures, figure, bar, false)));
    verdict.figures.extend(expected.least.iter().map(|(figure, bar)| judge(&figures, *figure, *bar, true)));
    if scenario.recover != Recover::None {
        recovered(arm, scenario, verdict)?;
    }
    Ok(())
}

/// The way back, and the bars of every scenario on it.
fn recovered(arm: &mut bench::Arm, scenario: &Scenario, verdict: &mut Verdict) -> Result<(), Failure> {
    bench::plant(arm).take_recorded();
    let outcome = recovery::recover(arm, scenario.recover);
    let sent = crate::bus::sent(&bench::plant(arm).take_recorded());
    for (figure, value) in
        [(Figure::Torque, crate::bus::largest(&sent)), (Figure::TorqueStep, crate::bus::largest_step(&sent))]
    {
        let bar = ALWAYS.iter().find(|(other, _)| *other == figure).map_or(1.0, |(_, bar)| *bar);
        if value > bar {
            verdict.failures.push(format!("on the way back: {} {value:.3}, bar {bar}", figure.label().0));
        }
    }
    outcome.map_err(|failure| format!("on the way back: {failure}").into())
}

fn watched_without(scenario: &Scenario, kind: SimulatorKind) -> Result<Watched, Failure> {
    let mut arm = bench::arm(scenario, false, kind)?;
    watch::watch(&mut arm, scenario.watch, &scenario.order)
}

fn worse(a: &Judged, b: &Judged) -> bool {
    if a.is_least { a.value < b.value } else { a.value > b.value }
}

fn judge(figures: &Figures, figure: Figure, bar: f64, is_least: bool) -> Judged {
    let value = figures.get(&figure).copied();
    let is_within = value.is_some_and(|value| if is_least { value >= bar } else { value <= bar });
    let (word, unit) = figure.label();
    Judged { figure: word, value, bar, is_least, unit, is_within }
}
