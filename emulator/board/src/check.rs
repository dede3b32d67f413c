//! Boots the unmodified image against an arm in this process and compares what it does with what it must do.

use std::sync::Arc;

use fdcan_model::Cancellation;
use puck::{CanFrame, Group, MotorMode, PropertyId, set, zero_torques};
use serde_json::{Map, Value, json};
use sim::{FreeJoints, Plant, PlantConfig, TICKS_PER_MICROSECOND, ticks};

use crate::board::UNIQUE;
use crate::findings::Grade;
use crate::host::{Inquirer, Learned, SharedLearned};
use crate::image::Image;
use crate::report::Measured;
use crate::run::{RunError, run};
use crate::setup::{Outcome, Setup};
use crate::world::InProcess;

/// Most findings told in sentences.
const MOST_FINDINGS: usize = 12;

/// Most faults told in sentences.
const MOST_FAULTS: usize = 4;

/// Virtual time of the check, ns.
const UNTIL: u64 = 3_500_000_000;

/// One row of the table.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Row {
    /// Name of the check.
    pub item: &'static str,
    /// Expected value.
    pub expected: String,
    /// Value found.
    pub found: String,
    /// True if they agree.
    pub is_right: bool,
}

/// The whole check.
#[derive(Debug)]
pub struct Checked {
    /// The table.
    pub rows: Vec<Row>,
    /// The report of the run.
    pub report: Map<String, Value>,
    /// Reasons of a failure, in sentences.
    pub reasons: Vec<String>,
}

impl Checked {
    /// True if everything is as it must be.
    #[must_use]
    pub fn is_right(&self) -> bool {
        self.rows.iter().all(|row| row.is_right)
    }

    /// The table as text.
    #[must_use]
    pub fn table(&self) -> String {
        let width = |text: fn(&Row) -> &str| self.rows.iter().map(|row| text(row).chars().count()).max().unwrap_or(0);
        let (first, second) = (width(|row| row.item), width(|row| &row.expected));
        let line = |row: &Row| {
            let mark = if row.is_right { "ok  " } else { "FAIL" };
            format!("{mark}  {:first$}  {:second$}  {}\n", row.item, row.expected, row.found)
        };
        self.rows.iter().map(line).collect()
    }
}

/// Runs the check.
///
/// # Errors
/// [`RunError`]
pub fn check(image: &Arc<Image>) -> Result<Checked, RunError> {
    let learned = SharedLearned::default();
    let plant = Plant::new(PlantConfig::default(), Box::new(FreeJoints::new(sim::HOME)));
    let world = InProcess::new(plant, Box::new(Inquirer::new(image.model_hash, learned.clone())));
    let setup = Setup { until: Some(UNTIL), cancellation: Cancellation::Skipped, strict: false, ..Setup::default() };
    let outcome = run(image, &setup, Box::new(world))?;
    let learned = learned.lock();
    let rows = rows(image, &outcome.measured, &learned);
    let mut report = outcome.measured.json(image);
    let table: Vec<Value> = rows
        .iter()
        .map(|row| json!({ "item": row.item, "expected": row.expected, "found": row.found, "ok": row.is_right }))
        .collect();
    report.insert("checks".into(), json!(table));
    report.insert("ready_us".into(), json!(learned.ready_at.map(|at| at / TICKS_PER_MICROSECOND)));
    report.insert("bus_hash".into(), json!(format!("{:016x}", learned.bus_hash)));
    Ok(Checked { rows, report, reasons: reasons(image, &outcome) })
}

/// First frames of the image: zero torques and idle to arm and hand, then the arm's again, because one may be lost.
fn first_frames() -> Vec<CanFrame> {
    let [arm, wrist] = zero_torques();
    let idle = |group| set(group, PropertyId::MODE, MotorMode::Idle.value());
    [arm, wrist, idle(Group::ARM), idle(Group::HAND), idle(Group::ARM)].into()
}

fn in_words(frames: &[CanFrame]) -> String {
    let words: Vec<String> = frames.iter().map(|frame| format!("{frame:?}").replace(' ', "")).collect();
    words.join(" ")
}

