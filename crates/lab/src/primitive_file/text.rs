//! Writes a primitive as text with a comment beside every section.

use std::fmt::Write;

use super::{GROUPS, HemisphereKind, OrientationErrorKind, PrimitiveFile, SCHEMA, Waypoint};

/// Columns after which a table of numbers breaks.
const LINE_WIDTH: usize = 118;

/// The text of the file. Every number is printed so that it reads back as the same f64.
pub(super) fn render(primitive: &PrimitiveFile) -> String {
    let mut text = String::new();
    write_all(&mut text, primitive).expect("writing to a string cannot fail");
    text
}

fn write_all(text: &mut String, primitive: &PrimitiveFile) -> std::fmt::Result {
    writeln!(
        text,
        "# Movement primitive of Tactus. SI units; quaternions are (w, x, y, z), tool to world; the position is that\n\
         # of the grasp point in the world frame. Comments may be changed; every number is covered by content_crc32."
    )?;
    writeln!(text, "schema = \"{SCHEMA}\"")?;
    writeln!(text, "name = {}", quoted(&primitive.name))?;
    writeln!(text, "model_hash = \"0x{:08x}\"      # model of the arm it was learned with", primitive.model_hash)?;
    writeln!(text, "content_crc32 = \"0x{:08x}\"", primitive.checksum())?;

    writeln!(text, "\n[movement]")?;
    writeln!(text, "duration_s = {:?}", primitive.duration)?;
    writeln!(text, "alpha = {:?}      # decay of the phase: s(duration) = exp(-alpha)", primitive.alpha)?;
    writeln!(text, "activation = {:?}      # of a kernel at the centre of the next", primitive.activation)?;
    writeln!(text, "kernels = {}", primitive.kernels())?;
    let error = match primitive.orientation_error {
        OrientationErrorKind::Quaternion => "quaternion",
        OrientationErrorKind::RotationVector => "rotation-vector",
    };
    writeln!(text, "orientation_error = \"{error}\"")?;
    let hemisphere = match primitive.hemisphere {
        HemisphereKind::Demonstrated => "demonstrated",
        HemisphereKind::Nearest => "nearest",
    };
    writeln!(text, "hemisphere = \"{hemisphere}\"")?;

    writeln!(text, "\n[gains]      # spring K and damper D of the transformation systems, dimensionless")?;
    for ((group, _), gain) in GROUPS.iter().zip(&primitive.gains) {
        writeln!(text, "{group} = {{ stiffness = {:?}, damping = {:?} }}", gain.stiffness, gain.damping)?;
    }

    writeln!(text, "\n[start]      # of the demonstration")?;
    write_waypoint(text, &primitive.start)?;
    writeln!(text, "\n[start_velocity]      # angular velocity in the body frame")?;
    let velocity = &primitive.start_velocity;
    write_numbers(text, "position_m_s", &velocity.position)?;
    write_numbers(text, "orientation_rad_s", &velocity.orientation)?;
    write_numbers(text, "posture_rad_s", &velocity.posture)?;
    write_numbers(text, "hand_rad_s", &velocity.hand)?;
    writeln!(text, "\n[goal]")?;
    write_waypoint(text, &primitive.goal)?;

    writeln!(
        text,
        "\n[weights]      # theta of Eq (2), one row a degree of freedom: position m, orientation (body) and joints rad"
    )?;
    let mut row = 0;
    for (group, size) in GROUPS {
        write_rows(text, group, &primitive.weights[row..row + size])?;
        row += size;
    }

    if let Some(feedback) = &primitive.feedback {
        writeln!(
            text,
            "\n[feedback]      # Eq (8), by phase: first point at the start, last at the end of the movement"
        )?;
        writeln!(text, "clamp_position_m = {:?}", feedback.clamps[0])?;
        writeln!(text, "clamp_orientation_rad = {:?}", feedback.clamps[1])?;
        writeln!(text, "clamp_hand_rad = {:?}", feedback.clamps[2])?;
        write_rows(text, "k1", &feedback.k1)?;
        write_rows(text, "k2", &feedback.k2)?;
    }
    if let Some(expectation) = &primitive.expectation {
        writeln!(
            text,
            "\n[expectation]      # wrench of the environment on the robot by phase: force N (world), torque N m, gauges N m"
        )?;
        writeln!(
            text,
            "model_hash = \"0x{:08x}\"      # model of the arm it was recorded with",
            expectation.model_hash
        )?;
        writeln!(text, "recorded_duration_s = {:?}", expectation.recorded_duration)?;
        writeln!(text, "payload_mass_kg = {:?}", expectation.payload_mass)?;
        write_numbers(text, "payload_centre_m", &expectation.payload_centre)?;
        writeln!(text, "filter_cutoff_hz = {:?}", expectation.filter_cutoff)?;
        writeln!(text, "trials = {}", expectation.trials)?;
        writeln!(text, "spread_floor = {:?}", expectation.spread_floor)?;
        write_rows(text, "mean", &expectation.mean)?;
        write_rows(text, "spread", &expectation.spread)?;
    }
    if let Some(experience) = &primitive.experience {
        writeln!(
            text,
            "\n[experience]      # of successful runs, by phase: the rows of the expectation, then fingers F1 to F3 rad"
        )?;
        writeln!(text, "trials = {}", experience.trials)?;
        write_rows(text, "mean", &experience.mean)?;
        write_rows(text, "spread", &experience.spread)?;
    }
    if let Some(provenance) = &primitive.provenance {
        writeln!(text, "\n[provenance]      # where it comes from; errors are [maximum, RMS] of the reproduction")?;
        writeln!(text, "demonstration = {}", quoted(&provenance.demonstration))?;
        writeln!(text, "demonstration_crc32 = \"0x{:08x}\"", provenance.demonstration_checksum)?;
        writeln!(text, "samples = {}", provenance.samples)?;
        write_numbers(text, "trimmed_s", &provenance.trimmed)?;
        writeln!(text, "largest_angle_rad = {:?}", provenance.largest_angle)?;
        write_numbers(text, "position_error_m", &provenance.position_error)?;
        write_numbers(text, "orientation_error_rad", &provenance.orientation_error)?;
        write_numbers(text, "posture_error_rad", &provenance.posture_error)?;
        writeln!(text, "tool = {}", quoted(&provenance.tool))?;
    }
    Ok(())
}

