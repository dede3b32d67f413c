//! The ways of the hand seen from above, with the objects it met.

use lab::plot::drawing::{Anchor, Drawing, Frame, GREY, INK};

use super::colour;
use crate::grid::{ApproachFrame, Grid};
use crate::results::{Report, Results};

/// Pixels per metre.
const SCALE: f64 = 1150.0;
const LEFT: f64 = 90.0;
const TOP: f64 = 130.0;
const PANEL_GAP: f64 = 70.0;
/// Width of a letter of the caption, px.
const CAPTION_LETTER: f64 = 9.0;
/// Ways whose object was not held.
const FAINT: &str = "#bbbbbb";

/// One panel for each mode, in the frame of the approach; the first seed of the experiment. `radius` is the object's,
/// m; `taught` the way of the primitive without feedback, world x and y, m.
pub fn draw(
    results: &Results,
    grid: &Grid,
    frame: &ApproachFrame,
    taught: &[[f64; 2]],
    title: &str,
    radius: f64,
) -> Drawing {
    let seed = results.seeds().first().copied();
    let modes = results.modes();
    let local = |points: &[[f64; 2]]| points.iter().map(|point| frame.local(*point)).collect::<Vec<_>>();
    let taught = local(taught);
    let shown: Vec<&Report> = results.reports.iter().filter(|report| Some(report.key.seed) == seed).collect();
    let mut points: Vec<[f64; 2]> = grid.cells.iter().map(|cell| [cell.along(), cell.sideways()]).collect();
    points.extend(&taught);
    points.extend(shown.iter().flat_map(|report| local(&report.path.measured)));
    let range = |axis: usize| {
        let values = points.iter().map(|point| point[axis]).filter(|value| value.is_finite());
        let (low, high) = values.fold((-0.05_f64, 0.05_f64), |(low, high), value| (low.min(value), high.max(value)));
        // Whatever a trial did, the picture shows the surroundings of the grid.
        [(low - 0.05).max(-0.7), (high + 0.05).min(0.4)]
    };
    let (x, y) = (range(0), range(1));
    let size = [(x[1] - x[0]) * SCALE * 0.6, (y[1] - y[0]) * SCALE * 0.6];
    let caption = "from above, the arm on the left; colour: ways that ended with the object held, discs: objects held, crosses: not held, dashed: as taught";
    let panels = modes.len() as f64 * (size[0] + PANEL_GAP);
    // The caption is wider than the panels of one or two modes.
    let width = LEFT + panels.max(CAPTION_LETTER * caption.len() as f64);
    let mut drawing = Drawing::new(width, TOP + size[1] + 100.0);
    drawing.text([LEFT, 48.0], title, 26, Anchor::Start, INK);
    drawing.text([LEFT, 78.0], caption, 16, Anchor::Start, GREY);
    for (column, mode) in modes.iter().enumerate() {
        let corner = [LEFT + column as f64 * (size[0] + PANEL_GAP), TOP];
        let panel = Frame { corner, size, x: x.map(|x| x * 100.0), y: y.map(|y| y * 100.0) };
        let at = |point: [f64; 2]| point.map(|value| value * 100.0);
        panel.grid(&mut drawing, 15, [6, 5]);
        let reports = || shown.iter().filter(|report| report.key.mode == *mode);
        let (held, lost): (Vec<&&Report>, Vec<&&Report>) = reports().partition(|report| report.outcome.is_success());
        for report in lost.iter().chain(&held) {
            let colour = if report.outcome.is_success() { colour(*mode) } else { FAINT };
            let way = panel.curve(local(&report.path.measured).into_iter().map(at));
            drawing.line(&way, colour, 1.3);
        }
        for report in reports() {
            let place = panel.at(at([report.key.cell.along(), report.key.cell.sideways()]));
            if report.outcome.is_success() {
                let size = radius * SCALE * 0.6 * 0.45;
                drawing.circle(place, size, Some(colour(*mode)), Some(("#ffffff", 1.5)));
            } else {
                drawing.cross(place, 5.0, GREY, 1.8);
            }
        }
        let way = panel.curve(taught.iter().copied().map(at));
        drawing.line(&way, "#ffffff", 5.0);
        drawing.dashed(&way, INK, 2.6, [9.0, 5.0]);
        drawing.circle(panel.at([0.0, 0.0]), 5.0, Some(INK), Some(("#ffffff", 1.5)));
        panel.axes(&mut drawing);
        let count = format!("({mode}) {}: {} of {}", mode.title(), held.len(), held.len() + lost.len());
        drawing.text([corner[0], TOP - 14.0], count, 17, Anchor::Start, colour(*mode));
        let middle = corner[0] + size[0] / 2.0;
        drawing.text([middle, panel.bottom() + 52.0], "along the approach, cm", 16, Anchor::Middle, INK);
    }
    drawing.upward_text([30.0, TOP + size[1] / 2.0], "sideways, cm", 16, INK);
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;

    #[test]
    fn the_caption_of_a_single_mode_is_not_cut() {
        let mut results = fixtures::results(&[1]);
        results.reports.retain(|report| report.key.mode == lab::procedure::Mode::Adaptive);
        let svg = draw(&results, &Grid::paper(), &fixtures::frame(), &[], "Torch", 0.028).to_inline_svg();
        let width: f64 = svg.split_once("viewBox=\"0 0 ").unwrap().1.split_once(' ').unwrap().0.parse().unwrap();
        let caption = svg.split('>').find_map(|text| text.strip_prefix("from above")).unwrap();
        let letters = "from above".len() + caption.split_once('<').unwrap().0.len();
        assert!(width >= LEFT + 0.56 * 16.0 * letters as f64, "{letters} letters on {width} px");
    }

    #[test]
    fn every_mode_has_its_panel() {
        let results = fixtures::results(&[1, 2]);
        let taught = results.reports[0].path.planned.clone();
        let svg = draw(&results, &Grid::paper(), &fixtures::frame(), &taught, "Torch", 0.028).to_svg();
        for words in
            ["(a) open loop: 8 of 48", "(b) force control: 18 of 48", "(c) force control and adaptation: 47 of 48"]
        {
            assert!(svg.contains(words), "{words}");
        }
    }
}
