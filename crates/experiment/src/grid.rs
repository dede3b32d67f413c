//! Where the object stands instead of where the primitive expects it: cells of a grid in the frame of the approach.
//!
//! ```text
//!                 sideways (left of the approach)
//!                   ^
//!   arm  ---------> o--> along (the direction in which the hand arrives; negative = nearer the arm)
//!                  goal
//! ```

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

/// Distance between neighbouring cells of the paper's grid, mm.
const PAPER_SPACING: i32 = 40;
/// Extent of the paper's grid along the approach, mm.
const PAPER_ALONG: [i32; 2] = [-240, 40];
/// Extent of the paper's grid sideways, mm.
const PAPER_SIDEWAYS: [i32; 2] = [-120, 80];

/// Displacement of the object from the goal in the frame of the approach. Whole millimetres, so that a cell has one
/// name only.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Default, Serialize, Deserialize)]
pub struct Cell {
    /// Along the approach, mm; negative is nearer the arm.
    pub along_mm: i32,
    /// Sideways, mm; positive is left of the approach.
    pub sideways_mm: i32,
}

impl Cell {
    /// A cell from centimetres.
    pub fn centimetres(along: f64, sideways: f64) -> Cell {
        Cell { along_mm: (along * 10.0).round() as i32, sideways_mm: (sideways * 10.0).round() as i32 }
    }

    /// Along the approach, m.
    pub fn along(self) -> f64 {
        f64::from(self.along_mm) * 1e-3
    }

    /// Sideways, m.
    pub fn sideways(self) -> f64 {
        f64::from(self.sideways_mm) * 1e-3
    }

    /// Distance from the goal, m.
    pub fn distance(self) -> f64 {
        self.along().hypot(self.sideways())
    }
}

/// Centimetres as they are told. Divided: a product with 0.1 is not the double that is written with one digit.
pub(super) fn centimetres(millimetres: i32) -> f64 {
    f64::from(millimetres) / 10.0
}

/// `along:sideways` in cm.
impl fmt::Display for Cell {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{}:{}", centimetres(self.along_mm), centimetres(self.sideways_mm))
    }
}

impl FromStr for Cell {
    type Err = String;

    fn from_str(text: &str) -> Result<Cell, String> {
        let number = |text: &str| text.trim().parse::<f64>().ok().filter(|value| value.abs() <= 100.0);
        match text.split_once(':').map(|(along, sideways)| (number(along), number(sideways))) {
            Some((Some(along), Some(sideways))) => Ok(Cell::centimetres(along, sideways)),
            _ => Err(format!("'{text}' is no cell; a cell is ALONG:SIDEWAYS in cm, for example -24:8")),
        }
    }
}

/// The cells of an experiment, in the order in which they are tried and numbered.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Grid {
    /// The cells, before the grid is turned and shifted.
    pub cells: Vec<Cell>,
}

impl Grid {
    /// The paper's grid: 28 x 20 cm, 4 cm apart, 48 cells.
    pub fn paper() -> Grid {
        Grid::raster(&steps(PAPER_ALONG, 8), &steps(PAPER_SIDEWAYS, 6))
    }

    /// `columns` along the approach and `rows` sideways, spread evenly over the paper's grid. As long as there are no
    /// more of them than the paper has, they are cells of the paper's grid.
    ///
    /// # Errors
    /// More than 64 either way, or none.
    pub fn spread(columns: usize, rows: usize) -> Result<Grid, String> {
        if !(1..=64).contains(&columns) || !(1..=64).contains(&rows) {
            return Err(format!("a grid of {columns} x {rows} cells cannot be made; 1 to 64 either way are possible"));
        }
        Ok(Grid::raster(&steps(PAPER_ALONG, columns), &steps(PAPER_SIDEWAYS, rows)))
    }

    /// A raster of cells: row by row from the largest sideways offset, as maps are drawn.
    pub(super) fn raster(along: &[i32], sideways: &[i32]) -> Grid {
        let cells = sideways
            .iter()
            .rev()
            .flat_map(|&sideways_mm| along.iter().map(move |&along_mm| Cell { along_mm, sideways_mm }));
        Grid { cells: cells.collect() }
    }

    /// The offsets along the approach that occur, ascending, mm.
    pub fn columns(&self) -> Vec<i32> {
        sorted(self.cells.iter().map(|cell| cell.along_mm))
    }

    /// The offsets sideways that occur, descending as maps are drawn, mm.
    pub fn rows(&self) -> Vec<i32> {
        let mut rows = sorted(self.cells.iter().map(|cell| cell.sideways_mm));
        rows.reverse();
        rows
    }

    /// The grid as the option `--grid` takes it, short where it has a name.
    #[must_use]
    pub fn option(&self) -> String {
        let (columns, rows) = (self.columns().len(), self.rows().len());
        if *self == Grid::paper() {
            return "paper".to_owned();
        }
        if Grid::spread(columns, rows).as_ref() == Ok(self) {
            return format!("{columns}x{rows}");
        }
        self.cells.iter().map(Cell::to_string).collect::<Vec<_>>().join(",")
    }

