//! A device reduced to its library, on a flash whose power can fail.

use core::pin::pin;
use core::task::{Context, Poll, Waker};
use std::sync::{Arc, Mutex, MutexGuard};

use control::Payload;
use control::model::{LinkWeight, WeightCorrection};
use device::storage::{Library, LibraryAccess, Opening, Scratch, Work, keep, value_bytes};
use device::{Home, Store, StoreError};
use embedded_storage_async::nor_flash::NorFlash;
use flash::{Flash, FlashChip, FlashPort, FlashTimes, VirtualClock};
use link::Secret;

/// Bytes of the images here: as large as the device's.
pub(crate) const IMAGE: usize = 16_384;
const VALUE: usize = value_bytes(IMAGE);

/// The library, as the keeper sees it.
pub(crate) struct Shared<const SLOTS: usize>(Arc<Mutex<Library<SLOTS, IMAGE>>>);

impl<const SLOTS: usize> Shared<SLOTS> {
    pub(crate) fn library(&self) -> MutexGuard<'_, Library<SLOTS, IMAGE>> {
        self.0.lock().expect("no test panics while it holds the library")
    }
}

impl<const SLOTS: usize> LibraryAccess for Shared<SLOTS> {
    fn restore(&mut self, slot: u8, image: &[u8]) {
        self.library().restore(slot, image);
    }

    fn forget(&mut self, slot: u8) {
        self.library().forget(slot);
    }

    fn holds(&mut self, key: u8, bytes: &[u8]) -> bool {
        self.library().holds(key, bytes)
    }

    fn lose(&mut self, slot: u8, head: &[u8]) {
        self.library().lose(slot, head);
    }

    fn open(&mut self, opening: Opening) {
        self.library().open(opening);
    }

    fn fail(&mut self, error: StoreError) {
        self.library().fail(error);
    }

    fn take(&mut self, image: &mut [u8]) -> Option<Work> {
        self.library().take(image)
    }

    fn settle(&mut self, outcome: Result<(), StoreError>) {
        self.library().settle(outcome);
    }
}

/// A request of the host.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Wish {
    /// Store the image of this number at a place.
    Save(u8, u8),
    /// Store the image of this number at a place, with the head of one that has a name.
    Named(u8, u8),
    /// Store [`TINY`] at a place.
    Tiny(u8),
    Delete(u8),
    /// Let the image at a place begin with another number, as a rename does with its name.
    Rename(u8, u8),
    /// Keep the weight of this number.
    Weight(u8),
    /// Keep the home of this number.
    Home(u8),
    ForgetHome,
    /// Keep the secret of this number.
    Secret(u8),
    ForgetSecret,
}

/// A weight made of its number.
pub(crate) fn weight(number: u8) -> WeightCorrection {
    let link = LinkWeight { share: f32::from(number) / 1000.0, shift: [0.01, -0.02, f32::from(number) / 10_000.0] };
    WeightCorrection::new(Payload::SensorAndHand, [link; 7]).expect("an arm can weigh that")
}

/// A home made of its number.
pub(crate) fn home(number: u8) -> Home {
    let turn = f32::from(number) / 1000.0;
    Home::new([turn, turn - 1.95, -turn, 3.1 - turn, turn, -turn, 0.02]).expect("within the bounds")
}

/// A secret made of its number.
pub(crate) fn secret(number: u8) -> Secret {
    Secret::new([number; 16])
}

/// An image of a few bytes.
pub(crate) const TINY: [u8; 20] = [250; 20];

/// An image made of its number, of a length that depends on it.
pub(crate) fn image(number: u8) -> Vec<u8> {
    let length = IMAGE - usize::from(number) * 61;
    (0..length).map(|place| number ^ (place as u8).wrapping_mul(31)).collect()
}

/// An image whose head has the name "image-NUMBER".
pub(crate) fn named(number: u8) -> Vec<u8> {
    let mut image = image(number);
    image[..16].copy_from_slice(b"TACP\x01\x00\x00\x00\x01\x02\x03\x04\x05\x06\x07\x08");
    image[16..48].fill(0);
    let name = format!("image-{number}");
    image[16..16 + name.len()].copy_from_slice(name.as_bytes());
    image
}

