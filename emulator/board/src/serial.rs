//! The serial controller of the host line: the chip's model and the receiver time-out that it lacks.
//!
//! RM0433 48.5.14 and 48.8.7: the time-out counts bit times from the last stop bit received, and sets RTOF when nothing
//! has begun meanwhile.

use std::collections::VecDeque;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use rigless::chip::Timeline;
use rigless::chip::uart::Peer;
use rigless::device::{Device, DeviceContext, Level, RegisterFile, RequestChange};
use rigless::snapshot::Store;
use rigless::soc::stm32h743::generated::usart1::Register;
use rigless::soc::stm32h743::peripherals::usart::Usart;
use rigless::time::{EventId, VirtualNanos};

/// Bits of a byte on the line: start, eight, stop.
const BITS_PER_BYTE: u64 = 10;

/// Register bits of the time-out: CR1.RTOIE, CR2.RTOEN, ISR and ICR RTOF.
const RTOIE: u64 = 1 << 26;
const RTOEN: u64 = 1 << 23;
const RTOF: u64 = 1 << 11;
/// ISR RXNE: a byte has come.
const RXNE: u64 = 1 << 5;
/// CR1.UE and CR1.RE.
const RECEIVING: u64 = 1 | 1 << 2;
/// CR1.OVER8.
const OVER8: u64 = 1 << 15;
/// Bits of RTOR that are the time.
const RTO: u64 = 0xFF_FFFF;

/// Each flag of ISR that interrupts with the enable bit it wants, in CR1 (`false`) or CR3 (`true`) (RM0433 table 410).
const CAUSES: [(u64, bool, u64); 15] = [
    (1 << 7, false, 1 << 7),
    (1 << 6, false, 1 << 6),
    (1 << 5, false, 1 << 5),
    (1 << 3, false, 1 << 5),
    (1 << 4, false, 1 << 4),
    (1, false, 1 << 8),
    (1 << 23, false, 1 << 30),
    (1 << 24, false, 1 << 31),
    (1 << 9, true, 1 << 10),
    (1 << 1, true, 1),
    (1 << 2, true, 1),
    (1 << 3, true, 1),
    (1 << 26, true, 1 << 28),
    (1 << 27, true, 1 << 23),
    (RTOF, false, RTOIE),
];

/// Bytes on their way between the controller and the far end.
#[derive(Debug, Default)]
pub struct Line {
    to_chip: VecDeque<u8>,
    from_chip: Vec<u8>,
    /// When the last byte towards the chip began.
    begun: Option<u64>,
}

/// The line, as the controller's far end and the rest of the board hold it.
#[derive(Clone, Debug, Default)]
pub struct SharedLine(Arc<Mutex<Line>>);

impl SharedLine {
    fn lock(&self) -> MutexGuard<'_, Line> {
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Bytes for the chip, behind those that wait.
    pub fn offer(&self, bytes: &[u8]) {
        self.lock().to_chip.extend(bytes);
    }

    /// Bytes that the chip has sent since the last call.
    #[must_use]
    pub fn take(&self) -> Vec<u8> {
        std::mem::take(&mut self.lock().from_chip)
    }

    fn begun(&self) -> Option<u64> {
        self.lock().begun
    }
}

impl Store for SharedLine {}

impl Peer for SharedLine {
    fn receive(&mut self, word: u16, _context: &mut Timeline<'_, '_>) {
        self.lock().from_chip.push(word as u8);
    }

    fn transmit(&mut self, now: VirtualNanos) -> Option<u16> {
        let mut line = self.lock();
        let byte = line.to_chip.pop_front()?;
        line.begun = Some(now.0);
        Some(byte.into())
    }
}

/// The controller: the chip's model of it, and the time-out.
#[derive(Debug)]
pub struct Serial {
    usart: Usart,
    line: SharedLine,
    kernel_hz: u64,
    /// Start of the last byte whose silence is timed.
    seen: Option<u64>,
    /// When the silence will have lasted.
    due: Option<u64>,
    flag: bool,
    /// A byte seems to have come, for good.
    stuck: bool,
    /// We hold the interrupt line up, whatever the model thinks.
    holding: bool,
}