    /// Turned about its middle and shifted: what a controller tuned to the cells of one grid would trip over.
    ///
    /// `degrees` counter-clockwise seen from above; `shift` along the approach and sideways, m.
    #[must_use]
    pub fn moved(&self, degrees: f64, shift: [f64; 2]) -> Grid {
        let (columns, rows) = (self.columns(), self.rows());
        let middle = |values: &[i32]| {
            f64::from(values.first().copied().unwrap_or(0) + values.last().copied().unwrap_or(0)) * 0.5
        };
        let (along_middle, sideways_middle) = (middle(&columns), middle(&rows));
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let cells = self.cells.iter().map(|cell| {
            let (x, y) = (f64::from(cell.along_mm) - along_middle, f64::from(cell.sideways_mm) - sideways_middle);
            Cell {
                along_mm: (along_middle + cosine * x - sine * y + shift[0] * 1e3).round() as i32,
                sideways_mm: (sideways_middle + sine * x + cosine * y + shift[1] * 1e3).round() as i32,
            }
        });
        Grid { cells: cells.collect() }
    }
}

impl FromStr for Grid {
    type Err = String;

    /// `paper`, `8x6`, or a list of cells such as `-24:8,0:0`.
    fn from_str(text: &str) -> Result<Grid, String> {
        if text == "paper" {
            return Ok(Grid::paper());
        }
        if text.contains(':') {
            let mut cells: Vec<Cell> = Vec::new();
            for cell in text.split(',').filter(|part| !part.trim().is_empty()) {
                let cell = cell.parse()?;
                if cells.contains(&cell) {
                    return Err(format!("the cell {cell} is there twice"));
                }
                cells.push(cell);
            }
            return Ok(Grid { cells });
        }
        let size = text.replace(' ', "");
        let numbers = size.split_once('x').and_then(|(n, m)| Some((n.parse().ok()?, m.parse().ok()?)));
        match numbers {
            Some((columns, rows)) => Grid::spread(columns, rows),
            None => Err(format!("'{text}' is no grid; there are `paper`, `8x6` and lists of cells such as -24:8,0:0")),
        }
    }
}

/// `count` values from one end to the other, on the paper's raster while they are few enough for it.
fn steps([low, high]: [i32; 2], count: usize) -> Vec<i32> {
    if count == 1 {
        return vec![0];
    }
    let raster = (high - low) / PAPER_SPACING;
    let few = count as i32 <= raster + 1;
    (0..count)
        .map(|index| {
            let share = index as f64 / (count - 1) as f64;
            if few {
                low + (share * f64::from(raster)).round() as i32 * PAPER_SPACING
            } else {
                low + (share * f64::from(high - low)).round() as i32
            }
        })
        .collect()
}

fn sorted(values: impl Iterator<Item = i32>) -> Vec<i32> {
    let mut values: Vec<i32> = values.collect();
    values.sort_unstable();
    values.dedup();
    values
}

/// The frame of the approach on the table: where the hand arrives and from which direction.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct ApproachFrame {
    /// The goal, world x and y, m.
    pub goal: [f64; 2],
    /// Horizontal direction of the approach, unit vector.
    pub direction: [f64; 2],
}

impl ApproachFrame {
    /// The frame at `goal` with the approach along `direction` (need not be a unit vector); `None` if that is no
    /// horizontal direction.
    pub fn new(goal: [f64; 2], direction: [f64; 2]) -> Option<ApproachFrame> {
        let length = direction[0].hypot(direction[1]);
        (length > 1e-6 && goal.iter().all(|value| value.is_finite()))
            .then(|| ApproachFrame { goal, direction: direction.map(|value| value / length) })
    }

    /// World x and y of a cell, m.
    pub fn world(&self, cell: Cell) -> [f64; 2] {
        let [c, s] = self.direction;
        let (along, sideways) = (cell.along(), cell.sideways());
        [self.goal[0] + c * along - s * sideways, self.goal[1] + s * along + c * sideways]
    }

