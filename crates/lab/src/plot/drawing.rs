//! A page: shapes and text in pixels, and frames with axes in data units. Only this file knows the plotting crate.

use std::fmt::Write as _;
use std::path::Path;

use kuva::backend::raster::RasterBackend;
use kuva::backend::svg::SvgBackend;
use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

use super::PlotError;
use super::pixels::Pixels;

/// A colour as `#rrggbb`.
pub type Colour = &'static str;

/// Text and marks.
pub const INK: Colour = "#222222";
/// Axes, secondary text.
pub const GREY: Colour = "#666666";
/// Grid lines.
pub const GRID: Colour = "#e6e6e6";
/// Nothing was achieved here.
pub const PALE: Colour = "#ededed";
/// Expected range.
pub const BAND: Colour = "#d9d9d9";
/// Limits.
pub const LIMIT: Colour = "#000000";

/// Direction of a text that reads upwards, degrees.
const UPWARD: f64 = -90.0;

/// Where a text stands relative to its point.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Start,
    /// Its middle is there.
    Middle,
    /// It ends there.
    End,
}

/// A page in the making; pixels, y downwards.
pub struct Drawing {
    scene: Scene,
}

impl Drawing {
    /// An empty white page.
    pub fn new(width: f64, height: f64) -> Drawing {
        Drawing { scene: Scene::new(width, height) }
    }

