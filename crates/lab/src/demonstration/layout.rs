//! Names, units and order of the columns of a recording: one layout to write, two spellings to read.
//!
//! The table in `docs/recording-format.md` is written from [`LAYOUT`] by
//! `UPDATE_DOCUMENTS=1 cargo test -p lab --test library recording::`.

use std::fmt::{Display, LowerExp};

use control::State;
use link::Telemetry;

/// Joints of the arm.
pub const JOINTS: usize = 7;

/// Name of the column of the time, s.
pub const TIME: &str = "t_s";
/// Name of the column of the control cycle's number.
pub const CYCLE: &str = "cycle";
/// Name of the column of the supervisor's state, a word.
pub const STATE: &str = "state";
/// Code of the latched fault.
pub const FAULT: &str = "fault";
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

/// Columns of the joint angles.
pub const JOINT_POSITIONS: [&str; JOINTS] = ["q1_rad", "q2_rad", "q3_rad", "q4_rad", "q5_rad", "q6_rad", "q7_rad"];
/// Columns of the joint velocities.
pub const JOINT_VELOCITIES: [&str; JOINTS] =
    ["dq1_rad_s", "dq2_rad_s", "dq3_rad_s", "dq4_rad_s", "dq5_rad_s", "dq6_rad_s", "dq7_rad_s"];
/// Columns of the joint torques commanded on the bus.
pub const JOINT_TORQUES: [&str; JOINTS] = ["tau1_Nm", "tau2_Nm", "tau3_Nm", "tau4_Nm", "tau5_Nm", "tau6_Nm", "tau7_Nm"];

/// One line of a recording.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordingRow {
    /// Time since the first line, s.
    pub time: f64,
    /// Tool frame computed from the joint angles: x, y, z (m, world), w, x, y, z.
    pub pose: [f64; 7],
    /// Everything else, as the device told it.
    pub telemetry: Telemetry,
}

impl RecordingRow {
    /// State of the supervisor, a word.
    pub fn state(&self) -> &'static str {
        State::from_code(self.telemetry.state).map_or(UNKNOWN_STATE, State::name)
    }
}

/// The word for a state that this version does not know; a device of another version may have one.
const UNKNOWN_STATE: &str = "unknown";

/// True for a word that [`RecordingRow::state`] writes.
pub(super) fn is_state(word: &str) -> bool {
    word == UNKNOWN_STATE || State::ALL.iter().any(|state| state.name() == word)
}

/// Columns of one quantity.
#[derive(Debug, Clone, Copy)]
pub struct Quantity {
    /// Names of the columns.
    pub columns: &'static [&'static str],
    /// Unit, 1 for a number without one.
    pub unit: &'static str,
    /// Meaning, for `docs/recording-format.md`.
    pub meaning: &'static str,
    /// Fields of the columns for one row, separated by commas.
    pub fields: fn(&RecordingRow) -> String,
}

const fn quantity(
    columns: &'static [&'static str],
    unit: &'static str,
    meaning: &'static str,
    fields: fn(&RecordingRow) -> String,
) -> Quantity {
    Quantity { columns, unit, meaning, fields }
}

fn list<T: Display + LowerExp>(values: &[T]) -> String {
    values.iter().map(number).collect::<Vec<_>>().join(",")
}

/// Most characters of a number that is written without an exponent. An estimate that fades away passes through numbers
/// with forty zeros.
const PLAIN_DIGITS: usize = 24;

/// A number as short as it can be read back exactly.
fn number<T: Display + LowerExp>(value: &T) -> String {
    let plain = value.to_string();
    if plain.len() > PLAIN_DIGITS { format!("{value:e}") } else { plain }
}

