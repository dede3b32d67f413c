//! An arm whose links weigh otherwise than the model says: it floats once its weight is known, and not before.

use control::model::{ArmModel, Frames, LinkWeight, MASS_SHARE, MOMENT_SHIFT, WeightCorrection};
use control::units::JointPositions;
use control::{Calibration, Command, Fault, Payload, Refusal, State};

use crate::rig::Rig;

const POSTURE: [f64; 7] = [0.0, 0.6, 0.0, 1.6, 0.0, 0.2, 0.0];

/// Upper arm and forearm are heavier, the forearm's centre is farther out.
fn heavier() -> WeightCorrection {
    let mut links = [LinkWeight::default(); 7];
    links[2].share = 0.1;
    links[3] = LinkWeight { share: 0.1, shift: [0.0, 0.0, 0.02] };
    WeightCorrection::new(Payload::SensorAndHand, links).expect("an arm can weigh that")
}

/// The arm of this weight, with little friction.
fn rig() -> Rig<f32> {
    let mut rig = Rig::<f32>::new(POSTURE, 1);
    rig.plant.coulomb *= 0.1;
    rig.plant.model = ArmModel::corrected(Payload::SensorAndHand, &heavier());
    rig
}

/// Returns how far the tool sinks in half a second of gravity compensation (m).
fn sunk(rig: &mut Rig<f32>) -> f64 {
    rig.command(Command::Hold);
    rig.run_for(2.0);
    rig.command(Command::Gravity);
    let before = rig.plant.frames().tool_pose().position.z;
    rig.run_for(0.5);
    before - rig.plant.frames().tool_pose().position.z
}

#[test]
fn an_arm_that_is_heavier_than_the_model_sinks_until_its_weight_is_known() {
    let unknown = sunk(&mut rig());
    let mut known = rig();
    known.cycle.weigh(&heavier()).expect("no torque is on");
    let known = sunk(&mut known);
    let mut inverted = rig();
    let links =
        heavier().links().map(|LinkWeight { share, shift }| LinkWeight { share: -share, shift: shift.map(|e| -e) });
    inverted.cycle.weigh(&WeightCorrection::new(Payload::SensorAndHand, links).expect("possible")).expect("no torque");
    let inverted = sunk(&mut inverted);
    println!("sunk {unknown:.4} m unknown, {known:.5} m known, {inverted:.4} m with the wrong sign");
    assert!(unknown > 0.02 && inverted > 1.2 * unknown);
    assert!(known.abs() < 1e-3);
}

#[test]
fn a_weight_is_taken_without_torque_only_and_outlives_a_restart_of_the_bus() {
    let torque = |rig: &Rig<f32>| {
        let model = rig.cycle.model();
        model.gravity_torque(&Frames::new(model, &JointPositions::from_array(POSTURE.map(|q| q as f32)))).0
    };
    let mut rig = rig();
    let nominal = torque(&rig);
    rig.command(Command::Hold);
    assert_eq!(rig.cycle.weigh(&heavier()), Err(Refusal::WrongState));
    assert_eq!(torque(&rig), nominal);
    rig.cycle.reset();
    rig.cycle.weigh(&heavier()).expect("no torque is on");
    let own = torque(&rig);
    assert!(own[1].abs() > nominal[1].abs() + 0.5, "{own} {nominal}");
    rig.cycle.reset();
    rig.cycle.calibrate(Calibration::nominal(Payload::SensorAndHand)).expect("idle");
    assert_eq!(torque(&rig), own);
    // It was measured with the hand: the bare arm is that of the model.
    rig.cycle.calibrate(Calibration::nominal(Payload::None)).expect("idle");
    let bare = ArmModel::<f32>::new(Payload::None);
    let frames = Frames::new(&bare, &JointPositions::from_array(POSTURE.map(|q| q as f32)));
    assert_eq!(torque(&rig), bare.gravity_torque(&frames).0);
    // And again with the hand, and with the weight forgotten.
    rig.cycle.calibrate(Calibration::nominal(Payload::SensorAndHand)).expect("idle");
    assert_eq!(torque(&rig), own);
    rig.cycle.weigh(&WeightCorrection::none(Payload::SensorAndHand)).expect("no torque is on");
    assert_eq!(torque(&rig), nominal);
}

