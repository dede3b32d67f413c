//! Demonstration, plan and execution of one movement as panels.
//!
//! Position and orientation stand above, the tracking error and the measured force below them, torques at the bottom.
//! The orientation is drawn as the rotation vector from the goal, `2 log(conj(g) (x) q)` in degrees: three numbers
//! that are zero at the goal and, unlike quaternion components, can be read.

use crate::demonstration::{Demonstration, Recording};
use crate::tracking::{self, Tracking};

use super::PlotError;
use super::canvas::{Curve, Ink, Page, Panel};

/// A path of poses over time.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct PosePath {
    /// Time since the start of the movement, s.
    pub time: Vec<f64>,
    /// Position, m, world.
    pub position: Vec<[f64; 3]>,
    /// Orientation, unit quaternions (w, x, y, z).
    pub orientation: Vec<[f64; 4]>,
}

impl PosePath {
    /// Of a demonstration.
    pub fn of_demonstration(demonstration: &Demonstration) -> PosePath {
        PosePath {
            time: demonstration.time.clone(),
            position: demonstration.position.clone(),
            orientation: demonstration.orientation.clone(),
        }
    }
}

/// Everything that is known of one movement; what is missing is left out of the figure.
#[derive(Debug, Clone, Default)]
pub struct Movement {
    /// Name for the title.
    pub name: String,
    /// The demonstration.
    pub demonstration: Option<PosePath>,
    /// The plan of the primitive.
    pub plan: Option<PosePath>,
    /// The recorded run, only its part in state `run`.
    pub execution: Option<Recording>,
}

impl Movement {
    /// The page.
    ///
    /// # Errors
    /// [`PlotError::Nothing`] if there is neither demonstration nor plan nor execution.
    pub fn page(&self) -> Result<Page, PlotError> {
        let execution = self.execution.as_ref().and_then(execution_path);
        let planned = self.execution.as_ref().and_then(desired_path);
        // The plan that was executed is the one the device made, from the measured start and at the chosen speed.
        let plan = planned.as_ref().or(self.plan.as_ref());
        let paths: Vec<(Ink, &PosePath)> = [
            (Ink::Demonstration, self.demonstration.as_ref()),
            (Ink::Execution, execution.as_ref()),
            (Ink::Plan, plan),
        ]
        .into_iter()
        .filter_map(|(ink, path)| path.map(|path| (ink, path)))
        .filter(|(_, path)| !path.time.is_empty())
        .collect();
        let end = |path: Option<&PosePath>| path.and_then(|path| path.orientation.last().copied());
        // A plan that was bent, or a run that was stopped, ends elsewhere than at the goal.
        let (end, from) = match end(self.plan.as_ref()).or(end(self.demonstration.as_ref())) {
            Some(goal) => (goal, "from the goal (deg)"),
            None => (end(plan).or(end(execution.as_ref())).ok_or(PlotError::Nothing)?, "from its end (deg)"),
        };
        let mut rows = vec![position_panels(&paths), orientation_panels(&paths, &end, from)];
        let mut legend: Vec<(Ink, String)> =
            [(Ink::Demonstration, "demonstration"), (Ink::Plan, "plan"), (Ink::Execution, "execution")]
                .into_iter()
                .filter(|(ink, _)| paths.iter().any(|(drawn, _)| drawn == ink))
                .map(|(ink, label)| (ink, label.to_owned()))
                .collect();
        if let Some(run) = &self.execution {
            let panels = error_panels(run);
            if !panels.is_empty() {
                rows.push(panels);
            }
            if run.tau.is_some() {
                rows.extend(torque_panels(run));
                legend.push((Ink::Limit, "torque limit of the joint".to_owned()));
            }
            rows.extend(hand_panels(run));
            if run.wrench.is_some() {
                for (ink, label) in [(Ink::First, "force x"), (Ink::Second, "force y"), (Ink::Third, "force z")] {
                    legend.push((ink, label.to_owned()));
                }
            }
        }
        let end = paths.iter().filter_map(|(_, path)| path.time.last()).copied().fold(0.1, f64::max);
        let shown: Vec<&str> = legend
            .iter()
            .filter(|(ink, _)| matches!(ink, Ink::Demonstration | Ink::Plan | Ink::Execution))
            .map(|(_, label)| label.as_str())
            .collect();
        let listed = match shown.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} and {last}", rest.join(", ")),
            _ => shown.join(""),
        };
        Ok(Page {
            title: format!("{}: {listed}", self.name),
            x_label: "time (s)".to_owned(),
            x_range: (0.0, end),
            rows,
            legend,
        })
    }
}

