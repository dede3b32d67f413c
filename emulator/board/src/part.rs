//! The microcontroller: the crate's STM32H743 with our models in the places it leaves empty or half done.

use fdcan_model::Unit;
use rigless::device::{ErasedDevice, ResetCause};
use rigless::mcu::{Mcu, Operate};
use rigless::soc::stm32h743::Stm32h743;
use rigless::soc::stm32h743::generated::{dbgmcu, flash, rcc};
use rigless::soc::{Bus, Error};
use rigless::time::VirtualNanos;

use crate::can::{Controller, SharedCan};
use crate::core::{Flush, SharedCore};
use crate::serial::{Serial, SharedLine};
use crate::usb::{DeviceRole, PowerGate};
use crate::watchdog::{SharedWatch, Watchdog};

/// Frequency of the crystal oscillator's input: the debug probe's clock output on the board.
pub const HSE_HZ: u64 = 8_000_000;

/// The board's supply, millivolts.
const SUPPLY: u32 = 3300;

/// Device identifier in the low half of DBGMCU.IDC.
const DEVICE: u64 = 0x6450;

/// RCC.CR HSECSSON.
const SECURITY: u64 = 1 << 19;

/// Place of the line OTG_FS among those of the controller's global block.
const USB_GLOBAL: usize = 3;

/// FLASH.SR2 DBECCERR: a word with two errors was read.
const DOUBLE_ERROR: u64 = 1 << 26;

/// Where our models answer.
#[derive(Debug, Clone, Copy)]
struct Slots {
    can: [usize; 2],
    watchdog: usize,
    serial: usize,
    debug: usize,
    flash: usize,
    clock: usize,
    usb: [usize; 2],
    usb_line: usize,
}

/// Inputs of the part from the board.
#[derive(Debug, Clone)]
pub struct Fitting {
    /// CAN.
    pub can: SharedCan,
    /// The serial line.
    pub serial: SharedLine,
    /// Where the watchdog tells what it sees.
    pub watch: SharedWatch,
    /// State that the core shares with the board.
    pub core: SharedCore,
    /// Million instructions a second.
    pub mips: u32,
    /// Revision of the silicon, REV_ID of DBGMCU.IDC: 0x2003 is V, 0x1003 is Y.
    pub revision: u16,
}

/// The part.
#[derive(Debug)]
pub struct Part {
    /// The crate's chip.
    pub chip: Stm32h743,
    can: SharedCan,
    controllers: [Controller; 2],
    watchdog: Watchdog,
    serial: Serial,
    usb: (DeviceRole, PowerGate),
    core: SharedCore,
    slots: Slots,
}

impl Part {
    /// The part after power-up.
    ///
    /// # Errors
    /// A description of the chip that names what it has not: a flaw of this crate or of a new version of the chip's.
    pub fn new(fitting: &Fitting) -> Result<Self, Error> {
        let mut chip = Stm32h743::new()?;
        chip.rcc.attach_crystals(HSE_HZ, 0);
        chip.set_supply(SUPPLY);
        chip.set_analog_supply(SUPPLY);
        let bus = chip.bus();
        let slots = Slots {
            can: [bus.slot("FDCAN1")?, bus.slot("FDCAN2")?],
            watchdog: bus.slot("IWDG")?,
            serial: bus.slot("USART3")?,
            debug: bus.slot("DBGMCU")?,
            flash: bus.slot("Flash")?,
            clock: bus.slot("RCC")?,
            usb: [bus.slot("OTG2_HS_DEVICE")?, bus.slot("OTG2_HS_PWRCLK")?],
            usb_line: bus.slot("OTG2_HS_GLOBAL")?,
        };
        let identity = DEVICE | u64::from(fitting.revision) << 16;
        chip.bus_mut().slot_mut(slots.debug).registers_mut().set(dbgmcu::Register::Idc, identity);
        let mut part = Self {
            chip,
            can: fitting.can.clone(),
            controllers: Unit::BOTH.map(|unit| Controller::new(fitting.can.clone(), unit)),
            watchdog: Watchdog::new(fitting.watch.clone()),
            serial: Serial::new(fitting.serial.clone()),
            usb: (DeviceRole, PowerGate),
            core: fitting.core.clone(),
            slots,
        };
        part.check()?;
        part.begin(VirtualNanos(0));
        Ok(part)
    }

