//! The serial line through the ST-LINK (USART3), by interrupts.
//!
//! The controller holds 16 bytes in each direction, 174 us of a full line, so its interrupt stands above every task and
//! does nothing but move bytes between those and two queues.
//!
//! Above every task: a controller whose line would not come down would keep the control slot from its turn. So it moves
//! no more bytes in one go than the controller holds, and it gives way until the session comes by when nobody fetches
//! what has come, or after so many turns in which there was nothing to move.

use core::cell::RefCell;

use cortex_m::peripheral::NVIC;
use critical_section::Mutex;
use embassy_stm32::pac::usart::regs::Icr;
use embassy_stm32::pac::usart::vals::Over8;
use embassy_stm32::pac::{self, RCC};
use heapless::Deque;

use super::super::constants::lines::{RECEIVE_BYTES, TRANSMIT_BYTES, UART_BRR, UART_EIGHT_SAMPLES, UART_FIFO_BYTES};
use super::device::{Chip, level};
use crate::board::LinkPort;

/// Logical priority: above every task.
const PRIORITY: u8 = 13;

/// Interrupt when half of the sixteen places are taken (received) or free (to be sent).
const HALF: u8 = 0b010;

/// Silence after which bytes below that half are told, bit times: four bytes.
const SILENCE_BITS: u32 = 40;

/// Bytes moved with interrupts masked in one go: 0.2 us of copying.
const PORTION: usize = 32;

/// Interrupts with nothing to move between two visits of the session, which comes by every 1.1 ms: a silence makes one.
const TURNS: u32 = 64;

/// The queues between the interrupt and the session.
struct Queues {
    received: Deque<u8, RECEIVE_BYTES>,
    to_send: Deque<u8, TRANSMIT_BYTES>,
    /// Of [`TURNS`].
    turns_left: u32,
}

static QUEUES: Mutex<RefCell<Queues>> =
    Mutex::new(RefCell::new(Queues { received: Deque::new(), to_send: Deque::new(), turns_left: TURNS }));

fn with<T>(action: impl FnOnce(&mut Queues) -> T) -> T {
    critical_section::with(|section| action(&mut QUEUES.borrow_ref_mut(section)))
}

/// Opens the line: 8 data bits, no parity, one stop bit.
pub(super) fn start(nvic: &mut NVIC) {
    RCC.apb1lenr().modify(|w| w.set_usart3en(true));
    RCC.apb1lenr().read();
    let r = pac::USART3;
    r.cr1().write(|w| {
        w.set_fifoen(true);
        w.set_over8(if UART_EIGHT_SAMPLES { Over8::OVERSAMPLING8 } else { Over8::OVERSAMPLING16 });
    });
    r.cr2().write(|w| w.set_rtoen(true));
    r.cr3().write(|w| {
        w.set_rxftcfg(HALF);
        w.set_txftcfg(HALF);
        w.set_rxftie(true);
    });
    r.brr().write(|w| w.set_brr(UART_BRR));
    r.rtor().write(|w| w.set_rto(SILENCE_BITS));
    r.cr1().modify(|w| {
        w.set_rtoie(true);
        w.set_te(true);
        w.set_re(true);
        w.set_ue(true);
    });
    // SAFETY: the handler shares nothing but the queues, behind their lock.
    unsafe {
        nvic.set_priority(Chip::USART3, level(PRIORITY));
        NVIC::unmask(Chip::USART3);
    }
}

/// Bytes have come, or there is room for more.
#[unsafe(no_mangle)]
extern "C" fn USART3() {
    let r = pac::USART3;
    let gives_way = with(|queues| {
        let mut moved = false;
        for _ in 0..UART_FIFO_BYTES {
            if !r.isr().read().rxne() {
                break;
            }
            let byte = r.rdr().read().dr() as u8;
            // Without room the byte is lost: see `LinkPort::read`.
            let _ = queues.received.push_back(byte);
            moved = true;
        }
        let mut seen = Icr(0);
        seen.set_rtof(true);
        seen.set_ore(true);
        seen.set_fe(true);
        seen.set_ne(true);
        seen.set_pe(true);
        r.icr().write_value(seen);
        for _ in 0..UART_FIFO_BYTES {
            if !r.isr().read().txe() {
                break;
            }
            match queues.to_send.pop_front() {
                Some(byte) => r.tdr().write(|w| w.set_dr(u16::from(byte))),
                None => {
                    r.cr3().modify(|w| w.set_txftie(false));
                    break;
                }
            }
            moved = true;
        }
        queues.turns_left -= u32::from(!moved && queues.turns_left > 0);
        queues.received.is_full() || queues.turns_left == 0
    });
    if gives_way {
        NVIC::mask(Chip::USART3);
    }
}

/// The line as the selector sees it.
pub struct Serial;

impl LinkPort for Serial {
    fn read(&mut self, buffer: &mut [u8]) -> usize {
        let mut count = 0;
        for portion in buffer.chunks_mut(PORTION) {
            let wanted = portion.len();
            let found = with(|queues| {
                let mut found = 0;
                for place in portion {
                    let Some(byte) = queues.received.pop_front() else { break };
                    *place = byte;
                    found += 1;
                }
                if found < wanted {
                    queues.turns_left = TURNS;
                }
                found
            });
            count += found;
            if found < wanted {
                // All there was is fetched. Not before: bytes without end would keep the session here.
                // SAFETY: as in `start`.
                unsafe { NVIC::unmask(Chip::USART3) };
                break;
            }
        }
        count
    }

    fn write(&mut self, bytes: &[u8]) {
        for portion in bytes.chunks(PORTION) {
            with(|queues| {
                for byte in portion {
                    let _ = queues.to_send.push_back(*byte);
                }
                pac::USART3.cr3().modify(|w| w.set_txftie(true));
            });
        }
    }

    fn room(&self) -> usize {
        with(|queues| TRANSMIT_BYTES - queues.to_send.len())
    }
}
