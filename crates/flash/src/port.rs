//! The flash as a device in this process sees it: `NorFlash` in virtual time.

use std::future::poll_fn;
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};
use std::task::Poll;

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};

use crate::{FLASH_BYTES, FlashChip, FlashError, SECTOR_BYTES, Ticks, WORD_BYTES};

/// The time in which the device lives; whoever lets it pass sets it, and can ask what the device waits for.
#[derive(Clone, Debug, Default)]
pub struct VirtualClock(Arc<Times>);

#[derive(Debug, Default)]
struct Times {
    now: AtomicU64,
    /// When the flash will be ready; 0: nobody waits for it.
    alarm: AtomicU64,
}

impl VirtualClock {
    /// Now, ticks.
    #[must_use]
    pub fn now(&self) -> Ticks {
        self.0.now.load(Ordering::Relaxed)
    }

    /// Time has passed.
    pub fn set(&self, now: Ticks) {
        self.0.now.store(now, Ordering::Relaxed);
    }

    /// When the flash the device waits for will be ready; `None` if it waits for something else. It is said once.
    #[must_use]
    pub fn take_alarm(&self) -> Option<Ticks> {
        Some(self.0.alarm.swap(0, Ordering::Relaxed)).filter(|alarm| *alarm > 0)
    }

    fn wait_for(&self, ready: Ticks) {
        self.0.alarm.store(ready, Ordering::Relaxed);
    }
}

/// The device's end. An operation that has not ended yet is pending: ask again when time has passed. One that power
/// failed in never ends.
#[derive(Clone, Debug)]
pub struct FlashPort {
    chip: FlashChip,
    clock: VirtualClock,
}

impl FlashPort {
    /// Connects a chip to a device that lives in this time.
    #[must_use]
    pub fn new(chip: FlashChip, clock: VirtualClock) -> Self {
        Self { chip, clock }
    }

    async fn until(&self, begun: Result<Ticks, FlashError>) -> Result<(), FlashError> {
        let ready = self.survive(begun).await?;
        poll_fn(|_| {
            if self.clock.now() >= ready {
                return Poll::Ready(Ok(()));
            }
            self.clock.wait_for(ready);
            Poll::Pending
        })
        .await
    }

    /// A device without power does nothing any more, not even see an error.
    async fn survive<T>(&self, outcome: Result<T, FlashError>) -> Result<T, FlashError> {
        if let Err(FlashError::NoPower) = outcome {
            std::future::pending::<()>().await;
        }
        outcome
    }
}

/// Whole units of the flash from `from` to `to`. As `NorFlash` promises: a call that names others changes nothing.
fn within(from: u32, to: u32, unit: usize) -> Result<(), FlashError> {
    let (from, to) = (crate::place(from)?, crate::place(to)?);
    let whole = from <= to && to <= FLASH_BYTES && from.is_multiple_of(unit) && to.is_multiple_of(unit);
    if whole { Ok(()) } else { Err(FlashError::Place) }
}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        match self {
            Self::Place => NorFlashErrorKind::OutOfBounds,
            Self::NotBlank | Self::NoPower => NorFlashErrorKind::Other,
        }
    }
}

impl ErrorType for FlashPort {
    type Error = FlashError;
}

impl ReadNorFlash for FlashPort {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let outcome = self.chip.lock().read(offset, bytes);
        self.survive(outcome).await
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for FlashPort {
    const WRITE_SIZE: usize = WORD_BYTES;
    const ERASE_SIZE: usize = SECTOR_BYTES;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        within(from, to, SECTOR_BYTES)?;
        for sector in (from..to).step_by(SECTOR_BYTES) {
            let begun = self.chip.lock().erase_sector(self.clock.now(), sector);
            self.until(begun).await?;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        let length = u32::try_from(bytes.len()).map_err(|_| FlashError::Place)?;
        within(offset, offset.checked_add(length).ok_or(FlashError::Place)?, WORD_BYTES)?;
        for (word, at) in bytes.chunks(WORD_BYTES).zip((offset..).step_by(WORD_BYTES)) {
            let begun = self.chip.lock().write_word(self.clock.now(), at, word);
            self.until(begun).await?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::pin::pin;
    use std::task::{Context, Poll, Waker};

    use super::*;
    use crate::{Flash, FlashTimes};

    fn end<T>(operation: impl Future<Output = T>) -> T {
        match pin!(operation).poll(&mut Context::from_waker(Waker::noop())) {
            Poll::Ready(outcome) => outcome,
            Poll::Pending => panic!("a flash without times is never busy"),
        }
    }

    #[test]
    fn what_is_not_whole_sectors_or_words_of_the_flash_is_refused_before_anything_is_changed() {
        let chip = FlashChip::new(Flash::with_content(vec![0; FLASH_BYTES - WORD_BYTES], FlashTimes::NONE));
        let before = chip.lock().content().to_vec();
        let mut port = FlashPort::new(chip.clone(), VirtualClock::default());
        let (sector, flash) = (SECTOR_BYTES as u32, FLASH_BYTES as u32);
        for (from, to) in [(0, 1), (0, sector + 1), (1, sector), (sector, 0), (flash - sector, flash + sector)] {
            assert_eq!(end(port.erase(from, to)), Err(FlashError::Place), "{from} {to}");
        }
        let last = flash - WORD_BYTES as u32;
        for (offset, length) in [(last, 33), (last, 31), (last + 1, 32), (last, 64), (u32::MAX - 31, 64)] {
            assert_eq!(end(port.write(offset, &vec![1; length])), Err(FlashError::Place), "{offset} {length}");
        }
        assert!(chip.lock().content() == before, "something was changed");
        assert_eq!(end(port.write(last, &[1; WORD_BYTES])), Ok(()));
        assert_eq!(end(port.erase(flash - sector, flash)), Ok(()));
    }
}
