//! From what was seen to figures.

use control::{Fault, State};
use puck::SafetyMode;
use sim::{TICKS_PER_MILLISECOND, Ticks};

use crate::bus::{self, Sent};
use crate::entry::{Given, Scenario};
use crate::figure::{Figure, Figures, largest};
use crate::watch::{Moment, Watched};

/// A joint at rest is slower, rad/s.
pub const AT_REST: f64 = 0.05;

/// Telemetry tells of an instant at most so long past, s.
const TELEMETRY_AGE: f64 = 0.012;

/// Torque may still be sent this long after the safety module has taken the arm out of ACTIVE.
const NOTICE: Ticks = 30 * TICKS_PER_MILLISECOND;

/// The same where the safety module's word can be lost: 100 ms of silence end the torque.
const UNHEARD: Ticks = NOTICE + 100 * TICKS_PER_MILLISECOND;

/// Longest time from the end of the torque until the motors brake, s.
const BRAKES: f64 = 0.01;

/// Behind the end of the faults, or a stop, the arm has so long to become slow, s.
const SETTLED: f64 = 0.3;

/// Speed of the hand is taken over so long a time, s.
const SPEED_WINDOW: f64 = 0.01;

/// The figures that hold in every scenario.
#[must_use]
pub fn always(watched: &Watched) -> Figures {
    let sent = bus::sent(&watched.bus);
    let speeds = hand_speeds(&watched.moments);
    let free = |least: f64| {
        let mut since = None;
        let mut fastest = 0.0_f64;
        for (moment, speed) in &speeds {
            since = if moment.is_free { since.or(Some(moment.time)) } else { None };
            if since.is_some_and(|since| moment.time - since >= least) {
                fastest = largest([fastest, *speed]);
            }
        }
        fastest
    };
    Figures::from([
        (Figure::Torque, bus::largest(&sent)),
        (Figure::TorqueStep, bus::largest_step(&sent)),
        (Figure::Belief, 1e3 * belief(&watched.moments)),
        (Figure::FreeSpeed, free(0.0)),
        (Figure::FallSpeed, free(BRAKES)),
        (Figure::CausesLost, f64::from(causes_lost(watched))),
        (Figure::TorqueUnasked, f64::from(unasked(&sent, &watched.moments, NOTICE))),
        (Figure::TorqueUnheard, f64::from(unasked(&sent, &watched.moments, UNHEARD))),
        (Figure::HandSpeed, largest(speeds.iter().map(|(_, speed)| *speed))),
    ])
}

/// All figures of a scenario, those against `nominal` if there is one.
#[must_use]
pub fn all(scenario: &Scenario, watched: &Watched, nominal: Option<&Watched>) -> Figures {
    let moments = &watched.moments;
    let mut figures = always(watched);
    figures.insert(Figure::Limited, limited(moments));
    let (first, last) = span(scenario);
    let stopped = moments.iter().find(|moment| moment.time >= first && !is_moving(moment.state));
    if let Some(stop) = stopped {
        figures.insert(Figure::Stop, 1e3 * (stop.time - first));
        let behind: Vec<&Moment> = moments.iter().filter(|moment| moment.time >= stop.time).collect();
        figures.insert(Figure::Rest, 1e3 * (moved_until(moments) - stop.time).max(0.0));
        let ways = behind.iter().flat_map(|moment| (0..7).map(|joint| (moment.q[joint] - stop.q[joint]).abs()));
        figures.insert(Figure::Travel, 1e3 * largest(ways));
        figures.extend(fastest_from(moments, stop.time + SETTLED).map(|speed| (Figure::StoppedSpeed, speed)));
    }
    figures.insert(Figure::Still, 1e3 * (moved_until(moments) - first).max(0.0));
    figures.extend(fastest_from(moments, last + SETTLED).map(|speed| (Figure::LateSpeed, speed)));
    if let Some(start) = moments.first() {
        let fall = largest(moments.iter().map(|moment| start.hand[2] - moment.hand[2]));
        figures.insert(Figure::Fall, 1e3 * fall);
    }
    let (before, after) = (&watched.before, &watched.after);
    let mut count = |figure, after: u32, before: u32| figures.insert(figure, f64::from(after.wrapping_sub(before)));
    count(Figure::LostReplies, after.lost_replies, before.lost_replies);
    count(Figure::TorqueMismatches, after.torque_mismatches, before.torque_mismatches);
    let odd = |statistics: &link::Statistics| statistics.late_replies.wrapping_add(statistics.rejected_frames);
    count(Figure::BusErrors, after.bus_errors, before.bus_errors);
    count(Figure::OddFrames, odd(after), odd(before));
    if let Some(nominal) = nominal {
        figures.extend(against(moments, &nominal.moments));
    }
    figures
}

