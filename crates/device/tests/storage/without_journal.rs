//! Why there is a journal of erases: what the log alone makes of an erase that power failed in.

use core::pin::pin;
use core::task::{Context, Poll, Waker};

use flash::{FLASH_BYTES, FlashChip, FlashPort, VirtualClock};
use sequential_storage::cache::Cache;
use sequential_storage::map::{MapConfig, MapStorage};

use crate::bench::{chip, image};

/// Polls once: everything is done, or power has failed.
fn now<T>(task: impl Future<Output = T>) -> Option<T> {
    match pin!(task).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(value) => Some(value),
        Poll::Pending => None,
    }
}

/// Stores images in the log alone; `false`: power failed, or the log refused.
fn store(chip: &FlashChip, values: &[(u8, u8)]) -> bool {
    let port = FlashPort::new(chip.clone(), VirtualClock::default());
    let config = MapConfig::new(0..FLASH_BYTES as u32);
    let mut log = MapStorage::<u8, _, _>::new(port, config, Cache::new_uncached());
    let mut room = vec![0; 17_000];
    values.iter().all(|(key, number)| {
        now(log.store_item(&mut room, key, &image(*number).as_slice())).is_some_and(|outcome| outcome.is_ok())
    })
}

/// Number of these values that are not there any more.
fn lost(chip: &FlashChip, values: &[(u8, u8)]) -> usize {
    let port = FlashPort::new(chip.clone(), VirtualClock::default());
    let config = MapConfig::new(0..FLASH_BYTES as u32);
    let mut log = MapStorage::<u8, _, _>::new(port, config, Cache::new_uncached());
    let mut room = vec![0; 17_000];
    let mut kept = |key: u8, number: u8| {
        let found = now(log.fetch_item::<&[u8]>(&mut room, &key)).and_then(Result::ok).flatten();
        found == Some(image(number).as_slice())
    };
    values.iter().filter(|(key, number)| !kept(*key, *number)).count()
}

#[test]
fn the_log_alone_loses_images_to_an_interrupted_erase() {
    let values = [(0, 40), (1, 41), (2, 42)];
    let whole = chip(&vec![0xFF; FLASH_BYTES]);
    assert!(store(&whole, &values));
    // Key 3 is written until an erase is due; the operations before and after it are those of writing.
    let mut before = whole.lock().content().to_vec();
    let erase = loop {
        let trial = chip(&before);
        assert!(store(&trial, &[(3, 50)]));
        let flash = trial.lock();
        if flash.erases().iter().sum::<u32>() > 0 {
            // The erase, then the header and the words of the new image.
            let words = (image(50).len() + 1).div_ceil(32) as u64 + 1;
            break flash.operations() - words - 1;
        }
        before = flash.content().to_vec();
    };
    let mut damaged = 0;
    for draw in 0..24 {
        let chip = chip(&before);
        chip.lock().cut_power_at(erase, draw);
        assert!(!store(&chip, &[(3, 51)]));
        assert_eq!(chip.lock().erases().iter().sum::<u32>(), 1, "power failed in another operation");
        chip.lock().restart();
        // The next change makes the log repair itself.
        store(&chip, &[(3, 52)]);
        damaged += usize::from(lost(&chip, &values) > 0);
    }
    println!("the log alone lost images in {damaged} of 24 interrupted erases");
    assert!(damaged > 0, "the log survives by itself now: is the journal still needed?");
}
