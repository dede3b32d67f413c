//! Error counters, error states and the protocol status register.
//!
//! Source: ISO 11898-1, fault confinement; registers ECR and PSR of RM0433.

use crate::registers::ir;

/// An error on the wire, as PSR.LEC names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BusError {
    /// More than five equal bits where stuffing forbids it.
    Stuff,
    /// A bit of fixed form has the wrong level.
    Form,
    /// Nobody acknowledged the frame.
    Acknowledge,
    /// Sent recessive, saw dominant.
    Bit1,
    /// Sent dominant, saw recessive.
    Bit0,
    /// The checksum of a received frame is wrong.
    Crc,
}

impl BusError {
    /// The code in PSR.LEC.
    pub(crate) fn code(self) -> u32 {
        match self {
            Self::Stuff => 1,
            Self::Form => 2,
            Self::Acknowledge => 3,
            Self::Bit1 => 4,
            Self::Bit0 => 5,
            Self::Crc => 6,
        }
    }
}

/// PSR.LEC: the last frame went well.
const NO_ERROR: u32 = 0;
/// PSR.LEC: nothing has happened since the last read.
const NO_CHANGE: u32 = 7;
/// A counter at or above this sets the warning status.
const WARNING: u16 = 96;
/// A counter at or above this makes the controller error passive.
const PASSIVE: u16 = 128;
/// A transmit counter at or above this takes the controller off the bus.
const BUS_OFF: u16 = 256;
/// An error of the transmitter, and a dominant bit where none should be, count this much.
const TRANSMIT_STEP: u16 = 8;
/// An error-passive receiver that receives a frame goes back to this. [M: the standard allows 119 to 127]
const AFTER_PASSIVE: u16 = 127;

/// The counters and what follows from them.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Errors {
    transmit: u16,
    receive: u16,
    logged: u8,
    last: u32,
    bus_off: bool,
}

impl Default for Errors {
    fn default() -> Self {
        Self { transmit: 0, receive: 0, logged: 0, last: NO_CHANGE, bus_off: false }
    }
}

impl Errors {
    /// The transmit error counter.
    pub(crate) fn transmit(&self) -> u16 {
        self.transmit
    }

    /// The receive error counter, at most 128; the number of recessive sequences while the controller recovers.
    pub(crate) fn receive(&self) -> u16 {
        self.receive
    }

    /// At least one counter has reached 128.
    pub(crate) fn is_passive(&self) -> bool {
        self.transmit >= PASSIVE || self.receive >= PASSIVE
    }

    /// The controller is off the bus.
    pub(crate) fn is_bus_off(&self) -> bool {
        self.bus_off
    }

    /// PSR without the field ACT.
    pub(crate) fn psr(&self) -> u32 {
        let warning = self.transmit >= WARNING || self.receive >= WARNING;
        let status = u32::from(self.is_passive()) << 5 | u32::from(warning) << 6 | u32::from(self.bus_off) << 7;
        // DLEC never changes without flexible data rate.
        self.last | NO_CHANGE << 8 | status
    }

    /// A read of PSR: the last error is taken.
    pub(crate) fn psr_read(&mut self) {
        self.last = NO_CHANGE;
    }

    /// ECR.
    pub(crate) fn ecr(&self) -> u32 {
        let passive = u32::from(self.receive >= PASSIVE);
        let receive = u32::from(self.receive.min(PASSIVE - 1));
        u32::from(self.transmit.min(u16::from(u8::MAX))) | receive << 8 | passive << 15 | u32::from(self.logged) << 16
    }

    /// A read of ECR: the logging counter starts again.
    pub(crate) fn ecr_read(&mut self) {
        self.logged = 0;
    }

    /// A frame was sent and acknowledged. Returns the flags this sets in IR, as the following do.
    pub(crate) fn sent(&mut self) -> u32 {
        self.change(|errors| {
            errors.transmit = errors.transmit.saturating_sub(1);
            errors.last = NO_ERROR;
            0
        })
    }

    /// A frame was received.
    pub(crate) fn received(&mut self) -> u32 {
        self.change(|errors| {
            errors.receive = if errors.receive >= PASSIVE { AFTER_PASSIVE } else { errors.receive.saturating_sub(1) };
            errors.last = NO_ERROR;
            0
        })
    }

    /// An attempt to send failed. An error-passive transmitter that nobody answers does not count further.
    pub(crate) fn send_failed(&mut self, error: BusError) -> u32 {
        self.change(|errors| {
            let mut flags = errors.note(error);
            if error != BusError::Acknowledge || !errors.is_passive() {
                flags |= errors.log();
                errors.count_transmit();
            }
            flags
        })
    }

    /// A frame could not be received; `step` is 1, or 8 for a dominant bit after the error flag.
    pub(crate) fn receive_failed(&mut self, error: BusError, step: u16) -> u32 {
        self.change(|errors| {
            let flags = errors.note(error) | errors.log();
            errors.receive = (errors.receive + step).min(PASSIVE);
            flags
        })
    }

    /// Software lets the controller come back: REC counts the recessive sequences from here.
    pub(crate) fn recovery_begins(&mut self) {
        self.receive = 0;
    }

    /// Eleven recessive bits in bus-off recovery.
    pub(crate) fn recovery_step(&mut self) {
        self.receive = (self.receive + 1).min(PASSIVE);
        self.last = BusError::Bit0.code();
    }

    /// A frame of others ended within recovery: `sequences` of those counted were not silence.
    pub(crate) fn recovery_back(&mut self, sequences: u32) {
        self.receive = self.receive.saturating_sub(sequences as u16);
    }

    /// Bus-off recovery is over.
    pub(crate) fn recovered(&mut self) -> u32 {
        self.change(|errors| {
            (errors.transmit, errors.receive, errors.bus_off) = (0, 0, false);
            0
        })
    }

    /// Sets the last error code.
    fn note(&mut self, error: BusError) -> u32 {
        self.last = error.code();
        ir::PEA
    }

    /// Counts in the log that is read with ECR.
    fn log(&mut self) -> u32 {
        if self.logged == u8::MAX {
            return ir::ELO;
        }
        self.logged += 1;
        0
    }

    /// The transmitter's rule. A counter that leaves the register's eight bits is bus-off; it keeps what it had. [M]
    fn count_transmit(&mut self) {
        if self.transmit + TRANSMIT_STEP >= BUS_OFF {
            self.bus_off = true;
        } else {
            self.transmit += TRANSMIT_STEP;
        }
    }

    /// Does `work` and adds the flags of every status that it changed, in either direction.
    fn change(&mut self, work: impl FnOnce(&mut Self) -> u32) -> u32 {
        let before = self.psr();
        let flags = work(self);
        let changed = before ^ self.psr();
        let status = |bit: u32, flag: u32| if changed >> bit & 1 == 1 { flag } else { 0 };
        flags | status(5, ir::EP) | status(6, ir::EW) | status(7, ir::BO)
    }
}