/// Time since the first sample.
fn relative_time(run: &Recording) -> Vec<f64> {
    let first = run.time.first().copied().unwrap_or(0.0);
    run.time.iter().map(|time| time - first).collect()
}

fn execution_path(run: &Recording) -> Option<PosePath> {
    Some(PosePath { time: relative_time(run), position: run.position.clone()?, orientation: run.orientation.clone()? })
}

fn desired_path(run: &Recording) -> Option<PosePath> {
    Some(PosePath {
        time: relative_time(run),
        position: run.position_d.clone()?,
        orientation: run.orientation_d.clone()?,
    })
}

fn curve(ink: Ink, time: &[f64], values: impl Iterator<Item = f64>) -> Curve {
    Curve { ink, points: time.iter().copied().zip(values).collect() }
}

fn position_panels(paths: &[(Ink, &PosePath)]) -> Vec<Panel> {
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(axis, name)| Panel {
            title: format!("Position {name}"),
            y_label: format!("{name} (m)"),
            curves: paths
                .iter()
                .map(|(ink, path)| curve(*ink, &path.time, path.position.iter().map(|x| x[axis])))
                .collect(),
            least_height: 0.02,
            from_zero: false,
        })
        .collect()
}

fn orientation_panels(paths: &[(Ink, &PosePath)], goal: &[f64; 4], from: &str) -> Vec<Panel> {
    let vectors: Vec<Vec<[f64; 3]>> = paths.iter().map(|(_, path)| rotation_vectors(goal, &path.orientation)).collect();
    ["x", "y", "z"]
        .iter()
        .enumerate()
        .map(|(axis, name)| Panel {
            title: format!("Orientation about {name}"),
            y_label: from.to_owned(),
            curves: paths
                .iter()
                .zip(&vectors)
                .map(|((ink, path), vectors)| curve(*ink, &path.time, vectors.iter().map(|r| r[axis].to_degrees())))
                .collect(),
            least_height: 4.0,
            from_zero: false,
        })
        .collect()
}

fn error_panels(run: &Recording) -> Vec<Panel> {
    let time = relative_time(run);
    let mut panels = Vec::new();
    if let (Some(errors), Ok(tracking)) = (tracking::errors(run), Tracking::of_run(run)) {
        panels.push(Panel {
            title: format!(
                "Position error: RMS {:.2} mm, end {:.2} mm",
                tracking.position_rms_m * 1e3,
                tracking.position_end_m * 1e3
            ),
            y_label: "distance to plan (mm)".to_owned(),
            curves: vec![curve(Ink::Execution, &time, errors.iter().map(|error| error.0 * 1e3))],
            least_height: 1.0,
            from_zero: true,
        });
        panels.push(Panel {
            title: format!(
                "Orientation error: RMS {:.2}°, end {:.2}°",
                tracking.orientation_rms_rad.to_degrees(),
                tracking.orientation_end_rad.to_degrees()
            ),
            y_label: "angle to plan (deg)".to_owned(),
            curves: vec![curve(Ink::Execution, &time, errors.iter().map(|error| error.1.to_degrees()))],
            least_height: 0.2,
            from_zero: true,
        });
    }
    if let Some(wrench) = &run.wrench {
        let inks = [Ink::First, Ink::Second, Ink::Third];
        panels.push(Panel {
            title: "Force of the environment on the hand".to_owned(),
            y_label: "force (N)".to_owned(),
            curves: inks
                .iter()
                .enumerate()
                .map(|(axis, ink)| curve(*ink, &time, wrench.iter().map(|wrench| wrench[axis])))
                .collect(),
            least_height: 2.0,
            from_zero: false,
        });
    }
    panels
}

