//! The idle task: keeps the library on the flash when nothing else is to be done.

use core::convert::Infallible;
use core::pin::pin;
use core::task::{Context, Poll, Waker};

use device::StoreError;
use device::storage::{LibraryAccess, Opening, Work, keep};
use embedded_storage_async::nor_flash::NorFlash;
use rtic_core::Mutex;

use super::{ArmSession, Log, StorageScratch};

/// The library behind the session's lock: each call holds it for one copy of an image at most.
struct SharedLibrary<M, L> {
    session: M,
    log: L,
}

impl<M: Mutex<T = &'static mut ArmSession>, L: Log> LibraryAccess for SharedLibrary<M, L> {
    fn restore(&mut self, slot: u8, image: &[u8]) {
        self.session.lock(|session| session.store_mut().restore(slot, image));
    }

    fn forget(&mut self, slot: u8) {
        self.session.lock(|session| session.store_mut().forget(slot));
    }

    fn holds(&mut self, key: u8, bytes: &[u8]) -> bool {
        self.session.lock(|session| session.store_mut().holds(key, bytes))
    }

    fn lose(&mut self, slot: u8, head: &[u8]) {
        self.session.lock(|session| session.store_mut().lose(slot, head));
    }

    fn open(&mut self, opening: Opening) {
        self.session.lock(|session| session.store_mut().open(opening));
        self.log.storage(&opening);
    }

    fn fail(&mut self, error: StoreError) {
        let opening = self.session.lock(|session| {
            session.store_mut().fail(error);
            session.store_mut().opening()
        });
        if let Some(opening) = opening {
            self.log.storage(&opening);
        }
    }

    fn take(&mut self, image: &mut [u8]) -> Option<Work> {
        self.session.lock(|session| session.store_mut().take(image))
    }

    fn settle(&mut self, outcome: Result<(), StoreError>) {
        self.session.lock(|session| session.store_mut().settle(outcome));
    }
}

/// Opens the library and keeps it on the flash, for ever.
pub async fn keep_library<F: NorFlash>(
    flash: F,
    room: &mut StorageScratch,
    session: impl Mutex<T = &'static mut ArmSession>,
    log: impl Log,
) -> Infallible {
    keep(flash, room, &mut SharedLibrary { session, log }).await
}

/// Runs a processor that has nothing else to do: asks the `task` whether it can go on, and sleeps until the next
/// interrupt. Lower than every task, so it may take its time; slots make an interrupt every 1.1 ms, so nothing needs to
/// wake it.
pub fn rest(task: impl Future<Output = Infallible>, mut sleep: impl FnMut()) -> ! {
    let mut task = pin!(task);
    let mut context = Context::from_waker(Waker::noop());
    loop {
        let Poll::Pending = task.as_mut().poll(&mut context);
        sleep();
    }
}
