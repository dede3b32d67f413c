//! Experiments from the demonstration to the results, in this process.

#![cfg(feature = "mujoco")]

use std::path::Path;

use experiment::preparation::Teaching;
use experiment::{Config, ExperimentError, Mode, PlantKind, Progress, Scenario, preparation};
use lab::client::Interrupt;
use lab::primitive_file::PrimitiveFile;

fn primitive() -> PrimitiveFile {
    let file = Path::new("flashlight.toml");
    let teaching = Teaching { scenario: Scenario::Flashlight, plant: PlantKind::Perturbed, speed: 1.0, number: 1 };
    preparation::make(teaching, file, 2, &Interrupt::never(), &mut |_| {})
        .expect("the person teaches, and the arm learns")
}

#[test]
fn results_are_the_same_however_many_simulations_run_at_a_time_and_after_a_break() {
    let folder = tempfile::tempdir().expect("a folder");
    let one = Config {
        grid: "0:0,-8:4".parse().expect("a grid"),
        modes: vec![Mode::OpenLoop, Mode::Adaptive],
        jobs: 1,
        ..Config::new(Scenario::Flashlight, primitive())
    };
    let two = Config { jobs: 2, out: Some(folder.path().to_owned()), ..one.clone() };
    let never = Interrupt::never();
    let alone = experiment::run(&one, &never, &mut |_| {}).expect("an experiment");
    assert_eq!(alone.results.reports.len(), 4);

    // The user interrupts after the first trial, and goes on later.
    let interrupt = Interrupt::never();
    let broken = experiment::run(&two, &interrupt, &mut |progress| {
        if matches!(progress, Progress::Done(_)) {
            interrupt.raise();
        }
    });
    let Err(ExperimentError::Interrupted { done, all: 4 }) = broken else { panic!("{broken:?}") };
    assert!((1..4).contains(&done), "{done}");
    let (mut begun, mut tried) = (0, 0);
    let resumed = experiment::run(&Config { resume: true, ..two }, &never, &mut |progress| match progress {
        Progress::Begin { done, .. } => begun = done,
        Progress::Done(_) => tried += 1,
        Progress::Unfinished { .. } => panic!("no figures were asked for"),
    })
    .expect("the rest");
    assert_eq!((begun, tried), (done, 4 - done));
    assert_eq!(resumed.results.without_wall_times(), alone.results.without_wall_times());

    // What is out of reach is said before anything is tried.
    let far = Config { grid: "0:0,60:0".parse().expect("a grid"), ..one };
    let refused = experiment::run(&far, &never, &mut |_| panic!("nothing may be tried"));
    let Err(ExperimentError::OutOfReach(cells)) = refused else { panic!("{refused:?}") };
    assert_eq!(cells.iter().map(|(cell, _)| cell.to_string()).collect::<Vec<_>>(), ["60:0"]);
}
