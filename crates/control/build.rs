//! Turns `model/wam7.toml` into Rust constants, so that no number of the arm is copied by hand.

use std::f64::consts::PI;
use std::fmt::Write as _;
use std::path::PathBuf;
use std::{env, fs};

use toml::{Table, Value};

const MODEL: &str = "model/wam7.toml";

fn main() {
    println!("cargo::rerun-if-changed={MODEL}");
    println!("cargo::rerun-if-changed=build.rs");
    let text = fs::read_to_string(MODEL).expect("the arm model is part of the crate");
    let model: Table = text.parse().expect("the arm model is valid TOML");
    let mut out = String::new();
    kinematics(&mut out, &model);
    links(&mut out, &model);
    drive(&mut out, &model);
    friction_and_sensor(&mut out, &model);
    payloads(&mut out, &model);
    hand(&mut out, &model);

    // Over the constants and not over the file: a comment, or a value that the code does not use, makes no other arm.
    let values: String = out.lines().filter(|line| !line.starts_with("///")).flat_map(|line| [line, "\n"]).collect();
    let hash = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC).checksum(values.as_bytes());
    writeln!(
        out,
        "/// CRC-32 (ISO-HDLC) of the constants above: a primitive learned for another arm model is refused by it.\n\
         pub const MODEL_HASH: u32 = {hash:#010x};"
    )
    .unwrap();

    let path = PathBuf::from(env::var_os("OUT_DIR").expect("cargo sets OUT_DIR")).join("wam7.rs");
    fs::write(path, out).expect("OUT_DIR is writable");
}

/// Axes of the world, home, Denavit-Hartenberg parameters and limits of the joints.
fn kinematics(out: &mut String, model: &Table) {
    let arm = table(model, "arm");
    let joints = arm["joint"].as_array().expect("arm.joint");
    assert_eq!(joints.len(), 7, "seven joints");
    let gravity = &table(model, "world")["gravity"];
    constant(out, "GRAVITY", "Acceleration of gravity in world axes (m/s^2).", "[f64; 3]", &list(gravity));
    constant(out, "HOME", "Posture of the arm while it is zeroed (rad).", "[f64; 7]", &list(&arm["home"]));
    let dh = |key: &str| -> Vec<f64> { joints.iter().map(|joint| number(&joint["dh"][key])).collect() };
    assert!(dh("theta_offset").iter().all(|offset| *offset == 0.0), "the kinematics know no joint offset");
    let cosines: Vec<f64> = dh("alpha").iter().map(|alpha| snap(alpha.cos())).collect();
    let sines: Vec<f64> = dh("alpha").iter().map(|alpha| snap(alpha.sin())).collect();
    for (name, values, text) in [
        ("DH_A", dh("a"), "Denavit-Hartenberg link lengths a (m)."),
        ("DH_D", dh("d"), "Denavit-Hartenberg offsets d (m)."),
        ("DH_COSINE", cosines, "Cosines of the Denavit-Hartenberg twists alpha."),
        ("DH_SINE", sines, "Sines of the Denavit-Hartenberg twists alpha."),
    ] {
        constant(out, name, text, "[f64; 7]", &format!("{values:?}"));
    }
    for (name, key, text) in [
        ("POSITION_MIN", "q_min", "Lower mechanical stops (rad)."),
        ("POSITION_MAX", "q_max", "Upper mechanical stops (rad)."),
        ("SOFT_MIN", "soft_min", "Lower soft limits (rad)."),
        ("SOFT_MAX", "soft_max", "Upper soft limits (rad)."),
        ("VELOCITY_MAX", "qd_max", "Speed limits (rad/s)."),
        ("TORQUE_MAX", "tau_max", "Torque each joint can give alone with its motors at their current cap (N m)."),
    ] {
        let values: Vec<f64> = joints.iter().map(|joint| number(&joint[key])).collect();
        constant(out, name, text, "[f64; 7]", &format!("{values:?}"));
    }
}

/// Masses of the links.
fn links(out: &mut String, model: &Table) {
    let ac02 = "The links by the manufacturer's older public sheet, which splits the wrist differently.";
    for (name, key, text) in
        [("LINKS", "link", "Rigid links without rotors, in the link frames."), ("LINKS_AC02", "link_ac02", ac02)]
    {
        let bodies: Vec<String> = table(model, "arm")[key].as_array().expect("links").iter().map(body).collect();
        constant(out, name, text, "[BodyTable; 7]", &format!("[{}]", bodies.join(", ")));
    }
}

/// Transmission, rotors and scales of the motors.
fn drive(out: &mut String, model: &Table) {
    let drive = table(table(model, "arm"), "drive");
    let text = "Motor angle = this matrix times joint angle, row by row.";
    constant(out, "JOINT_TO_MOTOR", text, "[[f64; 7]; 7]", &rows(&drive["j2m"]));
    for (name, key, text) in [
        ("ROTOR_INERTIA", "rotor_inertia", "Drive inertia at each rotor (kg m^2)."),
        ("REFLECTED_INERTIA", "reflected_diag", "Rotor inertia seen at the joints (kg m^2)."),
        ("MOTOR_TORQUE_MAX", "motor_torque_max", "Motor torque at the pucks' current cap (N m at the motor)."),
        (
            "CONTROL_SIGNAL_LIMIT",
            "control_signal_limit",
            "Joint torque that the manufacturer's controllers allow themselves on top of gravity (N m).",
        ),
    ] {
        constant(out, name, text, "[f64; 7]", &list(&drive[key]));
    }
    let text = "Coupling of J5 and J6 by their differential (kg m^2).";
    constant(out, "REFLECTED_INERTIA_J5_J6", text, "f64", &real(&drive["reflected_j5_j6"]));
    let text = "Nominal puck torque counts per N m at the motor; the true ones are read from the pucks.";
    constant(out, "TORQUE_COUNTS", text, "[f64; 7]", &list(&drive["ipnm"]));
    let text = "Nominal encoder counts per motor revolution.";
    constant(out, "ENCODER_COUNTS", text, "f64", &real(&drive["encoder_counts_per_rev"]));
}

