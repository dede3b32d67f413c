//! Power fails in the middle of every single word and sector, and every restart finds the old or the new.

use device::{Store, StoredHome, StoredSecret, StoredWeight};
use flash::FlashChip;

use crate::bench::{TINY, Wish, chip, home, image, renamed, run_on, secret, weight};

/// Places of the library here.
const SLOTS: usize = 4;

/// Times that the rest of a torn word is drawn for each word; there are a thousand words.
const WORD_DRAWS: u64 = 1;

/// Times that the rest of a torn erase is drawn for each erase: at least twice each of its kinds.
const ERASE_DRAWS: u64 = 24;

/// Number of the image that is renamed, and what it begins with then.
const RENAMED: (u8, u8) = (41, 210);

/// Content of the flash, by number.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Content {
    images: [Option<u8>; SLOTS],
    home: Option<u8>,
    weight: Option<u8>,
    secret: Option<u8>,
}

const EMPTY: Content = Content { images: [None; SLOTS], home: None, weight: None, secret: None };

/// The library on a chip after a start.
fn found(chip: &FlashChip) -> Content {
    let (library, _) = run_on::<SLOTS>(chip, &[]);
    let library = library.library();
    assert!(library.is_open(), "the device did not open its storage");
    let images = std::array::from_fn(|slot| {
        let bytes = library.image(slot as u8)?;
        // An image begins with its number.
        let is_ours = bytes == image(bytes[0]) || bytes == TINY || bytes == renamed(RENAMED.0, RENAMED.1);
        assert!(is_ours, "an image that nobody ever stored");
        Some(bytes[0])
    });
    let home = match library.home() {
        StoredHome::Nothing => None,
        StoredHome::Kept(kept) => Some((0..=255).find(|number| home(*number) == kept).expect("one of ours")),
        other => panic!("the home is {other:?}"),
    };
    let weight = match library.weight() {
        StoredWeight::Nothing => None,
        StoredWeight::Kept(kept) => Some((0..=255).find(|number| weight(*number) == kept).expect("one of ours")),
        other => panic!("the weight is {other:?}"),
    };
    let secret = match library.secret() {
        StoredSecret::Nothing => None,
        StoredSecret::Kept(kept) => Some((0..=255).find(|number| secret(*number) == kept).expect("one of ours")),
        StoredSecret::Unreadable => panic!("the secret cannot be read"),
    };
    Content { images, home, weight, secret }
}

fn content(chip: &FlashChip) -> Vec<u8> {
    chip.lock().content().to_vec()
}

/// Has a device fulfil all wishes on a chip with this content; what the chip holds then.
fn after(before: &[u8], wishes: &[Wish]) -> Vec<u8> {
    let chip = chip(before);
    let (_, answers) = run_on::<SLOTS>(&chip, wishes);
    assert!(answers.iter().all(|answer| *answer == Some(Ok(()))), "{answers:?}");
    content(&chip)
}

/// Which operations of a wish are erases.
fn erases_of(before: &[u8], wish: Wish, operations: u64) -> Vec<u64> {
    let count = |operation: u64| {
        let chip = chip(before);
        chip.lock().cut_power_at(operation, 0);
        run_on::<SLOTS>(&chip, &[wish]);
        let flash = chip.lock();
        flash.erases().iter().sum::<u32>()
    };
    // Erases so far never grow less: each is found by halving.
    let mut found = Vec::new();
    let mut from = 0;
    while from < operations && count(operations - 1) > found.len() as u32 {
        let (mut low, mut high) = (from, operations - 1);
        while low < high {
            let middle = (low + high) / 2;
            if count(middle) > found.len() as u32 { high = middle } else { low = middle + 1 }
        }
        found.push(low);
        from = low + 1;
    }
    found
}