    /// A filled rectangle without outline.
    pub fn rectangle(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], fill: Colour) {
        self.scene.elements.push(Primitive::Rect {
            x,
            y,
            width,
            height,
            fill: fill.into(),
            stroke: None,
            stroke_width: None,
            opacity: None,
        });
    }

    /// A disc, or a ring if `fill` is `None`.
    pub fn circle(&mut self, [cx, cy]: [f64; 2], r: f64, fill: Option<Colour>, outline: Option<(Colour, f64)>) {
        self.scene.elements.push(Primitive::Circle {
            cx,
            cy,
            r,
            fill: fill.unwrap_or("#ffffff").into(),
            fill_opacity: fill.is_none().then_some(0.0),
            stroke: outline.map(|(colour, _)| colour.into()),
            stroke_width: outline.map(|(_, width)| width),
        });
    }

    /// A line through points.
    pub fn line(&mut self, points: &[[f64; 2]], colour: Colour, width: f64) {
        self.scene.elements.push(Primitive::PolyLine {
            points: points.iter().map(|[x, y]| (*x, *y)).collect(),
            stroke: colour.into(),
            stroke_width: width,
            stroke_dasharray: None,
        });
    }

    /// A dashed line through points, cut into dashes here: the plotting crate would begin the pattern anew at every
    /// point.
    pub fn dashed(&mut self, points: &[[f64; 2]], colour: Colour, width: f64, pattern: [f64; 2]) {
        for dash in dashes(points, pattern) {
            self.line(&dash, colour, width);
        }
    }

    /// A filled polygon.
    pub fn polygon(&mut self, points: &[[f64; 2]], fill: Colour) {
        let mut d = String::new();
        for (index, [x, y]) in points.iter().enumerate() {
            // Writing into a String cannot fail.
            let _ = write!(d, "{}{x:.2} {y:.2} ", if index == 0 { "M " } else { "L " });
        }
        d.push('Z');
        self.scene.elements.push(Primitive::Path(Box::new(PathData {
            d,
            fill: Some(fill.into()),
            stroke: Color::None,
            stroke_width: 0.0,
            opacity: None,
            stroke_dasharray: None,
        })));
    }

    /// An arrow with a filled head.
    pub fn arrow(&mut self, from: [f64; 2], to: [f64; 2], colour: Colour, width: f64) {
        let length = (to[0] - from[0]).hypot(to[1] - from[1]).max(1e-9);
        let [c, s] = [(to[0] - from[0]) / length, (to[1] - from[1]) / length];
        let (head, half) = (5.0 * width, 2.2 * width);
        let neck = [to[0] - head * c, to[1] - head * s];
        self.line(&[from, neck], colour, width);
        self.polygon(&[to, [neck[0] - half * s, neck[1] + half * c], [neck[0] + half * s, neck[1] - half * c]], colour);
    }

    /// A cross.
    pub fn cross(&mut self, [x, y]: [f64; 2], half: f64, colour: Colour, width: f64) {
        self.line(&[[x - half, y - half], [x + half, y + half]], colour, width);
        self.line(&[[x - half, y + half], [x + half, y - half]], colour, width);
    }

    /// A line of text on the baseline `y`.
    pub fn text(&mut self, [x, y]: [f64; 2], content: impl Into<String>, size: u32, anchor: Anchor, colour: Colour) {
        self.put_text([x, y], content.into(), size, anchor, colour, None);
    }

    /// A line of text that reads upwards, its middle at the point.
    pub fn upward_text(&mut self, at: [f64; 2], content: impl Into<String>, size: u32, colour: Colour) {
        self.put_text(at, content.into(), size, Anchor::Middle, colour, Some(UPWARD));
    }

    fn put_text(
        &mut self,
        [x, y]: [f64; 2],
        content: String,
        size: u32,
        anchor: Anchor,
        colour: Colour,
        rotate: Option<f64>,
    ) {
        let anchor = match anchor {
            Anchor::Start => TextAnchor::Start,
            Anchor::Middle => TextAnchor::Middle,
            Anchor::End => TextAnchor::End,
        };
        let color = Some(colour.into());
        self.scene.elements.push(Primitive::Text { x, y, content, size, anchor, rotate, bold: false, color });
    }

    /// The page as SVG for a page of HTML: it takes the width that it is given, and the fonts of the reader.
    pub fn to_inline_svg(&self) -> String {
        let svg = SvgBackend::new().render_scene(&self.scene);
        let (width, height) = (self.scene.width, self.scene.height);
        let body = svg.split_once('>').map_or("", |(_, body)| body);
        format!("<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\">{body}")
    }

    /// The page as SVG with its font inside.
    pub fn to_svg(&self) -> String {
        SvgBackend::new().with_embedded_font(true).render_scene(&self.scene)
    }

    /// The page as PNG, `scale` pixels to a px of the page.
    ///
    /// # Errors
    /// The encoder's error.
    pub fn to_png(&self, scale: f32) -> Result<Vec<u8>, String> {
        let Scene { width, height, .. } = self.scene;
        let (mut page, mut sheet) = (Scene::new(width, height), Scene::new(height, width));
        // What the plotting crate turns is jagged: upward texts stand level on a sheet of their own, which is turned.
        for element in &self.scene.elements {
            match element {
                Primitive::Text { x, y, content, size, anchor, rotate: Some(UPWARD), bold, color } => {
                    sheet.elements.push(Primitive::Text {
                        x: height - y,
                        y: *x,
                        content: content.clone(),
                        size: *size,
                        anchor: *anchor,
                        rotate: None,
                        bold: *bold,
                        color: color.clone(),
                    });
                }
                other => page.elements.push(other.clone()),
            }
        }
        let pixels = RasterBackend::new().with_scale(scale);
        let file = pixels.render_scene(&page)?;
        if sheet.elements.is_empty() {
            return Ok(file);
        }
        let mut printed = Pixels::decode(&file)?;
        printed.print_turned(&Pixels::decode(&pixels.render_scene(&sheet)?)?);
        printed.encode()
    }

    /// Writes the page as `NAME.svg` and `NAME.png` into `folder`.
    ///
    /// # Errors
    /// [`PlotError`]
    pub fn write(&self, folder: &Path, name: &str) -> Result<(), PlotError> {
        let png = folder.join(format!("{name}.png"));
        let pixels = self.to_png(1.5).map_err(|reason| PlotError::Encode { file: png.clone(), reason })?;
        for (file, bytes) in [(folder.join(format!("{name}.svg")), self.to_svg().into_bytes()), (png, pixels)] {
            crate::output_file::replace(&file, &bytes)?;
        }
        Ok(())
    }
}

