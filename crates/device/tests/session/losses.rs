//! Which images the store has lost, as a host is told.

use device::storage::{Library, Opening, Work};
use link::{Name, Refusal, Reply, Request, RunOptions};

use crate::rig::{Rig, SLOT_BYTES, SLOTS, image};

/// A session over a library of which these images were read.
fn restored(images: &[Vec<u8>]) -> Rig<Library<SLOTS, SLOT_BYTES>> {
    let mut library = Library::new();
    for (slot, image) in images.iter().enumerate() {
        library.restore(slot as u8, image);
    }
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    rig
}

/// The lost image of a place, if any, with its name, and the number of all that are lost.
fn loss<S: device::Store>(rig: &mut Rig<S>, place: u8) -> (Option<Option<String>>, u8) {
    match rig.ask(Request::Storage { place }) {
        Some(Reply::Storage { storage, .. }) => {
            (storage.loss.map(|loss| loss.name.map(|name| name.to_string())), storage.lost)
        }
        other => panic!("no report but {other:?}"),
    }
}

#[test]
fn h11_an_image_that_was_read_and_is_not_sound_is_missed_unless_its_name_stands_elsewhere() {
    let mut damaged = image("reach", 3.0, 10);
    damaged[500] ^= 4;
    let mut rig = restored(&[damaged.clone(), image("push", 3.0, 10)]);
    assert_eq!(loss(&mut rig, 0), (Some(Some("reach".to_owned())), 1));
    assert_eq!((loss(&mut rig, 1), loss(&mut rig, 2)), ((None, 1), (None, 1)));
    let mut rig = restored(&[damaged, image("reach", 3.0, 10)]);
    assert_eq!((loss(&mut rig, 0), loss(&mut rig, 1)), ((None, 0), (None, 0)));
    assert_eq!(rig.refused(Request::Storage { place: SLOTS as u8 }), (Refusal::NoSuchPrimitive, [SLOTS as u32, 0]));
}

#[test]
fn h11_of_two_images_of_one_name_the_one_is_believed_whose_place_has_lost_nothing() {
    // "reach" was renamed to "reach-old", and another "reach" came to place 1. Then the renamed one was damaged: the
    // image of before stands at place 0 again, under the name that is another one's by now.
    let mut library = Library::<SLOTS, SLOT_BYTES>::new();
    let (before, now) = (image("reach", 3.0, 10), image("reach", 5.0, 10));
    library.restore(0, &before);
    library.restore(1, &now);
    library.lose(0, &image("reach-old", 3.0, 10));
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    assert_eq!(rig.names(), ["reach"]);
    rig.commanded(Request::Run { name: Name::new("reach").unwrap(), options: RunOptions::default() });
    assert_eq!(rig.bench.loaded, [5.0]);
    // Nobody is told that an image of before is used, and the place is free for others.
    assert_eq!(loss(&mut rig, 0), (Some(Some("reach-old".to_owned())), 1));
    let Some(Reply::Storage { storage, .. }) = rig.ask(Request::Storage { place: 0 }) else { panic!() };
    assert!(!storage.loss.unwrap().older);
    // Deleted, it does not come back as the one of before.
    assert_eq!(rig.ask(Request::Delete { name: Name::new("reach").unwrap() }), None);
    assert!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]).is_some());
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    assert_eq!(rig.names(), Vec::<String>::new());
}

/// The change that makes it fail: the first free place is taken, and nobody is told any more what was lost there.
#[test]
fn h11_an_image_of_a_new_name_takes_the_place_of_a_lost_one_only_where_there_is_no_other() {
    let mut damaged = image("reach", 3.0, 10);
    damaged[500] ^= 4;
    let mut rig = restored(&[damaged, image("push", 3.0, 10)]);
    for (name, slot) in [("grasp", 2), ("last", 0)] {
        rig.send_parts(name, &image(name, 3.0, 10));
        assert_eq!(rig.ask(Request::UploadCommit), None);
        let work = rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
        assert!(matches!(work, Some(Work::Save { slot: place, .. }) if place == slot), "{work:?}");
        rig.session.store_mut().settle(Ok(()));
        rig.poll();
        let missed = if slot == 0 { (None, 0) } else { (Some(Some("reach".to_owned())), 1) };
        assert_eq!(loss(&mut rig, 0), missed, "{name}");
    }
    assert_eq!(rig.names(), ["last", "push", "grasp"]);
}
