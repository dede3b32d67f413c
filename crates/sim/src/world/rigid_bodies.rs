//! `Dynamics`: mass matrix of the WAM, the torques of its velocities, and the step in time that dry friction and joint
//! stops take part in.
//!
//! Written down apart from `control`, from the same figures: a wrong equation there must not cancel itself out here.

use crate::chain::{Frame, Vector, add, dot, subtract};
use crate::rotation::cross;
use crate::time::STEP_SECONDS;

/// Largest number of sweeps over the joints in one step, and the change of speed at which they end (rad/s).
const SWEEPS: usize = 60;
const CONVERGED: f64 = 1e-10;

/// A rigid body on a link.
#[derive(Clone, Copy, Debug)]
pub(super) struct Body {
    /// The link that it is part of, 0 to 6.
    pub(super) link: usize,
    /// Mass, kg.
    pub(super) mass: f64,
    /// Its centre, frame of the link, m.
    pub(super) centre: Vector,
    /// Inertia about its centre, axes of the frame of the link: xx, yy, zz, xy, xz, yz, kg m^2.
    pub(super) inertia: [f64; 6],
}

impl Body {
    /// True of what an empty hand holds, for example: a third of the work is for bodies of this kind.
    fn is_nothing(&self) -> bool {
        self.mass == 0.0 && self.inertia == [0.0; 6]
    }
}

/// Equation of motion at one state: `mass ddq + velocity = torque`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Dynamics {
    /// Mass matrix of the links, kg m^2.
    pub(super) mass: [[f64; 7]; 7],
    /// Centrifugal and Coriolis torques, N m.
    pub(super) velocity: [f64; 7],
}

/// Motion of one link with all joint accelerations zero, world axes.
#[derive(Clone, Copy, Default)]
struct Motion {
    /// Angular velocity, rad/s.
    turn: Vector,
    /// Angular acceleration, rad/s^2.
    turn_rate: Vector,
    /// Acceleration of the origin of its joint, m/s^2.
    origin: Vector,
}

impl Motion {
    /// Acceleration of a point of the link that is `arm` away from the origin of its joint.
    fn at(&self, arm: Vector) -> Vector {
        add(self.origin, add(cross(self.turn_rate, arm), cross(self.turn, cross(self.turn, arm))))
    }
}

impl Dynamics {
    /// Of these bodies, with the frames at a posture (rad) and joint speeds (rad/s).
    pub(super) fn of(bodies: &[Body], frames: &[Frame; 8], speeds: &[f64; 7]) -> Self {
        let motions = motions(frames, speeds);
        let mut dynamics = Dynamics { mass: [[0.0; 7]; 7], velocity: [0.0; 7] };
        for body in bodies.iter().filter(|body| !body.is_nothing()) {
            let (frame, motion) = (&frames[body.link + 1], &motions[body.link]);
            let centre = frame.point(body.centre);
            let inertia = |about: Vector| frame.turn(times(&body.inertia, frame.turn_back(about)));
            let force = motion.at(subtract(centre, frames[body.link].origin)).map(|rate| rate * body.mass);
            let spin = add(inertia(motion.turn_rate), cross(motion.turn, inertia(motion.turn)));
            // Axis of each joint, and the way of the centre if it turns.
            let mut ways = [(Vector::default(), Vector::default()); 7];
            for row in 0..=body.link {
                let Frame { origin, axes: [.., axis] } = frames[row];
                let way = cross(axis, subtract(centre, origin));
                ways[row] = (axis, way);
                let (pushed, turned) = (way.map(|part| part * body.mass), inertia(axis));
                dynamics.velocity[row] += dot(way, force) + dot(axis, spin);
                for (column, (other, its_way)) in ways.into_iter().enumerate().take(row + 1) {
                    let share = dot(its_way, pushed) + dot(other, turned);
                    dynamics.mass[row][column] += share;
                    if column != row {
                        dynamics.mass[column][row] += share;
                    }
                }
            }
        }
        dynamics
    }

