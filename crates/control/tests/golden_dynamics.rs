//! Kinematics and dynamics against the golden vectors (Pinocchio on the same model file).

use control::model::{ArmModel, Frames};
use control::units::{JointAccelerations, JointPositions, JointVelocities};
use control::{Payload, Real};

struct Posture(Vec<f64>);

impl Posture {
    fn joints(&self, start: usize) -> [f64; 7] {
        self.0[start..start + 7].try_into().expect("seven columns")
    }
}

fn rows(file: &str) -> Vec<Posture> {
    let path = format!("{}/../../tests/vectors/{file}", env!("CARGO_MANIFEST_DIR"));
    let mut reader = csv::ReaderBuilder::new().comment(Some(b'#')).from_path(path).expect("golden vectors exist");
    let header: Vec<String> = reader.headers().expect("a header").iter().map(str::to_owned).collect();
    // The columns are read by position below; these anchors pin the layout.
    for (index, name) in [
        (1, "q1"),
        (8, "qd1"),
        (15, "qdd1"),
        (22, "px"),
        (25, "qw"),
        (29, "J11"),
        (71, "M11"),
        (120, "c1"),
        (127, "g1"),
        (134, "tau1"),
        (141, "jdqd1"),
    ] {
        assert_eq!(header[index], name, "{file}");
    }
    let rows: Vec<Posture> = reader
        .records()
        .map(|record| Posture(record.expect("a row").iter().map(|field| field.parse().expect("a number")).collect()))
        .collect();
    assert_eq!(rows.len(), 100, "{file}");
    rows
}

/// Largest deviation per quantity.
#[derive(Debug, Default)]
struct Worst {
    position: f64,
    rotation: f64,
    jacobian: f64,
    mass: f64,
    torque: f64,
    velocity_product: f64,
}

fn grow(worst: &mut f64, computed: f64, expected: f64) {
    let deviation = (computed - expected).abs();
    assert!(deviation.is_finite());
    *worst = worst.max(deviation);
}

fn compare<R: Real>(file: &str, payload: Payload) -> Worst
where
    f64: From<R>,
{
    let model = ArmModel::<R>::new(payload);
    let mut worst = Worst::default();
    for row in rows(file) {
        let convert = |start| row.joints(start).map(R::constant);
        let q = JointPositions::from_array(convert(1));
        let dq = JointVelocities::from_array(convert(8));
        let ddq = JointAccelerations::from_array(convert(15));
        let frames = Frames::new(&model, &q);
        let pose = frames.tool_pose();
        for axis in 0..3 {
            grow(&mut worst.position, pose.position[axis].into(), row.0[22 + axis]);
        }
        let sign = if f64::from(pose.orientation.0[0]) * row.0[25]
            + f64::from(pose.orientation.0[1]) * row.0[26]
            + f64::from(pose.orientation.0[2]) * row.0[27]
            + f64::from(pose.orientation.0[3]) * row.0[28]
            < 0.0
        {
            -1.0
        } else {
            1.0
        };
        for component in 0..4 {
            grow(&mut worst.rotation, sign * f64::from(pose.orientation.0[component]), row.0[25 + component]);
        }
        let jacobian = frames.jacobian();
        for r in 0..6 {
            for c in 0..7 {
                grow(&mut worst.jacobian, jacobian.0[(r, c)].into(), row.0[29 + 7 * r + c]);
            }
        }
        let mass = model.link_mass_matrix(&frames);
        for r in 0..7 {
            for c in 0..7 {
                grow(&mut worst.mass, mass[(r, c)].into(), row.0[71 + 7 * r + c]);
            }
        }
        let coriolis = model.coriolis_torque(&frames, &dq);
        let gravity = model.gravity_torque(&frames);
        let torque = model.inverse_dynamics(&frames, &dq, &ddq);
        for joint in 0..7 {
            grow(&mut worst.torque, coriolis.0[joint].into(), row.0[120 + joint]);
            grow(&mut worst.torque, gravity.0[joint].into(), row.0[127 + joint]);
            grow(&mut worst.torque, torque.0[joint].into(), row.0[134 + joint]);
        }
        let product = frames.velocity_product(&dq).to_vector();
        for axis in 0..6 {
            grow(&mut worst.velocity_product, product[axis].into(), row.0[141 + axis]);
        }
    }
    println!("{file}: {worst:?}");
    worst
}

const FILES: [(&str, Payload); 2] =
    [("dyn_wam7.csv", Payload::None), ("dyn_wam7_bh280_ft.csv", Payload::SensorAndHand)];

#[test]
fn double_precision_equals_the_golden_dynamics() {
    for (file, payload) in FILES {
        let worst = compare::<f64>(file, payload);
        let bound = 1e-10;
        assert!(worst.position <= bound && worst.rotation <= bound && worst.jacobian <= bound, "{worst:?}");
        assert!(worst.mass <= bound && worst.torque <= bound && worst.velocity_product <= bound, "{worst:?}");
    }
}

#[test]
fn single_precision_stays_within_the_stated_bounds() {
    for (file, payload) in FILES {
        let worst = compare::<f32>(file, payload);
        assert!(worst.position <= 2e-6, "{worst:?}");
        assert!(worst.rotation <= 1e-5 && worst.jacobian <= 1e-5, "{worst:?}");
        assert!(worst.mass <= 2e-6 && worst.torque <= 1e-4, "{worst:?}");
    }
}

#[test]
fn reflected_rotor_inertia_is_added_with_its_cross_term() {
    let model = ArmModel::<f64>::new(Payload::SensorAndHand);
    let q = JointPositions::from_array([0.3, -0.4, 0.5, 1.2, -0.3, 0.4, 0.2]);
    let frames = Frames::new(&model, &q);
    let rotors = model.mass_matrix(&frames) - model.link_mass_matrix(&frames);
    // j2m^T diag(rotor) j2m, computed here from the generated tables.
    for r in 0..7 {
        for c in 0..7 {
            let reflected: f64 = (0..7)
                .map(|motor| {
                    control::model::JOINT_TO_MOTOR[motor][r]
                        * control::model::ROTOR_INERTIA[motor]
                        * control::model::JOINT_TO_MOTOR[motor][c]
                })
                .sum();
            assert!((rotors[(r, c)] - reflected).abs() < 1e-12, "({r}, {c}): {} {reflected}", rotors[(r, c)]);
        }
    }
    let ddq = JointAccelerations::from_array([1.0, -2.0, 3.0, 0.5, 4.0, -3.0, 2.0]);
    let torque = model.rotor_torque(&ddq);
    assert!((torque.0 - rotors * ddq.0).amax() < 1e-12);
}

#[test]
fn the_mass_matrix_is_symmetric_and_positive_definite() {
    let model = ArmModel::<f64>::new(Payload::SensorAndHand);
    for row in rows("dyn_wam7.csv") {
        let frames = Frames::new(&model, &JointPositions::from_array(row.joints(1)));
        let mass = model.mass_matrix(&frames);
        assert!((mass - mass.transpose()).amax() < 1e-12);
        assert!(mass.cholesky().is_some());
    }
}
