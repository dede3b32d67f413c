//! Figures of an experiment.

pub mod bars;
pub mod curve;
pub mod forces;
pub mod paths;
pub mod series;
#[cfg(feature = "mujoco")]
pub mod strip;
pub mod success_map;
#[cfg(feature = "mujoco")]
mod write;

#[cfg(feature = "mujoco")]
pub use write::{FigureError, write, write_lift};

use lab::plot::drawing::{Colour, GREY};
use lab::procedure::Mode;

/// The colour of a mode, the same in every figure.
pub fn colour(mode: Mode) -> Colour {
    match mode {
        Mode::Track => GREY,
        Mode::OpenLoop => "#D55E00",
        Mode::ForceControl => "#E9B44C",
        Mode::Adaptive => "#0072B2",
        Mode::RigidFingers => "#009E73",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::grid::Grid;
    use lab::procedure::Mode;

    /// Set this to a folder to look at the figures with made-up data.
    const LOOK: &str = "TACTUS_FIGURES";

    #[test]
    fn figures_are_written_as_svg_and_png() {
        let temporary = tempfile::tempdir().unwrap();
        let folder = std::env::var_os(LOOK).map_or(temporary.path().to_owned(), Into::into);
        let results = fixtures::results(&[1, 2, 3, 4, 5]);
        success_map::draw(&results, &Grid::paper(), "Torch: where it is grasped", 0.028).write(&folder, "map").unwrap();
        forces::draw(&results, "Torch: contact forces", Some(1.97)).write(&folder, "forces").unwrap();
        let taught = results.reports[0].path.planned.clone();
        paths::draw(&results, &Grid::paper(), &fixtures::frame(), &taught, "Torch: ways of the hand", 0.028)
            .write(&folder, "paths")
            .unwrap();
        let (open, closed, expected) = series::tests::fixtures();
        let runs = [(Mode::OpenLoop, &open), (Mode::Adaptive, &closed)];
        series::draw(&runs, Some(&expected), &[(12.0, "lift")], "Torch: forces and movement")
            .write(&folder, "series")
            .unwrap();
        for name in ["map", "forces", "paths", "series"] {
            let png = std::fs::read(folder.join(format!("{name}.png"))).unwrap();
            assert!(png.starts_with(&[0x89, b'P', b'N', b'G']) && png.len() > 10_000, "{name}");
            assert!(std::fs::read_to_string(folder.join(format!("{name}.svg"))).unwrap().starts_with("<svg"));
        }
    }
}
