//! Pages of panels, drawn by `drawing.rs`.
//!
//! The look is decided here once: white page, thin open axes, grey grid, one font (shipped inside the plotting
//! crate), the Okabe-Ito colours that people with any kind of colour blindness tell apart, and line styles that
//! differ as well, so that a black-and-white print still reads.

use super::drawing::{Anchor, BAND, Colour, Drawing, Frame, INK};

/// Width of the page, px.
const PAGE_WIDTH: f64 = 1600.0;
/// Height of one row of panels, px.
const ROW_HEIGHT: f64 = 264.0;
/// Space of a panel beside, above and below its axes, px.
const LEFT: f64 = 90.0;
const RIGHT: f64 = 22.0;
const TOP: f64 = 34.0;
const BOTTOM: f64 = 50.0;
const TITLE_HEIGHT: f64 = 48.0;
const LEGEND_SIZE: u32 = 16;
const LEGEND_HEIGHT: f64 = 44.0;
const LEGEND_LINE: f64 = 52.0;
const LEGEND_GAP: f64 = 40.0;
const TITLE_SIZE: u32 = 22;
/// Space that no title and no legend takes, at either side of the page, px.
const MARGIN: f64 = 20.0;

/// Points that a curve has at most: two per pixel column of the widest panel.
const MOST_POINTS: usize = 1000;

/// Style of a curve, chosen by its meaning, so that a colour means the same in every panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ink {
    /// The demonstration.
    Demonstration,
    /// The plan of the primitive.
    Plan,
    /// The motion of the arm.
    Execution,
    /// A range that is expected; its points go around it.
    Band,
    /// A limit.
    Limit,
    /// First of several quantities in one panel (x).
    First,
    /// Second of several quantities in one panel (y).
    Second,
    /// Third of several quantities in one panel (z).
    Third,
}

impl Ink {
    fn colour(self) -> Colour {
        match self {
            Ink::Demonstration => "#999999",
            Ink::Plan => "#0072B2",
            Ink::Execution => "#D55E00",
            Ink::Band => BAND,
            Ink::Limit => "#000000",
            Ink::First => "#CC79A7",
            Ink::Second => "#009E73",
            Ink::Third => "#56B4E9",
        }
    }

    fn width(self) -> f64 {
        match self {
            Ink::Demonstration => 5.0,
            Ink::Band => 12.0,
            Ink::Execution => 1.8,
            Ink::Plan => 2.4,
            Ink::Limit => 1.2,
            Ink::First | Ink::Second | Ink::Third => 1.8,
        }
    }

    /// Lengths of dash and space, px; `None` for a solid line.
    fn dashes(self) -> Option<[f64; 2]> {
        match self {
            Ink::Plan => Some([10.0, 6.0]),
            Ink::Limit => Some([3.0, 4.0]),
            Ink::Second => Some([12.0, 4.0]),
            Ink::Third => Some([4.0, 3.0]),
            Ink::Demonstration | Ink::Band | Ink::Execution | Ink::First => None,
        }
    }

    fn line(self, drawing: &mut Drawing, points: &[[f64; 2]]) {
        match self.dashes() {
            None => drawing.line(points, self.colour(), self.width()),
            Some(pattern) => drawing.dashed(points, self.colour(), self.width(), pattern),
        }
    }
}

/// One line in a panel.
#[derive(Debug, Clone, PartialEq)]
pub struct Curve {
    /// Meaning and look.
    pub ink: Ink,
    /// Points (x, y).
    pub points: Vec<(f64, f64)>,
}

/// One diagram.
#[derive(Debug, Clone, PartialEq)]
pub struct Panel {
    /// The quantity shown, without unit.
    pub title: String,
    /// Quantity and unit of the vertical axis.
    pub y_label: String,
    /// Lines, drawn in this order.
    pub curves: Vec<Curve>,
    /// Smallest height of the vertical axis, so that noise of a micrometre does not fill the panel.
    pub least_height: f64,
    /// True if the vertical axis begins at zero.
    pub from_zero: bool,
}

/// A page: rows of panels of equal width under a title, a legend below.
#[derive(Debug, Clone, PartialEq)]
pub struct Page {
    /// Title of the page.
    pub title: String,
    /// Quantity and unit of every horizontal axis.
    pub x_label: String,
    /// Range of every horizontal axis.
    pub x_range: (f64, f64),
    /// Rows of panels.
    pub rows: Vec<Vec<Panel>>,
    /// Legend: what each ink means.
    pub legend: Vec<(Ink, String)>,
}

