//! Report of a run, the same for equal runs.

use fdcan_model::BitTiming;
use serde_json::{Map, Value, json};

use crate::cache::CacheCount;
use crate::clocks::Clocks;
use crate::findings::Findings;
use crate::image::Image;
use crate::notes::FaultNote;
use crate::stack::StackUse;
use crate::watchdog::Watched;

/// Measurements.
#[derive(Debug, Default)]
pub struct Measured {
    /// Virtual time, ns.
    pub now: u64,
    /// Instructions executed.
    pub instructions: u64,
    /// Restarts: time in ns, cause.
    pub resets: Vec<(u64, String)>,
    /// First frame on the arm's bus, ns.
    pub first_frame: Option<u64>,
    /// The second CAN controller is on its bus.
    pub second_bus: bool,
    /// The slot timer's first interrupt, ns.
    pub first_slot: Option<u64>,
    /// Frames sent on the arm's bus.
    pub frames_sent: u64,
    /// Clocks.
    pub clocks: Clocks,
    /// Bit timing of the arm's controller.
    pub timing: Option<BitTiming>,
    /// Stack.
    pub stack: StackUse,
    /// Watchdog.
    pub watchdog: Watched,
    /// Reads of bank 2.
    pub cache: CacheCount,
    /// Priority registers of the lines that run the session and the log.
    pub priorities: [u8; 2],
    /// Faults whose handlers began.
    pub faults: Vec<FaultNote>,
    /// Identifiers that pass the filters of the two CAN controllers.
    pub accepted: [Vec<u16>; 2],
    /// Rate of the serial line, bits per second; 0 while it is off.
    pub serial_baud: u64,
    /// Operations of bank 2.
    pub bank_operations: u64,
    /// Findings.
    pub findings: Findings,
}

impl Measured {
    /// One object.
    #[must_use]
    pub fn json(&self, image: &Image) -> Map<String, Value> {
        let resets: Vec<Value> =
            self.resets.iter().map(|(at, cause)| json!({ "at_us": at / 1000, "cause": cause })).collect();
        let stale_by = self.cache.first_stale.map(|pc| image.function_at(pc));
        let mut object = Map::new();
        let mut put = |key: &str, value: Value| object.insert(key.into(), value);
        put("board", json!(crate::image::BOARD));
        put("image", json!({ "revision": image.firmware, "hash": image.hash }));
        put("virtual_seconds", json!(self.now as f64 / 1e9));
        put("instructions", json!(self.instructions));
        put("resets", json!(resets));
        put("first_frame_us", json!(self.first_frame.map(|at| at / 1000)));
        put("first_slot_us", json!(self.first_slot.map(|at| at / 1000)));
        put("frames_sent", json!(self.frames_sent));
        put("clocks", self.clocks.json());
        put("can_bit_rate", json!(self.timing.map(|timing| timing.bits_per_second())));
        put("sample_point", json!(self.timing.map(|timing| f64::from(timing.sample_point_per_mille()) / 1000.0)));
        put("serial_baud", json!(self.serial_baud));
        put("slot_hz", json!(self.clocks.slot_micro_hz as f64 / 1e6));
        put(
            "stack",
            json!({
                "size": image.stack.end - image.stack.start,
                "used_at_start": self.stack.at_start,
                "used_now": self.stack.in_service,
                "used_ever": self.stack.ever,
            }),
        );
        put(
            "watchdog",
            json!({
                "window_us": self.watchdog.window_ns / 1000,
                "longest_window_us": self.watchdog.longest_window_ns / 1000,
                "nearest_us": self.watchdog.nearest_ns.map(|left| left / 1000),
            }),
        );
        put(
            "bank2",
            json!({
                "operations": self.bank_operations,
                "reads": self.cache.reads,
                "cached_reads": self.cache.cacheable,
                "stale_reads": self.cache.stale,
                "first_stale_by": stale_by,
            }),
        );
        put("priorities", json!({ "session": self.priorities[0], "log": self.priorities[1] }));
        put("faults", json!(self.faults.iter().map(|note| note.line(image)).collect::<Vec<_>>()));
        for (grade, entries) in self.findings.json() {
            put(grade, entries);
        }
        object
    }
}