    /// Offsets along the approach and sideways of a point of the world, m.
    pub fn local(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.direction;
        let (x, y) = (x - self.goal[0], y - self.goal[1]);
        [c * x + s * y, c * y - s * x]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_papers_grid_has_48_cells_on_28_by_20_cm() {
        let grid = Grid::paper();
        assert_eq!(grid.cells.len(), 48);
        assert_eq!(grid.columns(), [-240, -200, -160, -120, -80, -40, 0, 40]);
        assert_eq!(grid.rows(), [80, 40, 0, -40, -80, -120]);
        // The first cell is the upper left one of the map, the last the lower right one.
        assert_eq!(grid.cells[0], Cell::centimetres(-24.0, 8.0));
        assert_eq!(grid.cells[47], Cell::centimetres(4.0, -12.0));
        assert!((grid.cells.iter().map(|cell| cell.distance()).fold(0.0, f64::max) - 0.268).abs() < 1e-3);
    }

    #[test]
    fn a_small_grid_is_a_part_of_the_papers() {
        let paper = Grid::paper();
        for (columns, rows) in [(4, 3), (3, 1), (8, 6), (2, 2)] {
            let grid = Grid::spread(columns, rows).unwrap();
            assert_eq!(grid.cells.len(), columns * rows);
            assert!(grid.cells.iter().all(|cell| paper.cells.contains(cell)), "{columns} x {rows}");
        }
        assert!(Grid::spread(0, 3).is_err());
    }

    #[test]
    fn cells_and_grids_read_as_they_are_written() {
        let cell: Cell = "-24:7.5".parse().unwrap();
        assert_eq!((cell.along_mm, cell.sideways_mm), (-240, 75));
        assert_eq!(cell.to_string(), "-24:7.5");
        assert_eq!("paper".parse(), Ok(Grid::paper()));
        assert_eq!("8 x 6".parse(), Ok(Grid::paper()));
        assert_eq!("0:0,-4:8".parse::<Grid>().unwrap().cells.len(), 2);
        for wrong in ["", "-24", "8y6", "0:0,0:0", "1:x", "300:0"] {
            assert!(wrong.parse::<Grid>().is_err(), "{wrong}");
        }
    }

    /// The change that makes it fail: a product with 0.1 in `centimetres`, `-2.9000000000000004`.
    #[test]
    fn a_cell_is_told_in_centimetres_of_at_most_one_digit_and_read_back_as_the_same() {
        assert_eq!(Cell { along_mm: -29, sideways_mm: 137 }.to_string(), "-2.9:13.7");
        assert_eq!(Cell { along_mm: -3, sideways_mm: -240 }.to_string(), "-0.3:-24");
        for along_mm in -1000..=1000 {
            let cell = Cell { along_mm, sideways_mm: -along_mm };
            let text = cell.to_string();
            assert!(text.len() <= "-99.9:-99.9".len(), "{text}");
            assert_eq!(text.parse(), Ok(cell));
            // As versions before wrote it into their results.
            let old = format!("{}:{}", f64::from(cell.along_mm) * 0.1, f64::from(cell.sideways_mm) * 0.1);
            assert_eq!(old.parse(), Ok(cell));
        }
    }

    #[test]
    fn the_option_of_a_grid_gives_it_back() {
        for text in ["paper", "4x3", "2x1", "-2.9:13.7,0:0"] {
            let grid: Grid = text.parse().unwrap();
            assert_eq!(grid.option(), text);
        }
        let turned = Grid::paper().moved(30.0, [0.0, 0.0]);
        assert_eq!(turned.option().parse(), Ok(turned));
    }

    #[test]
    fn sideways_is_left_of_the_approach() {
        // An arm that reaches along +x has its left at +y; turned by 45 degrees, left of the approach is towards -x.
        let ahead = ApproachFrame::new([0.8, 0.0], [1.0, 0.0]).unwrap();
        assert_eq!(ahead.world(Cell::centimetres(-10.0, 5.0)), [0.8 - 0.1, 0.05]);
        let frame = ApproachFrame::new([0.75, 0.2], [2.0, 2.0]).unwrap();
        let [x, y] = frame.world(Cell::centimetres(0.0, 10.0));
        assert!((x - (0.75 - 0.1 * 0.5_f64.sqrt())).abs() < 1e-12 && (y - (0.2 + 0.1 * 0.5_f64.sqrt())).abs() < 1e-12);
        let [along, sideways] = frame.local([x, y]);
        assert!(along.abs() < 1e-12 && (sideways - 0.1).abs() < 1e-12);
        assert!(ApproachFrame::new([0.0; 2], [0.0; 2]).is_none());
    }

    #[test]
    fn a_quarter_turn_keeps_the_middle_and_swaps_the_sides() {
        let turned = Grid::paper().moved(90.0, [0.0, 0.0]);
        // 28 x 20 cm about (-10, -2) become 20 x 28 cm about the same point.
        assert_eq!((turned.columns()[0], *turned.columns().last().unwrap()), (-200, 0));
        assert_eq!((turned.rows()[0], *turned.rows().last().unwrap()), (120, -160));
        // Counter-clockwise: what lay farthest along the approach lies farthest to the left.
        assert_eq!(
            turned.cells[Grid::paper().cells.iter().position(|cell| cell.along_mm == 40).unwrap()].sideways_mm,
            120
        );
        let shifted = Grid::paper().moved(0.0, [0.02, -0.02]);
        assert_eq!(shifted.cells[0], Cell::centimetres(-22.0, 6.0));
    }
}
