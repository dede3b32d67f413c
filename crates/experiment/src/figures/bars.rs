//! Bars side by side: one quantity in every cell, mode against mode.

use lab::plot::drawing::{Anchor, Colour, Drawing, Frame, GREY, GRID, INK, LIMIT, plain, ticks};

use super::colour;
use crate::grid::Grid;
use crate::outcome::Measures;
use crate::results::Results;
use lab::procedure::Mode;

const LEFT: f64 = 96.0;
const TOP: f64 = 128.0;
const HEIGHT: f64 = 210.0;
const GAP: f64 = 84.0;
const LEAST_WIDTH: f64 = 620.0;
/// Width of one bar, px.
const BAR: f64 = 13.0;
/// White between two groups, px.
const BETWEEN: f64 = 14.0;

/// One diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The quantity shown, with its unit.
    pub title: String,
    /// Groups of bars: a label, and the value of each member if it has one.
    pub groups: Vec<(String, Vec<Option<f64>>)>,
    /// A limit, and what it is called.
    pub limit: Option<(f64, String)>,
}

/// A quantity in every cell, averaged over the seeds.
pub fn by_cell(
    results: &Results,
    grid: &Grid,
    modes: &[Mode],
    title: String,
    value: impl Fn(&Measures) -> f64,
    limit: Option<(f64, String)>,
) -> Panel {
    let mean = |mode: Mode, index: usize| {
        // An arm that stopped did not do the rest: a bar of it would show that as done gently.
        let reports = results.of(mode).filter(|report| report.key.index == index && !report.is_stopped());
        let values: Vec<f64> = reports.map(|report| value(&report.measures)).collect();
        (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
    };
    let groups = grid
        .cells
        .iter()
        .enumerate()
        .map(|(index, cell)| (cell.to_string(), modes.iter().map(|mode| mean(*mode, index)).collect()));
    Panel { title, groups: groups.collect(), limit }
}

/// The names and colours of modes as members of the groups.
pub fn members(modes: &[Mode]) -> Vec<(String, Colour)> {
    modes.iter().map(|mode| (format!("({mode}) {}", mode.title()), colour(*mode))).collect()
}

/// Diagrams below each other; `members` names the bars of a group, `below` what the groups are.
pub fn draw(panels: &[Panel], members: &[(String, Colour)], title: &str, below: &str) -> Drawing {
    let groups = panels.iter().map(|panel| panel.groups.len()).max().unwrap_or(0).max(1);
    let group = members.len().max(1) as f64 * BAR + BETWEEN;
    let width = (groups as f64 * group).max(LEAST_WIDTH);
    let height = TOP + panels.len() as f64 * (HEIGHT + GAP) + 2.0;
    let legend: f64 = members.iter().map(|(name, _)| legend_width(name)).sum();
    let mut drawing = Drawing::new(LEFT + width.max(legend).max(13.5 * title.len() as f64) + 40.0, height);
    drawing.text([LEFT, 46.0], title, 26, Anchor::Start, INK);
    let mut x = LEFT;
    for (name, colour) in members {
        drawing.rectangle([x, 66.0], [18.0, 18.0], colour);
        drawing.text([x + 26.0, 81.0], name.clone(), 16, Anchor::Start, INK);
        x += legend_width(name);
    }
    for (row, panel) in panels.iter().enumerate() {
        let largest = panel.groups.iter().flat_map(|(_, values)| values.iter().flatten().copied());
        let largest = largest.chain(panel.limit.iter().map(|(limit, _)| *limit)).fold(0.0, f64::max);
        let frame = Frame {
            corner: [LEFT, TOP + row as f64 * (HEIGHT + GAP)],
            size: [width, HEIGHT],
            x: [0.0, groups as f64],
            y: [0.0, 1.08 * largest.max(1e-6)],
        };
        draw_panel(&mut drawing, &frame, panel, members);
    }
    drawing.text([LEFT + width / 2.0, height - 20.0], below, 16, Anchor::Middle, INK);
    drawing
}

fn legend_width(name: &str) -> f64 {
    26.0 + 8.8 * name.len() as f64 + 34.0
}

fn draw_panel(drawing: &mut Drawing, frame: &Frame, panel: &Panel, members: &[(String, Colour)]) {
    let [left, top] = frame.corner;
    drawing.text([left, top - 12.0], panel.title.clone(), 17, Anchor::Start, INK);
    for tick in ticks(frame.y, 4) {
        let [_, y] = frame.at([0.0, tick]);
        drawing.line(&[[left, y], [frame.right(), y]], GRID, 1.0);
        drawing.text([left - 8.0, y + 5.0], plain(tick), 15, Anchor::End, GREY);
    }
    let slot = frame.size[0] / frame.x[1];
    let bar = ((slot - BETWEEN) / members.len().max(1) as f64).min(3.0 * BAR);
    // Labels of narrow groups read upwards.
    let wide = panel.groups.iter().all(|(label, _)| 8.0 * label.len() as f64 <= slot);
    for (index, (label, values)) in panel.groups.iter().enumerate() {
        let middle = left + (index as f64 + 0.5) * slot;
        let first = middle - 0.5 * bar * values.len() as f64;
        for (member, (value, (_, colour))) in values.iter().zip(members).enumerate() {
            let Some(value) = value else { continue };
            let [_, y] = frame.at([0.0, *value]);
            drawing.rectangle([first + member as f64 * bar + 0.5, y], [bar - 1.0, frame.bottom() - y], colour);
        }
        if wide {
            drawing.text([middle, frame.bottom() + 20.0], label.clone(), 14, Anchor::Middle, GREY);
        } else {
            drawing.upward_text([middle + 4.0, frame.bottom() + 28.0], label.clone(), 12, GREY);
        }
    }
    if let Some((limit, words)) = &panel.limit {
        let [_, y] = frame.at([0.0, *limit]);
        drawing.dashed(&[[left, y], [frame.right(), y]], LIMIT, 1.6, [6.0, 4.0]);
        // Above the title, where neither a bar nor the title stands in its way.
        drawing.text([frame.right(), top - 30.0], format!("dashed: {words}"), 14, Anchor::End, INK);
    }
    frame.axes(drawing);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;

    #[test]
    fn every_cell_has_a_bar_of_each_mode_and_the_limit_is_in_the_picture() {
        let results = fixtures::results(&[1, 2]);
        let modes = [Mode::OpenLoop, Mode::Adaptive];
        let limit = Some((2.0, "tips over".to_owned()));
        let panel = by_cell(&results, &Grid::paper(), &modes, "force, N".to_owned(), |m| m.contact_peak_n, limit);
        assert_eq!(panel.groups.len(), 48);
        assert!(panel.groups.iter().all(|(_, values)| values.iter().all(Option::is_some)));
        let svg = draw(&[panel], &members(&modes), "Torch", "cell").to_svg();
        assert!(svg.contains("tips over") && svg.contains("force, N") && svg.contains("(c) force control"));
        assert!(svg.matches("<rect").count() >= 2 * 48);
    }

    #[test]
    fn a_cell_in_which_every_arm_stopped_has_no_bar() {
        let mut results = fixtures::results(&[1, 2]);
        for report in results.reports.iter_mut().filter(|report| report.key.index == 3) {
            report.outcome = Outcome::Stopped("JointSpeed".to_owned());
            report.measures = Measures::default();
        }
        let modes = [Mode::OpenLoop, Mode::Adaptive];
        let panel = by_cell(&results, &Grid::paper(), &modes, "force, N".to_owned(), |m| m.contact_peak_n, None);
        assert_eq!(panel.groups[3].1, [None, None]);
        assert!(panel.groups[4].1.iter().all(Option::is_some));
    }
}
