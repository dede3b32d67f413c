//! The USB line: a serial device of the communication class (CDC ACM), by interrupts.
//!
//! The device itself belongs to the interrupt; the session shares two queues with it. A host that does not read fills
//! its queue and harms nobody: the other lines go on.
//!
//! The controller holds its line up for as long as it keeps a packet that nobody takes, and this interrupt stands
//! above the session, which alone makes room. So it gives way when the queue is full, and after so many turns in any
//! case; the session lets it in again at every visit.
//!
//! The driver empties queues of the controller when the bus was reset and when a question comes before the last answer
//! has left. It waits for that with interrupts masked and without a bound, and a control slot behind it. So what it is
//! about to empty is emptied here first: a controller that does not end this is not touched any more.

use core::cell::{RefCell, UnsafeCell};
use core::sync::atomic::{AtomicU32, Ordering};

use cortex_m::peripheral::NVIC;
use cortex_m::singleton;
use critical_section::Mutex;
use embassy_stm32::pac::{PWR, RCC};
use heapless::Deque;
use synopsys_usb_otg::{UsbBus, UsbPeripheral};
use usb_device::bus::UsbBusAllocator;
use usb_device::device::{StringDescriptors, UsbDevice, UsbDeviceBuilder, UsbVidPid};
use usbd_serial::{SerialPort, USB_CLASS_CDC};

use super::super::constants::clocks::AHB_HZ;
use super::super::constants::lines::{
    RECEIVE_BYTES, TRANSMIT_BYTES, USB_ENDPOINTS, USB_FIFO_WORDS, USB_PRODUCT, USB_VENDOR,
};
use super::clock;
use super::device::{Chip, level};
use crate::board::LinkPort;

/// Logical priority: above the session, below everything that touches the arm.
const PRIORITY: u8 = 3;

/// Bytes of a full packet, and most bytes moved with interrupts masked in one go.
const PORTION: usize = 64;

/// Interrupts between two visits of the session; a full line makes about 40 of them.
const TURNS: u32 = 64;

/// Of these are left.
static TURNS_LEFT: AtomicU32 = AtomicU32::new(TURNS);

/// Longest wait for the USB supply, and for the controller to be idle and to be reset, us. Without them there is no USB
/// line, and everything else works.
const READY_US: u32 = 1_000;

/// The reset register of the controller, and its bits: reset, and idle.
const RESET: *mut u32 = 0x4008_0010 as *mut u32;
const CORE_RESET: u32 = 1;
const IDLE: u32 = 1 << 31;
/// Its bits that empty the receive queue and a transmit queue, the number of the latter, and that of all of them.
const EMPTY_RECEIVE: u32 = 1 << 4;
const EMPTY_TRANSMIT: u32 = 1 << 5;
const QUEUE_NUMBER: u32 = 0x1F << 6;
const EVERY_QUEUE: u32 = 0x10 << 6;

/// Longest wait for empty queues, us: the controller needs some ticks of its transceiver's clock.
const EMPTY_US: u32 = 50;

/// The status register (GINTSTS) and its bits: a packet was received, the bus was reset, its speed is known.
const STATUS: *const u32 = 0x4008_0014 as *const u32;
const RECEIVED: u32 = 1 << 4;
const BUS_RESET: u32 = 1 << 12;
const SPEED_KNOWN: u32 = 1 << 13;

/// The packet that was received (GRXSTSR), where its kind stands, and that of a question (SETUP).
const HEAD: *const u32 = 0x4008_001C as *const u32;
const KIND_SHIFT: u32 = 17;
const QUESTION: u32 = 0b0110;

/// The size of the control endpoint's answer (DIEPTSIZ0), and its bits that count packets not sent yet.
const ANSWER: *const u32 = 0x4008_0910 as *const u32;
const NOT_SENT: u32 = 0b11 << 19;

/// The device's status (DSTS), where its speed stands, and the one that the driver panics at: there is none.
const DEVICE_STATUS: *const u32 = 0x4008_0808 as *const u32;
const NO_SPEED: u32 = 0b10;

/// The chip's second USB controller, on PA11 and PA12.
struct Peripheral;

