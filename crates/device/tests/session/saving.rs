//! A change of the store is answered when it is durable, and not before; everything else goes on meanwhile.

use control::State;
use device::storage::{Library, Opening, Work};
use device::{Command, Store as _, StoreError};
use link::{Name, PrimitiveImage, Refusal, Reply, Request};

use crate::rig::{SLOT_BYTES, SLOTS, hello, image, image_with};

type Rig = crate::rig::Rig<Library<SLOTS, SLOT_BYTES>>;

/// A session over a library whose flash is this test.
fn rig() -> Rig {
    let mut library = Library::new();
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    rig
}

#[test]
fn h6_a_stop_does_not_wait_for_the_storage_that_is_read() {
    // Younger than the second after which a session begins whatever the storage does.
    let mut rig: Rig = Rig::over(Library::new());
    rig.now_ms = 500;
    assert_eq!(rig.ask(Request::Hello(hello())), None, "it waits");
    assert_eq!(rig.ask(Request::Stop), None);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
    rig.session.store_mut().open(Opening::default());
    let replies = said(&mut rig);
    assert!(matches!(replies[..], [Reply::Hello { .. }]), "{replies:?}");
}

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

/// Replies of the session in its next poll.
fn said(rig: &mut Rig) -> Vec<Reply> {
    rig.poll();
    rig.sent().into_iter().map(|frame| frame.message).collect()
}

fn accepted(reply: Option<Reply>) -> bool {
    matches!(reply, Some(Reply::Accepted { .. }))
}

#[test]
fn a_commit_is_answered_when_the_flash_has_it_and_pings_meanwhile() {
    let mut rig = rig();
    let reach = image("reach", 2.0, 10);
    rig.send_parts("reach", &reach);
    assert_eq!(rig.ask(Request::UploadCommit), None, "answered before anything was written");
    let mut copy = [0; SLOT_BYTES];
    let work = rig.session.store_mut().take(&mut copy);
    assert_eq!(work, Some(Work::Save { slot: 0, length: reach.len() }));
    assert_eq!(copy[..reach.len()], reach);
    let commit = rig.sequence;
    assert!(accepted(rig.ask(Request::Ping)));
    assert!(accepted(rig.ask(Request::Telemetry { every: 1 })));
    assert!(matches!(rig.ask(Request::List { index: 0 }), Some(Reply::Listing { listing: None, .. })));
    rig.session.store_mut().settle(Ok(()));
    let replies = said(&mut rig);
    assert!(replies.iter().any(|reply| *reply == Reply::Accepted { of: commit }), "{replies:?}");
    assert!(matches!(rig.ask(Request::List { index: 0 }), Some(Reply::Listing { listing: Some(_), .. })));
}

#[test]
fn h9_a_commit_that_is_worked_on_may_be_repeated_as_a_sign_of_life() {
    let mut rig = rig();
    rig.send_parts("reach", &image("reach", 2.0, 10));
    rig.bench.state = State::Run;
    assert_eq!(rig.ask(Request::UploadCommit), None);
    for _ in 0..10 {
        rig.wait(90);
        rig.put(rig.sequence, 0, &Request::UploadCommit);
    }
    assert!(rig.bench.commands.is_empty(), "{:?}", rig.bench.commands);
}

#[test]
fn a_flash_that_fails_refuses_the_commit_and_the_old_image_stays() {
    let mut rig = rig();
    let (old, new) = (image("reach", 2.0, 10), image("reach", 3.0, 10));
    for (image, outcome) in [(&old, Ok(())), (&new, Err(StoreError::Medium))] {
        rig.send_parts("reach", image);
        assert_eq!(rig.ask(Request::UploadCommit), None);
        rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
        rig.session.store_mut().settle(outcome);
        let replies = said(&mut rig);
        let refused = replies.iter().any(|reply| matches!(reply, Reply::Refused { reason: Refusal::StoreFailed, .. }));
        assert_eq!(refused, outcome.is_err(), "{replies:?}");
    }
    assert_eq!(rig.session.store().image(0), Some(old.as_slice()));
}

#[test]
fn a_second_upload_must_wait_for_the_first_to_be_durable() {
    let mut rig = rig();
    rig.send_parts("one", &image("one", 2.0, 10));
    assert_eq!(rig.ask(Request::UploadCommit), None);
    let two = image("two", 2.0, 10);
    let crc = PrimitiveImage::parse(&two).unwrap().crc();
    let begin = Request::UploadBegin { name: name("two"), length: two.len() as u32, crc };
    let refused = rig.ask(begin.clone());
    let busy = [StoreError::Busy.code(), 0];
    assert!(
        matches!(refused, Some(Reply::Refused { reason: Refusal::StoreFailed, detail, .. }) if detail == busy),
        "{refused:?}"
    );
    rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    assert!(accepted(rig.ask(begin)));
}

#[test]
fn a_host_that_leaves_in_the_middle_of_a_commit_does_not_undo_it() {
    let mut rig = rig();
    let reach = image("reach", 2.0, 10);
    rig.send_parts("reach", &reach);
    assert_eq!(rig.ask(Request::UploadCommit), None);
    rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
    assert!(accepted(rig.ask(Request::Goodbye)));
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    rig.greet();
    assert!(matches!(rig.ask(Request::List { index: 0 }), Some(Reply::Listing { listing: Some(_), .. })));
}