/// Friction of the joints; place and range of the wrist sensor.
fn friction_and_sensor(out: &mut String, model: &Table) {
    let friction = table(table(model, "arm"), "friction");
    for (name, key, text) in [
        ("FRICTION_VISCOUS", "viscous", "Viscous friction at the joints (N m s/rad)."),
        ("FRICTION_COULOMB", "coulomb", "Coulomb friction at the joints (N m), an estimate."),
    ] {
        constant(out, name, text, "[f64; 7]", &list(&friction[key]));
    }
    let sensor = table(model, "ft_sensor");
    assert_eq!(sensor["axes_in_frame7"].as_str(), Some("aligned"), "the sensor is assumed aligned with frame 7");
    for (name, key, text) in [
        ("SENSOR_ORIGIN", "origin_in_frame7", "Origin of the wrist force/torque sensor in frame 7 (m)."),
        ("SENSOR_FORCE_RANGE", "force_range", "Full scale of the sensor's forces (N)."),
        ("SENSOR_TORQUE_RANGE", "torque_range", "Full scale of the sensor's torques (N m)."),
    ] {
        constant(out, name, text, "[f64; 3]", &list(&sensor[key]));
    }
}

/// Payloads that may be mounted on the arm.
fn payloads(out: &mut String, model: &Table) {
    for (name, key, text) in [
        ("PAYLOAD_NONE", "wam7", "The bare arm; the tool frame is the tool plate."),
        ("PAYLOAD_HAND", "wam7_bh280_ft", "Force/torque sensor and hand; the tool frame is the grasp point."),
    ] {
        let payload = &table(model, "payload")[key];
        let tool = &payload["tool_in_frame7"];
        let yaw = number(&tool["yaw"]);
        let value = format!(
            "PayloadTable {{ body: {}, tool_z: {:?}, tool_cosine: {:?}, tool_sine: {:?} }}",
            body(payload),
            number(&tool["z"]),
            snap(yaw.cos()),
            snap(yaw.sin()),
        );
        constant(out, name, text, "PayloadTable", &value);
    }
}

/// The hand on the sensor: mass, ranges and torques of its digits.
fn hand(out: &mut String, model: &Table) {
    // Frame H sits on the sensor's far face, half a turn about z from frame 7.
    let hand = table(model, "hand");
    let mount = &hand["mount_in_frame7"];
    assert!((number(&mount["yaw"]) - PI).abs() < 1e-12, "the hand is mounted half a turn about z");
    let fitted = &table(model, "payload")["wam7_bh280_ft"];
    let [x, y, z] = numbers(&fitted["hand_only_com"])[..] else { panic!("{MODEL}: hand_only_com") };
    let origin = numbers(&table(model, "ft_sensor")["origin_in_frame7"]);
    let centre = [-x - origin[0], -y - origin[1], z + number(&mount["z"]) - origin[2]];
    constant(out, "HAND_MASS", "Mass that hangs on the wrist sensor (kg).", "f64", &real(&fitted["hand_only_mass"]));
    let text = "Its centre of mass from the origin of the wrist sensor, in the sensor's axes (m).";
    constant(out, "HAND_CENTRE", text, "[f64; 3]", &format!("{centre:?}"));
    for (name, key, text) in [
        ("FINGER_RANGE", "theta2_range", "Range of an inner link (rad)."),
        ("SPREAD_RANGE", "spread_range", "Range of the spread (rad)."),
    ] {
        constant(out, name, text, "[f64; 2]", &list(&hand[key]));
    }
    for (name, key, text) in [
        ("FINGER_TORQUE_MAX", "finger_torque_max", "Largest torque of a finger's drive at its inner link (N m)."),
        ("SPREAD_TORQUE_MAX", "spread_torque_max", "Largest torque of the spread's drive at the spread (N m)."),
    ] {
        constant(out, name, text, "f64", &real(&hand[key]));
    }
}

/// Twists of the WAM are quarter turns: cos(pi/2) = 6e-17 and sin(pi) = 1.2e-16 become 0, so that frames stay exact.
fn snap(value: f64) -> f64 {
    if value.abs() < 1e-15 { 0.0 } else { value }
}

fn table<'a>(parent: &'a Table, key: &str) -> &'a Table {
    parent.get(key).and_then(Value::as_table).unwrap_or_else(|| panic!("{MODEL}: no table {key}"))
}

fn number(value: &Value) -> f64 {
    match value {
        Value::Float(number) => *number,
        Value::Integer(number) => *number as f64,
        other => panic!("{MODEL}: {other} is not a number"),
    }
}

fn real(value: &Value) -> String {
    format!("{:?}", number(value))
}

fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap_or_else(|| panic!("{MODEL}: {value} is not an array")).iter().map(number).collect()
}

fn list(value: &Value) -> String {
    format!("{:?}", numbers(value))
}

fn rows(value: &Value) -> String {
    let rows: Vec<Vec<f64>> = value.as_array().expect("a matrix").iter().map(numbers).collect();
    format!("{rows:?}")
}

fn body(value: &Value) -> String {
    format!(
        "BodyTable {{ mass: {:?}, centre: {}, inertia: {} }}",
        number(&value["mass"]),
        list(&value["com"]),
        list(&value["inertia"])
    )
}

fn constant(out: &mut String, name: &str, text: &str, kind: &str, value: &str) {
    writeln!(out, "/// {text}\npub const {name}: {kind} = {value};").unwrap();
}
