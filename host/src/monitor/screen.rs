//! The screen of `tactus monitor`: 80 columns and 24 lines at least, more events where there is more room.

use control::model::{SOFT_MAX, SOFT_MIN};
use lab::arm::TORQUE_LIMITS;
use link::HandStage;
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::text::{Line, Span};
use ratatui::widgets::{Block, Paragraph, Wrap};

use super::Watch;

/// Full deflection of the bars of force and torque, N and N m.
const FULL_WRENCH: [f64; 6] = [20.0, 20.0, 20.0, 2.0, 2.0, 2.0];

/// Full deflection of the bars of the fingers, rad: the range of spread and inner links.
const FULL_HAND: [f64; 4] = [std::f64::consts::PI, 2.44, 2.44, 2.44];

/// Surprise from which on a run counts as unusual, for the colour.
const UNUSUAL: f32 = 4.0;

/// Smallest screen.
const SMALLEST: (u16, u16) = (80, 24);

const GOOD: Style = Style::new().fg(Color::Green);
const WARNING: Style = Style::new().fg(Color::Yellow);
const BAD: Style = Style::new().fg(Color::Red).add_modifier(Modifier::BOLD);

/// The keys that mean something.
const KEYS: &str = " s or space: stop the arm   q: leave, the arm goes on ";

/// Draws everything.
pub fn draw(frame: &mut Frame<'_>, watch: &Watch) {
    let area = frame.area();
    if (area.width, area.height) < SMALLEST || area.height < SMALLEST.1 {
        let words = format!("{} x {} are needed, here are {} x {}", SMALLEST.0, SMALLEST.1, area.width, area.height);
        // Whoever made the window small may need the keys, and the state of the arm, all the same.
        let lines = [words, format!("state {}", watch.state().to_uppercase()), KEYS.to_owned(), watch.cause()];
        let lines: Vec<Line<'_>> = lines.into_iter().map(Line::raw).collect();
        return frame.render_widget(Paragraph::new(lines).wrap(Wrap { trim: true }), area);
    }
    // What to do stands at the end of a cause: a long one takes the line of the newest event, which says the same.
    let cause = watch.cause();
    let is_long = cause.chars().count() > usize::from(area.width);
    let rows = Layout::vertical([
        Constraint::Length(2),
        Constraint::Length(1 + u16::from(is_long)),
        Constraint::Length(9),
        Constraint::Length(8),
        Constraint::Length(2),
        Constraint::Min(u16::from(!is_long)),
        Constraint::Length(1),
    ]);
    let [head, reason, joints, senses, health, events, keys] = rows.areas(area);
    frame.render_widget(Paragraph::new(heading(watch, head.width)), head);
    let style = if watch.fault().is_some() { BAD } else { WARNING };
    frame.render_widget(Paragraph::new(Line::styled(cause, style)).wrap(Wrap { trim: true }), reason);
    panel(frame, joints, " joints ", joint_lines(watch, joints.width));
    let [left, right] = Layout::horizontal([Constraint::Percentage(50), Constraint::Percentage(50)]).areas(senses);
    let title = if watch.expected().is_some() { " wrench (+ expected) " } else { " wrench " };
    panel(frame, left, title, wrench_lines(watch, left.width));
    panel(frame, right, " hand, adaptation ", hand_lines(watch, right.width));
    frame.render_widget(Paragraph::new(health_lines(watch)), health);
    let newest = watch.events.iter().rev().take(usize::from(events.height)).collect::<Vec<_>>();
    let lines: Vec<Line<'_>> = newest.into_iter().rev().map(|event| Line::raw(event.as_str())).collect();
    frame.render_widget(Paragraph::new(lines), events);
    let help = Line::styled(KEYS, Modifier::REVERSED);
    frame.render_widget(Paragraph::new(help), keys);
}

fn panel(frame: &mut Frame<'_>, area: Rect, title: &'static str, lines: Vec<Line<'_>>) {
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), area);
}

