//! Turns `model/wam7.toml` into Rust constants, so that no number of the arm is copied by hand.

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

    let arm = table(&model, "arm");
    let drive = table(arm, "drive");
    let friction = table(arm, "friction");
    let sensor = table(&model, "ft_sensor");
    let joints = arm["joint"].as_array().expect("arm.joint");
    assert_eq!(joints.len(), 7, "seven joints");

    constant(
        &mut out,
        "GRAVITY",
        "Acceleration of gravity in world axes (m/s^2).",
        "[f64; 3]",
        &list(&table(&model, "world")["gravity"]),
    );
    constant(&mut out, "HOME", "Posture of the arm while it is zeroed (rad).", "[f64; 7]", &list(&arm["home"]));
    let column = |key: &str| -> String {
        let values: Vec<f64> = joints.iter().map(|joint| number(&joint[key])).collect();
        format!("{values:?}")
    };
    let dh = |key: &str| -> Vec<f64> { joints.iter().map(|joint| number(&joint["dh"][key])).collect() };
    assert!(dh("theta_offset").iter().all(|offset| *offset == 0.0), "the kinematics know no joint offset");
    // Twists of the WAM are quarter turns; cos(pi/2) = 6e-17 in f64 is snapped to 0 so that frames stay exact.
    let snap = |value: f64| if value.abs() < 1e-15 { 0.0 } else { value };
    let cosines: Vec<f64> = dh("alpha").iter().map(|alpha| snap(alpha.cos())).collect();
    let sines: Vec<f64> = dh("alpha").iter().map(|alpha| snap(alpha.sin())).collect();
    constant(&mut out, "DH_A", "Denavit-Hartenberg link lengths a (m).", "[f64; 7]", &format!("{:?}", dh("a")));
    constant(&mut out, "DH_D", "Denavit-Hartenberg offsets d (m).", "[f64; 7]", &format!("{:?}", dh("d")));
    constant(
        &mut out,
        "DH_COSINE",
        "Cosines of the Denavit-Hartenberg twists alpha.",
        "[f64; 7]",
        &format!("{cosines:?}"),
    );
    constant(&mut out, "DH_SINE", "Sines of the Denavit-Hartenberg twists alpha.", "[f64; 7]", &format!("{sines:?}"));
    for (name, key, text) in [
        ("POSITION_MIN", "q_min", "Lower mechanical stops (rad)."),
        ("POSITION_MAX", "q_max", "Upper mechanical stops (rad)."),
        ("SOFT_MIN", "soft_min", "Lower soft limits (rad)."),
        ("SOFT_MAX", "soft_max", "Upper soft limits (rad)."),
        ("VELOCITY_MAX", "qd_max", "Speed limits (rad/s)."),
        ("TORQUE_MAX", "tau_max", "Torque each joint can give alone with its motors at their current cap (N m)."),
    ] {
        constant(&mut out, name, text, "[f64; 7]", &column(key));
    }

    for (name, key, text) in [
        ("LINKS", "link", "Rigid links without rotors, in the link frames."),
        (
            "LINKS_AC02",
            "link_ac02",
            "The links by the manufacturer's older public sheet, which splits the wrist differently.",
        ),
    ] {
        let bodies: Vec<String> = arm[key].as_array().expect("links").iter().map(body).collect();
        constant(&mut out, name, text, "[BodyTable; 7]", &format!("[{}]", bodies.join(", ")));
    }

    constant(
        &mut out,
        "JOINT_TO_MOTOR",
        "Motor angle = this matrix times joint angle, row by row.",
        "[[f64; 7]; 7]",
        &rows(&drive["j2m"]),
    );
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
        constant(&mut out, name, text, "[f64; 7]", &list(&drive[key]));
    }
    constant(
        &mut out,
        "REFLECTED_INERTIA_J5_J6",
        "Coupling of J5 and J6 by their differential (kg m^2).",
        "f64",
        &format!("{:?}", number(&drive["reflected_j5_j6"])),
    );
    constant(
        &mut out,
        "TORQUE_COUNTS",
        "Nominal puck torque counts per N m at the motor; the true ones are read from the pucks.",
        "[f64; 7]",
        &list(&drive["ipnm"]),
    );
    constant(
        &mut out,
        "ENCODER_COUNTS",
        "Nominal encoder counts per motor revolution.",
        "f64",
        &format!("{:?}", number(&drive["encoder_counts_per_rev"])),
    );
    constant(
        &mut out,
        "FRICTION_VISCOUS",
        "Viscous friction at the joints (N m s/rad).",
        "[f64; 7]",
        &list(&friction["viscous"]),
    );
    constant(
        &mut out,
        "FRICTION_COULOMB",
        "Coulomb friction at the joints (N m), an estimate.",
        "[f64; 7]",
        &list(&friction["coulomb"]),
    );

    constant(
        &mut out,
        "SENSOR_ORIGIN",
        "Origin of the wrist force/torque sensor in frame 7 (m).",
        "[f64; 3]",
        &list(&sensor["origin_in_frame7"]),
    );
    assert_eq!(sensor["axes_in_frame7"].as_str(), Some("aligned"), "the sensor is assumed aligned with frame 7");
    for (name, key, text) in [
        ("SENSOR_FORCE_RANGE", "force_range", "Full scale of the sensor's forces (N)."),
        ("SENSOR_TORQUE_RANGE", "torque_range", "Full scale of the sensor's torques (N m)."),
    ] {
        constant(&mut out, name, text, "[f64; 3]", &list(&sensor[key]));
    }

    let payloads = table(&model, "payload");
    for (name, key, text) in [
        ("PAYLOAD_NONE", "wam7", "The bare arm; the tool frame is the tool plate."),
        ("PAYLOAD_HAND", "wam7_bh280_ft", "Force/torque sensor and hand; the tool frame is the grasp point."),
    ] {
        let payload = &payloads[key];
        let tool = &payload["tool_in_frame7"];
        let yaw = number(&tool["yaw"]);
        let value = format!(
            "PayloadTable {{ body: {}, tool_z: {:?}, tool_cosine: {:?}, tool_sine: {:?} }}",
            body(payload),
            number(&tool["z"]),
            snap(yaw.cos()),
            // sin(pi) = 1.2e-16
            snap(yaw.sin()),
        );
        constant(&mut out, name, text, "PayloadTable", &value);
    }

    // Frame H sits on the sensor's far face, half a turn about z from frame 7.
    let hand = table(&model, "hand");
    let mount = &hand["mount_in_frame7"];
    let yaw = number(&mount["yaw"]);
    assert!((yaw - std::f64::consts::PI).abs() < 1e-12, "the hand is mounted half a turn about z");
    let fitted = &payloads["wam7_bh280_ft"];
    let [x, y, z] = numbers(&fitted["hand_only_com"])[..] else { panic!("{MODEL}: hand_only_com") };
    let origin = numbers(&sensor["origin_in_frame7"]);
    let centre = [-x - origin[0], -y - origin[1], z + number(&mount["z"]) - origin[2]];
    constant(
        &mut out,
        "HAND_MASS",
        "What hangs on the wrist sensor (kg).",
        "f64",
        &format!("{:?}", number(&fitted["hand_only_mass"])),
    );
    constant(
        &mut out,
        "HAND_CENTRE",
        "Its centre of mass from the origin of the wrist sensor, in the sensor's axes (m).",
        "[f64; 3]",
        &format!("{centre:?}"),
    );
    for (name, key, text) in [
        ("FINGER_RANGE", "theta2_range", "Range of an inner link (rad)."),
        ("SPREAD_RANGE", "spread_range", "Range of the spread (rad)."),
    ] {
        constant(&mut out, name, text, "[f64; 2]", &list(&hand[key]));
    }
    for (name, key, text) in [
        ("FINGER_TORQUE_MAX", "finger_torque_max", "Largest torque of a finger's drive at its inner link (N m)."),
        ("SPREAD_TORQUE_MAX", "spread_torque_max", "Largest torque of the spread's drive at the spread (N m)."),
    ] {
        constant(&mut out, name, text, "f64", &format!("{:?}", number(&hand[key])));
    }

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
