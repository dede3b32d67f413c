//! Which primitive the control half holds, as the status tells it, through every change of the store.

use control::{Payload, State};
use device::storage::{Library, Opening};
use link::{Name, Reply, Request, RunOptions};

use crate::rig::{Rig, SLOT_BYTES, SLOTS, image};

fn name(text: &str) -> Name {
    Name::new(text).unwrap()
}

fn run(text: &str) -> Request {
    Request::Run { name: name(text), options: RunOptions::default() }
}

/// The name of the primitive in use.
fn in_use<S: device::Store>(rig: &mut Rig<S>) -> Option<String> {
    match rig.ask(Request::Status) {
        Some(Reply::Status { status, .. }) => status.loaded.map(|name| name.to_string()),
        other => panic!("no status but {other:?}"),
    }
}

#[test]
fn the_primitive_in_use_is_the_newest_or_that_of_the_last_run_until_its_name_is_gone() {
    let mut rig = Rig::greeted();
    assert_eq!(in_use(&mut rig), None);
    rig.store("reach", &image("reach", 3.0, 10));
    assert_eq!(in_use(&mut rig).as_deref(), Some("reach"));
    rig.store("push", &image("push", 4.0, 10));
    assert_eq!(in_use(&mut rig).as_deref(), Some("push"));
    rig.commanded(run("reach"));
    assert_eq!(in_use(&mut rig).as_deref(), Some("reach"));
    rig.done(Request::Delete { name: name("push") });
    assert_eq!(in_use(&mut rig).as_deref(), Some("reach"), "another one is gone");
    rig.done(Request::Rename { name: name("reach"), to: name("grasp") });
    assert_eq!(in_use(&mut rig), None);
    rig.commanded(run("grasp"));
    assert_eq!(in_use(&mut rig).as_deref(), Some("grasp"));
    rig.done(Request::Delete { name: name("grasp") });
    assert_eq!(in_use(&mut rig), None);
}

#[test]
fn a_run_goes_on_under_its_name_while_another_image_takes_it() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.commanded(run("reach"));
    rig.bench.state = State::Run;
    rig.store("reach", &image("reach", 4.0, 10));
    assert_eq!(in_use(&mut rig).as_deref(), Some("reach"));
    let Some(Reply::Listing { listing: Some(listing), .. }) = rig.ask(Request::List { index: 0 }) else { panic!() };
    assert!(!listing.loaded, "what is stored is not what runs");
}

#[test]
fn what_is_built_while_another_image_is_saved_is_not_taken_for_that_image() {
    let mut library: Library<SLOTS, SLOT_BYTES> = Library::new();
    library.open(Opening::default());
    let mut rig = Rig::over(library);
    rig.greet();
    for (text, duration) in [("push", 3.0), ("pull", 4.0), ("reach", 5.0)] {
        rig.send_parts(text, &image(text, duration, 10));
        assert_eq!(rig.ask(Request::UploadCommit), None);
        rig.session.store_mut().take(&mut [0; SLOT_BYTES]);
        if text == "reach" {
            // It takes the place of "reach" in the memory in which images are checked.
            rig.commanded(run("push"));
        }
        rig.session.store_mut().settle(Ok(()));
        rig.poll();
    }
    assert_eq!((in_use(&mut rig).as_deref(), rig.bench.loaded.last()), (Some("push"), Some(&3.0)));
}

#[test]
fn the_weight_of_the_links_is_handed_over_once() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    rig.bench.state = State::Idle;
    (0..5).for_each(|_| rig.poll());
    assert_eq!(rig.bench.weights.len(), 1);
    rig.store("push", &image("push", 3.0, 10));
    (0..5).for_each(|_| rig.poll());
    assert_eq!(rig.bench.weights.len(), 1);
}

/// The start-up has found another tool: the control half forgets what was checked for the old one, without a word.
#[test]
fn what_the_control_half_has_forgotten_is_in_use_no_longer() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 10));
    (rig.bench.payload, rig.bench.primitive) = (Payload::None, None);
    let Some(Reply::Listing { listing: Some(listing), .. }) = rig.ask(Request::List { index: 0 }) else { panic!() };
    assert!(!listing.loaded);
    assert_eq!(in_use(&mut rig), None);
}

/// The image that runs has been replaced, so that its name may go; it is told as long as it runs.
#[test]
fn a_name_that_goes_while_an_older_image_of_it_runs_is_in_use_until_the_run_is_over() {
    for gone in [Request::Delete { name: name("reach") }, Request::Rename { name: name("reach"), to: name("grasp") }] {
        let mut rig = Rig::greeted();
        rig.store("reach", &image("reach", 3.0, 10));
        rig.commanded(run("reach"));
        rig.bench.state = State::Run;
        rig.store("reach", &image("reach", 4.0, 10));
        rig.done(gone);
        assert_eq!(in_use(&mut rig).as_deref(), Some("reach"));
        rig.bench.state = State::Hold;
        assert_eq!(in_use(&mut rig), None, "there is none of this name");
    }
}
