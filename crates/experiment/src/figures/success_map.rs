//! Where the object could stand and was still grasped: the paper's figure 5, with three regions.

use lab::plot::drawing::{Anchor, Colour, Drawing, Frame, GREY, INK, PALE, plain};

use super::colour;
use crate::grid::{Cell, Grid};
use crate::map::short;
use crate::results::Results;
use lab::procedure::Mode;

/// Pixels per millimetre of the grid.
const SCALE: f64 = 2.75;
/// White between two cells, px.
const GAP: f64 = 3.0;
const LEFT: f64 = 150.0;
const TOP: f64 = 110.0;
const LEGEND: f64 = 470.0;
/// Least width of the axes, px: what stands below them shall not reach into the legend.
const LEAST_WIDTH: f64 = 300.0;
/// Space that a number along an axis takes, px.
const LABEL: [f64; 2] = [46.0, 20.0];

/// The map of an experiment; `title` says what was grasped, `radius` is the object's, m.
///
/// A cell is filled by the simplest mode that held the object there; where the seeds differ it is divided in their
/// proportion.
pub fn draw(results: &Results, grid: &Grid, title: &str, radius: f64) -> Drawing {
    let (columns, rows) = (grid.columns(), grid.rows());
    let pitch =
        if columns.len() * rows.len() == grid.cells.len() { [pitch(&columns), pitch(&rows)] } else { [apart(grid); 2] };
    // The place where the primitive expects the object belongs to the picture, whether or not a cell is there.
    let range = |values: &[i32], pitch: f64, least: f64| {
        let (low, high) = values.iter().fold((0, 0), |(low, high), &v| (low.min(v), high.max(v)));
        let around = radius * 1e3 + GAP;
        let (low, high) = ((f64::from(low) - 0.5 * pitch).min(-around), (f64::from(high) + 0.5 * pitch).max(around));
        let more = 0.5 * (least - (high - low)).max(0.0);
        [low - more, high + more]
    };
    let (x, y) = (range(&columns, pitch[0], LEAST_WIDTH / SCALE), range(&rows, pitch[1], 0.0));
    let size = [(x[1] - x[0]) * SCALE, (y[1] - y[0]) * SCALE];
    let frame = Frame { corner: [LEFT, TOP], size, x, y };
    let mut drawing = Drawing::new(LEFT + size[0] + LEGEND, (TOP + size[1] + 90.0).max(TOP + 350.0));
    drawing.text([LEFT, 48.0], title, 26, Anchor::Start, INK);
    let several = |count: usize, what: &str| format!("{count} {what}{}", if count == 1 { "" } else { "s" });
    let tried = format!(
        "{}, {}, {}",
        several(results.cells(None), "position"),
        several(results.modes().len(), "mode"),
        several(results.seeds().len(), "seed")
    );
    drawing.text([LEFT, 78.0], tried, 16, Anchor::Start, GREY);
    for (index, cell) in grid.cells.iter().enumerate() {
        let middle = frame.at([f64::from(cell.along_mm), f64::from(cell.sideways_mm)]);
        let side = pitch.map(|pitch| (pitch * SCALE - GAP).max(1.0));
        let mut left = middle[0] - side[0] / 2.0;
        for (share, fill) in parts(results, index) {
            drawing.rectangle([left, middle[1] - side[1] / 2.0], [share * side[0], side[1]], fill);
            left += share * side[0];
        }
    }
    axis_labels(&mut drawing, &frame, &columns, &rows);
    goal(&mut drawing, &frame, radius);
    let arrow = frame.at([frame.x[0], 0.0]);
    drawing.arrow([arrow[0] - 112.0, arrow[1]], [arrow[0] - 62.0, arrow[1]], INK, 4.0);
    legend(&mut drawing, results, [frame.right() + 44.0, TOP + 6.0]);
    drawing
}

/// Largest side of a cell, mm: where cells are farther apart, nothing is known of what is between them.
const LARGEST: i32 = 40;

/// Distance between neighbouring columns or rows, mm.
fn pitch(values: &[i32]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs());
    f64::from(steps.min().unwrap_or(LARGEST).min(LARGEST))
}

/// Side of the largest squares about cells that lie anywhere, as those of a turned grid, in which none covers another,
/// mm.
fn apart(grid: &Grid) -> f64 {
    let distance = |a: &Cell, b: &Cell| (a.along_mm - b.along_mm).abs().max((a.sideways_mm - b.sideways_mm).abs());
    let cells = grid.cells.iter().enumerate();
    let pairs = cells.flat_map(|(index, a)| grid.cells[..index].iter().map(move |b| distance(a, b)));
    f64::from(pairs.min().unwrap_or(LARGEST).min(LARGEST))
}