/// A rectangle of the page with the axes of data.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// Upper left corner on the page, px.
    pub corner: [f64; 2],
    /// Width and height on the page, px.
    pub size: [f64; 2],
    /// Range of x.
    pub x: [f64; 2],
    /// Range of y, upwards.
    pub y: [f64; 2],
}

impl Frame {
    /// Point on the page of a point of the data.
    pub fn at(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        [
            self.corner[0] + (x - self.x[0]) / (self.x[1] - self.x[0]) * self.size[0],
            self.corner[1] + (self.y[1] - y) / (self.y[1] - self.y[0]) * self.size[1],
        ]
    }

    /// A curve of the data on the page, kept inside the frame.
    pub fn curve(&self, points: impl IntoIterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
        points
            .into_iter()
            .filter(|[x, y]| y.is_finite() && (self.x[0]..=self.x[1]).contains(x))
            .map(|[x, y]| self.at([x, y.clamp(self.y[0], self.y[1])]))
            .collect()
    }

    /// Grid lines at round values, and what they are.
    pub fn grid(&self, drawing: &mut Drawing, size: u32, count: [usize; 2]) {
        for tick in ticks(self.x, count[0]) {
            let [x, _] = self.at([tick, self.y[0]]);
            drawing.line(&[[x, self.corner[1]], [x, self.bottom()]], GRID, 1.0);
            drawing.text([x, self.bottom() + f64::from(size) + 5.0], plain(tick), size, Anchor::Middle, GREY);
        }
        for tick in ticks(self.y, count[1]) {
            let [_, y] = self.at([self.x[0], tick]);
            drawing.line(&[[self.corner[0], y], [self.right(), y]], GRID, 1.0);
            drawing.text([self.corner[0] - 7.0, y + 0.36 * f64::from(size)], plain(tick), size, Anchor::End, GREY);
        }
    }

    /// The open axes: left and bottom.
    pub fn axes(&self, drawing: &mut Drawing) {
        let foot = [self.corner[0], self.bottom()];
        drawing.line(&[self.corner, foot, [self.right(), self.bottom()]], "#444444", 1.2);
    }

    /// Right end, px.
    pub fn right(&self) -> f64 {
        self.corner[0] + self.size[0]
    }

    /// Lower end, px.
    pub fn bottom(&self) -> f64 {
        self.corner[1] + self.size[1]
    }
}

/// Cuts a line into dashes of constant length; `pattern` is the length of dash and space.
fn dashes(points: &[[f64; 2]], pattern: [f64; 2]) -> Vec<Vec<[f64; 2]>> {
    let mut pieces: Vec<Vec<[f64; 2]>> = Vec::new();
    let mut piece: Vec<[f64; 2]> = points.first().copied().into_iter().collect();
    let mut drawing = true;
    let mut left = pattern[0];
    for pair in points.windows(2) {
        let ([x0, y0], [x1, y1]) = (pair[0], pair[1]);
        let length = (x1 - x0).hypot(y1 - y0);
        let mut done = 0.0;
        while length - done > left {
            done += left;
            let fraction = done / length;
            let at = [x0 + fraction * (x1 - x0), y0 + fraction * (y1 - y0)];
            if drawing {
                piece.push(at);
                pieces.push(std::mem::take(&mut piece));
            } else {
                piece = vec![at];
            }
            drawing = !drawing;
            left = if drawing { pattern[0] } else { pattern[1] };
        }
        left -= length - done;
        if drawing {
            piece.push([x1, y1]);
        }
    }
    if drawing && piece.len() > 1 {
        pieces.push(piece);
    }
    pieces
}

