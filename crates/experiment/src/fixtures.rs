//! Made-up results for the tests of tables, maps and figures: shaped as the prototype found them.

use super::grid::{ApproachFrame, Grid};
use super::outcome::{Measures, Outcome};
use super::results::{Key, PlanarPath, Report, Results, Surprise};
use super::seed;
use lab::procedure::Mode;

/// Letters row by row as the prototype's maps print them.
const MAPS: [&str; 3] = [
    "KKKKKKKKKKKKKKSSKKKKKSSSKKKKKSSSKKKKKKKKKKKKKKKK",
    "KKKKKSSSKKKKSSSSKKKKKSSSKKKKKSSSKKKKSSSSKKKKKKKS",
    "SSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSSK",
];

/// Frame of the made-up approach.
pub fn frame() -> ApproachFrame {
    ApproachFrame::new([0.75, 0.2], [1.0, 1.0]).expect("the direction is not zero")
}

/// All trials of the paper's grid with these seeds.
pub fn results(seeds: &[u64]) -> Results {
    let mut reports = Vec::new();
    for (mode, map) in Mode::PAPER.into_iter().zip(MAPS) {
        for (index, (cell, letter)) in Grid::paper().cells.into_iter().zip(map.chars()).enumerate() {
            for &seed in seeds {
                let trial_seed = seed::of_trial(seed, cell);
                let chance = (trial_seed % 1000) as f64 / 1000.0;
                let held = (letter == 'S') != (seed > 1 && chance < 0.06);
                let object = frame().world(cell);
                let share = if mode == Mode::Adaptive { 1.0 } else { 0.0 };
                let way = |shift: f64| -> Vec<[f64; 2]> {
                    (0..60)
                        .map(|k| {
                            let s = f64::from(k) / 59.0;
                            let back = -0.42 * (1.0 - s);
                            let bend = shift * s * s;
                            let [c, sine] = frame().direction;
                            [
                                0.75 + c * (back + bend * cell.along())
                                    - sine * (0.05 * (1.0 - s) + bend * cell.sideways()),
                                0.2 + sine * (back + bend * cell.along())
                                    + c * (0.05 * (1.0 - s) + bend * cell.sideways()),
                            ]
                        })
                        .collect()
                };
                reports.push(Report {
                    key: Key { index, cell, mode, seed },
                    trial_seed,
                    object,
                    outcome: if held { Outcome::Held } else { Outcome::KnockedOver },
                    measures: Measures {
                        lift_m: if held { 0.1 } else { -0.1 },
                        tilt_deg: if held { 4.0 } else { 80.0 },
                        push_m: 0.01 * chance,
                        touch_s: Some(5.0),
                        touch_speed_m_s: Some(0.034),
                        closing_s: Some(8.2),
                        lift_s: 12.5,
                        failure_s: (!held).then_some(6.0 + chance),
                        contact_peak_n: [2.5, 1.8, 1.2][mode as usize - 1] * (0.6 + chance),
                        contact_sustained_n: [2.2, 1.6, 0.9][mode as usize - 1] * (0.6 + chance),
                        contact_median_n: Some(1.0),
                        contact_mean_n: Some([1.0, 0.8, 0.4][mode as usize - 1]),
                        finger_n: [6.0, 6.0, 8.0],
                        table_peak_n: 0.0,
                        finger_peak_n: 8.0,
                        finger_grip_n: [7.0; 3],
                        finger_asked_n: 8.0,
                        chatter_n: Some(0.2),
                        shaking_rad_s: 0.02,
                        stopped: false,
                    },
                    adaptation_m: share * cell.distance(),
                    adaptation_deg: share * 80.0 * cell.distance(),
                    sag_m: Some(0.002),
                    free_sag_m: Some(0.003),
                    surprise: (!held && chance < 0.95).then_some(Surprise {
                        phase: 0.4,
                        channel: 0,
                        time_s: 6.5 + chance,
                    }),
                    path: PlanarPath { measured: way(share), planned: way(share) },
                    virtual_s: 20.0,
                    wall_s: Some(1.0),
                });
            }
        }
    }
    Results::new(reports)
}
