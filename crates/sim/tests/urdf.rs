//! `model/wam7_bh280.urdf` says what `model/wam7_bh280.xml` says: the arm with sensor and hand, for other programs.
//!
//! The file is written from the MuJoCo model: `UPDATE_DOCUMENTS=1 cargo test -p sim --test simulator urdf::`.

use std::fmt::Write as _;
use std::path::Path;

use roxmltree::{Document, Node};

const MODEL: &str = include_str!("../model/wam7_bh280.xml");

/// The arm's data; its speed limits are not in the MuJoCo model.
const ARM: &str = include_str!("../../control/model/wam7.toml");

/// Speed limit of the hand's joints, rad/s: 140 degrees in a second.
const HAND_SPEED: &str = "2.44";

/// Speed limit of a joint of the arm, rad/s, 1 for J1.
fn speed(joint: usize) -> Option<&'static str> {
    let mut limits = ARM.lines().filter_map(|line| line.strip_prefix("qd_max = "));
    limits.nth(joint.checked_sub(1)?)?.split_whitespace().next()
}

type Vector = [f64; 3];
/// Unit quaternion w, x, y, z.
type Quaternion = [f64; 4];

fn numbers<const N: usize>(node: Node<'_, '_>, name: &str) -> Option<[f64; N]> {
    let text = node.attribute(name)?;
    let values: Vec<f64> = text.split_whitespace().map(|number| number.parse().expect("a number")).collect();
    values.try_into().ok()
}

fn minus(a: Vector, b: Vector) -> Vector {
    std::array::from_fn(|i| a[i] - b[i])
}

