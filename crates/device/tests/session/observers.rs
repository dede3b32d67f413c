//! Hosts that look on beside an owner: they are told everything, and can change nothing but stop.

use control::{Fault, State};
use device::{Command, EventKind};
use link::{HostHello, Name, Refusal, Reply, Request, RunOptions};

use crate::rig::{Rig, hello, image};

const OWNER: u16 = 77;
const OBSERVER: u16 = 88;

/// Speaks as the host with this session number from now on.
fn speak_as(rig: &mut Rig, number: u16) {
    rig.number = number;
}

/// A session with an owner and an observer; the observer speaks.
fn watched() -> Rig {
    let mut rig = Rig::greeted();
    speak_as(&mut rig, OBSERVER);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
    rig
}

/// Session numbers under which the cycles of a second of 300 were told.
fn told(rig: &mut Rig) -> Vec<(u16, u32)> {
    let before = rig.now_ms;
    for cycle in 0..300 {
        rig.cycle(cycle, Fault::None);
    }
    assert_eq!(before, rig.now_ms);
    let sent = rig.sent().into_iter();
    sent.filter_map(|frame| match frame.message {
        Reply::Telemetry(telemetry) => Some((frame.envelope.session, telemetry.cycle)),
        _ => None,
    })
    .collect()
}

#[test]
fn an_observer_asks_for_state_counters_listing_and_calibration_beside_the_owner_of_a_run() {
    let mut rig = Rig::greeted();
    rig.store("reach", &image("reach", 3.0, 5));
    rig.bench.state = State::Run;
    speak_as(&mut rig, OBSERVER);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
    assert!(matches!(rig.ask(Request::Status), Some(Reply::Status { .. })));
    assert!(matches!(rig.ask(Request::Statistics), Some(Reply::Statistics { .. })));
    assert!(matches!(rig.ask(Request::List { index: 0 }), Some(Reply::Listing { listing: Some(_), .. })));
    assert!(matches!(rig.ask(Request::Calibration), Some(Reply::Calibration { .. })));
    assert!(matches!(rig.ask(Request::Weight), Some(Reply::Weight { .. })));
    // As fast as others may ask beside an owner.
    rig.wait(10);
    assert!(matches!(rig.ask(Request::Owner), Some(Reply::Owner { owner: Some(_), .. })));
    rig.done(Request::Ping);
    rig.done(Request::Goodbye);
    assert_eq!(rig.refused(Request::Status).0, Refusal::NoSession);
    // And the owner has noticed nothing.
    speak_as(&mut rig, OWNER);
    rig.done(Request::Ping);
    assert!(rig.bench.commands.is_empty());
}

