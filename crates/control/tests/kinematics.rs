//! Frames and signs of the kinematics that the golden vectors cannot show: derivatives, pseudo-inverse, orientation
//! error.

use control::model::{ArmModel, Frames};
use control::units::{JointPositions, JointVelocities, Orientation, Vector6, Vector7};
use control::{Payload, Real};
use nalgebra::{Rotation3, Vector3};

const POSTURES: [[f64; 7]; 3] = [
    [-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75],
    [0.7, -0.9, 0.4, 1.2, -2.0, 0.8, -1.1],
    [0.0, 1.0, 0.0, 1.5, 0.0, 0.3, 0.0],
];

fn model() -> ArmModel<f64> {
    ArmModel::new(Payload::SensorAndHand)
}

fn frames(q: [f64; 7]) -> Frames<f64> {
    Frames::new(&model(), &JointPositions::from_array(q))
}

#[test]
fn the_jacobian_is_the_derivative_of_the_pose_in_world_axes() {
    let dq = Vector7::from([0.3, -0.5, 0.7, 0.2, -0.9, 0.4, 0.6]);
    for q in POSTURES {
        let step = 1e-6;
        let (before, after) = [-step, step].map(|h| frames((Vector7::from(q) + dq * h).into()).tool_pose()).into();
        let before: control::units::Pose<f64> = before;
        let linear = (after.position - before.position) / (2.0 * step);
        // 2 vec(q1 (x) conj(q0)) is a rotation in world axes.
        let angular = before.orientation.error_to(&after.orientation) / (2.0 * step);
        let twist = frames(q).jacobian().twist(&dq);
        assert!((twist.fixed_rows::<3>(0) - linear).norm() < 1e-7, "{twist} {linear}");
        assert!((twist.fixed_rows::<3>(3) - angular).norm() < 1e-7, "{twist} {angular}");
        // The same velocity in body axes is something else: the check can tell the frames apart.
        let body = frames(q).tool_to_world().transpose() * angular;
        assert!((twist.fixed_rows::<3>(3) - body).norm() > 0.1);
    }
}

#[test]
fn a_wrench_does_the_same_work_at_the_joints_and_at_the_tool() {
    let dq = Vector7::from([0.3, -0.5, 0.7, 0.2, -0.9, 0.4, 0.6]);
    let wrench = Vector6::new(3.0, -2.0, 5.0, 0.4, 0.1, -0.3);
    for q in POSTURES {
        let jacobian = frames(q).jacobian();
        let power = jacobian.transpose_times(&wrench).dot(&dq);
        assert!((power - wrench.dot(&jacobian.twist(&dq))).abs() < 1e-12);
        assert!((frames(q).joint_torques(&wrench).0 - jacobian.transpose_times(&wrench)).amax() < 1e-12);
    }
}

#[test]
fn the_pseudo_inverse_does_the_task_and_the_rest_does_not_disturb_it() {
    let task = Vector6::new(0.05, -0.03, 0.02, 0.1, -0.2, 0.15);
    let posture = Vector7::from([0.5, -0.4, 0.3, 0.2, -0.6, 0.1, 0.4]);
    for q in POSTURES {
        let jacobian = frames(q).jacobian();
        // Almost undamped it is exact, with and without a preferred posture.
        let inverse = jacobian.damped(1e-9);
        for bias in [Vector7::zeros(), posture] {
            assert!((jacobian.twist(&inverse.resolve(&task, &bias)) - task).norm() < 1e-4);
        }
        // Against the definition, with damping.
        let lambda = 0.01;
        let gram = jacobian.0 * jacobian.0.transpose() + nalgebra::SMatrix::<f64, 6, 6>::identity() * lambda;
        let direct = jacobian.0.transpose() * gram.try_inverse().expect("damped");
        let expected = direct * task + posture - direct * (jacobian.0 * posture);
        assert!((jacobian.damped(lambda).resolve(&task, &posture) - expected).norm() < 1e-12);
        // Without a task the null space is a motion that leaves the tool alone.
        let still = inverse.resolve(&Vector6::zeros(), &posture);
        assert!(still.norm() > 1e-3 && jacobian.twist(&still).norm() < 1e-4);
    }
}

