//! Losses of the flash are told: which images and settings, and which sector cannot be erased.

use device::{Store, StoreError, StoredHome, StoredSecret, StoredWeight};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use flash::{FLASH_BYTES, FlashChip, FlashError, FlashPort, SECTOR_BYTES, VirtualClock, WORD_BYTES};

use crate::bench::{Wish, chip, home, named, run, run_on, secret, weight};

/// Places 0 to 2 with images 1 to 3, home, weight and secret; place 1 held image 9 before.
fn library() -> Vec<u8> {
    let chip = chip(&vec![0xFF; FLASH_BYTES]);
    let settings = [Wish::Home(5), Wish::Weight(6), Wish::Secret(7)];
    let images = [Wish::Named(1, 9), Wish::Named(0, 1), Wish::Named(1, 2), Wish::Named(2, 3)];
    let (_, answers) = run_on::<4>(&chip, &[settings.as_slice(), &images].concat());
    assert!(answers.iter().all(|answer| *answer == Some(Ok(()))));
    chip.lock().content().to_vec()
}

/// True if this word begins an image with its key.
fn key_of_image(sound: &[u8], word: usize) -> bool {
    sound[word + 1..word + 5] == *b"TACP"
}

#[test]
fn h11_whatever_word_is_damaged_every_image_and_setting_that_it_costs_is_told() {
    let sound = library();
    let (shared, _) = run_on::<4>(&chip(&sound), &[]);
    assert_eq!(shared.library().report(0), link::StorageReport::default());
    let used = (0..SECTOR_BYTES).step_by(WORD_BYTES).filter(|word| sound[*word..word + 32] != [0xFF; 32]);
    let (mut told, mut nameless, mut unread) = (0, 0, 0);
    // The first words of a value, where its header, key and name are, and a few of the rest.
    for word in used.enumerate().filter(|(index, _)| *index < 32 || index % 11 == 0).map(|(_, word)| word) {
        for (byte, bit) in [(0, 0), (1, 4), (5, 2), (7, 3), (31, 7)] {
            let mut content = sound.clone();
            content[word + byte] ^= 1 << bit;
            let (shared, _) = run_on::<4>(&chip(&content), &[]);
            let library = shared.library();
            let about = format!("word {}, bit {byte}.{bit}", word / WORD_BYTES);
            // The key of an image may be damaged so that it is another place's: that something is lost is told then.
            if key_of_image(&sound, word) && byte == 0 {
                let all = (0..3).all(|slot| library.image(slot) == Some(named(slot + 1).as_slice()));
                assert!(all || library.report(0).lost + library.report(0).unread > 0, "{about}");
                continue;
            }
            for slot in 0..4 {
                let expected = (slot < 3).then(|| named(slot + 1));
                let is_lost = library.image(slot) != expected.as_deref();
                let loss = library.report(slot).loss;
                assert_eq!(loss.is_some(), is_lost, "{about}, place {slot}");
                if let Some(loss) = loss {
                    told += 1;
                    assert_eq!((loss.place, loss.older), (slot, slot == 1), "{about}");
                    match loss.name {
                        Some(name) if name.as_str() == format!("image-{}", slot + 1) => {}
                        _ => nameless += 1,
                    }
                }
            }
            let is_lost = [
                library.home() != StoredHome::Kept(home(5)),
                library.weight() != StoredWeight::Kept(weight(6)),
                library.secret() != StoredSecret::Kept(secret(7)),
            ];
            let settings = is_lost.iter().enumerate().map(|(place, is_lost)| u8::from(*is_lost) << place).sum::<u8>();
            assert_eq!(library.report(0).settings_lost, settings, "{about}: {is_lost:?}");
            unread += u32::from(library.report(0).unread);
        }
    }
    println!("{told} losses told, {nameless} without the right name, {unread} that do not tell whose they are");
    assert!(told > 300 && nameless * 20 < told && unread < 20);
}

#[test]
fn h11_of_a_library_with_1900_damaged_words_it_is_told_which_images_are_lost() {
    for seed in 0..24_u64 {
        let (mut content, mut state) = (library(), seed);
        let mut draw = |limit: usize| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) as usize % limit
        };
        for _ in 0..1900 {
            content[draw(FLASH_BYTES)] &= !(1 << draw(8));
        }
        let chip = chip(&content);
        let (shared, answers) = run_on::<4>(&chip, &[Wish::Named(0, 8)]);
        assert_eq!(answers, [Some(Ok(()))]);
        let library = shared.library();
        for slot in 1..3 {
            let is_lost = library.image(slot) != Some(named(slot + 1).as_slice());
            assert_eq!(library.report(slot).loss.is_some(), is_lost, "seed {seed}, place {slot}");
        }
        // What was uploaded again is missed no more, and neither is it after a restart.
        assert_eq!(library.report(0).loss, None, "seed {seed}");
        drop(library);
        let (shared, _) = run_on::<4>(&chip, &[]);
        assert_eq!(shared.library().report(0).loss, None, "seed {seed}");
    }
}

