//! The outcomes as a map of letters for the terminal, and the figures of each mode as a table.

use super::grid::{self, Grid};
use super::results::Results;
use super::statistics::{Spread, Summary};
use lab::procedure::Mode;
use lab::table::Table;

/// Space between the maps of two modes.
const GAP: &str = "   ";

/// The maps of all modes side by side: columns along the approach, rows sideways, one sign a cell.
///
/// With one seed the sign is the outcome's letter; with several it is a letter where all agree, and otherwise the
/// number of successes (`+` from ten).
pub fn draw(results: &Results, grid: &Grid) -> String {
    let (columns, rows) = (grid.columns(), grid.rows());
    let width = 2 * columns.len() - 1;
    let modes = results.modes();
    let mut text = format!(
        "columns: object along the approach, {} .. {} cm (negative = nearer the arm); rows: sideways\n\
         S held, K knocked over, M missed, P pushed away, D dropped, C crushed, L not lifted,\n\
         U unstable, F stopped by a fault{}\n",
        centimetres(columns.first().copied().unwrap_or(0)),
        centimetres(columns.last().copied().unwrap_or(0)),
        if results.seeds().len() > 1 { "; a number: seeds of which it was held where they differ" } else { "" },
    );
    text.push_str("        ");
    for mode in &modes {
        let heading = format!("({mode}) {}/{}", short(results.success_count(*mode)), results.cells(Some(*mode)));
        text.push_str(&format!("{heading:width$}{GAP}"));
    }
    finish_line(&mut text);
    for sideways_mm in rows {
        text.push_str(&format!("{:>6}  ", centimetres(sideways_mm)));
        for mode in &modes {
            let signs: Vec<String> = columns
                .iter()
                .map(|&along_mm| {
                    let index =
                        grid.cells.iter().position(|cell| (cell.along_mm, cell.sideways_mm) == (along_mm, sideways_mm));
                    index.map_or(' ', |index| sign(results, *mode, index)).to_string()
                })
                .collect();
            text.push_str(&signs.join(" "));
            text.push_str(GAP);
        }
        finish_line(&mut text);
    }
    text
}

fn sign(results: &Results, mode: Mode, index: usize) -> char {
    let mut letters = results.of(mode).filter(|report| report.key.index == index).map(|report| report.outcome.letter());
    let Some(first) = letters.next() else {
        return '.';
    };
    let rest: Vec<char> = letters.collect();
    if rest.iter().all(|letter| *letter == first) {
        return first;
    }
    let held = rest.iter().chain([&first]).filter(|letter| **letter == 'S').count();
    // Failures of different kinds: the first one's letter, in lower case.
    if held == 0 {
        return first.to_ascii_lowercase();
    }
    u32::try_from(held).ok().and_then(|held| char::from_digit(held, 10)).unwrap_or('+')
}

fn finish_line(text: &mut String) {
    text.truncate(text.trim_end().len());
    text.push('\n');
}

fn centimetres(millimetres: i32) -> String {
    format!("{:+}", grid::centimetres(millimetres))
}

/// A mean without needless digits.
pub fn short(value: f64) -> String {
    if value.fract().abs() < 1e-9 { format!("{value:.0}") } else { format!("{value:.1}") }
}

/// Words on a value; a dash for one that nobody could measure.
fn or_none<T>(value: Option<T>, words: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| "-".to_owned(), words)
}

/// Median and largest of a force.
fn newtons(force: Option<Spread>) -> String {
    or_none(force, |force| format!("{:.1} N  {:.1} N", force.median, force.max))
}

/// Median and largest of a way.
fn millimetres(way: Option<Spread>) -> String {
    or_none(way, |way| format!("{:.1} mm  {:.1} mm", way.median * 1e3, way.max * 1e3))
}