/// Starts the device on this flash, has it fulfil the wishes one after the other, and gives its library and the
/// answers. `None` in place of an answer: power failed before it came.
pub(crate) fn run<const SLOTS: usize, F: NorFlash>(
    flash: F,
    wishes: &[Wish],
) -> (Shared<SLOTS>, Vec<Option<Result<(), StoreError>>>) {
    let shared = Shared(Arc::new(Mutex::new(Library::<SLOTS, IMAGE>::new())));
    let mut room = Box::new(Scratch::<IMAGE, VALUE>::new());
    let mut library = Shared(Arc::clone(&shared.0));
    let mut keeper = pin!(keep(flash, &mut room, &mut library));
    let mut context = Context::from_waker(Waker::noop());
    let mut answers = Vec::new();
    let mut step = || {
        let Poll::Pending = keeper.as_mut().poll(&mut context);
    };
    // A flash that takes no time leaves only pauses: one for each value read, and then the wait for work.
    (0..2000).for_each(|_| step());
    for wish in wishes {
        if !shared.library().is_open() {
            answers.push(None);
            continue;
        }
        let asked = match *wish {
            Wish::Save(slot, number) => save(&mut shared.library(), slot, &image(number)),
            Wish::Named(slot, number) => save(&mut shared.library(), slot, &named(number)),
            Wish::Tiny(slot) => save(&mut shared.library(), slot, &TINY),
            Wish::Delete(slot) => shared.library().delete(slot),
            Wish::Rename(slot, number) => rename(&mut shared.library(), slot, number),
            Wish::Weight(number) => shared.library().keep_weight(&weight(number)),
            Wish::Home(number) => shared.library().keep_home(&home(number)),
            Wish::ForgetHome => shared.library().forget_home(),
            Wish::Secret(number) => shared.library().keep_secret(&secret(number)),
            Wish::ForgetSecret => shared.library().forget_secret(),
        };
        if let Err(error) = asked {
            answers.push(Some(Err(error)));
            continue;
        }
        (0..4).for_each(|_| step());
        answers.push(shared.library().finished());
    }
    (shared, answers)
}

fn save<const SLOTS: usize>(library: &mut Library<SLOTS, IMAGE>, slot: u8, image: &[u8]) -> Result<(), StoreError> {
    library.begin(image.len())?;
    library.write(0, image)?;
    library.commit(slot)
}

fn rename<const SLOTS: usize>(library: &mut Library<SLOTS, IMAGE>, slot: u8, number: u8) -> Result<(), StoreError> {
    device::stage_copy(library, slot, &[number])?;
    library.commit(slot)
}

/// The image of one number after it was made to begin with another.
pub(crate) fn renamed(number: u8, to: u8) -> Vec<u8> {
    let mut image = image(number);
    image[0] = to;
    let (covered, sum) = image.split_last_chunk_mut::<4>().expect("longer than its check sum");
    *sum = link::frame::CRC.checksum(covered).to_le_bytes();
    image
}

/// As [`run`], on a simulated chip.
pub(crate) fn run_on<const SLOTS: usize>(
    chip: &FlashChip,
    wishes: &[Wish],
) -> (Shared<SLOTS>, Vec<Option<Result<(), StoreError>>>) {
    run(FlashPort::new(chip.clone(), VirtualClock::default()), wishes)
}

/// A chip with this content, power on.
pub(crate) fn chip(content: &[u8]) -> FlashChip {
    FlashChip::new(Flash::with_content(content.to_vec(), FlashTimes::NONE))
}

/// A library that has it store these bytes as home, weight or secret, whatever they are.
struct Forger<'a>(Option<(u8, &'a [u8])>);

impl LibraryAccess for Forger<'_> {
    fn restore(&mut self, _: u8, _: &[u8]) {}

    fn forget(&mut self, _: u8) {}

    fn holds(&mut self, _: u8, _: &[u8]) -> bool {
        true
    }

    fn lose(&mut self, _: u8, _: &[u8]) {}

    fn open(&mut self, _: Opening) {}

    fn fail(&mut self, error: StoreError) {
        panic!("{error:?}");
    }

    fn take(&mut self, room: &mut [u8]) -> Option<Work> {
        let (slot, bytes) = self.0.take()?;
        room[..bytes.len()].copy_from_slice(bytes);
        Some(Work::Save { slot, length: bytes.len() })
    }

    fn settle(&mut self, outcome: Result<(), StoreError>) {
        assert_eq!(outcome, Ok(()));
    }
}

/// Stores these bytes on the chip under the key of a setting.
pub(crate) fn write_setting(chip: &FlashChip, key: u8, bytes: &[u8]) {
    let mut room = Box::new(Scratch::<IMAGE, VALUE>::new());
    let mut forger = Forger(Some((key, bytes)));
    let port = FlashPort::new(chip.clone(), VirtualClock::default());
    let mut keeper = pin!(keep(port, &mut room, &mut forger));
    let mut context = Context::from_waker(Waker::noop());
    for _ in 0..2000 {
        let Poll::Pending = keeper.as_mut().poll(&mut context);
    }
}
