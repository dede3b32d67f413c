//! A bench for one controller: registers by name, and a driver that does what the project's image does.

use fdcan_model::{Cancellation, Controllers, Fault, Frame, Id, Line, Options, Remark, RemarkKind, Unit, WireEvent};

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
pub(crate) const TXBC: u32 = 0x0C0;
pub(crate) const TXFQS: u32 = 0x0C4;
pub(crate) const TXBRP: u32 = 0x0CC;
pub(crate) const TXBAR: u32 = 0x0D0;
pub(crate) const TXBCR: u32 = 0x0D4;
pub(crate) const TXBTO: u32 = 0x0D8;
pub(crate) const TXBCF: u32 = 0x0DC;
pub(crate) const TXBTIE: u32 = 0x0E0;
pub(crate) const TXBCIE: u32 = 0x0E4;

/// CCCR: initialisation, configuration change enable, no automatic retransmission.
pub(crate) const INIT: u32 = 1;
pub(crate) const CCE: u32 = 2;
pub(crate) const DAR: u32 = 1 << 6;

/// Flags of IR.
pub(crate) const TC: u32 = 1 << 9;
pub(crate) const TCF: u32 = 1 << 10;
pub(crate) const TFE: u32 = 1 << 11;
pub(crate) const EP: u32 = 1 << 23;
pub(crate) const EW: u32 = 1 << 24;
pub(crate) const BO: u32 = 1 << 25;

/// The kernel clock of the board, Hz.
pub(crate) const KERNEL_HZ: u32 = 80_000_000;
/// One bit at 1 Mbit/s, ns.
pub(crate) const BIT: u64 = 1000;
/// Where the image's transmit FIFO begins in the message memory, bytes.
pub(crate) const TRANSMIT_AT: u32 = 0x234;
/// Where the image's receive FIFO begins, bytes.
pub(crate) const RECEIVE_AT: u32 = 0x34;

/// The image's configuration of FDCAN1 (`docs` of the project; values seen by running the image).
pub(crate) const IMAGE: [(u32, u32); 6] =
    [(NBTP, 0x0009_0401), (GFC, 0x2B), (SIDFC, 0x000D_0000), (RXF0C, 0x0020_0034), (TXBC, 0x0800_0234), (XIDFC, 0)];

/// One line of what the wire was told: the identifiers offered, or that all are taken back.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Notice {
    Offer(u32),
    Withdraw,
}

/// FDCAN1 on a bench.
pub(crate) struct Bench {
    pub(crate) can: Controllers,
    pub(crate) now: u64,
}

impl Bench {
    /// After power-up, kernel clock running.
    pub(crate) fn new(options: Options) -> Self {
        let mut can = Controllers::new(options);
        can.set_kernel_clock(KERNEL_HZ, 0);
        Self { can, now: 0 }
    }

    /// On the bus as the image is, with other values behind the image's; the filters let everything into FIFO 0.
    pub(crate) fn with(options: Options, values: &[(u32, u32)]) -> Self {
        let mut bench = Self::new(options);
        bench.configure(Unit::One, &IMAGE);
        bench.open();
        // Range 0 to 0x7FF into FIFO 0, thirteen times.
        for filter in 0..13 {
            bench.set(4 * filter, 1 << 27 | 0x7FF);
        }
        for (offset, value) in values {
            bench.write(*offset, *value);
        }
        for (offset, value) in [(IE, 0x0200_0209), (ILS, 0x200), (TXBTIE, u32::MAX), (ILE, 0b11)] {
            bench.write(offset, value);
        }
        bench.join();
        bench
    }

    /// On the bus as the image is.
    pub(crate) fn image(cancellation: Cancellation) -> Self {
        Self::with(Options { cancellation, ..Options::default() }, &[])
    }

    /// Sets INIT, waits for it, sets CCE.
    pub(crate) fn open(&mut self) {
        self.write(CCCR, INIT);
        self.pass_ns(1000);
        self.write(CCCR, INIT | CCE);
        assert_eq!(self.read(CCCR) & 0b11, INIT | CCE);
    }

    /// Writes registers of one controller with INIT and CCE set.
    pub(crate) fn configure(&mut self, unit: Unit, values: &[(u32, u32)]) {
        self.can.write(unit, CCCR, INIT | CCE, self.now);
        for (offset, value) in values {
            self.can.write(unit, *offset, *value, self.now);
        }
    }

    /// Clears INIT and waits until the controller is on the bus.
    pub(crate) fn join(&mut self) {
        let dar = self.read(CCCR) & DAR;
        self.write(CCCR, dar);
        self.pass_ns(200 + 11 * BIT);
        assert!(self.can.status(Unit::One).on_bus);
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) {
        self.now += 10;
        self.can.write(Unit::One, offset, value, self.now);
    }