/// Reasons of a failure, in sentences.
fn reasons(image: &Image, outcome: &Outcome) -> Vec<String> {
    let measured = &outcome.measured;
    let mut reasons = Vec::new();
    let guard_met = measured.faults.iter().any(|note| note.exception == 4);
    let overflowed = measured.findings.all().iter().any(|finding| finding.text.contains("below the stack"));
    if overflowed && !guard_met {
        reasons.push("the stack overflowed and stepped over its guard: no memory fault came before this".into());
    }
    reasons.extend(measured.faults.iter().take(MOST_FAULTS).map(|note| note.line(image)));
    for (at, cause) in &measured.resets {
        reasons.push(format!("the chip was reset at {:.1} ms by {}", *at as f64 / 1e6, cause_in_words(cause)));
    }
    let worst: Vec<_> = measured.findings.all().iter().filter(|finding| finding.grade < Grade::Excused).collect();
    reasons.extend(worst.iter().take(MOST_FINDINGS).map(|finding| finding.line()));
    if worst.len() > MOST_FINDINGS {
        reasons.push(format!("and {} more findings of this kind", worst.len() - MOST_FINDINGS));
    }
    reasons
}

fn cause_in_words(cause: &str) -> &str {
    match cause {
        "Model(\"IWDG\")" => "the watchdog",
        "Core" => "the image itself",
        other => other,
    }
}

/// Collects rows.
struct Table(Vec<Row>);

impl Table {
    fn row(&mut self, item: &'static str, expected: impl Into<String>, found: impl Into<String>, is_right: bool) {
        self.0.push(Row { item, expected: expected.into(), found: found.into(), is_right });
    }

    fn equal(&mut self, item: &'static str, expected: u64, found: u64, unit: &str) {
        self.row(item, format!("{expected}{unit}"), format!("{found}{unit}"), expected == found);
    }

    fn at_most(&mut self, item: &'static str, most: f64, found: Option<f64>, unit: &str) {
        let text = found.map_or("never".into(), |found| format!("{found:.3}{unit}"));
        self.row(item, format!("at most {most}{unit}"), text, found.is_some_and(|found| found <= most));
    }
}

fn rows(image: &Image, measured: &Measured, learned: &Learned) -> Vec<Row> {
    let mut table = Table(Vec::new());
    table.equal("resets", 0, measured.resets.len() as u64, "");
    table.equal("faults", 0, measured.faults.len() as u64, "");
    table.at_most("first frame on the arm's bus", 15.0, measured.first_frame.map(|at| at as f64 / 1e6), " ms");
    let first = in_words(&learned.first_frames);
    let expected = in_words(&first_frames());
    table.row("its first frames", expected.clone(), first.clone(), first == expected);
    table.at_most("ready", 3.0, learned.ready_at.map(|at| at as f64 / ticks(1.0) as f64), " s");
    clock_rows(&mut table, measured);
    memory_rows(&mut table, image, measured);
    watchdog_rows(&mut table, measured);
    let [session, log] = measured.priorities;
    let found = format!("{session:#04x}, {log:#04x}");
    table.row("priorities of the session's and the log's line", "0xe0, 0xf0", found, (session, log) == (0xE0, 0xF0));
    link_rows(&mut table, learned);
    for (item, grade) in [
        ("accesses to nothing that is modelled", Grade::Unmodelled),
        ("accesses that the chip refuses", Grade::Refused),
        ("writes that the chip ignores", Grade::Ignored),
    ] {
        table.equal(item, 0, measured.findings.of(grade).count() as u64, "");
    }
    table.0
}