// SAFETY: the register block of an STM32 USB OTG controller, used by this module only.
unsafe impl UsbPeripheral for Peripheral {
    const REGISTERS: *const () = 0x4008_0000 as *const ();
    const HIGH_SPEED: bool = true;
    const FIFO_DEPTH_WORDS: usize = USB_FIFO_WORDS;
    const ENDPOINT_COUNT: usize = USB_ENDPOINTS;

    fn enable() {
        PWR.cr3().modify(|w| w.set_usb33den(true));
        clock::within(READY_US, || PWR.cr3().read().usb33rdy());
        RCC.ahb1enr().modify(|w| w.set_usb_otg_fsen(true));
        RCC.ahb1enr().read();
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_fsrst(true));
        RCC.ahb1rstr().modify(|w| w.set_usb_otg_fsrst(false));
        // While the core sleeps the controller must not wait for the clock of an outer transceiver, which it has not.
        RCC.ahb1lpenr().modify(|w| {
            w.set_usb_otg_fslpen(true);
            w.set_usb_otg_fs_ulpilpen(false);
        });
    }

    fn ahb_frequency_hz(&self) -> u32 {
        AHB_HZ
    }
}

type Bus = UsbBus<Peripheral>;

/// The part that the interrupt owns.
struct Device {
    device: UsbDevice<'static, Bus>,
    serial: SerialPort<'static, Bus>,
}

struct Place(UnsafeCell<Option<Device>>);

// SAFETY: filled by `start` before the interrupt is unmasked; used by the interrupt alone afterwards.
unsafe impl Sync for Place {}

static DEVICE: Place = Place(UnsafeCell::new(None));

/// The queues between the interrupt and the session.
struct Queues {
    received: Deque<u8, RECEIVE_BYTES>,
    to_send: Deque<u8, TRANSMIT_BYTES>,
}

static QUEUES: Mutex<RefCell<Queues>> =
    Mutex::new(RefCell::new(Queues { received: Deque::new(), to_send: Deque::new() }));

fn with<T>(action: impl FnOnce(&mut Queues) -> T) -> T {
    critical_section::with(|section| action(&mut QUEUES.borrow_ref_mut(section)))
}

/// True if the controller can be reset. It needs the clock of its transceiver for that, and the driver waits for it
/// without a bound.
fn can_be_reset() -> bool {
    // SAFETY: a register of the controller, which is clocked and which nobody else uses yet.
    let read = || unsafe { RESET.read_volatile() };
    if !clock::within(READY_US, || read() & IDLE != 0) {
        return false;
    }
    // SAFETY: as above.
    unsafe { RESET.write_volatile(read() | CORE_RESET) };
    clock::within(READY_US, || read() & CORE_RESET == 0)
}

/// True if the driver's next turn ends: it has no queue to empty, or the controller can empty it.
fn turn_ends() -> bool {
    // SAFETY: registers of the controller that reading does not change; only the interrupt uses it now.
    let (status, head, answer, device) = unsafe {
        (STATUS.read_volatile(), HEAD.read_volatile(), ANSWER.read_volatile(), DEVICE_STATUS.read_volatile())
    };
    let queues = if status & BUS_RESET != 0 {
        EMPTY_RECEIVE
    } else if status & SPEED_KNOWN != 0 {
        if device >> 1 & 0b11 == NO_SPEED {
            return false;
        }
        EMPTY_RECEIVE | EMPTY_TRANSMIT | EVERY_QUEUE
    } else if status & RECEIVED != 0 && head >> KIND_SHIFT & 0xF == QUESTION && answer & NOT_SENT != 0 {
        EMPTY_TRANSMIT
    } else {
        return true;
    };
    // SAFETY: as above, and the driver does the same next.
    let read = || unsafe { RESET.read_volatile() };
    // SAFETY: as above.
    unsafe { RESET.write_volatile(read() & !QUEUE_NUMBER | queues) };
    clock::within(EMPTY_US, || read() & (EMPTY_RECEIVE | EMPTY_TRANSMIT) == 0)
}