/// Fulfils `wish` with power failing at each of its operations, then starts again, with power failing at each operation
/// of that start too. Returns how many cuts were tried.
fn cut_everywhere(before: &[u8], wish: Wish) -> usize {
    let old = found(&chip(before));
    let mut new = old;
    let mut put = |slot: u8, number| {
        new.images[usize::from(slot)] = number;
        slot
    };
    // The place that is written to afterwards, to see that everything works on.
    let slot = match wish {
        Wish::Save(slot, number) => put(slot, Some(number)),
        Wish::Named(slot, _) => put(slot, Some(b'T')),
        Wish::Tiny(slot) => put(slot, Some(TINY[0])),
        Wish::Delete(slot) => put(slot, None),
        Wish::Rename(slot, number) => put(slot, Some(number)),
        Wish::Weight(number) => {
            new.weight = Some(number);
            0
        }
        Wish::Home(number) => {
            new.home = Some(number);
            0
        }
        Wish::ForgetHome => {
            new.home = None;
            0
        }
        Wish::Secret(number) => {
            new.secret = Some(number);
            0
        }
        Wish::ForgetSecret => {
            new.secret = None;
            0
        }
    };
    let whole = chip(before);
    let (_, answers) = run_on::<SLOTS>(&whole, &[wish]);
    assert_eq!(answers, [Some(Ok(()))]);
    assert_eq!(found(&whole), new, "without any cut");
    let operations = whole.lock().operations();
    let erases = erases_of(before, wish, operations);
    let mut cuts = 0;
    for operation in 0..operations {
        let draws = if erases.contains(&operation) { ERASE_DRAWS } else { WORD_DRAWS };
        for draw in 0..draws {
            let chip = chip(before);
            chip.lock().cut_power_at(operation, operation * 31 + draw);
            let (_, answers) = run_on::<SLOTS>(&chip, &[wish]);
            assert_eq!(answers, [None], "answered although power failed in operation {operation}");
            cuts += 1;
            let torn = content(&chip);
            chip.lock().restart();
            let before_start = chip.lock().operations();
            let now = found(&chip);
            let start_operations = chip.lock().operations() - before_start;
            assert!(now == old || now == new, "cut {operation}, draw {draw}: {now:?} is neither {old:?} nor {new:?}");
            cuts += cut_the_start(&torn, old, new, operation, start_operations);
            // And it works on. Most words are alike: every eighth cut is followed up.
            if draws == ERASE_DRAWS || operation % 8 == 0 {
                let again = after(&content(&chip), &[Wish::Save(slot, 200), Wish::Save((slot + 1) % 4, 201)]);
                let now = found(&self::chip(&again));
                assert_eq!(now.images[usize::from(slot)], Some(200), "cut {operation}, draw {draw}: does not work on");
                assert!([old.home, new.home].contains(&now.home), "cut {operation}, draw {draw}: {now:?} later");
                assert!([old.weight, new.weight].contains(&now.weight), "cut {operation}, draw {draw}: {now:?} later");
                assert!([old.secret, new.secret].contains(&now.secret), "cut {operation}, draw {draw}: {now:?} later");
            }
        }
    }
    println!("{operations} operations, {} of them erases; {cuts} cuts, {cuts} times the old or the new", erases.len());
    cuts
}

/// Power fails again in each of the operations with which the device puts its flash in order.
fn cut_the_start(torn: &[u8], old: Content, new: Content, first: u64, operations: u64) -> usize {
    for operation in 0..operations {
        let chip = chip(torn);
        chip.lock().cut_power_at(operation, first ^ operation);
        run_on::<SLOTS>(&chip, &[]);
        chip.lock().restart();
        let now = found(&chip);
        assert!(now == old || now == new, "cut {first}, then {operation} of the start: {now:?}");
    }
    usize::try_from(operations).expect("few")
}

