//! Draws panels on a page and writes it as SVG or PNG. This file and `drawing.rs` are the only ones that know the
//! plotting crate.
//!
//! The look is decided here once: white page, thin open axes, grey grid, one font (shipped inside the plotting
//! crate), the Okabe-Ito colours that people with any kind of colour blindness tell apart, and line styles that
//! differ as well, so that a black-and-white print still reads.

use std::sync::Arc;

use kuva::backend::raster::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::plot::LinePlot;
use kuva::render::figure::Figure;
use kuva::render::layout::{Layout, TickFormat};
use kuva::render::plots::Plot;
use kuva::render::render::{Primitive, Scene, TextAnchor};
use kuva::render::theme::Theme;

/// Width of the page, px.
pub const PAGE_WIDTH: f64 = 1600.0;
/// Height of one row of panels, px.
const ROW_HEIGHT: f64 = 258.0;
/// Columns of the grid in which panels take a share: the smallest number that 3 and 4 divide.
const GRID_COLUMNS: usize = 12;
const SPACING: f64 = 6.0;
const PADDING: f64 = 12.0;
/// Horizontal and vertical room that axes and titles take from a panel, px; only the length of dashes depends on it.
const MARGINS: (f64, f64) = (94.0, 96.0);
const TITLE_SIZE: u32 = 22;
const TITLE_HEIGHT: f64 = 40.0;
const LEGEND_SIZE: u32 = 16;
const LEGEND_HEIGHT: f64 = 44.0;
const LEGEND_LINE: f64 = 52.0;
const LEGEND_GAP: f64 = 40.0;

/// Points that a curve has at most: two per pixel column of the widest panel.
const MOST_POINTS: usize = 1000;

/// How a curve is drawn: what it means decides, so that a colour means the same in every panel.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash)]
pub enum Ink {
    /// What the person showed.
    Demonstration,
    /// What the primitive plans.
    Plan,
    /// What the arm did.
    Execution,
    /// What it may not exceed.
    Limit,
    /// First of several quantities in one panel (x).
    First,
    /// Second of several quantities in one panel (y).
    Second,
    /// Third of several quantities in one panel (z).
    Third,
}