    /// Joint speeds one step later (rad/s), from `speeds`, under `torques` (N m) and friction (viscous N m s/rad,
    /// Coulomb N m), of joints that cannot turn faster than `bounds` (rad/s), which is where their stops are.
    ///
    /// The speeds are those at which `v M v / 2 - p v + h sum c |v|` is least within the bounds, `p` the momentum that
    /// the step would make without dry friction: that is Coulomb friction, sticking included, of coupled joints. Joint
    /// by joint, over and over, the least is found whatever the step.
    pub(super) fn step(
        &self,
        speeds: &[f64; 7],
        torques: &[f64; 7],
        (viscous, coulomb): (&[f64; 7], &[f64; 7]),
        bounds: &[(f64, f64); 7],
    ) -> [f64; 7] {
        let momentum: [f64; 7] = std::array::from_fn(|row| {
            let carried: f64 = self.mass[row].iter().zip(speeds).map(|(mass, speed)| mass * speed).sum();
            carried + STEP_SECONDS * (torques[row] - self.velocity[row])
        });
        // Of the other joints only, and still one sum of seven: a sum with a gap is not unrolled.
        let mut coupling = self.mass;
        (0..7).for_each(|joint| coupling[joint][joint] = 0.0);
        let mut next = *speeds;
        for _ in 0..SWEEPS {
            let mut change = 0.0f64;
            for row in 0..7 {
                let of_others: f64 = coupling[row].iter().zip(&next).map(|(mass, speed)| mass * speed).sum();
                let left = momentum[row] - of_others;
                let rubbed = left.signum() * (left.abs() - STEP_SECONDS * coulomb[row]).max(0.0);
                let (slowest, fastest) = bounds[row];
                let speed = (rubbed / (self.mass[row][row] + STEP_SECONDS * viscous[row])).clamp(slowest, fastest);
                change = change.max((speed - next[row]).abs());
                next[row] = speed;
            }
            if change < CONVERGED {
                break;
            }
        }
        next
    }
}

/// Motion of each link.
fn motions(frames: &[Frame; 8], speeds: &[f64; 7]) -> [Motion; 7] {
    let mut before = Motion::default();
    std::array::from_fn(|link| {
        let turning = frames[link].axes[2].map(|part| part * speeds[link]);
        let motion = Motion {
            turn: add(before.turn, turning),
            turn_rate: add(before.turn_rate, cross(before.turn, turning)),
            origin: before.origin,
        };
        before = Motion { origin: motion.at(subtract(frames[link + 1].origin, frames[link].origin)), ..motion };
        motion
    })
}

/// A symmetric tensor (xx, yy, zz, xy, xz, yz) times a vector.
fn times([xx, yy, zz, xy, xz, yz]: &[f64; 6], [x, y, z]: Vector) -> Vector {
    [xx * x + xy * y + xz * z, xy * x + yy * y + yz * z, xz * x + yz * y + zz * z]
}

#[cfg(test)]
mod tests {
    use super::*;

    const FREE: [(f64, f64); 7] = [(f64::NEG_INFINITY, f64::INFINITY); 7];

    /// Two joints of one 2 kg m^2 each, coupled by 1 kg m^2; the others are alone.
    fn coupled() -> Dynamics {
        let mut mass = [[0.0; 7]; 7];
        (0..7).for_each(|joint| mass[joint][joint] = 2.0);
        (mass[0][1], mass[1][0]) = (1.0, 1.0);
        Dynamics { mass, velocity: [0.0; 7] }
    }

    /// The change that makes it fail: the torque of a joint moves that joint alone.
    #[test]
    fn a_torque_on_one_joint_throws_the_other_back_and_one_that_sticks_holds_it() {
        let torques = [6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let rubbing = |coulomb: f64| {
            let mut friction = [0.0; 7];
            friction[1] = coulomb;
            coupled().step(&[0.0; 7], &torques, (&[0.0; 7], &friction), &FREE).map(|speed| speed / STEP_SECONDS)
        };
        // [2 1; 1 2] ddq = [6; 0].
        let free = rubbing(0.0);
        assert!((free[0] - 4.0).abs() < 1e-5 && (free[1] + 2.0).abs() < 1e-5, "{free:?}");
        // J2 has to be held with 3 N m: [2] ddq = [6].
        let held = rubbing(3.1);
        assert!((held[0] - 3.0).abs() < 1e-5 && held[1] == 0.0, "{held:?}");
        // 1 N m of friction: [2 1; 1 2] ddq = [6; 1].
        let sliding = rubbing(1.0);
        assert!((sliding[0] - 11.0 / 3.0).abs() < 1e-5 && (sliding[1] + 4.0 / 3.0).abs() < 1e-5, "{sliding:?}");
    }

    #[test]
    fn a_joint_at_its_stop_does_not_go_on_whatever_the_other_does() {
        let mut bounds = FREE;
        bounds[1] = (0.0, f64::INFINITY);
        let torques = [6.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
        let speeds = coupled().step(&[0.0; 7], &torques, (&[0.0; 7], &[0.0; 7]), &bounds);
        assert!((speeds[0] / STEP_SECONDS - 3.0).abs() < 1e-5 && speeds[1] == 0.0, "{speeds:?}");
    }
}