/// Attaches to the host, if there is one.
pub(super) fn start(nvic: &mut NVIC, number: &'static str) {
    let (Some(memory), Some(place)) =
        (singleton!(: [u32; USB_FIFO_WORDS] = [0; USB_FIFO_WORDS]), singleton!(: Option<UsbBusAllocator<Bus>> = None))
    else {
        return;
    };
    Peripheral::enable();
    if !can_be_reset() {
        defmt::warn!("no USB line: its controller has no clock");
        return;
    }
    let allocator: &'static UsbBusAllocator<Bus> = place.insert(UsbBus::new(Peripheral, memory));
    let serial = SerialPort::new(allocator);
    let names =
        StringDescriptors::default().manufacturer("Tactus").product("Tactus co-controller").serial_number(number);
    let builder = UsbDeviceBuilder::new(allocator, UsbVidPid(USB_VENDOR, USB_PRODUCT)).device_class(USB_CLASS_CDC);
    let Ok(builder) = builder.strings(&[names]) else { return };
    // SAFETY: see `Place`: the interrupt is still masked.
    unsafe { *DEVICE.0.get() = Some(Device { device: builder.build(), serial }) };
    // SAFETY: the handler shares nothing but the queues, behind their lock.
    unsafe {
        nvic.set_priority(Chip::OTG_FS, level(PRIORITY));
        NVIC::unmask(Chip::OTG_FS);
    }
}

/// Something happened on the line, or the session has bytes for it.
#[unsafe(no_mangle)]
extern "C" fn OTG_FS() {
    // SAFETY: see `Place`.
    let place = unsafe { &mut *DEVICE.0.get() };
    if place.is_some() && !turn_ends() {
        defmt::error!("no USB line any more: its controller does not empty its queues");
        *place = None;
    }
    let Some(Device { device, serial }) = place else {
        NVIC::mask(Chip::OTG_FS);
        return;
    };
    device.poll(&mut [serial]);
    let left = TURNS_LEFT.load(Ordering::Relaxed).saturating_sub(1);
    TURNS_LEFT.store(left, Ordering::Relaxed);
    let mut is_full;
    let mut portion = [0; PORTION];
    loop {
        // What does not fit stays with the host, which keeps it until there is room.
        let room = with(|queues| RECEIVE_BYTES - queues.received.len()).min(PORTION);
        is_full = room == 0;
        let Some(place) = portion.get_mut(..room).filter(|place| !place.is_empty()) else { break };
        let Ok(count @ 1..) = serial.read(place) else { break };
        with(|queues| {
            for byte in place.iter().take(count) {
                let _ = queues.received.push_back(*byte);
            }
        });
    }
    loop {
        let ready = with(|queues| {
            let mut ready = 0;
            for (place, byte) in portion.iter_mut().zip(queues.to_send.iter()) {
                *place = *byte;
                ready += 1;
            }
            ready
        });
        let Some(bytes) = portion.get(..ready).filter(|bytes| !bytes.is_empty()) else { break };
        let Ok(count @ 1..) = serial.write(bytes) else { break };
        with(|queues| {
            for _ in 0..count {
                queues.to_send.pop_front();
            }
        });
    }
    // Fails when a packet is under way: its end interrupts again.
    let _ = serial.flush();
    if is_full || left == 0 {
        NVIC::mask(Chip::OTG_FS);
    }
}

/// The line as the selector sees it.
pub struct Usb;

impl LinkPort for Usb {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        TURNS_LEFT.store(TURNS, Ordering::Relaxed);
        for portion in buffer.chunks_mut(PORTION) {
            let wanted = portion.len();
            let found = with(|queues| {
                let mut found = 0;
                for place in portion {
                    let Some(byte) = queues.received.pop_front() else { break };
                    *place = byte;
                    found += 1;
                }
                found
            });
            count += found;
            if found < wanted {
                break;
            }
        }
        if count > 0 {
            // There is room again for what the host still holds.
            NVIC::pend(Chip::OTG_FS);
        }
        // SAFETY: as in `start`.
        unsafe { NVIC::unmask(Chip::OTG_FS) };
        count
    }

    fn write(&mut self, bytes: &[u8]) {
        for portion in bytes.chunks(PORTION) {
            with(|queues| {
                for byte in portion {
                    let _ = queues.to_send.push_back(*byte);
                }
            });
        }
        NVIC::pend(Chip::OTG_FS);
    }

    fn room(&self) -> usize {
        with(|queues| TRANSMIT_BYTES - queues.to_send.len())
    }
}
