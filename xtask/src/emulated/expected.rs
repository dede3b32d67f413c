//! Contents that the emulator's reports must have: the start as `emulated-board check` judges it, and what must hold
//! after any run.

use serde_json::Value;

use super::table::Table;

/// Share of the stack that may be used at the start, and in service, percent.
const STACK: [(&str, &str, f64); 2] =
    [("stack, at start", "/stack/used_at_start", 60.0), ("stack, in service", "/stack/used_now", 40.0)];

/// Nearest the watchdog may come to the end of its time in service, us: half of its 10 ms.
const WATCHDOG_NEAREST: f64 = 5000.0;

/// Findings that the emulator must not report.
const FINDINGS: [&str; 3] = ["unmodelled", "refused", "ignored"];

/// Adds the report of a start, whose rows the emulator has judged; without any it proves nothing.
pub(super) fn start(table: &mut Table, report: &Value, hash: &str) {
    table.part("start");
    let text = |value: Option<&Value>| value.and_then(Value::as_str).unwrap_or("missing").to_owned();
    table.told("image", text(report.pointer("/image/revision")));
    let same = report.pointer("/image/hash").and_then(Value::as_str) == Some(hash);
    table.checked("these bytes were executed", if same { "yes" } else { "no" }, "yes", same);
    let rows = report.get("checks").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    for row in rows {
        let holds = row.get("ok") == Some(&Value::Bool(true));
        table.checked(&text(row.get("item")), text(row.get("found")), text(row.get("expected")), holds);
    }
    if rows.is_empty() {
        table.checked("checks of the start", "none", "some", false);
    }
}

/// Adds what must hold of every report: nothing unexpected, no restart, the watchdog far away.
pub(super) fn findings(table: &mut Table, report: &Value) {
    for name in FINDINGS {
        let count = number(report, &format!("/{name}/count"));
        table.at_most(&format!("{name} accesses"), count, "", 0.0);
    }
    let resets = report.get("resets").and_then(Value::as_array).map(|resets| resets.len() as f64);
    table.at_most("restarts", resets, "", 0.0);
    let nearest = number(report, "/watchdog/nearest_us");
    let far = nearest.is_some_and(|nearest| nearest >= WATCHDOG_NEAREST);
    let shown = nearest.map_or_else(|| "missing".to_owned(), |us| format!("{us} us left"));
    table.checked("watchdog, nearest", shown, format!("at least {WATCHDOG_NEAREST}"), far);
}

/// Adds the use of the stack, in percent of it.
pub(super) fn stack(table: &mut Table, report: &Value) {
    let size = number(report, "/stack/size");
    table.told("stack", size.map_or_else(|| "missing".to_owned(), |size| format!("{size} B")));
    for (name, pointer, limit) in STACK {
        let share = number(report, pointer).zip(size).map(|(used, size)| used / size * 100.0);
        table.at_most(name, share.map(|share| (share * 10.0).round() / 10.0), "%", limit);
    }
}

/// A number of a report.
pub(super) fn number(report: &Value, pointer: &str) -> Option<f64> {
    report.pointer(pointer).and_then(Value::as_f64)
}

#[cfg(test)]
mod tests {
    use serde_json::{Value, json};

    use super::{findings, stack, start};
    use crate::emulated::table::Table;

    fn good() -> Value {
        let none = || json!({ "count": 0, "entries": [] });
        json!({
            "image": { "revision": "0.1.0 (1a2b3c4)", "hash": "ab12" }, "resets": [],
            "checks": [{ "item": "core clock", "expected": "400 Hz", "found": "400 Hz", "ok": true }],
            "stack": { "size": 65536, "used_at_start": 20000, "used_now": 9900 },
            "watchdog": { "nearest_us": 8880 },
            "unmodelled": none(), "refused": none(), "ignored": none(),
        })
    }

    fn verdict(report: &Value) -> Result<(), String> {
        let mut table = Table::default();
        start(&mut table, report, "ab12");
        findings(&mut table, report);
        stack(&mut table, report);
        table.verdict().map_err(|error| error.to_string())
    }

    #[test]
    fn a_good_report_holds() {
        assert_eq!(verdict(&good()), Ok(()));
    }

    #[test]
    fn every_deviation_is_named() {
        for (pointer, value, named) in [
            ("/checks/0/ok", json!(false), "core clock: 400 Hz, not 400 Hz"),
            ("/checks", json!([]), "checks of the start: none"),
            ("/resets", json!([{ "at_us": 515_600, "cause": "IWDG" }]), "restarts: 1"),
            ("/stack/used_at_start", json!(39_400), "stack, at start: 60.1 %"),
            ("/stack/used_now", json!(26_300), "stack, in service: 40.1 %"),
            ("/stack/size", json!(null), "stack, at start: missing"),
            ("/unmodelled/count", json!(2), "unmodelled accesses: 2"),
            ("/ignored/count", json!(1), "ignored accesses: 1"),
            ("/watchdog/nearest_us", json!(900), "watchdog, nearest: 900 us left"),
            ("/image/hash", json!("cd34"), "these bytes were executed: no"),
        ] {
            let mut report = good();
            *report.pointer_mut(pointer).unwrap() = value;
            let error = verdict(&report).unwrap_err();
            assert!(error.contains(named), "{error}");
        }
    }
}