/// Share of the cycles told in which the limiter cut the torque, percent.
fn limited(moments: &[Moment]) -> f64 {
    let told = moments.iter().filter(|moment| moment.told.is_some());
    let (cut, all) = told.fold((0_u32, 0_u32), |(cut, all), moment| (cut + u32::from(moment.is_limited), all + 1));
    100.0 * f64::from(cut) / f64::from(all.max(1))
}

/// Last moment at which a joint moved, s; infinite if one still does at the end: nobody knows until when.
fn moved_until(moments: &[Moment]) -> f64 {
    let rests = |moment: &Moment| moment.dq.iter().all(|speed| speed.abs() <= AT_REST);
    match moments.iter().rposition(|moment| !rests(moment)) {
        None => 0.0,
        Some(index) if index + 1 == moments.len() => f64::INFINITY,
        Some(index) => moments[index].time,
    }
}

/// Largest speed of the hand from this time on, m/s; `None` if nobody looked for so long.
fn fastest_from(moments: &[Moment], time: f64) -> Option<f64> {
    let late: Vec<f64> =
        hand_speeds(moments).into_iter().filter(|(moment, _)| moment.time > time).map(|(_, speed)| speed).collect();
    (!late.is_empty()).then(|| largest(late))
}

/// First begin, and last end or begin, of faults and orders, s.
fn span(scenario: &Scenario) -> (f64, f64) {
    let (mut first, mut last) = (f64::INFINITY, 0.0_f64);
    for fault in &scenario.inject {
        first = first.min(fault.at);
        let begin = fault.at + fault.every * f64::from(fault.times.saturating_sub(1));
        last = last.max(if fault.lasts.is_finite() { begin + fault.lasts } else { begin });
    }
    for order in &scenario.order {
        first = first.min(order.at);
        let length = if let Given::Silence(seconds) = order.give { seconds } else { 0.0 };
        last = last.max(order.at + length);
    }
    (if first.is_finite() { first } else { 0.0 }, last)
}

fn is_moving(state: State) -> bool {
    !matches!(state, State::Idle | State::SoftStop | State::Lower | State::Fault)
}

/// Speed of the hand at each moment, m/s.
fn hand_speeds(moments: &[Moment]) -> Vec<(&Moment, f64)> {
    let mut from = 0;
    let mut speeds = Vec::new();
    for moment in moments {
        while moment.time - moments[from].time > SPEED_WINDOW {
            from += 1;
        }
        let before = &moments[from.saturating_sub(1)];
        let time = moment.time - before.time;
        if time > 0.5 * SPEED_WINDOW {
            speeds.push((moment, distance(&moment.hand, &before.hand) / time));
        }
    }
    speeds
}

/// Largest distance of the joint angles told from those that were true a moment before, rad. Between two moments, which
/// an order parts by as long as its answer takes, the truth is interpolated.
fn belief(moments: &[Moment]) -> f64 {
    let mut worst = 0.0_f64;
    let mut from = 0;
    for (index, moment) in moments.iter().enumerate() {
        while moment.time - moments[from].time > TELEMETRY_AGE {
            from += 1;
        }
        let Some((q, _)) = moment.told else { continue };
        let off = |before: &Moment, behind: &Moment, share: f64| {
            let truth = |joint: usize| before.q[joint] + share * (behind.q[joint] - before.q[joint]);
            largest((0..7).map(|joint| (q[joint] - truth(joint)).abs()))
        };
        let seen = &moments[from.saturating_sub(1)..=index];
        let pairs = seen.windows(2).flat_map(|pair| (0..8).map(move |step| (pair, f64::from(step) / 8.0)));
        let nearest =
            pairs.map(|(pair, share)| off(&pair[0], &pair[1], share)).fold(off(moment, moment, 0.0), f64::min);
        worst = largest([worst, nearest]);
    }
    worst
}

