//! Eq (10) is the printed sum, with the rotors in its mass matrix.

use control::law::{Gains, JointController};
use control::model::{ArmModel, Frames};
use control::plan::JointReference;
use control::sense::JointState;
use control::units::{JointAccelerations, JointPositions, JointVelocities, Vector7};
use control::{Payload, model};

#[test]
fn the_torque_is_inertia_bias_feedback_and_friction() {
    let arm = ArmModel::<f64>::new(Payload::SensorAndHand);
    let gains = Gains::<f64>::tuned().stiff;
    let state = JointState::whole(
        JointPositions::from_array([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]),
        JointVelocities::from_array([0.2, -0.1, 0.3, 0.4, -0.5, 0.6, -0.2]),
    );
    let reference = JointReference {
        q: JointPositions(state.q.0 + Vector7::from([0.01, -0.02, 0.01, 0.02, -0.03, 0.01, 0.02])),
        dq: JointVelocities::from_array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]),
        ddq: JointAccelerations::from_array([1.0, -2.0, 0.5, 3.0, -4.0, 2.0, 5.0]),
        planned: JointVelocities::from_array([-1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0]),
    };
    let frames = Frames::new(&arm, &state.q);
    let mut controller = JointController::new(0.01);
    let torque = controller.torque(&arm, &gains, &frames, &state, &state.dq.0, &reference).0;

    let friction = Vector7::from_fn(|joint, _| {
        let rate = reference.planned.0[joint];
        // At 1 rad/s the smoothed sign is 1/1.01.
        model::FRICTION_VISCOUS[joint] * rate + 0.8 * model::FRICTION_COULOMB[joint] * rate / 1.01
    });
    let feedback = gains.stiffness.component_mul(&(reference.q.0 - state.q.0))
        + gains.damping.component_mul(&(reference.dq.0 - state.dq.0));
    let expected = arm.mass_matrix(&frames) * reference.ddq.0
        + arm.coriolis_torque(&frames, &state.dq).0
        + arm.gravity_torque(&frames).0
        + feedback
        + friction;
    assert!((torque - expected).amax() < 1e-10, "{torque} {expected}");

    // Frozen, the feedback of the last good cycle stays, whatever the extrapolated state is.
    let elsewhere = JointState { q: JointPositions(state.q.0 * 1.1), extrapolated: 0b111_1111, ..state };
    let frozen = controller.torque(&arm, &gains, &frames, &elsewhere, &state.dq.0, &reference).0;
    assert!((frozen - torque).amax() < 1e-10);
    // So it does for the joints of a motor that is missing; those of the others go on.
    let elsewhere = JointState { extrapolated: 0b110, ..elsewhere };
    let partly = controller.torque(&arm, &gains, &frames, &elsewhere, &state.dq.0, &reference).0;
    for joint in 0..7 {
        assert_eq!((partly[joint] - torque[joint]).abs() < 1e-10, [1, 2].contains(&joint), "J{}", joint + 1);
    }
}

/// The change that makes it fail: what measured motion asks for is taken from the velocity that is fed back, or the
/// feedback from the measured one.
#[test]
fn the_feedback_of_an_observed_velocity_and_that_of_the_measured_one_are_told_apart_and_forgotten() {
    let arm = ArmModel::<f64>::new(Payload::SensorAndHand);
    let gains = Gains::<f64>::tuned().stiff;
    let q = JointPositions::from_array([-0.49, 1.56, 1.47, 1.85, -0.17, -0.58, 1.75]);
    let state = JointState::whole(q, JointVelocities::from_array([0.2, -0.1, 0.3, 0.4, -0.5, 0.6, -0.2]));
    let reference = JointReference {
        q: JointPositions(q.0 + Vector7::from([0.01, -0.02, 0.01, 0.02, -0.03, 0.01, 0.02])),
        dq: JointVelocities::from_array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0, 1.0]),
        ddq: JointAccelerations::zero(),
        planned: JointVelocities::from_array([-1.0, -1.0, -1.0, 1.0, 1.0, -1.0, 1.0]),
    };
    let observed = Vector7::from([0.1, 0.2, -0.3, 0.1, 0.2, -0.1, 0.4]);
    let mut controller = JointController::new(0.01);
    controller.torque(&arm, &gains, &Frames::new(&arm, &q), &state, &observed, &reference);
    let spring = gains.stiffness.component_mul(&(reference.q.0 - q.0));
    let feedback = |velocity: &Vector7<f64>| spring + gains.damping.component_mul(&(reference.dq.0 - velocity));
    assert!((controller.feedback() - feedback(&observed)).amax() < 1e-12);
    assert!((controller.measured_feedback() - feedback(&state.dq.0)).amax() < 1e-12);
    assert_eq!(*controller.desired(), reference.dq.0);
    assert!(controller.friction().iter().zip(reference.planned.0.iter()).all(|(torque, rate)| torque * rate > 0.0));
    controller.reset();
    for forgotten in
        [controller.feedback(), controller.measured_feedback(), controller.desired(), controller.friction()]
    {
        assert_eq!(*forgotten, Vector7::zeros());
    }
}
