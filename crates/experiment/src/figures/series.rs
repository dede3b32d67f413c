//! One trial in closed loop against the same in open loop: forces with their expected band, pose, fingers. The
//! paper's figure 4.

use lab::plot::drawing::{Anchor, BAND, Drawing, Frame, GREY, INK};

use super::colour;
use crate::trace::{CHANNELS, Cycle, Trace};
use lab::procedure::Mode;

const LEFT: f64 = 96.0;
const TOP: f64 = 132.0;
const PANEL: [f64; 2] = [430.0, 140.0];
const GAP: [f64; 2] = [84.0, 62.0];
/// Points that a curve has at most.
const MOST_POINTS: usize = 700;
/// Standard deviations on either side of the expected mean.
const BAND_WIDTH: f64 = 2.0;

/// What the sensors should feel, over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Expected {
    /// Times after the start, s.
    pub time: Vec<f64>,
    /// Mean of each channel.
    pub mean: Vec<[f64; CHANNELS]>,
    /// Standard deviation of each channel.
    pub spread: Vec<[f64; CHANNELS]>,
}

/// One diagram: what it shows of a cycle.
struct Panel {
    title: &'static str,
    unit: &'static str,
    /// Least height of the axis.
    height: f64,
    measured: fn(&Cycle) -> f64,
    planned: Option<fn(&Cycle) -> f64>,
    channel: Option<usize>,
}

/// Panels row by row, three a row.
const PANELS: [[Panel; 3]; 5] = [
    [
        felt("force x", "N", 4.0, 0, |c| c.felt[0]),
        felt("force y", "N", 4.0, 1, |c| c.felt[1]),
        felt("force z", "N", 4.0, 2, |c| c.felt[2]),
    ],
    [
        felt("torque x", "N m", 0.4, 3, |c| c.felt[3]),
        felt("torque y", "N m", 0.4, 4, |c| c.felt[4]),
        felt("torque z", "N m", 0.4, 5, |c| c.felt[5]),
    ],
    [
        moved("position x", "cm", 4.0, |c| 100.0 * c.position[0], |c| 100.0 * c.position_d[0]),
        moved("position y", "cm", 4.0, |c| 100.0 * c.position[1], |c| 100.0 * c.position_d[1]),
        moved("position z", "cm", 4.0, |c| 100.0 * c.position[2], |c| 100.0 * c.position_d[2]),
    ],
    [
        moved("finger 1", "rad", 0.5, |c| c.hand[1], |c| c.hand_d[1]),
        moved("finger 2", "rad", 0.5, |c| c.hand[2], |c| c.hand_d[2]),
        moved("finger 3", "rad", 0.5, |c| c.hand[3], |c| c.hand_d[3]),
    ],
    [
        felt("gauge 1", "N m", 0.3, 6, |c| c.felt[6]),
        felt("gauge 2", "N m", 0.3, 7, |c| c.felt[7]),
        felt("gauge 3", "N m", 0.3, 8, |c| c.felt[8]),
    ],
];

const fn felt(
    title: &'static str,
    unit: &'static str,
    height: f64,
    channel: usize,
    measured: fn(&Cycle) -> f64,
) -> Panel {
    Panel { title, unit, height, measured, planned: None, channel: Some(channel) }
}

const fn moved(
    title: &'static str,
    unit: &'static str,
    height: f64,
    measured: fn(&Cycle) -> f64,
    planned: fn(&Cycle) -> f64,
) -> Panel {
    Panel { title, unit, height, measured, planned: Some(planned), channel: None }
}

