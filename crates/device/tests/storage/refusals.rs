//! Refusals of the storage, and its treatment of a flash that is not its own.

use control::Payload;
use control::model::WeightCorrection;
use device::secret::encode as encode_secret;
use device::storage::{HOME_KEY, SECRET_KEY, WEIGHT_KEY};
use device::weight::{WEIGHT_BYTES, encode};
use device::{Store, StoreError, StoredHome, StoredSecret, StoredWeight};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash};
use flash::{FLASH_BYTES, FlashPort, VirtualClock};
use link::SecretState;

use crate::bench::{Wish, chip, home, image, run, run_on, secret, weight, write_setting};

fn noise(seed: u64) -> Vec<u8> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 56) as u8
    };
    (0..FLASH_BYTES).map(|_| next()).collect()
}

#[test]
fn a_foreign_flash_is_made_ours_and_works() {
    for content in [vec![0; FLASH_BYTES], noise(1), noise(2), vec![0x55; FLASH_BYTES]] {
        let chip = chip(&content);
        let (shared, answers) = run_on::<4>(&chip, &[Wish::Save(0, 7)]);
        assert_eq!(answers, [Some(Ok(()))]);
        assert!(shared.library().opening().is_some_and(|opening| opening.formatted));
        let (shared, _) = run_on::<4>(&chip, &[]);
        assert_eq!(shared.library().image(0), Some(image(7).as_slice()));
        assert!(shared.library().opening().is_some_and(|opening| !opening.formatted && opening.found == 1));
    }
}

#[test]
fn damage_anywhere_in_the_log_costs_at_most_the_image_it_is_in() {
    let whole = chip(&vec![0xFF; FLASH_BYTES]);
    run_on::<4>(&whole, &[Wish::Save(0, 1), Wish::Save(1, 2), Wish::Save(2, 3)]);
    let sound = whole.lock().content().to_vec();
    // Bits fall over in every word of the three images, a word at a time.
    for word in (0..3 * 16_448).step_by(1184) {
        let mut content = sound.clone();
        for byte in &mut content[word..word + 8] {
            *byte ^= 0x5A;
        }
        let (shared, _) = run_on::<4>(&chip(&content), &[]);
        let library = shared.library();
        let kept = (0..3_u8).filter(|slot| library.image(*slot) == Some(image(slot + 1).as_slice())).count();
        assert!(kept >= 2, "damage at {word} cost {} images", 3 - kept);
    }
}

#[test]
fn garbage_inside_our_region_never_crashes_and_the_library_works_on() {
    let whole = chip(&vec![0xFF; FLASH_BYTES]);
    run_on::<4>(&whole, &[Wish::Save(0, 1), Wish::Save(1, 2)]);
    let sound = whole.lock().content().to_vec();
    for seed in 0..24 {
        let mut content = sound.clone();
        let garbage = noise(seed);
        let from = usize::from(garbage[0]) * 3000 % (FLASH_BYTES * 3 / 4 - 200_000);
        let count = 1000 + usize::from(garbage[1]) * 700;
        content[from..from + count].copy_from_slice(&garbage[from..from + count]);
        let chip = chip(&content);
        let (_, answers) = run_on::<4>(&chip, &[Wish::Save(3, 9)]);
        assert_eq!(answers, [Some(Ok(()))], "garbage {seed}: {count} bytes at {from}");
        let (shared, _) = run_on::<4>(&chip, &[]);
        assert_eq!(shared.library().image(3), Some(image(9).as_slice()), "garbage {seed}");
    }
}

#[test]
fn a_home_that_is_damaged_or_foreign_on_the_flash_is_said_and_can_be_replaced() {
    let sound = home(3).encode();
    let mut damaged = sound;
    damaged[20] ^= 1;
    // A home of another robot model is as sound as this arm's own.
    let mut foreign = sound;
    foreign[8] ^= 1;
    let (body, sum) = foreign.split_last_chunk_mut::<4>().expect("longer than a check sum");
    *sum = link::frame::CRC.checksum(body).to_le_bytes();
    for (bytes, expected) in [(damaged, StoredHome::Damaged), (foreign, StoredHome::Foreign)] {
        let chip = chip(&vec![0xFF; FLASH_BYTES]);
        run_on::<4>(&chip, &[Wish::Save(1, 7), Wish::Home(3)]);
        write_setting(&chip, HOME_KEY, &bytes);
        let (shared, _) = run_on::<4>(&chip, &[]);
        let opening = shared.library().opening().expect("open");
        assert_eq!((opening.home, opening.found), (expected, 1));
        assert!(
            opening.to_string().contains("the model's counts") || opening.to_string().contains("this model's counts")
        );
        assert_eq!(shared.library().image(1), Some(image(7).as_slice()));
        let (shared, answers) = run_on::<4>(&chip, &[Wish::Home(4)]);
        assert_eq!((answers, shared.library().home()), (vec![Some(Ok(()))], StoredHome::Kept(home(4))));
        assert_eq!(run_on::<4>(&chip, &[]).0.library().home(), StoredHome::Kept(home(4)));
    }
}