/// Spread and fingers, measured and planned, where a hand was recorded.
fn hand_panels(run: &Recording) -> Option<Vec<Panel>> {
    let hand = run.hand.as_ref()?;
    let time = relative_time(run);
    let panel = |digit: usize| {
        let mut curves = vec![curve(Ink::Execution, &time, hand.iter().map(|angles| angles[digit]))];
        if let Some(planned) = &run.hand_d {
            curves.push(curve(Ink::Plan, &time, planned.iter().map(|angles| angles[digit])));
        }
        Panel {
            title: ["Spread", "Finger F1", "Finger F2", "Finger F3"][digit].to_owned(),
            y_label: "angle (rad)".to_owned(),
            curves,
            least_height: 0.1,
            from_zero: false,
        }
    };
    Some((0..4).map(panel).collect())
}

/// Two rows of four: the seven joints, and the share of each joint's limit that was used at most.
fn torque_panels(run: &Recording) -> Vec<Vec<Panel>> {
    let Some(tau) = &run.tau else {
        return Vec::new();
    };
    let time = relative_time(run);
    let end = time.last().copied().unwrap_or(0.0);
    let limits = *crate::arm::TORQUE_LIMITS;
    let panel = |joint: usize| {
        let torque: Vec<f64> = tau.iter().map(|tau| tau[joint]).collect();
        let peak = torque.iter().fold(0.0_f64, |peak, value| peak.max(value.abs()));
        let limit = limits[joint];
        let mut curves = vec![curve(Ink::Execution, &time, torque.into_iter())];
        for side in [-limit, limit] {
            curves.push(Curve { ink: Ink::Limit, points: vec![(0.0, side), (end, side)] });
        }
        Panel {
            title: format!("Torque J{}: peak {:.0} % of limit", joint + 1, 100.0 * peak / limit),
            y_label: "torque (N m)".to_owned(),
            curves,
            least_height: 0.1,
            from_zero: false,
        }
    };
    let share = Panel {
        title: "Largest share of a torque limit".to_owned(),
        y_label: "share (%)".to_owned(),
        curves: vec![
            curve(
                Ink::Execution,
                &time,
                tau.iter().map(|tau| {
                    100.0 * tau.iter().zip(&limits).map(|(tau, limit)| tau.abs() / limit).fold(0.0, f64::max)
                }),
            ),
            Curve { ink: Ink::Limit, points: vec![(0.0, 100.0), (end, 100.0)] },
        ],
        least_height: 100.0,
        from_zero: true,
    };
    vec![(0..4).map(panel).collect(), (4..7).map(panel).chain([share]).collect()]
}

