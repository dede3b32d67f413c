//! Data of `tactus --json faults`.

use std::collections::BTreeMap;

use control::Fault;
use lab::client::LastSecond;
use lab::fault_guide::FaultGuide;
use link::{Status, Telemetry};
use schemars::JsonSchema;
use serde::Serialize;

use super::{SUPERVISED, health_name, pendant, state};

/// The present fault, the last one with its cycles, and the pendant.
#[derive(Debug, Serialize, JsonSchema)]
pub struct FaultReport {
    /// The latched fault; null for none.
    pub present: Option<Explained>,
    /// The last fault that the device remembers; null for none.
    pub last: Option<Last>,
    /// State of the pendant; null before it was read, and for a word that no document explains.
    pub pendant: Option<Pendant>,
    /// The pendant's word as read from the bus.
    pub pendant_word: Option<u32>,
}

/// A fault with its explanation.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Explained {
    /// Its code.
    pub code: u8,
    /// Its name.
    pub name: String,
    /// The event.
    pub meaning: &'static str,
    /// The usual cause.
    pub cause: &'static str,
    /// The thing to look at.
    pub check: &'static str,
    /// The way on.
    pub clear: &'static str,
}

/// The last fault.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Last {
    /// Its number; another number is another record.
    pub number: u16,
    /// The fault; null where the device was restarted instead.
    pub fault: Option<Explained>,
    /// It was no fault: the device was restarted.
    pub restart: bool,
    /// It is latched still.
    pub latched: bool,
    /// Cycles that could not be read back.
    pub damaged_cycles: usize,
    /// The second before it, oldest first.
    pub cycles: Vec<Cycle>,
}

/// A control cycle.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Cycle {
    /// Its number.
    pub cycle: u32,
    /// State of the supervisor.
    pub state: &'static str,
    /// Code of the latched fault, 0 for none.
    pub fault: u8,
    /// Flag bits; docs/faults.md lists them.
    pub flags: u32,
    /// Phase of the primitive, 1 to about 0.01.
    pub phase: f32,
    /// Joint angles, rad.
    pub q_rad: [f32; 7],
    /// Joint velocities, rad/s.
    pub dq_rad_s: [f32; 7],
    /// Joint torques sent, N m.
    #[serde(rename = "tau_Nm")]
    pub tau_nm: [f32; 7],
    /// Force of the environment on the robot (N, world axes) and torque (N m, hand axes).
    #[serde(rename = "wrench_N_Nm")]
    pub wrench: [f32; 6],
    /// Spread and fingers F1 to F3, rad.
    pub hand_rad: [f32; 4],
    /// Replies missing in this cycle.
    pub lost_replies: u8,
    /// Control computation, ticks.
    pub cost_ticks: u32,
}

/// State of the pendant.
#[derive(Debug, Serialize, JsonSchema)]
pub struct Pendant {
    /// Each quantity that the safety module judges: ok, warning or fault.
    pub supervised: BTreeMap<&'static str, &'static str>,
    /// The figure or letter on its display; null for none that is known.
    pub display: Option<char>,
    /// The idle light is on.
    pub idle_light: bool,
    /// The activate light is on.
    pub activate_light: bool,
    /// The button that is pressed.
    pub button: String,
}

impl FaultReport {
    pub(super) fn of(status: &Status, last: Option<&LastSecond>) -> Self {
        Self {
            present: Explained::of(status.fault),
            last: last.map(|LastSecond { record, cycles }| Last {
                number: record.number,
                fault: Explained::of(record.fault),
                restart: record.fault == 0,
                latched: record.latched,
                damaged_cycles: usize::from(record.cycles).saturating_sub(cycles.len()),
                cycles: cycles.iter().map(Cycle::of).collect(),
            }),
            pendant: pendant(status).map(|state| Pendant {
                supervised: SUPERVISED
                    .iter()
                    .zip(state.health())
                    .map(|(name, health)| (*name, health_name(health)))
                    .collect(),
                display: state.display(),
                idle_light: state.idle_light,
                activate_light: state.activate_light,
                button: format!("{:?}", state.button),
            }),
            pendant_word: status.pendant,
        }
    }
}

impl Explained {
    fn of(code: u8) -> Option<Self> {
        let fault = Fault::from_code(code).filter(|fault| *fault != Fault::None)?;
        let FaultGuide { cause, check, clear, .. } = FaultGuide::of(fault);
        Some(Self { code, name: format!("{fault:?}"), meaning: fault.explanation(), cause, check, clear })
    }
}

impl Cycle {
    fn of(cycle: &Telemetry) -> Self {
        Self {
            cycle: cycle.cycle,
            state: state(cycle),
            fault: cycle.fault,
            flags: cycle.flags,
            phase: cycle.phase,
            q_rad: cycle.q,
            dq_rad_s: cycle.dq,
            tau_nm: cycle.tau,
            wrench: cycle.wrench,
            hand_rad: cycle.hand,
            lost_replies: cycle.lost_replies,
            cost_ticks: cycle.cost_ticks,
        }
    }
}