fn rotated([w, x, y, z]: Quaternion, v: Vector) -> Vector {
    let cross =
        |a: Vector, b: Vector| [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    let u = [x, y, z];
    let t = cross(u, v).map(|value| 2.0 * value);
    let s = cross(u, t);
    std::array::from_fn(|i| v[i] + w * t[i] + s[i])
}

fn unit(quaternion: Quaternion) -> Quaternion {
    let length = quaternion.map(|value| value * value).iter().sum::<f64>().sqrt();
    quaternion.map(|value| value / length)
}

/// Roll, pitch and yaw as URDF has them: `Rz(yaw) Ry(pitch) Rx(roll)`.
fn roll_pitch_yaw([w, x, y, z]: Quaternion) -> Vector {
    let sine = (2.0 * (w * y - z * x)).clamp(-1.0, 1.0);
    if sine.abs() > 1.0 - 1e-9 {
        return [0.0, sine.asin(), -2.0 * sine.signum() * x.atan2(w)];
    }
    let roll = (2.0 * (w * x + y * z)).atan2(1.0 - 2.0 * (x * x + y * y));
    [roll, sine.asin(), (2.0 * (w * z + x * y)).atan2(1.0 - 2.0 * (y * y + z * z))]
}

/// Digits that matter: a tenth of a micrometre and of a microradian.
fn round(value: f64) -> f64 {
    let rounded = (value * 1e9).round() / 1e9;
    if rounded == 0.0 { 0.0 } else { rounded }
}

fn origin(xyz: Vector, quaternion: Quaternion) -> String {
    let [x, y, z] = xyz.map(round);
    let [roll, pitch, yaw] = roll_pitch_yaw(unit(quaternion)).map(round);
    format!("<origin xyz=\"{x} {y} {z}\" rpy=\"{roll} {pitch} {yaw}\"/>")
}

const UPRIGHT: Quaternion = [1.0, 0.0, 0.0, 0.0];

/// Position and attitude of a cylinder or capsule whose axis runs from one point to another, and its half length.
fn along(from: Vector, to: Vector) -> (Vector, Quaternion, f64) {
    let axis = minus(to, from);
    let length = axis.map(|value| value * value).iter().sum::<f64>().sqrt();
    let [x, y, z] = axis.map(|value| value / length);
    let turn = if z < -1.0 + 1e-12 { [0.0, 1.0, 0.0, 0.0] } else { unit([1.0 + z, -y, x, 0.0]) };
    (std::array::from_fn(|i| 0.5 * (from[i] + to[i])), turn, 0.5 * length)
}

/// The shapes of one geom, each with its place in the link; a capsule is a cylinder and two balls.
fn shapes(geom: Node<'_, '_>, shift: Vector) -> Vec<(String, String)> {
    let (mut place, mut turn) = (numbers(geom, "pos").unwrap_or_default(), numbers(geom, "quat").unwrap_or(UPRIGHT));
    let mut size: Vec<f64> = geom.attribute("size").expect("a size").split(' ').map(|n| n.parse().unwrap()).collect();
    if let Some([a, b, c, d, e, f]) = numbers(geom, "fromto") {
        let (middle, attitude, half) = along([a, b, c], [d, e, f]);
        (place, turn) = (middle, attitude);
        size.push(half);
    }
    let place = minus(place, shift);
    let cylinder = |size: &[f64]| {
        let text = format!("<cylinder radius=\"{}\" length=\"{}\"/>", size[0], round(2.0 * size[1]));
        (origin(place, turn), text)
    };
    match geom.attribute("type").expect("a type") {
        "box" => {
            let [x, y, z] = [2.0 * size[0], 2.0 * size[1], 2.0 * size[2]].map(round);
            vec![(origin(place, turn), format!("<box size=\"{x} {y} {z}\"/>"))]
        }
        "cylinder" => vec![cylinder(&size)],
        "capsule" => {
            let ball = |sign: f64| {
                let end = rotated(unit(turn), [0.0, 0.0, sign * size[1]]);
                let place = std::array::from_fn(|i| place[i] + end[i]);
                (origin(place, UPRIGHT), format!("<sphere radius=\"{}\"/>", size[0]))
            };
            vec![cylinder(&size), ball(-1.0), ball(1.0)]
        }
        other => panic!("a geom of type {other}"),
    }
}

fn child<'a, 'b>(body: Node<'a, 'b>, name: &str) -> Option<Node<'a, 'b>> {
    body.children().find(|node| node.has_tag_name(name))
}

/// Writes a body as a link whose frame is at its joint, its joint, and the bodies that hang on it.
fn body(out: &mut String, body: Node<'_, '_>, parent: Option<(&str, Vector)>, document: &Document<'_>) {
    let name = body.attribute("name").expect("a name");
    let joint = child(body, "joint");
    let shift = joint.and_then(|joint| numbers(joint, "pos")).unwrap_or_default();
    writeln!(out, "  <link name=\"{name}\">").unwrap();
    if let Some(inertial) = child(body, "inertial") {
        let place = minus(numbers(inertial, "pos").expect("a centre"), shift);
        let [xx, yy, zz, xy, xz, yz]: [f64; 6] = numbers(inertial, "fullinertia").expect("an inertia");
        let mass = inertial.attribute("mass").expect("a mass");
        writeln!(
            out,
            "    <inertial>{}<mass value=\"{mass}\"/><inertia ixx=\"{xx}\" iyy=\"{yy}\" izz=\"{zz}\" ixy=\"{xy}\" \
             ixz=\"{xz}\" iyz=\"{yz}\"/></inertial>",
            origin(place, UPRIGHT)
        )
        .unwrap();
    }
    for geom in body.children().filter(|node| node.has_tag_name("geom")) {
        let is_look = geom.attribute("class") == Some("look");
        for (origin, shape) in shapes(geom, shift) {
            if is_look {
                let material = geom.attribute("material").expect("a material");
                writeln!(
                    out,
                    "    <visual>{origin}<geometry>{shape}</geometry><material name=\"{material}\"/></visual>"
                )
            } else {
                writeln!(out, "    <collision>{origin}<geometry>{shape}</geometry></collision>")
            }
            .unwrap();
        }
    }
    writeln!(out, "  </link>").unwrap();
    if let Some((parent, parent_shift)) = parent {
        let turn = numbers(body, "quat").unwrap_or(UPRIGHT);
        let offset = rotated(unit(turn), shift);
        let place = minus(numbers(body, "pos").expect("a place"), parent_shift);
        let place = std::array::from_fn(|i| place[i] + offset[i]);
        link_joint(out, joint, (parent, name), &origin(place, turn), document);
    }
    for inner in body.children().filter(|node| node.has_tag_name("body")) {
        self::body(out, inner, Some((name, shift)), document);
    }
}

fn link_joint(
    out: &mut String,
    joint: Option<Node<'_, '_>>,
    (parent, name): (&str, &str),
    origin: &str,
    document: &Document<'_>,
) {
    let ends = format!("<parent link=\"{parent}\"/><child link=\"{name}\"/>{origin}");
    let Some(joint) = joint else {
        writeln!(out, "  <joint name=\"{name}_mount\" type=\"fixed\">{ends}</joint>").unwrap();
        return;
    };
    let name = joint.attribute("name").expect("a name");
    let [low, high]: [f64; 2] = numbers(joint, "range").expect("a range");
    let drive = document
        .descendants()
        .find(|node| matches!(node.tag_name().name(), "motor" | "position") && node.attribute("joint") == Some(name));
    let range = |drive: Node<'_, '_>| numbers::<2>(drive, "forcerange").or_else(|| numbers(drive, "ctrlrange"));
    let effort = drive.and_then(range).map_or(0.6, |[_, most]| most);
    let arm = name.strip_prefix('j').and_then(|number| number.parse::<usize>().ok());
    let speed = arm.and_then(speed).unwrap_or(HAND_SPEED);
    let mimic = if name == "f2_spread" { "<mimic joint=\"f1_spread\"/>" } else { "" };
    let friction = joint.attribute("frictionloss").unwrap_or("0");
    let damping = joint.attribute("damping").unwrap_or("0");
    writeln!(
        out,
        "  <joint name=\"{name}\" type=\"revolute\">{ends}<axis xyz=\"{}\"/><limit lower=\"{low}\" upper=\"{high}\" \
         effort=\"{effort}\" velocity=\"{speed}\"/><dynamics damping=\"{damping}\" friction=\"{friction}\"/>{mimic}\
         </joint>",
        joint.attribute("axis").expect("an axis")
    )
    .unwrap();
}

fn urdf() -> String {
    let document = Document::parse(MODEL).expect("the model is XML");
    let mut out = String::from(
        "<?xml version=\"1.0\"?>\n<!-- Barrett WAM 7-DOF with force/torque sensor and BarrettHand BH8-280. Written from \
         wam7_bh280.xml by tests/urdf.rs; change it there.\n     SI units. The frame of a link is at its joint; \
         base = meeting point of the J1 and J2 axes, 0.346 m above the mounting face.\n     Rotor inertias (armature of \
         the MuJoCo model) have no place in URDF: add them to the joints where motion is simulated. -->\n\
         <robot name=\"wam7_bh280\">\n  <!-- for MuJoCo: a link without an inertial has no mass -->\n  \
         <mujoco><compiler inertiafromgeom=\"false\"/></mujoco>\n",
    );
    for material in document.descendants().filter(|node| node.has_tag_name("material")) {
        let colour = match (material.attribute("name").expect("a name"), material.attribute("rgba")) {
            ("floor" | "wood" | "yellow" | "glass", _) => continue,
            (name, rgba) => format!("  <material name=\"{name}\"><color rgba=\"{}\"/></material>\n", rgba.unwrap()),
        };
        out.push_str(&colour);
    }
    let base = document.descendants().find(|node| node.attribute("name") == Some("base") && node.has_tag_name("body"));
    body(&mut out, base.expect("a base"), None, &document);
    out + "</robot>\n"
}

#[test]
fn the_file_is_written_from_the_model() {
    let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("model/wam7_bh280.urdf");
    let text = urdf();
    if std::env::var_os("UPDATE_DOCUMENTS").is_some() {
        std::fs::write(&file, &text).expect("a writable folder");
    }
    let found = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(found == text, "{} is old: UPDATE_DOCUMENTS=1 cargo test -p sim --test simulator urdf::", file.display());
}

/// MuJoCo reads both files: the same places of the grasp and the same weight, in postures of every joint.
#[cfg(feature = "mujoco")]
mod equal {
    use mujoco_rs::prelude::{MjData, MjModel};
    use mujoco_rs::wrappers::mj_model::MjtObjBase;

    /// Torque that holds the arm still and place of the last link, at these joint angles in the order of the bodies.
    fn statics(text: &str, angles: &[f64]) -> (Vec<f64>, [f64; 3]) {
        let model = MjModel::from_xml_string(text).expect("MuJoCo reads it");
        let names: Vec<String> = (1..=7).map(|joint| format!("j{joint}")).collect();
        let id = |kind, name: &str| model.name_to_id(kind, name).unwrap_or_else(|| panic!("{name}"));
        let joints: Vec<usize> = names.iter().map(|name| id(MjtObjBase::mjOBJ_JOINT, name)).collect();
        let tip = id(MjtObjBase::mjOBJ_BODY, "f1_outer");
        let (places, speeds): (Vec<usize>, Vec<usize>) = joints
            .iter()
            .map(|joint| (model.jnt_qposadr()[*joint] as usize, model.jnt_dofadr()[*joint] as usize))
            .unzip();
        let mut data = MjData::new(&model);
        for (place, angle) in places.iter().zip(angles) {
            data.qpos_mut()[*place] = *angle;
        }
        data.forward();
        (speeds.iter().map(|place| data.qfrc_bias()[*place]).collect(), data.xpos()[tip])
    }

    #[test]
    fn the_arm_of_the_urdf_weighs_and_reaches_what_the_arm_of_the_model_does() {
        let text = super::urdf();
        for posture in 0..20 {
            let angle = |joint: usize| (1.7 * f64::from(posture) + 2.3 * joint as f64 + 0.4).sin();
            let angles: Vec<f64> = (0..7).map(angle).collect();
            let ((urdf, there), (model, here)) = (statics(&text, &angles), statics(super::MODEL, &angles));
            for (one, other) in urdf.iter().zip(&model) {
                assert!((one - other).abs() < 2e-5, "{angles:?}: {urdf:?} N m, {model:?} N m");
            }
            assert!(there.iter().zip(here).all(|(one, other)| (one - other).abs() < 1e-6), "{there:?} {here:?}");
        }
    }
}