/// Round values within a range, about `count` of them.
pub fn ticks([low, high]: [f64; 2], count: usize) -> Vec<f64> {
    let raw = (high - low).max(f64::MIN_POSITIVE) / count.max(1) as f64;
    let power = 10_f64.powf(raw.log10().floor());
    let step =
        [1.0, 2.0, 5.0, 10.0].into_iter().map(|part| part * power).find(|step| *step >= raw * 0.999).unwrap_or(raw);
    let first = (low / step - 1e-9).ceil() as i64;
    let last = (high / step + 1e-9).floor() as i64;
    (first..=last).map(|index| index as f64 * step).collect()
}

/// A number without exponent and needless zeros, with a real minus sign.
pub fn plain(value: f64) -> String {
    let text = format!("{value:.4}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".to_owned() } else { text.replace('-', "\u{2212}") }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn dashes_have_the_length_of_the_pattern_and_keep_to_the_line() {
        let points: Vec<[f64; 2]> = (0..=1000).map(|k| [f64::from(k) * 0.1, 2.0]).collect();
        let pieces = dashes(&points, [3.0, 2.0]);
        // 100 px hold 20 patterns of 5 px; rounding may begin a 21st dash at the very end.
        assert!((20..=21).contains(&pieces.len()));
        for piece in &pieces[..20] {
            let length = piece[piece.len() - 1][0] - piece[0][0];
            assert!((length - 3.0).abs() < 1e-9, "{length}");
            assert!(piece.iter().all(|point| point[1] == 2.0));
        }
    }

    /// The change that makes it fail: the plotting crate turns the letters itself, and every pixel that they touch is
    /// as dark as its middle.
    #[test]
    fn the_letters_of_an_upward_text_are_those_of_a_level_one() {
        let (mut level, mut upward) = (Drawing::new(100.0, 40.0), Drawing::new(40.0, 100.0));
        level.text([50.0, 24.0], "force (N)", 14, Anchor::Middle, INK);
        upward.upward_text([24.0, 50.0], "force (N)", 14, INK);
        let pixels = |drawing: &Drawing| Pixels::decode(&drawing.to_png(1.0).unwrap()).unwrap();
        let (level, upward) = (pixels(&level), pixels(&upward));
        let places = || (0..100).flat_map(|x| (0..40).map(move |y| (x, y)));
        let differ = places().filter(|(x, y)| level.at(*x, *y) != upward.at(*y, 99 - x)).count();
        assert_eq!(differ, 0);
        assert!(places().any(|(x, y)| level.at(x, y)[0] < 60), "there are letters");
    }

    #[test]
    fn ticks_are_round_and_inside() {
        assert_eq!(ticks([-2.6, 4.2], 4), [-2.0, 0.0, 2.0, 4.0]);
        assert_eq!(ticks([0.0, 12.0], 6), [0.0, 2.0, 4.0, 6.0, 8.0, 10.0, 12.0]);
        assert!(ticks([0.003, 0.0042], 3).iter().all(|tick| (0.003..=0.0042).contains(tick)));
    }

    #[test]
    fn up_in_the_data_is_up_on_the_page() {
        let frame = Frame { corner: [10.0, 20.0], size: [100.0, 50.0], x: [-1.0, 1.0], y: [0.0, 5.0] };
        assert_eq!(frame.at([-1.0, 5.0]), [10.0, 20.0]);
        assert_eq!(frame.at([1.0, 0.0]), [110.0, 70.0]);
        let curve = frame.curve([[0.0, 9.0], [3.0, 1.0], [0.5, f64::NAN], [1.0, 1.0]]);
        assert_eq!(curve, [[60.0, 20.0], [110.0, 60.0]], "cut at the top, nothing beside the frame");
    }

    #[test]
    fn numbers_are_plain() {
        assert_eq!(plain(-0.25), "\u{2212}0.25");
        assert_eq!(plain(-0.0), "0");
        assert_eq!(plain(12.0), "12");
    }
}
