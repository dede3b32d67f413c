//! Names, units and order of the columns of a recording: one layout to write, two spellings to read.
//!
//! `docs/recording-format.md` describes the same for people; a test keeps the two equal.

/// Joints of the arm.
pub const JOINTS: usize = 7;

/// Name of the column of the time, s.
pub const TIME: &str = "t_s";
/// Name of the column of the control cycle's number.
pub const CYCLE: &str = "cycle";
/// Name of the column of the supervisor's state, a word.
pub const STATE: &str = "state";
/// Name of the column of the phase of the movement, 1 at its start, towards 0 at its end.
pub const PHASE: &str = "phase";
/// Columns of the measured position of the tool frame in the world frame.
pub const POSITION: [&str; 3] = ["x_m", "y_m", "z_m"];
/// Another spelling of [`POSITION`] that is read, never written.
pub const POSITION_ALIAS: [&str; 3] = ["px_m", "py_m", "pz_m"];
/// Columns of the measured orientation, unit quaternion tool to world.
pub const ORIENTATION: [&str; 4] = ["qw", "qx", "qy", "qz"];
/// Columns of the desired position of the tool frame in the world frame.
pub const POSITION_D: [&str; 3] = ["x_d_m", "y_d_m", "z_d_m"];
/// Columns of the desired orientation.
pub const ORIENTATION_D: [&str; 4] = ["qw_d", "qx_d", "qy_d", "qz_d"];
/// Columns of the wrench of the environment on the robot, at the tool frame.
pub const WRENCH: [&str; 6] = ["fx_N", "fy_N", "fz_N", "tx_Nm", "ty_Nm", "tz_Nm"];

/// Column of the flag bits.
pub const FLAGS: &str = "flags";
/// Columns of the measured hand: spread and fingers 1 to 3, inner links.
pub const HAND: [&str; 4] = ["spread_rad", "finger1_rad", "finger2_rad", "finger3_rad"];
/// Columns of the desired hand.
pub const HAND_D: [&str; 4] = ["spread_d_rad", "finger1_d_rad", "finger2_d_rad", "finger3_d_rad"];
/// Columns of the torque of the environment on the fingers, by their strain gauges.
pub const GAUGES: [&str; 3] = ["gauge1_Nm", "gauge2_Nm", "gauge3_Nm"];
/// Column of the statistic of the watch for unusual runs.
pub const SURPRISE: &str = "surprise";

/// `q1_rad` and so on: the name of one joint's column.
pub fn joint_column(symbol: &str, joint: usize, unit: &str) -> String {
    format!("{symbol}{}_{unit}", joint + 1)
}

/// Columns of the joint angles, rad.
pub fn joint_positions() -> [String; JOINTS] {
    std::array::from_fn(|joint| joint_column("q", joint, "rad"))
}

/// Columns of the joint velocities, rad/s.
pub fn joint_velocities() -> [String; JOINTS] {
    std::array::from_fn(|joint| joint_column("dq", joint, "rad_s"))
}

/// Columns of the joint torques commanded on the bus, N m.
pub fn joint_torques() -> [String; JOINTS] {
    std::array::from_fn(|joint| joint_column("tau", joint, "Nm"))
}

/// Every column of our own layout in its order.
pub fn header() -> Vec<String> {
    let mut names: Vec<String> = [CYCLE, TIME, STATE, "fault", FLAGS, PHASE].map(String::from).to_vec();
    names.extend(joint_positions());
    names.extend(joint_velocities());
    names.extend(joint_torques());
    names.extend(POSITION.map(String::from));
    names.extend(ORIENTATION.map(String::from));
    names.extend(POSITION_D.map(String::from));
    names.extend(ORIENTATION_D.map(String::from));
    names.extend(WRENCH.map(String::from));
    names.extend(["lost_replies", "cost_ticks"].map(String::from));
    // Appended: recordings of the time before the hand have none of these.
    names.extend(HAND.map(String::from));
    names.extend(HAND_D.map(String::from));
    names.extend(GAUGES.map(String::from));
    names.push(SURPRISE.to_owned());
    names
}

/// The name a column should have had, if `name` is a known quantity with another unit.
pub fn intended(name: &str) -> Option<String> {
    let known = header()
        .into_iter()
        .chain(POSITION_ALIAS.map(String::from))
        .filter(|known| !matches!(known.as_str(), "lost_replies" | "cost_ticks"));
    let stem = |text: &str| text.split('_').next().unwrap_or_default().to_owned();
    for candidate in known {
        let desired = candidate.contains("_d_") || candidate.ends_with("_d");
        if !desired && candidate != name && candidate.contains('_') && stem(name) == stem(&candidate) {
            // `x_d_m` shares its stem with `x_m` but is a column of its own, `x_extra` is nobody's.
            let unit = &name[stem(name).len()..];
            let is_unit = matches!(
                unit,
                "" | "_ms"
                    | "_us"
                    | "_ns"
                    | "_mm"
                    | "_cm"
                    | "_deg"
                    | "_deg_s"
                    | "_kN"
                    | "_mN"
                    | "_Nmm"
                    | "_s"
                    | "_m"
                    | "_rad"
                    | "_N"
                    | "_Nm"
                    | "_rad_s"
            );
            if is_unit {
                return Some(candidate);
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn degrees_and_milliseconds_are_recognised_as_the_wrong_unit() {
        assert_eq!(intended("q3_deg").as_deref(), Some("q3_rad"));
        assert_eq!(intended("t_ms").as_deref(), Some("t_s"));
        assert_eq!(intended("px_mm").as_deref(), Some("px_m"));
        assert_eq!(intended("gripper_mm"), None);
        assert_eq!(intended("x_extra"), None);
        assert_eq!(intended("state"), None);
    }

    #[test]
    fn header_has_no_name_twice() {
        let mut names = header();
        let count = names.len();
        names.sort();
        names.dedup();
        assert_eq!(names.len(), count);
    }
}