impl Page {
    /// Draws the page.
    pub fn draw(&self) -> Drawing {
        let legend = self.legend_lines();
        let panels = TITLE_HEIGHT + self.rows.len() as f64 * ROW_HEIGHT;
        let height = panels + legend.len().max(1) as f64 * LEGEND_HEIGHT;
        let mut drawing = Drawing::new(PAGE_WIDTH, height);
        let title = fitted(&self.title, TITLE_SIZE, PAGE_WIDTH - 2.0 * MARGIN);
        drawing.text([PAGE_WIDTH / 2.0, 30.0], title, TITLE_SIZE, Anchor::Middle, INK);
        for (row, panels) in self.rows.iter().enumerate() {
            let width = PAGE_WIDTH / panels.len().max(1) as f64;
            for (column, panel) in panels.iter().enumerate() {
                let frame = Frame {
                    corner: [column as f64 * width + LEFT, TITLE_HEIGHT + row as f64 * ROW_HEIGHT + TOP],
                    size: [width - LEFT - RIGHT, ROW_HEIGHT - TOP - BOTTOM],
                    x: self.x_range.into(),
                    y: panel.range().into(),
                };
                panel.draw(&mut drawing, &frame);
                if row + 1 == self.rows.len() {
                    let below = [frame.corner[0] + frame.size[0] / 2.0, frame.bottom() + 42.0];
                    drawing.text(below, self.x_label.clone(), 14, Anchor::Middle, INK);
                }
            }
        }
        for (line, entries) in legend.iter().enumerate() {
            draw_legend(entries, &mut drawing, panels + (line as f64 + 0.5) * LEGEND_HEIGHT);
        }
        drawing
    }

    /// The legend in lines that fit the page: names of files are as long as people make them.
    fn legend_lines(&self) -> Vec<Vec<(Ink, String)>> {
        let room = PAGE_WIDTH - 2.0 * MARGIN;
        let mut lines: Vec<Vec<(Ink, String)>> = Vec::new();
        let mut taken = f64::INFINITY;
        for (ink, label) in &self.legend {
            let label = fitted(label, LEGEND_SIZE, room - LEGEND_LINE - 10.0);
            let width = legend_width(&label);
            // The gap behind the last one needs no room.
            if taken + width - LEGEND_GAP > room {
                lines.push(Vec::new());
                taken = 0.0;
            }
            taken += width;
            lines.last_mut().into_iter().for_each(|line| line.push((*ink, label.clone())));
        }
        lines
    }
}

/// Width of a text, px: that of its letters in the mean.
fn text_width(text: &str, size: u32) -> f64 {
    text.chars().count() as f64 * 0.56 * f64::from(size)
}

/// A text that is no wider than `width` px; of a longer one the end is left out.
fn fitted(text: &str, size: u32, width: f64) -> String {
    if text_width(text, size) <= width {
        return text.to_owned();
    }
    let letters = (width / text_width("m", size)) as usize;
    format!("{}\u{2026}", text.chars().take(letters.saturating_sub(1)).collect::<String>().trim_end())
}

/// Width of an entry of a legend with the gap behind it, px.
fn legend_width(label: &str) -> f64 {
    LEGEND_LINE + 10.0 + text_width(label, LEGEND_SIZE) + LEGEND_GAP
}

/// One line of a legend.
fn draw_legend(entries: &[(Ink, String)], drawing: &mut Drawing, y: f64) {
    let whole: f64 = entries.iter().map(|(_, label)| legend_width(label)).sum();
    let mut x = (PAGE_WIDTH - whole + LEGEND_GAP) / 2.0;
    for (ink, label) in entries {
        ink.line(drawing, &[[x, y], [x + LEGEND_LINE, y]]);
        let at = [x + LEGEND_LINE + 10.0, y + f64::from(LEGEND_SIZE) * 0.36];
        drawing.text(at, label.clone(), LEGEND_SIZE, Anchor::Start, INK);
        x += legend_width(label);
    }
}

impl Panel {
    fn draw(&self, drawing: &mut Drawing, frame: &Frame) {
        let middle = [frame.corner[0] + frame.size[0] / 2.0, frame.corner[1] + frame.size[1] / 2.0];
        drawing.text([middle[0], frame.corner[1] - 12.0], self.title.clone(), 16, Anchor::Middle, INK);
        drawing.upward_text([frame.corner[0] - 64.0, middle[1]], self.y_label.clone(), 14, INK);
        frame.grid(drawing, 13, [5, 5]);
        for curve in &self.curves {
            if curve.ink == Ink::Band {
                let around: Vec<_> = curve.points.iter().map(|(x, y)| frame.at([*x, *y])).collect();
                drawing.polygon(&around, BAND);
                // An expectation without a spread is a line.
                drawing.line(&around, BAND, 1.0);
                continue;
            }
            curve.ink.line(drawing, &frame.curve(thin(&curve.points).into_iter().map(Into::into)));
        }
        frame.axes(drawing);
    }