fn clock_rows(table: &mut Table, measured: &Measured) {
    let clocks = &measured.clocks;
    for (item, expected, found) in [
        ("core clock", 400_000_000, clocks.core),
        ("AHB, AXI and flash", 200_000_000, clocks.ahb),
        ("APB", 100_000_000, clocks.apb),
        ("timers", 200_000_000, clocks.timer),
        ("CAN kernel clock", 80_000_000, clocks.can),
        ("USB kernel clock", 48_000_000, clocks.usb),
    ] {
        table.equal(item, expected, found, " Hz");
    }
    let (power, flash) = (clocks.power, clocks.flash);
    table.row("voltage scale 1, ready (PWR.D3CR)", "0xe000", format!("{power:#x}"), power == 0xE000);
    table.row("two wait states at 200 MHz (FLASH.ACR)", "0x22", format!("{flash:#x}"), flash == 0x22);
    let rate = measured.timing.map_or(0, |timing| timing.bits_per_second());
    table.equal("CAN bit rate", 1_000_000, u64::from(rate), " bit/s");
    let sample = measured.timing.map_or(0, |timing| timing.sample_point_per_mille());
    table.equal("CAN sample point", 750, u64::from(sample), " per mille");
    let [arm, host] = &measured.accepted;
    table.equal("identifiers that pass the arm's filters", 26, arm.len() as u64, "");
    let is_host = *host == (0x010..0x020).collect::<Vec<u16>>();
    let text = match (host.first(), host.last()) {
        (Some(first), Some(last)) => format!("{:#05x} to {:#05x}, {} of them", first, last, host.len()),
        _ => "none".into(),
    };
    table.row("identifiers that pass the host's filters", "0x010 to 0x01f, 16 of them", text, is_host);
    let slot = clocks.slot_micro_hz as f64 / 1e6;
    table.row("slots a second", "900 within 5 millionths", format!("{slot:.4}"), (slot / 900.0 - 1.0).abs() < 5e-6);
    let baud = measured.serial_baud as f64;
    let error = baud / 921_600.0 - 1.0;
    let text = format!("{baud} ({:+.2} %)", 100.0 * error);
    table.row("serial line, bit/s", "921600 within 0.3 %", text, error.abs() < 0.003);
}

fn memory_rows(table: &mut Table, image: &Image, measured: &Measured) {
    let size = f64::from(image.stack.end - image.stack.start);
    let percent = |used: Option<u32>| used.map(|used| 100.0 * f64::from(used) / size);
    table.at_most("stack used at start", 60.0, percent(measured.stack.at_start), " %");
    table.at_most("stack used in service", 40.0, percent(measured.stack.in_service), " %");
    table.equal("stale reads of bank 2", 0, measured.cache.stale, "");
    table.equal("cached reads of bank 2", 0, measured.cache.cacheable, "");
}

fn watchdog_rows(table: &mut Table, measured: &Measured) {
    let watchdog = &measured.watchdog;
    let window = watchdog.window_ns as f64 / 1e6;
    table.row("watchdog window", "9 to 11 ms", format!("{window:.3} ms"), (9.0..=11.0).contains(&window));
    let force = watchdog.changed_at;
    let first = measured.first_slot.unwrap_or(0);
    let text = format!("at {:.3} ms, first slot at {:.3} ms", force as f64 / 1e6, first as f64 / 1e6);
    table.row("watchdog window in force", "before the first slot", text, 0 < force && force < first);
    let nearest = watchdog.nearest_ns.map(|left| left as f64 / 1e6);
    let text = nearest.map_or("never fed".into(), |nearest| format!("{nearest:.3} ms"));
    table.row("watchdog's nearest in service", "at least 8 ms", text, nearest.is_some_and(|nearest| nearest >= 8.0));
}

fn link_rows(table: &mut Table, learned: &Learned) {
    let serial: String = UNIQUE.iter().map(|word| format!("{word:08x}")).collect();
    let told = learned.hello.as_ref().map_or("nobody", |hello| hello.serial.as_str());
    table.row("serial number over the link", serial.clone(), told, told == serial);
    let lost = learned.asked.saturating_sub(learned.answered);
    table.row(
        "answers over the serial line",
        "all but those at the start and the last",
        format!("{} of {}", learned.answered, learned.asked),
        learned.answered > 0 && lost <= 3,
    );
    let statistics = learned.statistics.unwrap_or_default();
    let latency = f64::from(statistics.latency_worst_ticks) / 200.0;
    table.at_most("latency of a slot", 100.0, Some(latency), " us");
    table.equal("missed deadlines", 0, statistics.missed_deadlines.into(), "");
    table.equal("lost replies", 0, statistics.lost_replies.into(), "");
    table.equal("rejected frames", 0, statistics.rejected_frames.into(), "");
}
