//! The registers: offset, name, value after reset, bits that can be written, and who may write them when.
//!
//! Source: RM0433 (checked against the text of RM0399, the same block); Bosch M_CAN 3.2.1.

/// Who may write a register when.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Access {
    /// Never.
    ReadOnly,
    /// Always.
    Free,
    /// While CCCR.INIT and CCCR.CCE are set.
    Protected,
    /// A write does something of its own.
    Command,
}

/// One register.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Register {
    /// Byte offset in the controller.
    pub(crate) offset: u32,
    /// Name in the manual, without the prefix `FDCAN_`.
    pub(crate) name: &'static str,
    /// Value after reset.
    pub(crate) reset: u32,
    /// Bits that can be written.
    pub(crate) mask: u32,
    /// Who may write it when.
    pub(crate) access: Access,
    /// Bits whose effect the model does not have.
    pub(crate) unmodelled: u32,
}

/// A line of the table.
const fn r(offset: u32, name: &'static str, reset: u32, mask: u32, access: Access, unmodelled: u32) -> Register {
    Register { offset, name, reset, mask, access, unmodelled }
}

use Access::{Command, Free, Protected, ReadOnly};

pub(crate) const TEST: u32 = 0x010;
pub(crate) const CCCR: u32 = 0x018;
pub(crate) const NBTP: u32 = 0x01C;
pub(crate) const ECR: u32 = 0x040;
pub(crate) const PSR: u32 = 0x044;
pub(crate) const IR: u32 = 0x050;
pub(crate) const IE: u32 = 0x054;
pub(crate) const ILS: u32 = 0x058;
pub(crate) const ILE: u32 = 0x05C;
pub(crate) const GFC: u32 = 0x080;
pub(crate) const SIDFC: u32 = 0x084;
pub(crate) const XIDFC: u32 = 0x088;
pub(crate) const XIDAM: u32 = 0x090;
pub(crate) const HPMS: u32 = 0x094;
pub(crate) const RXF0C: u32 = 0x0A0;
pub(crate) const RXF0S: u32 = 0x0A4;
pub(crate) const RXF0A: u32 = 0x0A8;
pub(crate) const RXF1C: u32 = 0x0B0;
pub(crate) const RXF1S: u32 = 0x0B4;
pub(crate) const RXF1A: u32 = 0x0B8;
pub(crate) const RXESC: u32 = 0x0BC;
pub(crate) const TXBC: u32 = 0x0C0;
pub(crate) const TXFQS: u32 = 0x0C4;
pub(crate) const TXESC: u32 = 0x0C8;
pub(crate) const TXBRP: u32 = 0x0CC;
pub(crate) const TXBAR: u32 = 0x0D0;
pub(crate) const TXBCR: u32 = 0x0D4;
pub(crate) const TXBTO: u32 = 0x0D8;
pub(crate) const TXBCF: u32 = 0x0DC;
pub(crate) const TXBTIE: u32 = 0x0E0;
pub(crate) const TXBCIE: u32 = 0x0E4;

/// Bits of IR, IE and ILS that exist.
const FLAGS: u32 = 0x3FCF_FFFF;
const ALL: u32 = u32::MAX;