#[test]
fn h11_an_upload_that_power_failed_in_is_told_as_no_loss() {
    let before = library();
    let operations = {
        let chip = chip(&before);
        run_on::<4>(&chip, &[Wish::Named(2, 4)]);
        chip.lock().operations()
    };
    for operation in (0..operations - 1).step_by(5) {
        let chip = chip(&before);
        chip.lock().cut_power_at(operation, operation);
        run_on::<4>(&chip, &[Wish::Named(2, 4)]);
        chip.lock().restart();
        let (shared, _) = run_on::<4>(&chip, &[]);
        let library = shared.library();
        assert_eq!(library.image(2), Some(named(3).as_slice()), "cut {operation}");
        assert_eq!(library.report(2).loss, None, "cut {operation}");
    }
}

/// Where the last value lies that begins in this way.
fn found(content: &[u8], beginning: &[u8]) -> usize {
    let mut words = (0..content.len()).step_by(WORD_BYTES).rev();
    words.find(|word| content[*word..].starts_with(beginning)).expect("it is on the flash")
}

/// The library with the newest images of places 1 and 2 damaged, and the home.
fn damaged() -> Vec<u8> {
    let mut content = library();
    for slot in 1..3 {
        let at = found(&content, &[&[slot], &named(slot + 1)[..60]].concat());
        content[at + 3000] ^= 1;
    }
    let at = found(&content, b"\xC0TacH");
    content[at + 20] ^= 1;
    content
}

/// The change that makes it fail: a loss is known by what lies on the flash alone, of which the sector of the damaged
/// value is erased one day, or the one with the image of before is copied behind it.
#[test]
fn h11_a_loss_is_told_for_as_long_as_nobody_has_made_it_good_however_much_is_stored_meanwhile() {
    let chip = chip(&damaged());
    for uploads in [0, 9, 60, 60, 60, 0] {
        let wishes: Vec<Wish> = (0..uploads).map(|number| Wish::Named(3, 10 + number)).collect();
        let (shared, answers) = run_on::<4>(&chip, &wishes);
        assert!(answers.iter().all(|answer| *answer == Some(Ok(()))), "{answers:?}");
        let library = shared.library();
        // Of the first one an image of before stands there.
        assert_eq!((library.image(1), library.image(2)), (Some(named(9).as_slice()), None));
        let losses = [1, 2].map(|slot| library.report(slot).loss.expect("a loss"));
        assert_eq!(losses.each_ref().map(|loss| loss.older), [true, false], "{uploads} uploads");
        let names = losses.map(|loss| loss.name.expect("a name").as_str().to_owned());
        assert_eq!(names, ["image-2", "image-3"], "{uploads} uploads");
        assert_eq!((library.report(0).lost, library.report(0).settings_lost), (2, 1), "{uploads} uploads");
    }
    // What was stored again is missed no more, be it the image of before itself.
    run_on::<4>(&chip, &[Wish::Named(1, 9), Wish::Named(2, 3), Wish::Home(5)]);
    let (shared, _) = run_on::<4>(&chip, &[]);
    assert_eq!(shared.library().report(1), link::StorageReport::default());
}

/// The change that makes it fail: as above; the deleted image would be like any other after two rounds of the log.
#[test]
fn h11_a_deleted_image_that_damage_brings_back_is_told_as_such_for_as_long_as_it_is_there() {
    let mut content = {
        let chip = chip(&library());
        run_on::<4>(&chip, &[Wish::Delete(0)]);
        chip.lock().content().to_vec()
    };
    // The deletion is the last value: a header, and a word with the key.
    let is_used = |word: &usize| content[*word..word + WORD_BYTES] != [0xFF; WORD_BYTES];
    let key = (0..SECTOR_BYTES - WORD_BYTES).step_by(WORD_BYTES).rev().find(is_used).expect("it is there");
    content[key - WORD_BYTES] ^= 1;
    let chip = chip(&content);
    for uploads in [0, 60, 60, 0] {
        let wishes: Vec<Wish> = (0..uploads).map(|number| Wish::Named(3, 10 + number)).collect();
        let (shared, _) = run_on::<4>(&chip, &wishes);
        let library = shared.library();
        assert_eq!(library.image(0), Some(named(1).as_slice()));
        assert!(library.report(0).loss.is_some_and(|loss| loss.older && loss.name.is_none()), "{uploads} uploads");
    }
    // Deleted once more it is gone, and nothing is missed.
    run_on::<4>(&chip, &[Wish::Delete(0)]);
    let (shared, _) = run_on::<4>(&chip, &[]);
    let library = shared.library();
    assert_eq!((library.image(0), library.report(0).loss), (None, None));
}

