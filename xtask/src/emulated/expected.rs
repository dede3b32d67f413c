//! What a good start of the image looks like: clocks, rates, stack, watchdog, and nothing the emulator had to report.

use serde_json::Value;

use super::table::Table;

/// Clocks and rates: name, where the report has it, unit, value, share of it that it may be off.
const RATES: [(&str, &str, &str, f64, f64); 9] = [
    ("core", "/clocks/core", "Hz", 400e6, 0.0),
    ("AHB, AXI, flash", "/clocks/ahb", "Hz", 200e6, 0.0),
    ("APB", "/clocks/apb", "Hz", 100e6, 0.0),
    ("timers", "/clocks/timer", "Hz", 200e6, 0.0),
    ("CAN, kernel clock", "/clocks/can_kernel", "Hz", 80e6, 0.0),
    ("USB, kernel clock", "/clocks/usb", "Hz", 48e6, 0.0),
    ("CAN, bit rate", "/can_bit_rate", "bit/s", 1e6, 0.0),
    ("CAN, sample point", "/sample_point", "", 0.75, 1e-9),
    // 200 MHz / 900 is not whole.
    ("slot timer", "/slot_hz", "Hz", 900.0, 2e-6),
];

/// Time to the first frame on the arm's bus, ms: a bus that stays silent for longer is a start-up that hangs.
const FIRST_FRAME: f64 = 20.0;

/// Share of the stack that may be used at the start, and in service, percent.
const STACK: [(&str, &str, f64); 2] =
    [("stack, at start", "/stack/used_at_start", 60.0), ("stack, in service", "/stack/used_now", 40.0)];

/// Nearest the watchdog may come to the end of its time in service, us: half of its 10 ms.
const WATCHDOG_NEAREST: f64 = 5000.0;

/// What the emulator must not have found.
const FINDINGS: [&str; 3] = ["unmodelled", "refused", "ignored"];

/// Adds the report of a start.
pub(super) fn start(table: &mut Table, report: &Value, hash: &str) {
    let text = |pointer: &str| report.pointer(pointer).and_then(Value::as_str).unwrap_or("missing").to_owned();
    table.told("image", text("/image/revision"));
    let same = text("/image/hash") == hash;
    table.checked("the same bytes were executed", if same { "yes" } else { "no" }, "yes", same);
    let first = number(report, "/first_frame_us").map(|us| us / 1e3);
    table.at_most("first frame after reset", first, "ms", FIRST_FRAME);
    for (name, pointer, unit, wanted, share) in RATES {
        table.equal(name, number(report, pointer), unit, wanted, share);
    }
    findings(table, report);
    stack(table, report);
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

    use super::start;
    use crate::emulated::table::Table;

    fn good() -> Value {
        let none = || json!({ "count": 0, "entries": [] });
        json!({
            "image": { "revision": "0.1.0 (1a2b3c4)", "hash": "ab12" }, "first_frame_us": 6700, "resets": [],
            "clocks": {
                "core": 400_000_000, "ahb": 200_000_000, "apb": 100_000_000, "timer": 200_000_000,
                "can_kernel": 80_000_000, "usb": 48_000_000,
            },
            "can_bit_rate": 1_000_000, "sample_point": 0.75, "slot_hz": 900.0009,
            "stack": { "size": 61440, "used_at_start": 20000, "used_now": 9900 },
            "watchdog": { "nearest_us": 8880 },
            "unmodelled": none(), "refused": none(), "ignored": none(),
        })
    }

    fn verdict(report: &Value) -> Result<(), String> {
        let mut table = Table::default();
        start(&mut table, report, "ab12");
        table.verdict().map_err(|error| error.to_string())
    }

    #[test]
    fn a_good_start_holds() {
        assert_eq!(verdict(&good()), Ok(()));
    }

    #[test]
    fn every_deviation_is_named() {
        for (pointer, value, named) in [
            ("/clocks/usb", json!(47_000_000), "USB"),
            ("/first_frame_us", json!(null), "first frame after reset: missing"),
            ("/resets", json!([{ "at_us": 515_600, "cause": "IWDG" }]), "restarts: 1"),
            ("/stack/used_at_start", json!(36_900), "stack, at start: 60.1 %"),
            ("/stack/used_now", json!(24_700), "stack, in service: 40.2 %"),
            ("/unmodelled/count", json!(2), "unmodelled accesses: 2"),
            ("/ignored/count", json!(1), "ignored accesses: 1"),
            ("/watchdog/nearest_us", json!(900), "watchdog, nearest: 900 us left"),
            ("/image/hash", json!("cd34"), "the same bytes were executed: no"),
            ("/slot_hz", json!(900.01), "slot timer"),
        ] {
            let mut report = good();
            *report.pointer_mut(pointer).unwrap() = value;
            let error = verdict(&report).unwrap_err();
            assert!(error.contains(named), "{error}");
        }
    }
}