    pub(crate) fn read(&mut self, offset: u32) -> u32 {
        self.now += 10;
        self.can.read(Unit::One, offset, self.now)
    }

    /// Writes a word of the message memory.
    pub(crate) fn set(&mut self, offset: u32, value: u32) {
        self.now += 10;
        self.can.write_memory(offset, value, self.now);
    }

    /// Lets bits go by.
    pub(crate) fn pass(&mut self, bits: u64) {
        self.pass_ns(bits * BIT);
    }

    pub(crate) fn pass_ns(&mut self, time: u64) {
        self.now += time;
        self.can.advance(self.now);
    }

    /// Writes a transmit element of the image's FIFO: standard identifier, one byte of data.
    pub(crate) fn element(&mut self, buffer: u32, id: u32) {
        let at = TRANSMIT_AT + 16 * buffer;
        for (word, value) in [id << 18, 1 << 16, id & 0xFF, 0].into_iter().enumerate() {
            self.set(at + 4 * word as u32, value);
        }
    }

    /// Puts a frame into the FIFO or queue as the image does; `false` if it is full.
    pub(crate) fn put(&mut self, id: u32) -> bool {
        let status = self.read(TXFQS);
        if status >> 21 & 1 == 1 {
            return false;
        }
        let place = status >> 16 & 0x1F;
        self.element(place, id);
        self.write(TXBAR, 1 << place);
        true
    }

    /// Takes the oldest frame of receive FIFO 0 as the image does: identifier and first byte.
    pub(crate) fn take(&mut self) -> Option<(u32, u32)> {
        let status = self.read(RXF0S);
        if status & 0x7F == 0 {
            return None;
        }
        let place = status >> 8 & 0x3F;
        let at = RECEIVE_AT + 16 * place;
        let frame = (self.can.peek_memory(at) >> 18 & 0x7FF, self.can.peek_memory(at + 8) & 0xFF);
        self.write(RXF0A, place);
        Some(frame)
    }

    /// The wire has sent the oldest frame.
    pub(crate) fn sent(&mut self) {
        self.pass(60);
        self.can.transmitted(Unit::One, self.now);
    }

    /// A frame of somebody else ends on a bus that was silent before.
    pub(crate) fn receive(&mut self, id: u16) {
        self.receive_frame(&Frame::standard(id, &[id as u8]));
    }

    pub(crate) fn receive_frame(&mut self, frame: &Frame) {
        self.pass(150);
        self.can.received(Unit::One, frame, self.now);
    }

    pub(crate) fn fault(&mut self, fault: Option<Fault>) {
        self.can.set_fault(Unit::One, fault, self.now);
    }

    /// Events that the wire was told since the last call.
    pub(crate) fn told(&mut self) -> Vec<Notice> {
        let told = |event| match event {
            WireEvent::Offer { frame: Frame { id: Id::Standard(id), .. }, .. } => Notice::Offer(id.into()),
            WireEvent::Offer { frame: Frame { id: Id::Extended(id), .. }, .. } => Notice::Offer(id),
            WireEvent::Withdraw { .. } => Notice::Withdraw,
        };
        self.can.take_wire(Unit::One).into_iter().map(told).collect()
    }

    /// Free level, get index, put index, full.
    pub(crate) fn fifo(&mut self) -> [u32; 4] {
        let status = self.read(TXFQS);
        [status & 0x3F, status >> 8 & 0x1F, status >> 16 & 0x1F, status >> 21 & 1]
    }

    /// Fill level, get index, put index, full, lost of receive FIFO 0.
    pub(crate) fn held(&mut self) -> [u32; 5] {
        let status = self.read(RXF0S);
        [status & 0x7F, status >> 8 & 0x3F, status >> 16 & 0x3F, status >> 24 & 1, status >> 25 & 1]
    }

    /// Transmit error counter and receive error counter with its passive bit.
    pub(crate) fn counters(&self) -> (u32, u32) {
        let ecr = self.can.peek(Unit::One, ECR);
        (ecr & 0xFF, ecr >> 8 & 0xFF)
    }

    pub(crate) fn lines(&self) -> (bool, bool) {
        (self.can.line(Unit::One, Line::Zero), self.can.line(Unit::One, Line::One))
    }

    /// The remarks since the last call: kind and register.
    pub(crate) fn remarks(&mut self) -> Vec<(RemarkKind, &'static str)> {
        self.can.take_remarks().into_iter().map(|Remark { kind, register, .. }| (kind, register)).collect()
    }
}
