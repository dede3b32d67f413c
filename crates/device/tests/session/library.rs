//! The library: renaming what is stored, beside runs, uploads and other changes.

use control::State;
use device::storage::{Library, Opening, Work};
use device::{Store as _, StoreError};
use link::image::stored_crc;
use link::{Name, PrimitiveImage, Refusal, Reply, Request, RunOptions};

use crate::rig::{Rig, SLOT_BYTES, SLOTS, image};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn rename(from: &str, to: &str) -> Request {
    Request::Rename { name: name(from), to: name(to) }
}

fn run(text: &str) -> Request {
    Request::Run { name: name(text), options: RunOptions::default() }
}

#[test]
fn a_renamed_primitive_is_the_image_that_would_have_been_uploaded_under_that_name() {
    let mut rig = Rig::greeted();
    rig.store("first", &image("first", 3.0, 20));
    rig.store("reach", &image("reach", 5.0, 7));
    rig.done(rename("first", "a-name-of-thirty-two-characters_"));
    let expected = image("a-name-of-thirty-two-characters_", 3.0, 20);
    assert_eq!(rig.session.store().image(0), Some(expected.as_slice()));
    let Some(Reply::Listing { listing: Some(listing), .. }) = rig.ask(Request::List { index: 0 }) else { panic!() };
    assert_eq!((listing.name.as_str(), listing.crc), ("a-name-of-thirty-two-characters_", stored_crc(&expected)));
    assert_eq!(rig.refused(run("first")).0, Refusal::NoSuchPrimitive);
    // A shorter name leaves nothing of the longer one.
    rig.done(rename("a-name-of-thirty-two-characters_", "f"));
    assert_eq!(rig.session.store().image(0), Some(image("f", 3.0, 20).as_slice()));
    rig.commanded(run("f"));
    assert_eq!(rig.bench.loaded.last(), Some(&3.0));
}

#[test]
fn a_rename_to_a_name_that_is_taken_or_of_one_that_is_not_there_is_refused() {
    let mut rig = Rig::greeted();
    rig.store("first", &image("first", 3.0, 20));
    rig.store("reach", &image("reach", 5.0, 7));
    assert_eq!(rig.refused(rename("first", "reach")).0, Refusal::NameTaken);
    assert_eq!(rig.refused(rename("first", "first")).0, Refusal::NameTaken);
    assert_eq!(rig.refused(rename("third", "fourth")).0, Refusal::NoSuchPrimitive);
    assert_eq!(rig.names(), ["first", "reach"]);
}

#[test]
fn a_primitive_in_use_is_not_renamed() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.commanded(run("reach"));
    rig.bench.state = State::Run;
    assert_eq!(rig.refused(rename("reach", "grasp")).0, Refusal::InUse);
    rig.bench.state = State::Hold;
    rig.done(rename("reach", "grasp"));
    assert_eq!(rig.names(), ["grasp"]);
    // The one that was in use has gone with its name: the next run loads what is stored.
    rig.commanded(run("grasp"));
    assert_eq!(rig.bench.loaded.len(), 2);
}

#[test]
fn a_damaged_image_is_not_given_a_good_check_sum_by_a_new_name() {
    let mut rig = Rig::greeted();
    let mut bytes = image("reach", 3.0, 10);
    rig.store("reach", &bytes);
    bytes[900] ^= 4;
    let store = rig.session.store_mut();
    store.begin(bytes.len()).unwrap();
    store.write(0, &bytes).unwrap();
    store.commit(0).unwrap();
    assert_eq!(store.finished(), Some(Ok(())));
    assert_eq!(rig.refused(rename("reach", "grasp")).0, Refusal::ImageInvalid);
    assert_eq!(rig.names(), ["reach"]);
    assert_eq!(rig.session.store().staged(), None);
}

#[test]
fn a_rename_forgets_an_upload_under_way_for_it_needs_its_place() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.send_parts("other", &image("other", 5.0, 10));
    rig.done(rename("reach", "grasp"));
    assert_eq!(rig.refused(Request::UploadCommit).0, Refusal::NoUpload);
    assert_eq!(rig.names(), ["grasp"]);
}

#[test]
fn a_rename_is_answered_when_the_flash_has_it_and_runs_wait_for_that() {
    let mut library = Library::<SLOTS, SLOT_BYTES>::new();
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    let mut copy = [0; SLOT_BYTES];
    rig.send_parts("reach", &image("reach", 3.0, 10));
    assert_eq!(rig.ask(Request::UploadCommit), None);
    rig.session.store_mut().take(&mut copy).unwrap();
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    for outcome in [Err(StoreError::Medium), Ok(())] {
        assert_eq!(rig.ask(rename("reach", "grasp")), None, "answered before anything was written");
        let of = rig.sequence;
        let work = rig.session.store_mut().take(&mut copy);
        let Some(Work::Save { slot: 0, length }) = work else { panic!("{work:?}") };
        assert_eq!(PrimitiveImage::parse(&copy[..length]).unwrap().name().as_str(), "grasp");
        // Under its old name it must not begin to run any more, and there is no other change of the store meanwhile.
        assert_eq!(rig.refused(run("reach")), (Refusal::StoreFailed, [StoreError::Busy.code(), 0]));
        assert_eq!(rig.refused(rename("reach", "third")), (Refusal::StoreFailed, [StoreError::Busy.code(), 0]));
        rig.session.store_mut().settle(outcome);
        rig.poll();
        let answers: Vec<_> = rig.sent().into_iter().filter(|frame| frame.message.answers() == Some(of)).collect();
        assert_eq!(matches!(answers[0].message, Reply::Accepted { .. }), outcome.is_ok());
        assert_eq!(rig.names(), [if outcome.is_ok() { "grasp" } else { "reach" }]);
    }
}