/// The change that makes it fail: a note counts whatever stands there by now.
#[test]
fn h11_an_upload_that_makes_a_loss_good_is_told_as_no_loss_wherever_power_fails_behind_it() {
    let noted = {
        let chip = chip(&damaged());
        run_on::<4>(&chip, &[]);
        chip.lock().content().to_vec()
    };
    let upload = [Wish::Named(2, 7)];
    let operations = {
        let chip = chip(&noted);
        run_on::<4>(&chip, &upload);
        chip.lock().operations()
    };
    let (mut before, mut behind) = (0, 0);
    for operation in operations.saturating_sub(12)..operations {
        let chip = chip(&noted);
        chip.lock().cut_power_at(operation, operation);
        run_on::<4>(&chip, &upload);
        chip.lock().restart();
        let (shared, _) = run_on::<4>(&chip, &[]);
        let library = shared.library();
        let is_there = library.image(2) == Some(named(7).as_slice());
        assert_eq!(library.report(2).loss.is_some(), !is_there, "cut {operation} of {operations}");
        assert!(library.report(1).loss.is_some(), "the other one is missed all the same");
        *(if is_there { &mut behind } else { &mut before }) += 1;
    }
    assert!(before > 2 && behind > 1, "{before} and {behind}");
}

/// A chip of which one sector cannot be erased, or only after so many tries.
struct Worn {
    port: FlashPort,
    sector: u32,
    failures: u32,
}

impl Worn {
    fn new(chip: &FlashChip, sector: u32, failures: u32) -> Self {
        Self { port: FlashPort::new(chip.clone(), VirtualClock::default()), sector, failures }
    }
}

impl ErrorType for Worn {
    type Error = FlashError;
}

impl ReadNorFlash for Worn {
    const READ_SIZE: usize = FlashPort::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        self.port.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.port.capacity()
    }
}

impl NorFlash for Worn {
    const WRITE_SIZE: usize = FlashPort::WRITE_SIZE;
    const ERASE_SIZE: usize = FlashPort::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        if from / SECTOR_BYTES as u32 == self.sector && self.failures > 0 {
            self.failures -= 1;
            return Err(FlashError::Place);
        }
        self.port.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.port.write(offset, bytes).await
    }
}

#[test]
fn h11_a_sector_that_cannot_be_erased_is_told_and_what_the_others_hold_is_read_and_kept() {
    let chip = chip(&library());
    let uploads: Vec<Wish> = (0..60).map(|number| Wish::Named(3, 10 + number)).collect();
    let (shared, answers) = run::<4, _>(Worn::new(&chip, 1, u32::MAX), &uploads);
    let taken = answers.iter().take_while(|answer| **answer == Some(Ok(()))).count();
    assert!(taken > 30, "{taken}");
    assert!(answers[taken..].iter().all(|answer| *answer == Some(Err(StoreError::Sector(1)))), "{answers:?}");
    assert_eq!(shared.library().report(0).bad_sector, Some(1));
    let newest = named(10 + u8::try_from(taken).unwrap() - 1);

    // The restart tries it again, in vain, and reads what there is.
    let (shared, answers) = run::<4, _>(Worn::new(&chip, 1, u32::MAX), &[Wish::Named(0, 99), Wish::Home(9)]);
    assert_eq!(answers, [Some(Err(StoreError::Sector(1))); 2]);
    {
        let library = shared.library();
        for (slot, image) in [(0, named(1)), (1, named(2)), (2, named(3)), (3, newest.clone())] {
            assert_eq!(library.image(slot), Some(image.as_slice()), "place {slot}");
            assert_eq!(library.report(slot).loss, None, "place {slot}");
        }
        let (report, opening) = (library.report(0), library.opening().expect("open"));
        assert_eq!((report.bad_sector, report.failed, report.settings_lost), (Some(1), false, 0));
        assert_eq!((library.home(), opening.found), (StoredHome::Kept(home(5)), 4));
        assert!(opening.to_string().contains("sector 1 cannot be erased"), "{opening}");
    }
    // Where it can be erased at the third try all is well again.
    let (shared, answers) = run::<4, _>(Worn::new(&chip, 1, 2), &[Wish::Named(0, 8)]);
    assert_eq!(answers, [Some(Ok(()))]);
    assert_eq!(shared.library().report(0), link::StorageReport::default());
    let (shared, _) = run_on::<4>(&chip, &[]);
    assert_eq!(shared.library().image(0), Some(named(8).as_slice()));
    assert_eq!(shared.library().image(3), Some(newest.as_slice()));
}

#[test]
fn a_blank_sector_with_a_fallen_bit_that_cannot_be_erased_is_told_before_anybody_asks() {
    const SECTOR: u32 = 3;
    let mut content = library();
    let word = SECTOR as usize * SECTOR_BYTES + 100 * 32;
    assert!(content[word..word + 32].iter().all(|byte| *byte == 0xFF), "the sector is in use");
    content[word] &= !1;
    let (shared, _) = run::<4, _>(Worn::new(&chip(&content), SECTOR, u32::MAX), &[]);
    let library = shared.library();
    assert_eq!((library.report(0).bad_sector, library.report(0).failed), (Some(3), false));
    assert_eq!((library.image(0), library.home()), (Some(named(1).as_slice()), StoredHome::Kept(home(5))));
}
