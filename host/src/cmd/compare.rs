//! `tactus compare`: how two recordings of the same movement differ.

use std::path::PathBuf;

use clap::Args;

use super::{ErrorCode, Failure, Global, plot};
use lab::demonstration::Recording;
use lab::difference::Difference;

/// Options of `compare`.
#[derive(Debug, Clone, Args)]
pub struct Cmd {
    /// Recording of a run, CSV
    #[arg(value_name = "ONE")]
    pub one: PathBuf,
    /// Recording of another run of the same movement, CSV
    #[arg(value_name = "OTHER")]
    pub other: PathBuf,
    /// Force that counts as a contact, N
    #[arg(long, default_value_t = 1.0, value_name = "NEWTON", value_parser = force, allow_hyphen_values = true)]
    pub contact: f64,
}

/// Compares.
///
/// # Errors
/// A recording cannot be read, or lacks what is compared.
pub fn run(command: &Cmd, global: &Global) -> Result<(), Failure> {
    let invalid =
        |cause: Box<dyn std::error::Error + Send + Sync>| Failure::of_file(ErrorCode::CompareInput, "compare", cause);
    let one = Recording::read(&command.one).map_err(|cause| invalid(cause.into()))?;
    let other = Recording::read(&command.other).map_err(|cause| invalid(cause.into()))?;
    plot::same_as(&one, &other, "compare refused")?;
    [&one, &other].into_iter().for_each(|recording| plot::tell_of_others(recording, global.output()));
    for recording in [&one, &other].into_iter().filter(|recording| recording.origin.primitive.is_none()) {
        global.output().warn(format!("{} does not name its movement", recording.file.display()));
    }
    if one.origin.goal != other.origin.goal {
        global.output().warn("the runs were made to different goals");
    }
    if one.origin.changes != other.origin.changes {
        global
            .output()
            .warn("speed or goal were changed on the way in one of the runs, or otherwise than in the other");
    }
    if one.origin.speed != other.origin.speed || one.origin.mode != other.origin.mode {
        global.output().warn("the runs were made at different speeds or in different modes");
    }
    let difference = Difference::between(&one, &other, command.contact).map_err(|cause| invalid(cause.into()))?;
    global.output().result(&difference, difference.to_string())
}

/// A force that can be exceeded: with NaN no contact would ever be found.
fn force(text: &str) -> Result<f64, String> {
    let force = text.parse::<f64>().ok().filter(|force| *force >= 0.0 && force.is_finite());
    force.ok_or_else(|| "a force from 0 N on is expected".to_owned())
}

#[cfg(test)]
mod tests {
    #[test]
    fn only_a_force_is_one() {
        assert_eq!(super::force("2.5"), Ok(2.5));
        for wrong in ["nan", "inf", "-1", "2,5", ""] {
            assert!(super::force(wrong).is_err(), "{wrong}");
        }
    }
}
