//! Figures beside what they must be.

use std::fmt;

use anyhow::{Result, ensure};

/// One line; one without a value is a heading.
struct Row {
    name: String,
    value: String,
    /// Expected value; empty: told, not checked.
    wanted: String,
    holds: bool,
}

/// Lines in the order in which they were found.
#[derive(Default)]
pub(super) struct Table(Vec<Row>);

impl Table {
    /// Begins a part of the table.
    pub(super) fn part(&mut self, name: &str) {
        self.told(name, "");
    }

    /// A figure that is only told.
    pub(super) fn told(&mut self, name: &str, value: impl Into<String>) {
        self.0.push(Row { name: name.to_owned(), value: value.into(), wanted: String::new(), holds: true });
    }

    /// A figure and what it must be.
    pub(super) fn checked(&mut self, name: &str, value: impl Into<String>, wanted: impl Into<String>, holds: bool) {
        self.0.push(Row { name: name.to_owned(), value: value.into(), wanted: wanted.into(), holds });
    }

    /// A number of some unit that must not be larger; one that is missing is a failure.
    pub(super) fn at_most(&mut self, name: &str, value: Option<f64>, unit: &str, limit: f64) {
        let holds = value.is_some_and(|value| value <= limit);
        let wanted = if limit == 0.0 { "0".to_owned() } else { format!("at most {}", number(limit)) };
        self.checked(name, shown(value, unit), wanted, holds);
    }

    /// True while everything is as it must be.
    pub(super) fn holds(&self) -> bool {
        self.0.iter().all(|row| row.holds)
    }

    /// An error that names what is not as it must be.
    pub(super) fn verdict(&self) -> Result<()> {
        let wrong: Vec<String> = self
            .0
            .iter()
            .filter(|row| !row.holds)
            .map(|row| format!("{}: {}, not {}", row.name, row.value, row.wanted))
            .collect();
        ensure!(wrong.is_empty(), "the emulated board deviates: {}", wrong.join("; "));
        Ok(())
    }
}

fn shown(value: Option<f64>, unit: &str) -> String {
    value.map_or_else(|| "missing".to_owned(), |value| format!("{} {unit}", number(value)).trim_end().to_owned())
}

/// With as many digits as it has, at most four behind the point.
fn number(value: f64) -> String {
    let text = format!("{value:.4}");
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

impl fmt::Display for Table {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for Row { name, value, wanted, holds } in &self.0 {
            let mark = if *holds { "" } else { "  <-- WRONG" };
            if value.is_empty() && wanted.is_empty() {
                writeln!(f, "\n{name}")?;
                continue;
            }
            let wanted = if wanted.is_empty() { String::new() } else { format!("({wanted})") };
            writeln!(f, "{}", format!("{name:<42} {value:<26} {wanted}{mark}").trim_end())?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn what_deviates_or_is_missing_fails_and_is_named() {
        let mut table = Table::default();
        table.part("start");
        table.told("speed", "2.1");
        table.at_most("stack", Some(60.0), "%", 60.0);
        table.checked("seeds", "equal", "equal", true);
        assert!(table.holds() && table.verdict().is_ok());
        table.at_most("frame", Some(7.5), "ms", 7.0);
        table.checked("core", "399 Hz", "400 Hz", false);
        table.at_most("lost", None, "", 0.0);
        assert!(!table.holds());
        let error = table.verdict().unwrap_err().to_string();
        for part in ["frame: 7.5 ms, not at most 7", "core: 399 Hz, not 400 Hz", "lost: missing"] {
            assert!(error.contains(part), "{error}");
        }
        assert_eq!(table.to_string().matches("WRONG").count(), 3);
    }
}