impl Serial {
    /// A controller as after a reset, on this line.
    #[must_use]
    pub fn new(line: SharedLine) -> Self {
        let mut usart = Usart::new();
        usart.attach(line.clone());
        Self { usart, line, kernel_hz: 0, seen: None, due: None, flag: false, stuck: false, holding: false }
    }

    /// A byte seems to have come from now on, until a reset.
    pub fn hold(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.stuck = true;
        self.settle(registers, context);
    }

    /// Nanoseconds of `bits` bits.
    fn span(&self, bits: u64, registers: &RegisterFile) -> Option<u64> {
        let divider = registers.get(Register::Brr);
        let oversampling8 = registers.get(Register::Cr1) & OVER8 != 0;
        // With eight samples a bit the lowest four bits of the divider stand one place lower (RM0433 48.5.7).
        let half_cycles = if oversampling8 { (divider & !0xF) | (divider & 7) << 1 } else { divider * 2 };
        (self.kernel_hz > 0 && half_cycles > 0).then(|| bits * half_cycles * 1_000_000_000 / (2 * self.kernel_hz))
    }

    /// After anything that may have changed something: the silence, its flag, the interrupt.
    fn settle(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        let now = context.now().0;
        let begun = self.line.begun();
        let receiving = registers.get(Register::Cr1) & RECEIVING == RECEIVING;
        if begun != self.seen {
            self.seen = begun;
            self.due = None;
            let bits = BITS_PER_BYTE + (registers.get(Register::Rtor) & RTO);
            if let (Some(begun), Some(span), true) = (begun, self.span(bits, registers), receiving) {
                let due = begun + span;
                self.due = Some(due);
                context.schedule(VirtualNanos(due));
            }
        }
        if self.due.is_some_and(|due| due <= now) {
            self.due = None;
            self.flag = registers.get(Register::Cr2) & RTOEN != 0;
        }
        let wanted = self.stuck || self.flag && registers.get(Register::Cr1) & RTOIE != 0;
        if wanted {
            context.interrupt(0, Level::High);
            self.holding = true;
        } else if self.holding {
            self.holding = false;
            context.interrupt(0, Level::from(interrupts(self.status(registers), registers)));
        }
    }

    /// ISR with the time-out's flag.
    fn status(&self, registers: &RegisterFile) -> u64 {
        let timed_out = if self.flag { RTOF } else { 0 };
        let come = if self.stuck { RXNE } else { 0 };
        registers.get(Register::Isr) & !RTOF | timed_out | come
    }
}

/// True if the flags of `status` interrupt with the enables as they are.
fn interrupts(status: u64, registers: &RegisterFile) -> bool {
    let (first, third) = (registers.get(Register::Cr1), registers.get(Register::Cr3));
    CAUSES
        .iter()
        .any(|(flag, in_third, enable)| status & flag != 0 && if *in_third { third } else { first } & enable != 0)
}

impl Device for Serial {
    type Register = Register;

    fn read(
        &mut self,
        register: Register,
        registers: &mut RegisterFile,
        context: &mut DeviceContext<'_>,
    ) -> Option<u64> {
        let answer = self.usart.read(register, registers, context);
        self.settle(registers, context);
        if register == Register::Isr { Some(self.status(registers)) } else { answer }
    }

    fn peek(&self, register: Register, registers: &RegisterFile, now: VirtualNanos) -> Option<u64> {
        if register == Register::Isr { Some(self.status(registers)) } else { self.usart.peek(register, registers, now) }
    }

    fn write(&mut self, register: Register, value: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        if register == Register::Icr && value & RTOF != 0 {
            self.flag = false;
        }
        self.usart.write(register, value, registers, context);
        self.settle(registers, context);
    }

    fn on_event(&mut self, event: EventId, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.usart.on_event(event, registers, context);
        self.settle(registers, context);
    }

    fn on_request(&mut self, request: RequestChange, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.usart.on_request(request, registers, context);
    }

    fn on_clock(&mut self, hz: u64, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.kernel_hz = hz;
        self.usart.on_clock(hz, registers, context);
    }

    fn poll(&mut self, registers: &mut RegisterFile, context: &mut DeviceContext<'_>) {
        self.usart.poll(registers, context);
        self.settle(registers, context);
    }

    fn reset(&mut self) {
        Device::reset(&mut self.usart);
        self.seen = self.line.begun();
        (self.due, self.flag, self.stuck, self.holding) = (None, false, false, false);
    }
}