#[test]
fn every_weight_within_the_bounds_is_one_that_a_body_can_have() {
    for signs in 0_u32..16 {
        let sign = |bit: u32| if signs >> bit & 1 == 0 { 1.0 } else { -1.0 };
        let link = LinkWeight { share: MASS_SHARE * sign(0), shift: [1, 2, 3].map(|bit| MOMENT_SHIFT * sign(bit)) };
        let weight = WeightCorrection::new(Payload::SensorAndHand, [link; 7]).expect("at the bound");
        let model = ArmModel::<f64>::corrected(Payload::SensorAndHand, &weight);
        for q in [POSTURE, [0.3, -1.2, 0.8, 2.4, -1.0, 0.7, -0.4], [0.0; 7]] {
            let mass = model.mass_matrix(&Frames::new(&model, &JointPositions::from_array(q)));
            assert!(mass.cholesky().is_some(), "{weight:?}");
        }
        let beyond = LinkWeight { share: link.share * 1.01, ..link };
        assert!(WeightCorrection::new(Payload::None, [beyond; 7]).is_err());
    }
}

/// An arm on whose bus no sensor answers, so that it is taken for a bare one.
fn bare(carries: Payload, posture: [f64; 7]) -> Rig<f32> {
    let mut rig = Rig::<f32>::new(posture, 1);
    rig.cycle.calibrate(Calibration::nominal(Payload::None)).expect("idle");
    rig.plant.model = ArmModel::new(carries);
    rig.plant.deaf = true;
    rig
}

#[test]
fn g4_a_hand_that_nobody_knows_of_stops_the_hold_by_its_weight() {
    for posture in [[0.0, 1.2, 0.0, 0.6, 0.0, 0.2, 0.0], [0.8, -1.0, 0.3, 0.5, 0.2, -0.3, 0.0], POSTURE] {
        for friction in [0.3, 1.0, 1.3] {
            let mut rig = bare(Payload::SensorAndHand, posture);
            rig.plant.coulomb *= friction;
            let hand = |rig: &Rig<f32>| rig.plant.frames().tool_pose().position;
            let before = hand(&rig);
            rig.command(Command::Hold);
            rig.until(State::SoftStop, 2.0);
            let output = rig.last.expect("ran");
            println!("{posture:?} x{friction}: cycle {}, {:.3} m", rig.number, (hand(&rig) - before).norm());
            assert_eq!(output.record.fault, Fault::UnseenContact);
            assert!(output.actuation.requests_idle(), "a soft stop does not carry what nobody knows of");
            assert!((hand(&rig) - before).norm() < 0.15);
        }
    }
}

#[test]
fn g4_a_bare_arm_holds_and_moves_as_ever() {
    for posture in [[0.0, 1.2, 0.0, 0.6, 0.0, 0.2, 0.0], [0.8, -1.0, 0.3, 0.5, 0.2, -0.3, 0.0], POSTURE] {
        for (friction, heavier) in [(0.0, 0.0), (0.7, 0.2), (1.3, -0.2)] {
            let mut rig = bare(Payload::None, posture);
            rig.plant.coulomb *= friction;
            rig.plant.model = ArmModel::disturbed(Payload::None, 1.0, heavier);
            rig.command(Command::Hold);
            rig.run_for(3.0);
            let record = rig.last.unwrap().record;
            assert_eq!(
                (record.state, record.fault),
                (State::Hold, Fault::None),
                "{posture:?} x{friction} {heavier} kg"
            );
        }
    }
}