fn heading(watch: &Watch, width: u16) -> Vec<Line<'static>> {
    let simulated = if watch.hello.simulated { ", simulated" } else { "" };
    let cycle = watch.telemetry.map_or(watch.status.cycle, |telemetry| telemetry.cycle);
    let device = format!("{} ({}){simulated}", watch.hello.board.as_str(), watch.hello.firmware.as_str());
    let state = watch.state();
    let style = match state {
        "fault" | "soft stop" => BAD,
        "run" | "coast" | "approach" => GOOD.add_modifier(Modifier::BOLD),
        _ => Style::new().add_modifier(Modifier::BOLD),
    };
    let style = if watch.fault().is_some() { BAD } else { style };
    let movement = match (&watch.status.loaded, watch.progress()) {
        (Some(name), Some(progress)) => {
            let bar = filled(progress, usize::from(width).saturating_sub(56));
            format!("'{}' [{bar}] {:3.0} %", name.as_str(), progress * 100.0)
        }
        (Some(name), None) => format!("'{}' is loaded", name.as_str()),
        (None, _) => "no primitive is loaded".to_owned(),
    };
    vec![
        Line::raw(format!("{device}   cycle {cycle}")),
        Line::from(vec![
            Span::raw("state "),
            Span::styled(state.to_uppercase(), style),
            Span::raw(format!("   {movement}")),
        ]),
    ]
}

fn joint_lines(watch: &Watch, width: u16) -> Vec<Line<'static>> {
    let newest = watch.placed();
    // The status alone has no speed and no torque, and an arm that is zeroed may not have been read since.
    let q =
        newest.map(|cycle| cycle.q).or((watch.telemetry.is_none() && watch.status.zeroed).then_some(watch.status.q));
    (0..7)
        .map(|joint| {
            let name = format!("J{} ", joint + 1);
            let Some(q) = q else {
                return Line::raw(format!(
                    "{name} {}",
                    if watch.status.zeroed { "not read yet" } else { "not zeroed" }
                ));
            };
            let (angle, low, high) = (f64::from(q[joint]), SOFT_MIN[joint], SOFT_MAX[joint]);
            let room = usize::from(width).saturating_sub(64);
            let near = (angle - low).min(high - angle) < 0.1;
            let speed = newest.map_or_else(|| "    -".to_owned(), |cycle| format!("{:+6.2}", cycle.dq[joint]));
            let tau = watch.telemetry.map(|cycle| f64::from(cycle.tau[joint]));
            let torque = tau.map_or_else(|| "     -".to_owned(), |tau| format!("{tau:+6.1}"));
            let share = tau.unwrap_or(0.0).abs() / TORQUE_LIMITS[joint];
            Line::from(vec![
                Span::raw(format!("{name}{angle:+7.3} rad {low:+5.2}[")),
                Span::styled(marked(angle, low, high, room), if near { WARNING } else { GOOD }),
                Span::raw(format!("]{high:+5.2} {speed:>6} rad/s {torque} N m [")),
                Span::styled(filled(share, 8), if share > 0.8 { WARNING } else { GOOD }),
                Span::raw("]"),
            ])
        })
        .collect()
}

fn wrench_lines(watch: &Watch, width: u16) -> Vec<Line<'static>> {
    let Some(telemetry) = watch.weighed() else {
        let why = match (watch.telemetry, watch.placed()) {
            (None, _) => "no cycles yet",
            (Some(_), None) => "not known before the joint angles",
            (Some(_), Some(_)) => "not measured: no force sensor answers",
        };
        return vec![Line::raw(why)];
    };
    let expected = watch.expected();
    let room = usize::from(width).saturating_sub(19);
    let axes = [("fx", "N  "), ("fy", "N  "), ("fz", "N  "), ("tx", "N m"), ("ty", "N m"), ("tz", "N m")];
    (0..6)
        .map(|axis| {
            let (name, unit) = axes[axis];
            let value = f64::from(telemetry.wrench[axis]);
            let bar = deflected(value / FULL_WRENCH[axis], expected.map(|all| all[axis] / FULL_WRENCH[axis]), room);
            let style = if value.abs() > FULL_WRENCH[axis] { WARNING } else { Style::new() };
            Line::styled(format!("{name} {value:+7.2} {unit} [{bar}]"), style)
        })
        .collect()
}