#[test]
fn a_weight_is_kept_over_a_restart_and_one_that_is_forged_is_not_used() {
    let sealed = |mut bytes: [u8; WEIGHT_BYTES]| {
        let (body, sum) = bytes.split_last_chunk_mut::<4>().expect("longer than a check sum");
        *sum = link::frame::CRC.checksum(body).to_le_bytes();
        bytes
    };
    let changed = |at: usize, by: &[u8]| {
        let mut bytes = encode(&weight(3));
        bytes[at..at + by.len()].copy_from_slice(by);
        bytes
    };
    let first = 12;
    for (bytes, expected) in [
        (encode(&weight(4)), StoredWeight::Kept(weight(4))),
        (changed(20, &[0xAA]), StoredWeight::Damaged),
        // Sound by their check sums: another model, layout and payload, no number, and links that cannot be.
        (sealed(changed(8, &[1, 2, 3, 4])), StoredWeight::Foreign),
        (sealed(changed(4, &[2])), StoredWeight::Foreign),
        (sealed(changed(6, &[7])), StoredWeight::Foreign),
        (sealed(changed(first, &f32::NAN.to_le_bytes())), StoredWeight::Foreign),
        (sealed(changed(first + 4, &f32::INFINITY.to_le_bytes())), StoredWeight::Foreign),
        (sealed(changed(first + 16, &(-0.6_f32).to_le_bytes())), StoredWeight::Foreign),
        (sealed(changed(first + 20, &0.06_f32.to_le_bytes())), StoredWeight::Foreign),
    ] {
        let chip = chip(&vec![0xFF; FLASH_BYTES]);
        run_on::<4>(&chip, &[Wish::Save(1, 7), Wish::Home(3), Wish::Weight(3)]);
        assert_eq!(run_on::<4>(&chip, &[]).0.library().weight(), StoredWeight::Kept(weight(3)));
        write_setting(&chip, WEIGHT_KEY, &bytes);
        let (shared, _) = run_on::<4>(&chip, &[]);
        let library = shared.library();
        assert_eq!((library.weight(), library.home()), (expected, StoredHome::Kept(home(3))), "{bytes:?}");
        let correction = library.weight().correction();
        assert!(correction == weight(4) || correction == WeightCorrection::none(Payload::SensorAndHand));
        drop(library);
        // It can be replaced.
        run_on::<4>(&chip, &[Wish::Weight(5)]);
        assert_eq!(run_on::<4>(&chip, &[]).0.library().weight(), StoredWeight::Kept(weight(5)));
    }
}

#[test]
fn a_secret_is_kept_over_a_restart_and_one_that_cannot_be_read_is_told_at_the_start() {
    let mut damaged = encode_secret(&secret(4));
    damaged[10] ^= 1;
    let blank = vec![0xFF; FLASH_BYTES];
    for (bytes, expected, words) in [
        (encode_secret(&secret(4)).to_vec(), StoredSecret::Kept(secret(4)), ", and a secret"),
        (damaged.to_vec(), StoredSecret::Unreadable, "the secret cannot be read"),
        (b"of another kind".to_vec(), StoredSecret::Unreadable, "the secret cannot be read"),
    ] {
        let chip = chip(&blank);
        run_on::<4>(&chip, &[Wish::Save(1, 7), Wish::Home(3), Wish::Weight(3), Wish::Secret(3)]);
        assert_eq!(run_on::<4>(&chip, &[]).0.library().secret(), StoredSecret::Kept(secret(3)));
        write_setting(&chip, SECRET_KEY, &bytes);
        let (shared, _) = run_on::<4>(&chip, &[]);
        let library = shared.library();
        assert_eq!((library.secret(), library.home()), (expected, StoredHome::Kept(home(3))));
        assert_eq!(library.weight(), StoredWeight::Kept(weight(3)));
        let opening = library.opening().expect("open");
        assert_eq!((opening.secret, opening.found), (expected.state(), 1));
        assert!(opening.to_string().contains(words), "{opening}");
        drop(library);
        // It can be replaced, and forgotten.
        for (wish, kept) in
            [(Wish::Secret(5), StoredSecret::Kept(secret(5))), (Wish::ForgetSecret, StoredSecret::Nothing)]
        {
            run_on::<4>(&chip, &[wish]);
            assert_eq!(run_on::<4>(&chip, &[]).0.library().secret(), kept);
        }
    }
    // A library that nobody ever gave a secret, as every one of before is.
    let chip = chip(&blank);
    run_on::<4>(&chip, &[Wish::Save(1, 7)]);
    let (shared, _) = run_on::<4>(&chip, &[]);
    assert_eq!(shared.library().opening().map(|opening| opening.secret), Some(SecretState::Nothing));
}