    /// Range of the vertical axis: all points, a margin of 6 %, at least [`Panel::least_height`].
    fn range(&self) -> (f64, f64) {
        let values = self
            .curves
            .iter()
            .flat_map(|curve| curve.points.iter().map(|point| point.1))
            .filter(|value| value.is_finite());
        let (low, high) =
            values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(value), high.max(value)));
        if low > high {
            return (0.0, self.least_height.max(1e-9));
        }
        let height = (high - low).max(self.least_height);
        let middle = (high + low) / 2.0;
        if self.from_zero {
            (0.0, high.max(self.least_height) * 1.06)
        } else {
            (middle - 0.56 * height, middle + 0.56 * height)
        }
    }
}

/// Fewer points of the same outline: the smallest and the largest of every bin stay.
fn thin(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    if points.len() <= MOST_POINTS {
        return points.to_vec();
    }
    let bin = points.len().div_ceil(MOST_POINTS / 2);
    let mut kept = Vec::with_capacity(MOST_POINTS + 2);
    for chunk in points.chunks(bin) {
        let low = (0..chunk.len()).min_by(|a, b| chunk[*a].1.total_cmp(&chunk[*b].1));
        let high = (0..chunk.len()).max_by(|a, b| chunk[*a].1.total_cmp(&chunk[*b].1));
        if let (Some(low), Some(high)) = (low, high) {
            kept.push(chunk[low.min(high)]);
            if low != high {
                kept.push(chunk[low.max(high)]);
            }
        }
    }
    // The end of a movement is what one looks at first.
    kept.extend(points.last().copied());
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Places (x, width, anchor) of the texts of a page as SVG, those that lie over its edge.
    fn cut_off(page: &Page) -> Vec<String> {
        let svg = page.draw().to_inline_svg();
        let texts = svg.split("<text ").skip(1).filter_map(|text| {
            let attribute = |name: &str| Some(text.split_once(&format!("{name}=\""))?.1.split_once('"')?.0);
            let content = text.split_once('>')?.1.split_once('<')?.0;
            let (x, size) = (attribute("x")?.parse::<f64>().ok()?, attribute("font-size")?.parse::<u32>().ok()?);
            let width = text_width(content, size);
            let from = match attribute("text-anchor")? {
                "middle" => x - width / 2.0,
                "end" => x - width,
                _ => x,
            };
            Some((from, from + width, content.to_owned()))
        });
        let texts: Vec<_> = texts.collect();
        assert!(!texts.is_empty(), "{svg}");
        texts.into_iter().filter(|(from, to, _)| *from < 0.0 || *to > PAGE_WIDTH).map(|(.., text)| text).collect()
    }

    #[test]
    fn a_long_title_and_names_of_many_long_files_stay_on_the_page() {
        let inks = [Ink::Execution, Ink::First, Ink::Second, Ink::Third, Ink::Plan];
        let legend = |name: &str| inks.map(|ink| (ink, name.to_owned())).to_vec();
        let page = |title: &str, name: &str| Page {
            title: title.to_owned(),
            x_label: "time (s)".to_owned(),
            x_range: (0.0, 1.0),
            rows: Vec::new(),
            legend: legend(name),
        };
        for (title, name) in [("reach", "run.csv"), (&"long ".repeat(100), "a".repeat(60).as_str())] {
            assert_eq!(cut_off(&page(title, name)), Vec::<String>::new(), "{title}");
        }
        let long = page(&"long ".repeat(100), &"b".repeat(500));
        assert_eq!(cut_off(&long), Vec::<String>::new());
        assert!(long.draw().to_inline_svg().contains('\u{2026}'));
        // A title that fits is not touched.
        assert!(page("reach: plan", "run.csv").draw().to_inline_svg().contains("reach: plan"));
    }

    #[test]
    fn thinning_keeps_a_single_peak() {
        let mut points: Vec<(f64, f64)> = (0..10_000).map(|k| (f64::from(k), 0.0)).collect();
        points[4321].1 = 7.0;
        let kept = thin(&points);
        assert!(kept.len() <= MOST_POINTS + 2);
        assert!(kept.contains(&(4321.0, 7.0)));
        assert_eq!(kept.last(), points.last());
    }
}
