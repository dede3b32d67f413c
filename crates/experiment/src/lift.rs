//! The experiment with a weight: what is expected to be heavy is carried as high as what is light.
//!
//! One movement, two memories: rehearsed with the usual weight, and with one that is 0.3 kg heavier. Each is then
//! carried with the memory of it, and the heavier one also with the memory of the usual one: what that sags is what
//! the memory is good for.

use super::carried::Carried;
use super::config::Config;
use super::preparation::{self, PreparationError};
use super::quantile::quantile;
use super::results::Results;
use lab::client::Interrupt;
use lab::primitive_file::PrimitiveFile;
use lab::table::Table;
use sim::world::mujoco::{ObjectKind, ObjectSpec};

/// Mass that the heavier one has beyond the other, kg.
pub const EXTRA: f64 = 0.3;

/// A weight that is carried, and the weight that is remembered.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Case {
    /// The usual weight, as rehearsed.
    Usual,
    /// The heavier one, as rehearsed.
    Heavier,
    /// The heavier one, rehearsed with the usual one.
    Unexpected,
}

impl Case {
    /// All cases.
    pub const ALL: [Case; 3] = [Case::Usual, Case::Heavier, Case::Unexpected];

    /// Its name in folders and tables.
    pub fn name(self) -> &'static str {
        match self {
            Case::Usual => "usual",
            Case::Heavier => "heavier",
            Case::Unexpected => "unexpected",
        }
    }

    /// Factors on the usual mass: the remembered and the carried one.
    fn factors(self) -> [f64; 2] {
        let usual = ObjectSpec::new(ObjectKind::Weight).mass;
        let heavier = (usual + EXTRA) / usual;
        match self {
            Case::Usual => [1.0, 1.0],
            Case::Heavier => [heavier, heavier],
            Case::Unexpected => [1.0, heavier],
        }
    }

    /// The experiment of this case; `primitive` is the one rehearsed for it, and `config` that of the usual weight.
    pub fn config(self, config: &Config, primitive: PrimitiveFile) -> Config {
        let [_, carried] = self.factors();
        let mut case = Config { primitive, ..config.clone() };
        case.variation.mass *= carried;
        case.out = config.out.as_deref().map(|folder| folder.join(self.name()));
        case
    }

    /// The primitive of this case: the same movement, rehearsed with the weight that shall be remembered.
    ///
    /// # Errors
    /// [`PreparationError`]
    pub fn rehearsed(self, config: &Config, interrupt: &Interrupt) -> Result<PrimitiveFile, PreparationError> {
        let [remembered, _] = self.factors();
        let mut rehearsal = config.clone();
        rehearsal.variation.mass *= remembered;
        preparation::rehearsed(&rehearsal, interrupt)
    }

    /// The case whose rehearsals this one shares.
    pub fn rehearsed_as(self) -> Case {
        if self == Case::Unexpected { Case::Usual } else { self }
    }
}

/// The figures of a case, mode by mode; `mass` is the factor on the usual mass in all cases.
pub fn carried(case: Case, results: &Results, mass: f64) -> Vec<Carried> {
    let usual = mass * ObjectSpec::new(ObjectKind::Weight).mass;
    let [remembered_kg, carried_kg] = case.factors().map(|factor| factor * usual);
    let of_mode = |mode| {
        // An arm that stopped has lifted nothing; earlier versions wrote a sag of 0 for it.
        let went_on = results.of(mode).filter(|report| !report.is_stopped());
        // Half of the arms rest above their plan: as a sag that would be better than none.
        let sags: Vec<f64> = went_on.filter_map(|report| report.sag_m).map(f64::abs).collect();
        let free: Vec<f64> = results.of(mode).filter_map(|report| report.free_sag_m).map(f64::abs).collect();
        Carried {
            case: case.name(),
            remembered_kg,
            carried_kg,
            mode,
            trials: results.of(mode).count(),
            held: results.of(mode).filter(|report| report.outcome.is_success()).count(),
            sag_median_m: quantile(&sags, 0.5),
            sag_max_m: quantile(&sags, 1.0),
            free_sag_median_m: quantile(&free, 0.5),
            free_sag_max_m: quantile(&free, 1.0),
        }
    };
    results.modes().into_iter().map(of_mode).collect()
}

/// As a table.
pub fn table(rows: &[Carried]) -> String {
    let heads =
        ["mode", "remembered", "carried", "held", "off when lifted", "largest", "off before a touch", "largest"];
    let mut table = Table::new(heads);
    let millimetres = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |m| format!("{:.1} mm", m * 1e3));
    for row in rows {
        table.row([
            row.mode.to_string(),
            format!("{:.1} kg", row.remembered_kg),
            format!("{:.1} kg", row.carried_kg),
            format!("{} of {}", row.held, row.trials),
            millimetres(row.sag_median_m),
            millimetres(row.sag_max_m),
            millimetres(row.free_sag_median_m),
            millimetres(row.free_sag_max_m),
        ]);
    }
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;
    use lab::procedure::Mode;

    #[test]
    fn a_median_that_nobody_measured_is_none_and_no_zero() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            report.free_sag_m = None;
            if report.key.mode == Mode::Adaptive {
                report.outcome = Outcome::Stopped("JointSpeed".to_owned());
                report.sag_m = Some(0.0);
            }
        }
        let rows = carried(Case::Usual, &results, 1.0);
        let row = |mode: Mode| rows.iter().find(|row| row.mode == mode).unwrap();
        assert_eq!((row(Mode::Adaptive).sag_median_m, row(Mode::Adaptive).sag_max_m), (None, None));
        assert_eq!((row(Mode::OpenLoop).sag_median_m, row(Mode::OpenLoop).free_sag_max_m), (Some(0.002), None));
        assert_eq!(row(Mode::Adaptive).trials, 48);
        let text = table(&rows);
        assert!(text.contains('-') && !text.contains("0.0 mm"), "{text}");
        let json = serde_json::to_value(row(Mode::Adaptive)).unwrap();
        assert!(json["sag_median_m"].is_null() && json["free_sag_median_m"].is_null(), "{json}");
    }
}