#[test]
fn a_bit_that_falls_over_in_the_secret_costs_the_secret_and_nothing_else() {
    let chip = chip(&vec![0xFF; FLASH_BYTES]);
    run_on::<4>(&chip, &[Wish::Save(0, 1), Wish::Home(3)]);
    let before = chip.lock().content().to_vec();
    run_on::<4>(&chip, &[Wish::Secret(0x5A)]);
    let sound = chip.lock().content().to_vec();
    let written: Vec<usize> = (0..FLASH_BYTES).filter(|at| before[*at] != sound[*at]).collect();
    let mut lost = 0;
    for at in &written {
        let mut content = sound.clone();
        content[*at] ^= 0x10;
        let (shared, _) = run_on::<4>(&self::chip(&content), &[]);
        let library = shared.library();
        assert_eq!((library.image(0), library.home()), (Some(image(1).as_slice()), StoredHome::Kept(home(3))));
        // The log's own check sum finds it first: then it is as if there had never been one, which a host that knows
        // one is told at every connection. Another secret is never taken for it.
        match library.secret() {
            StoredSecret::Nothing => lost += 1,
            found => assert_eq!(found, StoredSecret::Kept(secret(0x5A)), "byte {at}"),
        }
    }
    assert!(lost > 16, "{lost} of {}", written.len());
}

#[test]
fn a_full_flash_refuses_the_next_image_and_keeps_the_others() {
    // More places than the flash has room for: only then can it be full.
    let chip = chip(&vec![0xFF; FLASH_BYTES]);
    let wishes: Vec<_> = (0..48).map(|slot| Wish::Save(slot, slot)).collect();
    let (shared, answers) = run_on::<48>(&chip, &wishes);
    let kept = answers.iter().take_while(|answer| **answer == Some(Ok(()))).count();
    println!("{kept} images of 16 kB fit");
    assert!(kept >= 28, "only {kept} images fit into six sectors");
    assert_eq!(answers[kept], Some(Err(StoreError::Full)));
    let again = run_on::<48>(&chip, &[]).0;
    for slot in 0..kept as u8 {
        assert_eq!(shared.library().image(slot), Some(image(slot).as_slice()));
        assert_eq!(again.library().image(slot), Some(image(slot).as_slice()), "place {slot} after the restart");
    }
}

#[test]
fn a_flash_that_fails_refuses_and_the_memory_stays_as_it_was() {
    let chip = chip(&vec![0xFF; FLASH_BYTES]);
    run_on::<4>(&chip, &[Wish::Save(0, 1)]);
    let failing = failing::Failing { port: FlashPort::new(chip.clone(), VirtualClock::default()), writes_left: 40 };
    let (shared, answers) = run::<4, _>(failing, &[Wish::Save(0, 2), Wish::Save(1, 3), Wish::Delete(0)]);
    assert_eq!(answers, [Some(Err(StoreError::Sector(0))); 3]);
    assert_eq!(shared.library().report(0).bad_sector, Some(0));
    assert_eq!(shared.library().image(0), Some(image(1).as_slice()));
    assert_eq!(shared.library().image(1), None);
}

mod failing {
    use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
    use flash::{FlashError, FlashPort};

    /// A flash that can be written a few more times.
    pub(super) struct Failing {
        pub(super) port: FlashPort,
        pub(super) writes_left: u32,
    }