/// A flash that has been written all around, so that the next image needs a sector that still holds images: places 0,
/// 1, 2 with images 40, 41, 42 of which the oldest stands in the sector to be emptied, as does the home, 7.
fn crowded() -> Vec<u8> {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let mut before = after(&blank, &[Wish::Home(7), Wish::Save(0, 40), Wish::Save(1, 41), Wish::Save(2, 42)]);
    // Place 3 is written over and over, until the next image would be the first to erase.
    for number in 0_u8.. {
        let wish = Wish::Save(3, number % 64);
        let trial = chip(&before);
        run_on::<SLOTS>(&trial, &[wish]);
        if trial.lock().erases().iter().sum::<u32>() > 0 {
            return before;
        }
        before = content(&trial);
    }
    unreachable!("a flash that never needs an erase")
}

#[test]
fn power_fails_at_every_word_of_an_upload_that_replaces_and_the_old_or_the_new_is_there() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let before = after(&blank, &[Wish::Save(0, 1), Wish::Save(1, 2), Wish::Save(2, 3)]);
    let cuts = cut_everywhere(&before, Wish::Save(1, 9));
    assert!(cuts > 490 * WORD_DRAWS as usize, "{cuts} cuts are too few for an image of 16 kB in words of 32 bytes");
}

#[test]
fn power_fails_at_every_operation_of_an_upload_that_needs_an_erase_and_the_old_or_the_new_is_there() {
    let before = crowded();
    let cuts = cut_everywhere(&before, Wish::Save(1, 9));
    assert!(cuts > 1000 * WORD_DRAWS as usize, "{cuts} cuts: the images in the emptied sector were not copied");
}

#[test]
fn power_fails_at_every_operation_of_a_delete_and_the_image_is_there_or_gone() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let before = after(&blank, &[Wish::Save(0, 1), Wish::Save(1, 2), Wish::Save(2, 3)]);
    let cuts = cut_everywhere(&before, Wish::Delete(1));
    assert!(cuts >= 2 * WORD_DRAWS as usize);
}

#[test]
fn power_fails_at_every_operation_of_a_delete_that_needs_an_erase_and_the_image_is_there_or_gone() {
    // An image of a few bytes takes as much room as the note that one was deleted: fill the sector with such.
    let cuts = cut_everywhere(&full_for(Wish::Tiny(3)), Wish::Delete(0));
    assert!(cuts > 500, "{cuts} cuts: no sector was emptied");
}

#[test]
fn power_fails_at_every_word_of_a_rename_and_the_image_has_the_old_name_or_the_new() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let before = after(&blank, &[Wish::Save(0, 1), Wish::Save(1, RENAMED.0), Wish::Save(2, 3)]);
    let cuts = cut_everywhere(&before, Wish::Rename(1, RENAMED.1));
    let words = image(RENAMED.0).len() / 32;
    assert!(cuts > words * WORD_DRAWS as usize, "{cuts} cuts are too few for an image of {words} words");
}

#[test]
fn power_fails_at_every_operation_of_a_rename_that_needs_an_erase_and_the_image_has_the_old_name_or_the_new() {
    let cuts = cut_everywhere(&crowded(), Wish::Rename(1, RENAMED.1));
    assert!(cuts > 1000 * WORD_DRAWS as usize, "{cuts} cuts: the images in the emptied sector were not copied");
}

/// A crowded flash in which what is left of the sector is filled with small images, until this wish would need an
/// erase.
fn full_for(wish: Wish) -> Vec<u8> {
    let mut before = crowded();
    loop {
        let trial = chip(&before);
        run_on::<SLOTS>(&trial, &[wish]);
        if trial.lock().erases().iter().sum::<u32>() > 0 {
            return before;
        }
        before = after(&before, &[Wish::Tiny(3)]);
    }
}

#[test]
fn power_fails_at_every_word_of_a_calibration_and_the_old_home_or_the_new_is_there() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let mut cuts = 0;
    for before in [vec![], vec![Wish::Home(3)], vec![Wish::Home(3), Wish::ForgetHome]] {
        let before = [vec![Wish::Save(0, 1), Wish::Save(1, 2)], before].concat();
        let before = after(&blank, &before);
        for wish in [Wish::Home(4), Wish::Home(5), Wish::ForgetHome] {
            cuts += cut_everywhere(&before, wish);
        }
    }
    // Home: head and 45 bytes in words of 32. Forgotten: head and one byte.
    assert!(cuts >= 3 * (3 + 3 + 2), "{cuts} cuts");
}

