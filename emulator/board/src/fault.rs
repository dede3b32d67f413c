//! Faults that are put in from outside: on the wire, in the supply, in the core.

use std::str::FromStr;

/// Which fault.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Bit errors until the arm's controller leaves the bus; its INIT is read so many microseconds later than the flag.
    BusOff(u64),
    /// The message memory answers the arm's controller too late, as it reads the next frame to be sent: it goes over to
    /// restricted operation.
    TransmitStarved,
    /// Likewise as it stores the next received frame, which is lost.
    ReceiveStarved,
    /// Nobody acknowledges on the arm's bus, for these microseconds; 0: for ever.
    NoAcknowledge(u64),
    /// The arm's bus is held dominant, likewise.
    Dominant(u64),
    /// Power fails in the middle of this operation of bank 2, counted from the given time; 0 is the next.
    PowerCut(u64),
    /// This operation of bank 2, counted likewise, never ends; until a reset the bank answers nobody.
    FlashHangs(u64),
    /// The oscillator's input has no clock from this time on.
    HseDead,
    /// A debugger makes a non-maskable interrupt pending.
    Nmi,
    /// The image panics.
    Panic,
    /// The core meets an undefined instruction.
    HardFault,
    /// The core goes round in one instruction for ever, with interrupts masked.
    Hang,
    /// The core stands still for these microseconds.
    Stall(u64),
    /// The stack pointer is just above the guard.
    Guard,
    /// The stack pointer is below the guard: nothing a fault handler could push to.
    BelowGuard,
    /// Timer 5, the time since start-up, stands still from this time on.
    TimeStands,
    /// From this time on the watchdog loses what is written to its registers.
    WatchdogDeaf,
    /// The USB controller holds its interrupt line up for good, as for a packet that nobody takes.
    UsbHeld,
    /// The USB controller has no clock: a reset of it never ends.
    UsbDead,
    /// A bit falls over in a register or in the message memory: of the word at this address.
    Flip(u32, u8),
    /// A phase-locked loop (0 to 2) has lost its lock, until a reset; its output goes on.
    LoopLost(u64),
    /// The receive queue of the arm's controller lets nothing go any more, until its configuration is opened.
    ReceiveStuck,
    /// The first interrupt line of the arm's controller stays up.
    CanHeld,
    /// The serial controller says for good that a byte has come.
    SerialHeld,
    /// From this time on bank 2 does not take the keys of its control register.
    FlashLocked,
    /// From this time on bank 2 does nothing that it is told to, and tells nothing.
    FlashDeaf,
    /// The USB controller tells a reset of its bus, and a queue that is emptied then never says that it is empty.
    UsbFlushHeld,
    /// A reset of this kind.
    Reset(ResetKind),
}

/// Cause of the reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetKind {
    /// The reset pin.
    Pin,
    /// The supply came; memory is random.
    Power,
    /// The supply sagged; memory is random.
    BrownOut,
    /// A debugger writes SYSRESETREQ.
    Probe,
}

/// A fault and its time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The kind of the fault.
    pub kind: Kind,
    /// Time, ns since power-up.
    pub at: u64,
}

/// Forms that the command line takes.
pub const SYNTAX: &str = "KIND@MICROSECONDS[:ARGUMENT], KIND one of bus-off[:US], transmit-starved, receive-starved, no-acknowledge[:US], dominant[:US], \
power-cut:N, flash-hangs:N, hse-dead, nmi, panic, hard-fault, hang, stall:US, guard, below-guard, \
watchdog-deaf, flip:ADDRESS/BIT, loop-lost:N, time-stands, usb-held, usb-dead, \
usb-flush-held, receive-stuck, can-held, serial-held, flash-locked, flash-deaf, reset:pin|power|brown-out|probe";

/// A text that names no fault.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("no fault {0:?}; {SYNTAX}")]
pub struct NoFault(String);