/// Rotation vectors from `goal`, body axes, rad, continuous over a path: beyond 180 degrees the vector goes on
/// growing instead of jumping to the other side.
pub fn rotation_vectors(goal: &[f64; 4], path: &[[f64; 4]]) -> Vec<[f64; 3]> {
    let mut path = path.to_vec();
    // The path ends near the goal: going backwards from there keeps the sign that belongs to the way taken.
    let mut next = *goal;
    for quaternion in path.iter_mut().rev() {
        let dot: f64 = quaternion.iter().zip(&next).map(|(a, b)| a * b).sum();
        if dot < 0.0 {
            *quaternion = quaternion.map(|part| -part);
        }
        next = *quaternion;
    }
    path.iter()
        .map(|q| {
            let [gw, gx, gy, gz] = *goal;
            let [w, x, y, z] = *q;
            let scalar = gw * w + gx * x + gy * y + gz * z;
            let vector = [
                gw * x - gx * w - (gy * z - gz * y),
                gw * y - gy * w - (gz * x - gx * z),
                gw * z - gz * w - (gx * y - gy * x),
            ];
            let norm = vector.iter().map(|part| part * part).sum::<f64>().sqrt();
            let angle = 2.0 * norm.atan2(scalar);
            let scale = if norm > 1e-12 { angle / norm } else { 2.0 };
            vector.map(|part| part * scale)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn about(axis: [f64; 3], angle: f64) -> [f64; 4] {
        let (s, c) = (angle / 2.0).sin_cos();
        [c, s * axis[0], s * axis[1], s * axis[2]]
    }

    /// A run whose plan was bent by 0.2 rad about x, and ends there.
    #[test]
    fn angles_are_those_to_the_goal_that_was_taught_and_to_the_end_where_nobody_knows_the_goal() {
        let path = |end: f64| PosePath {
            time: vec![0.0, 1.0],
            position: vec![[0.0; 3]; 2],
            orientation: vec![[1.0, 0.0, 0.0, 0.0], about([1.0, 0.0, 0.0], end)],
        };
        let mut text = String::from("t_s,x_m,y_m,z_m,qw,qx,qy,qz,x_d_m,y_d_m,z_d_m,qw_d,qx_d,qy_d,qz_d\n");
        for k in 0..100 {
            let [w, x, ..] = about([1.0, 0.0, 0.0], 0.7 * f64::from(k) / 99.0);
            text += &format!("{},0,0,0,{w},{x},0,0,0,0,0,{w},{x},0,0\n", f64::from(k) * 0.01);
        }
        let execution = Recording::parse(std::path::Path::new("run.csv"), text.as_bytes()).unwrap();
        let mut movement = Movement { plan: Some(path(0.5)), execution: Some(execution), ..Movement::default() };
        let about_x = |movement: &Movement| {
            let page = movement.page().unwrap();
            let panel = page.rows[1][0].clone();
            let plan = panel.curves.into_iter().find(|curve| curve.ink == Ink::Plan).unwrap();
            (panel.y_label, plan.points.last().unwrap().1)
        };
        let (label, end) = about_x(&movement);
        assert!(label == "from the goal (deg)" && (end - 0.2_f64.to_degrees()).abs() < 1e-6, "{label}: {end}");
        movement.plan = None;
        let (label, end) = about_x(&movement);
        assert!(label == "from its end (deg)" && end.abs() < 1e-6, "{label}: {end}");
    }

    #[test]
    fn rotation_vector_is_that_of_the_turn_from_the_goal_in_body_axes() {
        // R(goal) turns body y to world -x... the vector is seen in the goal's own axes.
        let goal = about([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2);
        let q = about([0.0, 0.0, 1.0], std::f64::consts::FRAC_PI_2 + 0.3);
        let vector = rotation_vectors(&goal, &[q])[0];
        assert!((vector[2] - 0.3).abs() < 1e-12, "{vector:?}");
        // goal (x) rotation about body x by 0.2
        let (s, c) = 0.1_f64.sin_cos();
        let body = [goal[0] * c, goal[0] * s, goal[3] * s, goal[3] * c];
        let vector = rotation_vectors(&goal, &[body])[0];
        assert!((vector[0] - 0.2).abs() < 1e-12, "{vector:?}");
        assert!(vector[1].abs() < 1e-12 && vector[2].abs() < 1e-12);
    }

    #[test]
    fn a_turn_beyond_half_a_revolution_does_not_jump() {
        let goal = [1.0, 0.0, 0.0, 0.0];
        let path: Vec<[f64; 4]> =
            (0..=100).map(|k| about([0.0, 1.0, 0.0], 5.0 * (1.0 - f64::from(k) / 100.0))).collect();
        let vectors = rotation_vectors(&goal, &path);
        assert!((vectors[0][1] - 5.0).abs() < 1e-9);
        for pair in vectors.windows(2) {
            assert!((pair[0][1] - pair[1][1] - 0.05).abs() < 1e-9);
        }
    }
}
