//! The registers as a program meets them: reads with their effects, writes and who ignores them.

use crate::controller::{Bus, Controller};
use crate::memory::Memory;
use crate::registers::{
    self, Access, CCCR, ECR, HPMS, ILE, ILS, IR, PSR, RXF0A, RXF0S, RXF1A, RXF1S, Register, TXBAR, TXBC, TXBCF, TXBCR,
    TXBRP, TXBTO, TXFQS, cccr, ir,
};
use crate::remark::RemarkKind::{Ignored, Suspicious, Unmodelled, Unwritten};

/// TXBC: the buffers behind the dedicated ones are a queue, not a FIFO.
const QUEUE_MODE: u32 = 1 << 30;

impl Controller {
    /// A read without effects.
    pub(crate) fn peek(&self, offset: u32) -> u32 {
        let lost = |fifo: u32| u32::from(self.flags & ir::LOST << (4 * fifo) != 0) << 25;
        match offset {
            CCCR => self.value(CCCR) & !(cccr::INIT | cccr::CCE) | self.mode(),
            ECR => self.errors.ecr(),
            PSR => self.errors.psr() | self.activity() << 3,
            IR => self.flags,
            RXF0S => self.fifos[0].status(&self.receive_layout(0)) | lost(0),
            RXF1S => self.fifos[1].status(&self.receive_layout(1)) | lost(1),
            TXFQS => self.transmit.status(&self.transmit_layout()),
            TXBRP => self.transmit.pending,
            TXBCR => self.transmit.cancelling,
            TXBTO => self.transmit.occurred,
            TXBCF => self.transmit.cancelled,
            _ => self.value(offset),
        }
    }

    /// A program reads a register.
    pub(crate) fn read(&mut self, offset: u32) -> u32 {
        if registers::find(offset).is_none() {
            self.reserved(offset, 0);
        }
        let value = self.peek(offset);
        match offset {
            PSR => self.errors.psr_read(),
            ECR => self.errors.ecr_read(),
            _ => {}
        }
        value
    }

    /// A program writes a register.
    pub(crate) fn write(&mut self, offset: u32, value: u32, memory: &Memory) {
        let Some(register) = registers::find(offset) else {
            self.reserved(offset, value);
            return;
        };
        match register.access {
            Access::ReadOnly => self.remark(Ignored, offset, value, "the register is read-only"),
            Access::Protected if !(self.init.seen && self.cce) => {
                self.remark(
                    Ignored,
                    offset,
                    value,
                    "the register is protected: CCCR.INIT and CCCR.CCE are not both set",
                );
            }
            Access::Protected | Access::Free => self.store_register(register, value),
            Access::Command => self.command(register, value, memory),
        }
    }

    /// The level of an interrupt line.
    pub(crate) fn line(&self, line: u32) -> bool {
        let select = self.value(ILS);
        let routed = if line == 0 { !select } else { select };
        self.value(ILE) >> line & 1 == 1 && self.flags & self.value(registers::IE) & routed != 0
    }

    /// CCCR.INIT and CCCR.CCE as they are read.
    fn mode(&self) -> u32 {
        (u32::from(self.init.seen) * cccr::INIT) | (u32::from(self.cce) * cccr::CCE)
    }

    /// PSR.ACT; a frame is known here only when it is over, so the controller is idle or synchronising.
    fn activity(&self) -> u32 {
        u32::from(matches!(self.bus, Bus::Active { .. }))
    }

    fn reserved(&mut self, offset: u32, value: u32) {
        if offset < 0x100 {
            self.raise(ir::ARA);
        }
        self.remark(Unmodelled, offset, value, "no register here, or one of time-triggered operation");
    }

    /// A register that only keeps its value.
    fn store_register(&mut self, register: &Register, value: u32) {
        if value & register.unmodelled != 0 {
            self.remark(
                Unmodelled,
                register.offset,
                value,
                "the value asks for a function that the model does not have",
            );
        }
        let kept = register.reset & !register.mask;
        self.set_value(register.offset, value & register.mask | kept);
    }

    /// A register whose write does something of its own.
    fn command(&mut self, register: &Register, value: u32, memory: &Memory) {
        match register.offset {
            CCCR => self.write_cccr(value),
            IR => self.flags &= !value,
            RXF0A => self.acknowledge(0, value),
            RXF1A => self.acknowledge(1, value),
            TXBAR | TXBCR if self.cce => {
                self.remark(Ignored, register.offset, value, "the register can be written only while CCCR.CCE is 0");
            }
            TXBAR => self.request(value, memory),
            TXBCR => {
                if self.value(TXBC) & QUEUE_MODE == 0 && value & self.transmit.pending != 0 {
                    self.remark_on_cancellation(value);
                }
                self.cancel(value);
            }
            // Time stamp, time-out, dedicated receive buffers, transmit events: never anything to clear.
            _ => {}
        }
    }

    /// CCCR: what may be changed depends on INIT and CCE as they were before this write.
    fn write_cccr(&mut self, value: u32) {
        let old = self.value(CCCR);
        let is_open = self.init.seen && self.cce;
        let closed = if is_open { 0 } else { (old ^ value) & cccr::PROTECTED | value & !old & cccr::SET_PROTECTED };
        if closed != 0 {
            self.remark(Ignored, CCCR, value, "mode bits can be changed only while CCCR.INIT and CCCR.CCE are set");
        }
        let new = value & !closed | old & closed;
        if new & !old & cccr::UNMODELLED != 0 {
            self.remark(Unmodelled, CCCR, value, "the value asks for a mode that the model does not have");
        }
        let mask = cccr::PROTECTED | cccr::SET_PROTECTED | cccr::CSR;
        self.set_value(CCCR, new & mask);
        if (old ^ new) & cccr::ASM != 0 {
            self.refresh_wire();
        }
        let wants_init = value & cccr::INIT != 0;
        let wants_cce = value & cccr::CCE != 0;
        if wants_cce && !self.cce {
            if self.init.seen && wants_init {
                self.cce = true;
                self.reset_handlers();
            } else {
                self.remark(Ignored, CCCR, value, "CCCR.CCE can be set only while CCCR.INIT is read as 1");
            }
        } else if !wants_cce {
            self.cce = false;
        }
        self.write_init(wants_init);
    }

    /// Setting CCE resets HPMS, RXF0S, RXF1S, TXFQS, TXBRP, TXBTO, TXBCF and TXEFS.
    fn reset_handlers(&mut self) {
        self.set_value(HPMS, 0);
        self.fifos = Default::default();
        self.transmit.reset();
        self.link.forget();
        self.refresh_wire();
    }

    /// RXFnA.
    fn acknowledge(&mut self, fifo: usize, value: u32) {
        let layout = self.receive_layout(fifo);
        if !self.fifos[fifo].acknowledge(&layout, value & 0x3F) {
            let offset = if fifo == 0 { RXF0A } else { RXF1A };
            self.remark(Suspicious, offset, value, "acknowledges an element that the FIFO does not hold");
        }
    }

    /// TXBAR.
    fn request(&mut self, value: u32, memory: &Memory) {
        let outcome = self.change_transmit(|transmit, layout| transmit.request(layout, memory, value));
        if outcome.ignored != 0 {
            self.remark(Ignored, TXBAR, outcome.ignored, "buffers that are not configured or wait already");
        }
        if outcome.out_of_order != 0 {
            self.remark(Suspicious, TXBAR, outcome.out_of_order, "FIFO places other than those from the put index on");
        }
        if let Some(offset) = outcome.unwritten {
            self.memory_remark(Unwritten, offset, memory.get(offset / 4), "transmit element never written");
        }
        self.requested();
    }
}
