//! The simulated flash: as large and as slow as bank 2 of the STM32H743, at the other end of the lock step.

use core::future::poll_fn;
use core::task::Poll;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use super::lockstep::FlashRequest;
use super::{can, clock};

/// Bytes of a sector.
const SECTOR: usize = 128 * 1024;

/// Bytes of a word, the least that can be written.
const WORD: usize = 32;

/// Bytes of the region: 8 sectors.
const CAPACITY: usize = 8 * SECTOR;

/// Most bytes in one reply of the simulator.
const LONGEST_READ: usize = 4096;

/// An operation that takes longer than this is awaited, ticks; a shorter one is waited for: 1 ms.
const SHORT: u64 = 25_000;

/// The library's flash.
pub struct Flash;

/// Number of the simulator's error: 1 outside or not aligned, 2 the word is not blank.
#[derive(Clone, Copy, Debug)]
pub struct FlashError(u8);

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self.0 {
            1 => NorFlashErrorKind::OutOfBounds,
            _ => NorFlashErrorKind::Other,
        }
    }
}

impl ErrorType for Flash {
    type Error = FlashError;
}

/// Starts an operation and waits until it is over.
async fn perform(request: FlashRequest<'_>) -> Result<(), FlashError> {
    let reply = can::with(|controller| controller.flash(request, &mut []));
    if reply.status != 0 {
        return Err(FlashError(reply.status));
    }
    poll_fn(|_| {
        // Asked again after the next interrupt: a slot begins every 1.1 ms.
        while reply.ready > clock::now() {
            if reply.ready - clock::now() > SHORT {
                return Poll::Pending;
            }
        }
        Poll::Ready(())
    })
    .await;
    Ok(())
}

fn address(offset: usize) -> Result<u32, FlashError> {
    u32::try_from(offset).map_err(|_| FlashError(1))
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let mut from = offset as usize;
        for part in bytes.chunks_mut(LONGEST_READ) {
            let request = FlashRequest::Read(address(from)?, part.len() as u32);
            from += part.len();
            let reply = can::with(|controller| controller.flash(request, part));
            if reply.status != 0 {
                return Err(FlashError(reply.status));
            }
        }
        Ok(())
    }

    fn capacity(&self) -> usize {
        CAPACITY
    }
}

impl NorFlash for Flash {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        for sector in (from..to).step_by(SECTOR) {
            perform(FlashRequest::Erase(sector)).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        for (word, at) in bytes.chunks(WORD).zip((offset as usize..).step_by(WORD)) {
            perform(FlashRequest::Write(address(at)?, word)).await?;
        }
        Ok(())
    }
}