    /// The controllers begin to look at the time.
    fn begin(&mut self, at: VirtualNanos) {
        for (controller, slot) in self.controllers.iter_mut().zip(self.slots.can) {
            let (_, mut context) = self.chip.bus_mut().drive(at, slot);
            controller.begin(&mut context);
        }
    }

    /// The oscillator's input has lost its clock. Whether the clock security system has noticed.
    pub fn fail_crystal(&mut self, at: VirtualNanos) -> bool {
        let control = |part: &mut Self| part.chip.clocks().1.get(rcc::Register::Cr);
        if control(self) & SECURITY == 0 {
            return false;
        }
        let mut tree = std::mem::take(&mut self.chip.rcc);
        let (registers, mut context) = self.chip.bus_mut().drive(at, self.slots.clock);
        tree.fail_hse(registers, &mut context);
        self.chip.rcc = tree;
        true
    }

    /// The USB controller interrupts from now on, whatever the image does.
    pub fn hold_usb(&mut self, at: VirtualNanos) {
        let (_, mut context) = self.chip.bus_mut().drive(at, self.slots.usb_line);
        context.raise(USB_GLOBAL);
    }

    /// The serial controller says for good that a byte has come.
    pub fn hold_serial(&mut self, at: VirtualNanos) {
        let mut serial = std::mem::replace(&mut self.serial, Serial::new(SharedLine::default()));
        let (registers, mut context) = self.chip.bus_mut().drive(at, self.slots.serial);
        serial.hold(registers, &mut context);
        self.serial = serial;
    }

    /// Says that the last reset had these causes, flags of RCC.RSR.
    pub fn set_reset_flags(&mut self, flags: u64) {
        let (_, registers) = self.chip.clocks();
        registers.set(rcc::Register::Rsr, flags);
        registers.set(rcc::Register::C1Rsr, flags);
    }
}

impl Mcu for Part {
    fn bus(&self) -> &Bus {
        self.chip.bus()
    }

    fn bus_mut(&mut self) -> &mut Bus {
        self.chip.bus_mut()
    }

    fn reset(&mut self, at: VirtualNanos, cause: ResetCause) {
        self.chip.reset(at, cause);
        self.can.lock().reset(at.0);
        {
            let mut core = self.core.lock();
            (core.bank_hangs, core.bank_locked, core.bank_deaf) = (false, false, false);
            (core.loops_lost, core.usb_flush) = (0, Flush::default());
        }
        for slot in self.slots.can.into_iter().chain([self.slots.watchdog, self.slots.serial]) {
            if let (_, Some(model)) = self.split(slot) {
                model.reset();
            }
        }
        self.begin(at);
    }

    /// Only the serial line has somebody outside who does not announce himself.
    fn poll(&mut self, now: VirtualNanos) {
        let (registers, mut context) = self.chip.bus_mut().drive(now, self.slots.serial);
        rigless::device::Device::poll(&mut self.serial, registers, &mut context);
    }

    fn split(&mut self, slot: usize) -> (&mut Bus, Option<&mut dyn ErasedDevice>) {
        let [first, second] = &mut self.controllers;
        let own: &mut dyn ErasedDevice = if slot == self.slots.can[0] {
            first
        } else if slot == self.slots.can[1] {
            second
        } else if slot == self.slots.watchdog {
            &mut self.watchdog
        } else if slot == self.slots.serial {
            &mut self.serial
        } else if slot == self.slots.usb[0] {
            &mut self.usb.0
        } else if slot == self.slots.usb[1] {
            &mut self.usb.1
        } else {
            if slot == self.slots.flash && std::mem::take(&mut self.core.lock().double_error) {
                let registers = self.chip.bus_mut().slot_mut(slot).registers_mut();
                let status = registers.get(flash::Register::Sr2);
                registers.set(flash::Register::Sr2, status | DOUBLE_ERROR);
            }
            return self.chip.split(slot);
        };
        (self.chip.bus_mut(), Some(own))
    }
}