/// Changes of a latched fault into another, or none, that no person made. A loss that goes on is the same cause.
fn causes_lost(watched: &Watched) -> u32 {
    let changes = watched.moments.windows(2).filter(|pair| {
        let is_cleared = watched.clears.iter().any(|at| (pair[1].time - at).abs() < 0.1);
        let goes_on = (pair[0].fault, pair[1].fault) == (Fault::RepliesLost, Fault::RepliesLostForLong);
        pair[0].fault != Fault::None && pair[1].fault != pair[0].fault && !is_cleared && !goes_on
    });
    changes.count() as u32
}

/// Torques that are not zero although the safety module has not been ACTIVE for this while.
fn unasked(sent: &[Sent], moments: &[Moment], notice: Ticks) -> u32 {
    let mut since = None;
    let mut count = 0;
    let mut pairs = sent.iter().peekable();
    for moment in moments {
        while let Some(pair) = pairs.next_if(|pair| pair.at <= moment.ticks) {
            count += u32::from(!pair.is_zero && since.is_some_and(|since| pair.at > since + notice));
        }
        since = if moment.safety == SafetyMode::Active { None } else { since.or(Some(moment.ticks)) };
    }
    count
}

/// Figures against the same scenario without the faults.
fn against(moments: &[Moment], nominal: &[Moment]) -> Figures {
    let mut deviation = 0.0_f64;
    for moment in moments {
        let later = nominal.partition_point(|other| other.time < moment.time).clamp(1, nominal.len() - 1);
        let (before, behind) = (&nominal[later - 1], &nominal[later]);
        let share = ((moment.time - before.time) / (behind.time - before.time).max(1e-9)).clamp(0.0, 1.0);
        let off = (0..7).map(|joint| {
            let wanted = before.q[joint] + share * (behind.q[joint] - before.q[joint]);
            (moment.q[joint] - wanted).abs()
        });
        deviation = largest([deviation].into_iter().chain(off));
    }
    let plans = |moments: &[Moment]| -> Vec<(f64, [f64; 3], [f64; 3])> {
        moments.iter().filter_map(|moment| moment.told.map(|(_, plan)| (moment.time, plan, moment.hand))).collect()
    };
    let (planned, wanted) = (plans(moments), plans(nominal));
    let rms = |plans: &[(f64, [f64; 3], [f64; 3])]| {
        let squares: f64 = plans.iter().map(|(_, plan, hand)| distance(plan, hand).powi(2)).sum();
        (squares / plans.len().max(1) as f64).sqrt()
    };
    // What no plan was told for is no distance from it.
    let farthest = |plans: &[(f64, [f64; 3], [f64; 3])]| {
        let off = largest(plans.iter().map(|(_, plan, hand)| distance(plan, hand)));
        if plans.is_empty() { f64::NAN } else { off }
    };
    let apart = planned.iter().filter_map(|(time, plan, _)| {
        let later = wanted.partition_point(|(other, ..)| other < time);
        let nearest = wanted.get(later.saturating_sub(1)..(later + 1).min(wanted.len()))?;
        nearest.iter().map(|(_, other, _)| distance(plan, other)).reduce(f64::min)
    });
    Figures::from([
        (Figure::Deviation, 1e3 * deviation),
        (Figure::Tracking, rms(&planned) / rms(&wanted).max(1e-9)),
        (Figure::Astray, 1e3 * largest([farthest(&planned) - farthest(&wanted)])),
        (Figure::Plan, 1e3 * largest(apart)),
    ])
}

fn distance(a: &[f64; 3], b: &[f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a - b).powi(2)).sum::<f64>().sqrt()
}