impl FromStr for Fault {
    type Err = NoFault;

    fn from_str(text: &str) -> Result<Self, NoFault> {
        let wrong = || NoFault(text.to_owned());
        let (kind, rest) = text.split_once('@').ok_or_else(wrong)?;
        let (time, argument) = rest.split_once(':').map_or((rest, None), |(time, argument)| (time, Some(argument)));
        let at = time.parse::<u64>().ok().and_then(|us| us.checked_mul(1000)).ok_or_else(wrong)?;
        let number = || argument.map_or(Ok(0), |argument| argument.parse::<u64>().map_err(|_| wrong()));
        let kind = match kind {
            "bus-off" => Kind::BusOff(number()?),
            "transmit-starved" => Kind::TransmitStarved,
            "receive-starved" => Kind::ReceiveStarved,
            "no-acknowledge" => Kind::NoAcknowledge(number()?),
            "dominant" => Kind::Dominant(number()?),
            "power-cut" => Kind::PowerCut(number()?),
            "flash-hangs" => Kind::FlashHangs(number()?),
            "hse-dead" => Kind::HseDead,
            "nmi" => Kind::Nmi,
            "panic" => Kind::Panic,
            "hard-fault" => Kind::HardFault,
            "hang" => Kind::Hang,
            "stall" => Kind::Stall(number()?),
            "guard" => Kind::Guard,
            "below-guard" => Kind::BelowGuard,
            "time-stands" => Kind::TimeStands,
            "watchdog-deaf" => Kind::WatchdogDeaf,
            "flip" => argument.and_then(flipped).ok_or_else(wrong)?,
            "loop-lost" => Kind::LoopLost(number()?),
            "receive-stuck" => Kind::ReceiveStuck,
            "can-held" => Kind::CanHeld,
            "serial-held" => Kind::SerialHeld,
            "flash-locked" => Kind::FlashLocked,
            "flash-deaf" => Kind::FlashDeaf,
            "usb-flush-held" => Kind::UsbFlushHeld,
            "usb-dead" => Kind::UsbDead,
            "usb-held" => Kind::UsbHeld,
            "reset" => Kind::Reset(match argument {
                Some("pin") => ResetKind::Pin,
                Some("power") => ResetKind::Power,
                Some("brown-out") => ResetKind::BrownOut,
                Some("probe") => ResetKind::Probe,
                _ => return Err(wrong()),
            }),
            _ => return Err(wrong()),
        };
        Ok(Self { kind, at })
    }
}

/// Address, hexadecimal, and bit.
fn flipped(text: &str) -> Option<Kind> {
    let (address, bit) = text.strip_prefix("0x")?.split_once('/')?;
    let (address, bit) = (u32::from_str_radix(address, 16).ok()?, bit.parse().ok().filter(|bit| *bit < 32)?);
    Some(Kind::Flip(address, bit))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_from_text() {
        let at = 2_000_000_000;
        assert_eq!("bus-off@2000000".parse(), Ok(Fault { kind: Kind::BusOff(0), at }));
        assert_eq!("bus-off@2000000:50".parse(), Ok(Fault { kind: Kind::BusOff(50), at }));
        assert_eq!("power-cut@2000000:7".parse(), Ok(Fault { kind: Kind::PowerCut(7), at }));
        let kind = Kind::Reset(ResetKind::BrownOut);
        assert_eq!("reset@2000000:brown-out".parse(), Ok(Fault { kind, at }));
        assert_eq!("flip@2000000:0x4000a01c/16".parse(), Ok(Fault { kind: Kind::Flip(0x4000_A01C, 16), at }));
        for text in [
            "flip@1:0x0/32",
            "flip@1:7",
            "bus-off",
            "fire@1",
            "stall@x",
            "reset@1",
            "reset@1:kick",
            "panic@99999999999999999999",
        ] {
            assert!(text.parse::<Fault>().is_err(), "{text}");
        }
    }
}