/// Every quantity of our own layout in the order of its columns: what is written, in the file and in the document.
pub const LAYOUT: &[Quantity] = &[
    quantity(
        &[CYCLE],
        "1",
        "number of the control cycle on the device, 300 a second; a step of more than one is a gap",
        |row| row.telemetry.cycle.to_string(),
    ),
    quantity(&[TIME], "s", "time since the first line, computed from `cycle`", |row| row.time.to_string()),
    quantity(
        &[STATE],
        "word",
        "state of the supervisor: `idle`, `gravity`, `hold`, `approach`, `run`, `coast`, `soft stop`, `fault`, \
         `lowering`",
        |row| row.state().to_owned(),
    ),
    quantity(&[FAULT], "1", "code of the latched fault, 0 for none", |row| row.telemetry.fault.to_string()),
    quantity(&[FLAGS], "1", "flag bits of the cycle record, see `control::cycle::record::flags`", |row| {
        row.telemetry.flags.to_string()
    }),
    quantity(&[PHASE], "1", "phase s of the movement: 1 at its start, towards 0 at its end, 0 outside a run", |row| {
        number(&row.telemetry.phase)
    }),
    quantity(&JOINT_POSITIONS, "rad", "measured joint angles", |row| list(&row.telemetry.q)),
    quantity(&JOINT_VELOCITIES, "rad/s", "estimated joint velocities", |row| list(&row.telemetry.dq)),
    quantity(&JOINT_TORQUES, "N m", "joint torques sent on the bus, after all limits", |row| list(&row.telemetry.tau)),
    quantity(&POSITION, "m", "position of the tool frame, world; computed by the host from `q`", |row| {
        list(&row.pose[..3])
    }),
    quantity(
        &ORIENTATION,
        "1",
        "orientation of the tool frame, unit quaternion tool to world; computed by the host from `q`",
        |row| list(&row.pose[3..]),
    ),
    quantity(&POSITION_D, "m", "desired position; the measured one where nothing is desired", |row| {
        list(&row.telemetry.pose_d[..3])
    }),
    quantity(&ORIENTATION_D, "1", "desired orientation", |row| list(&row.telemetry.pose_d[3..])),
    quantity(
        &["fx_N", "fy_N", "fz_N"],
        "N",
        "force of the environment on the robot, world axes, filtered, tared",
        |row| list(&row.telemetry.wrench[..3]),
    ),
    quantity(
        &["tx_Nm", "ty_Nm", "tz_Nm"],
        "N m",
        "torque of the environment on the robot about the grasp point, tool axes",
        |row| list(&row.telemetry.wrench[3..]),
    ),
    quantity(&["lost_replies"], "1", "position replies that were missing in this cycle, 0 to 7", |row| {
        row.telemetry.lost_replies.to_string()
    }),
    quantity(&["cost_ticks"], "1", "cost of the control cycle in ticks of the device's clock", |row| {
        row.telemetry.cost_ticks.to_string()
    }),
    quantity(&HAND, "rad", "measured hand: spread and inner links of the fingers; 0 without a hand", |row| {
        list(&row.telemetry.hand)
    }),
    quantity(&HAND_D, "rad", "desired hand; the measured one where nothing is desired", |row| {
        list(&row.telemetry.hand_d)
    }),
    quantity(
        &GAUGES,
        "N m",
        "torque of the environment on each finger about its outer joint, by the strain gauges, filtered, \
         tared: negative when it closes on an object",
        |row| list(&row.telemetry.gauges),
    ),
    quantity(
        &[SURPRISE],
        "1",
        "how much this run differs from the successful ones before it; 0 when nothing is compared",
        |row| number(&row.telemetry.surprise),
    ),
];

/// Every column of our own layout in its order.
pub fn header() -> Vec<&'static str> {
    LAYOUT.iter().flat_map(|quantity| quantity.columns).copied().collect()
}

/// True for a column that a recording is read by; others may hold anything.
pub fn is_known(name: &str) -> bool {
    LAYOUT.iter().flat_map(|quantity| quantity.columns).chain(&POSITION_ALIAS).any(|known| *known == name)
}

/// The name a column should have had, if `name` is a known quantity with another unit.
pub fn intended(name: &str) -> Option<String> {
    let known =
        header().into_iter().chain(POSITION_ALIAS).filter(|known| !matches!(*known, "lost_replies" | "cost_ticks"));
    let stem = |text: &str| text.split('_').next().unwrap_or_default().to_owned();
    for candidate in known {
        let desired = candidate.contains("_d_") || candidate.ends_with("_d");
        if !desired && candidate != name && candidate.contains('_') && stem(name) == stem(candidate) {
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
                return Some(candidate.to_owned());
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

    /// The change that makes it fail: every number is written without an exponent. 48 characters then.
    #[test]
    fn a_number_is_short_however_small_it_is_and_is_read_back_exactly() {
        for value in [1e-45_f32, -1e-45, f32::MIN_POSITIVE, f32::MAX, f32::MIN, 0.1, -0.000_308_511_55, 0.0] {
            let text = number(&value);
            assert!(text.len() <= PLAIN_DIGITS && text.parse() == Ok(value), "{value:e}: {text}");
        }
        assert_eq!(list(&[1.0_f32, 1e-45, -0.25]), "1,1e-45,-0.25");
    }
}