/// Closed loop against open loop; `marks` are times (s) with their names, such as the end of the movement.
pub fn draw(runs: &[(Mode, &Trace)], expected: Option<&Expected>, marks: &[(f64, &str)], title: &str) -> Drawing {
    let width = LEFT + 3.0 * PANEL[0] + 2.0 * GAP[0] + 40.0;
    let bottom = TOP + PANELS.len() as f64 * (PANEL[1] + GAP[1]);
    let mut drawing = Drawing::new(width, bottom + 40.0);
    drawing.text([LEFT, 48.0], title, 26, Anchor::Start, INK);
    legend(&mut drawing, runs, expected.is_some());
    let end = runs.iter().filter_map(|(_, trace)| trace.cycles.last()).map(|cycle| cycle.time).fold(1.0, f64::max);
    for (row, panels) in PANELS.iter().enumerate() {
        // One scale for the three axes of a quantity, so that they can be compared.
        for (column, panel) in panels.iter().enumerate() {
            let corner = [LEFT + column as f64 * (PANEL[0] + GAP[0]), TOP + row as f64 * (PANEL[1] + GAP[1])];
            let frame = Frame { corner, size: PANEL, x: [0.0, end], y: range(panel, runs, expected) };
            draw_panel(&mut drawing, &frame, panel, runs, expected, marks);
        }
    }
    for column in 0..3 {
        let middle = LEFT + f64::from(column) * (PANEL[0] + GAP[0]) + PANEL[0] / 2.0;
        drawing.text([middle, bottom + 6.0], "time, s", 16, Anchor::Middle, INK);
    }
    drawing
}

fn legend(drawing: &mut Drawing, runs: &[(Mode, &Trace)], band: bool) {
    let (mut x, y) = (LEFT, 84.0);
    for (mode, _) in runs {
        drawing.line(&[[x, y], [x + 44.0, y]], colour(*mode), 2.6);
        drawing.text([x + 54.0, y + 6.0], mode.title(), 16, Anchor::Start, INK);
        x += 54.0 + 8.6 * mode.title().len() as f64 + 40.0;
    }
    drawing.dashed(&[[x, y], [x + 44.0, y]], GREY, 1.8, [6.0, 4.0]);
    drawing.text([x + 54.0, y + 6.0], "planned", 16, Anchor::Start, INK);
    x += 160.0;
    if band {
        drawing.rectangle([x, y - 9.0], [44.0, 18.0], BAND);
        drawing.line(&[[x, y], [x + 44.0, y]], GREY, 1.2);
        drawing.text([x + 54.0, y + 6.0], "expected: mean and 2 standard deviations", 16, Anchor::Start, INK);
    }
}

fn draw_panel(
    drawing: &mut Drawing,
    frame: &Frame,
    panel: &Panel,
    runs: &[(Mode, &Trace)],
    expected: Option<&Expected>,
    marks: &[(f64, &str)],
) {
    if let (Some(channel), Some(expected)) = (panel.channel, expected) {
        band(drawing, frame, channel, expected);
    }
    frame.grid(drawing, 14, [8, 4]);
    for (time, name) in marks {
        let [x, _] = frame.at([*time, frame.y[0]]);
        drawing.dashed(&[[x, frame.corner[1]], [x, frame.bottom()]], GREY, 1.2, [3.0, 4.0]);
        // Names side by side need room: 7 px a letter.
        let next = marks.iter().map(|(later, _)| *later).filter(|later| later > time).fold(f64::INFINITY, f64::min);
        let room = frame.at([next, 0.0])[0] - x > 7.0 * name.len() as f64 + 8.0;
        if frame.corner[1] < TOP + 1.0 && room {
            drawing.text([x + 4.0, frame.corner[1] + 11.0], *name, 13, Anchor::Start, GREY);
        }
    }
    for (mode, trace) in runs {
        let every = trace.cycles.len().div_ceil(MOST_POINTS).max(1);
        let curve = |value: fn(&Cycle) -> f64| {
            frame.curve(trace.cycles.iter().step_by(every).map(|cycle| [cycle.time, value(cycle)]))
        };
        drawing.line(&curve(panel.measured), colour(*mode), 2.0);
        if let Some(planned) = panel.planned {
            drawing.dashed(&curve(planned), GREY, 1.5, [6.0, 4.0]);
        }
    }
    frame.axes(drawing);
    drawing.text(
        [frame.corner[0], frame.corner[1] - 10.0],
        format!("{}, {}", panel.title, panel.unit),
        16,
        Anchor::Start,
        INK,
    );
}

fn band(drawing: &mut Drawing, frame: &Frame, channel: usize, expected: &Expected) {
    let edge = |sign: f64| {
        let rows = expected.time.iter().zip(&expected.mean).zip(&expected.spread);
        frame.curve(rows.map(|((time, mean), spread)| [*time, mean[channel] + sign * BAND_WIDTH * spread[channel]]))
    };
    let mut outline = edge(1.0);
    outline.extend(edge(-1.0).into_iter().rev());
    if outline.len() > 2 {
        drawing.polygon(&outline, BAND);
        drawing.line(&edge(0.0), GREY, 1.2);
    }
}