    impl ErrorType for Failing {
        type Error = FlashError;
    }

    impl ReadNorFlash for Failing {
        const READ_SIZE: usize = FlashPort::READ_SIZE;

        async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
            self.port.read(offset, bytes).await
        }

        fn capacity(&self) -> usize {
            self.port.capacity()
        }
    }

    impl NorFlash for Failing {
        const WRITE_SIZE: usize = FlashPort::WRITE_SIZE;
        const ERASE_SIZE: usize = FlashPort::ERASE_SIZE;

        async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
            self.port.erase(from, to).await
        }

        async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
            for (word, at) in bytes.chunks(Self::WRITE_SIZE).zip((offset..).step_by(Self::WRITE_SIZE)) {
                self.writes_left = self.writes_left.checked_sub(1).ok_or(FlashError::NotBlank)?;
                self.port.write(at, word).await?;
            }
            Ok(())
        }
    }
}

/// A flash that hangs in the write or erasure after so many, or in the read after them, and then answers nothing.
struct Hanging {
    port: FlashPort,
    operations_left: u32,
    in_a_read: bool,
    hangs: bool,
}

/// It hangs.
#[derive(Debug)]
struct Hangs;

impl NorFlashError for Hangs {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl Hanging {
    fn operation(&mut self) -> Result<(), Hangs> {
        self.hangs |= self.operations_left == 0;
        if self.hangs {
            return Err(Hangs);
        }
        self.operations_left -= 1;
        Ok(())
    }
}

impl ErrorType for Hanging {
    type Error = Hangs;
}

impl ReadNorFlash for Hanging {
    const READ_SIZE: usize = FlashPort::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Hangs> {
        self.hangs |= self.in_a_read && self.operations_left == 0;
        if self.hangs {
            return Err(Hangs);
        }
        self.port.read(offset, bytes).await.map_err(|_| Hangs)
    }

    fn capacity(&self) -> usize {
        self.port.capacity()
    }
}

impl NorFlash for Hanging {
    const WRITE_SIZE: usize = FlashPort::WRITE_SIZE;
    const ERASE_SIZE: usize = FlashPort::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Hangs> {
        self.operation()?;
        self.port.erase(from, to).await.map_err(|_| Hangs)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Hangs> {
        self.operation()?;
        self.port.write(offset, bytes).await.map_err(|_| Hangs)
    }
}

#[test]
fn c5_a_flash_that_hangs_in_any_operation_is_told_as_failed_and_a_new_start_trusts_it_again() {
    let blank = vec![0xFF; FLASH_BYTES];
    let mut told = [0; 2];
    for (operations_left, in_a_read) in (1..60).flat_map(|left| [(left, false), (left, true)]) {
        let chip = chip(&blank);
        let port = FlashPort::new(chip.clone(), VirtualClock::default());
        let flash = Hanging { port, operations_left, in_a_read, hangs: false };
        let (shared, answers) = run::<4, _>(flash, &[Wish::Save(0, 7), Wish::Home(3), Wish::Save(1, 8)]);
        let words = format!("{operations_left} {in_a_read}: {answers:?}");
        let library = shared.library();
        assert!(answers.iter().all(Option::is_some), "one is never answered, {words}");
        assert!(answers.is_sorted_by_key(|answer| *answer != Some(Ok(()))), "{words}");
        let refused = answers.iter().flatten().find_map(|answer| answer.err());
        let report = library.report(0);
        match refused {
            None => assert!(!report.failed && report.bad_sector.is_none(), "{words}"),
            Some(StoreError::Sector(sector)) => assert_eq!(report.bad_sector, Some(sector), "{words}"),
            Some(StoreError::Medium) => assert!(report.failed, "{words}"),
            Some(_) => panic!("{words}"),
        }
        told[usize::from(in_a_read)] += u32::from(refused.is_some());
        drop(library);
        let (shared, again) = run_on::<4>(&chip, &[Wish::Save(2, 9)]);
        let report = shared.library().report(0);
        assert_eq!((again, report.failed, report.bad_sector), (vec![Some(Ok(()))], false, None), "{words}");
        if answers.first() == Some(&Some(Ok(()))) {
            assert_eq!(shared.library().image(0), Some(image(7).as_slice()), "{words}");
        }
    }
    assert!(told.iter().all(|count| *count > 5), "{told:?}");
}
