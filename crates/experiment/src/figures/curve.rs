//! Cells held against the factor that was swept, mode by mode, each with its interval.

use lab::plot::drawing::{Anchor, Drawing, Frame, GREY, INK};

use super::colour;
use crate::sweep::Point;

const CORNER: [f64; 2] = [84.0, 96.0];
const SIZE: [f64; 2] = [620.0, 340.0];

/// The curve of a sweep over `name`; `title` says what was grasped.
pub fn draw(points: &[Point], name: &str, title: &str) -> Drawing {
    let values: Vec<f64> = points.iter().filter_map(|point| point.value).collect();
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let cells = points.iter().map(|point| point.cells).max().unwrap_or(1);
    let margin = 0.03 * (high - low).max(1e-9);
    let frame = Frame { corner: CORNER, size: SIZE, x: [low - margin, high + margin], y: [0.0, 1.04 * cells as f64] };
    let mut drawing = Drawing::new(frame.right() + 40.0, frame.bottom() + 70.0);
    drawing.text([CORNER[0], 40.0], title, 24, Anchor::Start, INK);
    frame.grid(&mut drawing, 15, [6, 6]);
    let mut x = CORNER[0];
    for (mode, _) in points.first().map(|point| point.held.as_slice()).unwrap_or_default() {
        let colour = colour(*mode);
        let held = || points.iter().filter_map(|point| Some((point.value?, point.interval(*mode)?)));
        for (value, interval) in held() {
            drawing.line(&[frame.at([value, interval.low]), frame.at([value, interval.high])], colour, 5.0);
            drawing.circle(frame.at([value, interval.mean]), 5.0, Some(colour), None);
        }
        drawing.line(&frame.curve(held().map(|(value, interval)| [value, interval.mean])), colour, 2.0);
        let words = format!("({mode}) {}", mode.title());
        drawing.circle([x + 8.0, 68.0], 6.0, Some(colour), None);
        drawing.text([x + 22.0, 73.0], words.clone(), 15, Anchor::Start, INK);
        x += 50.0 + 8.2 * words.len() as f64;
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
    use lab::procedure::Mode;

    #[test]
    fn every_value_has_its_mark_and_its_bar() {
        let point = |value: f64, held: usize| Point {
            value: Some(value),
            cells: 48,
            held: vec![(Mode::OpenLoop, vec![vec![9, 12]]), (Mode::Adaptive, vec![vec![held, held + 2]])],
        };
        let points = [point(1.0, 46), point(0.5, 40), point(0.0, 20)];
        let svg = draw(&points, "joint-friction", "Torch: what it stands").to_svg();
        assert_eq!(svg.matches("<circle").count(), 2 * (3 + 1));
        assert!(svg.contains("joint-friction") && svg.contains("held of 48"));
    }
}