#[test]
fn power_fails_at_every_word_of_a_weighing_and_the_old_weight_or_the_new_is_there() {
    let before = after(&vec![0xFF; flash::FLASH_BYTES], &[Wish::Save(0, 1), Wish::Home(3), Wish::Weight(6)]);
    let cuts = cut_everywhere(&before, Wish::Weight(8));
    // Head and 129 bytes in words of 32.
    assert!(cuts >= 6, "{cuts} cuts");
}

#[test]
fn power_fails_at_every_word_of_a_change_of_the_secret_and_the_old_one_or_the_new_is_there() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let others = [Wish::Save(0, 1), Wish::Home(3), Wish::Weight(6)];
    let without = after(&blank, &others);
    let with = after(&without, &[Wish::Secret(5)]);
    for (before, wish) in [(&without, Wish::Secret(8)), (&with, Wish::Secret(8)), (&with, Wish::ForgetSecret)] {
        let cuts = cut_everywhere(before, wish);
        assert!(cuts >= 2, "{cuts} cuts");
    }
}

#[test]
fn power_fails_at_every_operation_of_a_calibration_that_needs_an_erase_and_the_old_home_or_the_new_is_there() {
    let cuts = cut_everywhere(&full_for(Wish::Home(9)), Wish::Home(9));
    assert!(cuts > 500, "{cuts} cuts: no sector was emptied");
}

#[test]
fn power_fails_at_every_operation_of_the_first_start_and_the_flash_becomes_ours() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let foreign: Vec<u8> = (0..flash::FLASH_BYTES).map(|place| (place / 7) as u8).collect();
    for before in [blank, foreign] {
        let whole = chip(&before);
        assert_eq!(found(&whole), EMPTY);
        let operations = whole.lock().operations();
        for operation in 0..operations {
            for draw in 0..8 {
                let chip = chip(&before);
                chip.lock().cut_power_at(operation, draw);
                run_on::<SLOTS>(&chip, &[]);
                chip.lock().restart();
                assert_eq!(found(&chip), EMPTY);
                let now = after(&content(&chip), &[Wish::Save(0, 5), Wish::Home(6)]);
                let now = found(&self::chip(&now));
                assert_eq!((now.images[0], now.home), (Some(5), Some(6)));
            }
        }
    }
}

#[test]
fn a_deleted_image_stays_deleted_however_often_its_sector_is_emptied() {
    let blank = vec![0xFF; flash::FLASH_BYTES];
    let mut now = after(&blank, &[Wish::Home(3), Wish::Save(0, 1), Wish::Save(1, 2), Wish::Delete(1)]);
    for number in 0..120 {
        now = after(&now, &[Wish::Save(2, number)]);
        let expected =
            Content { images: [Some(1), None, Some(number), None], home: Some(3), weight: None, secret: None };
        assert_eq!(found(&chip(&now)), expected);
    }
}

#[test]
fn wear_is_spread_over_the_sectors_of_the_log() {
    let chip = chip(&vec![0xFF; flash::FLASH_BYTES]);
    let wishes: Vec<_> = (0..420).map(|count| Wish::Save(0, (count % 50) as u8)).collect();
    let (_, answers) = run_on::<SLOTS>(&chip, &wishes);
    assert!(answers.iter().all(|answer| *answer == Some(Ok(()))));
    let flash = chip.lock();
    let log = &flash.erases()[..6];
    let (least, most) = (log.iter().min(), log.iter().max());
    println!("erases after 420 uploads: {:?}", flash.erases());
    assert!(most.zip(least).is_some_and(|(most, least)| most - least <= 1), "{log:?}");
}
