//! Where a recording comes from: its first lines name the movement, how it was played, the device and the time.

use std::fmt;
use std::time::{SystemTime, UNIX_EPOCH};

/// The movement that a run played.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Played {
    /// Name of the primitive.
    pub name: String,
    /// Check sum of its movement alone: an expectation or statistics added later do not change it.
    pub movement: u32,
}

/// Where a recording comes from, as far as it says.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Origin {
    /// The movement that was played; none in a demonstration.
    pub primitive: Option<Played>,
    /// Speed relative to the taught one, 1.
    pub speed: Option<f64>,
    /// Use of the measured force, as a word.
    pub mode: Option<String>,
    /// Goal of the grasp point instead of the taught one, world frame, m.
    pub goal: Option<[f64; 3]>,
    /// Speeds and goals that were asked for while it runs, in words, `speed 2 at 3 s; goal_m 0.7,0.1,0.2 at 4 s`.
    pub changes: Option<String>,
    /// Board of the device.
    pub device: Option<String>,
    /// Its firmware.
    pub firmware: Option<String>,
    /// When it was made, UTC; none where time was simulated.
    pub date: Option<String>,
}

impl Origin {
    /// Read from the notes of a recording.
    #[must_use]
    pub fn of_notes<'a>(notes: impl Iterator<Item = &'a str>) -> Origin {
        let mut origin = Origin::default();
        for note in notes {
            let Some((key, value)) = note.split_once(": ") else { continue };
            let value = value.trim();
            let word = || Some(value.to_owned());
            match key.trim() {
                "primitive" => origin.primitive = played(value),
                "speed" => origin.speed = value.parse().ok(),
                "mode" => origin.mode = word(),
                "goal_m" => origin.goal = goal(value),
                "changes" => origin.changes = word(),
                "device" => origin.device = word(),
                "firmware" => origin.firmware = word(),
                "date" => origin.date = word(),
                _ => {}
            }
        }
        origin
    }

    /// The moment as `2026-11-22T17:05:09Z`.
    #[must_use]
    pub fn now() -> String {
        let seconds = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default().as_secs();
        date(seconds)
    }

    /// True if both say which movement they show, and it is not the same.
    #[must_use]
    pub fn contradicts(&self, other: &Origin) -> bool {
        matches!((&self.primitive, &other.primitive), (Some(one), Some(other)) if one.movement != other.movement)
    }
}

impl fmt::Display for Origin {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = |key: &str, value: Option<String>| match value {
            Some(value) => writeln!(f, "{key}: {value}"),
            None => Ok(()),
        };
        line("primitive", self.primitive.as_ref().map(Played::to_string))?;
        line("speed", self.speed.map(|speed| speed.to_string()))?;
        line("mode", self.mode.clone())?;
        line("goal_m", self.goal.map(|[x, y, z]| format!("{x},{y},{z}")))?;
        line("changes", self.changes.clone())?;
        line("device", self.device.clone())?;
        line("firmware", self.firmware.clone())?;
        line("date", self.date.clone())
    }
}

impl fmt::Display for Played {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} 0x{:08x}", self.name, self.movement)
    }
}

fn played(text: &str) -> Option<Played> {
    let (name, movement) = text.rsplit_once(" 0x")?;
    Some(Played { name: name.to_owned(), movement: u32::from_str_radix(movement, 16).ok()? })
}

fn goal(text: &str) -> Option<[f64; 3]> {
    let values: Vec<f64> = text.split(',').map(|value| value.trim().parse().ok()).collect::<Option<_>>()?;
    values.try_into().ok()
}

/// The date of a time in seconds since 1970, UTC, by the calendar's own rule: 146097 days are 400 years, counted from a
/// first of March so that the leap day comes last.
fn date(seconds: u64) -> String {
    let (days, second) = (seconds / 86_400, seconds % 86_400);
    let days = days + 719_468;
    let (era, day) = (days / 146_097, days % 146_097);
    let year = (day - day / 1_460 + day / 36_524 - day / 146_096) / 365;
    let day = day - (365 * year + year / 4 - year / 100);
    let month = (5 * day + 2) / 153;
    let day = day - (153 * month + 2) / 5 + 1;
    let (year, month) = if month < 10 { (year, month + 3) } else { (year + 1, month - 9) };
    let (hour, minute, second) = (second / 3600, second / 60 % 60, second % 60);
    format!("{:04}-{month:02}-{day:02}T{hour:02}:{minute:02}:{second:02}Z", year + 400 * era)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_origin_reads_back_what_it_wrote() {
        let origin = Origin {
            primitive: Some(Played { name: "reach".to_owned(), movement: 0x00ab_cdef }),
            speed: Some(0.3),
            mode: Some("adapt".to_owned()),
            goal: Some([0.5, -0.25, 0.1]),
            changes: Some("speed 2 at 3 s; goal_m 0.7,0.1,0.2 at 4.5 s".to_owned()),
            device: Some("in-process".to_owned()),
            firmware: Some("0.1.0 (abc)".to_owned()),
            date: Some(date(0)),
        };
        let text = origin.to_string();
        assert_eq!(Origin::of_notes(text.lines()), origin);
        let foreign = Origin::of_notes(["poses of somebody's arm", "primitive: of no check sum"].into_iter());
        assert_eq!(foreign, Origin::default());
        assert!(!foreign.contradicts(&origin) && !origin.contradicts(&origin));
    }

    #[test]
    fn dates_are_those_of_the_calendar() {
        for (seconds, expected) in [
            (0, "1970-01-01T00:00:00Z"),
            (951_782_399, "2000-02-28T23:59:59Z"),
            (951_782_400, "2000-02-29T00:00:00Z"),
            (1_767_225_600, "2026-01-01T00:00:00Z"),
            (4_107_542_400, "2100-03-01T00:00:00Z"),
        ] {
            assert_eq!(date(seconds), expected);
        }
    }
}
