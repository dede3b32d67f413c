//! What the low-priority half ([`crate::Session`]) needs from the world: the line, and the queues to the control half.

use control::plan::primitive::Primitive;
use control::{CycleRecord, Fit, LoadRefusal};

use crate::command::Command;
use crate::event::Event;
use crate::health::Health;

/// A primitive as the control half holds it.
pub type StoredPrimitive = Primitive<f32, { control::MAX_KERNELS }>;

/// One that has been checked against an arm.
pub type FitPrimitive<'a> = Fit<'a, f32, { control::MAX_KERNELS }>;

/// The queue to the control half is full: it has not taken the previous commands yet.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct QueueFull;

impl core::fmt::Display for QueueFull {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("the control cycle has not taken the previous commands yet")
    }
}

impl core::error::Error for QueueFull {}

/// One control cycle together with what only its caller can measure.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedRecord {
    /// What the cycle measured and decided.
    pub record: CycleRecord,
    /// How long its computation took, ticks; 0 where that is not measured.
    pub cost_ticks: u32,
}

/// What only the board can measure about its own processor.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Timing {
    /// Longest control computation, ticks.
    pub cost_worst_ticks: u32,
    /// Mean control computation, ticks.
    pub cost_mean_ticks: u32,
    /// Longest delay from the slot timer to the control task, ticks.
    pub latency_worst_ticks: u32,
    /// Stack never used so far, bytes; 0 where it is not measured.
    pub stack_free: u32,
    /// Size of the stack, bytes; 0 where it is not measured.
    pub stack_size: u32,
}

/// The line to the host and the queues to the control half, as the session sees them.
pub trait SessionPort {
    /// Hands bytes to the line. Never more than [`SessionPort::room`] said.
    fn send(&mut self, bytes: &[u8]);

    /// Bytes the line can take now. The session waits with answers and drops telemetry when it is too little.
    fn room(&self) -> usize {
        usize::MAX
    }

    /// Queues a command for the control half, which answers each by exactly one event, in their order.
    ///
    /// # Errors
    /// [`QueueFull`]
    fn command(&mut self, command: Command) -> Result<(), QueueFull>;

    /// Gives the control cycle another primitive, which is no more than a copy. Called only while no primitive runs.
    ///
    /// # Errors
    /// As [`crate::Core::load`]. It must not be swallowed: the next run would be that of the old primitive.
    fn load(&mut self, fit: &FitPrimitive<'_>) -> Result<(), LoadRefusal>;

    /// The next record of a control cycle, oldest first.
    fn record(&mut self) -> Option<TimedRecord>;

    /// The next event of the control half, oldest first.
    fn event(&mut self) -> Option<Event>;

    /// The state of the control half now.
    fn health(&mut self) -> Health;

    /// What the board measured about its processor.
    fn timing(&mut self) -> Timing;
}