#[test]
fn a_commit_that_meets_a_busy_storage_can_be_asked_for_again_whatever_becomes_of_the_other_change() {
    for deleted in [Ok(()), Err(StoreError::Full)] {
        let mut rig = rig();
        rig.send_parts("one", &image("one", 2.0, 10));
        assert_eq!(rig.ask(Request::UploadCommit), None);
        rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
        rig.session.store_mut().settle(Ok(()));
        rig.poll();
        rig.send_parts("two", &image("two", 2.0, 10));
        assert_eq!(rig.ask(Request::Delete { name: name("one") }), None);
        let refused = rig.ask(Request::UploadCommit);
        let busy = [StoreError::Busy.code(), 0];
        assert!(
            matches!(refused, Some(Reply::Refused { reason: Refusal::StoreFailed, detail, .. }) if detail == busy),
            "{refused:?}"
        );
        assert_eq!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]), Some(Work::Delete { slot: 0 }));
        rig.session.store_mut().settle(deleted);
        rig.poll();
        assert_eq!(rig.ask(Request::UploadCommit), None, "it waits for the flash");
        assert!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]).is_some());
        rig.session.store_mut().settle(Ok(()));
        rig.poll();
        assert_eq!(rig.names(), if deleted.is_ok() { vec!["two"] } else { vec!["one", "two"] });
    }
}

#[test]
fn c9_a_host_that_is_started_anew_is_not_answered_for_the_commit_of_its_predecessor() {
    let mut rig = rig();
    rig.send_parts("reach", &image("reach", 2.0, 10));
    assert_eq!(rig.ask(Request::UploadCommit), None);
    let commit = rig.sequence;
    rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
    // It dies, and begins anew with the number that it had.
    rig.wait(600);
    rig.sequence = 0;
    rig.greet();
    rig.session.store_mut().settle(Ok(()));
    let replies = said(&mut rig);
    assert!(!replies.contains(&Reply::Accepted { of: commit }), "{replies:?}");
}

#[test]
fn a_primitive_that_is_being_deleted_cannot_be_run() {
    let mut rig = rig();
    rig.send_parts("reach", &image("reach", 2.0, 10));
    rig.ask(Request::UploadCommit);
    rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    assert_eq!(rig.ask(Request::Delete { name: name("reach") }), None);
    rig.bench.state = State::Hold;
    let refused = rig.ask(Request::Run { name: name("reach"), options: Default::default() });
    assert!(matches!(refused, Some(Reply::Refused { reason: Refusal::StoreFailed, .. })), "{refused:?}");
    assert_eq!(rig.session.store_mut().take(&mut [0; SLOT_BYTES]), Some(Work::Delete { slot: 0 }));
    rig.session.store_mut().settle(Ok(()));
    rig.poll();
    let refused = rig.ask(Request::Run { name: name("reach"), options: Default::default() });
    assert!(matches!(refused, Some(Reply::Refused { reason: Refusal::NoSuchPrimitive, .. })), "{refused:?}");
}

#[test]
fn an_image_of_another_robot_model_is_listed_after_a_restart_but_not_run() {
    let foreign = image_with("old", 2.0, 10, |content| content.model_hash ^= 1);
    let mut library = Library::new();
    library.restore(1, &foreign);
    library.open(Opening { found: 1, ..Opening::default() });
    let mut rig = Rig::over(library);
    rig.greet();
    assert!(matches!(rig.ask(Request::List { index: 1 }), Some(Reply::Listing { listing: Some(_), .. })));
    rig.bench.state = State::Hold;
    let refused = rig.ask(Request::Run { name: name("old"), options: Default::default() });
    assert!(matches!(refused, Some(Reply::Refused { reason: Refusal::ImageModel, .. })), "{refused:?}");
}

#[test]
fn a_hello_waits_for_the_library_a_second_and_is_then_answered_without_it() {
    let mut rig = Rig::over(Library::new());
    rig.now_ms = 10;
    assert_eq!(rig.ask(Request::Hello(hello())), None, "nobody knows yet what is stored");
    rig.wait(989);
    assert_eq!(rig.answer(), None, "999 ms after its start");
    rig.wait(1);
    assert!(matches!(rig.answer(), Some(Reply::Hello { .. })));
    let refused = rig.ask(Request::List { index: 0 });
    assert!(matches!(refused, Some(Reply::Refused { reason: Refusal::StoreFailed, .. })), "{refused:?}");
    rig.session.store_mut().restore(2, &image("kept", 2.0, 10));
    rig.session.store_mut().open(Opening { found: 1, ..Opening::default() });
    rig.poll();
    assert!(matches!(rig.ask(Request::List { index: 2 }), Some(Reply::Listing { listing: Some(_), .. })));
}

#[test]
fn the_next_host_is_told_nothing_of_the_commit_of_the_one_that_is_gone() {
    let mut rig = rig();
    rig.send_parts("reach", &image("reach", 2.0, 10));
    assert_eq!(rig.ask(Request::UploadCommit), None);
    let mut copy = [0; SLOT_BYTES];
    assert!(rig.session.store_mut().take(&mut copy).is_some());
    let commit = rig.sequence;
    rig.done(Request::Goodbye);
    rig.number = 88;
    rig.greet();
    rig.session.store_mut().settle(Ok(()));
    let replies = said(&mut rig);
    assert!(replies.iter().all(|reply| reply.answers() != Some(commit)), "{replies:?}");
}
