//! Cells held against the factor that was swept, mode by mode, each with its interval.

use lab::plot::drawing::{Anchor, Drawing, Frame, GREY, INK};

use super::colour;
use crate::sweep::Point;
use lab::procedure::Mode;

const CORNER: [f64; 2] = [84.0, 96.0];
const SIZE: [f64; 2] = [620.0, 340.0];

/// Width of a letter of the title, px.
const TITLE_LETTER: f64 = 13.5;

/// Width of a mode in the legend, px.
fn legend_width(words: &str) -> f64 {
    50.0 + 8.2 * words.len() as f64
}

/// The curve of a sweep over `name`; `title` says what was grasped.
pub fn draw(points: &[Point], name: &str, title: &str) -> Drawing {
    let values: Vec<f64> = points.iter().filter_map(|point| point.value).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let cells = points.iter().map(|point| point.cells).max().unwrap_or(1);
    let margin = 0.03 * (high - low).max(1e-9);
    let frame = Frame { corner: CORNER, size: SIZE, x: [low - margin, high + margin], y: [0.0, 1.04 * cells as f64] };
    let modes = points.first().map(|point| point.held.as_slice()).unwrap_or_default();
    let words = |mode: Mode| format!("({mode}) {}", mode.title());
    let legend: f64 = modes.iter().map(|(mode, _)| legend_width(&words(*mode))).sum();
    let width = (SIZE[0] + 40.0).max(legend).max(TITLE_LETTER * title.chars().count() as f64);
    let mut drawing = Drawing::new(CORNER[0] + width, frame.bottom() + 70.0);
    drawing.text([CORNER[0], 40.0], title, 24, Anchor::Start, INK);
    frame.grid(&mut drawing, 15, [6, 6]);
    let mut x = CORNER[0];
    for (mode, _) in modes {
        let colour = colour(*mode);
        let held = || points.iter().filter_map(|point| Some((point.value?, point.interval(*mode)?)));
        for (value, interval) in held() {
            drawing.line(&[frame.at([value, interval.low]), frame.at([value, interval.high])], colour, 5.0);
            drawing.circle(frame.at([value, interval.mean]), 5.0, Some(colour), None);
        }
        drawing.line(&frame.curve(held().map(|(value, interval)| [value, interval.mean])), colour, 2.0);
        let words = words(*mode);
        drawing.circle([x + 8.0, 68.0], 6.0, Some(colour), None);
        drawing.text([x + 22.0, 73.0], words.clone(), 15, Anchor::Start, INK);
        x += legend_width(&words);
    }
    frame.axes(&mut drawing);
    let middle = CORNER[0] + SIZE[0] / 2.0;
    drawing.text([middle, frame.bottom() + 52.0], name, 16, Anchor::Middle, INK);
    let words = format!("held of {cells}; bars: 95 %");
    drawing.text([frame.right(), frame.bottom() + 52.0], words, 14, Anchor::End, GREY);
    drawing
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_value_has_its_mark_and_its_bar() {
        let point = |value: f64, held: usize| {
            Point::with(value, vec![(Mode::OpenLoop, vec![vec![9, 12]]), (Mode::Adaptive, vec![vec![held, held + 2]])])
        };
        let points = [point(1.0, 46), point(0.5, 40), point(0.0, 20)];
        let svg = draw(&points, "joint-friction", "Torch: what it stands").to_svg();
        assert_eq!(svg.matches("<circle").count(), 2 * (3 + 1));
        assert!(svg.contains("joint-friction") && svg.contains("held of 48"));
    }

    #[test]
    fn the_names_of_all_modes_stay_on_the_page() {
        let modes = [Mode::OpenLoop, Mode::ForceControl, Mode::Adaptive, Mode::RigidFingers];
        let held = modes.map(|mode| (mode, vec![vec![9, 12]])).to_vec();
        let points = [1.0, 0.5].map(|value| Point::with(value, held.clone()));
        let svg = draw(&points, "joint-friction", "Torch").to_inline_svg();
        let width: f64 = svg.split_once("viewBox=\"0 0 ").unwrap().1.split_once(' ').unwrap().0.parse().unwrap();
        let last = svg.split("<text ").find(|text| text.contains("(d) ")).unwrap();
        let x: f64 = last.split_once("x=\"").unwrap().1.split_once('"').unwrap().0.parse().unwrap();
        let letters = format!("(d) {}", Mode::RigidFingers.title()).len();
        assert!(x + 0.56 * 15.0 * letters as f64 <= width, "a name that begins at {x} on {width} px");
    }
}