/// The figures of each mode as a table.
pub fn table(summaries: &[Summary]) -> String {
    let mut heading = vec!["mean over the seeds".to_owned()];
    heading.extend(summaries.iter().map(|summary| format!("({}) {}", summary.mode, summary.mode.title())));
    let mut table = Table::new(heading);
    let mut row = |name: &str, value: &dyn Fn(&Summary) -> String| {
        let cells = std::iter::once(name.to_owned()).chain(summaries.iter().map(value));
        table.row(cells.collect::<Vec<_>>());
    };
    row("held", &|s| format!("{} of {}", short(s.success), s.cells));
    if summaries.iter().any(|summary| summary.success_interval.is_some()) {
        row("held, 95 % interval over the arms", &|s| or_none(s.success_interval, |interval| interval.bounds()));
    }
    row("held, seed by seed", &|s| s.success_by_seed.iter().map(usize::to_string).collect::<Vec<_>>().join(" "));
    row("knocked over, missed, pushed away", &|s| {
        format!("{} {} {}", short(s.knocked_over), short(s.missed), short(s.pushed_away))
    });
    row("dropped, crushed, stopped", &|s| format!("{} {} {}", short(s.dropped), short(s.crushed), short(s.stopped)));
    row("not lifted, unstable", &|s| format!("{} {}", short(s.not_lifted), short(s.unstable)));
    row("farthest success", &|s| or_none(s.farthest_success_m, |m| format!("{:.1} cm", m * 100.0)));
    row("largest adaptation", &|s| {
        or_none(s.adaptation_m.zip(s.adaptation_deg), |(m, degrees)| format!("{:.1} cm  {degrees:.1} deg", m * 100.0))
    });
    row("hand at the first touch, median, max", &|s| {
        or_none(s.touch_speed_m_s, |speed| format!("{:.1} cm/s  {:.1} cm/s", speed.median * 1e2, speed.max * 1e2))
    });
    row("peak force before closing, median, max", &|s| newtons(s.contact_peak_n));
    if summaries.iter().any(|summary| summary.below_tipping.is_some()) {
        row("trials below the tipping force", &|s| or_none(s.below_tipping, |share| format!("{:.0} %", share * 100.0)));
    }
    row("pushed before closing, median, max", &|s| {
        or_none(s.push_m, |way| format!("{:.1} cm  {:.1} cm", way.median * 100.0, way.max * 100.0))
    });
    row("finger on object, median, max", &|s| newtons(s.finger_peak_n));
    row("finger over 50 ms, median, max; asked", &|s| {
        format!("{}; {}", newtons(s.finger_grip_n), or_none(s.finger_asked_n, |force| format!("{:.1} N", force.max)))
    });
    row("trials with at most 1.5 of what was asked", &|s| format!("{:.0} %", s.grip_as_asked * 100.0));
    row("wrist above 3 Hz, closing to lift, median, max", &|s| {
        or_none(s.chatter_n, |force| format!("{:.2} N  {:.2} N", force.median, force.max))
    });
    row("hand on table, max", &|s| or_none(s.table_peak_n, |force| format!("{:.1} N", force.max)));
    row("off its plan when lifted, median, max", &|s| millimetres(s.sag_m));
    row("off its height before a touch, median, max", &|s| millimetres(s.free_sag_m));
    row("shaking above 15 Hz, median, max", &|s| {
        or_none(s.shaking_rad_s, |speed| format!("{:.2}  {:.2} rad/s", speed.median, speed.max))
    });
    row("false alarms", &|s| format!("{} of {}", s.detection.false_alarms, s.detection.successes));
    row("failures reported before the lift", &|s| {
        format!("{} of {}", s.detection.flagged_before_lift, s.detection.failures)
    });
    row("delay of the report, median", &|s| or_none(s.detection.median_delay_s, |delay| format!("{delay:.2} s")));
    table.to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixtures;
    use crate::outcome::Outcome;

    #[test]
    fn the_map_has_the_arm_on_the_left_and_the_left_side_on_top() {
        let mut results = fixtures::results(&[1]);
        for report in &mut results.reports {
            let cell = report.key.cell;
            report.outcome = match (cell.along_mm, cell.sideways_mm) {
                (-240, 80) => Outcome::Missed,
                (40, -120) => Outcome::Dropped,
                _ => Outcome::Held,
            };
        }
        let text = draw(&results, &Grid::paper());
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[3].contains("(a) 46/48") && lines[3].contains("(c) 46/48"), "{}", lines[3]);
        assert_eq!(lines[4], "    +8  M S S S S S S S   M S S S S S S S   M S S S S S S S");
        assert_eq!(lines[9], "   -12  S S S S S S S D   S S S S S S S D   S S S S S S S D");
        assert_eq!(lines.len(), 10);
    }

    /// The change that makes it fail: a product with 0.1 instead of `grid::centimetres`.
    #[test]
    fn the_labels_of_a_turned_grid_are_centimetres_of_at_most_one_digit() {
        let turned = Grid::paper().moved(30.0, [0.0, 0.0]);
        let text = draw(&fixtures::results(&[1]), &turned);
        let labels: Vec<&str> = text.lines().skip(4).filter_map(|line| line.split_whitespace().next()).collect();
        assert!(labels.iter().all(|label| label.len() <= "-13.7".len()), "{labels:?}");
        assert_eq!((centimetres(137), centimetres(-29), centimetres(40)), ("+13.7".into(), "-2.9".into(), "+4".into()));
    }

    #[test]
    fn seeds_that_differ_show_how_many_held() {
        let mut results = fixtures::results(&[1, 2, 3]);
        for report in &mut results.reports {
            report.outcome =
                if report.key.index == 0 && report.key.seed == 2 { Outcome::KnockedOver } else { Outcome::Held };
        }
        let text = draw(&results, &Grid::paper());
        assert!(text.lines().nth(4).is_some_and(|line| line.starts_with("    +8  2 S S")), "{text}");
        assert!(text.contains("(a) 47.7/48"), "{text}");
    }

    #[test]
    fn the_table_names_every_mode() {
        let results = fixtures::results(&[1, 2]);
        let summaries: Vec<Summary> = Mode::PAPER.iter().map(|mode| Summary::of(&results, *mode, Some(2.0))).collect();
        let text = table(&summaries);
        assert!(
            text.contains("(c) force control and adaptation") && text.contains("trials below the tipping force"),
            "{text}"
        );
    }
}