/// Shares of a cell by the simplest mode that holds there, seed by seed, and what no mode holds; nothing of a cell that
/// was not tried.
fn parts(results: &Results, index: usize) -> Vec<(f64, Colour)> {
    let held = |mode: Mode, seed: u64| {
        let mut reports = results.of(mode).filter(|report| (report.key.index, report.key.seed) == (index, seed));
        reports.next().map(|report| report.outcome.is_success())
    };
    let modes = results.modes();
    // Of each seed with which it was tried, the simplest mode that held.
    let simplest: Vec<Option<Mode>> = results
        .seeds()
        .into_iter()
        .filter(|&seed| modes.iter().any(|&mode| held(mode, seed).is_some()))
        .map(|seed| modes.iter().copied().find(|&mode| held(mode, seed) == Some(true)))
        .collect();
    let share = |of: Option<Mode>| {
        let count = simplest.iter().filter(|mode| **mode == of).count();
        (count > 0).then(|| (count as f64 / simplest.len() as f64, of.map_or(PALE, colour)))
    };
    modes.iter().copied().map(Some).chain([None]).filter_map(share).collect()
}

/// Values with their places, without those that stand less than `room` px behind the one before.
fn spread(values: &[i32], room: f64, place: impl Fn(f64) -> f64) -> Vec<(i32, f64)> {
    let mut kept: Vec<(i32, f64)> = Vec::new();
    for &value in values {
        let at = place(f64::from(value));
        if kept.last().is_none_or(|(_, last)| (at - last).abs() >= room) {
            kept.push((value, at));
        }
    }
    kept
}

fn axis_labels(drawing: &mut Drawing, frame: &Frame, columns: &[i32], rows: &[i32]) {
    let cm = |millimetres: i32| plain(f64::from(millimetres) * 0.1);
    for (column, x) in spread(columns, LABEL[0], |column| frame.at([column, 0.0])[0]) {
        drawing.text([x, frame.bottom() + 24.0], cm(column), 16, Anchor::Middle, GREY);
    }
    for (row, y) in spread(rows, LABEL[1], |row| frame.at([0.0, row])[1]) {
        drawing.text([frame.corner[0] - 10.0, y + 6.0], cm(row), 16, Anchor::End, GREY);
    }
    let middle = frame.corner[0] + frame.size[0] / 2.0;
    drawing.text([middle, frame.bottom() + 54.0], "object along the approach, cm", 17, Anchor::Middle, INK);
    drawing.upward_text([26.0, frame.corner[1] + frame.size[1] / 2.0], "object sideways, cm", 17, INK);
}

/// The object where the primitive expects it.
fn goal(drawing: &mut Drawing, frame: &Frame, radius: f64) {
    let at = frame.at([0.0, 0.0]);
    drawing.circle(at, radius * 1e3 * SCALE, None, Some(("#ffffff", 5.0)));
    drawing.circle(at, radius * 1e3 * SCALE, None, Some((INK, 2.2)));
    drawing.circle(at, 4.0, Some(INK), None);
}