/// Everything a panel shows, with a margin; short peaks of an uncontrolled contact do not flatten the rest.
fn range(panel: &Panel, runs: &[(Mode, &Trace)], expected: Option<&Expected>) -> [f64; 2] {
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut take = |values: Vec<f64>| {
        let at = |share| crate::quantile::quantile(&values, share);
        if let (Some(least), Some(most)) = (at(0.005), at(0.995)) {
            (low, high) = (low.min(least), high.max(most));
        }
    };
    for (_, trace) in runs {
        take(trace.cycles.iter().map(panel.measured).collect());
        take(panel.planned.map(|planned| trace.cycles.iter().map(planned).collect()).unwrap_or_default());
    }
    if let (Some(channel), Some(expected)) = (panel.channel, expected) {
        let rows = || expected.mean.iter().zip(&expected.spread);
        take(rows().map(|(mean, spread)| mean[channel] - BAND_WIDTH * spread[channel]).collect());
        take(rows().map(|(mean, spread)| mean[channel] + BAND_WIDTH * spread[channel]).collect());
    }
    if low > high {
        return [-0.5 * panel.height, 0.5 * panel.height];
    }
    let (middle, half) = ((low + high) / 2.0, 0.56 * (high - low).max(panel.height));
    [middle - half, middle + half]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::trace::tests::cycle;

    /// A made-up approach: the force rises at contact at 5 s, by much in open loop and little in closed loop.
    pub(crate) fn fixtures() -> (Trace, Trace, Expected) {
        let run = |force: f64| Trace {
            cycles: (0..14 * control::RATE_HZ)
                .map(|k| {
                    let time = f64::from(k) / control::RATE;
                    let s = (time / 8.0).min(1.0);
                    let touch = (time - 5.0).clamp(0.0, 1.0);
                    let mut cycle = cycle(time);
                    cycle.position = [0.45 + 0.3 * s, -0.1 + 0.3 * s, 0.02 * (6.0 * s).sin()];
                    cycle.position_d = [0.45 + 0.3 * s + 0.01, -0.1 + 0.3 * s, 0.02 * (6.0 * s).sin()];
                    cycle.felt = std::array::from_fn(|i| {
                        let scale = if i < 3 { 1.0 } else { 0.05 };
                        scale * (-force * touch / (1.0 + i as f64) + 0.1 * (f64::from(k) * (0.7 + i as f64)).sin())
                    });
                    let closing = ((time - 9.0) / 3.0).clamp(0.0, 1.0);
                    cycle.hand = [0.0, 0.25 + 1.4 * closing, 0.25 + 1.4 * closing, 0.25 + 1.5 * closing];
                    cycle.hand_d = [0.0, 0.25 + 2.1 * closing, 0.25 + 2.1 * closing, 0.25 + 2.1 * closing];
                    cycle
                })
                .collect(),
        };
        let time: Vec<f64> = (0..64).map(|k| f64::from(k) * 12.0 / 63.0).collect();
        let expected = Expected {
            mean: time.iter().map(|_| [0.0; CHANNELS]).collect(),
            spread: time.iter().map(|_| std::array::from_fn(|i| if i < 3 { 0.3 } else { 0.02 })).collect(),
            time,
        };
        (run(9.0), run(2.0), expected)
    }

    #[test]
    fn all_fifteen_diagrams_are_there() {
        let (open, closed, expected) = fixtures();
        let runs = [(Mode::OpenLoop, &open), (Mode::Adaptive, &closed)];
        let svg = draw(&runs, Some(&expected), &[(12.0, "lift")], "Torch").to_svg();
        for title in PANELS.iter().flatten() {
            assert!(svg.contains(&format!("{}, {}", title.title, title.unit)), "{}", title.title);
        }
    }

    #[test]
    fn one_spike_does_not_flatten_a_diagram() {
        let (mut open, closed, _) = fixtures();
        open.cycles[2000].felt[0] = 500.0;
        let runs = [(Mode::OpenLoop, &open), (Mode::Adaptive, &closed)];
        let [low, high] = range(&PANELS[0][0], &runs, None);
        assert!(high - low < 20.0 && low < -9.0, "{low} {high}");
    }
}