/// Every register but those of time-triggered operation (0x100 and up).
const REGISTERS: [Register; 46] = [
    r(0x000, "CREL", 0x3214_1218, 0, ReadOnly, 0),
    r(0x004, "ENDN", 0x8765_4321, 0, ReadOnly, 0),
    r(0x00C, "DBTP", 0x0000_0A33, 0x009F_1FFF, Protected, 0),
    r(TEST, "TEST", 0, 0x70, Protected, 0x70),
    r(0x014, "RWD", 0, 0xFF, Protected, 0),
    r(CCCR, "CCCR", 0x0000_0001, 0xF3FF, Command, 0),
    r(NBTP, "NBTP", 0x0600_0A03, 0xFFFF_FF7F, Protected, 0),
    r(0x020, "TSCC", 0, 0x000F_0003, Protected, 0b11),
    r(0x024, "TSCV", 0, 0, Command, 0),
    r(0x028, "TOCC", 0xFFFF_0000, 0xFFFF_0007, Protected, 0b1),
    r(0x02C, "TOCV", 0x0000_FFFF, 0, Command, 0),
    r(ECR, "ECR", 0, 0, ReadOnly, 0),
    r(PSR, "PSR", 0x0000_0707, 0, ReadOnly, 0),
    r(0x048, "TDCR", 0, 0x7F7F, Protected, 0),
    r(IR, "IR", 0, FLAGS, Command, 0),
    r(IE, "IE", 0, FLAGS, Free, 0),
    r(ILS, "ILS", 0, FLAGS, Free, 0),
    r(ILE, "ILE", 0, 0b11, Free, 0),
    r(GFC, "GFC", 0, 0x3F, Protected, 0),
    r(SIDFC, "SIDFC", 0, 0x00FF_FFFC, Protected, 0),
    r(XIDFC, "XIDFC", 0, 0x007F_FFFC, Protected, 0),
    r(XIDAM, "XIDAM", 0x1FFF_FFFF, 0x1FFF_FFFF, Protected, 0),
    r(HPMS, "HPMS", 0, 0, ReadOnly, 0),
    r(0x098, "NDAT1", 0, 0, Command, 0),
    r(0x09C, "NDAT2", 0, 0, Command, 0),
    r(RXF0C, "RXF0C", 0, 0xFF7F_FFFC, Protected, 0),
    r(RXF0S, "RXF0S", 0, 0, ReadOnly, 0),
    r(RXF0A, "RXF0A", 0, 0x3F, Command, 0),
    r(0x0AC, "RXBC", 0, 0xFFFC, Protected, 0),
    r(RXF1C, "RXF1C", 0, 0xFF7F_FFFC, Protected, 0),
    r(RXF1S, "RXF1S", 0, 0, ReadOnly, 0),
    r(RXF1A, "RXF1A", 0, 0x3F, Command, 0),
    r(RXESC, "RXESC", 0, 0x777, Protected, 0),
    r(TXBC, "TXBC", 0, 0x7F3F_FFFC, Protected, 0),
    r(TXFQS, "TXFQS", 0, 0, ReadOnly, 0),
    r(TXESC, "TXESC", 0, 0b111, Protected, 0),
    r(TXBRP, "TXBRP", 0, 0, ReadOnly, 0),
    r(TXBAR, "TXBAR", 0, ALL, Command, 0),
    r(TXBCR, "TXBCR", 0, ALL, Command, 0),
    r(TXBTO, "TXBTO", 0, 0, ReadOnly, 0),
    r(TXBCF, "TXBCF", 0, 0, ReadOnly, 0),
    r(TXBTIE, "TXBTIE", 0, ALL, Free, 0),
    r(TXBCIE, "TXBCIE", 0, ALL, Free, 0),
    r(0x0F0, "TXEFC", 0, 0x3F3F_FFFC, Protected, 0x003F_0000),
    r(0x0F4, "TXEFS", 0, 0, ReadOnly, 0),
    r(0x0F8, "TXEFA", 0, 0x1F, Command, 0),
];

/// Words up to the registers of time-triggered operation.
pub(crate) const WORDS: usize = 0x100 / 4;

/// The value of every word after reset.
pub(crate) fn after_reset() -> [u32; WORDS] {
    let mut values = [0; WORDS];
    for register in &REGISTERS {
        values[register.offset as usize / 4] = register.reset;
    }
    values
}

/// The register at an offset.
pub(crate) fn find(offset: u32) -> Option<&'static Register> {
    REGISTERS.iter().find(|register| register.offset == offset)
}

/// Bits of CCCR.
pub(crate) mod cccr {
    pub(crate) const INIT: u32 = 1 << 0;
    pub(crate) const CCE: u32 = 1 << 1;
    pub(crate) const ASM: u32 = 1 << 2;
    pub(crate) const CSR: u32 = 1 << 4;
    pub(crate) const MON: u32 = 1 << 5;
    pub(crate) const DAR: u32 = 1 << 6;
    pub(crate) const TEST: u32 = 1 << 7;
    /// FDOE, BRSE, PXHD, EFBI, TXP, NISO.
    pub(crate) const FLEXIBLE: u32 = 0xF300;
    /// Can be set and cleared only while INIT and CCE are set.
    pub(crate) const PROTECTED: u32 = DAR | FLEXIBLE;
    /// Can be set only while INIT and CCE are set, and cleared at any time.
    pub(crate) const SET_PROTECTED: u32 = ASM | MON | TEST;
    /// The model stores these bits and does nothing more.
    pub(crate) const UNMODELLED: u32 = CSR | MON | TEST | FLEXIBLE;
}

/// Bits of IR, IE and ILS.
pub(crate) mod ir {
    /// First flag of receive FIFO 0 (new, watermark, full, lost); those of FIFO 1 stand four higher.
    pub(crate) const NEW: u32 = 1 << 0;
    pub(crate) const WATERMARK: u32 = 1 << 1;
    pub(crate) const FULL: u32 = 1 << 2;
    pub(crate) const LOST: u32 = 1 << 3;
    pub(crate) const HPM: u32 = 1 << 8;
    pub(crate) const TC: u32 = 1 << 9;
    pub(crate) const TCF: u32 = 1 << 10;
    pub(crate) const TFE: u32 = 1 << 11;
    pub(crate) const MRAF: u32 = 1 << 17;
    pub(crate) const ELO: u32 = 1 << 22;
    pub(crate) const EP: u32 = 1 << 23;
    pub(crate) const EW: u32 = 1 << 24;
    pub(crate) const BO: u32 = 1 << 25;
    pub(crate) const PEA: u32 = 1 << 27;
    pub(crate) const ARA: u32 = 1 << 29;
}