#[test]
fn b8_the_damped_inverse_is_finite_in_a_singular_posture_even_in_single_precision() {
    let model = ArmModel::<f32>::new(Payload::SensorAndHand);
    for q in [[0.0f32; 7], [0.0, 1.57, 0.0, 0.0, 0.0, 0.0, 0.0], [0.3, 0.0, 0.5, 0.0, 0.2, 0.0, 0.1]] {
        let jacobian = Frames::new(&model, &JointPositions::from_array(q)).jacobian();
        let dq = jacobian.damped(4e-4).resolve(&Vector6::new(0.1, 0.1, 0.1, 0.5, 0.5, 0.5), &Vector7::zeros());
        // |J^+| <= 1/(2 sqrt(lambda)) = 25.
        assert!(dq.iter().all(|rate| rate.is_finite_number()) && dq.norm() < 25.0, "{dq}");
    }
}

#[test]
fn the_orientation_error_turns_towards_the_goal_in_world_axes_on_the_short_way() {
    for (axis, angle) in [(Vector3::new(0.2, -0.5, 0.8), 0.3f64), (Vector3::new(1.0, 0.4, -0.2), -0.2)] {
        let axis = axis.normalize();
        let start = Rotation3::from_euler_angles(0.4, -0.7, 1.1);
        let goal = Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle) * start;
        let q = Orientation::from_matrix(start.matrix());
        let q_d = Orientation::from_matrix(goal.matrix());
        let expected = axis * 2.0 * (angle / 2.0).sin();
        assert!((q.error_to(&q_d) - expected).norm() < 1e-12);
        // -q_d is the same orientation.
        assert!((q.error_to(&Orientation(q_d.0.map(|c| -c))) - expected).norm() < 1e-12);
    }
}

#[test]
fn quaternions_and_matrices_agree_for_every_branch() {
    for euler in [[0.1, 0.2, 0.3], [3.0, 0.1, 0.2], [0.1, 3.0, 0.2], [0.1, 0.2, 3.1], [1.5, 1.5, 1.5], [3.0, 0.0, 3.0]]
    {
        let matrix = *Rotation3::from_euler_angles(euler[0], euler[1], euler[2]).matrix();
        let orientation = Orientation::from_matrix(&matrix);
        assert!((orientation.to_matrix() - matrix).amax() < 1e-12);
        assert!(orientation.0[0] >= 0.0);
    }
}

#[test]
fn watched_speeds_are_derivatives_of_points_on_the_arm() {
    let dq = JointVelocities::from_array([0.4, -0.3, 0.6, 0.5, 1.0, 1.0, 1.0]);
    for q in POSTURES {
        // By forward kinematics of the bare geometry: the elbow 0.55 m up the upper arm and 0.045 m aside, the point
        // beyond it along the forearm, which J4 bends.
        let points = |q: &Vector7<f64>| {
            let turn = |axis: Vector3<f64>, angle: f64| {
                Rotation3::from_axis_angle(&nalgebra::Unit::new_unchecked(axis), angle)
            };
            let rotation = turn(Vector3::z(), q[0]) * turn(Vector3::y(), q[1]) * turn(Vector3::z(), q[2]);
            let elbow = rotation * Vector3::new(0.045, 0.0, 0.55);
            let tip = elbow + rotation * turn(Vector3::y(), q[3]) * Vector3::new(0.0, 0.0, 0.35);
            [elbow, tip, frames((*q).into()).tool_pose().position]
        };
        let h = 1e-6;
        let q = Vector7::from(q);
        let (before, after) = (points(&(q - dq.0 * h)), points(&(q + dq.0 * h)));
        for (point, computed) in frames(q.into()).watched_speeds(&dq, 0.35).into_iter().enumerate() {
            let speed = ((after[point] - before[point]) / (2.0 * h)).norm();
            assert!((computed - speed).abs() < 1e-6, "{point}: {computed} {speed}");
        }
    }
}

#[test]
fn single_precision_sine_and_cosine_are_those_of_the_library() {
    // (half range in rad, bound): one turn, and every angle a joint can have.
    for (range, bound) in [(std::f64::consts::PI, 1e-7), (5.0, 2.5e-7)] {
        let mut worst = 0.0f64;
        for step in -100_000..=100_000 {
            let x = (range * f64::from(step) / 1e5) as f32;
            let (s, c) = x.sine_cosine();
            let deviation = (f64::from(s) - f64::from(x).sin()).abs().max((f64::from(c) - f64::from(x).cos()).abs());
            worst = worst.max(deviation);
        }
        println!("within {range}: {worst:e}");
        assert!(worst < bound, "{worst}");
    }
}
