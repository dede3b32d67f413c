//! The force on the object before the fingers closed, against the force that tips it over.

use lab::plot::drawing::{Anchor, Drawing, Frame, GREY, GRID, INK, LIMIT, plain, ticks};

use super::colour;
use crate::results::Results;

/// Bars over the whole range.
const BINS: usize = 40;
const LEFT: f64 = 110.0;
const WIDTH: f64 = 780.0;
const ROW: f64 = 150.0;
const ROW_GAP: f64 = 26.0;
const TOP: f64 = 110.0;

/// A histogram for each mode above one common axis; `tipping` is the horizontal force that tips the object over, N.
pub fn draw(results: &Results, title: &str, tipping: Option<f64>) -> Drawing {
    let modes = results.modes();
    let values: Vec<Vec<f64>> = modes
        .iter()
        .map(|mode| {
            // What an arm that stopped did not do any more is not gentle: it has no force that could be counted.
            let went_on = results.of(*mode).filter(|report| !report.is_stopped());
            went_on.map(|report| report.measures.contact_sustained_n).collect()
        })
        .collect();
    let largest = values.iter().flatten().copied().chain(tipping).fold(0.1, f64::max);
    // The axis ends at a round number of newtons that leaves the largest bar inside.
    let step = ticks([0.0, largest * 1.05], 8).get(1).copied().unwrap_or(1.0);
    let high = (largest * 1.05 / step).ceil() * step;
    let height = TOP + modes.len() as f64 * (ROW + ROW_GAP) + 60.0;
    let mut drawing = Drawing::new(LEFT + WIDTH + 330.0, height);
    drawing.text([LEFT, 48.0], title, 26, Anchor::Start, INK);
    let caption = "largest horizontal force on the object before the fingers close, mean over 100 ms";
    drawing.text([LEFT, 78.0], caption, 16, Anchor::Start, GREY);
    for (row, (mode, values)) in modes.iter().zip(&values).enumerate() {
        let corner = [LEFT, TOP + row as f64 * (ROW + ROW_GAP)];
        let counts = counts(values, high);
        let most = counts.iter().copied().fold(0.0, f64::max).max(1.0);
        let frame = Frame { corner, size: [WIDTH, ROW], x: [0.0, high], y: [0.0, most * 1.15] };
        let last = row + 1 == modes.len();
        for tick in ticks(frame.x, 10) {
            let [x, _] = frame.at([tick, 0.0]);
            drawing.line(&[[x, corner[1]], [x, frame.bottom()]], GRID, 1.0);
            if last {
                drawing.text([x, frame.bottom() + 24.0], plain(tick), 16, Anchor::Middle, GREY);
            }
        }
        for (bin, count) in counts.iter().enumerate().filter(|(_, count)| **count > 0.0) {
            let edge = |bin: usize| bin as f64 * high / BINS as f64;
            let (from, to) = (frame.at([edge(bin), *count]), frame.at([edge(bin + 1), 0.0]));
            drawing.rectangle([from[0] + 1.0, from[1]], [to[0] - from[0] - 2.0, to[1] - from[1]], colour(*mode));
        }
        if let Some(tipping) = tipping {
            let [x, _] = frame.at([tipping, 0.0]);
            drawing.dashed(&[[x, corner[1] - 6.0], [x, frame.bottom()]], LIMIT, 1.6, [6.0, 4.0]);
            if row == 0 {
                let words = format!("tips over at {tipping:.1} N");
                let (at, anchor) =
                    if x > LEFT + 0.7 * WIDTH { (x - 8.0, Anchor::End) } else { (x + 8.0, Anchor::Start) };
                drawing.text([at, corner[1] + 8.0], words, 15, anchor, INK);
            }
        }
        frame.axes(&mut drawing);
        let side = frame.right() + 24.0;
        drawing.text([side, corner[1] + 36.0], format!("({mode}) {}", mode.title()), 17, Anchor::Start, colour(*mode));
        let below = tipping.map(|tipping| values.iter().filter(|value| **value < tipping).count());
        let trials = results.of(*mode).count();
        let words = match below {
            Some(below) => format!("{below} of {trials} trials stay below"),
            None => format!("{trials} trials"),
        };
        drawing.text([side, corner[1] + 62.0], words, 16, Anchor::Start, GREY);
        let [_, tallest] = frame.at([0.0, most]);
        drawing.text([LEFT - 12.0, tallest + 5.0], plain(most), 15, Anchor::End, GREY);
        drawing.text([LEFT - 12.0, frame.bottom() + 5.0], "0", 15, Anchor::End, GREY);
    }
    drawing.text([LEFT + WIDTH / 2.0, height - 22.0], "force, N", 17, Anchor::Middle, INK);
    drawing.upward_text([36.0, TOP + (height - TOP - 60.0) / 2.0], "trials", 17, INK);
    drawing
}

/// Number of values in each bar; what lies beyond the axis counts as the last one.
fn counts(values: &[f64], high: f64) -> Vec<f64> {
    let mut counts = vec![0.0; BINS];
    for value in values.iter().filter(|value| value.is_finite()) {
        let bin = (value / high * BINS as f64) as usize;
        counts[bin.min(BINS - 1)] += 1.0;
    }
    counts
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::{Measures, Outcome};

    #[test]
    fn every_trial_is_in_one_bar() {
        let counts = counts(&[0.0, 0.1, 3.9, 4.0, 4.1, f64::NAN], 4.0);
        assert_eq!(counts.iter().sum::<f64>(), 5.0);
        assert_eq!((counts[0], counts[1], counts[39]), (1.0, 1.0, 3.0));
    }

    #[test]
    fn the_tipping_force_is_in_the_picture() {
        let svg = draw(&fixtures::results(&[1]), "Torch", Some(1.97)).to_svg();
        assert!(svg.contains("tips over at 2.0 N") && svg.contains("trials stay below"));
    }

    /// The change that makes it fail: the number stands at the end of the axis, which goes on beyond the tallest bar.
    #[test]
    fn the_number_of_trials_stands_where_the_tallest_bar_ends() {
        let mut results = fixtures::results(&[1]);
        results.reports.retain(|report| report.key.mode == lab::procedure::Mode::Adaptive);
        for (at, report) in results.reports.iter_mut().enumerate() {
            report.measures.contact_sustained_n = if at < 37 { 1.0 } else { 2.0 };
        }
        let svg = draw(&results, "Torch", None).to_inline_svg();
        let y = |element: &str| -> f64 {
            element.split_once(" y=\"").unwrap().1.split_once('"').unwrap().0.parse().unwrap()
        };
        let fill = colour(lab::procedure::Mode::Adaptive).to_lowercase();
        let bars = svg.split("<rect").skip(1).filter(|rect| rect.split('>').next().unwrap().contains(&fill));
        let top = bars.map(y).fold(f64::INFINITY, f64::min);
        let label = svg.split("<text").find(|text| text.contains(">37<")).map(y).unwrap();
        // The foot of letters of 15 px stands 5 px below their middle.
        assert!((label - 5.0 - top).abs() < 0.5, "37 stands at {label}, the bar of 37 ends at {top}");
    }

    #[test]
    fn a_trial_in_which_the_arm_stopped_is_not_shown_as_a_gentle_one() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            report.outcome = Outcome::Stopped("JointSpeed".to_owned());
            report.measures = Measures::default();
        }
        let svg = draw(&results, "Torch", Some(1.97)).to_svg();
        assert!(svg.contains("0 of 48 trials stay below") && !svg.contains("48 of 48"));
    }
}