fn legend(drawing: &mut Drawing, results: &Results, [x, top]: [f64; 2]) {
    let text = x + 40.0;
    let mut y = top;
    drawing.text([x, y + 16.0], "held after lifting by 10 cm for 2 s", 17, Anchor::Start, INK);
    y += 38.0;
    // Where one mode alone was tried nobody knows what the others do.
    let modes = results.modes();
    let is_alone = modes.len() == 1;
    for mode in modes {
        drawing.rectangle([x, y], [28.0, 28.0], colour(mode));
        let words = match mode {
            Mode::Track => "with stiff position control",
            Mode::OpenLoop if is_alone => "in open loop",
            Mode::OpenLoop => "already in open loop",
            Mode::ForceControl => "with force control",
            Mode::Adaptive if is_alone => "with adaptation of the movement",
            Mode::Adaptive => "only with adaptation of the movement",
            Mode::RigidFingers if is_alone => "if the fingers do not adapt",
            Mode::RigidFingers => "only if the fingers do not adapt",
        };
        drawing.text([text, y + 13.0], words, 16, Anchor::Start, INK);
        let count = format!("this mode: {} of {}", short(results.success_count(mode)), results.cells(Some(mode)));
        drawing.text([text, y + 32.0], count, 15, Anchor::Start, GREY);
        y += 54.0;
    }
    drawing.rectangle([x, y], [28.0, 28.0], PALE);
    let none = if is_alone { "not held" } else { "in no mode" };
    drawing.text([text, y + 19.0], none, 16, Anchor::Start, INK);
    y += 50.0;
    drawing.circle([x + 14.0, y + 8.0], 14.0, None, Some((INK, 2.2)));
    drawing.circle([x + 14.0, y + 8.0], 3.5, Some(INK), None);
    drawing.text([text, y + 14.0], "where the primitive expects the object", 16, Anchor::Start, INK);
    y += 40.0;
    drawing.arrow([x - 2.0, y + 8.0], [x + 30.0, y + 8.0], INK, 3.0);
    drawing.text([text, y + 14.0], "direction in which the hand arrives", 16, Anchor::Start, INK);
    if results.seeds().len() > 1 {
        drawing.text([x, y + 50.0], "Where seeds differ a cell is divided in proportion.", 14, Anchor::Start, GREY);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;

    #[test]
    fn a_cell_goes_to_the_simplest_mode_and_is_divided_where_seeds_differ() {
        let mut results = fixtures::results(&[1, 2]);
        for report in results.reports.iter_mut().filter(|report| report.key.index == 5) {
            let held = match report.key.mode {
                Mode::Track | Mode::OpenLoop => false,
                Mode::ForceControl => report.key.seed == 1,
                Mode::Adaptive | Mode::RigidFingers => true,
            };
            report.outcome = if held { Outcome::Held } else { Outcome::Missed };
        }
        assert_eq!(parts(&results, 5), [(0.5, colour(Mode::ForceControl)), (0.5, colour(Mode::Adaptive))]);
        for report in results.reports.iter_mut().filter(|report| report.key.index == 7) {
            report.outcome = Outcome::Missed;
        }
        assert_eq!(parts(&results, 7), [(1.0, PALE)]);
        assert_eq!(parts(&results, 999), [], "nobody tried it: it is not shown as one that failed");
    }

    /// The change that makes it fail: one legend, whatever was tried.
    #[test]
    fn of_one_mode_alone_nothing_is_said_of_the_others() {
        let mut results = fixtures::results(&[1]);
        results.reports.retain(|report| report.key.mode == Mode::Adaptive);
        let svg = draw(&results, &Grid::paper(), "Torch", 0.03).to_svg();
        assert!(
            !svg.contains("only with") && svg.contains(">with adaptation of the movement<"),
            "nobody tried without"
        );
        assert!(svg.contains(">not held<") && !svg.contains("in no mode") && svg.contains("1 mode, 1 seed"));
    }

    /// The change that makes it fail: the shares of the modes, which are not those of the seeds they belong to.
    #[test]
    fn a_cell_that_one_mode_or_another_held_with_every_seed_is_not_in_no_mode() {
        let mut results = fixtures::results(&[1, 2, 3, 4]);
        for report in results.reports.iter_mut().filter(|report| report.key.index == 5) {
            let held = match report.key.mode {
                Mode::OpenLoop => report.key.seed == 1,
                Mode::Adaptive => report.key.seed == 2 || report.key.seed == 3,
                _ => false,
            };
            report.outcome = if held { Outcome::Held } else { Outcome::Missed };
        }
        let expected = [(0.25, colour(Mode::OpenLoop)), (0.5, colour(Mode::Adaptive)), (0.25, PALE)];
        assert_eq!(parts(&results, 5), expected);
    }

    /// An attribute of every element of a kind, and the text in it.
    fn attributes(svg: &str, element: &str, name: &str) -> Vec<(f64, String)> {
        let of = |text: &str| {
            let value = text.split_once(&format!(" {name}=\""))?.1.split_once('"')?.0.parse().ok()?;
            Some((value, text.split_once('>')?.1.split_once('<')?.0.to_owned()))
        };
        svg.split(&format!("<{element}")).skip(1).filter_map(of).collect()
    }

    #[test]
    fn grids_that_are_turned_fine_or_far_away_give_cells_labels_and_the_goal_their_places() {
        let results = fixtures::results(&[1]);
        let turned = Grid::paper().moved(30.0, [0.01, 0.0]);
        let far: Grid = "-24:8,-20:8".parse().unwrap();
        for grid in [Grid::paper(), turned, far, Grid::spread(64, 64).unwrap()] {
            let svg = draw(&results, &grid, "Torch", 0.028).to_inline_svg();
            for side in ["width", "height"] {
                let sides = attributes(&svg, "rect", side);
                assert!(sides.iter().all(|(side, _)| *side > 0.0), "{side} of {} cells: {sides:?}", grid.cells.len());
            }
            // The circle of the goal stands left of the legend.
            let legend = attributes(&svg, "text", "x").into_iter().find(|(_, text)| text.starts_with("held after"));
            let legend = legend.unwrap().0;
            let goal = attributes(&svg, "circle", "cx")[0].0;
            assert!(goal + 0.028e3 * SCALE < legend, "{goal} beside a legend at {legend}");
            let below = attributes(&svg, "text", "x").into_iter().find(|(_, text)| text.starts_with("object along"));
            assert!(below.unwrap().0 + 0.28 * 17.0 * 29.0 < legend, "what stands below the axis meets the legend");
            // No number stands on another.
            let numbers = attributes(&svg, "text", "x").into_iter().zip(attributes(&svg, "text", "y"));
            let numbers: Vec<_> =
                numbers.filter(|((_, text), _)| text.replace('\u{2212}', "-").parse::<f64>().is_ok()).collect();
            for (index, ((x, text), (y, _))) in numbers.iter().enumerate() {
                for ((other_x, other), (other_y, _)) in &numbers[..index] {
                    let is_clear = (x - other_x).abs() >= 40.0 || (y - other_y).abs() >= 16.0;
                    assert!(is_clear, "{text} and {other} of {} cells", grid.cells.len());
                }
            }
        }
    }

    #[test]
    fn the_map_is_a_picture() {
        let svg = draw(&fixtures::results(&[1, 2]), &Grid::paper(), "Torch", 0.028).to_svg();
        assert!(svg.contains("object along the approach, cm") && svg.contains("of 48"));
    }
}