impl Ink {
    fn colour(self) -> &'static str {
        match self {
            Ink::Demonstration => "#999999",
            Ink::Plan => "#0072B2",
            Ink::Execution => "#D55E00",
            Ink::Limit => "#000000",
            Ink::First => "#CC79A7",
            Ink::Second => "#009E73",
            Ink::Third => "#56B4E9",
        }
    }

    fn width(self) -> f64 {
        match self {
            Ink::Demonstration => 5.0,
            Ink::Execution => 1.8,
            Ink::Plan => 2.4,
            Ink::Limit => 1.2,
            Ink::First | Ink::Second | Ink::Third => 1.8,
        }
    }

    /// Lengths of dash and space, px; `None` for a solid line.
    fn dashes(self) -> Option<(f64, f64)> {
        match self {
            Ink::Plan => Some((10.0, 6.0)),
            Ink::Limit => Some((3.0, 4.0)),
            Ink::Second => Some((12.0, 4.0)),
            Ink::Third => Some((4.0, 3.0)),
            Ink::Demonstration | Ink::Execution | Ink::First => None,
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
    /// What is shown, without unit.
    pub title: String,
    /// Quantity and unit of the vertical axis.
    pub y_label: String,
    /// Lines, drawn in this order.
    pub curves: Vec<Curve>,
    /// Smallest height of the vertical axis, so that noise of a micrometre does not fill the panel.
    pub least_height: f64,
    /// Whether the vertical axis begins at zero.
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
    /// Rows; each has 1, 2, 3, 4, 6 or 12 panels.
    pub rows: Vec<Vec<Panel>>,
    /// Legend: what each ink means.
    pub legend: Vec<(Ink, String)>,
}

impl Page {
    /// The page as SVG with its font inside.
    pub fn to_svg(&self) -> String {
        SvgBackend::new().with_embedded_font(true).render_scene(&self.scene())
    }

    /// The page as PNG of [`PAGE_WIDTH`] times `scale` pixels.
    ///
    /// # Errors
    /// What the encoder says.
    pub fn to_png(&self, scale: f32) -> Result<Vec<u8>, String> {
        RasterBackend::new().with_scale(scale).render_scene(&self.scene())
    }

    fn scene(&self) -> Scene {
        let mut structure = Vec::new();
        let mut plots = Vec::new();
        let mut layouts = Vec::new();
        for (row, panels) in self.rows.iter().enumerate() {
            let share = GRID_COLUMNS / panels.len().clamp(1, GRID_COLUMNS);
            for (column, panel) in panels.iter().enumerate() {
                let first = row * GRID_COLUMNS + column * share;
                structure.push((first..first + share).collect());
                plots.push(self.lines(panel, (PAGE_WIDTH - 2.0 * PADDING) / panels.len() as f64));
                layouts.push(self.layout(panel, row + 1 == self.rows.len()));
            }
        }
        let height = self.rows.len() as f64 * (ROW_HEIGHT + SPACING) + 2.0 * PADDING + TITLE_HEIGHT;
        let mut scene = Figure::new(self.rows.len(), GRID_COLUMNS)
            .with_structure(structure)
            .with_plots(plots)
            .with_layouts(layouts)
            .with_title(self.title.clone())
            .with_title_size(TITLE_SIZE)
            .with_spacing(SPACING)
            .with_padding(PADDING)
            .with_figure_size(PAGE_WIDTH, height)
            .render();
        self.draw_legend(&mut scene);
        scene
    }

    /// One line below the panels, outside the data. (The plotting crate's own shared legend stacks its entries.)
    fn draw_legend(&self, scene: &mut Scene) {
        let text_width = |label: &str| label.chars().count() as f64 * 0.56 * f64::from(LEGEND_SIZE);
        let widths: Vec<f64> =
            self.legend.iter().map(|(_, label)| LEGEND_LINE + 10.0 + text_width(label) + LEGEND_GAP).collect();
        let mut x = (scene.width - widths.iter().sum::<f64>() + LEGEND_GAP) / 2.0;
        let y = scene.height + LEGEND_HEIGHT / 2.0 - 8.0;
        for ((ink, label), width) in self.legend.iter().zip(&widths) {
            scene.elements.push(Primitive::Line {
                x1: x,
                y1: y,
                x2: x + LEGEND_LINE,
                y2: y,
                stroke: ink.colour().into(),
                stroke_width: ink.width(),
                stroke_dasharray: ink.dashes().map(|(dash, space)| format!("{dash} {space}")),
            });
            scene.elements.push(Primitive::Text {
                x: x + LEGEND_LINE + 10.0,
                y: y + f64::from(LEGEND_SIZE) * 0.36,
                content: label.clone(),
                size: LEGEND_SIZE,
                anchor: TextAnchor::Start,
                rotate: None,
                bold: false,
                color: None,
            });
            x += width;
        }
        scene.height += LEGEND_HEIGHT;
    }

    /// The curves of a panel, cut into dashes. (The plotting crate starts a dash pattern anew at every point when it
    /// draws pixels, so that a dashed curve of many points would come out solid.)
    fn lines(&self, panel: &Panel, width: f64) -> Vec<Plot> {
        let (low, high) = panel.range();
        let scale = (
            (width - MARGINS.0) / (self.x_range.1 - self.x_range.0).max(f64::MIN_POSITIVE),
            (ROW_HEIGHT - MARGINS.1) / (high - low).max(f64::MIN_POSITIVE),
        );
        let line = |ink: Ink, points: Vec<(f64, f64)>| {
            Plot::Line(LinePlot::new().with_data(points).with_color(ink.colour()).with_stroke_width(ink.width()))
        };
        panel
            .curves
            .iter()
            .flat_map(|curve| {
                let points = thin(&curve.points);
                match curve.ink.dashes() {
                    None => vec![line(curve.ink, points)],
                    Some(pattern) => {
                        dashes(&points, pattern, scale).into_iter().map(|dash| line(curve.ink, dash)).collect()
                    }
                }
            })
            .collect()
    }

    fn layout(&self, panel: &Panel, last_row: bool) -> Layout {
        let (low, high) = panel.range();
        let mut layout = Layout::new(self.x_range, (low, high))
            .with_title(panel.title.clone())
            .with_y_label(panel.y_label.clone())
            .with_theme(Theme {
                grid_color: "#e6e6e6".into(),
                axis_color: "#444444".into(),
                tick_color: "#444444".into(),
                ..Theme::light()
            })
            .with_title_size(16)
            .with_label_size(14)
            .with_tick_size(13)
            .with_body_size(15)
            .with_ticks(5)
            .with_clamp_axis()
            .with_force_margins(78.0, 16.0)
            .with_y_label_offset(-6.0, 0.0)
            .with_y_tick_format(TickFormat::Custom(Arc::new(plain_number)))
            .with_x_tick_format(TickFormat::Custom(Arc::new(plain_number)));
        if last_row {
            layout = layout.with_x_label(self.x_label.clone());
        }
        layout
    }
}

impl Panel {
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

/// Cuts a curve into dashes of constant length on the page; `scale` is px per unit of x and of y.
pub(super) fn dashes(points: &[(f64, f64)], pattern: (f64, f64), scale: (f64, f64)) -> Vec<Vec<(f64, f64)>> {
    let mut pieces: Vec<Vec<(f64, f64)>> = Vec::new();
    let mut piece: Vec<(f64, f64)> = points.first().copied().into_iter().collect();
    let mut drawing = true;
    let mut left = pattern.0;
    for pair in points.windows(2) {
        let ((x0, y0), (x1, y1)) = (pair[0], pair[1]);
        let length = ((x1 - x0) * scale.0).hypot((y1 - y0) * scale.1);
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let fraction = done / length;
            let at = (x0 + fraction * (x1 - x0), y0 + fraction * (y1 - y0));
            if drawing {
                piece.push(at);
                pieces.push(std::mem::take(&mut piece));
            } else {
                piece = vec![at];
            }
            drawing = !drawing;
            left = if drawing { pattern.0 } else { pattern.1 };
        }
        left -= length - done;
        if drawing {
            piece.push((x1, y1));
        }
    }
    if drawing && piece.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

/// A tick label without exponent and without trailing zeros.
fn plain_number(value: f64) -> String {
    let text = format!("{value:.6}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_have_the_length_of_the_pattern_and_keep_to_the_curve() {
        let points: Vec<(f64, f64)> = (0..=1000).map(|k| (f64::from(k) * 0.01, 2.0)).collect();
        let pieces = dashes(&points, (3.0, 2.0), (10.0, 10.0));
        // 100 px hold 20 patterns of 5 px; rounding may begin a 21st dash at the very end.
        assert!((20..=21).contains(&pieces.len()));
        for piece in &pieces[..20] {
            let length = (piece[piece.len() - 1].0 - piece[0].0) * 10.0;
            assert!((length - 3.0).abs() < 1e-9, "{length}");
            assert!(piece.iter().all(|point| point.1 == 2.0));
        }
    }

    #[test]
    fn tick_labels_are_plain_numbers() {
        assert_eq!(plain_number(0.0025), "0.0025");
        assert_eq!(plain_number(-0.0), "0");
        assert_eq!(plain_number(150.0), "150");
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