fn hand_lines(watch: &Watch, width: u16) -> Vec<Line<'static>> {
    let room = usize::from(width).saturating_sub(30);
    let mut lines: Vec<Line<'static>> = match (watch.telemetry, watch.status.hand_stage) {
        (Some(telemetry), HandStage::Ready) => (0..4)
            .map(|digit| {
                let (angle, full) = (f64::from(telemetry.hand[digit]), FULL_HAND[digit]);
                let name = ["sp", "F1", "F2", "F3"][digit];
                let gauge = digit.checked_sub(1).map(|finger| format!("{:+6.2} N m", telemetry.gauges[finger]));
                let bar = aimed(angle / full, f64::from(telemetry.hand_d[digit]) / full, room);
                Line::raw(format!("{name} {angle:5.2} rad [{bar}] {}", gauge.unwrap_or_default()))
            })
            .collect(),
        (_, stage) => vec![Line::raw(format!("hand: {}", stage.name()))],
    };
    lines.resize(4, Line::raw(""));
    let surprise = watch.telemetry.map_or(0.0, |telemetry| telemetry.surprise);
    let adaptation = watch.adaptation();
    let style = |warn: bool| if warn { WARNING } else { Style::new() };
    lines.push(Line::styled(format!("adaptation: {adaptation}"), style(adaptation == "at its limits")));
    lines.push(Line::styled(format!("surprise: {surprise:.1}"), style(surprise > UNUSUAL)));
    lines
}

fn health_lines(watch: &Watch) -> Vec<Line<'static>> {
    let (now, worst) = watch.computation_us();
    let now = watch.telemetry.map_or_else(|| "-".to_owned(), |_| format!("{now:.0} us"));
    let counters = &watch.statistics;
    let style = |count: u32| if count > 0 { WARNING } else { Style::new() };
    vec![
        Line::from(vec![
            Span::raw(format!("loop {now}, worst {worst:.0} us   ")),
            Span::styled(format!("missed {}", counters.missed_deadlines), style(counters.missed_deadlines)),
            Span::raw("   "),
            Span::styled(format!("lost replies {}", counters.lost_replies), style(counters.lost_replies)),
        ]),
        Line::from(vec![
            Span::styled(format!("bus errors {}", counters.bus_errors), style(counters.bus_errors)),
            Span::raw(format!(", restarts {}   ", counters.bus_restarts)),
            Span::styled(format!("telemetry lost {}", watch.gaps.telemetry), style(watch.gaps.telemetry)),
            Span::raw(format!(", dropped {}", counters.telemetry_dropped)),
        ]),
    ]
}

/// A bar filled from the left.
fn filled(share: f64, width: usize) -> String {
    let full = (share.clamp(0.0, 1.0) * width as f64).round() as usize;
    format!("{}{}", "#".repeat(full), ".".repeat(width.saturating_sub(full)))
}

/// A bar filled from the left, with a `+` where it is to end.
fn aimed(share: f64, aim: f64, width: usize) -> String {
    let at = (aim.clamp(0.0, 1.0) * width.saturating_sub(1) as f64).round() as usize;
    filled(share, width).chars().enumerate().map(|(place, dot)| if place == at { '+' } else { dot }).collect()
}

/// A range with a mark in it.
fn marked(value: f64, low: f64, high: f64, width: usize) -> String {
    let at = ((value - low) / (high - low)).clamp(0.0, 1.0) * width.saturating_sub(1) as f64;
    (0..width).map(|place| if place == at.round() as usize { '#' } else { '-' }).collect()
}

/// A bar that goes out from the middle, -1 to 1, with a `+` where it is expected to end.
fn deflected(value: f64, expected: Option<f64>, width: usize) -> String {
    let middle = width / 2;
    let place = |value: f64| (middle as f64 + value.clamp(-1.0, 1.0) * middle as f64).round() as usize;
    let (from, to) = (middle.min(place(value)), middle.max(place(value)));
    let expected = expected.map(place);
    (0..width.max(1))
        .map(|at| match at {
            at if expected == Some(at) => '+',
            at if at == middle => '|',
            at if (from..=to).contains(&at) => '#',
            _ => ' ',
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn bars_show_where_a_value_is_and_where_it_was_expected() {
        assert_eq!(deflected(0.5, None, 9), "    |##  ");
        assert_eq!(deflected(-1.7, Some(0.5), 9), "####| +  ");
        assert_eq!(deflected(0.0, Some(9.0), 9), "    |   +");
        assert_eq!(aimed(0.5, 1.0, 8), "####...+");
        assert_eq!((filled(1.2, 4).as_str(), filled(f64::NAN, 4).as_str()), ("####", "...."));
        assert_eq!(marked(0.0, -1.0, 1.0, 5), "--#--");
    }
}
