//! Runs scenarios and judges them.

use lab::transport::SimulatorKind;
use serde::Serialize;

use crate::bench::{self, Failure};
use crate::entry::{Entry, Known, Recover, Scenario, fault_name};
use crate::figure::{ALWAYS, Figure, Figures};
use crate::measure;
use crate::recovery;
use crate::watch::{self, Watched};

/// One figure against its bar.
#[derive(Debug, Clone, Serialize)]
pub struct Judged {
    /// The figure.
    #[serde(skip)]
    pub which: Figure,
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
    /// Time of the last fault on the arm of a sweep that went wrong, s.
    pub failed_at: Option<f64>,
    /// The defect that is known, if one is.
    pub known: Option<Known>,
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
            failed_at: None,
            known: scenario.known.clone(),
        }
    }

    /// Takes in the verdict on one more arm: its end, and the worse of each figure.
    fn join(&mut self, one: Verdict) {
        let before = std::mem::replace(self, one);
        // The end of the last arm is told, and of the figures the worst.
        self.failed_at = before.failed_at.or(self.failed_at);
        for old in before.figures {
            let now = self.figures.iter_mut().find(|now| (now.which, now.is_least) == (old.which, old.is_least));
            if let Some(now) = now.filter(|now| worse(&old, now)) {
                *now = old;
            }
        }
    }

    /// True if everything is as it must be.
    #[must_use]
    pub fn holds(&self) -> bool {
        self.failures.is_empty() && self.figures.iter().all(|judged| judged.is_within)
    }

    /// True if the verdict is the expected one: it holds, or fails by what a known defect misses and no more.
    #[must_use]
    pub fn is_as_told(&self) -> bool {
        let Some(known) = &self.known else { return self.holds() };
        let is_excused = |judged: &Judged| {
            let bar = known.misses.get(&judged.which).copied();
            judged.is_within || bar.is_some_and(|bar| is_within(judged.value, bar, judged.is_least))
        };
        !self.holds() && self.failures.is_empty() && self.figures.iter().all(is_excused)
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
    let compares =
        |figure: &Figure| matches!(figure, Figure::Deviation | Figure::Tracking | Figure::Astray | Figure::Plan);
    let (most, least) = (&scenario.expect.most, &scenario.expect.least);
    let nominal = most.keys().chain(least.keys()).any(compares).then(|| watched_without(scenario, kind)).transpose()?;
    for arm in scenario.each() {
        let mut one = Verdict::open(&verdict.id, scenario);
        let failure = judged(&mut bench::arm(&arm, true, kind)?, &arm, nominal.as_ref(), &mut one).err();
        one.failures.extend(failure.map(|failure| failure.to_string()));
        if scenario.sweep.is_some() && !one.holds() {
            one.failed_at = arm.inject.last().map(|injection| injection.at);
        }
        verdict.join(one);
        // A defect that is known is looked at on every arm: none may be worse than it says.
        if !verdict.holds() && !verdict.is_as_told() {
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
    let watched = watch::watch(arm, scenario, true)?;
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
    if !scenario.late.is_empty() {
        recovery::hindered(arm, scenario)?;
    }
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
    watch::watch(&mut arm, scenario, false)
}

/// True if `a` is worse than `b`; no measurement, and no number, is worse than any value.
fn worse(a: &Judged, b: &Judged) -> bool {
    let order = |judged: &Judged| {
        let worst = if judged.is_least { f64::NEG_INFINITY } else { f64::INFINITY };
        judged.value.filter(|value| !value.is_nan()).unwrap_or(worst)
    };
    if a.is_least { order(a) < order(b) } else { order(a) > order(b) }
}

/// True if the value is within its bar; no measurement is, and no number neither.
fn is_within(value: Option<f64>, bar: f64, is_least: bool) -> bool {
    value.is_some_and(|value| if is_least { value >= bar } else { value <= bar })
}

fn judge(figures: &Figures, figure: Figure, bar: f64, is_least: bool) -> Judged {
    let value = figures.get(&figure).copied();
    let is_within = is_within(value, bar, is_least);
    let (word, unit) = figure.label();
    Judged { which: figure, figure: word, value, bar, is_least, unit, is_within }
}