#[test]
fn an_observer_changes_nothing_but_may_stop() {
    let mut rig = watched();
    let reach = || Name::new("reach").unwrap();
    for request in [
        Request::Zero { home: [0.0; 7] },
        Request::Gravity,
        Request::Hold,
        Request::Approach { q: [0.0; 7], duration: 0.0 },
        Request::Run { name: reach(), options: RunOptions::default() },
        Request::ClearFault,
        Request::SetGoal(link::Goal::default()),
        Request::SetSpeed { factor: 1.0 },
        Request::UploadBegin { name: reach(), length: 100, crc: 0 },
        Request::UploadCommit,
        Request::UploadAbort,
        Request::Delete { name: reach() },
        Request::Rename { name: reach(), to: reach() },
        Request::Read { name: reach(), offset: 0 },
        Request::Release,
        Request::Tare,
        Request::InitialiseHand,
        Request::MoveHand { q: [0.0; 4], duration: 0.0 },
        Request::Calibrate { home: [0.0; 7] },
        Request::ForgetCalibration,
    ] {
        let word = request.name();
        // As fast as others may ask beside an owner.
        rig.wait(10);
        assert_eq!(rig.refused(request).0, Refusal::Observing, "{word}");
    }
    assert!(rig.bench.commands.is_empty());
    rig.commanded(Request::Stop);
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn every_cycle_goes_over_the_line_once_whoever_asked_for_it() {
    let mut rig = watched();
    rig.done(Request::Telemetry { every: 10 });
    let alone = told(&mut rig);
    assert_eq!(alone.len(), 30, "the owner asks for none");
    assert!(alone.iter().all(|(session, _)| *session == OBSERVER));

    speak_as(&mut rig, OWNER);
    rig.done(Request::Telemetry { every: 1 });
    assert!(told(&mut rig).iter().map(|(session, _)| *session).eq([OWNER; 300]));

    rig.done(Request::Telemetry { every: 15 });
    let both = told(&mut rig);
    assert_eq!(both.len(), 40, "every tenth and every fifteenth, each once");
    assert!(both.iter().all(|(session, cycle)| (*session == OWNER) == (cycle % 15 == 0)));
}

#[test]
fn events_are_told_to_an_observer_where_nobody_commands() {
    let mut rig = watched();
    speak_as(&mut rig, OWNER);
    rig.done(Request::Goodbye);
    rig.event(EventKind::Arrived);
    let sent = rig.sent();
    assert!(sent.iter().any(|frame| frame.envelope.session == OBSERVER && matches!(frame.message, Reply::Event(_))));
}

#[test]
fn an_observer_does_not_keep_a_motion_alive() {
    let mut rig = watched();
    rig.bench.state = State::Run;
    for _ in 0..5 {
        assert_eq!(rig.bench.commands, []);
        rig.wait(100);
        rig.ask(Request::Ping);
    }
    assert_eq!(rig.bench.commands, [Command::Control(control::Command::Stop)]);
}

#[test]
fn an_observer_that_is_silent_for_two_seconds_is_gone_and_its_stream_with_it() {
    let mut rig = watched();
    rig.done(Request::Telemetry { every: 1 });
    rig.wait(1999);
    assert_eq!(told(&mut rig).len(), 300);
    rig.wait(1);
    assert_eq!(told(&mut rig).len(), 0);
    assert_eq!(rig.refused(Request::Status).0, Refusal::NoSession);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
}

#[test]
fn a_third_observer_waits_until_one_is_gone() {
    let mut rig = watched();
    rig.wait(300);
    speak_as(&mut rig, 89);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })), "a repeated hello needs no room");
    speak_as(&mut rig, 90);
    assert_eq!(rig.refused(Request::Observe(hello())), (Refusal::Busy, [0, 1700]));
    rig.wait(1700);
    assert!(matches!(rig.ask(Request::Observe(hello())), Some(Reply::Hello { .. })));
}

#[test]
fn an_observer_that_says_hello_becomes_the_owner_when_nobody_is() {
    let mut rig = watched();
    assert_eq!(rig.refused(Request::Hello(hello())).0, Refusal::Busy);
    speak_as(&mut rig, OWNER);
    assert_eq!(rig.refused(Request::Observe(hello())).0, Refusal::BadValue, "it commands already");
    rig.done(Request::Goodbye);
    speak_as(&mut rig, OBSERVER);
    assert!(matches!(rig.ask(Request::Hello(hello())), Some(Reply::Hello { .. })));
    rig.commanded(Request::Hold);
}

#[test]
fn an_observer_of_another_version_is_told_so() {
    let mut rig = Rig::greeted();
    speak_as(&mut rig, OBSERVER);
    let old = HostHello { link_version: 5, ..hello() };
    assert_eq!(rig.refused(Request::Observe(old)).0, Refusal::LinkVersion);
}

#[test]
fn who_finds_the_device_busy_is_told_whose_it_is_and_since_when_but_not_the_number_of_the_session() {
    let owned = |rig: &mut Rig| match rig.ask(Request::Owner) {
        Some(Reply::Owner { owner, .. }) => owner,
        other => panic!("{other:?}"),
    };
    let mut rig = watched();
    let before = owned(&mut rig).expect("somebody has it");
    assert_eq!(before.name, hello().owner);
    rig.wait(300);
    assert_eq!(owned(&mut rig).map(|owner| owner.since_ms - before.since_ms), Some(300));
    speak_as(&mut rig, OWNER);
    assert!(owned(&mut rig).is_some(), "the owner may ask as well");
    rig.done(Request::Goodbye);
    speak_as(&mut rig, OBSERVER);
    assert_eq!(owned(&mut rig), None);
    speak_as(&mut rig, 77);
    assert_eq!(rig.refused(Request::Owner).0, Refusal::NoSession, "a stranger looks on first");
}