/// A text as TOML string.
fn quoted(text: &str) -> String {
    toml::Value::String(text.to_owned()).to_string()
}

fn write_waypoint(text: &mut String, waypoint: &Waypoint) -> std::fmt::Result {
    write_numbers(text, "position_m", &waypoint.position)?;
    write_numbers(text, "orientation_wxyz", &waypoint.orientation)?;
    write_numbers(text, "posture_rad", &waypoint.posture)?;
    write_numbers(text, "hand_rad", &waypoint.hand)
}

fn write_numbers(text: &mut String, key: &str, values: &[f64]) -> std::fmt::Result {
    let values: Vec<String> = values.iter().map(|value| format!("{value:?}")).collect();
    writeln!(text, "{key} = [{}]", values.join(", "))
}

fn write_rows(text: &mut String, key: &str, rows: &[Vec<f64>]) -> std::fmt::Result {
    writeln!(text, "{key} = [")?;
    for row in rows {
        let mut line = String::from("  [");
        for (index, value) in row.iter().enumerate() {
            let number = format!("{value:?}");
            if line.len() + number.len() + 2 > LINE_WIDTH {
                writeln!(text, "{}", line.trim_end())?;
                line = String::from("   ");
            }
            line.push_str(&number);
            if index + 1 < row.len() {
                line.push_str(", ");
            }
        }
        writeln!(text, "{line}],")?;
    }
    writeln!(text, "]")
}
